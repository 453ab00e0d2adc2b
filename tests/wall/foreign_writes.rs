//! Somebody else writes to an instrument: its set-point is another than the one that was commanded. On every
//! bundled profile that takes set-points, for each of them: the rig trips within the stated time, or it is
//! said here, and in docs/devices.md, that nothing shows it.

use models::PeakToPeak;
use realtime::Ports;
use realtime::cycle::{Command, Marker};
use realtime::safety::{Request, Trip, TripCause};
use rig::wall_clock_loop::WallClockLoop;
use rig::wall_clock_loop::{LoopHandle, Parts};
use runs::supervisor::Loop;
use sim::wire::world::WorldPlant;
use sim::wire::{Command as Wire, SharedPlant};
use sim::world::{World, WorldConfig};
use std::fmt::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tests::{file, setup};

/// What becomes of a foreign write.
enum Fate {
    /// The rig trips for one of these causes within so many ms.
    Trips(&'static [TripCause], u64),
    /// Nothing shows it. Why, and what is left then.
    Unseen(&'static str),
}

/// A foreign write: on which profile, to which set-point.
struct Case {
    profile: &'static str,
    set_point: &'static str,
    /// The setup that the profile is in, and what is written, in SI.
    setup: &'static str,
    write: Option<(Wire, f64)>,
    fate: Fate,
}

macro_rules! cases {
    ($($profile:literal $set:literal in $setup:literal: $write:expr => $fate:expr;)*) => {
        const CASES: &[Case] = &[$(Case {
            profile: $profile, set_point: $set, setup: $setup, write: $write, fate: $fate,
        },)*];
    };
}

use Fate::{Trips, Unseen};
use TripCause::*;

/// Another drive, another frequency or another switch shows in the echo, or in the plate's motion.
const DRIVE: &[TripCause] = &[EchoMismatch, AmplitudeRunaway, DriveNoResponse, AmplitudeRate];
const ANOTHER_LIFE: &str =
    "a second master that keeps feeding it outlives this program's end: the second channel is left";
/// A chamber is beside the loop: what it measures goes with each pass (`runs/src/sweep/passing.rs`).
const AIR: &str = "no run trips; a pass whose level left its tolerance is marked `lost`";

cases! {
    "muprime-amplifier" "amplitude" in "virtual-ideal": Some((Wire::Amplitude, 3e-6)) => Trips(DRIVE, 400);
    "muprime-amplifier" "frequency" in "virtual-ideal": Some((Wire::Frequency, 28_000.0)) => Trips(DRIVE, 400);
    "muprime-amplifier" "enable" in "virtual-ideal": Some((Wire::Enable, 0.0)) => Trips(DRIVE, 400);
    "muprime-amplifier" "heartbeat" in "virtual-ideal": None => Unseen(ANOTHER_LIFE);
    "muprime-stage" "velocity" in "virtual-ideal": Some((Wire::Velocity, 0.05)) => Trips(&[StageNotFollowing], 400);
    "muprime-stage" "load" in "virtual-ideal": Some((Wire::NormalForce, 1.0)) => Trips(&[LoadImplausible, ForceRate, NormalOverforce, Noisy], 2500);
    "muprime-stage" "heartbeat" in "virtual-ideal": None => Unseen(ANOTHER_LIFE);
    "muprime-chamber" "pressure" in "virtual-ideal": None => Unseen(AIR);
    "muprime-chamber" "temperature" in "virtual-ideal": None => Unseen(AIR);
    "muprime-chamber" "humidity" in "virtual-ideal": None => Unseen(AIR);
    "muprime-relay" "closed" in "virtual-relay": Some((Wire::CloseSupply, 0.0)) => Trips(&[SupplySwitch, EchoMismatch, DriveNoResponse, AmplifierFault], 1000);
    "wago-750-watchdog" "closed" in "wago": Some((Wire::CloseSupply, 0.0)) => Trips(&[SupplySwitch, EchoMismatch, DriveNoResponse, AmplifierFault], 1000);
    "wago-750-watchdog" "heartbeat" in "wago": None => Unseen("a second master that keeps feeding it keeps the supply closed beyond this program's end");
    "piezodrive-pdus210" "amplitude" in "virtual-mixed": Some((Wire::Amplitude, 3e-6)) => Trips(DRIVE, 600);
    "piezodrive-pdus210" "frequency" in "virtual-mixed": Some((Wire::Frequency, 28_000.0)) => Trips(DRIVE, 600);
    "piezodrive-pdus210" "enable" in "virtual-mixed": Some((Wire::Enable, 0.0)) => Trips(DRIVE, 600);
    "cia402-profile-velocity" "velocity" in "virtual-mixed": Some((Wire::Velocity, 0.05)) => Trips(&[StageNotFollowing], 600);
    "cia402-profile-velocity" "control" in "virtual-mixed": Some((Wire::Velocity, 0.0)) => Trips(&[StageNotFollowing], 1500);
    "keysight-33500b" "amplitude" in "scpi": Some((Wire::Amplitude, 3e-6)) => Trips(DRIVE, 600);
    "keysight-33500b" "frequency" in "scpi": Some((Wire::Frequency, 28_000.0)) => Trips(DRIVE, 600);
    "keysight-33500b" "enable" in "scpi": Some((Wire::Enable, 0.0)) => Trips(DRIVE, 600);
    "siglent-sdg" "amplitude" in "siglent": Some((Wire::Amplitude, 3e-6)) => Trips(DRIVE, 600);
    "siglent-sdg" "frequency" in "siglent": Some((Wire::Frequency, 28_000.0)) => Trips(DRIVE, 600);
    "siglent-sdg" "enable" in "siglent": Some((Wire::Enable, 0.0)) => Trips(DRIVE, 600);
    "zaber-x-lsm" "velocity" in "zaber": Some((Wire::Velocity, 0.05)) => Trips(&[StageNotFollowing], 600);
}

/// A rig that is driven, behind its links.
struct Driven {
    _rig: WallClockLoop,
    reins: LoopHandle,
    plant: SharedPlant,
    _emulators: rig::emulators::Emulators,
}

impl Driven {
    fn start(name: &str) -> Result<Self, String> {
        // At 250 Hz a machine that takes a CPU away for some milliseconds trips no rig before anything is written.
        let setup = tests::slower(&setup(name));
        let (epoch, origin_ns) = (Instant::now(), realtime::pacing::monotonic_ns());
        let plant = SharedPlant::new(WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap()), epoch);
        let mut instruments = setup.instruments();
        let emulators = rig::emulators::serve(&mut instruments, &plant, false).unwrap();
        let opened = drivers::open(&instruments, epoch).map_err(|e| e.to_string())?;
        let mut config = setup.config;
        // The generator has neither watchdog nor relay here: what it shows is looked at, not how it is armed.
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
            pacing: setup.file.pace.pacing(),
            origin_ns,
        })
        .unwrap();
        let mut driven = Driven { _rig: rig, reins, plant, _emulators: emulators };
        driven.drive().map(|()| driven)
    }

    /// Arms, drives and slides, until it has stood for longer than any rule waits.
    fn drive(&mut self) -> Result<(), String> {
        let request = Request {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            velocity_m_s: 0.005,
            normal_force_n: 0.25,
        };
        let began = Instant::now();
        let (mut asked, mut driven_from) = (None::<Instant>, None::<Instant>);
        while began.elapsed() < Duration::from_secs(15) {
            let Some(row) = self.reins.next_row() else { continue };
            if let Some(trip) = row.tripped.filter(|_| driven_from.is_some()) {
                return Err(format!("before anything was written: {trip}"));
            }
            if row.armed && row.drive_pp_m > 0.0 {
                driven_from = driven_from.or(Some(Instant::now()));
            }
            if driven_from.is_some_and(|from| from.elapsed() > Duration::from_millis(2300)) {
                return Ok(());
            }
            if asked.is_none_or(|at| at.elapsed() > Duration::from_millis(60)) && driven_from.is_none() {
                asked = Some(Instant::now());
                self.reins.send(if row.armed {
                    Command::Set(request, Marker::default())
                } else {
                    Command::Reset
                });
            }
        }
        Err("it was never driven".into())
    }

    /// Writes from now on, a thousand times a second; the trip that follows, and after how long.
    fn write(&mut self, (what, value): (Wire, f64)) -> Option<(Trip, Duration)> {
        let (plant, over) = (self.plant.clone(), Arc::new(AtomicBool::new(false)));
        let ended = Arc::clone(&over);
        let foreign = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                plant.now().0.command(&[(what, value)]);
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let began = Instant::now();
        let mut found = None;
        while began.elapsed() < Duration::from_secs(4) && found.is_none() {
            found = self.reins.next_row().and_then(|row| row.tripped).map(|trip| (trip, began.elapsed()));
        }
        over.store(true, Ordering::Relaxed);
        foreign.join().unwrap();
        found
    }
}

/// What a busy machine adds to a bound.
const BUSY: Duration = Duration::from_millis(500);

fn noticed(case: &Case) -> Result<(), String> {
    let (Trips(causes, within_ms), Some(write)) = (&case.fate, case.write) else { return Ok(()) };
    let name = format!("{} {}", case.profile, case.set_point);
    let mut driven = Driven::start(case.setup).map_err(|why| format!("{name}: {why}"))?;
    match driven.write(write) {
        Some((trip, after)) if causes.contains(&trip.cause) => {
            println!("{name}: {trip}, after {} ms", after.as_millis());
            let most = Duration::from_millis(*within_ms) + BUSY;
            if after <= most { Ok(()) } else { Err(format!("{name}: {trip} only after {after:?}")) }
        }
        other => Err(format!("{name}: {other:?}")),
    }
}

#[test]
fn a_foreign_write_to_any_instrument_trips_within_its_time() {
    wall::in_wall_clock_time(|| {
        let only = std::env::var("MUPRIME_FOREIGN").unwrap_or_default();
        let mut wrong = Vec::new();
        for case in CASES.iter().filter(|case| case.profile.contains(&only)) {
            // A machine that stalls trips a rig for its own reasons: once more then.
            let tries = (0..3).map(|_| noticed(case)).take_while(Result::is_err).filter_map(Result::err);
            let failed: Vec<String> = tries.collect();
            if failed.len() == 3 {
                wrong.extend(failed);
            }
        }
        assert!(wrong.is_empty(), "{wrong:#?}");
    });
}

/// Every set-point of every bundled profile is in the list, and the list is the page's.
#[test]
fn every_set_point_is_noticed_or_named() {
    let mut there: Vec<(String, String)> = Vec::new();
    for id in drivers::bundled::ids() {
        let profile = drivers::profile(id).unwrap();
        let sets = profile.description.set.iter().map(|set| set.name.as_ref().to_string());
        there.extend(sets.map(|set| (id.to_string(), set)));
    }
    let mut listed: Vec<(String, String)> =
        CASES.iter().map(|case| (case.profile.to_string(), case.set_point.to_string())).collect();
    there.sort();
    listed.sort();
    assert_eq!(there, listed);
    let mut table = String::from("| profile | set-point | noticed by | within |\n|---|---|---|---|\n");
    for case in CASES {
        let (by, within) = match &case.fate {
            Trips(causes, ms) => {
                let ids = causes.iter().filter_map(|cause| cause.requirement());
                (ids.collect::<Vec<_>>().join(", "), format!("{ms} ms"))
            }
            Unseen(why) => (format!("nothing: {why}"), "-".into()),
        };
        let _ = writeln!(table, "| `{}` | `{}` | {by} | {within} |", case.profile, case.set_point);
    }
    let page = std::fs::read_to_string(file("docs/devices.md")).unwrap();
    assert!(page.contains(&table), "docs/devices.md must hold this table:\n{table}");
}
