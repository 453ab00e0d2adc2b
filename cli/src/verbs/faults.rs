//! `muprime faults`: the fault list in virtual time, from seeds.

use super::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use studies::cases::kinds::faults::{FaultSettings, search};
use studies::validation::faults::scene::{Scene, run as run_scene};
use studies::validation::faults::{Pace, Tally};

/// Scenes of the bench, run here or as cases.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct Scenes {
    /// How many seeds to run; each is one fault of the list in one phase
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u64).range(1..))]
    pub seeds: u64,
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
}

impl Scenes {
    /// What all of them share.
    pub fn settings(self) -> FaultSettings {
        let pace = if self.default_limits { Pace::Default } else { Pace::Fast };
        FaultSettings { first: self.first, pairs: self.pairs, twice: self.twice, pace }
    }
}

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    scenes: Scenes,
    /// Run one scene again, as a failure printed it
    #[arg(long, value_name = "SCENE.json")]
    scene: Option<PathBuf>,
}

/// Runs the seeds; refused: a scene that cannot be read.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if let Some(path) = &args.scene {
        let text = runs::input::text_of(path)?;
        let scene: Scene = serde_json::from_str(&text).into_diagnostic()?;
        if scene.strikes.iter().any(|s| s.row >= studies::validation::faults::ROWS.len()) {
            miette::bail!("{}: a strike's row is beyond the list", path.display());
        }
        let found = run_scene(&scene, true);
        answer_json(&found);
        return exit(if found.wrong.is_empty() { DONE } else { FAILED });
    }
    let seeds = args.scenes.seeds;
    let (begun, cpu_ns) = (std::time::Instant::now(), realtime::pacing::process_cpu_ns());
    let bar = studies::progress::bar(seeds, "scenes");
    let so_far: Arc<Mutex<Tally>> = Arc::default();
    let shared = Arc::clone(&so_far);
    studies::progress::on_interrupt(&bar, move |_| {
        let tally = so_far.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if json {
            return answer_json(&document(&tally, None, true));
        }
        studies::validation::faults::table(&tally);
        let (runs, failed) = (tally.scenes, tally.failed);
        out!("partial: {runs} of {seeds} runs, {failed} over a bound or otherwise wrong");
    })?;
    let tally = search(&args.scenes.settings(), seeds, &mut |tally| {
        bar.inc(1);
        shared.lock().unwrap_or_else(PoisonError::into_inner).clone_from(tally);
    })?;
    bar.finish_and_clear();
    let cpu_s = (realtime::pacing::process_cpu_ns() - cpu_ns) as f64 * 1e-9;
    let simulated_s = tally.cycles as f64 * studies::validation::faults::scene::T.seconds();
    let speed = simulated_s / cpu_s.max(1e-9);
    if json {
        answer_json(&document(&tally, Some(speed), false));
    } else {
        studies::validation::faults::table(&tally);
        let (runs, took_s, failed) = (tally.scenes, begun.elapsed().as_secs_f64(), tally.failed);
        out!("{runs} runs in {took_s:.0} s, {failed} over a bound or otherwise wrong");
        out!(
            "{simulated_s:.0} s simulated in {cpu_s:.0} s of processor time: {speed:.0} times real time per core"
        );
        for failure in &tally.failures {
            out!("seed {}: {}", failure.seed, failure.wrong.join("; "));
            let smallest = serde_json::to_string(&failure.smallest).into_diagnostic()?;
            out!("  again: muprime faults --scene FILE, with {smallest}");
        }
    }
    exit(if tally.failed == 0 { DONE } else { FAILED })
}

fn document(tally: &Tally, speed: Option<f64>, partial: bool) -> serde_json::Value {
    let rows: Vec<_> = (tally.reactions.iter())
        .map(|((number, name, moment), r)| {
            json!({ "number": number, "fault": name, "phase": moment, "reactions": r })
        })
        .collect();
    let mut document = json!({
        "runs": tally.scenes, "simulated_seconds_per_core_second": speed, "failed": tally.failed, "rows": rows, "failures": tally.failures
    });
    if partial {
        document["partial"] = true.into();
    }
    document
}
