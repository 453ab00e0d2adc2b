//! `muprime cases`: writes files of cases.

use super::faults::Scenes;
use super::prelude::*;
use models::ridge::Steady;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use studies::cases::file::{self, Header};
use studies::cases::kinds::{self, blind, diagnose, finger, noop, ridge, table};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Cases of the finite element model: from a table, or drawn evenly from a box
    Ridge(Ridge),
    /// The nodes of the surrogate's table, and those held out
    Table(To),
    /// Scenes of the fault bench, one a seed
    Faults(Faults),
    /// Sealed sets, to be diagnosed and scored
    Blind(Blind),
    /// Point tables or runs, to be diagnosed
    Diagnose(Diagnose),
    /// Phase tables of fingers, to be identified
    Finger(FingerArgs),
    /// Cases that only hash: for measuring an engine
    Noop(Noop),
}

#[derive(Debug, clap::Args)]
struct To {
    /// The file of cases
    #[arg(long, short = 'o', value_name = "FILE")]
    output: PathBuf,
}

#[derive(Debug, clap::Args)]
struct Ridge {
    #[command(flatten)]
    to: To,
    /// A table in CSV, a case a row: columns named as the variables of --span
    #[arg(long, conflicts_with_all = ["draw", "span"], required_unless_present = "draw")]
    from: Option<PathBuf>,
    /// How many cases to draw from the spans
    #[arg(long, requires = "span")]
    draw: Option<u64>,
    /// Number of the first draw: others are other cases
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// A variable from LOW to HIGH, with :log evenly in its logarithm (may be repeated)
    #[arg(long, value_name = "NAME=LOW..HIGH[:log]")]
    span: Vec<String>,
    /// A variable that all cases share (may be repeated)
    #[arg(long, value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Elements of each mesh, about
    #[arg(long, default_value_t = models::ridge::case::ELEMENTS)]
    elements: usize,
    /// Tolerance on mu' at which the cycles count as steady
    #[arg(long, default_value_t = 0.004)]
    tolerance: f64,
    /// Most cycles at full amplitude
    #[arg(long, default_value_t = 300)]
    at_most: usize,
}

#[derive(Debug, clap::Args)]
struct Faults {
    #[command(flatten)]
    to: To,
    #[command(flatten)]
    scenes: Scenes,
}

#[derive(Debug, clap::Args)]
struct Blind {
    #[command(flatten)]
    to: To,
    /// Number of sets
    #[arg(long, default_value_t = 100)]
    sets: u64,
    #[command(flatten)]
    settings: blind::BlindStudy,
}

#[derive(Debug, clap::Args)]
struct Diagnose {
    #[command(flatten)]
    to: To,
    /// Point tables, or folders of runs
    data: Vec<PathBuf>,
    /// A file that names further ones, a line each
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    /// One rig.toml for all; without it, that beside each table
    #[arg(long)]
    rig: Option<PathBuf>,
    #[command(flatten)]
    settings: diagnose::DiagnosisSettings,
}

#[derive(Debug, clap::Args)]
struct FingerArgs {
    #[command(flatten)]
    to: To,
    /// Phase tables, one a finger
    phases: Vec<PathBuf>,
    /// A file that names further ones, a line each
    #[arg(long, value_name = "FILE")]
    list: Option<PathBuf>,
    /// Frequency of tables without that column
    #[arg(long)]
    frequency_hz: Option<f64>,
    /// Normal force of tables without that column
    #[arg(long)]
    normal_force_n: Option<f64>,
    /// Identify the modulus alone
    #[arg(long)]
    modulus_only: bool,
    /// Elements of the ridge's mesh, about
    #[arg(long, default_value_t = models::ridge::case::ELEMENTS)]
    elements: usize,
}

#[derive(Debug, clap::Args)]
struct Noop {
    #[command(flatten)]
    to: To,
    /// How many cases
    #[arg(long)]
    cases: u64,
    #[command(flatten)]
    settings: noop::NoopSettings,
}

/// Files that were named, absolute: a study may stand elsewhere.
fn named(given: &[PathBuf], list: Option<&Path>) -> miette::Result<Vec<PathBuf>> {
    let mut all = given.to_vec();
    if let Some(list) = list {
        let bytes = runs::input::bytes_of(list, runs::input::MAX_TABLE_BYTES)?;
        let text = String::from_utf8(bytes).into_diagnostic().wrap_err_with(|| list.display().to_string())?;
        let lines = text.trim_start_matches('\u{feff}').lines().map(str::trim);
        all.extend(lines.filter(|l| !l.is_empty()).map(PathBuf::from));
    }
    if all.is_empty() {
        miette::bail!("no files: name them, or a file that lists them with --list");
    }
    let absolute = |p: PathBuf| p.canonicalize().into_diagnostic().wrap_err_with(|| p.display().to_string());
    all.into_iter().map(absolute).collect()
}

/// A line for each file that was named.
fn lines<L: Serialize>(
    given: &[PathBuf],
    list: Option<&Path>,
    line: impl Fn(PathBuf) -> L,
) -> miette::Result<Vec<Value>> {
    let line = |path| serde_json::to_value(line(path)).into_diagnostic();
    named(given, list)?.into_iter().map(line).collect()
}

/// The settings of `--set`.
pub(crate) fn values(list: &[String]) -> miette::Result<BTreeMap<String, f64>> {
    named_values("--set", "NAME=VALUE", list, |value| value.trim().parse().ok())
}

/// What an option states by names, each as `NAME=...`.
fn named_values<T>(
    option: &str,
    form: &str,
    list: &[String],
    parsed: impl Fn(&str) -> Option<T>,
) -> miette::Result<BTreeMap<String, T>> {
    let entry = |text: &String| {
        let (name, value) = text.split_once('=')?;
        Some((name.trim().to_string(), parsed(value)?))
    };
    let mut all = BTreeMap::new();
    for text in list {
        let wrong = || miette::miette!("{option} {text}: {form} is needed");
        let (name, value) = entry(text).ok_or_else(wrong)?;
        let is_new = all.insert(name, value).is_none();
        miette::ensure!(is_new, help = "leave out one of the two", "{option} {text}: stated a second time");
    }
    Ok(all)
}

/// The spans of `--span`.
pub(crate) fn spans(list: &[String]) -> miette::Result<BTreeMap<String, ridge::ValueRange>> {
    named_values("--span", "NAME=LOW..HIGH or NAME=LOW..HIGH:log", list, |text| {
        let (ends, log) = text.strip_suffix(":log").map_or((text, false), |ends| (ends, true));
        let (low, high) = ends.split_once("..")?;
        Some(ridge::ValueRange { low: low.trim().parse().ok()?, high: high.trim().parse().ok()?, log })
    })
}

/// The rows of a table of variables, where all cases share `base`.
fn rows(path: &Path, base: &BTreeMap<String, f64>) -> miette::Result<Vec<Value>> {
    let bytes = runs::input::bytes_of(path, runs::input::MAX_TABLE_BYTES)?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let (mut all, mut names) = (Vec::new(), base.clone());
    for name in reader.headers().into_diagnostic().wrap_err_with(|| path.display().to_string())? {
        let is_new = names.insert(name.to_string(), 0.0).is_none();
        let help = "state it in one column, or with --set";
        miette::ensure!(is_new, help = help, "{}: line 1: '{name}' is stated twice", path.display());
    }
    for row in reader.deserialize::<BTreeMap<String, f64>>() {
        let row = row.into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        ridge::set(models::ridge::RidgeCase::paper(), &row).wrap_err_with(|| path.display().to_string())?;
        all.push(serde_json::to_value(row).into_diagnostic()?);
    }
    Ok(all)
}

/// Writes the file, after its cases have been looked at as the worker will.
fn write(
    kind: &str,
    to: &To,
    cases: u64,
    settings: &impl Serialize,
    lines: Option<&[Value]>,
    json: bool,
) -> miette::Result<ExitCode> {
    let kind = kinds::by_name(kind)?;
    let count = lines.map_or(cases, |lines| lines.len() as u64);
    let header = Header { listed: lines.is_some(), ..Header::of(kind, settings, count)? };
    if header.cases == 0 {
        miette::bail!("no cases");
    }
    let make = (kind.prepare)(&header, Path::new("/"))?;
    match lines {
        Some(lines) => (0..).zip(lines).try_for_each(|(i, line)| make(i, Some(line)).map(drop))?,
        None => drop(make(header.cases - 1, None)?),
    }
    file::write(&to.output, header.clone(), lines)?;
    let document = json!({ "file": to.output, "kind": kind.name, "cases": header.cases });
    let words = format!("{}: {} cases: {}", to.output.display(), header.cases, kind.words);
    answered(json, &document, words)
}

/// Writes a file of cases; refused: what is no case, with the place.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    match args.what {
        What::Ridge(a) => {
            let steady = Steady { tolerance: a.tolerance, at_most: a.at_most, ..Steady::default() };
            let (elements, base, spans) = (a.elements, values(&a.set)?, spans(&a.span)?);
            let lines = a.from.as_deref().map(|path| rows(path, &base)).transpose()?;
            let settings = ridge::RidgeSettings { elements, steady, base, spans, first: a.first, case: None };
            settings.check_spans()?;
            write("ridge", &a.to, a.draw.unwrap_or(0), &settings, lines.as_deref(), json)
        }
        What::Table(to) => write("table", &to, table::points().len() as u64, &Value::Null, None, json),
        What::Faults(a) => write("faults", &a.to, a.scenes.seeds, &a.scenes.settings(), None, json),
        What::Blind(a) => write("blind", &a.to, a.sets, &a.settings, None, json),
        What::Diagnose(a) => {
            let rig = a.rig.map(|p| named(&[p], None)).transpose()?.and_then(|mut all| all.pop());
            let line = |data| diagnose::Line { data, rig: rig.clone() };
            let lines = lines(&a.data, a.list.as_deref(), line)?;
            write("diagnose", &a.to, 0, &a.settings, Some(&lines), json)
        }
        What::Finger(a) => {
            let (frequency_hz, normal_force_n) = (a.frequency_hz, a.normal_force_n);
            let line = |phases| finger::Line { phases, frequency_hz, normal_force_n };
            let lines = lines(&a.phases, a.list.as_deref(), line)?;
            let (elements, modulus_only) = (a.elements, a.modulus_only);
            let settings = finger::FingerSettings { elements, modulus_only, ..Default::default() };
            write("finger", &a.to, 0, &settings, Some(&lines), json)
        }
        What::Noop(a) => write("noop", &a.to, a.cases, &a.settings, None, json),
    }
}

#[cfg(test)]
mod tests {
    use super::named;

    /// The first file of such a list was not found.
    #[test]
    fn a_byte_order_mark_is_no_part_of_a_list() {
        let folder = tempfile::tempdir().unwrap();
        let (list, run) = (folder.path().join("list.txt"), folder.path().canonicalize().unwrap());
        std::fs::write(&list, format!("\u{feff}{}\n", run.display())).unwrap();
        assert_eq!(named(&[], Some(&list)).unwrap(), [run]);
    }
}
