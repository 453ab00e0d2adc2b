//! 'Off' always leaves: the plate is driven, or the stage slides, behind a real link; the link is struck; the run ends. The
//! instrument, in a process of its own, must be off within the stated time, and what is said of it must be true.
//!
//! `MUPRIME_OFF_SEEDS` faults are drawn for each rig (7 when it is not set: one of each kind).
//! `MUPRIME_OFF_CASE` names one rig. No instrument here has a watchdog that would help.

#[path = "off_leaves/line.rs"]
mod line;

use line::{Fault, Kind, Trouble};
use models::PeakToPeak;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use realtime::cycle::{Command, Marker};
use realtime::safety::Request;
use realtime::{Ports, Row};
use rig::wall_clock_loop::WallClockLoop;
use rig::wall_clock_loop::{LoopHandle, Parts};
use runs::Setup;
use runs::supervisor::{Loop, OffReport};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdout, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tests::setup;
use wall::Stopwatch;

/// One at a time: two loops would take each other's processors.
static ALONE: Mutex<()> = Mutex::new(());

/// Beside the profile's own time limit: an answer that is waited for ([`drivers::off::OFF_ANSWER_MS`]), a new
/// connection, and a busy machine.
const BESIDE: Duration = Duration::from_millis(drivers::off::OFF_ANSWER_MS as u64 + 600);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Struck {
    Amplifier,
    Stage,
}

/// A rig and the instrument whose link is struck.
struct Case {
    name: &'static str,
    setup: &'static str,
    struck: Struck,
    kinds: &'static [fn(u64) -> Kind],
}

const LATE: fn(u64) -> Kind = |r| Kind::Late(Duration::from_millis(60 + r % 440));
const TCP: &[fn(u64) -> Kind] = &[
    LATE,
    |_| Kind::Garbage,
    |_| Kind::Refused,
    |_| Kind::Echo,
    |_| Kind::Cut,
    |_| Kind::Stopped,
    |_| Kind::HalfOpen,
];
const LINE: &[fn(u64) -> Kind] =
    &[LATE, |_| Kind::Garbage, |_| Kind::Refused, |_| Kind::Echo, |_| Kind::Stopped, |_| Kind::HalfOpen];
const CASES: &[Case] = &[
    Case { name: "Modbus TCP amplifier", setup: "virtual-ideal", struck: Struck::Amplifier, kinds: TCP },
    Case { name: "Modbus TCP stage", setup: "virtual-ideal", struck: Struck::Stage, kinds: TCP },
    Case { name: "Modbus RTU amplifier", setup: "virtual-rtu", struck: Struck::Amplifier, kinds: LINE },
    Case { name: "Modbus RTU stage", setup: "virtual-rtu", struck: Struck::Stage, kinds: LINE },
    Case { name: "amplifier of text lines", setup: "virtual-mixed", struck: Struck::Amplifier, kinds: LINE },
    Case { name: "CANopen stage over slcan", setup: "virtual-mixed", struck: Struck::Stage, kinds: LINE },
    Case { name: "SCPI generator", setup: "scpi", struck: Struck::Amplifier, kinds: TCP },
    Case { name: "amplifier with a relay", setup: "virtual-relay", struck: Struck::Amplifier, kinds: TCP },
];

/// A rig in another process: `muprime virtual-rig`, whose lamps are asked for over a pipe. No watchdog of its amplifier helps.
struct Served {
    process: Mutex<(Child, BufReader<ChildStdout>)>,
    /// Where its instruments are, in the order of the setup.
    places: Vec<String>,
}

impl Served {
    fn start(setup: &Setup, refuses_off: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (file, defects) = (folder.path().join("setup.toml"), folder.path().join("defects.toml"));
        std::fs::write(&file, &setup.text).unwrap();
        let refuses = if refuses_off { "[[defect]]\nname = \"amplifier_refuses_off\"\n" } else { "" };
        std::fs::write(&defects, format!("[[defect]]\nname = \"amplifier_without_watchdog\"\n{refuses}"))
            .unwrap();
        let mut rig = tests::muprime();
        rig.args(["--json", "virtual-rig", "--hands", "--modbus-tcp", "127.0.0.1:0", "--setup"]).arg(&file);
        rig.arg("--defects")
            .arg(&defects)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit());
        let mut child = rig.spawn().unwrap();
        let mut out = BufReader::new(child.stdout.take().unwrap());
        let mut said = String::new();
        out.read_line(&mut said).unwrap();
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        let place =
            |text: &serde_json::Value| text.as_str().unwrap().split_once(" at ").unwrap().1.to_string();
        let places = said["instruments"].as_array().unwrap().iter().map(place).collect();
        Served { process: Mutex::new((child, out)), places }
    }

    /// Whether the instrument is on, by itself.
    fn is_on(&self, which: Struck) -> bool {
        let mut process = self.process.lock().unwrap_or_else(|e| e.into_inner());
        let (child, out) = &mut *process;
        child.stdin.as_mut().unwrap().write_all(b"look\n").unwrap();
        let mut said = String::new();
        out.read_line(&mut said).unwrap();
        let seen: serde_json::Value = serde_json::from_str(&said).unwrap();
        match which {
            Struck::Amplifier => seen["output_on"].as_bool().unwrap(),
            Struck::Stage => seen["velocity_m_s"].as_f64().unwrap().abs() > 0.5e-3,
        }
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let process = self.process.get_mut().unwrap_or_else(|e| e.into_inner());
        let _ = process.0.kill();
        let _ = process.0.wait();
    }
}

/// A rig behind its links, one of which can be struck.
struct Bench {
    rig: Option<WallClockLoop>,
    reins: LoopHandle,
    served: Arc<Served>,
    trouble: Trouble,
    answer_limit: Duration,
}

impl Bench {
    fn start(case: &Case, refuses_off: bool, seed: u64) -> Self {
        let setup = setup(case.setup);
        let served = Arc::new(Served::start(&setup, refuses_off));
        let (epoch, origin_ns) = (Instant::now(), realtime::pacing::monotonic_ns());
        let mut instruments = setup.instruments();
        for (instrument, place) in instruments.all_mut().zip(&served.places) {
            instrument.address.clone_from(place);
        }
        let trouble = Trouble::new(if case.struck == Struck::Amplifier { 100 } else { 102 }, seed);
        let struck = match case.struck {
            Struck::Amplifier => &mut instruments.amplifier,
            Struck::Stage => &mut instruments.stage,
        };
        let (scheme, place) = match struck.address.split_once(":/") {
            Some((scheme, path)) => (format!("{scheme}:"), format!("/{path}")),
            None => (String::new(), struck.address.clone()),
        };
        struck.address = match place.parse() {
            Ok(server) => line::before_tcp(server, &trouble).to_string(),
            Err(_) => format!("{scheme}{}", line::before_line(&place, &trouble)),
        };
        let link = drivers::profile(&struck.profile).unwrap().description.link;
        let opened = wall::bench::opened(&instruments, epoch);
        // An amplifier without a watchdog needs a relay to arm. Here none is to help: 'off' must leave by the amplifier's link.
        let mut config = setup.config;
        config.limits.amplifier_watchdog = true;
        let (rig, reins, _) = WallClockLoop::start(Parts {
            config,
            model: Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap()),
            ports: Ports {
                supply: opened.supply,
                contacts: opened.contacts,
                ..Ports::new(opened.force, opened.amplifier, opened.stage)
            },
            links: opened.links,
            pacing: realtime::pacing::Pacing::default(),
            origin_ns,
        })
        .unwrap();
        let answer_limit = Duration::from_millis(u64::from(link.response_timeout_ms));
        Bench { rig: Some(rig), reins, served, trouble, answer_limit }
    }

    /// A bench that drives and slides; where a stall kept it from that, another.
    fn driven(case: &Case, refuses_off: bool, seed: u64) -> Self {
        for _ in 0..5 {
            let watch = Stopwatch::start();
            let mut bench = Bench::start(case, refuses_off, seed);
            match bench.drive() {
                Ok(()) => return bench,
                Err(why) if watch.saw_a_stall() => {
                    eprintln!("{}, seed {seed}: {why}, beside a stall", case.name)
                }
                Err(why) => panic!("{}, seed {seed}: {why}", case.name),
            }
        }
        wall::undecided("five rigs in a row were not driven beside stalls of the machine")
    }

    /// Arms, drives the plate, slides the stage; else what the last row showed.
    fn drive(&mut self) -> Result<(), String> {
        let began = Instant::now();
        let request = Request {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            velocity_m_s: 0.005,
            normal_force_n: 0.25,
        };
        let mut asked: Option<Instant> = None;
        let mut last = None;
        while began.elapsed() < Duration::from_secs(10) {
            let Some(row) = self.reins.next_row() else { continue };
            last = Some(row);
            if row.armed && self.is_on(Struck::Amplifier) && self.is_on(Struck::Stage) {
                return Ok(());
            }
            if asked.is_none_or(|at| at.elapsed() > Duration::from_millis(60)) {
                asked = Some(Instant::now());
                if !row.armed {
                    self.reins.send(Command::Set(Request::default(), Marker::default()));
                    self.reins.send(Command::Reset);
                } else {
                    self.reins.send(Command::Set(request, Marker::default()));
                }
            }
        }
        let seen = last.map(|row| {
            (row.armed, row.blocking, row.tripped, row.drive_pp_m, row.velocity_m_s, row.inputs.seen)
        });
        Err(format!("it was never driven; the last row: {seen:?}"))
    }

    fn is_on(&self, which: Struck) -> bool {
        self.served.is_on(which)
    }

    /// Watches an instrument until told to end; returns when it was last seen on.
    fn watch(&self, which: Struck) -> (Arc<AtomicBool>, std::thread::JoinHandle<Option<Instant>>) {
        let (served, done) = (Arc::clone(&self.served), Arc::new(AtomicBool::new(false)));
        let ended = Arc::clone(&done);
        let look = move || {
            let mut last_on = None;
            while !ended.load(Ordering::Acquire) {
                if served.is_on(which) {
                    last_on = Some(Instant::now());
                }
                std::thread::sleep(Duration::from_millis(1));
            }
            last_on
        };
        (done, std::thread::spawn(look))
    }

    fn end(&mut self) -> OffReport {
        self.rig.take().unwrap().end().off
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        drop(self.rig.take());
        self.trouble.end();
    }
}

/// One strike. The complaint, if there is one.
fn strike(case: &Case, seed: u64) -> Result<String, String> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let kind = case.kinds[seed as usize % case.kinds.len()](random.next_u64());
    let mut bench = Bench::driven(case, false, seed);
    let (done, watch) = bench.watch(case.struck);
    let lasts = Duration::from_millis(50 + random.next_u64() % 350);
    // What keeps the way open for set-points never ends; what closes it does.
    let closes = matches!(kind, Kind::Cut | Kind::Stopped | Kind::HalfOpen);
    let from = Instant::now();
    let until = from + if closes { lasts } else { Duration::from_secs(60) };
    bench.trouble.strike(Fault { kind, from, until });
    std::thread::sleep(Duration::from_millis(random.next_u64() % 300));
    let ended = Stopwatch::start();
    let ended_at = Instant::now();
    let off = bench.end();
    std::thread::sleep(Duration::from_millis(30));
    done.store(true, Ordering::Release);
    let last_on = watch.join().unwrap();
    let left_on = bench.is_on(case.struck);
    let carries = if closes { until } else { from };
    let took = last_on.map_or(Duration::ZERO, |at| at.saturating_duration_since(carries.max(ended_at)));
    let bound = bench.answer_limit + BESIDE;
    let found =
        format!("{}, seed {seed}, {kind:?}: off {} ms after the end, {off:?}", case.name, took.as_millis());
    if left_on {
        return Err(format!("left on: {found}"));
    }
    // What was not read back was not within the time that a run waits for it.
    let in_time = took <= bound && (off.read_back || !closes);
    ended.judge(in_time, &format!("later than {bound:?}, or not read back: {found}"));
    Ok(found)
}

#[test]
fn off_leaves_on_every_transport_whatever_strikes_the_link() {
    wall::outcome_alone(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let seeds: u64 = std::env::var("MUPRIME_OFF_SEEDS").map_or(7, |n| n.parse().expect("a number"));
        let only = std::env::var("MUPRIME_OFF_CASE").unwrap_or_default();
        let mut wrong = Vec::new();
        for case in CASES.iter().filter(|case| case.name.contains(&only)) {
            for seed in 0..seeds {
                match strike(case, seed) {
                    Ok(found) => println!("{found}"),
                    Err(found) => {
                        println!("WRONG {found}");
                        wrong.push(found);
                    }
                }
            }
        }
        assert!(wrong.is_empty(), "{} of {} strikes: {wrong:#?}", wrong.len(), seeds * CASES.len() as u64);
    });
}

/// An amplifier that ignores its enable, and a link that carries nothing more: neither is said to be off.
#[test]
fn what_was_not_read_back_off_is_not_said_to_be_off() {
    wall::outcome_alone(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let mut stubborn = Bench::driven(&CASES[0], true, 1);
        let off = stubborn.end();
        assert!(stubborn.is_on(Struck::Amplifier), "else this test shows nothing");
        assert!(!off.read_back && off.words().contains("may still be on: switch the supply off"), "{off:?}");

        let mut dead = Bench::driven(&CASES[0], false, 2);
        let (from, until) = (Instant::now(), Instant::now() + Duration::from_secs(600));
        dead.trouble.strike(Fault { kind: Kind::HalfOpen, from, until });
        let ended = Stopwatch::start();
        let off = dead.end();
        assert!(!off.read_back && off.not_read_back[0].drives, "{off:?}");
        let took = ended.elapsed();
        let bounded = took < drivers::off::OFF_WITHIN + Duration::from_secs(4);
        ended.judge(bounded, &format!("the wait for 'off' took {took:?}"));
    });
}

/// The amplifier's link is dead for good, or the amplifier ignores its enable: the relay in its supply opens all the same.
#[test]
fn the_second_channel_switches_off_what_the_first_cannot() {
    wall::outcome_alone(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let case = CASES.iter().find(|case| case.setup == "virtual-relay").unwrap();
        for dead in [true, false] {
            let mut bench = Bench::driven(case, !dead, 5);
            if dead {
                let (from, until) = (Instant::now(), Instant::now() + Duration::from_secs(600));
                bench.trouble.strike(Fault { kind: Kind::HalfOpen, from, until });
            }
            let off = bench.end();
            assert!(!bench.is_on(Struck::Amplifier), "dead link {dead}: {off:?}");
            assert!(off.read_back, "dead link {dead}: {off:?}");
        }
    });
}

/// A panic of whoever supervises: the rig is off when it has been unwound.
#[test]
fn a_panic_of_the_supervising_thread_switches_off() {
    wall::outcome_alone(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let bench = Bench::driven(&CASES[0], false, 3);
        let served = Arc::clone(&bench.served);
        let panicked = std::thread::spawn(move || {
            let _held = bench;
            panic!("as an eprintln does whose terminal is gone");
        });
        assert!(panicked.join().is_err());
        assert!(!served.is_on(Struck::Amplifier));
    });
}

/// What a row shows is what the rig did: a guard against a test that never drove anything.
#[test]
fn the_rows_show_the_drive() {
    wall::outcome_alone(|| {
        let _alone = ALONE.lock().unwrap_or_else(|e| e.into_inner());
        let mut bench = Bench::driven(&CASES[0], false, 4);
        let driven = |row: &Row| row.drive_pp_m > 0.0 && row.velocity_m_s != 0.0;
        let seen =
            std::iter::repeat_with(|| bench.reins.next_row()).take(2000).flatten().any(|row| driven(&row));
        assert!(seen);
    });
}
