//! Readings of a force on a faulty line.

use super::*;
use crate::ports::Channel;

/// What the loop is shown of both axes in so many cycles, from a sensor with a new sample in each.
fn shown(faults: &[Fault], seed: u64, cycles: u64) -> Vec<Forces> {
    let sensor = Port {
        state: |now: Nanos| {
            let sample = nth(now.0 / T);
            Forces { lateral: Ok(sample), normal: Ok(Sample { value: 1000.0 + sample.value, ..sample }) }
        },
        command: (),
    };
    let mut faulty = FaultyForce::new(sensor, faults, seed);
    (0..cycles).map(|cycle| faulty.read(at(cycle))).collect()
}

/// The lateral axis alone.
fn lateral(mode: FaultMode, strength: f64, cycles: u64) -> Vec<Channel> {
    let shown = shown(&[fault(FaultTarget::Lateral, mode, strength)], 1, cycles);
    shown.into_iter().map(|forces| forces.lateral).collect()
}

/// Holds every cycle against what a fault should make of it; outside of its time it makes nothing of it.
#[track_caller]
fn is(mode: FaultMode, strength: f64, during: impl Fn(u64) -> Channel) {
    for (cycle, channel) in (0..).zip(lateral(mode, strength, 30)) {
        let expected = if ACTS.contains(&cycle) { during(cycle) } else { Ok(nth(cycle)) };
        assert_eq!(channel, expected, "{mode:?} in cycle {cycle}");
    }
}

#[test]
fn a_fault_acts_from_its_begin_to_just_before_its_end() {
    is(FaultMode::Ok, 0.0, |cycle| Ok(nth(cycle)));
    is(FaultMode::Invalid, 0.0, |_| Err(NoData::Invalid));
    is(FaultMode::Corrupt, 0.0, |_| Err(NoData::Corrupt));
    is(FaultMode::Disconnected, 0.0, |_| Err(NoData::Disconnected));
    let acts = |now| fault(FaultTarget::Force, FaultMode::Off, 0.0).acts(Nanos(now));
    assert_eq!([10 * T - 1, 10 * T, 20 * T - 1, 20 * T].map(acts), [false, true, true, false]);
}

#[test]
fn a_fault_is_on_its_channel_alone() {
    let sound = shown(&[], 1, 30);
    let hit = |target| {
        let shown = shown(&[fault(target, FaultMode::Invalid, 0.0)], 1, 30);
        let differ = |axis: fn(&Forces) -> Channel| shown.iter().zip(&sound).any(|(a, b)| axis(a) != axis(b));
        (differ(|forces| forces.lateral), differ(|forces| forces.normal))
    };
    assert_eq!(hit(FaultTarget::Lateral), (true, false));
    assert_eq!(hit(FaultTarget::Normal), (false, true));
    assert_eq!(hit(FaultTarget::Force), (true, true));
    for other in [FaultTarget::Amplifier, FaultTarget::Drive, FaultTarget::Stage] {
        assert_eq!(hit(other), (false, false), "{other:?}");
    }
}

#[test]
fn several_faults_act_together() {
    let wrong = fault(FaultTarget::Lateral, FaultMode::Wrong, 2.0);
    for cycle in ACTS {
        let shown = shown(&[wrong; FAULTS], 1, 30)[cycle as usize].lateral.unwrap();
        assert_eq!(shown.value, nth(cycle).value * 16.0);
    }
}

#[test]
fn off_is_silence() {
    is(FaultMode::Off, 0.0, |_| Ok(nth(9)));
    let never = shown(&[always(FaultTarget::Force, FaultMode::Off, 0.0)], 1, 3);
    assert_eq!(never, [Forces::missing(NoData::NeverRead); 3], "silent from the beginning");
}

#[test]
fn stuck_stands_still_while_counters_and_clocks_go_on() {
    let held = |cycle, since| Ok(Sample { value: nth(since).value, raw: nth(since).raw, ..nth(cycle) });
    is(FaultMode::Stuck, 0.0, |cycle| held(cycle, 10));
    // A second time it stands where it is then, not where it stood before.
    let first = fault(FaultTarget::Lateral, FaultMode::Stuck, 0.0);
    let again = Fault { from: at(30), until: at(40), ..first };
    let shown = shown(&[first, again], 1, 40);
    assert!((30..40).all(|cycle| shown[cycle as usize].lateral == held(cycle, 30)));
}

/// A line that is down has no value that could stand still.
#[test]
fn what_is_missing_stays_missing_under_a_fault() {
    for mode in FaultMode::PX4.into_iter().chain(EXTRA) {
        let sensor = Port {
            state: |now: Nanos| match now.0 / T {
                0..=4 => Forces { lateral: Ok(nth(now.0 / T)), normal: Err(NoData::NotFitted) },
                5..=7 => Forces::missing(NoData::Disconnected),
                cycle => Forces { lateral: Ok(nth(cycle)), normal: Err(NoData::NotFitted) },
            },
            command: (),
        };
        let now = Fault { from: at(5), ..always(FaultTarget::Lateral, mode, 1.0) };
        let mut faulty = FaultyForce::new(sensor, &[now], 1);
        let shown: Vec<Channel> = (0..10).map(|cycle| faulty.read(at(cycle)).lateral).collect();
        let expected = match mode {
            FaultMode::Invalid => Err(NoData::Invalid),
            FaultMode::Corrupt => Err(NoData::Corrupt),
            FaultMode::Off => Ok(nth(4)),
            // A delay of a second: nothing had come then.
            FaultMode::Delayed => Err(NoData::NeverRead),
            _ => Err(NoData::Disconnected),
        };
        assert_eq!(shown[6], expected, "{mode:?}");
        if mode == FaultMode::Stuck {
            assert_eq!([shown[8].unwrap().value, shown[9].unwrap().value], [nth(8).value; 2]);
        }
    }
}

#[test]
fn garbage_is_anything_and_keeps_count_and_time() {
    let cycles = 8000;
    let shown = shown(&[always(FaultTarget::Lateral, FaultMode::Garbage, 0.0)], 3, cycles);
    let readings: Vec<Sample> = shown.iter().map(|forces| forces.lateral.unwrap()).collect();
    for (cycle, reading) in (0..).zip(&readings) {
        assert_eq!((reading.sequence, reading.taken_at), (nth(cycle).sequence, nth(cycle).taken_at));
        assert!((-(1 << 23)..1 << 23).contains(&reading.raw), "{}", reading.raw);
    }
    let share = |is: fn(f64) -> bool| readings.iter().filter(|reading| is(reading.value)).count();
    for (name, is) in [
        ("no number", f64::is_nan as fn(f64) -> bool),
        ("infinite", |value| value == f64::INFINITY),
        ("tiny", |value| value == f64::from_bits(1)),
    ] {
        assert!(about(share(is), cycles as usize, 1.0 / 8.0), "{name}: {}", share(is));
    }
    // The rest is spread over the range, both signs alike.
    let rest: Vec<f64> =
        readings.iter().map(|r| r.value).filter(|v| v.is_finite() && *v != f64::from_bits(1)).collect();
    assert!(rest.iter().all(|value| value.abs() <= 200.0));
    for quarter in [-200.0, -100.0, 0.0, 100.0] {
        let count = rest.iter().filter(|value| (quarter..quarter + 100.0).contains(*value)).count();
        assert!(about(count, rest.len(), 0.25), "{quarter}: {count} of {}", rest.len());
    }
    let raws: std::collections::HashSet<i64> = readings.iter().map(|reading| reading.raw).collect();
    assert!(raws.len() > 7900, "{} raw values", raws.len());
}

#[test]
fn wrong_is_a_factor_on_value_and_counts() {
    let wrong = |cycle| Sample { value: -0.5 * nth(cycle).value, raw: -5 * cycle as i64, ..nth(cycle) };
    is(FaultMode::Wrong, FaultMode::Wrong.default_strength(), |cycle| Ok(wrong(cycle)));
}

#[test]
fn slow_is_one_sample_in_so_many() {
    // The sample of cycle n is the one numbered n + 1.
    is(FaultMode::Slow, 4.0, |cycle| Ok(nth(if cycle < 11 { 9 } else { cycle - (cycle + 1) % 4 })));
    is(FaultMode::Slow, 0.0, |cycle| Ok(nth(cycle)));
}

#[test]
fn delayed_is_what_had_come_so_long_before() {
    is(FaultMode::Delayed, 0.005, |cycle| Ok(nth(cycle - 5)));
    // The line is a ring: all the same when it has gone round.
    let late = always(FaultTarget::Lateral, FaultMode::Delayed, 0.1);
    for (cycle, forces) in (0..).zip(shown(&[late], 1, 1000)) {
        let expected = if cycle < 100 { Err(NoData::NeverRead) } else { Ok(nth(cycle - 100)) };
        assert_eq!(forces.lateral, expected, "cycle {cycle}");
    }
}

#[test]
fn intermittent_loses_its_share_the_same_from_the_same_seed() {
    for share in [0.1, 0.3, 0.9] {
        let lossy = always(FaultTarget::Lateral, FaultMode::Intermittent, share);
        let run = |seed| shown(&[lossy], seed, 4001);
        let mut last = 0;
        let mut lost = 0;
        for (cycle, forces) in (0..).zip(&run(5)).skip(1) {
            match forces.lateral {
                Ok(new) if new == nth(cycle) => last = cycle,
                Ok(old) => {
                    lost += 1;
                    assert!(old == nth(last), "what was shown last stays: {old:?}");
                }
                Err(none) => assert_eq!((none, last), (NoData::NeverRead, 0)),
            }
        }
        let lost_early = run(5).iter().skip(1).filter(|forces| forces.lateral.is_err()).count();
        assert!(about(lost + lost_early, 4000, share), "{lost} of 4000 at {share}");
        assert_eq!(run(5), run(5));
        assert_ne!(run(5), run(6));
    }
}

#[test]
fn a_spike_is_one_sample_a_hundred_times_too_large() {
    let spike = |cycle| Sample { value: 100.0 * nth(cycle).value, raw: 1000 * cycle as i64, ..nth(cycle) };
    let once = FaultMode::Spikes.default_strength();
    is(FaultMode::Spikes, once, |cycle| Ok(if cycle == 10 { spike(10) } else { nth(cycle) }));
    // One in three, from the first on: samples 12, 15 and 18 are those of cycles 11, 14 and 17.
    let spiked = [10, 11, 14, 17];
    is(FaultMode::Spikes, 3.0, |cycle| Ok(if spiked.contains(&cycle) { spike(cycle) } else { nth(cycle) }));
    is(FaultMode::Spikes, 0.0, |cycle| Ok(spike(cycle)));
}

#[test]
fn saturated_says_so() {
    let end = |cycle| Sample { quality: Quality::Saturated, raw: i64::from(i32::MAX), ..nth(cycle) };
    is(FaultMode::Saturated, 0.0, |cycle| Ok(end(cycle)));
}

#[test]
fn disordered_is_every_other_sample_three_old_with_its_old_stamp() {
    is(FaultMode::Disordered, 0.0, |cycle| Ok(nth(if cycle % 2 == 0 { cycle - 3 } else { cycle })));
    // Round the ring as well; of the first samples there is none that is three old.
    let mixed = always(FaultTarget::Lateral, FaultMode::Disordered, 0.0);
    for (cycle, forces) in (0..).zip(shown(&[mixed], 1, 600)) {
        let expected = match cycle {
            0 | 2 => Err(NoData::NeverRead),
            _ => Ok(nth(if cycle % 2 == 0 { cycle - 3 } else { cycle })),
        };
        assert_eq!(forces.lateral, expected, "cycle {cycle}");
    }
}

#[test]
fn a_clock_that_jumps_moves_the_stamp_alone() {
    let jumped =
        |cycle: u64, by: i64| Sample { taken_at: Nanos(at(cycle).0.saturating_add_signed(by)), ..nth(cycle) };
    is(FaultMode::ClockJump, 0.5, |cycle| Ok(jumped(cycle, 500_000_000)));
    is(FaultMode::ClockJump, -0.002, |cycle| Ok(jumped(cycle, -2_000_000)));
    is(FaultMode::ClockJump, -1.0, |cycle| Ok(Sample { taken_at: Nanos(0), ..nth(cycle) }));
}

/// A sensor that samples slower than the loop turns is read many times over: what the line lost does not come after all.
#[test]
fn a_lost_sample_stays_lost_until_the_next() {
    const TURNS: u64 = 5;
    let run = |mode, strength| {
        let sensor = Port {
            state: |now: Nanos| Forces {
                lateral: Ok(nth(now.0 / T / TURNS)),
                normal: Err(NoData::NotFitted),
            },
            command: (),
        };
        let mut faulty = FaultyForce::new(sensor, &[always(FaultTarget::Lateral, mode, strength)], 2);
        (0..400).map(move |cycle| faulty.read(at(cycle)).lateral).collect::<Vec<Channel>>()
    };
    for (mode, strength) in [
        (FaultMode::Slow, 4.0),
        (FaultMode::Intermittent, 0.3),
        (FaultMode::Spikes, 3.0),
        (FaultMode::Disordered, 0.0),
    ] {
        let shown = run(mode, strength);
        for sample in shown.chunks(TURNS as usize) {
            assert!(sample.iter().all(|turn| *turn == sample[0]), "{mode:?}: {sample:?}");
        }
        let distinct =
            shown.iter().step_by(TURNS as usize).zip(0..).filter(|(s, n)| **s == Ok(nth(*n))).count();
        assert!((1..80).contains(&distinct), "{mode:?} lets {distinct} of 80 through unchanged");
    }
}

/// What is not decided sample by sample goes on between samples: a delayed one comes when its time has come.
#[test]
fn a_delay_goes_on_between_samples() {
    let sensor = Port {
        state: |now: Nanos| Forces { lateral: Ok(nth(now.0 / T / 5)), normal: Err(NoData::NotFitted) },
        command: (),
    };
    let mut faulty = FaultyForce::new(sensor, &[always(FaultTarget::Lateral, FaultMode::Delayed, 0.003)], 2);
    for cycle in 0..100 {
        let shown = faulty.read(at(cycle)).lateral;
        assert_eq!(
            shown,
            if cycle < 3 { Err(NoData::NeverRead) } else { Ok(nth((cycle - 3) / 5)) },
            "cycle {cycle}"
        );
    }
}
