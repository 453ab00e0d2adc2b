//! States of the amplifier and of the stage on a faulty line.

use super::*;
use models::PeakToPeak;

/// The amplifier's state of a cycle: everything in it is of that cycle.
fn amplifier(cycle: u64) -> AmplifierState {
    AmplifierState {
        amplitude: Ok(Sample { value: 1e-6 * cycle as f64, ..nth(cycle) }),
        echoed_amplitude: PeakToPeak::from_metres(1.1e-6 * cycle as f64),
        echoed_frequency_hz: 27_000.0 + cycle as f64,
        output_on: cycle % 3 == 1,
        watchdog_tripped: false,
        fault: false,
        temperature_c: Ok(Sample { value: 25.0 + cycle as f64, ..nth(cycle) }),
        taken_at: at(cycle),
        sequence: cycle as u32,
    }
}

fn stage(cycle: u64) -> StageState {
    StageState {
        position_m: 1e-3 * cycle as f64,
        velocity_m_s: 1e-2 * cycle as f64,
        at_limit: false,
        fault: false,
        taken_at: at(cycle),
        sequence: cycle as u32,
    }
}

/// What the loop is shown of an amplifier with a fault.
fn amplifiers(fault: Fault, cycles: u64) -> Vec<Result<AmplifierState, NoData>> {
    let port = Port { state: |now: Nanos| Ok(amplifier(now.0 / T)), command: |_: DriveCommand, _: Nanos| {} };
    let mut faulty = FaultyAmplifier::new(port, &[fault], 1);
    (0..cycles).map(|cycle| faulty.state(at(cycle))).collect()
}

fn stages(fault: Fault, cycles: u64) -> Vec<Result<StageState, NoData>> {
    let port = Port { state: |now: Nanos| Ok(stage(now.0 / T)), command: |_: StageCommand, _: Nanos| {} };
    let mut faulty = FaultyStage::new(port, &[fault], 1);
    (0..cycles).map(|cycle| faulty.state(at(cycle))).collect()
}

#[track_caller]
fn amplifier_is(mode: FaultMode, strength: f64, during: impl Fn(u64) -> AmplifierState) {
    for (cycle, state) in (0..).zip(amplifiers(fault(FaultTarget::Amplifier, mode, strength), 30)) {
        let expected = if ACTS.contains(&cycle) { during(cycle) } else { amplifier(cycle) };
        assert_eq!(state, Ok(expected), "{mode:?} in cycle {cycle}");
    }
    // Faults of other channels, the way of the commands included, leave the states alone.
    for other in [FaultTarget::Force, FaultTarget::Drive, FaultTarget::Stage] {
        assert_eq!(amplifiers(fault(other, mode, strength), 30)[15], Ok(amplifier(15)));
    }
}

#[track_caller]
fn stage_is(mode: FaultMode, strength: f64, during: impl Fn(u64) -> StageState) {
    for (cycle, state) in (0..).zip(stages(fault(FaultTarget::Stage, mode, strength), 30)) {
        let expected = if ACTS.contains(&cycle) { during(cycle) } else { stage(cycle) };
        assert_eq!(state, Ok(expected), "{mode:?} in cycle {cycle}");
    }
    for other in [FaultTarget::Force, FaultTarget::Drive, FaultTarget::Amplifier] {
        assert_eq!(stages(fault(other, mode, strength), 30)[15], Ok(stage(15)));
    }
}

#[test]
fn stuck_states_show_what_was_and_count_on() {
    amplifier_is(FaultMode::Stuck, 0.0, |cycle| {
        let (now, held) = (amplifier(cycle), amplifier(10));
        let read = held.amplitude.unwrap();
        let amplitude = Ok(Sample { value: read.value, raw: read.raw, ..now.amplitude.unwrap() });
        let (taken_at, sequence, temperature_c) = (now.taken_at, now.sequence, now.temperature_c);
        AmplifierState { amplitude, taken_at, sequence, temperature_c, ..held }
    });
    stage_is(FaultMode::Stuck, 0.0, |cycle| {
        let (now, held) = (stage(cycle), stage(10));
        StageState { position_m: held.position_m, velocity_m_s: held.velocity_m_s, ..now }
    });
}

#[test]
fn wrong_states_are_out_by_a_factor() {
    amplifier_is(FaultMode::Wrong, -2.0, |cycle| {
        let now = amplifier(cycle);
        let read = now.amplitude.unwrap();
        AmplifierState {
            amplitude: Ok(Sample { value: -2.0 * read.value, raw: -2 * read.raw, ..read }),
            ..now
        }
    });
    stage_is(FaultMode::Wrong, -2.0, |cycle| {
        let now = stage(cycle);
        StageState { velocity_m_s: -2.0 * now.velocity_m_s, ..now }
    });
}

#[test]
fn saturated_states_are_at_the_end_of_the_range() {
    amplifier_is(FaultMode::Saturated, 0.0, |cycle| {
        let now = amplifier(cycle);
        let (quality, raw) = (Quality::Saturated, i64::from(i32::MAX));
        AmplifierState { amplitude: Ok(Sample { quality, raw, ..now.amplitude.unwrap() }), ..now }
    });
    stage_is(FaultMode::Saturated, 0.0, |cycle| StageState { at_limit: true, ..stage(cycle) });
}

#[test]
fn a_jump_of_the_clock_moves_the_stamps_of_states() {
    amplifier_is(FaultMode::ClockJump, 0.25, |cycle| AmplifierState {
        taken_at: at(cycle + 250),
        ..amplifier(cycle)
    });
    stage_is(FaultMode::ClockJump, 0.25, |cycle| StageState { taken_at: at(cycle + 250), ..stage(cycle) });
}

#[test]
fn delayed_and_slow_states_are_earlier_ones() {
    amplifier_is(FaultMode::Delayed, 0.003, |cycle| amplifier(cycle - 3));
    stage_is(FaultMode::Delayed, 0.003, |cycle| stage(cycle - 3));
    let slow = |cycle: u64| if cycle < 11 { 9 } else { cycle - (cycle + 1) % 4 };
    amplifier_is(FaultMode::Slow, 4.0, |cycle| amplifier(slow(cycle)));
    stage_is(FaultMode::Slow, 4.0, |cycle| stage(slow(cycle)));
}

/// Numbers that are spread over a range, and some that are none.
#[track_caller]
fn is_garbage(name: &str, values: impl Iterator<Item = f64>, range: f64) {
    let values: Vec<f64> = values.collect();
    let none = values.iter().filter(|value| !value.is_finite()).count();
    assert!(about(none, values.len(), 0.25), "{name}: {none} of {}", values.len());
    let finite: Vec<f64> = values.into_iter().filter(|value| value.is_finite()).collect();
    assert!(finite.iter().all(|value| value.abs() <= range), "{name} leaves {range}");
    for end in [-range, range] {
        assert!(
            finite.iter().any(|value| (value - end).abs() < 0.05 * range),
            "{name} never comes near {end}"
        );
    }
}

#[test]
fn garbage_spoils_every_number_of_a_state() {
    const CYCLES: u64 = 4000;
    let amplifiers = amplifiers(always(FaultTarget::Amplifier, FaultMode::Garbage, 0.0), CYCLES);
    let all = || amplifiers.iter().map(|state| state.as_ref().unwrap());
    is_garbage("amplitude", all().map(|state| state.amplitude.unwrap().value), 200e-6);
    is_garbage("frequency", all().map(|state| state.echoed_frequency_hz), 200e3);
    is_garbage("temperature", all().map(|state| state.temperature_c.unwrap().value), 200.0);
    assert!(about(all().filter(|state| state.output_on).count(), CYCLES as usize, 0.5));
    assert!(
        all().zip(0..).all(|(state, cycle)| (state.sequence, state.taken_at) == (cycle as u32, at(cycle)))
    );

    let stages = stages(always(FaultTarget::Stage, FaultMode::Garbage, 0.0), CYCLES);
    let all = || stages.iter().map(|state| state.as_ref().unwrap());
    is_garbage("position", all().map(|state| state.position_m), 2.0);
    is_garbage("velocity", all().map(|state| state.velocity_m_s), 2.0);
    assert!(about(all().filter(|state| state.at_limit).count(), CYCLES as usize, 0.5));
    assert!(
        all().zip(0..).all(|(state, cycle)| (state.sequence, state.taken_at) == (cycle as u32, at(cycle)))
    );
}
