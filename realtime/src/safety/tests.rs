//! The state machine by itself. Faults over whole runs are in the workspace's `tests/faults.rs`.
#![allow(clippy::disallowed_types)]

use super::*;
use crate::ports::{Quality, SafetyContact, Sample};
use proptest::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering};

mod arming;
mod bounds;
mod human;
mod times;
mod trip_text;

const T: Nanos = Nanos(1_000_000);

fn limits() -> Limits {
    Limits::paper(T).checked().unwrap()
}

fn reading(value: f64, sequence: u32, taken_at: Nanos) -> Sample {
    let raw = (value * 1e4).round() as i64 * 7 + i64::from(sequence % 5);
    Sample { value, raw, taken_at, sequence, quality: Quality::Good }
}

/// A healthy rig in cycle `n`, driven as commanded.
fn healthy(n: u32, drive: &DriveCommand) -> Observation {
    let now = Nanos(u64::from(n) * T.0);
    let amplifier = AmplifierState {
        amplitude: Ok(reading(drive.amplitude().metres(), n, now)),
        echoed_amplitude: drive.amplitude(),
        echoed_frequency_hz: drive.frequency_hz(),
        output_on: drive.enable(),
        watchdog_tripped: false,
        fault: false,
        temperature_c: Ok(reading(25.0, n, now)),
        taken_at: now,
        sequence: n,
    };
    let stage = StageState {
        position_m: 0.0,
        velocity_m_s: 0.0,
        at_limit: false,
        fault: false,
        taken_at: now,
        sequence: n,
    };
    Observation {
        forces: Forces { lateral: Ok(reading(0.1, n, now)), normal: Ok(reading(0.25, n, now)) },
        amplifier: Ok(amplifier),
        stage: Ok(stage),
        lateness: Nanos(0),
        supply: Err(NoData::NotFitted),
        contacts: Contacts::ABSENT,
    }
}

struct Bench {
    safety: Safety,
    limits: Limits,
    request: Request,
    n: u32,
    last: DriveCommand,
    velocity_m_s: f64,
    /// The request that was sent last: one that differs is a new one.
    sent: Option<Request>,
}

impl Bench {
    fn new() -> Self {
        Bench {
            safety: Safety::default(),
            limits: limits(),
            request: Request::default(),
            n: 0,
            last: DriveCommand::off(0, T),
            velocity_m_s: 0.0,
            sent: None,
        }
    }

    fn armed() -> Self {
        let mut bench = Bench::new();
        bench.cycle(|_| {}, Controls::default());
        let decision = bench.cycle(|_| {}, Controls { reset: true, ..Controls::default() });
        assert!(decision.armed_now, "{:?}", decision.blocking);
        bench.request = Request {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            velocity_m_s: 0.02,
            normal_force_n: 0.25,
        };
        for _ in 0..60 {
            bench.cycle(|_| {}, Controls::default());
        }
        assert!(bench.last.enable());
        bench
    }

    /// What a healthy amplifier says now.
    fn last_state(&self) -> AmplifierState {
        healthy(self.n, &self.last).amplifier.unwrap()
    }

    fn cycle(&mut self, spoil: impl FnOnce(&mut Observation), controls: Controls) -> SafetyDecision {
        self.n += 1;
        let mut seen = healthy(self.n, &self.last);
        stage(&mut seen).velocity_m_s = self.velocity_m_s;
        spoil(&mut seen);
        let now = Nanos(u64::from(self.n) * T.0);
        let new_request = controls.new_request || self.sent != Some(self.request);
        self.sent = Some(self.request);
        let controls = Controls { new_request, ..controls };
        let decision = self.safety.step(&self.limits, &seen, &self.request, controls, now);
        self.last = decision.drive;
        self.velocity_m_s = decision.stage.velocity_m_s();
        decision
    }

    /// Spoils every cycle from now on; the cause and the number of cycles until the drive is off.
    fn until_off(&mut self, mut spoil: impl FnMut(&mut Observation)) -> (TripCause, u32) {
        for cycles in 1..2000 {
            let decision = self.cycle(&mut spoil, Controls::default());
            if let Some(trip) = decision.tripped {
                assert!(!decision.drive.enable() && decision.drive.amplitude() == PeakToPeak::ZERO);
                return (trip.cause, cycles);
            }
        }
        panic!("no trip in 2000 cycles");
    }
}

fn is_cut(decision: &SafetyDecision) -> bool {
    decision.supply == SupplyCommand::Cut
}

fn stage(seen: &mut Observation) -> &mut StageState {
    seen.stage.as_mut().unwrap()
}

fn normal(seen: &mut Observation) -> &mut Sample {
    seen.forces.normal.as_mut().unwrap()
}

fn lateral(seen: &mut Observation) -> &mut Sample {
    seen.forces.lateral.as_mut().unwrap()
}

fn amplifier(seen: &mut Observation) -> &mut AmplifierState {
    seen.amplifier.as_mut().unwrap()
}

#[test]
fn starts_faulted_and_arms_only_on_an_edge_with_all_clear() {
    let mut safety = Safety::default();
    let limits = limits();
    let off = DriveCommand::off(0, T);
    let request =
        Request { amplitude: PeakToPeak::from_metres(1e-6), frequency_hz: 3e4, ..Request::default() };
    let reset = Controls { reset: true, ..Controls::default() };
    let mut bad = healthy(1, &off);
    bad.forces.normal = Err(NoData::NeverRead);
    let decision = safety.step(&limits, &bad, &request, reset, Nanos(T.0));
    assert!(!decision.armed_now && decision.blocking == Some(TripCause::NormalStale));
    // The cause clears while the button is held: still no edge.
    let decision = safety.step(&limits, &healthy(2, &off), &request, reset, Nanos(2 * T.0));
    assert!(!decision.armed_now && !decision.drive.enable());
    safety.step(&limits, &healthy(3, &off), &request, Controls::default(), Nanos(3 * T.0));
    let decision = safety.step(&limits, &healthy(4, &off), &request, reset, Nanos(4 * T.0));
    // Armed, and nothing driven: earlier requests count for nothing.
    assert!(decision.armed_now && !decision.drive.enable());
    let decision = safety.step(&limits, &healthy(5, &off), &request, Controls::default(), Nanos(5 * T.0));
    assert!(!decision.drive.enable());
    let requested = Controls { new_request: true, ..Controls::default() };
    let decision = safety.step(&limits, &healthy(6, &off), &request, requested, Nanos(6 * T.0));
    assert!(decision.drive.enable());
}

#[test]
fn a_trip_latches_with_cause_value_bound_and_cycle() {
    let mut bench = Bench::armed();
    let before = bench.n;
    let over = |seen: &mut Observation| {
        let (n, now) = match seen.forces.normal {
            Ok(r) => (r.sequence, r.taken_at),
            Err(_) => unreachable!(),
        };
        seen.forces.normal = Ok(reading(1.6, n, now));
    };
    let (cause, cycles) = bench.until_off(over);
    assert_eq!((cause, cycles), (TripCause::NormalOverforce, 2), "a step is confirmed by its second sample");
    let State::Faulted(trip) = bench.safety.state else { panic!("not faulted") };
    assert_eq!((trip.value, trip.bound, trip.cycle), (1.6, 1.5, u64::from(before) + 2));
    for _ in 0..100 {
        assert!(
            !bench.cycle(|_| {}, Controls::default()).drive.enable(),
            "it stays off after the cause is gone"
        );
    }
}

#[test]
fn each_fault_trips_with_its_own_cause_within_its_bound() {
    type Spoil = fn(&mut Observation);
    let lateral_age = limits().timing.lateral.age_limit().0 / T.0;
    let amplifier_age = limits().timing.amplifier.age_limit().0 / T.0;
    let frozen = u64::from(limits().frozen_after);
    let cases: &[(TripCause, u64, Spoil)] = &[
        (TripCause::LateralInvalid, 4, |s| s.forces.lateral = Err(NoData::Invalid)),
        (TripCause::NormalInvalid, 4, |s| s.forces.normal.as_mut().unwrap().value = f64::NAN),
        (TripCause::LateralSaturated, 2, |s| s.forces.lateral.as_mut().unwrap().quality = Quality::Saturated),
        (TripCause::NormalSaturated, 2, |s| s.forces.normal.as_mut().unwrap().quality = Quality::Saturated),
        (TripCause::LateralFrozen, frozen + 2, |s| s.forces.lateral.as_mut().unwrap().raw = 77),
        (TripCause::NormalFrozen, frozen + 2, |s| s.forces.normal.as_mut().unwrap().raw = 77),
        (TripCause::LateralOverforce, 2, |s| s.forces.lateral.as_mut().unwrap().value = -2.5),
        (TripCause::AmplifierFault, 1, |s| amplifier(s).fault = true),
        (TripCause::AmplifierWatchdog, 1, |s| amplifier(s).watchdog_tripped = true),
        (TripCause::OverAmplitude, 1, |s| amplifier(s).amplitude.as_mut().unwrap().value = 7e-6),
        (TripCause::AmplitudeRunaway, 2, |s| amplifier(s).amplitude.as_mut().unwrap().value = 3.5e-6),
        (TripCause::OverTemperature, 1, |s| amplifier(s).temperature_c = Err(NoData::Invalid)),
        (TripCause::DriveNoResponse, 2, |s| amplifier(s).amplitude.as_mut().unwrap().value = 0.0),
        (TripCause::EchoMismatch, 2, |s| amplifier(s).echoed_frequency_hz = 27_600.0),
        (TripCause::StageFault, 1, |s| s.stage.as_mut().unwrap().fault = true),
        (TripCause::OverTravel, 1, |s| s.stage.as_mut().unwrap().position_m = 0.061),
        (TripCause::StageStale, 1, |s| s.stage = Err(NoData::Disconnected)),
        (TripCause::Overrun, 2, |s| s.lateness = Nanos(2 * T.0)),
        (TripCause::Overrun, 1, |s| s.lateness = Nanos(3 * T.0)),
        (TripCause::AmplitudeSaturated, 2, |s| {
            amplifier(s).amplitude.as_mut().unwrap().quality = Quality::Saturated;
        }),
        (TripCause::AmplitudeFrozen, 201, |s| amplifier(s).amplitude.as_mut().unwrap().raw = 77),
        (TripCause::LoadImplausible, 2001, |s| s.forces.normal.as_mut().unwrap().value = 0.7),
        (TripCause::Suspended, 1, |s| s.lateness = Nanos(51 * T.0)),
        (TripCause::AmplifierFault, 1, |s| amplifier(s).amplitude.as_mut().unwrap().value = f64::NAN),
        (TripCause::AmplifierFault, 1, |s| amplifier(s).amplitude.as_mut().unwrap().value = -1e-6),
        (TripCause::AmplifierFault, 1, |s| amplifier(s).echoed_frequency_hz = f64::INFINITY),
        (TripCause::AmplifierFault, 1, |s| amplifier(s).echoed_amplitude = PeakToPeak::from_metres(f64::NAN)),
        (TripCause::DriveNoResponse, 2, |s| amplifier(s).amplitude = Err(NoData::Invalid)),
        (TripCause::StageFault, 1, |s| stage(s).position_m = f64::NAN),
        (TripCause::StageFault, 1, |s| stage(s).velocity_m_s = f64::NAN),
        (TripCause::StageStale, 1, |s| stage(s).taken_at.0 += 1_000_000_000),
        (TripCause::AmplifierStale, 1, |s| amplifier(s).taken_at.0 += 1_000_000_000),
        (TripCause::NormalInvalid, 4, |s| normal(s).taken_at.0 += 1_000_000_000),
        (TripCause::StageNotFollowing, 2, |s| stage(s).velocity_m_s = 0.3),
        (TripCause::StageNotFollowing, 320, |s| stage(s).velocity_m_s = 0.0),
    ];
    for (cause, bound, spoil) in cases {
        let mut bench = Bench::armed();
        let (got, cycles) = bench.until_off(spoil);
        assert_eq!(got, *cause);
        assert!(u64::from(cycles) <= *bound, "{cause:?} took {cycles} cycles, bound {bound}");
    }
    let mut bench = Bench::armed();
    let last = healthy(bench.n, &bench.last);
    let (got, cycles) = bench.until_off(|s| s.forces.lateral = last.forces.lateral);
    assert_eq!((got, u64::from(cycles)), (TripCause::LateralStale, lateral_age + 1));
    let mut bench = Bench::armed();
    let last = healthy(bench.n, &bench.last);
    let (got, cycles) = bench.until_off(|s| s.amplifier = last.amplifier);
    assert_eq!((got, u64::from(cycles)), (TripCause::AmplifierStale, amplifier_age + 1));
}

#[test]
fn a_single_spike_is_rejected_and_five_in_fifty_cycles_trip() {
    let mut bench = Bench::armed();
    let decision = bench.cycle(|s| s.forces.lateral.as_mut().unwrap().value *= 100.0, Controls::default());
    assert!(decision.tripped.is_none() && !decision.lateral_usable);
    let decision = bench.cycle(|_| {}, Controls::default());
    assert!(decision.tripped.is_none() && decision.lateral_usable);
    let mut bench = Bench::armed();
    let mut i = 0;
    let (cause, cycles) = bench.until_off(|s| {
        i += 1;
        if i % 9 == 0 {
            s.forces.lateral.as_mut().unwrap().value *= 100.0;
        }
    });
    assert_eq!(cause, TripCause::Noisy);
    assert!(cycles <= 51);
}

#[test]
fn an_amplifier_that_refuses_off_is_cut_from_its_supply() {
    let mut bench = Bench::armed();
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    let age = (limits().timing.amplifier.age_limit().0 / T.0) as u32;
    let cut = (0..100).find(|_| is_cut(&bench.cycle(|s| amplifier(s).output_on = true, Controls::default())));
    assert!(cut.is_some_and(|n| n <= age + 11), "{cut:?}");
    // As long as it stays on nothing arms the rig.
    let reset = Controls { reset: true, ..Controls::default() };
    let decision = bench.cycle(|s| amplifier(s).output_on = true, reset);
    assert!(
        !decision.armed_now && decision.blocking == Some(TripCause::RefusesOff),
        "{:?}",
        decision.blocking
    );
}

#[test]
fn a_request_beyond_a_limit_is_a_trip_not_a_smaller_request() {
    let spoil: [fn(&mut Request); 6] = [
        |r| r.amplitude = PeakToPeak::from_metres(6.1e-6),
        |r| r.amplitude = PeakToPeak::from_metres(f64::NAN),
        |r| r.frequency_hz = 9_000.0,
        |r| r.velocity_m_s = -0.3,
        |r| r.normal_force_n = -0.1,
        |r| r.normal_force_n = 1.6,
    ];
    for spoil in spoil {
        let mut bench = Bench::armed();
        spoil(&mut bench.request);
        let decision = bench.cycle(|_| {}, Controls::default());
        assert_eq!(decision.tripped.unwrap().cause, TripCause::RequestRefused);
        assert!(!decision.drive.enable());
    }
}

#[test]
fn every_rule_has_its_own_identifier_and_cause() {
    // Rules stand in the order of their urgency; identifiers are stable, and none is missing.
    let mut ids: Vec<_> = RULES.iter().map(|r| r.id).collect();
    ids.sort_unstable();
    let wanted: Vec<_> = (1..=RULES.len()).map(|i| format!("SR-{i:02}")).collect();
    assert_eq!(ids, wanted);
    for rule in RULES {
        assert!(RULES.iter().filter(|r| r.cause == rule.cause).count() == 1);
    }
}

#[test]
fn a_force_that_rises_too_fast_trips_and_a_small_spike_does_not() {
    let mut bench = Bench::armed();
    let n0 = bench.n;
    let (cause, cycles) = bench.until_off(|s| {
        let n = normal(s).sequence - n0;
        normal(s).value = 0.25 + 0.061 * f64::from(n);
    });
    assert_eq!((cause, cycles), (TripCause::ForceRate, 2));
    let mut bench = Bench::armed();
    let n0 = bench.n;
    for _ in 0..15 {
        let decision = bench.cycle(
            |s| {
                let n = normal(s).sequence - n0;
                normal(s).value = 0.25 + 0.059 * f64::from(n);
            },
            Controls::default(),
        );
        assert_eq!(decision.tripped, None, "just under the limit");
    }
    let mut bench = Bench::armed();
    for n in 0..30 {
        let decision =
            bench.cycle(|s| normal(s).value += if n % 10 == 5 { 0.2 } else { 0.0 }, Controls::default());
        assert_eq!(decision.tripped, None, "up and down again");
    }
}

#[test]
fn an_amplitude_that_rises_too_fast_trips() {
    for (rise_m, trips) in [(21e-9, true), (19e-9, false)] {
        let mut bench = Bench::armed();
        bench.limits.amplitude_rate_max_m_s = 20e-6;
        let mut w = 2e-6;
        let tripped = (0..10).find_map(|_| {
            w += rise_m;
            bench.cycle(|s| amplifier(s).amplitude.as_mut().unwrap().value = w, Controls::default()).tripped
        });
        assert_eq!(tripped.map(|t| t.cause), trips.then_some(TripCause::AmplitudeRate));
    }
}

#[test]
fn lost_samples_are_remarked_and_then_trip() {
    let mut bench = Bench::armed();
    let mut last = healthy(bench.n, &bench.last).forces;
    let mut lose = |bench: &mut Bench, one_in: u32, cycles: u32| {
        let mut remarked = None;
        for _ in 0..cycles {
            let decision = bench.cycle(
                |s| {
                    if normal(s).sequence.is_multiple_of(one_in) {
                        last = s.forces;
                    } else {
                        // The same sample again, made fresh enough not to be stale.
                        for channel in [&mut last.lateral, &mut last.normal] {
                            channel.as_mut().unwrap().taken_at = stage(s).taken_at;
                        }
                        s.forces = last;
                    }
                },
                Controls::default(),
            );
            if let Some(trip) = decision.tripped {
                return (remarked, Some(trip.cause));
            }
            remarked = remarked.or(decision.remark);
        }
        (remarked, None)
    };
    assert_eq!(lose(&mut bench, 2, 250), (Some(Remark::LateralLossy), None));
    let (_, cause) = lose(&mut bench, 5, 250);
    assert_eq!(cause, Some(TripCause::LateralLossy));
}

#[test]
fn a_normal_channel_that_loses_most_samples_trips_by_itself() {
    let mut bench = Bench::armed();
    let mut last = healthy(bench.n, &bench.last).forces.normal.unwrap();
    let (cause, cycles) = bench.until_off(|s| {
        if normal(s).sequence.is_multiple_of(5) {
            last = *normal(s);
        }
        last.taken_at = lateral(s).taken_at;
        *normal(s) = last;
    });
    assert!(cause == TripCause::NormalLossy && cycles <= 200, "{cause:?} after {cycles}");
}

#[test]
fn what_was_lost_before_arming_does_not_trip_after_it() {
    let mut bench = Bench::armed();
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    for _ in 0..250 {
        bench.cycle(|s| s.forces = Forces::missing(NoData::Disconnected), Controls::default());
    }
    let reset = Controls { reset: true, ..Controls::default() };
    assert!(bench.cycle(|_| {}, reset).armed_now);
    for _ in 0..250 {
        assert_eq!(bench.cycle(|_| {}, Controls::default()).tripped, None);
    }
}

#[test]
fn a_plate_that_sags_is_remarked() {
    let mut bench = Bench::armed();
    let half = |s: &mut Observation| amplifier(s).amplitude.as_mut().unwrap().value = 1.0e-6;
    assert_eq!(bench.cycle(half, Controls::default()).remark, Some(Remark::AmplitudeSags));
    let most = |s: &mut Observation| amplifier(s).amplitude.as_mut().unwrap().value = 1.5e-6;
    assert_eq!(bench.cycle(most, Controls::default()).remark, None);
}

#[test]
fn an_overtaken_sample_is_never_used() {
    let mut bench = Bench::armed();
    let decision = bench.cycle(|s| normal(s).taken_at.0 -= 2 * T.0, Controls::default());
    assert!(!decision.normal_usable && decision.lateral_usable);
}

#[test]
fn the_command_expires_and_counts() {
    let mut bench = Bench::armed();
    let first = bench.cycle(|_| {}, Controls::default());
    let second = bench.cycle(|_| {}, Controls::default());
    assert_eq!(second.drive.sequence(), first.drive.sequence().wrapping_add(1));
    assert_eq!(second.stage.sequence(), second.drive.sequence());
    let now = Nanos(u64::from(bench.n) * T.0);
    assert_eq!(second.drive.expires_at(), now.plus(limits().timing.command_expiry));
    assert_eq!(second.stage.expires_at(), second.drive.expires_at());
    assert_eq!((second.drive.frequency_hz(), second.stage.normal_force_n()), (27_500.0, 0.25));
}

fn any_channel() -> impl Strategy<Value = Result<Sample, NoData>> {
    let value = prop_oneof![any::<f64>(), -3.0..3.0f64];
    let quality = prop_oneof![Just(Quality::Good), Just(Quality::Degraded), Just(Quality::Saturated)];
    prop_oneof![
        (value, any::<i64>(), any::<u64>(), any::<u32>(), quality).prop_map(
            |(value, raw, at, sequence, quality)| Ok(Sample {
                value,
                raw,
                taken_at: Nanos(at),
                sequence,
                quality
            })
        ),
        Just(Err(NoData::Invalid)),
        Just(Err(NoData::NeverRead)),
    ]
}

static DRIVEN: AtomicU32 = AtomicU32::new(0);
static REQUESTED: AtomicU32 = AtomicU32::new(0);

/// A value within a limit, or one of its ends.
fn legal(low: f64, high: f64) -> impl Strategy<Value = f64> {
    prop_oneof![8 => low..high, 1 => Just(low), 1 => Just(high)]
}

proptest! {
    /// In the faulted state, without a reset, no inputs and no requests yield a drive or a motion.
    #[test]
    fn faulted_never_drives(
        seen in prop::collection::vec((any_channel(), any_channel(), any_channel(), any::<bool>(), any::<u64>()), 1..40),
        requests in prop::collection::vec((any::<f64>(), any::<f64>(), any::<f64>(), any::<f64>()), 40),
        times in prop::collection::vec(any::<u64>(), 40),
    ) {
        let mut safety = Safety::default();
        let limits = limits();
        for (i, (lateral, normal, amplitude, flag, late)) in seen.into_iter().enumerate() {
            let mut observation = healthy(i as u32, &DriveCommand::off(0, T));
            observation.forces = Forces { lateral, normal };
            observation.lateness = Nanos(late);
            if let Ok(a) = &mut observation.amplifier {
                a.amplitude = amplitude;
                a.output_on = flag;
            }
            let (w, f, u, n) = requests[i];
            let request = Request {
                amplitude: PeakToPeak::from_metres(w),
                frequency_hz: f,
                velocity_m_s: u,
                normal_force_n: n,
            };
            let controls = Controls {
                reset: false,
                stop: flag,
                dead_man: !flag,
                new_request: true,
                open_supply: flag,
                modulated: flag,
            };
            let decision = safety.step(&limits, &observation, &request, controls, Nanos(times[i]));
            prop_assert!(!decision.drive.enable());
            prop_assert_eq!(decision.drive.amplitude(), PeakToPeak::ZERO);
            prop_assert_eq!(decision.stage.velocity_m_s(), 0.0);
            prop_assert_eq!(decision.stage.normal_force_n(), 0.0);
        }
    }

    /// Whatever happens, no command exceeds the limits.
    #[test]
    fn no_command_exceeds_the_limits(
        // Nine in ten are legal, so that the rig is armed and drives for most of the time; the bounds themselves come up.
        requests in prop::collection::vec(prop_oneof![
            9 => (legal(0.0, 6e-6), legal(1e4, 1e5), legal(-0.25, 0.25), legal(0.0, 1.5)),
            1 => (0.0..2e-5f64, 0.0..2e5f64, -1.0..1.0f64, -1.0..3.0f64),
        ], 20..60),
        resets in prop::collection::vec(any::<bool>(), 60),
    ) {
        let mut safety = Safety::default();
        let limits = limits();
        let mut last = DriveCommand::off(0, T);
        let mut driven = 0;
        for (i, (w, f, u, n)) in requests.iter().copied().enumerate() {
            let request = Request {
                amplitude: PeakToPeak::from_metres(w),
                frequency_hz: f,
                velocity_m_s: u,
                normal_force_n: n,
            };
            let reset = resets[i] && !safety.is_armed();
            let controls = Controls { reset, new_request: !reset, ..Controls::default() };
            let now = Nanos(i as u64 * T.0);
            let decision = safety.step(&limits, &healthy(i as u32, &last), &request, controls, now);
            last = decision.drive;
            driven += u32::from(last.enable());
            prop_assert!(last.amplitude() <= limits.amplitude_max);
            let (low, high) = limits.frequency_hz;
            prop_assert!(!last.enable() || (low..=high).contains(&last.frequency_hz()));
            prop_assert!(decision.stage.velocity_m_s().abs() <= limits.speed_max_m_s);
            prop_assert!((0.0..=limits.normal_force_max_n).contains(&decision.stage.normal_force_n()));
        }
        DRIVEN.fetch_add(driven, Ordering::Relaxed);
        let requested = REQUESTED.fetch_add(requests.len() as u32, Ordering::Relaxed) + requests.len() as u32;
        // A quarter of the cycles drive, over all cases so far: a faulted core would pass for nothing.
        prop_assert!(requested < 2000 || DRIVEN.load(Ordering::Relaxed) > requested / 4);
    }
}

/// The last line of defence behind the rules: whatever is not inside every limit is off.
#[test]
fn a_command_beyond_any_single_limit_is_off() {
    let limits = limits();
    let command = |amplitude_m: f64, frequency_hz: f64| {
        let amplitude = PeakToPeak::from_metres(amplitude_m);
        let request = Request { amplitude, frequency_hz, ..Request::default() };
        DriveCommand::within(&limits, &request, 1, T).enable()
    };
    let most = limits.amplitude_max.metres();
    assert!(
        command(most, 27_500.0)
            && command(1e-6, limits.frequency_hz.0)
            && command(1e-6, limits.frequency_hz.1)
    );
    assert!(!command(0.0, 27_500.0) && !command(-1e-6, 27_500.0) && !command(f64::NAN, 27_500.0));
    assert!(!command(most * 1.001, 27_500.0));
    assert!(!command(1e-6, limits.frequency_hz.0 - 1.0) && !command(1e-6, limits.frequency_hz.1 + 1.0));
    // A setup's limit that is above the hard one (which `checked` would refuse) does not help either.
    let mut lax = limits;
    lax.amplitude_max = PeakToPeak::from_metres(1.0);
    let wild =
        Request { amplitude: PeakToPeak::from_metres(11e-6), frequency_hz: 27_500.0, ..Request::default() };
    assert!(!DriveCommand::within(&lax, &wild, 1, T).enable());
}

#[test]
fn armed_is_armed_and_faulted_is_not() {
    let mut bench = Bench::armed();
    assert!(bench.safety.is_armed());
    bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
    assert!(!bench.safety.is_armed() && !Safety::default().is_armed());
}

#[test]
fn ages_are_periods_and_latency() {
    let timing = ChannelTiming { period: Nanos(1_000), latency: Nanos(70), periods: 3 };
    assert_eq!(timing.age_limit(), Nanos(3_070));
    assert_eq!(limits().timing.command_expiry, Nanos(2 * T.0));
    assert_eq!(format!("{:?}", RULES[0]), "SR-35 EmergencyStop");
}
