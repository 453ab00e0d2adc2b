//! Writes sealed data sets:
//! `cargo run --release -p muprime-sim --example seal -- FOLDER COUNT FIRST_SEED [STRATUM [PASSES]]`.
//!
//! `FOLDER/open/SEED/` holds what a diagnoser may read, `FOLDER/sealed/SEED/` what only the scorer may. The
//! stratum is drawn from the seed unless one is named: none, single, pair, alias, outside. With `PASSES` the
//! sweep is gone through again until the table has so many: what time and memory of a verdict are measured on.
#![allow(clippy::disallowed_methods, reason = "it says how long it took")]

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use models::condition::Condition;
use muprime_sim::sealed::{Ask, SealedRig, Set, Stratum, generate_with_rig};

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
        return Err("usage: seal FOLDER COUNT FIRST_SEED [STRATUM [PASSES]]".to_string());
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
    let long = rest.get(1).map(|text| number("PASSES", text)).transpose()?;
    let start = Instant::now();
    let mut passes = 0;
    for seed in first..first + count {
        let stratum = named.unwrap_or_else(|| Stratum::draw(seed));
        let (mut set, mut rig) = generate_with_rig(seed, stratum, Ask::Gain);
        if let Some(long) = long {
            lengthen(&mut set, &mut rig, long as usize);
        }
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

/// Goes through the sweep again until the set has so many passes.
fn lengthen(set: &mut Set, rig: &mut SealedRig, long: usize) {
    let place = |p: &models::pass::Pass| Condition {
        amplitude: p.amplitude,
        frequency_hz: p.frequency_hz,
        speed_m_s: p.speed_m_s,
        direction: p.direction,
        normal_force_n: p.normal_force_n,
        position_m: p.position_m,
        ambient_pressure_pa: p.ambient_pressure_pa,
        ..Condition::paper()
    };
    let missing = long.saturating_sub(set.passes.len());
    let again: Vec<Condition> = set.passes.iter().cycle().take(missing).map(place).collect();
    set.passes.extend(rig.measure(&again));
    set.passes.truncate(long);
}
