//! `muprime faults`: the fault list in virtual time, from seeds.

use crate::out;
use crate::validation::faults::Pace;
use crate::validation::faults::bench::{Scene, run as run_scene};
use crate::validation::faults::search::{Search, Tally, search};
use miette::IntoDiagnostic;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// How many seeds to run; each is one fault of the list in one phase
    #[arg(long, default_value_t = 2000)]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1)]
    first: u64,
    /// Two faults in each run
    #[arg(long)]
    pairs: bool,
    /// Every seed twice: equal hashes, and its rows replayed to equal decisions
    #[arg(long)]
    twice: bool,
    /// At the limits that a setup has by default (links held up for 20 ms), not at those of fast links
    #[arg(long)]
    default_limits: bool,
    /// Run one scene again, as a failure printed it
    #[arg(long, value_name = "SCENE.json")]
    scene: Option<PathBuf>,
}

/// Runs the seeds.
///
/// # Errors
/// A scene that cannot be read.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if let Some(path) = &args.scene {
        let text = crate::input::text_of(path)?;
        let scene: Scene = serde_json::from_str(&text).into_diagnostic()?;
        if scene.strikes.iter().any(|s| s.row >= crate::validation::faults::ROWS.len()) {
            miette::bail!("{}: a strike's row is beyond the list", path.display());
        }
        let found = run_scene(&scene, true);
        out!("{}", serde_json::to_string(&found).into_diagnostic()?);
        return super::exit(if found.wrong.is_empty() { super::DONE } else { super::FAILED });
    }
    let Args { seeds, first, pairs, twice, default_limits, .. } = args;
    let pace = if default_limits { Pace::Default } else { Pace::Fast };
    let (begun, cpu_ns) = (std::time::Instant::now(), realtime::pacing::process_cpu_ns());
    let bar = crate::progress::bar(seeds, "scenes");
    let so_far: Arc<Mutex<Tally>> = Arc::default();
    let kept = Arc::clone(&so_far);
    crate::progress::on_interrupt(&bar, move |_| {
        let tally = so_far.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if json {
            match document(&tally, None, true) {
                Ok(text) => out!("{text}"),
                Err(why) => crate::say!("{why}"),
            }
        } else {
            table(&tally);
            out!(
                "partial: {} of {seeds} runs, {} over a bound or otherwise wrong",
                tally.scenes,
                tally.failed
            );
        }
    })?;
    let tally = search(Search { first, seeds, pairs, twice, pace }, |chunk| {
        bar.inc(chunk.scenes);
        let mut so_far = kept.lock().unwrap_or_else(PoisonError::into_inner);
        *so_far = std::mem::take(&mut *so_far).with(chunk.clone());
    });
    bar.finish_and_clear();
    let cpu_s = (realtime::pacing::process_cpu_ns() - cpu_ns) as f64 * 1e-9;
    let simulated_s = tally.cycles as f64 * crate::validation::faults::bench::T.seconds();
    let speed = simulated_s / cpu_s.max(1e-9);
    if json {
        out!("{}", document(&tally, Some(speed), false)?);
    } else {
        table(&tally);
        out!(
            "{} runs in {:.0} s, {} over a bound or otherwise wrong",
            tally.scenes,
            begun.elapsed().as_secs_f64(),
            tally.failed
        );
        out!(
            "{simulated_s:.0} s simulated in {cpu_s:.0} s of processor time: {speed:.0} times real time per core"
        );
        for failure in &tally.failures {
            out!("seed {}: {}", failure.seed, failure.wrong.join("; "));
            out!("  again: muprime faults --scene FILE, with {}", json_of(&failure.smallest)?);
        }
    }
    super::exit(if tally.failed == 0 { super::DONE } else { super::FAILED })
}

fn json_of(value: &impl serde::Serialize) -> miette::Result<String> {
    serde_json::to_string(value).into_diagnostic()
}

fn document(tally: &Tally, speed: Option<f64>, partial: bool) -> miette::Result<String> {
    let rows: Vec<_> = tally
        .reactions
        .iter()
        .map(|((number, name, moment), r)| {
            serde_json::json!({ "number": number, "fault": name, "phase": moment, "reactions": r })
        })
        .collect();
    let mut document = serde_json::json!({
        "runs": tally.scenes, "simulated_seconds_per_core_second": speed, "failed": tally.failed, "rows": rows, "failures": tally.failures
    });
    if partial {
        document["partial"] = true.into();
    }
    json_of(&document)
}

/// Worst reactions beside their bounds, in cycles of 1 ms.
pub fn table(tally: &Tally) {
    out!("  # fault                          phase    runs  command off / bound  measured off / bound (ms)");
    for ((number, name, moment), r) in &tally.reactions {
        let moment = format!("{moment:?}").to_lowercase();
        let cells = match r.command_bound {
            None => "no trip due".to_string(),
            Some(bound) => {
                let cell = |n: Option<u64>| n.map_or_else(|| "-".into(), |n| n.to_string());
                format!(
                    "{:>11} / {bound:<5} {:>14} / {}",
                    cell(r.command_off),
                    cell(r.measured_off),
                    r.measured_bound
                )
            }
        };
        out!("{number:>3} {name:<30} {moment:<7} {:>6}  {cells}", r.runs);
    }
}
