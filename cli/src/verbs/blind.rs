//! `muprime blind`: the diagnosis scored on sealed sets.

mod noise;

use super::prelude::*;
use clap::builder::RangedU64ValueParser;
use studies::cases::kinds::blind::run as score_all;
use studies::progress::Study;
use studies::validation::blind::distance::by_cause;
use studies::validation::blind::reliability::{diagram, identifiable};
use studies::validation::blind::{BlindStudy, Scored, confusion, figures};

/// Score the diagnosis on sealed sets of the independent simulation.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Number of sets.
    #[arg(long, default_value_t = 100, value_parser = RangedU64ValueParser::<usize>::new().range(1..))]
    pub sets: usize,
    #[command(flatten)]
    pub of: BlindStudy,
    /// Write the sets to this folder (open and sealed parts apart) for other diagnosers; none is scored.
    #[arg(long, value_name = "DIR")]
    pub write: Option<std::path::PathBuf>,
    /// Instead: sets whose scatter is not what rig.toml states: gaussian, heavy, serial, gross, understated,
    /// runs, or all; so many of each truth (none, a squeeze film, friction that depends on load, an offset).
    #[arg(long, value_name = "KIND", conflicts_with_all = ["write", "stratum"])]
    pub noise: Option<String>,
    /// Instead: the table of constants, as docs/diagnosis/constants.md has it.
    #[arg(long, hide = true)]
    pub constants: bool,
    /// Print one line a set on stderr.
    #[arg(long)]
    pub verbose: bool,
}

/// Makes, diagnoses and scores the sets; fails without thread or signals for Ctrl-C, and on a set that cannot
/// be made or written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let stratum = args.of.stratum;
    if let Some(folder) = &args.write {
        empty(folder)?;
        let (sets, to) = (args.sets, folder.display().to_string());
        let study = Study::begin(sets as u64, "sets", move |_: Vec<()>, done| {
            if json {
                answer_json(&json!({ "partial": true, "written": done, "sets": sets }));
            } else {
                out!("partial: {done} of {sets} sets are in {to}");
            }
        })?;
        for set in studies::validation::blind::sets(args.of.seed, sets, stratum) {
            let name = format!("{:06}", set.label.seed % 1_000_003);
            set.write(&folder.join("open").join(&name), &folder.join("sealed").join(&name))
                .into_diagnostic()?;
            study.done(None);
        }
        return Ok(ExitCode::SUCCESS);
    }
    if args.constants {
        out!("{}", diagnosis::constants::markdown().trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    if let Some(kind) = args.noise.as_deref() {
        return noise::run(&args, kind, json);
    }
    let (seed, sets) = (args.of.seed, args.sets);
    let study = Study::begin(sets as u64, "sets", move |scored: Vec<Scored>, done| {
        if !json {
            out!("partial: {done} of {sets} sets");
        }
        tell(&scored, seed, sets, true, json);
    })?;
    let scored = score_all(&args.of, sets as u64, &mut |s| {
        if args.verbose {
            study.bar.suspend(|| say!("{}", serde_json::to_string(s).unwrap_or_default()));
        }
        study.done(Some(s.clone()));
    })?;
    drop(study);
    tell(&scored, seed, sets, false, json);
    Ok(ExitCode::SUCCESS)
}

/// The folder for the sets is new or holds nothing: what is there is not replaced.
fn empty(folder: &Path) -> miette::Result<()> {
    if std::fs::read_dir(folder).is_ok_and(|mut found| found.next().is_none()) || !folder.exists() {
        return Ok(());
    }
    let help = "give an empty or new folder as --write";
    miette::bail!(help = help, "{} exists and is not an empty folder: nothing was replaced", folder.display())
}

/// Figures and answers of the sets that were scored.
fn tell(scored: &[Scored], seed: u64, sets: usize, partial: bool, json: bool) {
    let figures = figures(scored);
    let confusion = confusion(scored);
    if json {
        let mut document = json!({
            "schema": "muprime.blind/1", "seed": seed, "sets": sets,
            "figures": figures, "reliability": diagram(scored.iter()),
            "reliability_of_what_can_be_told": diagram(scored.iter().filter(|s| identifiable(s))),
            "distances": by_cause(scored), "confusion": confusion, "scored": scored,
        });
        if partial {
            document["partial"] = true.into();
        }
        return answer_json(&document);
    }
    out!("{:52} {:>8}  {:>17}  {:>5}  target", "figure", "value", "95 % interval", "n");
    for f in &figures {
        let value = f.value.map_or_else(|| "-".to_string(), |v| format!("{v:.3}"));
        let ci = f.ci95.map_or_else(|| "-".to_string(), |c| format!("[{:.3}, {:.3}]", c[0], c[1]));
        out!("{:52} {value:>8}  {ci:>17}  {:>5}  {}", f.name, f.n, f.target);
    }
    out!("\ntruth -> answers");
    for (truth, answers) in &confusion {
        let list: Vec<String> = answers.iter().map(|(a, n)| format!("{a} {n}")).collect();
        out!("  {truth:40} {}", list.join("; "));
    }
    out!("\ncause: distance from the library's nearest law, median (sets)");
    for (cause, (distance, sets)) in by_cause(scored) {
        out!("  {cause:28} {distance:.3} ({sets})");
    }
    let identifiable_only = diagram(scored.iter().filter(|s| identifiable(s)));
    for (title, bins) in [("all sets", diagram(scored.iter())), ("identifiable sets", identifiable_only)] {
        out!("\nentries of the lists, {title}: stated probability, share that is right");
        for b in bins {
            let ([from, to], [low, high]) = (b.from_to, b.ci95);
            let (stated, right, n) = (b.stated, b.observed, b.entries);
            out!("  {from:5.3} to {to:5.3}  {stated:.4}  {right:.4} [{low:.4}, {high:.4}]  n {n}");
        }
    }
}
