//! The diagnosis of one table a case: a laboratory's archive. The key holds the contents of table and rig.toml, not their names.

use super::{Case, CaseKind, Cell, count, line, number, text, word};
use crate::cases::file::Header;
use calibration::certificate::sha256_hex;
use diagnosis::Options;
use diagnosis::report::document::document;
use miette::Context;
use runs::input::{MAX_TABLE_BYTES, bytes_of, rig_text, text_of};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tables::diagnose::{Subject, inputs};
use tables::passes::parse_passes;

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "diagnose",
    words: "the diagnosis of a point table or of a run's folder, as `muprime diagnose` makes it",
    model: 1,
    columns: &[
        text("verdict", "named, ambiguous, unknown or no_gap"),
        text("leading", "effects of the first hypothesis, joined by +; empty for no gap"),
        number("probability", "its probability"),
        number("shrinkage", "shrinkage of the removable gap"),
        number("unexplained_share", "share of the gap that is left"),
        count("points", "passes of the table"),
        text("document", "the verdict as `muprime diagnose --json` has it"),
    ],
    prepare,
};

/// A line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// A point table, or a run's folder; relative paths are to the file of cases.
    pub data: PathBuf,
    /// What the rig's calibration states; the rig.toml beside the table if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<PathBuf>,
}

/// What all cases share, and options of the command line.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, clap::Args)]
#[serde(default, deny_unknown_fields)]
pub struct DiagnosisSettings {
    /// Try single effects only
    #[arg(long)]
    pub no_pairs: bool,
    /// Leave an effect out of the library (may be repeated)
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
    /// One candidate effect more, of your own, as for `muprime diagnose` (may be repeated)
    #[arg(long, value_name = "FILE")]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effect: Vec<PathBuf>,
}

fn prepare(header: &Header, folder: &Path) -> miette::Result<super::Make> {
    let settings: DiagnosisSettings = super::settings(header)?;
    if let Some(name) = settings.without.iter().find(|name| effects::by_name(name).is_none()) {
        miette::bail!("without {name}: no such effect; `muprime model effects` lists them");
    }
    let files: Vec<PathBuf> = settings.effect.iter().map(|file| folder.join(file)).collect();
    let own = tables::law::own_effects(&files)?;
    let tables = own.iter().filter_map(|e| effects::at(*e).own).map(|own| sha256_hex(own.text.as_bytes()));
    let rest = serde_json::to_string(&settings).unwrap_or_default() + &tables.collect::<String>();
    let folder = folder.to_path_buf();
    Ok(Box::new(move |index, given| {
        let case: Line = line(index, given)?;
        let data = folder.join(&case.data);
        let (table_path, rig_path) = inputs(&data, case.rig.map(|rig| folder.join(rig)));
        // What cannot be read is no answer about the table: the case is not run, and another try may read it.
        let bytes = bytes_of(&table_path, MAX_TABLE_BYTES)
            .wrap_err_with(|| format!("case {index}: cannot read the table {}", table_path.display()))?;
        let rig = text_of(&rig_path)
            .wrap_err_with(|| format!("case {index}: cannot read the rig's calibration"))?;
        let damage = if data.is_dir() { runs::run_dir::damage_in(&data)? } else { Vec::new() };
        let inputs = format!("{} {} {rest} {damage:?}", sha256_hex(&bytes), sha256_hex(rig.as_bytes()));
        let (settings, own) = (settings.clone(), own.clone());
        let run = move || {
            // The file's own name says nothing of its contents: a reason holds none.
            let plain =
                |why: miette::Report| why.chain().map(ToString::to_string).collect::<Vec<_>>().join(": ");
            let rig = rig_text("rig.toml", &rig).map_err(plain)?;
            let passes = parse_passes(&table_path, &bytes)
                .map_err(|why| plain(why).replace(&table_path.display().to_string(), "table"))?;
            let subject = Subject::of(passes, &bytes, rig).map_err(|why| why.to_string())?;
            let (pairs, without) = (!settings.no_pairs, settings.without.clone());
            let options = Options { pairs, without, own, ..Options::default() };
            let result = subject.diagnose(options, None).map_err(plain)?;
            let first = result.report.hypotheses.first();
            Ok(vec![
                word(result.report.verdict)?.into(),
                first.map(|h| h.effects.join("+")).into(),
                first.map(|h| h.probability).into(),
                result.report.gap.shrinkage.into(),
                result.report.gap.unexplained_share.into(),
                Cell::Count(subject.passes.len() as u64),
                document(&result, &subject.rig, &damage).map_err(|why| why.to_string())?.into(),
            ])
        };
        Ok(Case { inputs, run: Box::new(run) })
    }))
}
