//! Long runs: nothing trips, nothing grows.
//!
//! Short by default. One simulated day, and thirty minutes of wall-clock time over Modbus TCP to a rig in another process:
//! `MUPRIME_SOAK_VIRTUAL_S=86400 cargo test --release -p muprime-tests --test soak virtual_time -- --nocapture` and
//! `MUPRIME_SOAK_WIRE_S=1800 cargo test --release -p muprime-tests --test soak over_the_wire -- --nocapture`.

use models::condition::{Condition, OutOfDomain};
use models::prediction::{EmpiricalPsi, FrictionModel, Prediction};
use realtime::cycle::{Command, CycleState};
use realtime::ports::Nanos;
use realtime::recorder::{Preamble, Recorder};
use realtime::safety::Cause;
use realtime::turn::{Ports, Tick, turn};
use runs::plan::{Plan, Resolution};
use runs::sequence::{Outcome, Sequence};
use runs::session::Summary;
use runs::setup::Setup;
use sim::virtual_rig::VirtualRig;
use sim::world::WorldConfig;
use std::collections::{BTreeMap, VecDeque};
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tests::muprime;
use tests::served::{self, ServedRig, resident_bytes};

const MIB: u64 = 1 << 20;
/// One row in so many goes into the record of a day.
const DECIMATED: u64 = 1000;

fn seconds(name: &str, short: u64) -> u64 {
    std::env::var(name).map_or(short, |s| s.parse().unwrap_or_else(|_| panic!("{name} is whole seconds")))
}

/// A law that is asked anew only where what it depends on has changed by a twentieth: the loop predicts in every cycle, and 86
/// million predictions would take most of the day's time.
struct Held(EmpiricalPsi, Mutex<Option<(Condition, Prediction)>>);

impl FrictionModel for Held {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn predict(&self, now: &Condition) -> Result<Prediction, OutOfDomain> {
        let near = |a: f64, b: f64| (a - b).abs() <= 0.05 * b.abs();
        let mut held = self.1.lock().unwrap();
        if let Some((then, prediction)) = &*held
            && near(now.amplitude.metres(), then.amplitude.metres())
            && near(now.frequency_hz, then.frequency_hz)
            && near(now.speed_m_s, then.speed_m_s)
            && near(now.normal_force_n, then.normal_force_n)
            && near(now.mu0, then.mu0)
        {
            return Ok(*prediction);
        }
        let prediction = self.0.predict(now)?;
        *held = Some((*now, prediction));
        Ok(prediction)
    }
}

/// Sweep after sweep in virtual time on one rig that is never opened anew.
#[test]
fn a_day_in_virtual_time_without_a_trip() {
    let day = seconds("MUPRIME_SOAK_VIRTUAL_S", 120);
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = served::timed_plan("soak", 4, &[0.5e-6, 1e-6, 2e-6, 3e-6, 4e-6, 5e-6], [0.15, 0.5]);
    let plan = Plan::parse("soak", &plan).unwrap();
    let config = setup.config;
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let model = Arc::new(Held(EmpiricalPsi::paper(setup.tip.finger).unwrap(), Mutex::default()));
    let sweep = |seed: u64| {
        let points = plan.points(seed, &config.limits, &resolution).unwrap();
        Sequence::new(points, plan.file.pass, Arc::clone(&model) as _, &setup.tip, setup.file.noise)
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("day.mcap");
    let file = std::fs::File::options().create_new(true).read(true).write(true).open(&path).unwrap();
    let preamble = Preamble { start_unix_ns: 0, facts: BTreeMap::new(), files: Vec::new() };
    let mut recorder = Recorder::begin(file, preamble).unwrap();

    let [force, amplifier, stage] = VirtualRig::new(&WorldConfig::ideal(), 1).unwrap().split();
    let mut ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut state = CycleState::default();
    let mut queue: VecDeque<Command> = VecDeque::new();
    let (mut sweeps, mut passes, mut rows, mut ended, mut rest) = (0u64, 0u64, 0u64, false, 0);
    let mut sequence = sweep(0);
    let (cycles, mut warm) = (day * 1000, None);
    let begun = Instant::now();
    for number in 1..=cycles {
        let now = Nanos(number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        let row = turn(&config, &*model, &mut state, &mut ports, &mut || queue.pop_front(), tick);
        // Every sweep ends with a stop, which latches as it must; nothing else does.
        let stopped = std::mem::take(&mut ended).then_some(Cause::Stopped);
        assert_eq!(row.tripped.map(|t| t.cause), stopped, "after {:.3} s", now.seconds());
        if number.is_multiple_of(DECIMATED) {
            recorder.row(&row).unwrap();
            rows += 1;
        }
        if number.is_multiple_of(50 * DECIMATED) {
            recorder.flush().unwrap();
        }
        if number == cycles / 20 {
            warm = resident_bytes(std::process::id());
        }
        if rest > 0 {
            rest -= 1;
            continue;
        }
        let reaction = sequence.on_row(&row);
        passes += u64::from(reaction.pass.is_some());
        queue.extend(reaction.commands);
        if let Some(outcome) = reaction.outcome {
            assert_eq!(outcome, Outcome::Complete, "after {:.3} s", now.seconds());
            // The stop reaches the rig before the next sweep looks at it.
            (sweeps, ended, rest) = (sweeps + 1, true, 20);
            sequence = sweep(sweeps);
        }
    }
    let grown = resident_bytes(std::process::id()).unwrap().saturating_sub(warm.unwrap());
    recorder.end(BTreeMap::new()).unwrap();
    let wall = begun.elapsed().as_secs_f64();
    println!(
        "{day} s in virtual time ({:.0} times real time): {sweeps} sweeps, {passes} passes, 0 trips; memory grew by {} KiB \
         from a twentieth of it to its end; {rows} rows kept, one in {DECIMATED}",
        day as f64 / wall,
        grown / 1024
    );
    assert!(sweeps >= 2 && passes >= 16);
    assert!(grown < MIB, "memory grew by {grown} bytes");
    let read = realtime::recorder::read(&std::fs::read(&path).unwrap());
    assert_eq!((read.rows().count() as u64, read.integrity.complete()), (rows, true));
}

/// One session of `muprime run` against a rig in another process.
struct SessionSeen {
    lasted: Duration,
    /// Resident memory of the controller after it warmed up, and at the end, in bytes.
    warm_and_last: Option<(u64, u64)>,
    summary: Summary,
}

/// Wall-clock time, real Modbus TCP, two processes. A trip needs a stall of the machine that a witness recorded; the sweep is
/// then taken up again, as its user would.
#[test]
fn half_an_hour_over_the_wire_without_a_trip_that_the_machine_did_not_cause() {
    tests::in_wall_clock_time(|| {
        let wanted = Duration::from_secs(seconds("MUPRIME_SOAK_WIRE_S", 12));
        // Allocators, thread stacks and the record's chunks come to rest within a minute.
        let warm_up = (wanted / 5).min(Duration::from_secs(60));
        let folder = tempfile::tempdir().unwrap();
        let rig = ServedRig::start(5, None);
        let amplitudes: Vec<f64> = (1..=10).map(|i| f64::from(i) * 0.5e-6).collect();
        let plan = served::timed_plan("soak", 4, &amplitudes, [0.2, 1.0])
            .replace("seed = 3", &format!("seed = 3\nreplicates = {}", 1 + wanted.as_secs() / 10));
        let (plan_file, setup_file) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
        std::fs::write(&plan_file, plan).unwrap();
        let setup = served::setup("soak", rig.address).replace("rate_hz = 250", "rate_hz = 1000");
        std::fs::write(&setup_file, setup).unwrap();
        let rig_warm = resident_bytes(rig.process.id()).unwrap();
        let (begun, mut sessions) = (Instant::now(), Vec::new());
        while begun.elapsed() < wanted {
            let left = wanted - begun.elapsed();
            let mut child = muprime()
                .args(["--json", "run"])
                .arg(&plan_file)
                .arg("--setup")
                .arg(&setup_file)
                .arg("--out")
                .arg(folder.path().join("run"))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            let (started, mut seen) = (Instant::now(), Vec::new());
            let status = loop {
                std::thread::sleep(Duration::from_millis(200));
                if let Some(status) = child.try_wait().unwrap() {
                    break status;
                }
                if started.elapsed() >= left {
                    // SIGINT: an orderly stop.
                    // SAFETY: a signal to a child that has not been waited for: its id is still its own.
                    unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
                    break child.wait().unwrap();
                }
                seen.extend(resident_bytes(child.id()).map(|bytes| (started.elapsed(), bytes)));
            };
            let said = std::fs::read(folder.path().join("run/summary.json")).unwrap();
            let summary: Summary = serde_json::from_slice(&said).unwrap();
            let lasted = started.elapsed();
            match &summary.outcome {
                Outcome::Complete => assert_eq!(status.code(), Some(0)),
                Outcome::Stopped => assert_eq!(status.code(), Some(1)),
                Outcome::Tripped(trip) => {
                    let before = Nanos(trip.at.0.saturating_sub(300_000_000));
                    let stalls = summary.stalls.as_ref().unwrap();
                    let stall = stalls.within(before, trip.at);
                    let stall = stall.unwrap_or_else(|| panic!("{trip:?} without a recorded stall"));
                    println!(
                        "session {}: {:?} after {:.0} s, the machine stalled for {:.0} ms",
                        sessions.len() + 1,
                        trip.cause,
                        lasted.as_secs_f64(),
                        stall.lasted.seconds() * 1e3
                    );
                }
                other => panic!("{other:?}"),
            }
            // After the loop's end the report is written: its memory is not the loop's.
            let looped = Duration::from_millis(summary.loop_report.as_ref().unwrap().cycles);
            let mut steady =
                seen.iter().filter(|(at, _)| *at >= warm_up && *at <= looped).map(|(_, bytes)| *bytes);
            let warm = steady.next();
            sessions.push(SessionSeen { lasted, warm_and_last: warm.zip(steady.next_back()), summary });
        }
        let longest = sessions.iter().max_by_key(|s| s.lasted).unwrap();
        let (warm, last) = longest.warm_and_last.expect("no session was longer than its warm-up");
        let grown = last.saturating_sub(warm);
        let report = longest.summary.loop_report.as_ref().unwrap();
        let cycles: u64 =
            sessions.iter().filter_map(|s| s.summary.loop_report.as_ref()).map(|r| r.cycles).sum();
        let rig_grown = resident_bytes(rig.process.id()).unwrap().saturating_sub(rig_warm);
        println!(
            "{:.0} s over Modbus TCP, {cycles} cycles, {} session(s), {} trip(s), each with a recorded stall; the longest, {:.0} s: \
         {} passes, {} overruns, {} rows dropped, memory {:.1} MiB and {} KiB more at its end; the rig's {} KiB more since its \
         start",
            begun.elapsed().as_secs_f64(),
            sessions.len(),
            sessions.iter().filter(|s| matches!(s.summary.outcome, Outcome::Tripped(_))).count(),
            longest.lasted.as_secs_f64(),
            longest.summary.passes,
            report.overruns,
            report.ring_drops,
            warm as f64 / MIB as f64,
            grown / 1024,
            rig_grown / 1024
        );
        assert!(grown < MIB, "memory grew by {grown} bytes");
    });
}
