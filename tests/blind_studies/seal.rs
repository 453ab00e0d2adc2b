//! Writes sealed data sets: `cargo run --release -p muprime-tests --example seal -- FOLDER COUNT FIRST_SEED
//! [STRATUM]`.
//!
//! `FOLDER/open/SEED/` holds what a diagnoser may read, `FOLDER/sealed/SEED/` what only the scorer may. The
//! stratum is drawn from the seed unless one is named: none, single, pair, alias, outside.
#![allow(clippy::disallowed_methods, reason = "it says how long it took")]

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use sim::sealed::{Ask, Stratum, generate};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("{problem}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, count, first, rest @ ..] = arguments.as_slice() else {
        return Err("usage: seal FOLDER COUNT FIRST_SEED [STRATUM]".to_string());
    };
    let number = |name: &str, text: &str| text.parse::<u64>().map_err(|e| format!("{name} '{text}': {e}"));
    let (count, first) = (number("COUNT", count)?, number("FIRST_SEED", first)?);
    let named = match rest.first().map(String::as_str) {
        None => None,
        Some("none") => Some(Stratum::None),
        Some("single") => Some(Stratum::Single),
        Some("pair") => Some(Stratum::Pair),
        Some("alias") => Some(Stratum::Alias),
        Some("outside") => Some(Stratum::Outside),
        Some(other) => {
            return Err(format!("STRATUM '{other}': none, single, pair, alias or outside is needed"));
        }
    };
    let start = Instant::now();
    let mut passes = 0;
    for seed in first..first + count {
        let set = generate(seed, named.unwrap_or_else(|| Stratum::draw(seed)), Ask::Gain);
        passes += set.passes.len();
        let at = |room: &str| Path::new(folder).join(room).join(seed.to_string());
        set.write(&at("open"), &at("sealed")).map_err(|e| format!("{folder}: {e}"))?;
    }
    let seconds = start.elapsed().as_secs_f64();
    eprintln!(
        "{count} sets, {passes} passes, {seconds:.1} s: {:.0} sets a minute",
        60.0 * count as f64 / seconds
    );
    Ok(())
}
