//! A dead-weight series at the terminal: the operator loads, the program reads (or the operator types).

use drivers::Rig;
use realtime::ports::{Nanos, NoData, Quality};
use runs::{Setup, ask, say};
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use tables::calibrate::SeriesOptions;

const HELP: &str = "\
Each line is one reading: what hangs on the sensor now, and which way it changed.
  zero                   nothing hangs, the finger is lifted
  lateral 0.050 up       50 g pull along the stroke (minus sign: the other way), weight was added
  normal 0.100 down      100 g press on the plate, weight was taken off
  undo                   forget the last reading
  done                   evaluate
Start and end with a zero and take one between; at least three weights on each axis, better five, up and
down, twice. Wait until nothing swings and the reading stands still before each line.";

/// Asks for readings on stderr, takes them from stdin, keeps the series and returns it as CSV.
pub fn series(way: &SeriesOptions<'_>) -> miette::Result<String> {
    if !(0.1..=600.0).contains(&way.average_s) {
        miette::bail!("--average-s {}: between 0.1 and 600", way.average_s);
    }
    if !(0.0..=86_400.0).contains(&way.reconnect_s) {
        miette::bail!("--reconnect-s {}: between 0 and 86400", way.reconnect_s);
    }
    let epoch = Instant::now();
    // Closing the links switches off what they reach: that must be nobody else's rig.
    let mut _rig_lock = None;
    let mut rig = match way.setup {
        None => None,
        Some(name) => {
            let setup = Setup::load(name)?;
            _rig_lock = Some(crate::rig_lock::RigLock::take(&setup)?);
            Some(drivers::open(&setup.instruments(), epoch).map_err(|e| miette::miette!("{e}"))?)
        }
    };
    say!("{HELP}");
    let mut series = Series::take_up(way.keep)?;
    let mut lines = std::io::stdin().lock().lines();
    loop {
        ask!("reading {}> ", series.rows.len() + 1);
        let Some(line) = lines.next() else {
            miette::bail!(
                help = "repeat the command to resume; delete that file to start over",
                "the input ended before `done`: no series, no certificate. {} readings are in {}",
                series.rows.len(),
                series.part.display()
            );
        };
        let line = line.map_err(|e| miette::miette!("the terminal: {e}"))?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let (axis, mass, branch) = match words.as_slice() {
            [] => continue,
            ["done"] => break,
            ["undo"] => {
                let row = series.rows.pop();
                series.write()?;
                say!("{}", row.map_or("nothing to forget".into(), |r| format!("forgotten: {r}")));
                continue;
            }
            ["zero"] => ("zero", String::new(), ""),
            [axis @ ("lateral" | "normal"), mass] if number(mass) => (*axis, (*mass).to_string(), ""),
            [axis @ ("lateral" | "normal"), mass, branch @ ("up" | "down")] if number(mass) => {
                (*axis, (*mass).to_string(), *branch)
            }
            _ => {
                say!("not understood: `{line}`\n{HELP}");
                continue;
            }
        };
        let taken = match &mut rig {
            Some(rig) => read(rig, epoch, way),
            None => typed(&mut lines),
        };
        match taken {
            Ok(t) => {
                // The middle of the readings that were averaged, which a link that went down may have put off.
                let time_s = series.time_s() - 0.5 * t.length_s;
                let ([lateral, normal], saturated) = (t.counts, u8::from(t.saturated));
                let row = format!("{time_s:.6},{axis},{mass},{lateral},{normal},{branch},{saturated}");
                series.rows.push(row);
                series.write()?;
                // Printed only after it is stored.
                say!("  lateral {lateral:.2}, normal {normal:.2} counts{}", t.note);
            }
            Err(why) => say!("  no reading: {why}; try again"),
        }
    }
    series.finish(way.keep)
}

/// The series so far, on the disk after every reading: a program that is ended, or a machine that is, loses none.
struct Series {
    part: PathBuf,
    /// When the series began, in s since 1970: times count from there, also in a later session.
    began_unix_s: f64,
    rows: Vec<String>,
}

const BEGAN: &str = "# began_unix_s = ";
const HEADER: &str = "time_s,axis,mass_kg,lateral_counts,normal_counts,branch,saturated";

impl Series {
    /// Begins a series, or goes on with the one that an earlier session left.
    fn take_up(keep: &Path) -> miette::Result<Series> {
        let part = keep.with_extension("csv.part");
        let shown = part.display().to_string();
        if !part.exists() {
            return Ok(Series { part, began_unix_s: unix_s(), rows: Vec::new() });
        }
        let text = runs::input::text_of(&part)?;
        let mut lines = text.lines();
        let began = lines.next().and_then(|l| l.strip_prefix(BEGAN)).and_then(|t| t.trim().parse().ok());
        let (Some(began_unix_s), Some(HEADER)) = (began, lines.next()) else {
            miette::bail!(help = "delete it to start over", "{shown} is not a series of this program");
        };
        let rows: Vec<String> = lines.map(String::from).collect();
        say!(
            "resumes with {} readings of an earlier session from {shown} (begun {:.0} s ago); to start over, delete that file",
            rows.len(),
            unix_s() - began_unix_s
        );
        Ok(Series { part, began_unix_s, rows })
    }

    fn time_s(&self) -> f64 {
        unix_s() - self.began_unix_s
    }

    fn text(&self) -> String {
        let rows = self.rows.iter().map(|row| format!("{row}\n")).collect::<String>();
        format!("{BEGAN}{:.6}\n{HEADER}\n{rows}", self.began_unix_s)
    }

    fn write(&self) -> miette::Result<()> {
        runs::files::write_whole(&self.part, self.text())
    }

    /// Writes the series and returns its text; only then the file so far goes.
    fn finish(self, keep: &Path) -> miette::Result<String> {
        let text = self.text().lines().skip(1).fold(String::new(), |all, line| all + line + "\n");
        runs::files::write_whole(keep, &text)?;
        std::fs::remove_file(&self.part).or_else(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Ok(()),
            _ => Err(miette::miette!("{}: {e}", self.part.display())),
        })?;
        Ok(text)
    }
}

fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

/// One reading; where a link goes down it is waited for, and the averaging begins anew.
fn read(rig: &mut Rig, epoch: Instant, way: &SeriesOptions<'_>) -> Result<Taken, String> {
    let begun = Instant::now();
    let mut down = false;
    loop {
        let why = match average(rig, epoch, way.average_s) {
            Ok(taken) => return Ok(taken),
            Err(Missing::Other(why)) => return Err(why),
            Err(Missing::Link(why)) => why,
        };
        if !std::mem::replace(&mut down, true) {
            let links = rig.links.health().map(|(name, health)| format!("{name}: {}", health.last_problem));
            say!(
                "  {why} ({}): waiting up to {:.0} s for it to come back; nothing that was weighed is lost",
                links.collect::<Vec<_>>().join(", "),
                way.reconnect_s
            );
        }
        loop {
            if begun.elapsed().as_secs_f64() > way.reconnect_s {
                return Err(format!("{why}, and did not come back within {:.0} s", way.reconnect_s));
            }
            std::thread::sleep(Duration::from_millis(50));
            let now = Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX));
            let forces = rig.force.read(now);
            if forces.lateral.is_ok() && forces.normal.is_ok() {
                say!("  the link is back: the reading starts over");
                break;
            }
        }
    }
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

/// Why there is no reading.
enum Missing {
    /// The link is down, or nothing fresh comes over it.
    Link(String),
    /// Anything else: waiting would not mend it.
    Other(String),
}

/// Means of the counts of fresh samples, each sequence number once.
fn average(rig: &mut Rig, epoch: Instant, average_s: f64) -> Result<Taken, Missing> {
    let now = || Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX));
    let start = now();
    let (mut sums, mut samples, mut last) = ([0.0; 2], [0u32; 2], [None; 2]);
    let mut saturated = false;
    while now().since(start).seconds() < average_s {
        let forces = rig.force.read(now());
        for (axis, channel) in [forces.lateral, forces.normal].into_iter().enumerate() {
            let reading = channel.map_err(|reason| match reason {
                NoData::Disconnected | NoData::NeverRead => Missing::Link(reason.to_string()),
                other => Missing::Other(other.to_string()),
            })?;
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
        return Err(Missing::Other(format!("only {samples:?} fresh samples in {average_s} s")));
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
    ask!("  counts, lateral and normal> ");
    let line = lines.next().ok_or("the input ended")?.map_err(|e| e.to_string())?;
    let numbers: Vec<f64> = line.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    match numbers.as_slice() {
        [lateral, normal] if lateral.is_finite() && normal.is_finite() => {
            Ok(Taken { counts: [*lateral, *normal], length_s: 0.0, saturated: false, note: String::new() })
        }
        _ => Err(format!("`{line}` is not two numbers")),
    }
}
