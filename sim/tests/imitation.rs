//! The oracle's imitations against what is known from outside: the groups of gains that the closed forms of the paper
//! cannot tell apart (k_n w / F and k_l U / (f mu0 k_n w) are all that mu' depends on), and causes of different kinds.

use models::PeakToPeak;
use muprime_sim::defects::{Defect, DefectKind, Defects, Surroundings};
use muprime_sim::finger::{FingerConfig, VirtualFinger};
use muprime_sim::sealed::imitate::Imitator;
use muprime_sim::sealed::oracle::Case;
use muprime_sim::sealed::{Ask, Stratum};
use muprime_sim::world::{Point, steady_forces};

fn finger() -> VirtualFinger {
    VirtualFinger::new(&FingerConfig { stiffness_relative_sd: 0.0, ..FingerConfig::default() }, 1)
}

/// A full sweep: six amplitudes, four speeds, three forces, both directions.
fn sweep() -> Vec<Point> {
    let mut out = Vec::new();
    for (i, pp_um) in [0.0, 0.5, 1.0, 1.6, 2.5, 4.0].into_iter().enumerate() {
        for (j, speed_m_s) in [0.006, 0.02, 0.06, 0.15].into_iter().enumerate() {
            for (k, normal_force_n) in [0.15, 0.3, 0.7].into_iter().enumerate() {
                let direction = if (i + j + k) % 2 == 0 { 1.0 } else { -1.0 };
                let time_s = 10.0 + 7.0 * ((13 * (12 * i + 3 * j + k)) % 72) as f64;
                let at = Surroundings {
                    time_s,
                    contact_time_s: time_s,
                    position_m: 0.004 * direction,
                    direction,
                    frequency_hz: if k == 1 { 27_500.0 } else { 40_000.0 },
                    normal_force_n,
                    ambient_pressure_pa: 101_325.0,
                    temperature_c: 22.0,
                };
                let known_pp_m = PeakToPeak::from_metres(pp_um * 1e-6).metres();
                out.push(Point { at, known_pp_m, speed_m_s });
            }
        }
    }
    out
}

/// What the oracle says of forces from a world that differs from the nominal one in `changed` and `defects`.
fn asked(
    truth: &str,
    changed: impl Fn(&mut VirtualFinger, &mut Point),
    defects: &Defects,
) -> (f64, Vec<Imitator>) {
    asked_beside(&[truth], &[], changed, defects)
}

/// The same in the place of several causes, while others act beside the imitator.
fn asked_beside(
    truth: &[&str],
    beside: &[Defect],
    changed: impl Fn(&mut VirtualFinger, &mut Point),
    defects: &Defects,
) -> (f64, Vec<Imitator>) {
    let known = sweep();
    let nominal = finger();
    let mut lateral_n = Vec::new();
    let mut shown = known.clone();
    for (point, shown) in known.iter().zip(&mut shown) {
        let (mut own, mut at) = (nominal, *point);
        changed(&mut own, &mut at);
        let forces = steady_forces(&own, defects, &at);
        lateral_n.push(forces.lateral_n);
        shown.at.normal_force_n = forces.normal_n;
    }
    let sd_n: Vec<f64> = lateral_n.iter().map(|l| (0.015 * l).hypot(8e-4)).collect();
    let case = Case {
        known: &shown,
        lateral_n: &lateral_n,
        sd_n: &sd_n,
        nominal,
        stiffness_sd: 0.03,
        beside,
        place: 0,
    };
    let base = case.fit(&Defects::none(), 8);
    let truth: Vec<Defect> = truth
        .iter()
        .map(|name| Defect { kind: DefectKind::named(name).unwrap(), values: Default::default() })
        .collect();
    (base.chi2, case.imitators(&truth, &base, 0.0, false))
}

fn left(list: &[Imitator], name: &str) -> f64 {
    list.iter().find(|i| i.name == name).unwrap().chi2_left
}

fn one(name: &str, values: [f64; 4]) -> Defects {
    Defects { defects: vec![Defect { kind: DefectKind::named(name).unwrap(), values }], channels: Vec::new() }
}

#[test]
fn a_gain_of_the_amplitude_is_a_gain_of_the_normal_stiffness() {
    // Exact gain, without the bend of this world's own cause.
    let (gap, list) = asked("amplitude_miscalibration", |_, point| point.known_pp_m *= 1.9, &Defects::none());
    println!("gap {gap:.0}: {:?}", &list[..3]);
    assert!(gap > 100.0, "{gap}");
    assert_eq!(list[0].name, "stiffness_error");
    assert!(list[0].chi2_left < 1e-2, "{:?}", list[0]);
    assert!(list[0].is_near());
}

#[test]
fn a_gain_of_the_speed_is_a_gain_of_the_lateral_stiffness() {
    // The cause `speed_error` has a slip of its own, so it comes near but not to nothing.
    let soft = |own: &mut VirtualFinger, _: &mut Point| own.lateral_stiffness_n_per_m /= 1.5;
    let (gap, list) = asked("stiffness_error", soft, &Defects::none());
    println!("gap {gap:.0}: {:?}", &list[..3]);
    assert!(gap > 100.0);
    // Here all passes lie at one place, where a ripple of the speed is a gain too.
    assert!(left(&list, "speed_error") < 0.15 * gap, "{list:?}");
}

#[test]
fn a_gain_of_the_speed_leaves_nothing_that_the_lateral_stiffness_would_not_explain() {
    let (gap, list) = asked("speed_error", |_, point| point.speed_m_s *= 1.7, &Defects::none());
    println!("gap {gap:.0}: {:?}", &list[..3]);
    assert!(gap > 100.0);
    assert!(list[0].name == "stiffness_error" && list[0].is_near(), "{list:?}");
}

#[test]
fn a_straight_tilt_is_a_cross_talk_and_no_squeeze_film() {
    let (gap, list) = asked("plate_tilt", |_, _| {}, &one("plate_tilt", [0.05, 0.0, 0.0, 0.0]));
    println!("gap {gap:.0}: {:?}", &list[..3]);
    assert!(gap > 300.0);
    assert!(left(&list, "force_crosstalk") < 0.01 * gap, "{list:?}");
    let film = list.iter().find(|i| i.name == "squeeze_film").unwrap();
    assert!(!film.is_near());
    assert!(left(&list, "squeeze_film") > 0.9 * gap, "a film does not know the direction: {list:?}");
}

#[test]
fn ridges_that_fly_are_asked_of_each_other() {
    for (truth, other, values) in [
        ("ridge_inertia", "normal_damping", [2e-6, 0.6, 0.3, 0.0]),
        ("normal_damping", "ridge_inertia", [1e-6, 0.0, 0.0, 0.0]),
    ] {
        let (gap, list) = asked(truth, |_, _| {}, &one(truth, values));
        println!("{truth}, gap {gap:.0}: {:?}", &list[..3]);
        assert!(left(&list, other) < 0.8 * gap, "{list:?}");
        assert!(list.iter().any(|i| i.name == "lateral_recovery"));
    }
}

#[test]
fn an_alias_stays_one_beside_another_cause() {
    let tilt = one("plate_tilt", [0.05, 0.0, 0.0, 0.0]);
    let gain = |_: &mut VirtualFinger, point: &mut Point| point.known_pp_m *= 1.9;
    let (gap, list) = asked_beside(&["amplitude_miscalibration"], &tilt.defects, gain, &tilt);
    assert!(gap > 100.0, "{gap}");
    assert_eq!((list[0].name.as_str(), list[0].instead_of.len()), ("stiffness_error", 1));
    assert!(list[0].chi2_left < 1e-2 && list.iter().all(|i| i.name != "plate_tilt"), "{list:?}");
}

#[test]
fn one_gain_stands_for_two_and_for_a_gain_with_a_tilt_does_not() {
    let two = |own: &mut VirtualFinger, point: &mut Point| {
        point.known_pp_m *= 1.5;
        own.normal_stiffness_n_per_m *= 1.3;
    };
    let names = ["amplitude_miscalibration", "stiffness_error"];
    let (gap, list) = asked_beside(&names, &[], two, &Defects::none());
    assert!(gap > 100.0 && list[0].name == "stiffness_error" && list[0].share_left < 1e-3, "{gap} {list:?}");
    let tilt = one("plate_tilt", [0.006, 0.0, 0.0, 0.0]);
    let (gap, list) = asked_beside(&["stiffness_error", "plate_tilt"], &[], two, &tilt);
    assert!(gap > 100.0 && list[0].share_left > 0.2, "{gap} {list:?}");
}

#[test]
fn a_companion_that_the_stiffness_takes_up_leaves_nothing_to_a_single_cause() {
    // Ageing of the contact, and a speed 1.8 times what is said: the lateral stiffness moves by five of its deviations.
    let label = muprime_sim::sealed::generate(1_710_005_130_040, Stratum::Pair, Ask::Imitators).label;
    let names: Vec<&str> = label.causes.iter().map(|c| c.name.as_str()).collect();
    assert!(
        names.contains(&"contact_ageing") && names.contains(&"speed_error"),
        "another set by now: {names:?}"
    );
    let left = label.best_single_leaves.expect("a pair");
    assert!(left < 0.01, "{left}");
}
