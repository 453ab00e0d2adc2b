//! From faulted to armed: one edge, the second channel proved, and no earlier request.

use super::*;
use crate::ports::SupplyState;

const RESET: Controls = Controls {
    reset: true,
    stop: false,
    dead_man: false,
    new_request: false,
    open_supply: false,
    modulated: false,
};

/// A rig with a relay that follows its command so many cycles later.
struct Relayed {
    bench: Bench,
    sent: Vec<SupplyCommand>,
    delay: usize,
    /// What it shows whatever the command.
    stuck: Option<bool>,
}

impl Relayed {
    fn new(delay: usize, stuck: Option<bool>) -> Self {
        Relayed { bench: Bench::new(), sent: Vec::new(), delay, stuck }
    }

    fn cut(&self) -> bool {
        let command = self.sent.len().checked_sub(self.delay + 1).map(|i| self.sent[i]);
        self.stuck.unwrap_or(command == Some(SupplyCommand::Cut))
    }

    fn cycle(&mut self, spoil: impl FnOnce(&mut Observation), controls: Controls) -> SafetyDecision {
        let (cut, n) = (self.cut(), self.bench.n + 1);
        let taken_at = Nanos(u64::from(n) * T.0);
        let decision = self.bench.cycle(
            |s| {
                s.supply = Ok(SupplyState { cut, taken_at, sequence: n });
                // A cut supply takes the amplifier with it.
                if cut {
                    s.amplifier = Err(NoData::Disconnected);
                }
                spoil(s);
            },
            controls,
        );
        self.sent.push(decision.supply);
        decision
    }

    /// A reset, and what follows within so many cycles: armed, or a trip.
    fn arm(&mut self, cycles: usize) -> (Option<Trip>, bool) {
        self.cycle(|_| {}, Controls::default());
        let first = self.cycle(|_| {}, RESET);
        for _ in 0..cycles {
            let decision = self.cycle(|_| {}, Controls::default());
            assert!(!decision.drive.enable());
            if decision.tripped.is_some() || decision.armed_now {
                return (decision.tripped, decision.armed_now);
            }
        }
        (first.tripped, first.armed_now)
    }
}

#[test]
fn the_second_channel_is_opened_and_closed_before_every_arming() {
    let mut rig = Relayed::new(5, None);
    assert_eq!(rig.arm(100), (None, true));
    assert!(rig.sent.contains(&SupplyCommand::Cut) && rig.sent.last() == Some(&SupplyCommand::Restore));
    // And again after a trip.
    rig.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    let cuts = |rig: &Relayed| rig.sent.iter().filter(|t| **t == SupplyCommand::Cut).count();
    let before = cuts(&rig);
    assert_eq!(rig.arm(100), (None, true));
    assert!(cuts(&rig) > before);
}

/// Before somebody reaches into the rig the supply opens and stays open; a reset proves it again.
#[test]
fn a_disarmed_rig_keeps_its_supply_open_until_the_channel_is_proved() {
    let mut rig = Relayed::new(5, None);
    assert_eq!(rig.arm(100), (None, true));
    let disarm = Controls { stop: true, open_supply: true, ..Controls::default() };
    let decision = rig.cycle(|_| {}, disarm);
    assert_eq!(decision.tripped.map(|trip| trip.cause), Some(TripCause::Stopped));
    for _ in 0..5000 {
        let decision = rig.cycle(|_| {}, Controls::default());
        assert_eq!((decision.supply, decision.drive.enable()), (SupplyCommand::Cut, false));
    }
    assert_eq!(rig.cycle(|_| {}, Controls::default()).waits_for, None, "a program may ask for the reset");
    assert_eq!(rig.arm(100), (None, true));
    assert_eq!(rig.sent.last(), Some(&SupplyCommand::Restore));
}

#[test]
fn a_second_channel_that_does_not_act_keeps_the_rig_from_arming() {
    for stuck in [false, true] {
        let mut rig = Relayed::new(0, Some(stuck));
        let (trip, armed) = rig.arm(700);
        assert!(!armed);
        // One that stands open already is known without a proof; one that does not open is found by it.
        match trip {
            Some(trip) => assert!(trip.cause == TripCause::SupplySwitch && trip.value > 0.5, "{trip:?}"),
            None => assert!(stuck),
        }
    }
    // Silent, it is lost: nothing is proved without a readback.
    let mut rig = Relayed::new(0, None);
    rig.cycle(|s| s.supply = Err(NoData::Disconnected), Controls::default());
    let decision = rig.cycle(|s| s.supply = Err(NoData::Disconnected), RESET);
    assert_eq!((decision.armed_now, decision.blocking), (false, Some(TripCause::SupplySwitch)));
}

/// A relay that sticks where its own proof has put it: the supply stays cut, and the rig is not armed.
#[test]
fn a_second_channel_that_opens_and_does_not_close_again_keeps_the_rig_from_arming() {
    let mut rig = Relayed::new(3, None);
    rig.cycle(|_| {}, Controls::default());
    rig.cycle(|_| {}, RESET);
    while !rig.cut() {
        assert!(rig.cycle(|_| {}, Controls::default()).tripped.is_none());
    }
    rig.stuck = Some(true);
    let tripped = (1..2000).find_map(|n| {
        let decision = rig.cycle(|_| {}, Controls::default());
        assert!(!decision.armed_now && !decision.drive.enable());
        decision.tripped.map(|trip| (n, trip))
    });
    let (cycles, trip) = tripped.unwrap();
    assert!(trip.cause == TripCause::SupplySwitch && trip.bound == 0.5 && trip.value > 0.5, "{trip:?}");
    // 500 ms, and the cycles in which the cut was seen and the closing commanded.
    assert!((500..=504).contains(&cycles), "{cycles}");
    assert!(!rig.cycle(|_| {}, Controls::default()).drive.enable());
}

#[test]
fn an_amplifier_that_does_not_come_back_is_a_trip_with_its_own_cause() {
    let mut rig = Relayed::new(2, None);
    rig.cycle(|_| {}, Controls::default());
    rig.cycle(|_| {}, RESET);
    let dead = |s: &mut Observation| s.amplifier = Err(NoData::Disconnected);
    let trip = (0..6000).find_map(|_| rig.cycle(dead, Controls::default()).tripped).unwrap();
    assert_eq!((trip.cause, trip.bound), (TripCause::AmplifierStale, 5.0));
    // One that comes back switched on is cut again at once.
    let mut rig = Relayed::new(2, None);
    rig.cycle(|_| {}, Controls::default());
    rig.cycle(|_| {}, RESET);
    let on = |s: &mut Observation| {
        if let Ok(state) = &mut s.amplifier {
            state.output_on = true;
        }
    };
    let decision =
        (0..200).map(|_| rig.cycle(on, Controls::default())).find(|d| d.tripped.is_some()).unwrap();
    assert_eq!(decision.tripped.unwrap().cause, TripCause::RefusesOff);
    assert!(is_cut(&decision));
}

#[test]
fn a_relay_that_falls_while_armed_trips() {
    let mut rig = Relayed::new(1, None);
    assert_eq!(rig.arm(100), (None, true));
    rig.stuck = Some(true);
    let up = |s: &mut Observation| s.amplifier = healthy(0, &DriveCommand::off(0, T)).amplifier;
    let trip = (0..700).find_map(|_| rig.cycle(up, Controls::default()).tripped).unwrap();
    assert!(matches!(trip.cause, TripCause::SupplySwitch | TripCause::AmplifierStale), "{trip:?}");
    // A readback that grows old trips as well.
    let mut rig = Relayed::new(1, None);
    assert_eq!(rig.arm(100), (None, true));
    let old = Nanos(u64::from(rig.bench.n) * T.0);
    let (mut cycles, mut trip) = (0, None);
    while trip.is_none() && cycles < 300 {
        cycles += 1;
        let stale =
            |s: &mut Observation| s.supply = Ok(SupplyState { cut: false, taken_at: old, sequence: 1 });
        trip = rig.cycle(stale, Controls::default()).tripped;
    }
    assert_eq!((trip.map(|t| t.cause), cycles), (Some(TripCause::SupplySwitch), 81));
}

/// The refusal is answered by the relay, which stays open until a reset proves it anew.
#[test]
fn an_amplifier_that_was_cut_stays_cut_until_it_is_proved_again() {
    let mut rig = Relayed::new(1, None);
    assert_eq!(rig.arm(100), (None, true));
    rig.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    let on = |s: &mut Observation| {
        if let Ok(state) = &mut s.amplifier {
            state.output_on = true;
        }
    };
    let cut = (1..100).find(|_| is_cut(&rig.cycle(on, Controls::default())));
    assert!(cut.is_some_and(|n| n <= 9 + 10 + 1), "{cut:?}");
    for _ in 0..300 {
        assert!(is_cut(&rig.cycle(|_| {}, Controls::default())));
    }
    assert_eq!(rig.arm(100), (None, true));
}

#[test]
fn a_reset_clears_and_never_restarts() {
    let mut bench = Bench::armed();
    assert!(bench.last.enable());
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    // Requested again while it stands faulted, and in the very cycle of the reset: neither counts.
    bench.cycle(|_| {}, Controls { new_request: true, ..Controls::default() });
    let armed = bench.cycle(|_| {}, Controls { new_request: true, ..RESET });
    assert!(armed.armed_now);
    for _ in 0..500 {
        let decision = bench.cycle(|_| {}, Controls::default());
        assert!(bench.safety.is_armed() && !decision.drive.enable());
        assert_eq!((decision.stage.velocity_m_s(), decision.stage.normal_force_n()), (0.0, 0.0));
    }
    let decision = bench.cycle(|_| {}, Controls { new_request: true, ..Controls::default() });
    assert!(decision.drive.enable() && decision.stage.normal_force_n() == 0.25);
}

#[test]
fn an_amplifier_without_watchdog_needs_the_second_channel() {
    let mut bench = Bench::new();
    bench.limits.amplifier_watchdog = false;
    bench.cycle(|_| {}, Controls::default());
    let decision = bench.cycle(|_| {}, RESET);
    assert_eq!((decision.armed_now, decision.blocking), (false, Some(TripCause::Unguarded)));
    let mut rig = Relayed::new(1, None);
    rig.bench.limits.amplifier_watchdog = false;
    assert_eq!(rig.arm(100), (None, true));
}

/// An amplifier that shows a fault for as long as its supply is open, as one with a guard of its own supply does.
fn faulted_without_supply(s: &mut Observation) {
    if s.supply.is_ok_and(|supply| supply.cut) {
        s.amplifier = healthy(0, &DriveCommand::off(0, T)).amplifier;
        let taken_at = s.supply.unwrap().taken_at;
        let state = s.amplifier.as_mut().unwrap();
        (state.fault, state.taken_at) = (true, taken_at);
    }
}

/// A board that is heard again: the supply that was cut for its silence is what makes the amplifier show a
/// fault. Nothing prevents the proof, which closes it; until that proof it stays cut.
#[test]
fn a_supply_cut_for_a_silent_board_before_arming_is_proved_and_the_fault_it_explains_is_not_waited_for() {
    let closed = |s: &mut Observation, at: u64| {
        let contact = SafetyContact { closed: true, taken_at: Nanos(at * T.0), sequence: at as u32 };
        s.contacts.emergency_stop = Ok(contact);
    };
    let mut rig = Relayed::new(3, None);
    let heard = |rig: &mut Relayed, controls: Controls| {
        let at = u64::from(rig.bench.n) + 1;
        rig.cycle(|s| (closed(s, at), faulted_without_supply(s)).1, controls)
    };
    for _ in 0..20 {
        assert_eq!(heard(&mut rig, Controls::default()).waits_for, None);
    }
    let last = u64::from(rig.bench.n);
    for n in 1..=100 {
        let decision = rig.cycle(|s| (closed(s, last), faulted_without_supply(s)).1, Controls::default());
        // 80 ms is its age limit.
        assert_eq!(decision.waits_for, (n > 80).then_some(TripCause::EmergencyStop), "{n}");
        assert_eq!(is_cut(&decision), n > 80);
    }
    for _ in 0..1000 {
        let decision = heard(&mut rig, Controls::default());
        assert!(is_cut(&decision) && !decision.armed_now);
        assert_eq!((decision.blocking, decision.waits_for), (Some(TripCause::AmplifierFault), None));
    }
    heard(&mut rig, RESET);
    assert!((0..100).any(|_| heard(&mut rig, Controls::default()).armed_now));
    // A fault that the supply does not explain is waited for, before the reset and in the proof.
    let mut rig = Relayed::new(3, None);
    let faulted = |s: &mut Observation| s.amplifier.as_mut().unwrap().fault = true;
    assert_eq!(rig.cycle(faulted, Controls::default()).waits_for, Some(TripCause::AmplifierFault));
    assert_eq!(rig.cycle(faulted, RESET).waits_for, Some(TripCause::AmplifierFault));
    assert!(!rig.bench.safety.is_proving());
}

/// What a person did, or must look at, keeps a program from asking for a reset: pressed and released, or refused and cut.
#[test]
fn a_supply_cut_for_a_pressed_stop_or_a_refusal_waits_for_a_person() {
    for pressed in [true, false] {
        let mut rig = Relayed::new(1, None);
        let seen = |s: &mut Observation, is_closed: bool, on: bool| {
            let taken_at = s.supply.unwrap().taken_at;
            s.contacts.emergency_stop = Ok(SafetyContact { closed: is_closed, taken_at, sequence: 1 });
            faulted_without_supply(s);
            s.amplifier.as_mut().unwrap().output_on = on;
        };
        let cause = if pressed { TripCause::EmergencyStop } else { TripCause::RefusesOff };
        let cut = (0..100).find(|_| {
            let decision = rig.cycle(|s| seen(s, !pressed, !pressed), Controls::default());
            assert!(!is_cut(&decision) || decision.waits_for == Some(cause));
            is_cut(&decision)
        });
        assert!(cut.is_some());
        for _ in 0..200 {
            let decision = rig.cycle(|s| seen(s, true, false), Controls::default());
            assert!(is_cut(&decision) && decision.waits_for == Some(cause), "{:?}", decision.waits_for);
        }
        // A silence afterwards does not make it less.
        rig.cycle(|s| s.contacts.emergency_stop = Err(NoData::Disconnected), Controls::default());
        let decision = rig.cycle(|s| seen(s, true, false), Controls::default());
        assert_eq!(decision.waits_for, Some(cause));
        // The operator's own reset proves the channel, as ever.
        rig.cycle(|s| seen(s, true, false), RESET);
        let armed = (0..100).any(|_| rig.cycle(|s| seen(s, true, false), Controls::default()).armed_now);
        assert!(armed);
        assert_eq!(rig.cycle(|s| seen(s, true, false), Controls::default()).waits_for, None);
    }
}

/// A relay that does not close is not reported as its amplifier's fault, in the proof and before it.
#[test]
fn an_open_supply_is_reported_as_the_relay_and_not_as_the_amplifier() {
    let mut rig = Relayed::new(0, Some(true));
    for _ in 0..600 {
        let decision = rig.cycle(faulted_without_supply, Controls::default());
        assert_eq!(decision.blocking, Some(TripCause::AmplifierFault));
        assert_eq!(decision.waits_for, Some(TripCause::SupplySwitch));
    }
    // Closed again in the proof, the amplifier is what is waited for.
    let mut rig = Relayed::new(2, None);
    rig.cycle(|_| {}, Controls::default());
    rig.cycle(|_| {}, RESET);
    let faulted = |s: &mut Observation| {
        s.amplifier = healthy(0, &DriveCommand::off(0, T)).amplifier;
        let taken_at = s.supply.unwrap().taken_at;
        let state = s.amplifier.as_mut().unwrap();
        (state.fault, state.taken_at) = (true, taken_at);
    };
    let waits: Vec<_> = (0..12).map(|_| rig.cycle(faulted, Controls::default()).waits_for).collect();
    assert_eq!((waits[0], waits[11]), (None, Some(TripCause::AmplifierFault)), "{waits:?}");
    assert!(rig.bench.safety.is_proving());
}

/// Deadlines that were missed before arming count after it as well: a reset before they are forgotten would arm a rig that trips.
#[test]
fn missed_deadlines_that_would_trip_the_armed_rig_are_waited_for() {
    let mut bench = Bench::new();
    let late = |s: &mut Observation| s.lateness = Nanos(11 * T.0);
    bench.cycle(late, Controls::default());
    let waited =
        (1..2000).find(|_| bench.cycle(|_| {}, Controls::default()).waits_for != Some(TripCause::Overrun));
    // A thousand cycles in buckets of a hundred, the first of which holds the stall.
    assert_eq!(waited, Some(1000));
    bench.cycle(|_| {}, RESET);
    assert!((0..50).all(|_| bench.cycle(|_| {}, Controls::default()).tripped.is_none()));
    // As many as are allowed keep nothing from being armed.
    let mut bench = Bench::new();
    bench.cycle(|s| s.lateness = Nanos(10 * T.0), Controls::default());
    assert_eq!(bench.cycle(|_| {}, Controls::default()).waits_for, None);
}
