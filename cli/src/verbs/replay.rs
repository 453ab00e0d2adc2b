//! `muprime replay`: a recorded run through the same cycle again.

use super::prelude::*;
use models::law::Rendering;
use models::{BuiltIn, FrictionModel};
use realtime::recorder::{CYCLES, Entry, Integrity, Reader, inspect};
use realtime::replay::{Replay, replay};
use runs::job::{REPLAYABLE, Replayable, TARGET};
use runs::run_dir::{missing_records, records_in};
use std::fs::File;
use std::io::BufReader;
use std::sync::Arc;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of a run, or one of its records
    run: PathBuf,
}

/// What a replay of one record came to.
#[derive(serde::Serialize)]
struct ReplayResult {
    record: PathBuf,
    replay: Replay,
    /// What the record has lost, and where.
    integrity: Integrity,
    /// Every cycle that is known of is there, and was decided as recorded.
    holds: bool,
}

/// Runs every cycle of every record of a run again, and compares its decisions with those recorded, bit for
/// bit. It holds only where the record is whole, or was made whole by `recover` and no message is known to be
/// missing. Refused: a record that cannot be read, or that lacks what a replay needs.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    super::must_exist(&args.run, "run or recording")?;
    let (records, gone) = if args.run.is_dir() {
        (records_in(&args.run)?, missing_records(&args.run)?)
    } else {
        (vec![args.run.clone()], Vec::new())
    };
    if records.is_empty() {
        miette::bail!("{} holds no record", args.run.display());
    }
    let mut holds = gone.is_empty();
    for path in records {
        let found = again(path)?;
        holds &= found.holds;
        if json {
            answer_json(&found);
        } else {
            tell(&found);
        }
    }
    gone.iter().for_each(|sentence| say!("{sentence}"));
    exit(if holds { DONE } else { FAILED })
}

fn tell(found: &ReplayResult) {
    let Replay { cycles, equal, missing, first_difference } = &found.replay;
    out!("{}: {equal} of {cycles} cycles decide as recorded", found.record.display());
    found.integrity.sentences().iter().for_each(|sentence| out!("  {sentence}"));
    if *missing > found.integrity.missing(CYCLES) {
        out!("  {missing} cycles are missing from the record");
    }
    if *missing > 0 {
        out!("  what follows missing cycles cannot be expected to agree");
    }
    if let Some(cycle) = first_difference {
        out!("  the first that differs is cycle {cycle}");
    }
}

fn again(path: PathBuf) -> miette::Result<ReplayResult> {
    let shown = path.display().to_string();
    let reader = || {
        let file = File::open(&path).into_diagnostic().wrap_err_with(|| shown.clone())?;
        Ok::<_, miette::Report>(Reader::new(BufReader::new(file)).only(CYCLES))
    };
    // The files come first: what follows the first row holds none.
    let files: Vec<(String, Vec<u8>)> = reader()?
        .take_while(|entry| !matches!(entry, Entry::Message { .. }))
        .filter_map(|entry| match entry {
            Entry::File { name, bytes, .. } => Some((name, bytes)),
            _ => None,
        })
        .collect();
    let Some((_, built)) = files.iter().find(|f| f.0 == REPLAYABLE) else {
        let found = inspect(BufReader::new(File::open(&path).into_diagnostic()?)).sentences().join("; ");
        let help = "give a run's folder, or its run-1.mcap";
        miette::bail!(help = help, "{shown} is not a recording of a run: it holds no {REPLAYABLE} ({found})");
    };
    let built: Replayable = serde_json::from_slice(built)
        .into_diagnostic()
        .wrap_err_with(|| format!("{REPLAYABLE} in {shown}"))?;
    let model = model_of(&files, &built)?;
    let mut entries = reader()?;
    let rows = entries.by_ref().filter_map(|entry| match entry {
        Entry::Message { text, .. } => serde_json::from_slice(&text).ok(),
        _ => None,
    });
    let mut replayed = replay(&built.config, &*model, rows);
    let integrity = entries.integrity().clone();
    // Cycles that the last words count and that never came stand behind the last that did.
    replayed.missing = replayed.missing.max(integrity.missing(CYCLES));
    let holds = replayed.holds() && integrity.intact() && integrity.missing.is_empty();
    Ok(ReplayResult { record: path, replay: replayed, integrity, holds })
}

fn model_of(files: &[(String, Vec<u8>)], built: &Replayable) -> miette::Result<Arc<dyn FrictionModel>> {
    let file = files.iter().find(|(name, _)| runs::job::is_model(name));
    let law = match (file, built.law) {
        (Some((name, text)), _) => {
            runs::model_file::law(&built.finger, name, &String::from_utf8_lossy(text))?
        }
        (None, law) => law.unwrap_or(BuiltIn::SpringSlider).law(&built.finger).into_diagnostic()?,
    };
    let Some((_, target)) = files.iter().find(|(name, _)| name == TARGET) else { return Ok(law) };
    let target = serde_json::from_slice(target).into_diagnostic().wrap_err(TARGET)?;
    Ok(Arc::new(Rendering { law, target }))
}
