//! Each bound from both sides: the last value that is let through, and the first that is not.

use super::*;
use crate::safety::limits::{ChannelTiming, LimitError};

/// A bench whose every sample may jump, so that a value can be set at once.
fn bench() -> Bench {
    let mut bench = Bench::armed();
    bench.limits.force_rate_max_n_s = 1e9;
    bench.limits.amplitude_rate_max_m_s = 1e9;
    bench
}

/// Spoils `cycles` cycles; the first trip.
fn trips(bench: &mut Bench, cycles: u32, mut spoil: impl FnMut(&mut Observation)) -> Option<Trip> {
    (0..cycles).find_map(|_| bench.cycle(&mut spoil, Controls::default()).tripped)
}

fn measured(seen: &mut Observation) -> &mut f64 {
    &mut amplifier(seen).amplitude.as_mut().unwrap().value
}

/// 30 % and 0.3 um above what is commanded; a fifth of it below; seven tenths for the remark.
#[test]
fn the_measured_amplitude_is_held_to_what_was_commanded() {
    let w = 2e-6;
    for (value, cause) in [
        (1.3 * w + 0.3e-6, None),
        (1.3 * w + 0.301e-6, Some(TripCause::AmplitudeRunaway)),
        (0.2 * w, None),
        (0.2 * w * (1.0 - 1e-12), Some(TripCause::DriveNoResponse)),
        (-0.3e-6, Some(TripCause::DriveNoResponse)),
        (-0.3001e-6, Some(TripCause::AmplifierFault)),
    ] {
        let trip = trips(&mut bench(), 3, |s| *measured(s) = value);
        assert_eq!(trip.map(|t| t.cause), cause, "{value}");
        if let Some(trip) = trip.filter(|t| t.cause != TripCause::AmplifierFault) {
            let bound = if value > w { 1.3 * w + 0.3e-6 } else { 0.2 * w };
            assert!((trip.value - value).abs() < 1e-15 && (trip.bound - bound).abs() < 1e-15, "{trip:?}");
        }
    }
    for (value, remark) in [(0.7 * w, None), (0.7 * w * (1.0 - 1e-12), Some(Remark::AmplitudeSags))] {
        assert_eq!(bench().cycle(|s| *measured(s) = value, Controls::default()).remark, remark);
    }
    // At rest a sensor may be as noisy as that, and no sag is reported.
    let mut rest = bench();
    rest.request.amplitude = PeakToPeak::ZERO;
    assert_eq!(trips(&mut rest, 100, |_| {}), None);
    let decision = rest.cycle(|s| *measured(s) = -0.3e-6, Controls::default());
    assert_eq!((decision.tripped, decision.remark), (None, None));
    // A plate sensor that is not fitted is missed by nobody; one that is fitted is.
    assert_eq!(trips(&mut bench(), 9, |s| amplifier(s).amplitude = Err(NoData::NotFitted)), None);
    // A saturated one is a lower bound: what it breaks is broken, and at the end of its range it is no measure.
    let saturated = |value: f64| {
        let trip = trips(&mut bench(), 9, |s| {
            *measured(s) = value;
            amplifier(s).amplitude.as_mut().unwrap().quality = Quality::Saturated;
        });
        trip.map(|t| (t.cause, t.value))
    };
    assert_eq!(saturated(50e-6), Some((TripCause::OverAmplitude, 50e-6)));
    assert_eq!(saturated(2e-6), Some((TripCause::AmplitudeSaturated, 2.0)));
}

/// The echo: 2 % and 5 nm, 1 Hz and 1e-4, either way.
#[test]
fn the_echo_is_held_to_what_was_sent() {
    for (off_m, off_hz, trip) in [
        (44.9e-9, 0.0, false),
        (-44.9e-9, 0.0, false),
        (45.1e-9, 0.0, true),
        (-45.1e-9, 0.0, true),
        (0.0, 3.74, false),
        (0.0, -3.74, false),
        (0.0, 3.76, true),
        (0.0, -3.76, true),
    ] {
        let got = trips(&mut bench(), 2, |s| {
            amplifier(s).echoed_amplitude = PeakToPeak::from_metres(2e-6 + off_m);
            amplifier(s).echoed_frequency_hz = 27_500.0 + off_hz;
        });
        assert_eq!(got.map(|t| t.cause), trip.then_some(TripCause::EchoMismatch), "{off_m} {off_hz}");
        if let Some(trip) = got {
            let (shown, commanded) =
                if off_hz == 0.0 { (2e-6 + off_m, 2e-6) } else { (27_500.0 + off_hz, 27_500.0) };
            assert_eq!((trip.value, trip.bound), (shown, commanded));
        }
    }
    // Switched off by somebody else, echoes as they were: nothing else shows it where no amplitude is measured.
    let switched = trips(&mut bench(), 60, |s| {
        amplifier(s).output_on = false;
        amplifier(s).amplitude = Err(NoData::NotFitted);
    });
    assert_eq!(switched.map(|t| (t.cause, t.unit)), Some((TripCause::EchoMismatch, Unit::Flag)));
    // Off, nothing is expected of it.
    let mut off = bench();
    off.request.amplitude = PeakToPeak::ZERO;
    trips(&mut off, 60, |_| {});
    assert_eq!(trips(&mut off, 60, |s| amplifier(s).echoed_frequency_hz = 5.0), None);
}

/// A request at a limit is granted, one beyond it is refused, and the trip names the side.
#[test]
fn requests_up_to_each_limit_are_granted() {
    type Set = fn(&mut Request, f64);
    let l = limits();
    let cases: &[(f64, f64, Set)] = &[
        (0.0, l.amplitude_max.metres(), |r, v| r.amplitude = PeakToPeak::from_metres(v)),
        (-l.speed_max_m_s, l.speed_max_m_s, |r, v| r.velocity_m_s = v),
        (0.0, l.normal_force_max_n, |r, v| r.normal_force_n = v),
        (l.frequency_hz.0, l.frequency_hz.1, |r, v| r.frequency_hz = v),
    ];
    for (low, high, set) in cases {
        let step = (high - low) * 1e-9;
        for (value, bound) in
            [(*low, None), (*high, None), (low - step, Some(*low)), (high + step, Some(*high))]
        {
            let mut bench = bench();
            set(&mut bench.request, value);
            let decision = bench.cycle(|_| {}, Controls::default());
            assert_eq!(
                decision.tripped.map(|t| (t.cause, t.bound)),
                bound.map(|b| (TripCause::RequestRefused, b))
            );
            if bound.is_none() {
                assert_eq!(decision.stage.velocity_m_s(), bench.request.velocity_m_s);
                assert_eq!(decision.drive.amplitude(), bench.request.amplitude);
            }
        }
    }
    // A setup whose limit is above the hard one does not help.
    let mut lax = bench();
    lax.limits.amplitude_max = PeakToPeak::from_metres(1.0);
    lax.request.amplitude = PeakToPeak::from_metres(10.1e-6);
    let trip = lax.cycle(|_| {}, Controls::default()).tripped.unwrap();
    assert_eq!((trip.cause, trip.bound), (TripCause::RequestRefused, HARD.amplitude_max.metres()));
    // Without vibration the frequency does not matter.
    let mut still = bench();
    still.request = Request { frequency_hz: 1.0, ..Request::default() };
    assert_eq!(trips(&mut still, 3, |_| {}), None);
}

/// The middle of a travel that is not centred decides which way is back; standing still is not a way back.
#[test]
fn the_way_back_leads_to_the_middle_of_the_travel() {
    for (position, velocity, end) in [
        (0.2, 0.02, None),
        (0.2, -0.02, Some(-0.25)),
        (0.2, 0.0, Some(-0.25)),
        (0.3, -0.02, None),
        (0.3, 0.02, Some(0.75)),
        (0.3, 0.0, Some(0.75)),
        (0.25, -0.02, None),
        (0.25, 0.02, Some(0.75)),
    ] {
        let mut bench = bench();
        bench.limits.travel_m = (-0.25, 0.75);
        bench.request.velocity_m_s = velocity;
        bench.cycle(|_| {}, Controls::default());
        let trip = trips(&mut bench, 1, |s| (stage(s).position_m, stage(s).at_limit) = (position, true));
        assert_eq!(
            trip.map(|t| (t.cause, t.bound)),
            end.map(|e| (TripCause::OverTravel, e)),
            "{position} {velocity}"
        );
    }
}

/// What the temperature rule asks, and of whom.
#[test]
fn a_temperature_is_asked_for_only_where_it_is_fitted() {
    let lost = |s: &mut Observation| amplifier(s).temperature_c = Err(NoData::NotFitted);
    let mut bench = bench();
    bench.limits.temperature_fitted = false;
    assert_eq!(trips(&mut bench, 3, lost), None);
    bench.limits.temperature_fitted = true;
    assert_eq!(
        trips(&mut bench, 1, lost).map(|t| (t.cause, t.value)),
        Some((TripCause::OverTemperature, f64::INFINITY))
    );
    let mut none = super::bounds::bench();
    let trip = trips(&mut none, 1, |s| amplifier(s).temperature_c.as_mut().unwrap().value = f64::NAN);
    assert_eq!(trip.map(|t| t.cause), Some(TripCause::OverTemperature));
}

/// A step of the force that is no spike yet, and one that is; a value too small for a normal number is none.
#[test]
fn a_sample_is_believed_up_to_the_step_limit() {
    // 0.25 and 0.5 are exact in binary.
    for (value, usable) in
        [(0.75, true), (-0.25, true), (0.7500001, false), (-0.2500001, false), (1e-310, false)]
    {
        let decision = bench().cycle(|s| normal(s).value = value, Controls::default());
        assert_eq!((decision.normal_usable, decision.lateral_usable), (usable, true), "{value}");
        let mut lateral_bench = bench();
        lateral_bench.cycle(|s| lateral(s).value = 0.25, Controls::default());
        let decision = lateral_bench.cycle(|s| lateral(s).value = value, Controls::default());
        assert_eq!((decision.lateral_usable, decision.normal_usable), (usable, true), "{value}");
    }
    // A second far-off sample confirms the first, wherever it lies.
    let mut bench = bench();
    bench.cycle(|s| lateral(s).value = 1.5, Controls::default());
    assert!(bench.cycle(|s| lateral(s).value = 0.9, Controls::default()).lateral_usable);
}

/// Force rates at the limit, one above it, and of two samples with one stamp.
#[test]
fn a_rate_is_a_difference_over_a_time() {
    let climb = |step: f64, limit: f64, held_stamp: bool| {
        let mut bench = Bench::armed();
        bench.limits.force_rate_max_n_s = limit;
        bench.limits.timing.normal.periods = 100;
        let (n0, stamp) = (bench.n, Nanos(u64::from(bench.n) * T.0));
        trips(&mut bench, 6, |s| {
            normal(s).value = 0.25 + step * f64::from(normal(s).sequence - n0);
            if held_stamp {
                normal(s).taken_at = stamp;
            }
        })
    };
    // A sixteenth of a newton in a millisecond: the limit is that very quotient.
    let limit = 0.0625 / T.seconds();
    assert_eq!(climb(0.0625, limit, false), None);
    let trip = climb(0.0625, limit * (1.0 - 1e-9), false).unwrap();
    assert_eq!((trip.cause, trip.value, trip.bound), (TripCause::ForceRate, limit, limit * (1.0 - 1e-9)));
    assert_eq!(climb(-0.0625, limit * (1.0 - 1e-9), false).map(|t| t.cause), Some(TripCause::ForceRate));
    assert_eq!(climb(0.0625, limit * 0.5, true), None, "one stamp is no time");
    // Fast, slow, fast: two in a row are needed.
    let mut bench = Bench::armed();
    let n0 = bench.n;
    let trip = trips(&mut bench, 12, |s| {
        let i = normal(s).sequence - n0;
        normal(s).value = 0.25 + 0.07 * f64::from(i / 2) + 1e-3 * f64::from(i % 2);
    });
    assert_eq!(trip, None);
}

/// The same of the amplitude, whose sample counts only when its count is new.
#[test]
fn an_amplitude_rate_is_a_difference_over_a_time() {
    let climb = |rise_m: f64, held_stamp: bool, held_count: bool| {
        let mut bench = Bench::armed();
        bench.limits.amplitude_rate_max_m_s = 20e-6;
        let (n0, stamp) = (bench.n, Nanos(u64::from(bench.n) * T.0));
        trips(&mut bench, 8, |s| {
            let i = stage(s).sequence - n0;
            let reading = amplifier(s).amplitude.as_mut().unwrap();
            reading.value = 2e-6 + rise_m * f64::from(i);
            if held_stamp {
                reading.taken_at = stamp;
            }
            if held_count {
                reading.sequence = n0;
            }
        })
    };
    let trip = climb(20.1e-9, false, false).unwrap();
    assert!(trip.cause == TripCause::AmplitudeRate && (trip.value - 20.1e-6).abs() < 1e-9, "{trip:?}");
    assert_eq!(climb(20.1e-9, true, false), None, "one stamp is no time");
    // At the limit itself: values, and their differences, that are exact in binary.
    let step = 2f64.powi(-26);
    let mut exact = Bench::armed();
    exact.limits.amplitude_rate_max_m_s = step / T.seconds();
    let n0 = exact.n;
    let climb_by = |s: &mut Observation| {
        let i = stage(s).sequence - n0;
        *measured(s) = 2f64.powi(-19) + step * f64::from(i);
    };
    assert_eq!(trips(&mut exact, 8, climb_by), None);
    exact.limits.amplitude_rate_max_m_s *= 1.0 - 1e-12;
    assert_eq!(trips(&mut exact, 8, climb_by).map(|t| t.cause), Some(TripCause::AmplitudeRate));
    assert_eq!(climb(20.1e-9, false, true), None, "the same count is the same sample");
    assert_eq!(climb(-25e-9, false, false), None, "falling is not rising");
    // Fast, slow, fast: two in a row are needed.
    let mut bench = Bench::armed();
    bench.limits.amplitude_rate_max_m_s = 20e-6;
    let n0 = bench.n;
    let trip = trips(&mut bench, 12, |s| {
        let i = stage(s).sequence - n0;
        *measured(s) = 2e-6 + 25e-9 * f64::from(i / 2);
    });
    assert_eq!(trip, None);
}

/// Shares of lost samples at the very limits: 85 of a hundred for the remark, 25 for the trip.
#[test]
fn lost_samples_are_counted_in_whole_windows() {
    type Pick = fn(&mut Observation) -> &mut Sample;
    let lose = |channel: Pick, came: u32| {
        let mut bench = bench();
        (bench.limits.timing.lateral.periods, bench.limits.timing.normal.periods) = (1000, 1000);
        bench.cycle(|_| {}, Controls { stop: true, ..Controls::default() });
        assert!(bench.cycle(|_| {}, Controls { reset: true, ..Controls::default() }).armed_now);
        // The window began with the reset: of its hundred samples the first ones come.
        let n0 = bench.n;
        let mut remark = None;
        for i in 1..=150 {
            let lost = |s: &mut Observation| {
                if (came + 1..=100).contains(&i) {
                    channel(s).sequence = n0 + came;
                }
            };
            let decision = bench.cycle(lost, Controls::default());
            if let Some(trip) = decision.tripped {
                return (remark, Some((trip.cause, trip.value, trip.bound)));
            }
            remark = remark.or(decision.remark.map(|r| (r, i)));
        }
        (remark, None)
    };
    let channels: [(Pick, Remark, TripCause); 2] = [
        (lateral, Remark::LateralLossy, TripCause::LateralLossy),
        (normal, Remark::NormalLossy, TripCause::NormalLossy),
    ];
    for (channel, remark, cause) in channels {
        assert_eq!(lose(channel, 85), (None, None));
        assert_eq!(lose(channel, 84), (Some((remark, 100)), None));
        assert_eq!(lose(channel, 25), (Some((remark, 100)), None));
        assert_eq!(lose(channel, 24), (None, Some((cause, 0.24, 0.25))));
    }
}

/// A channel at half the loop's rate owes half as many samples.
#[test]
fn a_slow_channel_owes_what_its_period_says() {
    let mut bench = bench();
    bench.limits.timing.lateral.period = Nanos(2 * T.0);
    let mut held = healthy(bench.n, &bench.last).forces.lateral;
    for _ in 0..600 {
        let decision = bench.cycle(
            |s| {
                if lateral(s).sequence.is_multiple_of(2) {
                    held = s.forces.lateral;
                }
                s.forces.lateral = held;
            },
            Controls::default(),
        );
        assert_eq!((decision.tripped, decision.remark), (None, None));
    }
    // A channel faster than the loop can show one sample a cycle, no more.
    bench.limits.timing.lateral.period = Nanos(T.0 / 4);
    bench.limits.timing.lateral.latency = Nanos(5 * T.0);
    for _ in 0..600 {
        let decision = bench.cycle(|_| {}, Controls::default());
        assert_eq!((decision.tripped, decision.remark), (None, None));
    }
}

/// What is refused is named, with its value.
#[test]
fn a_refused_limit_is_named() {
    let refused = |change: fn(&mut Limits)| {
        let mut limits = Limits::paper(T);
        change(&mut limits);
        limits.checked().unwrap_err().name()
    };
    assert_eq!(refused(|l| l.lateral_force_max_n = 10.1), "lateral_force_max_n");
    assert_eq!(refused(|l| l.amplitude_max = PeakToPeak::from_metres(10.1e-6)), "amplitude_max_pp_m");
    assert_eq!(refused(|l| l.frequency_hz.1 = 120_001.0), "frequency_max_hz");
    assert_eq!(refused(|l| l.frequency_hz.0 = 4_999.0), "frequency_min_hz");
    assert_eq!(refused(|l| l.frequency_hz.0 = f64::NAN), "frequency_min_hz");
    assert_eq!(refused(|l| l.speed_max_m_s = 1.01), "speed_max_m_s");
    assert_eq!(refused(|l| l.temperature_max_c = 48.1), "temperature_max_c");
    assert_eq!(refused(|l| l.exposure_max_s = 600.1), "exposure_max_s");
    assert_eq!(refused(|l| l.late_cycles_max = 101), "late_cycles_max");
    assert_eq!(refused(|l| l.late_in_a_row_max = 51), "late_in_a_row_max");
    assert_eq!(refused(|l| l.late_in_a_row_max = 0), "late_in_a_row_max");
    assert_eq!(refused(|l| l.travel_m.1 = f64::NAN), "travel_max_m");
    assert_eq!(refused(|l| l.timing.cycle = Nanos(0)), "cycle");
    let mut limits = Limits::paper(T);
    limits.travel_m = (0.06, -0.06);
    let reversed = limits.checked().unwrap_err();
    assert_eq!(reversed.name(), "travel_max_m");
    assert!(reversed.to_string().contains("swapped"), "{reversed}");
    let timing = ChannelTiming { period: Nanos(7), latency: Nanos(0), periods: 2 };
    assert_eq!(timing.age_limit(), Nanos(14));
}

/// A limit binds above its value, and only there.
#[test]
fn limits_bind_exactly_where_they_say() {
    type Spoil = fn(&mut Observation, f64);
    let l = limits();
    let amplitude: Spoil = |s, v| amplifier(s).amplitude.as_mut().unwrap().value = v;
    let cases: &[(TripCause, f64, f64, Spoil)] = &[
        (TripCause::NormalOverforce, l.normal_force_max_n, 1e-6, |s, v| normal(s).value = v),
        (TripCause::LateralOverforce, l.lateral_force_max_n, 1e-6, |s, v| lateral(s).value = v),
        (TripCause::LateralOverforce, -l.lateral_force_max_n, -1e-6, |s, v| lateral(s).value = v),
        (TripCause::OverAmplitude, l.amplitude_max.metres(), 1e-12, amplitude),
        (TripCause::OverTemperature, l.temperature_max_c, 1e-6, |s, v| {
            amplifier(s).temperature_c.as_mut().unwrap().value = v;
        }),
        (TripCause::OverTravel, l.travel_m.1, 1e-9, |s, v| stage(s).position_m = v),
        (TripCause::OverTravel, l.travel_m.0, -1e-9, |s, v| stage(s).position_m = v),
        (TripCause::Suspended, 50.0, 0.001, |s, v| s.lateness = Nanos((v * T.0 as f64) as u64)),
    ];
    for (cause, bound, above, spoil) in cases {
        let mut bench = Bench::armed();
        // At rest in the middle, so that a position beyond the travel is not on its way back.
        bench.request.velocity_m_s = 0.0;
        if *cause == TripCause::OverAmplitude {
            bench.request.amplitude = l.amplitude_max;
        }
        for _ in 0..60 {
            bench.cycle(|_| {}, Controls::default());
        }
        // Fifty late cycles are a row; the rule under test is another.
        bench.limits.late_in_a_row_max = 60;
        bench.limits.late_cycles_max = 1000;
        // A jump to the bound is confirmed by its second sample; the rate rule is out of the way.
        bench.limits.force_rate_max_n_s = 1e9;
        for i in 0..5 {
            let late = *cause == TripCause::Suspended && i > 0;
            let decision = bench.cycle(
                |s| {
                    if !late {
                        spoil(s, *bound)
                    }
                },
                Controls::default(),
            );
            assert_eq!(decision.tripped, None, "{cause:?} at its bound");
        }
        let (got, cycles) = bench.until_off(|s| spoil(s, bound + above));
        assert_eq!((got, cycles), (*cause, 1), "just above the bound");
    }
}

#[test]
fn no_setup_can_raise_a_hard_limit() {
    let mut limits = Limits::paper(T);
    limits.normal_force_max_n = HARD.normal_force_max_n * 1.01;
    assert!(limits.checked().unwrap_err().to_string().contains("above the hard limit"));
    let mut limits = Limits::paper(T);
    limits.temperature_max_c = f64::NAN;
    assert!(limits.checked().is_err());
    let mut limits = Limits::paper(T);
    limits.frozen_after = 19;
    assert!(limits.checked().is_err());
}

#[test]
fn a_setup_may_go_to_its_hard_limit_and_not_beyond() {
    let with = |change: fn(&mut Limits)| {
        let mut limits = Limits::paper(T);
        change(&mut limits);
        limits.checked()
    };
    assert!(with(|l| l.normal_force_max_n = HARD.normal_force_max_n).is_ok());
    assert!(with(|l| l.frequency_hz = HARD.frequency_hz).is_ok());
    assert!(with(|l| l.frequency_hz.0 = HARD.frequency_hz.0 - 1.0).is_err());
    assert!(with(|l| l.frequency_hz = (30e3, 30e3)).is_err());
    assert!(with(|l| l.frequency_hz.1 = HARD.frequency_hz.1 + 1.0).is_err());
    assert!(with(|l| l.travel_m = (0.01, 0.01)).is_err());
    assert!(with(|l| l.travel_m = (f64::NEG_INFINITY, 0.01)).is_err());
    assert!(with(|l| l.travel_m = (0.0, f64::INFINITY)).is_err());
    assert!(with(|l| l.force_step_max_n = 0.0).is_err());
    assert!(with(|l| l.force_rate_max_n_s = f64::INFINITY).is_err());
    assert!(with(|l| l.amplitude_rate_max_m_s = -1.0).is_err());
    assert!(with(|l| l.frozen_after = 1001).is_err());
    assert!(with(|l| l.timing.cycle = Nanos(0)).is_err());
    // What was recorded is checked again when it is read.
    let mut above = Limits::paper(T);
    above.exposure_max_s = 1e6;
    let text = serde_json::to_string(&above).unwrap();
    assert!(serde_json::from_str::<Limits>(&text).unwrap_err().to_string().contains("hard limit"));
    let text = serde_json::to_string(&limits()).unwrap();
    assert_eq!(serde_json::from_str::<Limits>(&text).unwrap(), limits());
}

#[test]
fn beyond_the_travel_only_the_way_back_is_let_through() {
    for (position, velocity, trips) in
        [(0.061, -0.02, false), (0.061, 0.02, true), (-0.061, 0.02, false), (-0.061, -0.02, true)]
    {
        let mut bench = Bench::armed();
        bench.request.velocity_m_s = velocity;
        bench.cycle(|_| {}, Controls::default());
        let decision = bench.cycle(|s| stage(s).position_m = position, Controls::default());
        assert_eq!(decision.tripped.is_some(), trips, "{position} {velocity}");
        bench.cycle(|s| stage(s).at_limit = true, Controls::default());
    }
}

/// Every value of a setup has two hard ends: at each it is taken, beyond each it is refused by its name with
/// the range; what is not a number, zero where nothing is, and what is absurd are beyond.
#[test]
fn every_range_is_closed_at_both_ends() {
    type Set = fn(&mut Limits, f64);
    fn seconds(v: f64) -> Nanos {
        // To the nanosecond that is meant, not the one below.
        Nanos((v * 1e9).round() as u64)
    }
    let cases: &[(&str, f64, f64, Set)] = &[
        ("force_step_max_n", 0.01, 5.0, |l, v| l.force_step_max_n = v),
        ("force_rate_max_n_s", 1.0, 500.0, |l, v| l.force_rate_max_n_s = v),
        ("amplitude_rate_max_m_s", 1e-6, 0.1, |l, v| l.amplitude_rate_max_m_s = v),
        ("travel_min_m", -0.5, 0.5, |l, v| l.travel_m = (v, 0.06)),
        ("travel_max_m", -0.499, 0.5, |l, v| l.travel_m = (-0.5, v)),
        ("frozen_after", 20.0, 1000.0, |l, v| l.frozen_after = v as u32),
        ("amplitude_frozen_after", 20.0, 1000.0, |l, v| l.amplitude_frozen_after = Some(v as u32)),
        ("exposure_rest_s", 10.0, 3600.0, |l, v| l.exposure_rest_s = v),
        ("exposure_duty_max", 1e-3, 0.5, |l, v| l.exposure_duty_max = v),
        ("exposure_dose_max_m2_s", 1e-3, 100.0, |l, v| l.exposure_dose_max_m2_s = v),
        ("lateral", 1e-5, 0.05, |l, v| l.timing.lateral.period = seconds(v)),
        ("normal", 1e-5, 0.05, |l, v| l.timing.normal.period = seconds(v)),
        ("amplifier", 1e-5, 0.1, |l, v| l.timing.amplifier.period = seconds(v)),
        ("stage", 1e-5, 0.1, |l, v| l.timing.stage.period = seconds(v)),
        ("supply", 1e-5, 0.1, |l, v| l.timing.supply.period = seconds(v)),
        ("contacts", 1e-5, 0.1, |l, v| l.timing.contacts.period = seconds(v)),
        ("command_expiry", 1e-3, 0.02, |l, v| l.timing.command_expiry = seconds(v)),
        ("plate_ring_time_s", 1e-5, 0.05, |l, v| l.timing.ring_time = seconds(v)),
    ];
    for (name, low, high, set) in cases {
        let taken = |value: f64| {
            let mut limits = Limits::paper(T);
            set(&mut limits, value);
            limits.checked()
        };
        if *name != "travel_min_m" {
            assert!(taken(*high).is_ok(), "{name} = {high}: {:?}", taken(*high));
        }
        assert!(taken(*low).is_ok(), "{name} = {low}: {:?}", taken(*low));
        let step = if name.contains("frozen") { 1.0 } else { (high - low) * 1e-3 };
        for beyond in [low - step, high + step, 1e6 * high] {
            let error = taken(beyond).expect_err(name);
            assert!(matches!(error, LimitError::OutOfRange { .. }) && error.name() == *name, "{error}");
            assert!(error.to_string().contains("permitted"), "{error}");
        }
    }
    type Wide = fn(&mut Limits, f64);
    let floats: &[(&str, Wide)] = &[
        ("force_step_max_n", |l, v| l.force_step_max_n = v),
        ("force_rate_max_n_s", |l, v| l.force_rate_max_n_s = v),
        ("amplitude_rate_max_m_s", |l, v| l.amplitude_rate_max_m_s = v),
        ("travel_min_m", |l, v| l.travel_m.0 = v),
        ("travel_max_m", |l, v| l.travel_m.1 = v),
        ("exposure_rest_s", |l, v| l.exposure_rest_s = v),
        ("exposure_duty_max", |l, v| l.exposure_duty_max = v),
        ("exposure_dose_max_m2_s", |l, v| l.exposure_dose_max_m2_s = v),
        ("normal_force_max_n", |l, v| l.normal_force_max_n = v),
        ("exposure_max_s", |l, v| l.exposure_max_s = v),
    ];
    for (name, set) in floats {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e12, 1e12] {
            let mut limits = Limits::paper(T);
            set(&mut limits, value);
            let error = limits.checked().expect_err(name);
            assert_eq!(error.name(), *name, "{value}");
        }
    }
    // Latencies and periods, of any channel.
    for (latency, periods, fits) in
        [(50_000_000, 5, true), (50_000_001, 5, false), (50_000_000, 6, false), (0, 1, true), (0, 0, false)]
    {
        let mut limits = Limits::paper(T);
        (limits.timing.stage.latency, limits.timing.stage.periods) = (Nanos(latency), periods);
        assert_eq!(limits.checked().is_ok(), fits, "{latency} {periods}");
    }
    for (cycle, fits) in [(249_000, false), (250_000, true), (100_000_000, true), (101_000_000, false)] {
        assert_eq!(Limits::paper(Nanos(cycle)).checked().is_ok(), fits, "{cycle}");
    }
}

/// Saturated every other cycle is saturated.
#[test]
fn saturation_that_comes_and_goes_trips() {
    let mut bench = bench();
    let mut i = 0;
    let (cause, cycles) = bench.until_off(|s| {
        i += 1;
        if i % 2 == 0 {
            normal(s).quality = Quality::Saturated;
        }
    });
    assert_eq!((cause, cycles), (TripCause::NormalSaturated, 10));
    // Four in fifty cycles, alone each, are let through.
    let mut bench = super::bounds::bench();
    for i in 0..400 {
        let rail = |s: &mut Observation| {
            if i % 13 == 0 {
                lateral(s).quality = Quality::Saturated;
            }
        };
        assert_eq!(bench.cycle(rail, Controls::default()).tripped, None, "{i}");
    }
}

/// A counter that stands still hides no overforce: what is shown above the limit for two samples' time trips.
#[test]
fn an_overforce_trips_whatever_the_counter_says() {
    let mut stuck = bench();
    let n0 = stuck.n;
    let (cause, cycles) = stuck.until_off(|s| {
        normal(s).sequence = n0;
        normal(s).value = 40.0;
    });
    assert_eq!((cause, cycles), (TripCause::NormalOverforce, 3));
    let mut railed = bench();
    let (cause, cycles) = railed.until_off(|s| {
        normal(s).value = 40.0;
        normal(s).quality = Quality::Saturated;
    });
    assert_eq!((cause, cycles), (TripCause::NormalSaturated, 2));
}

/// Near its load, or near zero when lifted off; less than the load is a lost contact, not a fault.
#[test]
fn the_normal_force_is_held_to_the_load() {
    let trip_of = |load_n: f64, shows: f64, commanded: bool| {
        let mut bench = bench();
        bench.limits.load_commanded = commanded;
        bench.request.normal_force_n = load_n;
        trips(&mut bench, 2100, |s| normal(s).value = shows).map(|t| (t.cause, t.bound))
    };
    for (load, shows, fits) in [
        (0.25, 0.674, true),
        (0.25, 0.676, false),
        (0.25, 0.0, true),
        (0.0, 0.299, true),
        (0.0, 0.301, false),
        (0.0, -0.301, false),
    ] {
        let bound = (TripCause::LoadImplausible, 1.5 * load + 0.3);
        assert_eq!(trip_of(load, shows, true), (!fits).then_some(bound), "{load} N, {shows} N");
        assert_eq!(trip_of(load, shows, false), None, "weights load this finger");
    }
}

/// Equal amplitudes count while the same set-point is driven, from a state of that set-point on.
#[test]
fn an_amplitude_that_repeats_itself_is_frozen() {
    let frozen = |after: Option<u32>, driven: bool| {
        let mut bench = bench();
        bench.limits.amplitude_frozen_after = after;
        if !driven {
            bench.request.amplitude = PeakToPeak::ZERO;
        }
        trips(&mut bench, 400, |s| amplifier(s).amplitude.as_mut().unwrap().raw = 77)
            .map(|t| (t.cause, t.bound))
    };
    assert_eq!(frozen(Some(200), true), Some((TripCause::AmplitudeFrozen, 200.0)));
    assert_eq!(frozen(Some(200), false), None, "at rest it has nothing to tell");
    assert_eq!(frozen(None, true), None, "a readback without noise");
}
