//! Arming beside stalls, in virtual time: the loop stands still, the board that it hears through stands still
//! with it, the rig does not.

use crate::plan::{Plan, Resolution};
use crate::supervisor::{self, Loop, Requests, VirtualLoop};
use crate::{Event, Outcome, Setup, Sweep};
use models::{FrictionModel, SpringSlider};
use realtime::ports::{Amplifier, AmplifierState, Contacts, Nanos, NoData, SafetyInputs};
use realtime::safety::{DriveCommand, Limits, TripCause};
use realtime::{Command, Ports, Row};
use sim::virtual_rig::{SharedRig, VirtualRig};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const PLAN: &str = "name = \"p\"\nseed = 3\nreference_every = 0\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n[base]\n\
    amplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
    amplitude_pp_m = [2e-6]\n";
const MS: u64 = 1_000_000;

/// What happens to the rig before it is armed.
#[derive(Clone, Copy, Default)]
struct Before {
    /// A stall of so many ms in the cycle of this number.
    stall: Option<(u64, u64)>,
    /// A stall of so many ms in the second cycle of each of the first so many proofs.
    proofs: Option<(u32, u64)>,
    /// The emergency stop is pressed in these cycles.
    pressed: [u64; 2],
    /// The amplifier has a fault of its own.
    faulty: bool,
    /// The sweep has a human finger.
    human: bool,
}

/// A board whose link stands still with the loop: the first look after a stall shows what was there before
/// it.
struct Board {
    rig: SharedRig,
    pressed: Arc<AtomicBool>,
    stored: Option<(Nanos, Contacts)>,
}

impl SafetyInputs for Board {
    fn read(&mut self, now: Nanos) -> Contacts {
        let held = self.stored.filter(|(before, _)| now.since(*before).0 > 10 * MS);
        let mut seen = held.map_or_else(|| self.rig.read(now), |(_, stored)| stored);
        if let (None, Ok(contact)) = (held, &mut seen.emergency_stop) {
            contact.closed = !self.pressed.load(Ordering::Relaxed);
        }
        seen.dead_man = Err(NoData::NotFitted);
        self.stored = Some((now, seen));
        seen
    }
}

struct Generator {
    rig: SharedRig,
    faulty: bool,
}

impl Amplifier for Generator {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        Amplifier::command(&mut self.rig, command, now);
    }

    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData> {
        let state = Amplifier::state(&mut self.rig, now)?;
        Ok(AmplifierState { fault: state.fault || self.faulty, ..state })
    }
}

/// A loop in virtual time that is held up.
struct Held {
    rig: VirtualLoop,
    before: Before,
    pressed: Arc<AtomicBool>,
    now: u64,
    cycle: u64,
    proving: u64,
    proofs: u32,
}

impl Loop for Held {
    fn next_row(&mut self) -> Option<Row> {
        self.cycle += 1;
        let [from, to] = self.before.pressed;
        self.pressed.store((from..to).contains(&self.cycle), Ordering::Relaxed);
        let here = self.before.stall.filter(|(cycle, _)| *cycle == self.cycle).map(|(_, ms)| ms);
        let proof = self.before.proofs.filter(|(most, _)| self.proving == 1 && self.proofs <= *most);
        let stall = here.or(proof.map(|(_, ms)| ms)).unwrap_or(0);
        self.now += (1 + stall) * MS;
        let row = self.rig.cycle_at(Nanos(self.now), Nanos(stall * MS));
        self.proving = if row.proving { self.proving + 1 } else { 0 };
        self.proofs += u32::from(self.proving == 1);
        Some(row)
    }

    fn send(&mut self, command: Command) -> bool {
        self.rig.send(command)
    }

    fn stop(&mut self) {
        self.rig.stop();
    }

    fn is_lost(&self) -> bool {
        false
    }
}

/// Sweeps on the rig with a relay and a board; returns how it ended, its events and its rows.
fn swept(before: Before) -> (Outcome, Vec<Event>, Vec<Row>) {
    let setup = Setup::load("virtual-relay").unwrap();
    let plan = Plan::parse("plan.toml", PLAN).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut limits: Limits = setup.config.limits;
    limits.human_contact = before.human;
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise)
        .guarded_by(&limits);
    let [force, rig, stage] = VirtualRig::new(&sim::world::WorldConfig::ideal(), 1).unwrap().split();
    let pressed = Arc::new(AtomicBool::new(false));
    let board = Board { rig: stage.clone(), pressed: Arc::clone(&pressed), stored: None };
    let amplifier = Generator { rig, faulty: before.faulty };
    let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage.clone()));
    let ports = Ports { supply: Box::new(stage), contacts: Box::new(board), ..ports };
    let rig = VirtualLoop::new(setup.config, model, ports);
    let mut held = Held { rig, before, pressed, now: 0, cycle: 0, proving: 0, proofs: 0 };
    let (mut events, mut rows) = (Vec::new(), Vec::new());
    let outcome =
        supervisor::sweep(&mut held, &mut sweep, &mut Requests::default, &mut |row, _, reaction| {
            rows.push(*row);
            events.extend(reaction.events);
        });
    // Whatever happened, nothing was driven or moved before it was armed, and every arming came straight from
    // a proof.
    for pair in rows.windows(2) {
        let [before, row] = pair else { unreachable!("two rows") };
        assert!(row.armed || (row.drive_pp_m, row.velocity_m_s, row.load_n) == (0.0, 0.0, 0.0));
        assert!(before.armed || !row.armed || (before.proving && row.blocking.is_none()), "{row:?}");
    }
    (outcome, events, rows)
}

fn disturbed(events: &[Event]) -> Vec<(TripCause, u64)> {
    let of = |event: &Event| match event {
        Event::ArmingDisturbed { cause, held_up } => Some((*cause, held_up.0 / MS)),
        _ => None,
    };
    events.iter().filter_map(of).collect()
}

/// The supply was cut for a board that was silent for 120 ms, and its amplifier showed a fault for that. For
/// ten seconds the sweep waited for what only its own proof could clear, and reported the amplifier's fault
/// as the cause.
#[test]
fn a_stall_before_arming_is_reported_and_the_second_channel_proved() {
    let (outcome, events, _) = swept(Before::default());
    assert_eq!((outcome, disturbed(&events)), (Outcome::Complete, vec![]), "{events:?}");
    // Of 120 deadlines in a thousand, more than the limit were missed: armed before they are forgotten, the
    // rig would trip at once.
    for (cycle, ms, waits) in [(3, 90, 40..80), (10, 90, 40..80), (40, 90, 40..80), (10, 120, 900..1100)] {
        let (outcome, events, rows) = swept(Before { stall: Some((cycle, ms)), ..Before::default() });
        assert_eq!(outcome, Outcome::Complete, "{events:?}");
        assert_eq!(disturbed(&events), [(TripCause::EmergencyStop, ms)]);
        let explained =
            |row: &&Row| row.supply_cut && !row.proving && row.blocking == Some(TripCause::AmplifierFault);
        let shown = rows.iter().filter(explained).count();
        assert!(waits.contains(&shown), "the fault that the cut explains was shown for {shown} cycles");
    }
}

#[test]
fn a_proof_that_a_stall_broke_off_is_made_again_and_told() {
    for (ms, cause) in [(120, TripCause::Suspended), (48, TripCause::Overrun)] {
        let (outcome, events, rows) = swept(Before { proofs: Some((1, ms)), ..Before::default() });
        assert_eq!(outcome, Outcome::Complete, "{events:?}");
        assert_eq!(disturbed(&events), [(cause, ms)], "{events:?}");
        assert!(!events.iter().any(|event| matches!(event, Event::Tripped(_))));
        assert_eq!(rows.iter().filter(|row| row.tripped.is_some()).count(), 1, "the record has the trip");
        // A stall in every proof: three, and the true cause.
        let (outcome, events, rows) = swept(Before { proofs: Some((9, ms)), ..Before::default() });
        let Outcome::Tripped(trip) = outcome else { panic!("{outcome:?}") };
        assert_eq!((trip.cause, events.last()), (cause, Some(&Event::Tripped(trip))));
        assert_eq!(rows.iter().filter(|row| row.tripped.is_some()).count(), 3);
        // With a human finger nothing is begun again without a person.
        let (outcome, events, _) = swept(Before { proofs: Some((1, ms)), human: true, ..Before::default() });
        assert!(matches!(outcome, Outcome::Tripped(trip) if trip.cause == cause), "{events:?}");
    }
}

/// Pressed and released while the rig arms: whoever pressed it must start the run again.
#[test]
fn a_stop_that_was_pressed_before_arming_is_not_cleared_by_the_sweep() {
    let (outcome, events, rows) = swept(Before { pressed: [10, 300], ..Before::default() });
    assert_eq!(outcome, Outcome::WouldNotArm { blocking: Some(TripCause::EmergencyStop) }, "{events:?}");
    // A person reads what stopped it, no name of the code.
    assert_eq!(outcome.words(), format!("the rig would not arm: {}", TripCause::EmergencyStop.words()));
    assert!(rows.iter().skip(10).all(|row| row.supply_cut && !row.proving));
    // In the midst of a proof too, whatever the machine does.
    let (outcome, ..) = swept(Before { pressed: [54, 300], proofs: Some((1, 9)), ..Before::default() });
    assert!(
        matches!(outcome, Outcome::Tripped(trip) if trip.cause == TripCause::EmergencyStop),
        "{outcome:?}"
    );
}

#[test]
fn a_fault_of_the_amplifiers_own_is_its_own_beside_a_stall_too() {
    let (outcome, events, _) = swept(Before { faulty: true, ..Before::default() });
    assert_eq!(outcome, Outcome::WouldNotArm { blocking: Some(TripCause::AmplifierFault) });
    assert!(events.is_empty(), "{events:?}");
    // Cut for a silent board, only the proof can tell: closed again, the fault is still there.
    let (outcome, events, rows) = swept(Before { faulty: true, stall: Some((10, 120)), ..Before::default() });
    let Outcome::Tripped(trip) = outcome else { panic!("{outcome:?} {events:?}") };
    assert_eq!((trip.cause, trip.bound), (TripCause::AmplifierFault, 5.0));
    assert!(rows.iter().all(|row| !row.armed));
}
