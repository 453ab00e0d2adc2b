//! Each time to the cycle: closed forms of what the rules count in.

use super::*;

fn now(bench: &Bench) -> u64 {
    u64::from(bench.n) * T.0
}

/// 2.4 ms of ring time makes the response time 12 + 18 + 2 = 32 whole cycles: the 33rd cycle after a change
/// is the first to be judged.
fn whole_cycles() -> Bench {
    let mut bench = Bench::armed();
    bench.limits.timing.ring_time = Nanos(2_400_000);
    bench.limits.amplitude_rate_max_m_s = 1e9;
    bench
}

#[test]
fn a_new_set_point_has_its_response_time() {
    type Change = fn(&mut Request);
    let changes: [Change; 2] =
        [|r| r.frequency_hz = 28_000.0, |r| r.amplitude = PeakToPeak::from_metres(2.2e-6)];
    for change in changes {
        let mut bench = whole_cycles();
        let before = bench.last_state();
        change(&mut bench.request);
        bench.cycle(|_| {}, Controls::default());
        let (cause, cycles) = bench.until_off(|s| {
            amplifier(s).echoed_amplitude = before.echoed_amplitude;
            amplifier(s).echoed_frequency_hz = before.echoed_frequency_hz;
        });
        assert_eq!((cause, cycles), (TripCause::EchoMismatch, 33));
    }
    // A plate that does not follow from rest: remarked and refused in the same cycle.
    let mut bench = whole_cycles();
    bench.request.amplitude = PeakToPeak::ZERO;
    for _ in 0..60 {
        bench.cycle(|_| {}, Controls::default());
    }
    bench.request.amplitude = PeakToPeak::from_metres(2e-6);
    bench.cycle(|_| {}, Controls::default());
    let (cause, cycles) = bench.until_off(|s| amplifier(s).amplitude.as_mut().unwrap().value = 0.0);
    assert_eq!((cause, cycles), (TripCause::DriveNoResponse, 33));
    let mut bench = whole_cycles();
    bench.request.amplitude = PeakToPeak::from_metres(4e-6);
    bench.cycle(|_| {}, Controls::default());
    let sags = (1..100).find(|_| {
        let half = |s: &mut Observation| amplifier(s).amplitude.as_mut().unwrap().value = 2e-6;
        bench.cycle(half, Controls::default()).remark == Some(Remark::AmplitudeSags)
    });
    assert_eq!(sags, Some(33));
}

/// A lower set-point: two cycles to be sent and nine to be read, then the plate rings down; measured may be 1.3 of that.
#[test]
fn a_plate_may_ring_down_with_its_time_constant_and_no_slower() {
    for ring_cycles in [2.5, 25.0] {
        let mut bench = Bench::armed();
        bench.limits.timing.ring_time = Nanos((ring_cycles * T.0 as f64) as u64);
        bench.request.amplitude = PeakToPeak::from_metres(1e-6);
        bench.cycle(|_| {}, Controls::default());
        let (cause, cycles) = bench.until_off(|s| amplifier(s).amplitude.as_mut().unwrap().value = 2e-6);
        let down: f64 = ring_cycles * f64::ln(1.3 * 2e-6 / (2e-6 - 0.3e-6));
        assert_eq!((cause, cycles), (TripCause::AmplitudeRunaway, 11 + down.ceil() as u32), "{ring_cycles}");
    }
}

/// A stage that stays at its earlier speed after a slower command: its speed may fade in 300 ms.
#[test]
fn a_stage_may_slow_down_with_its_response_time_and_no_slower() {
    let mut bench = Bench::armed();
    bench.request.velocity_m_s = 0.25;
    for _ in 0..400 {
        bench.cycle(|_| {}, Controls::default());
    }
    bench.request.velocity_m_s = 0.02;
    bench.cycle(|s| stage(s).velocity_m_s = 0.25, Controls::default());
    let (cause, cycles) = bench.until_off(|s| stage(s).velocity_m_s = 0.25);
    let fade: f64 = 300.0 * (1.5 * 0.25 / (0.25 - 0.02_f64)).ln();
    assert_eq!(
        (cause, cycles),
        (TripCause::StageNotFollowing, fade.ceil() as u32 + 1),
        "two states in a row"
    );
    // Exactly half as fast again and 20 mm/s is let through; a state that is not new is not judged again.
    let mut bench = Bench::armed();
    for _ in 0..100 {
        let decision = bench.cycle(|s| stage(s).velocity_m_s = -(1.5 * 0.02 + 0.02), Controls::default());
        assert_eq!(decision.tripped, None);
    }
    let mut bench = Bench::armed();
    let held = bench.n + 1;
    for _ in 0..400 {
        let again = |s: &mut Observation| (stage(s).velocity_m_s, stage(s).sequence) = (0.3, held);
        assert_eq!(bench.cycle(again, Controls::default()).tripped, None);
    }
}

/// Speeds from creeping on are commanded; the slowest since the start counts.
#[test]
fn a_stage_owes_a_fifth_of_the_slowest_commanded_speed() {
    let mut bench = Bench::armed();
    bench.request.velocity_m_s = -1.5e-3;
    let (cause, cycles) = bench.until_off(|s| stage(s).velocity_m_s = 0.0);
    assert_eq!((cause, cycles), (TripCause::StageNotFollowing, 311));
    // 100 mm/s is commanded, then 10: a fifth of the slower one will do; a faster one restarts no time.
    let mut bench = Bench::armed();
    for velocity in [0.1, 0.01, 0.1] {
        bench.request.velocity_m_s = velocity;
        for _ in 0..200 {
            let decision = bench.cycle(|s| stage(s).velocity_m_s = 0.0021, Controls::default());
            assert_eq!(decision.tripped, None);
        }
    }
    assert_eq!(bench.until_off(|s| stage(s).velocity_m_s = 0.0019).1, 1);
    // A commanded standstill in between restarts its time.
    let mut bench = Bench::armed();
    bench.request.velocity_m_s = 0.0;
    for _ in 0..400 {
        assert_eq!(bench.cycle(|s| stage(s).velocity_m_s = 0.0, Controls::default()).tripped, None);
    }
    bench.request.velocity_m_s = 0.02;
    assert_eq!(bench.until_off(|s| stage(s).velocity_m_s = 0.0), (TripCause::StageNotFollowing, 311));
}

/// What a trip of this rule reports, and the fifth itself, which will do.
#[test]
fn a_stage_that_does_not_follow_is_reported_with_its_bound() {
    let trip = |share: f64| {
        let mut bench = Bench::armed();
        (0..400).find_map(|_| {
            let spoil = |s: &mut Observation| stage(s).velocity_m_s = share * 0.02;
            bench.cycle(spoil, Controls::default()).tripped.map(|t| (t.cause, t.value, t.bound))
        })
    };
    assert_eq!(trip(0.2), None);
    assert_eq!(trip(0.1), Some((TripCause::StageNotFollowing, 0.1 * 0.02, 0.2 * 0.02)));
    assert_eq!(trip(10.0), Some((TripCause::StageNotFollowing, 10.0 * 0.02, 1.5 * 0.02 + 0.02)));
}

/// Off, and still on after its age and ten cycles: cut.
#[test]
fn the_supply_is_cut_to_the_cycle() {
    let mut bench = Bench::armed();
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    let cut = (1..100).find(|_| is_cut(&bench.cycle(|s| amplifier(s).output_on = true, Controls::default())));
    assert_eq!(cut, Some(9 + 10 + 1));
    // Following its commands, on or off, is not a reason.
    let mut bench = Bench::armed();
    for _ in 0..100 {
        assert!(!is_cut(&bench.cycle(|_| {}, Controls::default())));
    }
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    for _ in 0..100 {
        assert!(!is_cut(&bench.cycle(|_| {}, Controls::default())));
    }
    // Silent, it counts as it last was.
    let mut bench = Bench::armed();
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    bench.cycle(|s| amplifier(s).output_on = true, Controls::default());
    let lost = |s: &mut Observation| s.amplifier = Err(NoData::Disconnected);
    assert_eq!((2..100).find(|_| is_cut(&bench.cycle(lost, Controls::default()))), Some(20));
}

/// A row of equal raw values is counted from its second.
#[test]
fn a_frozen_channel_is_known_by_its_fiftieth_repeat() {
    let mut bench = Bench::armed();
    assert_eq!(bench.until_off(|s| lateral(s).raw = 77), (TripCause::LateralFrozen, 51));
    let mut bench = Bench::armed();
    for i in 0..300 {
        let thaws = i % 50 == 49;
        let decision = bench.cycle(|s| normal(s).raw = if thaws { 78 } else { 77 }, Controls::default());
        assert_eq!(decision.tripped, None);
    }
}

/// Five spikes in fifty cycles trip; in fifty-one they do not.
#[test]
fn spikes_are_counted_over_fifty_cycles() {
    for (last, trips) in [(49, true), (50, false)] {
        let mut bench = Bench::armed();
        let tripped = (0..60).find_map(|i| {
            let spike = [0, 10, 20, 30, last].contains(&i);
            let decision =
                bench.cycle(|s| normal(s).value += if spike { 1.0 } else { 0.0 }, Controls::default());
            assert_eq!(decision.normal_usable, !spike);
            decision.tripped.map(|t| (t.cause, t.value, i))
        });
        assert_eq!(tripped, trips.then_some((TripCause::Noisy, 5.0, last)));
    }
}

/// Invalid samples, spikes and repeats in a row.
#[test]
fn a_row_of_samples_that_cannot_be_believed_is_three_long() {
    let mut last = healthy(1, &DriveCommand::off(0, T)).forces.lateral;
    let mut play = |bench: &mut Bench, script: &str| {
        script.chars().position(|what| {
            let play = |s: &mut Observation| {
                match what {
                    'x' => s.forces.lateral = Err(NoData::Invalid),
                    's' => lateral(s).value += 1.0,
                    'r' => s.forces.lateral = last,
                    'f' => lateral(s).quality = Quality::Saturated,
                    _ => {}
                }
                if what != 'x' {
                    last = s.forces.lateral;
                }
            };
            bench
                .cycle(play, Controls::default())
                .tripped
                .is_some_and(|t| t.cause == TripCause::LateralInvalid)
        })
    };
    // Each script on its own bench; the place of the trip.
    for (script, at) in [
        ("xx.xx.xxx", Some(8)),
        ("xxrxx.", None),
        ("srxx", Some(3)),
        ("srx.", None),
        ("sxx", Some(2)),
        ("xxs", Some(2)),
        ("xxfxx.", None),
    ] {
        let mut bench = Bench::armed();
        assert_eq!(play(&mut bench, script), at, "{script}");
    }
}

/// A sample that still stands is usable while it is fresh, unless it waits to be confirmed.
#[test]
fn a_repeated_sample_is_used_as_long_as_it_is_fresh() {
    let mut bench = Bench::armed();
    let last = healthy(bench.n, &bench.last).forces.normal;
    let age = limits().timing.normal.age_limit().0 / T.0;
    for i in 1..=age {
        let decision = bench.cycle(|s| s.forces.normal = last, Controls::default());
        assert!(decision.normal_usable && decision.tripped.is_none(), "{i}");
    }
    let decision = bench.cycle(|s| s.forces.normal = last, Controls::default());
    assert_eq!(
        (decision.normal_usable, decision.tripped.map(|t| t.cause)),
        (false, Some(TripCause::NormalStale))
    );
    let mut bench = Bench::armed();
    let mut spike = healthy(bench.n, &bench.last).forces.normal;
    bench.cycle(
        |s| {
            normal(s).value += 1.0;
            spike = s.forces.normal;
        },
        Controls::default(),
    );
    assert!(!bench.cycle(|s| s.forces.normal = spike, Controls::default()).normal_usable);
    // A new sample with the stamp of the one before is not overtaken.
    let mut bench = Bench::armed();
    let stamp = Nanos(now(&bench));
    assert!(bench.cycle(|s| normal(s).taken_at = stamp, Controls::default()).normal_usable);
    assert!(!bench.cycle(|s| normal(s).taken_at = Nanos(stamp.0 - 1), Controls::default()).normal_usable);
}

/// A stamp ahead of the loop's time by no more than an age is taken; beyond, it is none.
#[test]
fn a_stamp_may_be_ahead_by_its_age_limit() {
    let l = limits().timing;
    let force = l.normal.age_limit().0;
    assert!(Bench::armed().cycle(|s| normal(s).taken_at.0 += force, Controls::default()).normal_usable);
    assert!(!Bench::armed().cycle(|s| normal(s).taken_at.0 += force + 1, Controls::default()).normal_usable);
    for (more, trips) in [(0, false), (1, true)] {
        let mut bench = Bench::armed();
        let decision =
            bench.cycle(|s| amplifier(s).taken_at.0 += l.amplifier.age_limit().0 + more, Controls::default());
        assert_eq!(decision.tripped.map(|t| t.cause), trips.then_some(TripCause::AmplifierStale));
        let mut bench = Bench::armed();
        let decision =
            bench.cycle(|s| stage(s).taken_at.0 += l.stage.age_limit().0 + more, Controls::default());
        assert_eq!(decision.tripped.map(|t| t.cause), trips.then_some(TripCause::StageStale));
    }
}

/// Counters do not stop at their end.
#[test]
fn the_sequence_wraps() {
    let mut safety = Safety { sequence: u32::MAX, ..Safety::default() };
    let seen = healthy(1, &DriveCommand::off(0, T));
    let decision = safety.step(&limits(), &seen, &Request::default(), Controls::default(), T);
    assert_eq!((decision.drive.sequence(), decision.stage.sequence()), (0, 0));
}

#[test]
fn a_stage_is_given_its_time_and_a_fifth_of_its_speed() {
    // 300 ms to respond and nine for the state's age, then it must move: forwards, and not at less than a fifth.
    let after = |share: f64, velocity: f64| {
        let mut bench = Bench::armed();
        bench.request.velocity_m_s = velocity;
        let (cause, cycles) = bench.until_off(|s| stage(s).velocity_m_s = share * velocity);
        assert_eq!(cause, TripCause::StageNotFollowing);
        cycles
    };
    // `armed` has commanded this speed for sixty cycles already; a new direction restarts the time.
    assert_eq!((after(0.19, 0.02), after(0.19, -0.02)), (251, 311));
    assert_eq!(after(-1.0, -0.02), after(0.0, -0.02), "the wrong way is not following");
    let mut bench = Bench::armed();
    for _ in 0..800 {
        let decision = bench.cycle(|s| stage(s).velocity_m_s = 0.2001 * 0.02, Controls::default());
        assert_eq!(decision.tripped, None, "a fifth will do");
    }
    // Below the creeping speed the rule does not apply.
    let mut bench = Bench::armed();
    bench.request.velocity_m_s = 1.4e-3;
    for _ in 0..800 {
        assert_eq!(bench.cycle(|s| stage(s).velocity_m_s = 0.0, Controls::default()).tripped, None);
    }
    // Half as fast again and 20 mm/s is the limit.
    let mut bench = Bench::armed();
    for _ in 0..100 {
        let decision = bench.cycle(|s| stage(s).velocity_m_s = 0.0499, Controls::default());
        assert_eq!(decision.tripped, None);
    }
    assert_eq!(bench.until_off(|s| stage(s).velocity_m_s = 0.0501), (TripCause::StageNotFollowing, 2));
}

#[test]
fn one_late_cycle_in_a_hundred_is_too_many() {
    let mut bench = Bench::armed();
    let mut i = 0;
    let (cause, cycles) = bench.until_off(|s| {
        i += 1;
        s.lateness = Nanos(if i % 50 == 0 { 2 * T.0 - 1 } else { T.0 });
    });
    assert_eq!((cause, cycles), (TripCause::Overrun, 550), "the eleventh of a thousand");
    let mut bench = Bench::armed();
    for i in 0..3000 {
        let lateness = Nanos(if i % 101 == 0 { 2 * T.0 - 1 } else { 0 });
        let decision = bench.cycle(|s| s.lateness = lateness, Controls::default());
        assert_eq!(decision.tripped, None, "one in a hundred and one");
    }
}
