//! The loop's thread by itself, in wall-clock time: what it tells safety, and what it tells the ports at its end.
//!
//! Bounds are generous and counts are compared with counts, so that a busy machine makes these tests slow and not wrong.

use super::*;
use crate::cycle::{Command, Marker};
use crate::estimate::EstimateConfig;
use crate::ports::{
    Amplifier, AmplifierState, ForceSensor, Forces, NoData, Quality, Sample, Stage, StageState,
};
use crate::safety::{Limits, Request, TripCause};
use models::{PeakToPeak, SpringSlider};
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer, Observer, Split};
use std::sync::Mutex;
use std::time::Duration;

mod parts;

use parts::touch_new_pages;

const PERIOD: Nanos = Nanos(5_000_000);

/// The commands that the rig got, and what it is to do.
#[derive(Default)]
struct Scene {
    /// Every drive command, as enable.
    drives: Vec<bool>,
    /// Stage commands that move nothing, at the end.
    stops: usize,
    /// How long the force port blocks in each cycle.
    blocks: Duration,
    /// The force port panics.
    panics: bool,
    /// New pages that the force port touches, once.
    touches: usize,
}

#[derive(Clone)]
struct Rig {
    scene: Arc<Mutex<Scene>>,
    sequence: u32,
    last: DriveCommand,
}

fn reading(value: f64, sequence: u32, taken_at: Nanos) -> Sample {
    Sample { value, raw: i64::from(sequence % 97), taken_at, sequence, quality: Quality::Good }
}

impl ForceSensor for Rig {
    fn read(&mut self, now: Nanos) -> Forces {
        let (blocks, panics, touches) = {
            let mut scene = self.scene.lock().unwrap();
            (scene.blocks, scene.panics, std::mem::take(&mut scene.touches))
        };
        assert!(!panics, "the port gives up");
        touch_new_pages(touches);
        sleep_until(monotonic_ns() + blocks.as_nanos() as u64);
        self.sequence += 1;
        Forces { lateral: Ok(reading(0.0, self.sequence, now)), normal: Ok(reading(0.0, self.sequence, now)) }
    }
}

impl Amplifier for Rig {
    fn command(&mut self, command: DriveCommand, _: Nanos) {
        self.last = command;
        self.scene.lock().unwrap().drives.push(command.enable());
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        self.sequence += 1;
        Ok(AmplifierState {
            amplitude: Ok(reading(self.last.amplitude().metres(), self.sequence, now)),
            echoed_amplitude: self.last.amplitude(),
            echoed_frequency_hz: self.last.frequency_hz(),
            output_on: self.last.enable(),
            watchdog_tripped: false,
            fault: false,
            temperature_c: Ok(reading(25.0, self.sequence, now)),
            taken_at: now,
            sequence: self.sequence,
        })
    }
}

impl Stage for Rig {
    fn command(&mut self, command: StageCommand, _: Nanos) {
        let still = command.velocity_m_s() == 0.0 && command.normal_force_n() == 0.0;
        self.scene.lock().unwrap().stops += usize::from(still);
    }

    fn state(&mut self, now: Nanos) -> Result<StageState, NoData> {
        self.sequence += 1;
        Ok(StageState {
            position_m: 0.0,
            velocity_m_s: 0.0,
            at_limit: false,
            fault: false,
            taken_at: now,
            sequence: self.sequence,
        })
    }
}

/// A loop on a thread of its own, and what one needs to lead it.
struct Running {
    scene: Arc<Mutex<Scene>>,
    queue: Arc<CommandQueue>,
    life: Arc<Lifeline>,
    rows: ringbuf::HeapCons<Row>,
    thread: std::thread::JoinHandle<LoopReport>,
}

impl Running {
    fn start(late_in_a_row_max: u32) -> Self {
        Self::with(late_in_a_row_max, 16384, Scene::default())
    }

    fn with(late_in_a_row_max: u32, rows: usize, scene: Scene) -> Self {
        let mut limits = Limits::paper(PERIOD);
        (limits.late_in_a_row_max, limits.late_cycles_max) = (late_in_a_row_max, 100);
        for channel in [
            &mut limits.timing.lateral,
            &mut limits.timing.normal,
            &mut limits.timing.amplifier,
            &mut limits.timing.stage,
        ] {
            channel.latency = Nanos(50_000_000);
        }
        let estimate = EstimateConfig { window: 50, normal_force_min_n: 0.02, sample_sd_n: 0.002 };
        let scene = Arc::new(Mutex::new(scene));
        let rig = Rig { scene: Arc::clone(&scene), sequence: 0, last: DriveCommand::off(0, PERIOD) };
        let queue = Arc::new(CommandQueue::new(64));
        let life = Arc::new(Lifeline::default());
        let (rows_in, rows) = HeapRb::<Row>::new(rows).split();
        let (watch, _) = HeapRb::<Row>::new(1).split();
        let parts = LoopParts {
            config: Config { limits: limits.checked().unwrap(), estimate, exposed: Default::default() },
            model: Arc::new(SpringSlider::new(models::finger::Finger::paper()).unwrap()),
            ports: Ports::new(Box::new(rig.clone()), Box::new(rig.clone()), Box::new(rig)),
            commands: Arc::clone(&queue),
            rows: rows_in,
            watch,
            life: Arc::clone(&life),
            origin_ns: monotonic_ns(),
            held: None,
        };
        let thread = std::thread::spawn(move || run(parts, Pacing::default()));
        Running { scene, queue, life, rows, thread }
    }

    /// The first row with that property, within ten seconds.
    fn until(&mut self, what: &str, mut is: impl FnMut(&Row) -> bool) -> Row {
        let end = monotonic_ns() + 10_000_000_000;
        while monotonic_ns() < end {
            match self.rows.try_pop() {
                Some(row) if is(&row) => return row,
                Some(_) => {}
                None => sleep_until(monotonic_ns() + 1_000_000),
            }
        }
        panic!("not within ten seconds: {what}")
    }

    /// Armed and driving.
    fn driving(late_in_a_row_max: u32) -> Self {
        let mut running = Self::start(late_in_a_row_max);
        for _ in 0..20 {
            running.until("nothing in the way", |row| row.blocking.is_none());
            running.queue.push(Command::Reset).unwrap();
            let row = running.until("an answer to the reset", |row| row.inputs.commands[0].is_some());
            if row.armed {
                break;
            }
        }
        let request = Request {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            ..Request::default()
        };
        running.queue.push(Command::Set(request, Marker::default())).unwrap();
        running.until("the drive", |row| row.drive_pp_m > 0.0);
        running
    }

    fn end(self) -> (LoopReport, Arc<Mutex<Scene>>) {
        self.life.end.store(true, Ordering::Relaxed);
        (self.thread.join().unwrap(), self.scene)
    }
}

#[test]
fn a_blocked_port_is_lateness_overruns_and_a_trip() {
    let mut running = Running::driving(20);
    // Each turn takes 30 periods: of 31 deadlines one is run.
    running.scene.lock().unwrap().blocks = Duration::from_nanos(30 * PERIOD.0);
    let before = running.rows.try_iter_last_cycle();
    let row = running.until("a trip", |row| row.tripped.is_some());
    let trip = row.tripped.unwrap();
    assert!(matches!(trip.cause, TripCause::Overrun | TripCause::Suspended), "{trip:?}");
    assert!(row.cycle <= before + 3, "cycle {} after {before}", row.cycle);
    assert!(row.drive_pp_m == 0.0 && row.inputs.seen.missed(PERIOD) >= 30);
    running.until("some more", |row| row.cycle > before + 10);
    let (report, _) = running.end();
    assert!(report.overruns >= 8 * 30, "{}", report.overruns);
    // Corrected for omission: nearly all deadlines since then were late, so the upper quantiles must say so.
    assert!(report.lateness_ns[3] > 20 * PERIOD.0, "{:?}", report.lateness_ns);
    let counted: u64 = report.histogram.iter().map(|(_, n)| n).sum();
    assert!(
        counted + 1 >= report.cycles + report.overruns,
        "{counted} {} {}",
        report.cycles,
        report.overruns
    );
}

trait LastCycle {
    fn try_iter_last_cycle(&mut self) -> u64;
}

impl LastCycle for ringbuf::HeapCons<Row> {
    /// Number of the newest row that waits, or of the next one.
    fn try_iter_last_cycle(&mut self) -> u64 {
        loop {
            let mut last = None;
            while let Some(row) = self.try_pop() {
                last = Some(row.cycle);
            }
            match last {
                Some(cycle) => return cycle,
                None => sleep_until(monotonic_ns() + 1_000_000),
            }
        }
    }
}

/// A record that takes no rows (a slow disk) costs the loop its rows, counted, and nothing else.
#[test]
fn a_full_ring_is_counted_and_holds_nothing_up() {
    let running = Running::start(50);
    sleep_until(monotonic_ns() + 300_000_000);
    let (report, _) = running.end();
    // The ring of the watch has one place, and nobody takes from it.
    assert_eq!(report.watch_drops, report.cycles - 1);
    assert_eq!(report.ring_drops, 0);
    assert!(report.cycles + report.overruns >= 50, "{report:?}");
    let running = Running::with(50, 1, Scene::default());
    sleep_until(monotonic_ns() + 100_000_000);
    let Running { life, thread, rows, .. } = running;
    life.end.store(true, Ordering::Relaxed);
    let report = thread.join().unwrap();
    assert_eq!((report.ring_drops, rows.occupied_len()), (report.cycles - 1, 1));
}

#[test]
fn a_port_that_panics_ends_the_loop_with_the_drive_off() {
    let running = Running::driving(50);
    running.scene.lock().unwrap().panics = true;
    let report = running.thread.join().unwrap();
    assert_eq!(report.panicked.as_deref(), Some("the port gives up"));
    let scene = running.scene.lock().unwrap();
    assert!(scene.drives.iter().any(|on| *on) && scene.drives.last() == Some(&false));
}

#[test]
fn the_end_of_the_loop_is_off_whatever_was_asked() {
    let running = Running::driving(50);
    let (report, scene) = running.end();
    assert_eq!(report.panicked, None);
    let scene = scene.lock().unwrap();
    assert!(scene.drives.iter().any(|on| *on) && scene.drives.last() == Some(&false));
    assert!(scene.stops > 0);
}

#[test]
fn a_stop_is_off_within_two_cycles_however_full_the_queue() {
    let mut running = Running::driving(50);
    let driven =
        Request { amplitude: PeakToPeak::from_metres(2e-6), frequency_hz: 27_500.0, ..Request::default() };
    while running.queue.push(Command::Set(driven, Marker::default())).is_ok() {}
    let at = running.rows.try_iter_last_cycle();
    while running.queue.push(Command::Set(driven, Marker::default())).is_ok() {}
    running.queue.stop();
    let row = running.until("the stop", |row| row.tripped.is_some());
    assert_eq!(row.tripped.map(|t| t.cause), Some(TripCause::Stopped));
    assert!(row.inputs.commands[0] == Some(Command::Stop) && row.drive_pp_m == 0.0);
    assert!(row.cycle <= at + 3, "{} after {at}", row.cycle);
    let later = running.until("later", |later| later.cycle >= row.cycle + 20);
    assert_eq!((later.drive_pp_m, later.armed), (0.0, false));
    running.end();
}

/// Deadlines are counted once each, run or skipped.
#[test]
fn the_grid_counts_every_deadline_once() {
    let mut grid = DeadlineGrid { period: 10, due: 100 };
    assert_eq!((grid.next(93), grid.begin(101)), (100, (1, 0)));
    // The turn ends at 145: deadlines 110 to 140 are past, the cycle begins at 150 and is late by 40.
    assert_eq!(grid.next(145), 150);
    assert_eq!(grid.begin(151), (41, 4));
    // Woken late by 33 from 160: 160 to 180 are missed, 190 is run.
    assert_eq!((grid.next(155), grid.begin(193), grid.due), (160, (33, 3), 200));
    // On the deadline itself is in time.
    assert_eq!((grid.next(200), grid.begin(200)), (200, (0, 0)));
    assert_eq!((grid.next(220), grid.begin(220)), (220, (10, 1)));
}

/// Runs in a child process of the test below: says when it drives, and what tripped it.
#[test]
#[ignore = "a part of `a_process_that_was_stopped_trips_first_thing`"]
fn suspended_child() {
    let mut running = Running::driving(50);
    println!("driving");
    let row = running.until("a trip", |row| row.tripped.is_some());
    println!("tripped {:?} {}", row.tripped.unwrap().cause, row.drive_pp_m);
    running.end();
}

#[test]
fn a_process_that_was_stopped_trips_first_thing() {
    use std::io::BufRead;
    let mut child = std::process::Command::new(std::env::current_exe().unwrap())
        .args(["--exact", "pacing::thread::tests::suspended_child", "--ignored", "--nocapture"])
        .stdout(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    let mut lines = std::io::BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("driving")));
    let signal = |signal| {
        // SAFETY: a signal to a child that was not waited for yet: its number is still its own.
        unsafe { libc::kill(child.id() as libc::pid_t, signal) };
    };
    signal(libc::SIGSTOP);
    sleep_until(monotonic_ns() + 500_000_000);
    signal(libc::SIGCONT);
    let line = lines.find(|line| line.contains("tripped")).unwrap();
    child.wait().unwrap();
    assert!(line.contains("tripped Suspended 0"), "{line}");
}
