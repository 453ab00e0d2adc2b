//! The loop with the rig, driven to one amplitude after another with the finger lifted and the stage at rest.

use crate::wall_clock_loop::{LoopHandle, Parts, WallClockLoop};
use miette::IntoDiagnostic;
use models::{PeakToPeak, SpringSlider};
use realtime::cycle::{Command, Marker};
use realtime::safety::{Request, Trip, TripCause};
use realtime::{Ports, Row, pacing, threads};
use runs::Setup;
use runs::job::Unfinished;
use runs::supervisor::{Loop, OffReport};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Time to arm in s.
const ARM_WITHIN_S: f64 = 10.0;
/// Time to reach an amplitude in s: the loop limits its rate.
const REACH_WITHIN_S: f64 = 10.0;

/// The loop's last report.
#[derive(Default)]
struct Seen {
    row: Option<Row>,
    tripped: Option<Trip>,
}

/// A driven rig. Dropping it stops the drive, as its supervisor does.
pub(super) struct Drive {
    rig: WallClockLoop,
    seen: Arc<Mutex<Seen>>,
    interrupted: Arc<AtomicBool>,
    ended: Arc<AtomicBool>,
    watching: Option<JoinHandle<()>>,
}

impl Drive {
    /// Connects the rig of a setup and starts its loop.
    pub(super) fn start(setup: &Setup) -> miette::Result<Drive> {
        if setup.config.limits.human_contact {
            miette::bail!(
                help = "write nobody_touches_the_plate = true in [finger] for the calibration, and keep hands off",
                "a calibration drives the plate without a finger, and counts nobody's exposure"
            );
        }
        let epoch = Instant::now();
        let origin_ns = pacing::monotonic_ns();
        let model = SpringSlider::new(setup.tip.finger).map_err(|e| miette::miette!("{e}"))?;
        let interrupted = Arc::new(AtomicBool::new(false));
        for signal in crate::terminal::STOPS {
            signal_hook::flag::register(signal, Arc::clone(&interrupted)).into_diagnostic()?;
        }
        let rig = drivers::open(&setup.instruments(), epoch).map_err(|e| miette::miette!("{e}"))?;
        // Nobody records here: what the ring for a record loses is not missed.
        let (rig, handle, _) = WallClockLoop::start(Parts {
            config: setup.config,
            model: Arc::new(model),
            // The raw set-point is what is calibrated: a certificate of the setup is not applied.
            ports: Ports {
                supply: rig.supply,
                contacts: rig.contacts,
                ..Ports::new(rig.force, rig.amplifier, rig.stage)
            },
            links: rig.links,
            pacing: setup.file.pace.pacing(),
            origin_ns,
        })
        .into_diagnostic()?;
        let seen = Arc::new(Mutex::new(Seen::default()));
        let ended = Arc::new(AtomicBool::new(false));
        let (note, stop, done) = (Arc::clone(&seen), Arc::clone(&interrupted), Arc::clone(&ended));
        let watch = move || watch(handle, &note, &stop, &done);
        let watching = threads::spawn("watch", watch).into_diagnostic()?;
        Ok(Drive { rig, seen, interrupted, ended, watching: Some(watching) })
    }

    /// Stops the drive and says whether it was read back off.
    pub(super) fn end(mut self) -> OffReport {
        self.ended.store(true, Ordering::Release);
        let _ = self.watching.take().map(JoinHandle::join);
        self.rig.end().off
    }

    /// Refuses to go on once a signal has ended it.
    pub(super) fn go_on(&self) -> miette::Result<()> {
        if self.interrupted.load(Ordering::Relaxed) { Err(Unfinished::Interrupted.into()) } else { Ok(()) }
    }

    fn seen(&self) -> std::sync::MutexGuard<'_, Seen> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn until(&self, seconds: f64, so: impl Fn(&Row) -> bool) -> bool {
        let began = Instant::now();
        while began.elapsed().as_secs_f64() < seconds && !self.interrupted.load(Ordering::Relaxed) {
            if self.seen().row.is_some_and(|row| so(&row)) {
                return true;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        false
    }

    /// Arms the rig, with nothing driven: once at the beginning, and after a trip when the operator says so.
    pub(super) fn arm(&self) -> miette::Result<()> {
        let began = Instant::now();
        while !self.seen().row.is_some_and(|row| row.armed) {
            self.go_on()?;
            if began.elapsed().as_secs_f64() > ARM_WITHIN_S {
                let waits_for = self.seen().row.and_then(|row| row.waits_for);
                let tripped = || self.seen().tripped.map(|trip| trip.cause);
                let cause = waits_for.or_else(tripped).unwrap_or(TripCause::SupplySwitch);
                let (help, words) = (cause.remedy(), cause.words());
                miette::bail!(help = help, "the rig does not arm within {ARM_WITHIN_S} s: {words}");
            }
            self.rig.send(Command::Set(Request::default(), Marker::default()));
            self.rig.send(Command::Reset);
            std::thread::sleep(Duration::from_millis(60));
        }
        self.seen().tripped = None;
        Ok(())
    }

    /// Brings the plate to an amplitude and lets it settle.
    pub(super) fn hold(&self, amplitude: PeakToPeak, frequency_hz: f64, settle_s: f64) -> Result<(), String> {
        let request = Request { amplitude, frequency_hz, ..Request::default() };
        self.rig.send(Command::Set(request, Marker::default()));
        let stands =
            self.until(REACH_WITHIN_S, |row| !row.armed || reached(row, amplitude)) && self.holds(amplitude);
        if stands {
            self.until(settle_s, |row| !row.armed);
            if self.holds(amplitude) {
                return Ok(());
            }
        }
        self.rig.send(Command::Set(Request::default(), Marker::default()));
        let seen = self.seen();
        let why = seen.tripped.map(|trip| trip.cause).or(seen.row.and_then(|row| row.waits_for));
        Err(match why {
            Some(cause) => format!("the rig has tripped ({})", cause.words()),
            None => format!("{:.3} \u{b5}m are not reached in {REACH_WITHIN_S} s", amplitude.micrometres()),
        })
    }

    /// Whether the drive has stood at an amplitude since it was reached.
    pub(super) fn holds(&self, amplitude: PeakToPeak) -> bool {
        let seen = self.seen();
        seen.tripped.is_none() && seen.row.is_some_and(|row| row.armed && reached(&row, amplitude))
    }
}

/// Notes the loop's rows. A signal stops the drive from here, since whoever asks the questions may wait for an answer.
fn watch(mut handle: LoopHandle, seen: &Mutex<Seen>, interrupted: &AtomicBool, ended: &AtomicBool) {
    let mut stopped = false;
    while !ended.load(Ordering::Acquire) {
        if !stopped && interrupted.load(Ordering::Relaxed) {
            stopped = true;
            handle.stop();
        }
        if let Some(row) = handle.next_row() {
            let mut seen = seen.lock().unwrap_or_else(PoisonError::into_inner);
            seen.tripped = row.tripped.or(seen.tripped);
            seen.row = Some(row);
        }
    }
}

fn reached(row: &Row, amplitude: PeakToPeak) -> bool {
    (row.drive_pp_m - amplitude.metres()).abs() <= 1e-3 * amplitude.metres()
}
