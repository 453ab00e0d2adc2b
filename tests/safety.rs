//! What the tests of safety in wall-clock time judge, in virtual time and to the cycle: a hand that lets go of the dead-man key, an 'off'
//! that is read back, and one that is not. Their twins: tests/wall/dead_man_key.rs, off_leaves.rs and ends.rs.

use models::{PeakToPeak, SpringSlider};
use realtime::cycle::{Command, KEY_AGE, Marker, Phase};
use realtime::ports::{
    Amplifier, AmplifierState, Contacts, ForceSensor, Forces, Nanos, NoData, SafetyInputs,
};
use realtime::safety::{DriveCommand, Remark, Request, TripCause};
use realtime::{Ports, Row};
use runs::plan::{Plan, Resolution};
use runs::supervisor::{self, Loop, Requests, VirtualLoop};
use runs::{Event, MeasuredPass, Outcome, Setup, Sweep};
use sim::defects::Defects;
use sim::virtual_rig::VirtualRig;
use sim::world::WorldConfig;
use std::path::Path;
use std::sync::Arc;

/// A terminal repeats a held key some thirty times a second.
const REPEAT: Nanos = Nanos(33_000_000);

/// The rig's contacts without a dead-man device: the key takes its place.
struct WithoutDevice<S>(S);

impl<S: SafetyInputs> SafetyInputs for WithoutDevice<S> {
    fn read(&mut self, now: Nanos) -> Contacts {
        Contacts { dead_man: Err(NoData::NotFitted), ..self.0.read(now) }
    }
}

/// A virtual rig with a relay, under a human finger whose hand is at a key; with these defects.
fn rig(defects: &str) -> VirtualLoop {
    let board = |table: &str| format!("[{table}]\nprofile = \"muprime-relay\"\naddress = \"127.0.0.1:0\"\n");
    let text = Setup::load("virtual-ideal").unwrap().text;
    let text = text.replace("artificial-silicone", "human-index-moist");
    let text = text.replace("[limits]\n", "[limits]\nhuman_contact = true\ndead_man_key = true\n");
    let text = format!(
        "{text}\n{}{}wired = [\"emergency_stop\", \"interlock\"]\n",
        board("supply_relay"),
        board("safety_inputs")
    );
    let setup = Setup::parse("hand", &text, Path::new(".")).unwrap();
    let world = WorldConfig { defects: Defects::parse(defects).unwrap(), ..WorldConfig::ideal() };
    let [force, amplifier, stage] = VirtualRig::new(&world, 1).unwrap().split();
    let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage.clone()));
    let supply = Box::new(stage.clone());
    let ports = Ports { supply, contacts: Box::new(WithoutDevice(stage)), ..ports };
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    VirtualLoop::new(setup.config, model, ports)
}

fn is_driven(row: &Row) -> bool {
    row.armed && row.drive_pp_m > 0.0 && row.inputs.seen.amplifier.is_ok_and(|state| state.output_on)
}

/// Runs with the key held from `held_from` on until `done`, or for half a minute of the rig's time; asks for a drive as a sweep does.
fn with_key(rig: &mut VirtualLoop, held_from: Nanos, done: impl Fn(&Row) -> bool) -> Option<Row> {
    let request = Request {
        amplitude: PeakToPeak::from_metres(2e-6),
        frequency_hz: 27_500.0,
        velocity_m_s: 0.005,
        normal_force_n: 0.25,
    };
    let mut due = [held_from, Nanos(0)];
    for _ in 0..30_000 {
        let row = rig.cycle();
        if done(&row) {
            return Some(row);
        }
        if row.now >= due[0] {
            rig.send(Command::DeadMan(true));
            due[0] = row.now.plus(REPEAT);
        }
        if row.now >= due[1] {
            rig.send(if row.armed { Command::Set(request, Marker::default()) } else { Command::Reset });
            due[1] = row.now.plus(Nanos(60_000_000));
        }
    }
    None
}

/// Held it drives, for longer than the key's own age; let go, the loop trips when the last repeat is that old, and not a cycle later.
#[test]
fn a_key_that_is_let_go_switches_off_to_the_cycle() {
    let mut rig = rig("");
    let driven = with_key(&mut rig, Nanos(1_500_000_000), is_driven).expect("a held key drives");
    let later = driven.now.plus(Nanos(2 * KEY_AGE.0));
    let last = with_key(&mut rig, Nanos(0), |row| row.now >= later).unwrap();
    assert!(is_driven(&last), "the repeats count: {:?}", last.blocking);
    // The key was repeated a moment ago at the latest: nobody holds it from now on.
    let mut rows = (0..1000).map(|_| rig.cycle());
    let off = rows.find(|row| row.tripped.is_some()).expect("a trip within a second");
    assert_eq!(off.tripped.unwrap().cause, TripCause::DeadMan);
    let after = off.now.since(last.now);
    assert!(after.0 <= KEY_AGE.0 + 2_000_000 && after.0 >= KEY_AGE.0 - REPEAT.0 - 2_000_000, "{after:?}");
    assert_eq!((off.drive_pp_m, off.velocity_m_s), (0.0, 0.0));
    let report = rig.end(&mut |_| {});
    assert!(report.read_back, "{report:?}");
}

/// Something lies on the key before the rig is looked at: nobody has confirmed anything, and nothing is armed.
#[test]
fn a_key_that_is_held_from_the_beginning_arms_nothing() {
    let mut rig = rig("");
    assert_eq!(with_key(&mut rig, Nanos(0), |row| row.armed || row.drive_pp_m > 0.0), None);
}

/// An amplifier that ignores its enable is never said to be off where no relay cuts its supply; the same rig without the defect is.
#[test]
fn off_is_said_of_what_was_read_back_off_alone() {
    for (defects, off) in [("", true), ("[[defect]]\nname = \"amplifier_refuses_off\"\nseed = 1\n", false)] {
        let setup = Setup::load("virtual-ideal").unwrap();
        let world = WorldConfig { defects: Defects::parse(defects).unwrap(), ..WorldConfig::ideal() };
        let [force, amplifier, stage] = VirtualRig::new(&world, 1).unwrap().split();
        let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
        let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
        let mut rig = VirtualLoop::new(setup.config, model, ports);
        with_key(&mut rig, Nanos(0), is_driven).expect("an armed rig drives");
        let report = rig.end(&mut |_| {});
        assert_eq!(report.read_back, off, "{report:?}");
        assert_eq!(report.words().contains("may still be on: switch the supply off"), !off, "{report:?}");
    }
}

const TEN_PASSES: &str = "name = \"p\"\nseed = 3\nreference_every = 0\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n[base]\n\
    amplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
    amplitude_pp_m = [2e-6, 1e-6, 2.5e-6, 3e-6, 1.5e-6]\n";

/// A force sensor whose lateral raw value stands still for a while, and whose count goes on.
struct Stuck<F> {
    force: F,
    from_to: [f64; 2],
    shown: Option<(i64, f64)>,
}

impl<F: ForceSensor> ForceSensor for Stuck<F> {
    fn read(&mut self, now: Nanos) -> Forces {
        let mut forces = self.force.read(now);
        if let Ok(lateral) = &mut forces.lateral {
            let stands = now.seconds() >= self.from_to[0] && now.seconds() < self.from_to[1];
            let (raw, value) = *self.shown.filter(|_| stands).get_or_insert((lateral.raw, lateral.value));
            self.shown = Some((raw, value));
            (lateral.raw, lateral.value) = (raw, value);
        }
        forces
    }
}

/// An amplifier whose plate shows a share of its amplitude.
struct Damped<A> {
    amplifier: A,
    share: f64,
}

impl<A: Amplifier> Amplifier for Damped<A> {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        self.amplifier.command(command, now);
    }
    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        let mut state = self.amplifier.state(now)?;
        state.amplitude.iter_mut().for_each(|read| read.value *= self.share);
        Ok(state)
    }
}

type Swept = (Vec<MeasuredPass>, Vec<Event>, Vec<(u32, f64)>, Outcome);

/// Passes, events, when each point was measured, and the outcome, of a sweep with a sensor that stands still.
fn stuck(from_to: [f64; 2], frozen_after: u32) -> Swept {
    swept(from_to, frozen_after, 1.0)
}

fn swept(from_to: [f64; 2], frozen_after: u32, share: f64) -> Swept {
    let mut setup = Setup::load("virtual-ideal").unwrap();
    setup.config.limits.frozen_after = frozen_after;
    let plan = Plan::parse("plan.toml", TEN_PASSES).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn models::prediction::FrictionModel> =
        Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let noise = setup.file.noise;
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, noise);
    let [force, amplifier, stage] = VirtualRig::new(&WorldConfig::ideal(), 1).unwrap().split();
    let force = Stuck { force, from_to, shown: None };
    let amplifier = Damped { amplifier, share };
    let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut rig = VirtualLoop::new(setup.config, model, ports);
    let (mut passes, mut events, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    let outcome = supervisor::sweep(&mut rig, &mut sweep, &mut Requests::default, &mut |row, _, reaction| {
        if row.marker.phase == Phase::Measure {
            measured.push((row.marker.point, row.now.seconds()));
        }
        passes.extend(reaction.pass);
        events.extend(reaction.events);
    });
    (passes, events, measured, outcome)
}

/// A sensor dies in a pass: neither that pass nor a later one counts, whether a trip follows or not.
#[test]
fn a_pass_with_a_sensor_that_stands_still_does_not_count() {
    let (plain, _, measured, outcome) = stuck([f64::MAX; 2], 50);
    assert_eq!((plain.len(), outcome), (10, Outcome::Complete));
    let third = u32::try_from(plain[3].pass.point).unwrap();
    let ends = measured.iter().rfind(|(point, _)| *point == third).unwrap().1;

    let (passes, events, _, outcome) = stuck([ends - 0.02, f64::MAX], 50);
    assert!(
        matches!(outcome, Outcome::Tripped(trip) if trip.cause == TripCause::LateralFrozen),
        "{outcome:?}"
    );
    assert_eq!(passes.len(), 3, "the pass in which it died counts");
    let cause = Some(TripCause::LateralFrozen);
    assert!(events.contains(&Event::PassRepeated { point: third, cause }), "{events:?}");

    // No trip: it lives again before so many samples.
    let (passes, events, _, outcome) = stuck([ends - 0.02, ends + 0.1], 1000);
    assert_eq!((passes.len(), outcome), (10, Outcome::Complete));
    assert!(passes.iter().all(|p| p.pass.lateral_force_sd_n.is_some_and(|sd| sd > 0.0)));
    assert!(events.iter().any(|e| matches!(e, Event::PassRepeated { cause: Some(_), .. })), "{events:?}");

    // It stays dead, and no rule notices: the sweep gives up.
    let (passes, _, _, outcome) = stuck([ends - 0.02, f64::MAX], u32::MAX);
    assert!(matches!(outcome, Outcome::Frozen { cause: TripCause::LateralFrozen, .. }), "{outcome:?}");
    assert_eq!(passes.len(), 3);
}

/// The record alone had the remark. Here the first pass at an amplitude ends before the amplifier's response.
#[test]
fn a_plate_that_moves_too_little_is_remarked_on() {
    let (passes, events, _, outcome) = swept([f64::MAX; 2], 50, 0.5);
    assert_eq!((passes.len(), outcome), (10, Outcome::Complete));
    let remarked: Vec<&Event> = events.iter().filter(|e| matches!(e, Event::Remarked { .. })).collect();
    let of = |point: u32| Event::Remarked { point, remark: Remark::AmplitudeSags };
    assert_eq!(remarked, [1, 3, 5, 7, 9].map(of).each_ref(), "{events:?}");
    assert!(runs::report::events::describe(remarked[0]).contains("less than 0.7 of the commanded amplitude"));
    assert!(!swept([f64::MAX; 2], 50, 1.0).1.iter().any(|e| matches!(e, Event::Remarked { .. })));
}

#[test]
fn a_frozen_sensor_is_noticed_within_its_time() {
    let (profile, limits) = ("profile = \"muprime-force2\"", "[limits]\nfrozen_after");
    let stated = |rate: &str, n: u32| {
        let text = Setup::load("virtual-ideal").unwrap().text;
        let text = text.replacen(profile, &format!("{profile}\nrate_hz = {rate}"), 1);
        let text = match text.contains("[limits]\n") {
            true => text.replacen("[limits]\n", &format!("{limits} = {n}\n"), 1),
            false => format!("{text}\n{limits} = {n}\n"),
        };
        Setup::parse("changed", &text, Path::new(".")).err().map(|e| format!("{e:?}"))
    };
    for (rate, n, good) in [("20", 50, true), ("40", 100, true), ("40", 101, false), ("1000", 1000, true)] {
        let problem = stated(rate, n);
        assert_eq!(problem.is_none(), good, "{rate} {n}: {problem:?}");
        assert!(problem.is_none_or(|why| why.contains("20 to 100")), "{rate} {n}");
    }
}
