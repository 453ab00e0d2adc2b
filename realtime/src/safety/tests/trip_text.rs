//! The description of a trip: its unit, its requirement, what to do about it.

use super::*;

#[test]
fn every_cause_has_a_unit_a_requirement_and_a_remedy_of_its_own_kind() {
    let causes = || RULES.iter().map(|rule| rule.cause).chain([TripCause::StartUp]);
    for cause in causes() {
        let remedy = cause.remedy();
        assert!(remedy.len() > 30 && remedy.ends_with('.'), "{cause:?}: {remedy}");
        assert!(cause == TripCause::StartUp || cause.requirement().is_some(), "{cause:?}");
        // Only causes of one kind share a remedy.
        let kind = |cause: TripCause| {
            let name = format!("{cause:?}");
            let sides = ["Lateral", "Normal", "OverAmplitude", "AmplitudeRunaway"];
            sides.iter().any(|side| name.starts_with(side))
        };
        let alike = causes().filter(|other| *other != cause && other.remedy() == remedy);
        for other in alike {
            assert!(kind(cause) && kind(other), "{cause:?} and {other:?}: {remedy}");
        }
    }
    assert!(RULES.iter().all(|rule| !rule.units.is_empty()));
}

/// A healthy rig is armed, then shows or gets something: the trip that follows.
fn tripped(request: Request, change: impl Fn(&mut Observation)) -> Trip {
    let mut bench = Bench::armed();
    bench.request = request;
    for _ in 0..1000 {
        if let Some(trip) = bench.cycle(&change, Controls::default()).tripped {
            return trip;
        }
    }
    panic!("no trip")
}

#[test]
fn a_trip_is_told_in_its_unit() {
    let slow = Request::default();
    let force = tripped(slow, |seen| {
        if let Ok(normal) = &mut seen.forces.normal {
            normal.value = 40.0;
        }
    });
    assert_eq!(force.unit, Unit::Newton);
    let text = force.to_string();
    assert!(
        text.starts_with("the normal force is beyond its limit: 40 N (limit ")
            && text.ends_with(" s [SR-04]"),
        "{text}"
    );

    let silent = tripped(slow, |seen| seen.forces.lateral = Err(NoData::Disconnected));
    let text = silent.to_string();
    assert!(silent.unit == Unit::Second && text.contains(": no data (limit 0.0"), "{text}");

    // One rule, several units: the trip has that of what broke it.
    let much = Request { amplitude: PeakToPeak::from_metres(9e-6), frequency_hz: 27_500.0, ..slow };
    let text = tripped(much, |_| {}).to_string();
    assert!(text.contains("9 \u{b5}m (limit ") && text.contains("[SR-30]"), "{text}");
    let high = Request { amplitude: PeakToPeak::from_metres(1e-6), frequency_hz: 2e6, ..slow };
    let text = tripped(high, |_| {}).to_string();
    assert!(text.contains("2000000 Hz (limit "), "{text}");
}

/// '0 m (limit 0.2 um)': the reader had to convert to compare.
#[test]
fn value_and_limit_of_a_trip_have_one_unit() {
    let trip = tripped(Request::default(), |seen| seen.forces.lateral = Err(NoData::Disconnected));
    for (value, bound, words) in [
        (0.0, 2e-10, ": 0 \u{b5}m (limit 0.0002 \u{b5}m)"),
        (1e-4, 0.02, ": 0.0001 m (limit 0.02 m)"),
        (f64::INFINITY, 2e-6, ": no data (limit 2 \u{b5}m)"),
        (0.0, 0.0, ": 0 m (limit 0 m)"),
        (-1e-14, 0.02, ": 0 m (limit 0.02 m)"),
    ] {
        let text = Trip { unit: Unit::Metre, value, bound, ..trip }.to_string();
        assert!(text.contains(words), "{text}");
    }
}

/// A stage at rest that is to move backwards: its speed along that is -0.0, and a record shows 0.
#[test]
fn no_number_of_a_trip_is_minus_zero() {
    let backwards = Request { velocity_m_s: -0.02, normal_force_n: 0.25, ..Request::default() };
    let trip = tripped(backwards, |seen| stage(seen).velocity_m_s = 0.0);
    assert_eq!((trip.cause, trip.value), (TripCause::StageNotFollowing, 0.0));
    assert!(trip.value.is_sign_positive(), "{:?}", trip.value);
}

#[test]
fn a_trip_of_an_older_record_is_read() {
    let old = r#"{"cause":"over_travel","value":0.1,"bound":0.05,"cycle":7,"at":7000000}"#;
    let trip: Trip = serde_json::from_str(old).unwrap();
    assert_eq!((trip.cause, trip.unit), (TripCause::OverTravel, Unit::Flag));
    let new = serde_json::to_string(&Trip { unit: Unit::Metre, ..trip }).unwrap();
    assert!(new.contains(r#""unit":"m""#), "{new}");
}
