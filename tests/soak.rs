//! Long runs: nothing trips, nothing grows.
//!
//! Short by default. One simulated day: `MUPRIME_SOAK_VIRTUAL_S=86400 cargo test --release -p muprime-tests
//! --test soak virtual_time -- --nocapture`.

use models::prediction::{EmpiricalPsi, FrictionModel, Prediction};
use models::{Condition, OutOfDomain};
use realtime::cycle::{Command, CycleState};
use realtime::cycle_io::{Ports, Tick, run_cycle};
use realtime::recorder::{Preamble, Recorder};
use realtime::{Nanos, TripCause};
use runs::plan::{Plan, Resolution};
use runs::{Outcome, Setup, Sweep};
use sim::virtual_rig::VirtualRig;
use sim::world::WorldConfig;
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use tests::served::{self, resident_bytes};

const MIB: u64 = 1 << 20;
/// One row in so many goes into the record of a day.
const DECIMATED: u64 = 1000;

fn seconds(name: &str, short: u64) -> u64 {
    std::env::var(name).map_or(short, |s| s.parse().unwrap_or_else(|_| panic!("{name} is whole seconds")))
}

/// A law that is asked anew only where what it depends on has changed by a twentieth: the loop predicts in
/// every cycle, and 86 million predictions would take most of the day's time.
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
        Sweep::new(points, plan.file.pass, Arc::clone(&model) as _, &setup.tip, setup.file.noise)
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
    for number in 1..=cycles {
        let now = Nanos(number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        let row = run_cycle(&config, &*model, &mut state, &mut ports, &mut || queue.pop_front(), tick);
        // Every sweep ends with a stop, which latches as it must; nothing else does.
        let stopped = std::mem::take(&mut ended).then_some(TripCause::Stopped);
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
    println!(
        "{day} s in virtual time: {sweeps} sweeps, {passes} passes, 0 trips; memory grew by {} KiB \
         from a twentieth of it to its end; {rows} rows kept, one in {DECIMATED}",
        grown / 1024
    );
    assert!(sweeps >= 2 && passes >= 16);
    assert!(grown < MIB, "memory grew by {grown} bytes");
    let read = tests::contents::read(&std::fs::read(&path).unwrap());
    assert_eq!((read.rows().count() as u64, tests::contents::complete(&read.integrity)), (rows, true));
}
