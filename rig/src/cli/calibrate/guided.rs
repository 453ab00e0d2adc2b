//! A dead-weight series at the terminal: the operator loads, the program reads (or the operator types).

use crate::drivers::{self, Rig};
use crate::setup::Setup;
use realtime::ports::{Nanos, Quality};
use std::fmt::Write as _;
use std::io::BufRead;
use std::time::{Duration, Instant};

const HELP: &str = "\
Each line is one reading: what hangs on the sensor now, and which way it changed.
  zero                   nothing hangs, the finger is lifted
  lateral 0.050 up       50 g pull along the stroke (minus sign: the other way), weight was added
  normal 0.100 down      100 g press on the plate, weight was taken off
  undo                   forget the last reading
  done                   evaluate
Start and end with a zero and take one between; at least three weights on each axis, better five, up and
down, twice. Wait until nothing swings and the reading stands still before each line.";

/// Asks for readings on stderr, takes them from stdin, and returns the series as CSV.
pub fn series(setup: Option<&str>, average_s: f64) -> miette::Result<String> {
    if !(0.1..=600.0).contains(&average_s) {
        miette::bail!("--average-s {average_s}: between 0.1 and 600");
    }
    let epoch = Instant::now();
    let mut rig = match setup {
        None => None,
        Some(name) => {
            let setup = Setup::load(name)?;
            Some(drivers::open(&setup.instruments(), epoch).map_err(|e| miette::miette!("{e}"))?)
        }
    };
    eprintln!("{HELP}");
    let mut rows: Vec<String> = Vec::new();
    let mut lines = std::io::stdin().lock().lines();
    loop {
        eprint!("reading {}> ", rows.len() + 1);
        let Some(line) = lines.next() else {
            miette::bail!("the input ended before `done`: no series, no certificate");
        };
        let line = line.map_err(|e| miette::miette!("the terminal: {e}"))?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let (axis, mass, branch) = match words.as_slice() {
            [] => continue,
            ["done"] => break,
            ["undo"] => {
                eprintln!("{}", rows.pop().map_or("nothing to forget".into(), |r| format!("forgotten: {r}")));
                continue;
            }
            ["zero"] => ("zero", String::new(), ""),
            [axis @ ("lateral" | "normal"), mass] if number(mass) => (*axis, (*mass).to_string(), ""),
            [axis @ ("lateral" | "normal"), mass, branch @ ("up" | "down")] if number(mass) => {
                (*axis, (*mass).to_string(), *branch)
            }
            _ => {
                eprintln!("not understood: `{line}`\n{HELP}");
                continue;
            }
        };
        let time_s = epoch.elapsed().as_secs_f64();
        let taken = match &mut rig {
            Some(rig) => average(rig, epoch, average_s),
            None => typed(&mut lines),
        };
        match taken {
            Ok(t) => {
                eprintln!("  lateral {:.2}, normal {:.2} counts{}", t.counts[0], t.counts[1], t.note);
                rows.push(format!(
                    "{:.6},{axis},{mass},{},{},{branch},{}",
                    time_s + 0.5 * t.length_s,
                    t.counts[0],
                    t.counts[1],
                    u8::from(t.saturated)
                ));
            }
            Err(why) => eprintln!("  no reading: {why}; try again"),
        }
    }
    let mut text = String::from("time_s,axis,mass_kg,lateral_counts,normal_counts,branch,saturated\n");
    for row in rows {
        let _ = writeln!(text, "{row}");
    }
    Ok(text)
}

fn number(text: &str) -> bool {
    text.parse::<f64>().is_ok_and(|x| x.is_finite() && x != 0.0)
}

/// One averaged reading.
struct Taken {
    counts: [f64; 2],
    length_s: f64,
    saturated: bool,
    note: String,
}

/// Means of the counts of fresh samples, each sequence number once.
fn average(rig: &mut Rig, epoch: Instant, average_s: f64) -> Result<Taken, String> {
    let now = || Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX));
    let start = now();
    let (mut sums, mut samples, mut last) = ([0.0; 2], [0u32; 2], [None; 2]);
    let mut saturated = false;
    while now().since(start).seconds() < average_s {
        let forces = rig.force.read(now());
        for (axis, channel) in [forces.lateral, forces.normal].into_iter().enumerate() {
            let reading = channel.map_err(|e| e.to_string())?;
            // Samples from before the reading began are not of this load.
            if reading.taken_at < start || last[axis] == Some(reading.sequence) {
                continue;
            }
            last[axis] = Some(reading.sequence);
            sums[axis] += reading.raw as f64;
            samples[axis] += 1;
            saturated |= reading.quality == Quality::Saturated;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    if samples.iter().any(|n| *n < 10) {
        return Err(format!("only {samples:?} fresh samples in {average_s} s"));
    }
    Ok(Taken {
        counts: [sums[0] / f64::from(samples[0]), sums[1] / f64::from(samples[1])],
        length_s: average_s,
        saturated,
        note: format!(" (means of {} and {} samples)", samples[0], samples[1]),
    })
}

/// Counts as the operator reads them off a display.
fn typed(lines: &mut impl Iterator<Item = std::io::Result<String>>) -> Result<Taken, String> {
    eprint!("  counts, lateral and normal> ");
    let line = lines.next().ok_or("the input ended")?.map_err(|e| e.to_string())?;
    let numbers: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    match numbers.as_slice() {
        [lateral, normal] if lateral.is_finite() && normal.is_finite() => {
            Ok(Taken { counts: [*lateral, *normal], length_s: 0.0, saturated: false, note: String::new() })
        }
        _ => Err(format!("`{line}` is not two numbers")),
    }
}
