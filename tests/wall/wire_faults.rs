//! Faults in wall-clock time: the rig in one process, its controller in another, Modbus TCP between them.
//!
//! Each trip must match what was injected, or a stall of the machine that the monitor recorded (then the case
//! is run again, seven times at most); reactions are judged on the virtual amplifier's own clock.

use realtime::Nanos;
use realtime::safety::{Trip, TripCause};
use runs::{Outcome, Summary};
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};
use tests::served::{self, AmplifierSaid, AmplifierWatch, ServedRig};
use tests::{file, muprime, texts};

/// When a fault strikes, by the rig's clock: long after the plate is driven.
const STRIKES_S: f64 = 3.0;
/// How long it lasts: the amplifier can be asked again after it.
const LASTS_S: f64 = 1.0;
/// Of the loop: at 1 kHz a machine that takes a CPU away for some milliseconds at a time cuts one run after
/// another. How soon each rule trips at 1 kHz is measured in virtual time (`tests/faults.rs`).
const CYCLE_MS: f64 = 4.0;
/// Of a rule that counts cycles: the setup lets a tenth of them be missed without a trip.
const CYCLES_MADE_UP: f64 = 1.1;
/// Of a force or state that is silent: what the setup lets a link be held up, and three of its periods.
const SILENT_MS: f64 = 45.0 + 3.0 * CYCLE_MS;
/// Beside a rule's own time: two polls and a write (1 to 2 ms each), the state's period, the world's step, and the cycle that sees it.
const ON_THE_WAY_MS: f64 = 10.0 + CYCLE_MS;
/// What the machine may add unseen: six threads stand between a fault and the lamp, and the monitor notes delays of 3 ms and
/// more. A case that is late by less is run again; one whose bound is wrong is late each time.
const UNSEEN_MS: f64 = 6.0 * 3.0;
/// The amplifier's own heartbeat timeout, the age of a state and the world's step.
const WATCHDOG_MS: f64 = 51.5;

/// How well the strike's instant is known: an answer's way and the age of the clock in it.
const STRIKE_KNOWN_TO: Duration = Duration::from_millis(2);

/// One sweep at a time: two would take each other's processors.
static ALONE: Mutex<()> = Mutex::new(());

struct Case {
    channel: &'static str,
    fault: &'static str,
    strength: f64,
    /// Causes that match it.
    causes: &'static [TripCause],
    /// Time from the strike until the output is off, in ms; `None` where the fault blinds those who ask the amplifier.
    bound_ms: Option<f64>,
}

const FORCE: &[TripCause] =
    &[TripCause::LateralStale, TripCause::NormalStale, TripCause::LateralLossy, TripCause::NormalLossy];
/// What random numbers over the whole range may be taken for.
const WILD: &[TripCause] = &[
    TripCause::LateralOverforce,
    TripCause::NormalOverforce,
    TripCause::ForceRate,
    TripCause::LateralInvalid,
    TripCause::NormalInvalid,
    TripCause::LateralSaturated,
    TripCause::NormalSaturated,
    TripCause::Noisy,
];

const CASES: &[Case] = &[
    Case { channel: "force", fault: "off", strength: 0.0, causes: FORCE, bound_ms: Some(SILENT_MS) },
    Case { channel: "force", fault: "delayed", strength: 0.1, causes: FORCE, bound_ms: Some(SILENT_MS) },
    // A quarter of a hundred samples that are due must come, in the window that the fault begins in or in the next whole one.
    Case {
        channel: "force",
        fault: "intermittent",
        strength: 0.97,
        causes: FORCE,
        bound_ms: Some(2.0 * 100.0 * CYCLES_MADE_UP * CYCLE_MS),
    },
    // Fifty equal samples, of which the loop sees one a cycle.
    Case {
        channel: "force",
        fault: "stuck",
        strength: 0.0,
        causes: &[TripCause::LateralFrozen, TripCause::NormalFrozen],
        bound_ms: Some(50.0 * CYCLES_MADE_UP * CYCLE_MS),
    },
    Case { channel: "force", fault: "garbage", strength: 0.0, causes: WILD, bound_ms: Some(4.0 * CYCLE_MS) },
    Case { channel: "force", fault: "wrong", strength: 20.0, causes: WILD, bound_ms: Some(2.0 * CYCLE_MS) },
    Case {
        channel: "stage",
        fault: "off",
        strength: 0.0,
        causes: &[TripCause::StageStale],
        bound_ms: Some(SILENT_MS + 20.0),
    },
    Case {
        channel: "stage",
        fault: "garbage",
        strength: 0.0,
        causes: &[TripCause::StageFault, TripCause::OverTravel, TripCause::StageNotFollowing],
        bound_ms: Some(20.0),
    },
    Case {
        channel: "amplifier",
        fault: "off",
        strength: 0.0,
        causes: &[TripCause::AmplifierStale, TripCause::AmplifierWatchdog],
        bound_ms: None,
    },
    Case {
        channel: "amplifier",
        fault: "garbage",
        strength: 0.0,
        causes: &[
            TripCause::OverAmplitude,
            TripCause::AmplitudeRunaway,
            TripCause::AmplitudeRate,
            TripCause::AmplifierFault,
            TripCause::OverTemperature,
            TripCause::DriveNoResponse,
        ],
        bound_ms: None,
    },
    Case {
        channel: "amplifier",
        fault: "delayed",
        strength: 0.2,
        causes: &[TripCause::AmplifierStale],
        bound_ms: None,
    },
];

/// A controller at work on a served rig.
struct Running {
    rig: ServedRig,
    controller: Child,
    out: PathBuf,
    watch: AmplifierWatch,
    _folder: tempfile::TempDir,
}

impl Running {
    fn start(defects: Option<&str>, change: impl FnOnce(&mut std::process::Command, &Path)) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        let defects = defects.map(|text| {
            std::fs::write(path("defects.toml"), text).unwrap();
            path("defects.toml")
        });
        let rig = ServedRig::start(5, defects.as_deref());
        // Long passes: the plate is driven nearly all the time.
        let plan = served::timed_plan("faults", 0, &[2e-6, 2.5e-6, 3e-6, 3.5e-6], [0.1, 1.5]);
        std::fs::write(path("plan.toml"), plan).unwrap();
        std::fs::write(path("setup.toml"), served::setup("faults", rig.address)).unwrap();
        let out = path("run");
        let mut command = muprime();
        command.args(["--json", "run"]).arg(path("plan.toml")).arg("--setup").arg(path("setup.toml"));
        command.arg("--out").arg(&out).stdout(Stdio::piped()).stderr(Stdio::piped());
        change(&mut command, folder.path());
        let controller = command.spawn().unwrap();
        let watch = AmplifierWatch::connect(rig.address);
        Running { rig, controller, out, watch, _folder: folder }
    }

    /// Waits until the output has been on for a while.
    ///
    /// # Errors
    /// The machine stalled, and the controller tripped for it.
    fn until_driven(&mut self) -> Result<AmplifierSaid, String> {
        let begun = Instant::now();
        let mut on = 0;
        loop {
            let said = self.watch.read();
            on = if said.on { on + 1 } else { 0 };
            if on > 100 {
                return Ok(said);
            }
            assert!(begun.elapsed() < Duration::from_secs(30), "the plate is never driven");
            if self.controller.try_wait().unwrap().is_some() {
                return Err(wall::cut_by_a_stall(&self.out).expect("a controller leaves for a stall alone"));
            }
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    fn signal(&self, pid: u32, signal: i32) {
        // SAFETY: a signal to a child that has not been waited for: its id is still its own.
        let failed = unsafe { libc::kill(pid as i32, signal) };
        assert_eq!(failed, 0, "{signal} to {pid} ({})", self.out.display());
    }

    /// The end of the run: its status and summary.
    fn end(self) -> (Option<i32>, Summary) {
        let output = self.controller.wait_with_output().unwrap();
        let said = std::fs::read(self.out.join("summary.json"));
        let (_, stderr) = texts(&output);
        let said = said.unwrap_or_else(|e| panic!("no summary: {e}\n{stderr}"));
        (output.status.code(), serde_json::from_slice(&said).unwrap())
    }
}

/// The longest stall that the monitor recorded in the 300 ms before a time, in ms.
fn stall_before(summary: &Summary, at: Nanos) -> Option<f64> {
    let before = Nanos(at.0.saturating_sub(300_000_000));
    summary.stalls.as_ref().unwrap().within(before, at).map(|s| s.lasted.seconds() * 1e3)
}

fn tripped(summary: &Summary) -> Option<Trip> {
    match &summary.outcome {
        Outcome::Tripped(trip) => Some(*trip),
        _ => None,
    }
}

/// The instant at which the controller said that it tripped.
fn said_trip(out: ChildStdout) -> Option<Instant> {
    let mut at = None;
    for line in BufReader::new(out).lines().map_while(Result::ok) {
        if line.contains("\"tripped\"") {
            at = at.or(Some(Instant::now()));
        }
    }
    at
}

/// Runs a case once: a line of the table, or why the machine spoilt it.
fn strike(case: &Case) -> Result<String, String> {
    let name = format!("{} {}", case.channel, case.fault);
    let strength =
        if case.strength == 0.0 { String::new() } else { format!("strength = {:?}\n", case.strength) };
    let defects = format!(
        "[[channel]]\nchannel = \"{}\"\nfault = \"{}\"\nfrom_s = {STRIKES_S:?}\nuntil_s = {:?}\n{strength}",
        case.channel,
        case.fault,
        STRIKES_S + LASTS_S
    );
    let mut running = Running::start(Some(&defects), |_, _| {});
    let saying = running.controller.stdout.take().unwrap();
    let saying = std::thread::spawn(move || said_trip(saying));
    let strikes_us = (STRIKES_S * 1e6) as u32;
    // The amplifier is asked until well after the fault; its clock is the rig's.
    let (mut on_at_strike, mut off_at_us) = (false, None);
    // A fault may hold up what the amplifier says: when it strikes is worked out beforehand. An answer that comes late makes
    // the rig's clock look slow, never fast: of all answers the one that came soonest is right.
    let mut strike_instant = Instant::now() + Duration::from_secs(60);
    while Instant::now() < strike_instant {
        let said = running.watch.read();
        let left = Duration::from_micros(u64::from(strikes_us.saturating_sub(said.time_us)));
        strike_instant = strike_instant.min(Instant::now() + left);
        on_at_strike = said.on;
        std::thread::sleep(Duration::from_millis(1));
    }
    loop {
        let said = running.watch.read();
        // Off for good: between two passes it goes off and on again.
        off_at_us = if said.on { None } else { off_at_us.or(Some(said.time_us)) };
        if strike_instant.elapsed() > Duration::from_secs_f64(LASTS_S + 0.5) {
            // Whatever the fault was, it is over: what the amplifier says now is true.
            break;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let (status, summary) = running.end();
    let told = saying.join().unwrap();
    let Some(trip) = tripped(&summary) else {
        panic!("{name}: no trip, but {:?}", summary.outcome);
    };
    assert_eq!(status, Some(1), "{name}");
    let machine = stall_before(&summary, trip.at);
    let after_ms = told.unwrap().saturating_duration_since(strike_instant).as_secs_f64() * 1e3;
    let matches = case.causes.contains(&trip.cause) && told.unwrap() + STRIKE_KNOWN_TO >= strike_instant;
    if !matches {
        let stall = machine.unwrap_or_else(|| panic!("{name}: {trip:?} matches neither fault nor stall"));
        return Err(format!("{name}: {:?}, the machine stalled for {stall:.0} ms", trip.cause));
    }
    let off_at_us = off_at_us.unwrap_or_else(|| panic!("{name}: on again, or still"));
    if !on_at_strike {
        return Err(format!("{name}: it struck between two passes"));
    }
    let Some(bound_ms) = case.bound_ms else {
        return Ok(format!(
            "{name:<22} {:<18} told after {after_ms:>4.0} ms; off when it could be asked again",
            format!("{:?}", trip.cause)
        ));
    };
    let took_ms = f64::from(off_at_us.saturating_sub(strikes_us)) * 1e-3;
    let bound_ms = bound_ms + ON_THE_WAY_MS;
    if took_ms > bound_ms {
        let late = format!("{name}: off after {took_ms:.1} ms, bound {bound_ms:.1}");
        assert!(machine.is_some() || took_ms <= bound_ms + UNSEEN_MS, "{late}");
        let stall = machine.map_or(String::new(), |stall| format!(", the machine stalled for {stall:.0} ms"));
        return Err(format!("{late}{stall}"));
    }
    Ok(format!(
        "{name:<22} {:<18} off after {took_ms:>5.1} ms, bound {bound_ms:.1}",
        format!("{:?}", trip.cause)
    ))
}

/// Tries until the machine does not spoil it, eight times at most.
fn tried<T>(mut once: impl FnMut() -> Result<T, String>) -> T {
    for attempt in 1..=8 {
        match once() {
            Ok(found) => return found,
            Err(why) => println!("attempt {attempt}: {why}"),
        }
    }
    panic!("the machine is too busy for a test in wall-clock time");
}

#[test]
fn each_fault_of_a_channel_trips_with_its_cause_and_the_amplifier_is_off_in_time() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        for case in CASES {
            println!("{}", tried(|| strike(case)));
        }
    });
}

/// The controller stands still for half a second: the amplifier's own watchdog drops the output, and the
/// controller's first cycle afterwards trips.
#[test]
fn a_stopped_controller_is_outlived_by_the_amplifiers_watchdog_and_trips_when_it_goes_on() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let line = tried(|| {
            let mut running = Running::start(None, |_, _| {});
            let mut last = running.until_driven()?;
            running.signal(running.controller.id(), libc::SIGSTOP);
            let (mut fed_us, mut longest_us, stopped) = (last.time_us, 0, Instant::now());
            while stopped.elapsed() < Duration::from_millis(500) {
                let said = running.watch.read();
                if said.heartbeat != last.heartbeat {
                    fed_us = said.time_us;
                }
                if said.on {
                    longest_us = said.time_us.wrapping_sub(fed_us);
                }
                last = said;
            }
            assert!(
                !last.on && f64::from(longest_us) * 1e-3 <= WATCHDOG_MS,
                "{last:?}, on for {longest_us} us"
            );
            running.signal(running.controller.id(), libc::SIGCONT);
            while running.controller.try_wait().unwrap().is_none() {
                assert!(!running.watch.read().on, "on again after the controller was stopped");
                std::thread::sleep(Duration::from_millis(1));
            }
            let (status, summary) = running.end();
            let trip = tripped(&summary).expect("a trip");
            if trip.cause != TripCause::Suspended {
                let stall = stall_before(&summary, trip.at).unwrap_or_else(|| panic!("{trip:?}"));
                return Err(format!("{:?}, the machine stalled for {stall:.0} ms", trip.cause));
            }
            assert_eq!(status, Some(1));
            Ok(format!(
                "controller stopped for 500 ms: output on for {:.1} ms after its last heartbeat; then {:?}",
                f64::from(longest_us) * 1e-3,
                trip.cause
            ))
        });
        println!("{line}");
    });
}

/// The rig stands still: its controller trips on silence, and the output is off when the rig goes on.
#[test]
fn a_stopped_rig_trips_its_controller_and_is_off_when_it_goes_on() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let line = tried(|| {
            let mut running = Running::start(None, |_, _| {});
            running.until_driven()?;
            running.signal(running.rig.process.id(), libc::SIGSTOP);
            std::thread::sleep(Duration::from_millis(400));
            running.signal(running.rig.process.id(), libc::SIGCONT);
            let first = running.watch.read();
            assert!(!first.on, "the output outlived its heartbeat: {first:?}");
            while running.controller.try_wait().unwrap().is_none() {
                assert!(!running.watch.read().on, "on again");
                std::thread::sleep(Duration::from_millis(1));
            }
            let (status, summary) = running.end();
            let trip = tripped(&summary).expect("a trip");
            let silent = [
                TripCause::LateralStale,
                TripCause::NormalStale,
                TripCause::AmplifierStale,
                TripCause::StageStale,
                TripCause::AmplifierWatchdog,
            ];
            if !silent.contains(&trip.cause) {
                let stall = stall_before(&summary, trip.at).unwrap_or_else(|| panic!("{trip:?}"));
                return Err(format!("{:?}, the machine stalled for {stall:.0} ms", trip.cause));
            }
            assert_eq!(status, Some(1), "{trip:?}");
            Ok(format!("rig stopped for 400 ms: {:?}, off when it went on", trip.cause))
        });
        println!("{line}");
    });
}

/// A library that gives a program another wall clock, and nothing else another time.
fn jumping_clock(folder: &Path) -> PathBuf {
    let library = folder.join("jump.so");
    let mut cc = std::process::Command::new("cc");
    cc.args(["-shared", "-fPIC", "-O2", "-o"]).arg(&library).arg(file("tests/wall/wall_clock/jump.c"));
    let built = cc.output().expect("a C compiler is needed: tests/run installs it");
    assert!(built.status.success(), "{}", texts(&built).1);
    library
}

/// The wall clock jumps by an hour, forwards and back, while a sweep is driven: nothing trips, nothing is stamped by it.
#[test]
fn a_jump_of_the_wall_clock_trips_nothing_and_stamps_nothing_wrong() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let hours = |h: i64| format!("{}\n", h * 3600);
        let unix_s =
            || std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs_f64();
        let (ended_s, took_s, record) = tried(|| {
            let mut clock = PathBuf::new();
            let began = Instant::now();
            let mut running = Running::start(None, |command, folder| {
                clock = folder.join("clock");
                std::fs::write(&clock, hours(5)).unwrap();
                command.env("LD_PRELOAD", jumping_clock(folder)).env("WALL_CLOCK_JUMP", &clock);
            });
            running.until_driven()?;
            for h in [6, 4, 5] {
                std::fs::write(&clock, hours(h)).unwrap();
                std::thread::sleep(Duration::from_millis(700));
            }
            let record = running.out.join("run-1.mcap");
            let folder = tempfile::tempdir().unwrap();
            let copy = folder.path().join("record");
            // The folder goes with `running`: the record is copied when the run has ended.
            let status = running.controller.wait().unwrap();
            std::fs::copy(&record, &copy).unwrap();
            let (_, summary) = running.end();
            if let Some(trip) = tripped(&summary) {
                let stall =
                    stall_before(&summary, trip.at).unwrap_or_else(|| panic!("{trip:?} without a stall"));
                return Err(format!("{:?}, the machine stalled for {stall:.0} ms", trip.cause));
            }
            assert_eq!((status.code(), &summary.outcome), (Some(0), &Outcome::Complete));
            Ok((unix_s(), began.elapsed().as_secs_f64(), std::fs::read(copy).unwrap()))
        });
        let read = tests::contents::read(&record);
        // The program did live by the other clock: the record says five hours later.
        let start = &read.facts(realtime::recorder::HEADER).expect("a header")["start_unix_ns"];
        let start_s = start.parse::<f64>().unwrap() * 1e-9;
        assert!((start_s - ended_s - 5.0 * 3600.0).abs() < took_s + 60.0, "{start_s} {ended_s}");
        let times: Vec<u64> = read.rows().map(|r| r.now.0).collect();
        assert!(times.windows(2).all(|w| w[0] < w[1]), "times go on");
        let (first, last) = (times[0] as f64 * 1e-9, times[times.len() - 1] as f64 * 1e-9);
        assert!(first < 5.0 && last < took_s, "from {first} s to {last} s in {took_s} s");
        let gap = times.windows(2).map(|w| w[1] - w[0]).max().unwrap();
        assert!(gap < 1_000_000_000, "a gap of {gap} ns");
        println!(
            "the wall clock jumped by an hour three times in {last:.1} s: no trip, {} rows in order",
            times.len()
        );
    });
}
