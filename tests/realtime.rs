//! The promises that do not depend on the machine: the loop does not allocate, whatever the cycle does; the
//! record's writer holds no more memory after hours than after seconds.

use models::SpringSlider;
use realtime::Nanos;
use realtime::cycle::{Command, CycleState};
use realtime::cycle_io::{Ports, Row, Tick, run_cycle};
use realtime::recorder::{Entry, Preamble, Reader, Recorder};
use ringbuf::HeapRb;
use ringbuf::traits::{Consumer, Producer, Split};
use runs::plan::{Plan, Resolution};
use runs::{Setup, Sweep};
use sim::virtual_rig::VirtualRig;
use sim::world::WorldConfig;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static COUNT: Cell<u64> = const { Cell::new(0) };
    /// Bytes that the thread holds, since it asked, and the most that it held.
    static HELD: Cell<[i64; 2]> = const { Cell::new([0; 2]) };
}

/// The system's allocator, counting on threads that ask for it.
struct Counting;

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches thread-local cells only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        if COUNTING.get() {
            COUNT.set(COUNT.get() + 1);
            let [held, most] = HELD.get();
            let held = held + layout.size() as i64;
            HELD.set([held, most.max(held)]);
        }
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        if COUNTING.get() {
            COUNT.set(COUNT.get() + 1);
            let [held, most] = HELD.get();
            HELD.set([held - layout.size() as i64, most]);
        }
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Cycles of the sweep below: a million, or as many as `MUPRIME_CYCLES` says.
fn cycles() -> u64 {
    std::env::var("MUPRIME_CYCLES").ok().and_then(|n| n.parse().ok()).unwrap_or(1_000_000)
}

#[test]
fn no_allocation_in_a_million_cycles_of_a_sweep() {
    let finger = Setup::load("virtual").unwrap().tip.finger;
    no_allocation_in_a_sweep(Arc::new(SpringSlider::new(finger).unwrap()), cycles());
}

/// A table of five variables that covers the sweep, with an uncertainty: it answers in every driven cycle of
/// a pass.
#[test]
fn no_allocation_with_a_law_table() {
    use models::law_table::grid::LawGrid;
    let words = [
        "amplitude_pp_m=0.1e-6..8e-6:9:log",
        "frequency_hz=20e3..60e3:3",
        "speed_m_s=0.001..0.3:7:log",
        "normal_force_n=0.01..2:5:log",
        "mu0=0.05..3:3",
    ];
    let grid = LawGrid::parse(words).unwrap();
    let mu = |c: &Vec<f64>| [1.0 / (1.0 + c[0] * c[1] * c[4] / c[2]), 0.02];
    let made = grid.table(0, &grid.conditions(0).iter().map(mu).collect::<Vec<_>>()).unwrap();
    let law = runs::model_file::load("own.csv", &made.csv).unwrap();
    no_allocation_in_a_sweep(law, cycles() / 4);
}

fn no_allocation_in_a_sweep(model: Arc<dyn models::prediction::FrictionModel>, cycles: u64) {
    let setup = Setup::load("virtual").unwrap();
    let plan = Plan::load("first-sweep").unwrap();
    let mut compared = 0u64;
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let config = setup.config;
    let [force, amplifier, stage] = VirtualRig::new(&WorldConfig::bundled(), 3).unwrap().split();
    let mut ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let (mut rows, mut drain) = HeapRb::<Row>::new(64).split();
    let queue = crossbeam_queue::ArrayQueue::<Command>::new(64);
    let mut state = CycleState::default();
    let mut sequence = None;
    let (mut armed, mut driven) = (0u64, 0u64);
    for number in 1..=cycles {
        let fresh = || {
            let points = plan.points(number, &config.limits, &resolution).unwrap();
            Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise)
        };
        let sequence_now = sequence.get_or_insert_with(fresh);
        let now = Nanos(number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        // Exactly what the loop's thread does in a cycle, with the virtual rig behind the ports.
        COUNTING.set(true);
        let row = run_cycle(&config, &*model, &mut state, &mut ports, &mut || queue.pop(), tick);
        let pushed = rows.try_push(row).is_ok();
        COUNTING.set(false);
        assert!(pushed);
        armed += u64::from(row.armed);
        driven += u64::from(row.drive_pp_m > 0.0);
        compared += u64::from(row.online.is_some() && row.drive_pp_m > 0.0);
        // What runs beside the loop may allocate.
        let row = drain.try_pop().unwrap();
        let reaction = sequence_now.on_row(&row);
        for command in reaction.commands {
            queue.push(command).unwrap();
        }
        if reaction.outcome.is_some() {
            sequence = None;
        }
    }
    let name = model.name();
    println!(
        "{name}: {cycles} cycles, {armed} armed, {driven} driving, {compared} compared, {} allocations",
        COUNT.get()
    );
    assert!(driven > cycles * 3 / 10, "the cycles must be those of a real sweep: {driven}");
    assert!(compared > driven / 4, "the law must answer in the driven cycles: {compared}");
    assert_eq!(COUNT.get(), 0);
}

/// A model that looks, when it is asked, whether the commands of its cycle have left.
struct Late {
    inner: SpringSlider,
    commands: Arc<std::sync::atomic::AtomicU64>,
    cycle: Arc<std::sync::atomic::AtomicU64>,
    asked: Arc<std::sync::atomic::AtomicU64>,
}

impl models::prediction::FrictionModel for Late {
    fn name(&self) -> &str {
        self.inner.name()
    }

    fn predict(
        &self,
        condition: &models::condition::Condition,
    ) -> Result<models::prediction::Prediction, models::condition::OutOfDomain> {
        use std::sync::atomic::Ordering::Relaxed;
        self.asked.fetch_add(1, Relaxed);
        assert_eq!(
            self.commands.load(Relaxed),
            self.cycle.load(Relaxed),
            "the model is asked before the drive"
        );
        self.inner.predict(condition)
    }
}

/// An amplifier that counts the commands that reach it.
struct Counts<P> {
    inner: P,
    commands: Arc<std::sync::atomic::AtomicU64>,
}

impl<P: realtime::ports::Amplifier> realtime::ports::Amplifier for Counts<P> {
    fn command(&mut self, command: realtime::safety::DriveCommand, now: Nanos) {
        self.commands.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        self.inner.command(command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<realtime::ports::AmplifierState, realtime::ports::NoData> {
        self.inner.state(now)
    }
}

/// However long a model takes, what was decided has left: in no cycle is it asked first.
#[test]
fn what_is_decided_leaves_before_the_model_is_asked() {
    use realtime::estimate::Mu0;
    use realtime::safety::Request;
    use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
    let setup = Setup::load("virtual-ideal").unwrap();
    let [commands, cycle, asked] = [(); 3].map(|()| Arc::new(AtomicU64::new(0)));
    let model = Late {
        inner: SpringSlider::new(setup.tip.finger).unwrap(),
        commands: Arc::clone(&commands),
        cycle: Arc::clone(&cycle),
        asked: Arc::clone(&asked),
    };
    let [force, amplifier, stage] = VirtualRig::new(&WorldConfig::ideal(), 3).unwrap().split();
    let amplifier = Counts { inner: amplifier, commands };
    let mut ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut state = CycleState::default();
    let request = Request {
        amplitude: models::quantity::PeakToPeak::from_metres(2e-6),
        frequency_hz: 27_500.0,
        velocity_m_s: 0.02,
        normal_force_n: 0.25,
    };
    let mut stopped = None;
    for number in 1..=1000u64 {
        let mut queue = match number {
            1 => Some(Command::Mu0(Mu0 { value: 0.5, sd: 0.01 })),
            60 => Some(Command::Reset),
            80 => Some(Command::Set(request, realtime::cycle::Marker::default())),
            900 => Some(Command::Stop),
            _ => None,
        };
        cycle.store(number, Relaxed);
        let tick = Tick { number, lateness: Nanos(0), now: Nanos(number * 1_000_000) };
        let row = run_cycle(&setup.config, &model, &mut state, &mut ports, &mut || queue.take(), tick);
        assert!(!(100..900).contains(&number) || row.drive_pp_m > 0.0, "{number}");
        stopped = stopped.or(row.tripped.map(|_| number));
    }
    assert_eq!(stopped, Some(900));
    assert!(asked.load(Relaxed) > 500, "{asked:?}");
}

/// Three minutes of rows, flushed as a run flushes them, and the end of the file with its index of 3600 chunks.
#[test]
fn a_record_takes_no_more_memory_the_longer_it_gets() {
    const ROWS: u64 = 180_000;
    let setup = Setup::load("virtual-ideal").unwrap();
    let model = SpringSlider::new(setup.tip.finger).unwrap();
    let [force, amplifier, stage] = VirtualRig::new(&WorldConfig::ideal(), 3).unwrap().split();
    let mut ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut state = CycleState::default();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.mcap");
    let file = std::fs::File::options().create_new(true).read(true).write(true).open(&path).unwrap();
    COUNTING.set(true);
    let mut recorder = Recorder::begin(file, Preamble::default()).unwrap();
    let mut early = 0;
    for number in 1..=ROWS {
        COUNTING.set(false);
        let tick = Tick { number, lateness: Nanos(0), now: Nanos(number * 1_000_000) };
        let row = run_cycle(&setup.config, &model, &mut state, &mut ports, &mut || None, tick);
        COUNTING.set(true);
        recorder.row(&row).unwrap();
        if number.is_multiple_of(50) {
            recorder.flush().unwrap();
            if number == ROWS / 100 {
                early = HELD.get()[0];
            }
        }
    }
    let late = HELD.get()[0];
    HELD.set([late; 2]);
    recorder.end(std::collections::BTreeMap::new()).unwrap();
    let most = HELD.get()[1] - late;
    COUNTING.set(false);
    println!(
        "{ROWS} rows: {early} bytes held after a hundredth, {late} at the end, {most} more while the file was ended"
    );
    assert!((late - early).abs() < 16 * 1024);
    assert!(most < 1 << 20);
    let rows = Reader::new(std::io::BufReader::new(std::fs::File::open(&path).unwrap()));
    assert_eq!(rows.filter(|e| matches!(e, Entry::Message { .. })).count() as u64, ROWS);
}

/// A number in [0, 1) from a counter: the fractional part of multiples of an irrational number.
fn part(k: u64, of: f64) -> f64 {
    (k as f64 * of).fract()
}

/// The paper's finger with a squeeze film, as a diagnosis saves it.
fn corrected() -> effects::corrected::Corrected {
    use effects::corrected::{Corrected, SavedEffect, SavedModel, SavedParameter};
    use effects::operating::{Baseline, Design};
    let law = &effects::by_name("squeeze_film").unwrap().laws[0];
    let parameters = law.parameters.iter().map(|p| p.at_load(0.3));
    let saved = |p: effects::Parameter| SavedParameter {
        name: p.name.into(),
        unit: p.unit.into(),
        value: p.value(0.2),
    };
    let model = SavedModel {
        schema: "muprime.model/1".into(),
        verdict: "named".into(),
        relative_sd: 0.01,
        interpolation_error: 0.0,
        baseline: Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 },
        design: Design {
            duration_s: 100.0,
            reference_load_n: 0.3,
            reference_speed_m_s: 0.02,
            reference_frequency_hz: 27.5e3,
            reference_temperature_c: 22.0,
            stroke_m: 0.02,
            largest_amplitude_m: 3e-6,
        },
        law: None,
        effects: vec![SavedEffect {
            name: "squeeze_film".into(),
            law: law.name.into(),
            acts_on: "prediction".into(),
            parameters: parameters.map(saved).collect(),
            table: None,
            covariance: Vec::new(),
        }],
    };
    Corrected::compile_on(&model, None).unwrap()
}

/// The law turned round, at scattered conditions: what it misses by, how often it asks the law, and that it
/// allocates nothing.
#[test]
fn the_inverse_meets_what_is_wanted_at_scattered_conditions_without_allocation() {
    use models::inverse::{MOST_EVALUATIONS, Reach, quick};
    use models::law_table::grid::LawGrid;
    use models::{BuiltIn, Condition, FrictionModel, PeakToPeak};
    let finger = Setup::load("virtual").unwrap().tip.finger;
    let grid = LawGrid::parse(["amplitude_pp_m=0.05e-6..8e-6:33:log", "speed_m_s=0.004..0.2:9:log"]).unwrap();
    let mu = |c: &Vec<f64>| [1.0 - (-3.5e-5 * c[1] / c[0]).exp(), 0.02];
    let table = grid.table(0, &grid.conditions(0).iter().map(mu).collect::<Vec<_>>()).unwrap();
    let mut laws: Vec<(String, Arc<dyn FrictionModel>)> =
        BuiltIn::ALL.iter().map(|law| (law.name().to_string(), law.law(&finger).unwrap())).collect();
    laws.push(("law table".into(), runs::model_file::load("own.csv", &table.csv).unwrap()));
    laws.push(("corrected".into(), Arc::new(corrected())));
    let count = tests::rounds(10_000, 1_000_000);
    let largest = PeakToPeak::from_metres(8e-6);
    for (name, law) in laws {
        let (mut off, mut asked, mut last) = (Vec::with_capacity(count), 0u64, None);
        let mut unreached = [0u32; 3];
        COUNT.set(0);
        for k in 1..=count as u64 {
            let condition = Condition {
                frequency_hz: 20e3 + 30e3 * part(k, 0.618_034),
                speed_m_s: 0.005 * 20f64.powf(part(k, 0.754_878)),
                normal_force_n: 0.1 + 0.8 * part(k, 0.569_840),
                mu0: 0.3 + 0.6 * part(k, 0.324_718),
                ..Condition::paper()
            };
            let wanted = 0.1 + 0.85 * part(k, 0.819_173);
            COUNTING.set(true);
            let found = quick(&*law, &condition, wanted, largest, last.as_ref());
            COUNTING.set(false);
            let found = found.expect("every law answers here");
            asked += u64::from(found.evaluations);
            assert!(found.evaluations <= MOST_EVALUATIONS);
            match found.reach {
                Reach::Within => {
                    last = Some(found);
                    let again =
                        law.mu_relative(&Condition { amplitude: found.amplitude, ..condition }).unwrap();
                    off.push((again - wanted).abs());
                }
                Reach::TooLow => unreached[0] += 1,
                Reach::TooHigh => unreached[1] += 1,
                Reach::BeyondLaw => unreached[2] += 1,
            }
        }
        off.sort_by(f64::total_cmp);
        let quantile = |q: f64| off[((off.len() - 1) as f64 * q) as usize];
        println!(
            "{name}: {count} conditions; |mu'(inverse(mu')) - mu'| 50 % {:.1e}, 99 % {:.1e}, greatest {:.1e}; too low {}, too high {}, \
             beyond the law {}; {:.1} evaluations each, {} allocations",
            quantile(0.5),
            quantile(0.99),
            quantile(1.0),
            unreached[0],
            unreached[1],
            unreached[2],
            asked as f64 / count as f64,
            COUNT.get()
        );
        assert_eq!(COUNT.get(), 0, "{name}");
        assert!(off.len() > count / 2 && quantile(0.99) < 3e-5 && quantile(1.0) <= 1e-3, "{name}");
    }
}
