//! A vibrometer's table taken live: set-points driven on the amplifier, the velocity's amplitude read off, the range read
//! back from the vibrometer's controller.
//!
//! The drive goes through the same loop with the same safety rules as a sweep; the finger is lifted and the stage stands.
//! What stands in this file is only the order of the set-points and the questions. The velocity is a voltage that a
//! digitiser, an oscilloscope or a lock-in shows: its amplitude comes from the standard input, typed or from a program.

use crate::session::RigClaim;
use crate::setup::Setup;
use crate::{ask, say};
use crossbeam_queue::ArrayQueue;
use drivers::Links;
use miette::IntoDiagnostic;
use models::prediction::SpringSlider;
use models::quantity::PeakToPeak;
use realtime::cycle::{Command, Marker};
use realtime::pacing::{self, Lifeline, LoopParts};
use realtime::safety::{Request, Trip};
use realtime::turn::{Ports, Row};
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer, Split};
use std::fmt::Write as _;
use std::io::BufRead;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Largest amplitude of a decoder's output in V: full scale is taken as 20 V peak-to-peak.
const FULL_SCALE_V: f64 = 10.0;
/// Time to arm in s.
const ARM_WITHIN_S: f64 = 10.0;
/// Time to reach an amplitude in s: the loop limits its rate.
const REACH_WITHIN_S: f64 = 10.0;

/// What is to be driven.
pub struct Table<'a> {
    /// Set-points, peak-to-peak, in m.
    pub set_points_pp_m: &'a [f64],
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Passes through the set-points, up and down by turns.
    pub passes: u32,
    /// Wait at a set-point before the reading, in s.
    pub settle_s: f64,
}

/// Peak-to-peak displacement of a sine whose velocity shows as so many volts, zero to peak.
///
/// # Errors
/// No amplitude, or one at the rail of the decoder's output.
pub fn displacement(volts: f64, range_m_s_per_v: f64, frequency_hz: f64) -> Result<PeakToPeak, String> {
    if !(volts.is_finite() && volts > 0.0) {
        return Err(format!("{volts} V is no amplitude: a number above zero is needed, zero to peak"));
    }
    if volts >= FULL_SCALE_V {
        return Err(format!(
            "{volts} V is at the rail of the decoder's output ({FULL_SCALE_V} V): choose a larger range and begin anew"
        ));
    }
    // v = 2 pi f (w/2), so w = v / (pi f).
    Ok(PeakToPeak::from_metres(volts * range_m_s_per_v / (std::f64::consts::PI * frequency_hz)))
}

/// Drives the set-points and asks for the readings; the table as CSV, with the settings at its head.
///
/// # Errors
/// A setup without a vibrometer, a rig that does not connect or will not stay armed, set-points beyond its limits, an
/// input that ends early, settings that were changed meanwhile.
pub fn table(setup: &Setup, table: &Table<'_>) -> miette::Result<String> {
    check(setup, table)?;
    let settings = setup.vibrometer_settings(table.frequency_hz)?;
    say!("vibrometer: {settings}");
    let _claim = RigClaim::take(setup)?;
    let drive = Drive::start(setup)?;
    drive.arm()?;
    say!(
        "The plate will vibrate at {:.1} Hz, up to {:.2} um peak-to-peak. Nothing may touch it. Each question wants the \
         amplitude of the velocity signal in V, zero to peak; an empty line asks again after another settling.",
        table.frequency_hz,
        table.set_points_pp_m.iter().fold(0.0f64, |a, b| a.max(*b)) * 1e6
    );
    let mut text = format!("# vibrometer: {settings}\nset_point_pp_m,velocity_v,amplitude_pp_m\n");
    let mut lines = std::io::stdin().lock().lines();
    for pass in 0..table.passes {
        let mut order = table.set_points_pp_m.to_vec();
        if pass % 2 == 1 {
            order.reverse();
        }
        for set_point in order {
            let amplitude = PeakToPeak::from_metres(set_point);
            let (volts, w) = loop {
                if let Err(why) = drive.hold(amplitude, table) {
                    // A trip stays until somebody at the rig takes it back.
                    ask!("  {why}; an empty line arms the rig again> ");
                    answer(&mut lines)?;
                    drive.arm()?;
                    continue;
                }
                ask!("set-point {set_point:.3e} m, volts> ");
                let line = answer(&mut lines)?;
                if !drive.holds(amplitude) {
                    say!("  no reading: the drive did not stand while it was taken; again");
                    continue;
                }
                let volts = line.trim().parse().unwrap_or(f64::NAN);
                match displacement(volts, settings.range_m_s_per_v, table.frequency_hz) {
                    Ok(w) => break (volts, w),
                    Err(why) => say!("  no reading: {why}"),
                }
            };
            say!("  {volts} V are {:.4} um peak-to-peak", w.micrometres());
            let _ = writeln!(text, "{set_point:e},{volts},{:e}", w.metres());
        }
    }
    drop(drive);
    let after = setup.vibrometer_settings(table.frequency_hz)?;
    if after != settings {
        miette::bail!("the vibrometer was set otherwise while the table was taken ({after} now): no table");
    }
    Ok(text)
}

/// What the operator, or the program in his place, says next.
fn answer(lines: &mut impl Iterator<Item = std::io::Result<String>>) -> miette::Result<String> {
    match lines.next() {
        Some(line) => line.map_err(|e| miette::miette!("the terminal: {e}")),
        None => miette::bail!("the input ended before the last set-point: no table, no certificate"),
    }
}

/// Refuses before anything moves.
fn check(setup: &Setup, table: &Table<'_>) -> miette::Result<()> {
    if setup.file.virtual_rig.is_some() {
        miette::bail!(
            help = "serve it with `muprime virtual-rig --hands` and name its addresses in a setup without [virtual]",
            "a virtual rig inside this process shows its plate to no vibrometer"
        );
    }
    let limits = &setup.config.limits;
    let largest = limits.amplitude_max.metres();
    for set in table.set_points_pp_m {
        if !(*set > 0.0 && *set <= largest) {
            miette::bail!("--live {set}: above 0 and at most {largest:e} m peak-to-peak (the setup's limit)");
        }
    }
    let (low, high) = limits.frequency_hz;
    if !(low..=high).contains(&table.frequency_hz) {
        miette::bail!("--frequency-hz {}: the setup allows {low} to {high}", table.frequency_hz);
    }
    if !(0.05..=60.0).contains(&table.settle_s) || !(1..=20).contains(&table.passes) {
        miette::bail!("--settle-s is between 0.05 and 60, --passes between 1 and 20");
    }
    Ok(())
}

/// What the loop said last.
#[derive(Default)]
struct Seen {
    row: Option<Row>,
    tripped: Option<Trip>,
}

/// The loop with the rig, driven to one amplitude after another; dropping it stops the drive.
struct Drive {
    commands: Arc<ArrayQueue<Command>>,
    life: Arc<Lifeline>,
    seen: Arc<Mutex<Seen>>,
    ended: Arc<AtomicBool>,
    threads: Vec<JoinHandle<()>>,
    links: Option<Links>,
}

impl Drive {
    fn start(setup: &Setup) -> miette::Result<Drive> {
        let epoch = Instant::now();
        let origin_ns = pacing::monotonic_ns();
        let rig = drivers::open(&setup.instruments(), epoch).map_err(|e| miette::miette!("{e}"))?;
        let model = SpringSlider::new(setup.tip.finger).map_err(|e| miette::miette!("{e}"))?;
        let commands = Arc::new(ArrayQueue::new(64));
        let life = Arc::new(Lifeline::default());
        // Nobody records here: a ring of one is full at once, and what is lost is not missed.
        let (rows, _) = HeapRb::<Row>::new(1).split();
        let (watch, mut watched) = HeapRb::<Row>::new(8192).split();
        let parts = LoopParts {
            config: setup.config,
            model: Arc::new(model),
            // The raw set-point is what is calibrated: a certificate of the setup is not applied.
            ports: Ports { force: rig.force, amplifier: rig.amplifier, stage: rig.stage },
            commands: Arc::clone(&commands),
            rows,
            watch,
            life: Arc::clone(&life),
            origin_ns,
        };
        let priority = (setup.file.pace.priority > 0).then_some(setup.file.pace.priority);
        let looping = std::thread::Builder::new().name("loop".into()).spawn(move || {
            pacing::run(parts, priority);
        });
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
            signal_hook::flag::register(signal, Arc::clone(&interrupted)).into_diagnostic()?;
        }
        let seen = Arc::new(Mutex::new(Seen::default()));
        let ended = Arc::new(AtomicBool::new(false));
        let (note, done, queue) = (Arc::clone(&seen), Arc::clone(&ended), Arc::clone(&commands));
        let watching = std::thread::Builder::new().name("watch".into()).spawn(move || {
            while !done.load(Ordering::Acquire) {
                let mut news = false;
                while let Some(row) = watched.try_pop() {
                    let mut seen = note.lock().unwrap_or_else(PoisonError::into_inner);
                    seen.tripped = row.tripped.or(seen.tripped);
                    seen.row = Some(row);
                    news = true;
                }
                if interrupted.load(Ordering::Relaxed) {
                    // The main thread waits for a line: the stop goes out from here, and the program ends.
                    let _ = queue.force_push(Command::Stop);
                    std::thread::sleep(Duration::from_millis(200));
                    say!("stopped: the drive is off");
                    std::process::exit(1);
                }
                if !news {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
        });
        let threads = vec![looping.into_diagnostic()?, watching.into_diagnostic()?];
        Ok(Drive { commands, life, seen, ended, threads, links: Some(rig.links) })
    }

    fn row(&self) -> Option<Row> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).row
    }

    fn send(&self, command: Command) {
        let _ = self.commands.force_push(command);
    }

    fn until(&self, seconds: f64, so: impl Fn(&Row) -> bool) -> bool {
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < seconds {
            if self.row().is_some_and(|row| so(&row)) {
                return true;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        false
    }

    /// Arms the rig, with nothing driven: once at the beginning, and after a trip when the operator says so.
    fn arm(&self) -> miette::Result<()> {
        let began = Instant::now();
        while !self.row().is_some_and(|row| row.armed) {
            if began.elapsed().as_secs_f64() > ARM_WITHIN_S {
                let blocking = self.row().and_then(|row| row.blocking);
                miette::bail!("the rig does not arm within {ARM_WITHIN_S} s: {blocking:?}");
            }
            self.send(Command::Set(Request::default(), Marker::default()));
            self.send(Command::Reset);
            std::thread::sleep(Duration::from_millis(60));
        }
        self.seen.lock().unwrap_or_else(PoisonError::into_inner).tripped = None;
        Ok(())
    }

    /// Brings the plate to an amplitude and lets it settle.
    fn hold(&self, amplitude: PeakToPeak, table: &Table<'_>) -> Result<(), String> {
        let request = Request { amplitude, frequency_hz: table.frequency_hz, ..Request::default() };
        self.send(Command::Set(request, Marker::default()));
        let stands =
            self.until(REACH_WITHIN_S, |row| !row.armed || reached(row, amplitude)) && self.holds(amplitude);
        if stands {
            std::thread::sleep(Duration::from_secs_f64(table.settle_s));
            if self.holds(amplitude) {
                return Ok(());
            }
        }
        self.send(Command::Set(Request::default(), Marker::default()));
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let why = seen.tripped.map(|trip| trip.cause).or(seen.row.and_then(|row| row.blocking));
        Err(match why {
            Some(cause) => format!("the rig has tripped ({cause:?})"),
            None => format!("{:.3} um are not reached in {REACH_WITHIN_S} s", amplitude.micrometres()),
        })
    }

    /// Whether the drive has stood at an amplitude since it was reached.
    fn holds(&self, amplitude: PeakToPeak) -> bool {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.tripped.is_none() && seen.row.is_some_and(|row| row.armed && reached(&row, amplitude))
    }
}

fn reached(row: &Row, amplitude: PeakToPeak) -> bool {
    (row.drive_pp_m - amplitude.metres()).abs() <= 1e-3 * amplitude.metres()
}

impl Drop for Drive {
    fn drop(&mut self) {
        self.send(Command::Stop);
        // A few cycles carry the stop to the amplifier.
        std::thread::sleep(Duration::from_millis(100));
        self.life.end.store(true, Ordering::Relaxed);
        self.ended.store(true, Ordering::Release);
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
        drop(self.links.take());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volts_become_peak_to_peak_metres() {
        // 2 um peak-to-peak at 27.5 kHz moves at 0.1728 m/s (Fig. 2's plate); 25 mm/s/V shows 6.911 V.
        let w = displacement(0.172_788 / 0.025, 0.025, 27_500.0).unwrap();
        assert!((w.metres() / 2e-6 - 1.0).abs() < 1e-5, "{w}");
        for bad in [0.0, -1.0, f64::NAN, 10.0, 12.0] {
            assert!(displacement(bad, 0.025, 27_500.0).is_err(), "{bad}");
        }
    }
}
