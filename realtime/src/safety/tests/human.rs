//! A human finger in the rig: the contacts, the hand that confirms, and how long and how strongly it may be vibrated.

use super::*;
use crate::ports::SupplyState;

/// A rig with everything that a human finger needs.
struct Guarded {
    bench: Bench,
    held: bool,
    pressed: bool,
    open: bool,
    cut: bool,
}

impl Guarded {
    fn new() -> Self {
        let mut bench = Bench::new();
        bench.limits.human_contact = true;
        Guarded { bench, held: false, pressed: false, open: false, cut: false }
    }

    fn cycle(&mut self, spoil: impl FnOnce(&mut Observation), controls: Controls) -> SafetyDecision {
        let n = self.bench.n + 1;
        let taken_at = Nanos(u64::from(n) * T.0);
        let contact = |closed| Ok(SafetyContact { closed, taken_at, sequence: n });
        let (held, pressed, open, cut) = (self.held, self.pressed, self.open, self.cut);
        let decision = self.bench.cycle(
            |s| {
                s.supply = Ok(SupplyState { cut, taken_at, sequence: n });
                s.contacts = Contacts {
                    emergency_stop: contact(!pressed),
                    interlock: contact(!open),
                    dead_man: contact(held),
                };
                spoil(s);
            },
            controls,
        );
        self.cut = is_cut(&decision);
        decision
    }

    /// Presses the reset and waits for the proof.
    fn reset(&mut self) -> bool {
        let first = self.cycle(|_| {}, Controls { reset: true, ..Controls::default() });
        first.armed_now || (0..50).any(|_| self.cycle(|_| {}, Controls::default()).armed_now)
    }

    /// Armed and driving, the hand at its device.
    fn driving() -> Self {
        let mut rig = Guarded::new();
        rig.cycle(|_| {}, Controls::default());
        rig.held = true;
        rig.cycle(|_| {}, Controls::default());
        assert!(rig.reset(), "{:?}", rig.cycle(|_| {}, Controls::default()).blocking);
        rig.bench.request = Request {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            velocity_m_s: 0.0,
            normal_force_n: 0.25,
        };
        assert!(rig.cycle(|_| {}, Controls::default()).drive.enable());
        rig
    }
}

#[test]
fn a_hand_must_let_go_and_grip_again_before_every_arming() {
    // Tied down from the beginning.
    let mut rig = Guarded::new();
    rig.held = true;
    rig.cycle(|_| {}, Controls::default());
    assert!(!rig.reset());
    assert_eq!(rig.cycle(|_| {}, Controls::default()).blocking, Some(TripCause::DeadMan));
    let mut rig = Guarded::driving();
    rig.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    assert!(!rig.reset(), "held all the time: nobody confirmed");
    rig.held = false;
    rig.cycle(|_| {}, Controls::default());
    rig.held = true;
    assert!(rig.reset());
}

#[test]
fn letting_go_pressing_stop_and_opening_the_guard_switch_off_at_once() {
    type Act = fn(&mut Guarded);
    let acts: [(Act, TripCause); 3] = [
        (|r| r.held = false, TripCause::DeadMan),
        (|r| r.pressed = true, TripCause::EmergencyStop),
        (|r| r.open = true, TripCause::Interlock),
    ];
    for (act, cause) in acts {
        let mut rig = Guarded::driving();
        act(&mut rig);
        let decision = rig.cycle(|_| {}, Controls::default());
        assert_eq!(decision.tripped.map(|t| t.cause), Some(cause));
        assert!(!decision.drive.enable());
        // The emergency stop is the one that takes the supply away.
        assert_eq!(is_cut(&decision), cause == TripCause::EmergencyStop);
    }
}

#[test]
fn a_contact_of_which_nothing_is_known_is_open() {
    type Pick = fn(&mut Observation) -> &mut Result<SafetyContact, NoData>;
    let picks: [(Pick, TripCause); 3] = [
        (|s| &mut s.contacts.dead_man, TripCause::DeadMan),
        (|s| &mut s.contacts.emergency_stop, TripCause::EmergencyStop),
        (|s| &mut s.contacts.interlock, TripCause::Interlock),
    ];
    for (pick, cause) in picks {
        for reason in [NoData::Disconnected, NoData::NeverRead, NoData::Corrupt] {
            let mut rig = Guarded::driving();
            let decision = rig.cycle(|s| *pick(s) = Err(reason), Controls::default());
            assert_eq!(decision.tripped.map(|t| t.cause), Some(cause), "{reason:?}");
        }
        // Silent: 80 ms is its age limit.
        let mut rig = Guarded::driving();
        let last = Nanos(u64::from(rig.bench.n) * T.0);
        let silent = |s: &mut Observation| pick(s).as_mut().unwrap().taken_at = last;
        let took = (1..200).find(|_| rig.cycle(silent, Controls::default()).tripped.is_some());
        assert_eq!(took, Some(81), "{cause:?}");
    }
}

/// Stopped for 200 ms (SR-31): everything is old, and no contact is blamed for it. What is open is blamed,
/// and the supply is cut as ever.
#[test]
fn what_grew_old_while_the_loop_stood_still_is_not_to_blame() {
    type Act = fn(&mut Guarded);
    let acts: [(Act, TripCause); 3] = [
        (|_| {}, TripCause::Suspended),
        (|r| r.pressed = true, TripCause::EmergencyStop),
        (|r| r.open = true, TripCause::Interlock),
    ];
    for (act, cause) in acts {
        let mut rig = Guarded::driving();
        for _ in 0..250 {
            rig.cycle(|_| {}, Controls::default());
        }
        act(&mut rig);
        let decision = rig.cycle(suspended, Controls::default());
        assert_eq!(decision.tripped.map(|t| t.cause), Some(cause));
        assert!(is_cut(&decision) && !decision.drive.enable(), "{cause:?}");
    }
    let stop = Controls { stop: true, ..Controls::default() };
    assert_eq!(Guarded::driving().cycle(suspended, stop).tripped.map(|t| t.cause), Some(TripCause::Stopped));
}

fn suspended(seen: &mut Observation) {
    let old = |at: &mut Nanos| *at = Nanos(at.0.saturating_sub(200 * T.0));
    seen.lateness = Nanos(200 * T.0);
    for sample in [&mut seen.forces.lateral, &mut seen.forces.normal].into_iter().flatten() {
        old(&mut sample.taken_at);
    }
    let contacts = &mut seen.contacts;
    for contact in
        [&mut contacts.emergency_stop, &mut contacts.interlock, &mut contacts.dead_man].into_iter().flatten()
    {
        old(&mut contact.taken_at);
    }
}

#[test]
fn a_human_finger_is_refused_where_anything_is_missing() {
    type Spoil = fn(&mut Observation);
    let missing: [(Spoil, f64); 3] = [
        (|s| s.supply = Err(NoData::NotFitted), 2.0),
        (|s| s.contacts.emergency_stop = Err(NoData::NotFitted), 3.0),
        (|s| s.contacts.dead_man = Err(NoData::NotFitted), 4.0),
    ];
    for (spoil, which) in missing {
        let mut rig = Guarded::driving();
        let trip = rig.cycle(spoil, Controls::default()).tripped.unwrap();
        match trip.cause {
            TripCause::Unguarded => assert_eq!(trip.value, which),
            // A dead-man device that is not there is not held either.
            cause => assert_eq!((cause, which), (TripCause::DeadMan, 4.0)),
        }
    }
    // A relay that the same program switches is no watchdog: one must be at the amplifier or at the relay itself.
    for (amplifier, supply) in [(true, false), (false, true), (true, true), (false, false)] {
        let mut rig = Guarded::driving();
        (rig.bench.limits.amplifier_watchdog, rig.bench.limits.supply_watchdog) = (amplifier, supply);
        let tripped = rig.cycle(|_| {}, Controls::default()).tripped.map(|trip| (trip.cause, trip.value));
        assert_eq!(tripped, (!amplifier && !supply).then_some((TripCause::Unguarded, 5.0)));
    }
    // An interlock that is not fitted is not missed.
    let mut rig = Guarded::driving();
    let without = |s: &mut Observation| s.contacts.interlock = Err(NoData::NotFitted);
    assert_eq!(rig.cycle(without, Controls::default()).tripped, None);
}

#[test]
fn a_key_stands_for_a_dead_man_device_only_where_the_limits_say_so() {
    let no_device = |s: &mut Observation| s.contacts.dead_man = Err(NoData::NotFitted);
    for allowed in [true, false] {
        let mut rig = Guarded::driving();
        rig.bench.limits.dead_man_key = allowed;
        let key = Controls { dead_man: true, ..Controls::default() };
        assert_eq!(rig.cycle(no_device, key).tripped.is_none(), allowed);
        assert!(!allowed || rig.cycle(no_device, Controls::default()).tripped.is_some(), "released");
    }
    // Where a device is fitted, no key helps.
    let mut rig = Guarded::driving();
    (rig.bench.limits.dead_man_key, rig.held) = (true, false);
    let key = Controls { dead_man: true, ..Controls::default() };
    assert_eq!(rig.cycle(|_| {}, key).tripped.map(|t| t.cause), Some(TripCause::DeadMan));
}

/// Driven and resting by turns; the cause and the time driven in s at the trip.
fn driven(on: u32, off: u32, cycles: u32, change: fn(&mut Limits)) -> Option<(TripCause, f64)> {
    let mut rig = Guarded::driving();
    change(&mut rig.bench.limits);
    let w = rig.bench.request.amplitude;
    let mut time = 1;
    for i in 0..cycles {
        let drive = i % (on + off) < on;
        rig.bench.request.amplitude = if drive { w } else { PeakToPeak::ZERO };
        let decision = rig.cycle(|_| {}, Controls::default());
        if let Some(trip) = decision.tripped {
            return Some((trip.cause, f64::from(time) * T.seconds()));
        }
        time += u32::from(decision.drive.enable());
    }
    None
}

#[test]
fn no_pause_shorter_than_a_rest_ends_a_go() {
    let short: fn(&mut Limits) = |l| {
        (l.exposure_max_s, l.exposure_rest_s) = (2.0, 10.0);
        l.frozen_after = 1000;
    };
    for off in [0, 1, 50, 500] {
        let (cause, time) = driven(100, off, 60_000, short).unwrap();
        assert_eq!(cause, TripCause::Exposure, "{off}");
        assert!((1.99..2.05).contains(&time), "{off}: {time} s");
    }
    // A rest of full length does.
    assert_eq!(driven(1900, 10_100, 40_000, short), None);
}

#[test]
fn the_hour_has_a_share_and_a_dose() {
    let duty: fn(&mut Limits) = |l| (l.exposure_max_s, l.exposure_duty_max) = (600.0, 1e-3);
    let (cause, time) = driven(700, 1, 10_000, duty).unwrap();
    assert!(cause == TripCause::ExposureDuty && (3.6..3.62).contains(&time), "{cause:?} {time}");
    // 2 um at 27.5 kHz: (pi f w)^2 / 2 = 0.01493 m2/s2.
    let dose: fn(&mut Limits) = |l| (l.exposure_max_s, l.exposure_dose_max_m2_s) = (600.0, 0.03);
    let (cause, time) = driven(700, 1, 10_000, dose).unwrap();
    let expected = 0.03 / (0.5 * (std::f64::consts::PI * 27_500.0 * 2e-6f64).powi(2));
    assert!(
        cause == TripCause::ExposureDose && (time - expected).abs() < 0.02,
        "{cause:?} {time} {expected}"
    );
    // Nobody's finger: nothing is counted against it.
    let nobody: fn(&mut Limits) = |l| {
        (l.exposure_max_s, l.exposure_dose_max_m2_s, l.exposure_duty_max) = (0.1, 1e-3, 1e-3);
        l.human_contact = false;
    };
    assert_eq!(driven(700, 1, 10_000, nobody), None);
}

/// The window forgets a minute only when all of it is an hour ago.
#[test]
fn the_hour_slides_and_forgets_nothing_early() {
    let mut exposure = exposure::Exposure::default();
    let second = 1_000_000_000;
    let rest = Nanos(60 * second);
    exposure.add(false, 0.0, rest, Nanos(0));
    // Driven for the first ten minutes, at 0.1 m/s.
    for s in 1..=600 {
        exposure.add(true, 0.1, rest, Nanos(s * second));
    }
    let (time, dose) = exposure.in_the_last_hour();
    assert_eq!(time, Nanos(600 * second));
    assert!((dose - 6.0).abs() < 1e-9);
    for s in 601..=8000 {
        exposure.add(false, 0.0, rest, Nanos(s * second));
        let (time, dose) = exposure.in_the_last_hour();
        // What was driven within the last 3600 s exactly is never more than what the window says, and at most a minute less.
        let exact = 600u64.saturating_sub(s.saturating_sub(3600)).min(600);
        let seconds = time.0 / second;
        assert!(seconds >= exact && seconds <= exact + 61, "{s}: {seconds} s counted, {exact} s driven");
        assert!((dose - 0.01 * time.seconds()).abs() < 1e-9);
    }
    assert_eq!(exposure.in_the_last_hour().0, Nanos(0));
    assert_eq!(exposure.in_one_go, Nanos(0));
}

/// What earlier runs did counts on, and leaves the hour when it is an hour ago: never earlier, at most six minutes later.
#[test]
fn what_earlier_runs_did_is_carried_over() {
    let second = 1_000_000_000;
    let (rest, minute) = (Nanos(60 * second), 60);
    for part in 0..PARTS {
        let mut past =
            Exposed { in_one_go: Nanos(7 * second), resting: Nanos(59 * second), ..Exposed::default() };
        past.parts[part] = (Nanos(100 * second), 3.0);
        let mut exposure = exposure::Exposure::default();
        exposure.carry(&past);
        exposure.add(false, 0.0, rest, Nanos(0));
        assert_eq!((exposure.in_one_go, exposure.in_all), (Nanos(7 * second), (Nanos(0), 0.0)));
        assert_eq!(exposure.in_the_last_hour(), (Nanos(100 * second), 3.0));
        // It was driven between these times before the run, in minutes.
        let (newest, oldest) = ((part * PART_MINUTES) as u64, ((part + 1) * PART_MINUTES) as u64);
        let forgotten = (1..=66 * minute).find(|s| {
            exposure.add(false, 0.0, rest, Nanos(s * second));
            exposure.in_the_last_hour().0 == Nanos(0)
        });
        let forgotten = forgotten.expect("it is forgotten some time") / minute;
        assert!(
            forgotten + newest >= 60 && forgotten + oldest <= 60 + 6,
            "part {part}: after {forgotten} min"
        );
        assert_eq!(exposure.in_one_go, Nanos(0), "the rest went on over the gap");
    }
    // The rules see it from the first cycle on.
    let mut rig = Guarded::new();
    let mut past = Exposed::default();
    past.parts[2] = (Nanos(1801 * second), 0.0);
    rig.bench.safety.carry(&past);
    let decision = rig.cycle(|_| {}, Controls::default());
    assert!(matches!(decision.blocking, Some(TripCause::DeadMan)), "{:?}", decision.blocking);
    rig.held = true;
    let decision = rig.cycle(|_| {}, Controls::default());
    assert_eq!(decision.blocking, Some(TripCause::ExposureDuty));
}
