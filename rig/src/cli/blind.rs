//! `muprime blind`: the diagnosis scored on sealed sets.

use crate::validation::blind::distance::by_cause;
use crate::validation::blind::reliability::{diagram, told};
use crate::validation::blind::{confusion, figures, run as score_all};
use crate::{out, say};
use diagnosis::constants::{Constants, Row, Stage};
use diagnosis::hypotheses::Options;
use miette::IntoDiagnostic;
use sim::sealed::Stratum;
use std::process::ExitCode;
use std::sync::Arc;

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
    /// Instead: how often the intervals of the size cover on sets of the library's own forms.
    #[arg(long, conflicts_with_all = ["further", "write", "stratum"])]
    pub same_form: bool,
    /// Instead: designed next experiments against random ones.
    #[arg(long, conflicts_with_all = ["write", "stratum"])]
    pub further: bool,
    /// Instead: sets whose scatter is not what rig.toml states: gaussian, heavy, serial, gross, understated, runs, or all; so
    /// many of each truth (none, a squeeze film, friction that depends on load, an offset).
    #[arg(long, value_name = "KIND", conflicts_with_all = ["further", "write", "same_form", "stratum"])]
    pub noise: Option<String>,
    /// Set a constant of the diagnosis for this study (may be repeated); docs/diagnosis/constants.md lists them.
    #[arg(long, value_name = "NAME=VALUE", hide = true)]
    pub constant: Vec<String>,
    /// Instead: the verdicts with each constant halved and doubled. `fit`, `decision` or a name restricts it.
    #[arg(long, value_name = "WHICH", num_args = 0..=1, default_missing_value = "all", hide = true,
          conflicts_with_all = ["further", "write", "same_form"])]
    pub sensitivity: Option<String>,
    /// Instead: the table of constants, as docs/diagnosis/constants.md has it.
    #[arg(long, hide = true)]
    pub constants: bool,
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
        for set in crate::validation::blind::sets(args.seed, args.sets, stratum) {
            let name = format!("{:06}", set.label.seed % 1_000_003);
            set.write(&folder.join("open").join(&name), &folder.join("sealed").join(&name))
                .into_diagnostic()?;
        }
        return Ok(ExitCode::SUCCESS);
    }
    if args.constants {
        out!("{}", diagnosis::constants::markdown().trim_end());
        return Ok(ExitCode::SUCCESS);
    }
    if args.same_form {
        return same_form(&args, json);
    }
    if args.further {
        return further(&args, json);
    }
    let mut constants = Constants::default();
    for setting in &args.constant {
        let (name, value) = setting
            .split_once('=')
            .ok_or_else(|| miette::miette!("--constant {setting}: NAME=VALUE is needed"))?;
        constants.set(name.trim(), value).map_err(|e| miette::miette!("--constant {setting}: {e}"))?;
    }
    let options =
        Options { constants: Arc::new(constants), pairs: !args.no_pairs, without: args.without.clone() };
    if let Some(kind) = args.noise.as_deref() {
        return rough(&args, kind, &options, json);
    }
    if let Some(asked) = args.sensitivity.as_deref() {
        return sensitivity(&args, asked, stratum, &options, json);
    }
    let scored = score_all(args.seed, args.sets, stratum, &options, |s| {
        if args.verbose {
            say!("{}", serde_json::to_string(s).unwrap_or_default());
        }
    })?;
    let figures = figures(&scored);
    let confusion = confusion(&scored);
    if json {
        let document = serde_json::json!({
            "schema": "muprime.blind/1", "seed": args.seed, "sets": args.sets,
            "figures": figures, "reliability": diagram(scored.iter()),
            "reliability_of_what_can_be_told": diagram(scored.iter().filter(|s| told(s))),
            "distances": by_cause(&scored), "confusion": confusion, "scored": scored,
        });
        out!("{}", serde_json::to_string(&document).into_diagnostic()?);
    } else {
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
        for (cause, (distance, sets)) in by_cause(&scored) {
            out!("  {cause:28} {distance:.3} ({sets})");
        }
        let told_only = diagram(scored.iter().filter(|s| told(s)));
        for (title, bins) in [("all sets", diagram(scored.iter())), ("what can be told", told_only)] {
            out!("\nentries of the lists, {title}: stated probability, share that is right");
            for b in bins {
                let ([from, to], [low, high]) = (b.from_to, b.ci95);
                out!(
                    "  {from:5.3} to {to:5.3}  {:.4}  {:.4} [{low:.4}, {high:.4}]  n {}",
                    b.stated,
                    b.observed,
                    b.entries
                );
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Answers on scatter that is not what rig.toml states.
fn rough(args: &Args, kind: &str, options: &Options, json: bool) -> miette::Result<ExitCode> {
    use crate::validation::blind::rough::{Answers, TRUTHS, run};
    use sim::sealed::rough::{RoughSet, Roughness};
    let picked: Vec<_> =
        Roughness::ALL.into_iter().filter(|(name, _)| kind == "all" || kind == *name).collect();
    if picked.is_empty() {
        let names: Vec<&str> = Roughness::ALL.iter().map(|k| k.0).collect();
        miette::bail!("--noise {kind}: {} or all is needed", names.join(", "));
    }
    let mut rows: Vec<Answers> = Vec::new();
    if !json {
        out!(
            "| scatter | truth | sets | right | wrong | ambiguous | unknown | missed | bad passes found | others suspect |"
        );
        out!("|---|---|---|---|---|---|---|---|---|---|");
    }
    let each = |seed: u64, set: &RoughSet, report: &diagnosis::verdict::Report| {
        if args.verbose {
            let suspects: Vec<u64> = report.scatter.suspects.iter().map(|s| s.point).collect();
            let (s, text) = (&report.scatter, &report.text);
            say!(
                "{seed}: bad {:?}, suspect {suspects:?}, together {:?}, scale {:.2}, runs {:?}, correlation {:.2}; {text}",
                set.bad,
                s.together_in,
                s.scale,
                s.run_relative_sd,
                s.serial_correlation
            );
        }
    };
    for kind in picked {
        for a in run(args.seed, args.sets, kind, &TRUTHS, options, each)? {
            if !json {
                let (found, others) = (format!("{}/{}", a.found, a.bad), format!("{}/{}", a.falsely, a.good));
                out!(
                    "| {} | {} | {} | {} | {} | {} | {} | {} | {found} | {others} |",
                    a.noise,
                    a.truth,
                    a.sets,
                    a.right,
                    a.wrong,
                    a.ambiguous,
                    a.unknown,
                    a.missed
                );
            }
            rows.push(a);
        }
    }
    if json {
        let document = serde_json::json!({
            "schema": "muprime.blind.noise/1", "seed": args.seed, "sets": args.sets, "rows": rows,
        });
        out!("{}", serde_json::to_string(&document).into_diagnostic()?);
    }
    Ok(ExitCode::SUCCESS)
}

/// Verdicts with each constant halved and doubled.
fn sensitivity(
    args: &Args,
    asked: &str,
    stratum: Option<Stratum>,
    options: &Options,
    json: bool,
) -> miette::Result<ExitCode> {
    let picked = |row: &Row| match asked {
        "all" => true,
        "fit" => row.stage == Stage::Fit,
        "decision" => row.stage == Stage::Decision,
        name => row.name == name,
    };
    if !options.constants.rows().iter().any(picked) {
        miette::bail!("--sensitivity {asked}: fit, decision, the name of a constant, or nothing is needed");
    }
    let rows = crate::validation::blind::sensitivity::run(args.seed, args.sets, stratum, options, &picked)?;
    if json {
        let document = serde_json::json!({
            "schema": "muprime.blind.sensitivity/1", "seed": args.seed, "sets": args.sets, "rows": rows,
        });
        out!("{}", serde_json::to_string(&document).into_diagnostic()?);
        return Ok(ExitCode::SUCCESS);
    }
    out!("| constant | factor | right | misnamed | changed | probability on the truth | n |");
    out!("|---|---|---|---|---|---|---|");
    for r in rows {
        out!(
            "| `{}` | {} | {} | {} | {} | {:.3} | {} |",
            r.constant,
            r.factor,
            r.right,
            r.misnamed,
            r.changed,
            r.probability,
            r.sets
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Coverage of the size's interval, and how many sets were named in their own form.
fn same_form(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let sets = crate::validation::blind::same_form::run(args.seed, args.sets)?;
    let stated: Vec<(f64, [f64; 2])> = sets.iter().filter_map(|s| Some((s.truth, s.ci95?))).collect();
    let covered = stated.iter().map(|(t, ci)| ci[0] <= *t && *t <= ci[1]).collect();
    let figure =
        crate::validation::blind::share("size inside its 95 % interval, same form", "0.92 to 0.98", covered);
    if json {
        let document =
            serde_json::json!({ "schema": "muprime.blind.same_form/1", "figure": figure, "sets": sets });
        out!("{}", serde_json::to_string(&document).into_diagnostic()?);
    } else {
        let ci = figure.ci95.unwrap_or([f64::NAN; 2]);
        out!(
            "{}: {:.3} [{:.3}, {:.3}], n {} of {} sets (the others were not named in their own form)",
            figure.name,
            figure.value.unwrap_or(f64::NAN),
            ci[0],
            ci[1],
            figure.n,
            sets.len()
        );
    }
    Ok(ExitCode::SUCCESS)
}

/// Passes until a probability of 0.9, designed and at random.
fn further(args: &Args, json: bool) -> miette::Result<ExitCode> {
    use crate::validation::blind::further::{self, LIMIT};
    let each = |r: &further::Race| {
        let passes = |n: Option<usize>| n.map_or(format!("> {LIMIT}"), |n| n.to_string());
        let (designed, random) = (passes(r.designed), passes(r.random));
        if args.verbose {
            say!(
                "{} {:26} kept {} before {:.3} designed {designed} random {random}",
                r.seed,
                r.truth,
                r.kept,
                r.before
            );
        }
    };
    let races = further::run(args.seed, args.sets, &each)?;
    let figures = further::figures(&races);
    if json {
        let document = serde_json::json!({
            "schema": "muprime.blind.further/2", "limit": LIMIT, "figures": figures, "races": races,
        });
        out!("{}", serde_json::to_string(&document).into_diagnostic()?);
        return Ok(ExitCode::SUCCESS);
    }
    out!(
        "further passes to a probability of 0.9 on the truth, {} sets whose cause is open at first:",
        races.len()
    );
    for f in figures {
        let ci = f.ci95.unwrap_or([f64::NAN; 2]);
        let value = f.value.unwrap_or(f64::NAN);
        out!("  {:46} {value:7.3} [{:.3}, {:.3}]  n {}  {}", f.name, ci[0], ci[1], f.n, f.target);
    }
    let count = |of: &dyn Fn(usize, usize) -> bool| {
        let passes = |n: Option<usize>| n.unwrap_or(usize::MAX);
        races.iter().filter(|r| of(passes(r.designed), passes(r.random))).count()
    };
    out!("  designed sooner in {}, later in {}", count(&|d, r| d < r), count(&|d, r| d > r));
    Ok(ExitCode::SUCCESS)
}
