//! `muprime blind`: the diagnosis scored on sealed sets.

use crate::blind::{confusion, figures, run as score_all};
use diagnosis::hypotheses::Options;
use miette::IntoDiagnostic;
use sim::sealed::Stratum;
use std::process::ExitCode;

/// Score the diagnosis on sealed sets of the independent simulation.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Number of sets.
    #[arg(long, default_value_t = 100)]
    pub sets: usize,
    /// Seed of the first set.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// One stratum only: none, single, pair, alias or outside; all in their shares without it.
    #[arg(long)]
    pub stratum: Option<String>,
    /// Try single effects only.
    #[arg(long)]
    pub no_pairs: bool,
    /// Leave an effect out of the library (may be repeated).
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
    /// Write the sets to this folder (open and sealed parts apart) for other diagnosers; none is scored.
    #[arg(long, value_name = "DIR")]
    pub write: Option<std::path::PathBuf>,
    /// Print one line a set on stderr.
    #[arg(long)]
    pub verbose: bool,
}

/// Makes, diagnoses and scores the sets.
///
/// # Errors
/// An unknown stratum.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let stratum = match args.stratum.as_deref() {
        None => None,
        Some("none") => Some(Stratum::None),
        Some("single") => Some(Stratum::Single),
        Some("pair") => Some(Stratum::Pair),
        Some("alias") => Some(Stratum::Alias),
        Some("outside") => Some(Stratum::Outside),
        Some(other) => miette::bail!("--stratum {other}: none, single, pair, alias or outside is needed"),
    };
    if let Some(folder) = &args.write {
        for set in crate::blind::sets(args.seed, args.sets, stratum) {
            let name = format!("{:06}", set.label.seed % 1_000_003);
            set.write(&folder.join("open").join(&name), &folder.join("sealed").join(&name))
                .into_diagnostic()?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    let options = Options { pairs: !args.no_pairs, without: args.without.clone(), ..Options::default() };
    let scored = score_all(args.seed, args.sets, stratum, &options, |s| {
        if args.verbose {
            eprintln!("{}", serde_json::to_string(s).unwrap_or_default());
        }
    })?;
    let figures = figures(&scored);
    let confusion = confusion(&scored);
    if json {
        let document = serde_json::json!({
            "schema": "muprime.blind/1", "seed": args.seed, "sets": args.sets,
            "figures": figures, "confusion": confusion, "scored": scored,
        });
        println!("{}", serde_json::to_string(&document).into_diagnostic()?);
    } else {
        println!("{:52} {:>8}  {:>17}  {:>5}  target", "figure", "value", "95 % interval", "n");
        for f in &figures {
            let value = f.value.map_or_else(|| "-".to_string(), |v| format!("{v:.3}"));
            let ci = f.ci95.map_or_else(|| "-".to_string(), |c| format!("[{:.3}, {:.3}]", c[0], c[1]));
            println!("{:52} {value:>8}  {ci:>17}  {:>5}  {}", f.name, f.n, f.target);
        }
        println!("\ntruth -> answers");
        for (truth, answers) in &confusion {
            let list: Vec<String> = answers.iter().map(|(a, n)| format!("{a} {n}")).collect();
            println!("  {truth:40} {}", list.join("; "));
        }
    }
    Ok(ExitCode::SUCCESS)
}
