//! `muprime watch RUN`: follows a run, at a terminal with the live view, else line by line from its journal.

use super::prelude::*;
use rig::watch::TerminalView;
use runs::MeasuredPass;
use runs::catalogue::{existing, runs_folder};
use std::io::{BufRead, BufReader, IsTerminal};
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the run [default: the newest]
    run: Option<PathBuf>,
}

/// Shows a run until somebody leaves it; with `--json`, or where no terminal is, prints passes as they come
/// until the run has ended; refused where there is no run.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let newest = |all: PathBuf| Ok::<_, miette::Report>(all.join(&existing(&all)?[0].folder));
    let run = args.run.map_or_else(|| newest(runs_folder()), Ok)?;
    let journal = run.join("passes.jsonl");
    let file = std::fs::File::open(&journal)
        .into_diagnostic()
        .wrap_err_with(|| format!("{} holds no run", run.display()))?;
    if !json && std::io::stdout().is_terminal() && rig::terminal::has_keys().is_ok() {
        // A signal takes the view down, and nothing else: the run is another process's.
        studies::progress::on_signals(&rig::terminal::STOPS, || runs::exit::exit_now(DONE))?;
        TerminalView::begin(&run, None, false)?.wait();
        return exit(DONE);
    }
    let mut reader = BufReader::new(file);
    let mut line = String::new();
    loop {
        // Looked at before reading: what was written before the lock went is still printed.
        let running = runs::run_dir::is_held(&run);
        while reader.read_line(&mut line).into_diagnostic()? > 0 && line.ends_with('\n') {
            show(&line, json);
            line.clear();
        }
        if !running {
            return exit(DONE);
        }
        std::thread::sleep(Duration::from_millis(200));
    }
}

fn show(line: &str, json: bool) {
    if json {
        out!("{}", line.trim_end());
        return;
    }
    let Ok(p) = serde_json::from_str::<MeasuredPass>(line) else { return };
    let c = p.comparison;
    let number = |v: Option<f64>| v.map_or("  --".to_string(), |v| format!("{v:.3}"));
    out!(
        "pass {:4}  w {:6.2} \u{b5}m  f {:6.2} kHz  U {:6.1} mm/s  Fn {:.3} N  mu' {} predicted {} z {}{}",
        p.pass.point,
        p.pass.amplitude.micrometres(),
        p.pass.frequency_hz / 1e3,
        p.pass.speed_m_s * 1e3,
        p.pass.normal_force_n,
        number(c.and_then(|c| c.mu_relative)),
        number(c.map(|c| c.predicted)),
        number(c.map(|c| c.z)),
        if c.is_some_and(|c| c.departed) { "  DISAGREES WITH THE MODEL" } else { "" }
    );
}
