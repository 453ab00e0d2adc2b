//! What the library says of its causes is true: names exist, exact aliases are exact, checks and certificates fit.
use models::rig_file::CertifiedKey;
use models::{Condition, Direction, PeakToPeak};
use muprime_effects::corrected::{Corrected, SavedEffect, SavedModel, SavedParameter};
use muprime_effects::{Active, Baseline, Design, Effect, Prior, by_name, known, lateral_force, library};
use std::collections::BTreeSet;

const BASELINE: Baseline =
    Baseline { mu0: 0.6, normal_stiffness_n_per_m: 2e6, lateral_stiffness_n_per_m: 0.8e6 };

const DESIGN: Design = Design {
    duration_s: 200.0,
    reference_load_n: 0.35,
    reference_speed_m_s: 0.02,
    reference_frequency_hz: 35_000.0,
    reference_temperature_c: 20.0,
    stroke_m: 0.03,
    largest_amplitude_m: 5e-6,
};

fn passes() -> Vec<Condition> {
    let mut list = Vec::new();
    for amplitude_pp_m in [0.0, 0.4e-6, 1.5e-6, 5e-6] {
        for speed_m_s in [2e-3, 0.02, 0.2] {
            for normal_force_n in [0.15, 0.8] {
                for direction in [Direction::Forward, Direction::Backward] {
                    list.push(Condition {
                        time_s: 10.0,
                        amplitude: PeakToPeak::from_metres(amplitude_pp_m),
                        frequency_hz: 27_500.0,
                        speed_m_s,
                        direction,
                        position_m: 0.01,
                        normal_force_n,
                        ..Condition::paper()
                    });
                }
            }
        }
    }
    list
}

fn forces(baseline: &Baseline, active: &[Active<'_>]) -> Vec<f64> {
    passes().iter().map(|p| lateral_force(baseline, active, p, &DESIGN)).collect()
}

/// Largest difference, relative to the largest force.
fn apart(a: &[f64], b: &[f64]) -> f64 {
    let top = a.iter().fold(0.0f64, |m, v| m.max(v.abs()));
    a.iter().zip(b).fold(0.0f64, |m, (x, y)| m.max((x - y).abs())) / top
}

/// Every effect and law that one file names in another exists, and laws of one effect differ in name.
#[test]
fn every_name_referred_to_exists() {
    let names: BTreeSet<&str> = known().iter().map(|e| e.name).collect();
    assert_eq!(names.len(), known().len(), "two causes of one name");
    for effect in known() {
        for other in effect.imitated_by {
            assert!(by_name(other).is_some() && *other != effect.name, "{} names '{other}'", effect.name);
        }
        let laws: BTreeSet<&str> = effect.laws.iter().map(|l| l.name).collect();
        assert_eq!(laws.len(), effect.laws.len(), "{}: two laws of one name", effect.name);
        for (other, law) in effect.laws.iter().filter_map(|l| l.same_as) {
            let found = by_name(other).is_some_and(|e| e.laws.iter().any(|l| l.name == law));
            assert!(found && other != effect.name, "{} names '{other}' with '{law}'", effect.name);
        }
    }
    for outside in &known()[library().len()..] {
        assert!(by_name(outside.name).is_none() && outside.words.is_some(), "{}", outside.name);
    }
}

/// What a law says of itself as a change of the baseline is so on every pass.
#[test]
fn laws_that_act_as_a_change_of_the_baseline_do_so_exactly() {
    let mut tried = 0;
    for effect in known() {
        for (law, form) in effect.laws.iter().enumerate() {
            let Some([mu0, normal, lateral]) = form.acts_as else { continue };
            for size in [-0.4, 0.1, 0.5] {
                let changed = Baseline {
                    mu0: BASELINE.mu0 * (mu0 * size).exp(),
                    normal_stiffness_n_per_m: BASELINE.normal_stiffness_n_per_m * (normal * size).exp(),
                    lateral_stiffness_n_per_m: BASELINE.lateral_stiffness_n_per_m * (lateral * size).exp(),
                };
                let with = forces(&BASELINE, &[Active { effect, law, theta: &[size] }]);
                let off = apart(&with, &forces(&changed, &[]));
                assert!(off < 1e-9, "{} ({}) at {size}: off by {off:.1e}", effect.name, form.name);
                assert!(apart(&with, &forces(&BASELINE, &[])) > 1e-3, "{}: nothing changes", effect.name);
                tried += 1;
            }
        }
    }
    assert!(tried >= 3 * 6, "{tried}");
}

/// Twins do the same for the same size, but for a rest that is small against what they do.
#[test]
fn twins_do_the_same() {
    let twins = muprime_effects::twins();
    for [(a, law_a), (b, law_b)] in &twins {
        let of = |e: usize, law: usize| {
            let effect: &'static Effect = library()[e];
            forces(&BASELINE, &[Active { effect, law, theta: &[0.03] }])
        };
        let (one, other) = (of(*a, *law_a), of(*b, *law_b));
        let change = apart(&one, &forces(&BASELINE, &[]));
        let names = [library()[*a].name, library()[*b].name];
        assert!(apart(&one, &other) < 0.35 * change, "{names:?}: {} of {change}", apart(&one, &other));
    }
    let of = |name: &str| twins.iter().filter(|t| t.iter().any(|(e, _)| library()[*e].name == name)).count();
    assert!(of("plate_tilt") == 1 && of("stiffness_error") == 2 && of("speed_error") == 1, "{twins:?}");
}

/// Each quantity that a certificate can bound is the size of some law, which starts from zero.
#[test]
fn every_certified_quantity_bounds_a_law() {
    for key in CertifiedKey::ALL {
        let laws: Vec<_> =
            library().iter().flat_map(|e| e.laws).filter(|l| l.certified_by == Some(key)).collect();
        assert_eq!(laws.len(), 1, "{} bounds {} laws", key.name(), laws.len());
        let size = &laws[0].parameters[0];
        let unit = if key.name().ends_with("_n") {
            "N"
        } else if key.name().ends_with("_rad") {
            "rad"
        } else {
            "1"
        };
        assert!(size.unit == unit && size.zero == Some(0.0), "{}: size in {}", key.name(), size.unit);
    }
}

/// A cause outside of the library is imitated by a pair, and only by the whole of it.
#[test]
fn heating_is_imitated_by_rate_and_load_together() {
    let pair = ["load_dependent_friction", "rate_dependent_friction"];
    assert_eq!(muprime_effects::imitated(&pair).map(|e| e.name), Some("frictional_heating"));
    assert!(muprime_effects::imitated(&pair[..1]).is_none());
}

/// What a check measures is of the unit of the law's size: its deviation is a part of the size's prior,
/// neither more than half of it nor next to nothing.
#[test]
fn checks_measure_in_the_unit_of_the_size() {
    let mut checked = 0;
    for (effect, law) in library().iter().flat_map(|e| e.laws.iter().map(move |l| (e, l))) {
        let Some(check) = law.seen_by else { continue };
        let (Prior::Normal(sd) | Prior::HalfNormal(sd)) = law.parameters[0].prior else {
            panic!("{} ({}): the size comes first", effect.name, law.name)
        };
        let share = check.sd / sd;
        assert!((5e-3..=0.5).contains(&share), "{} ({}): {share:.1e} of the prior", effect.name, law.name);
        checked += 1;
    }
    assert!(checked > 20, "{checked}");
}

/// Every law can be made ready for the loop, however many parameters it has, and the model predicts what the law does.
#[test]
fn every_law_can_be_made_ready_for_the_loop() {
    for effect in library() {
        for (law, form) in effect.laws.iter().enumerate() {
            let parameters: Vec<_> =
                form.parameters.iter().map(|p| p.at_load(DESIGN.reference_load_n)).collect();
            let theta: Vec<f64> = parameters.iter().map(|p| p.value(0.2)).collect();
            let saved = SavedModel {
                schema: "muprime.model/1".into(),
                verdict: String::new(),
                relative_sd: 0.01,
                interpolation_error: 0.0,
                baseline: BASELINE,
                design: DESIGN,
                law: None,
                effects: vec![SavedEffect {
                    name: effect.name.into(),
                    law: form.name.into(),
                    acts_on: "prediction".into(),
                    table: None,
                    parameters: parameters
                        .iter()
                        .zip(&theta)
                        .map(|(p, value)| SavedParameter {
                            name: p.name.into(),
                            unit: p.unit.into(),
                            value: *value,
                        })
                        .collect(),
                    covariance: Vec::new(),
                }],
            };
            let model = Corrected::compile_on(&saved, None).unwrap();
            let active = [Active { effect, law, theta: &theta }];
            for (pass, force) in passes().iter().zip(forces(&BASELINE, &active)) {
                let got = model.lateral_force(pass);
                assert!(
                    (got - force).abs() <= 1e-9 * force.abs().max(1e-3),
                    "{}: {}",
                    effect.name,
                    form.name
                );
            }
        }
    }
}

/// A pass before the first of the table saw nothing of a change that the first pass began: no clock runs
/// backwards, where an exponential has no bound and a power of time no value. A straight drift may go on.
#[test]
fn what_the_first_pass_began_was_not_under_way_before_it() {
    let at = |effect: &'static Effect, law: usize, theta: &[f64], time_s: f64| -> Vec<f64> {
        let active = [Active { effect, law, theta }];
        let when = |p: Condition| Condition { time_s, run_time_s: Some(time_s), ..p };
        passes().into_iter().map(|p| lateral_force(&BASELINE, &active, &when(p), &DESIGN)).collect()
    };
    let mut clocks = 0;
    for effect in library() {
        for (law, l) in effect.laws.iter().enumerate() {
            let theta: Vec<f64> = l.parameters.iter().map(|p| p.value(0.8)).collect();
            let [before, first, later] =
                [-0.5, 0.0, 0.5].map(|share| at(effect, law, &theta, share * DESIGN.duration_s));
            // A parabola through the table has no beginning.
            if apart(&first, &later) == 0.0 || l.name == "offset with curved drift" {
                continue;
            }
            clocks += 1;
            let (grown, back) = (apart(&first, &later), apart(&first, &before));
            assert!(back <= 1.001 * grown, "{} {}: {back} before, {grown} after", effect.name, l.name);
        }
    }
    assert!(clocks > 10, "{clocks} laws follow time");
}

/// What laws of one quantity do is a change of that quantity: a Hertzian stiffness goes with the cube root of
/// the load; rings follow J0 (zero at 2.404826, -0.402759 at 3.831706: Abramowitz and Stegun, table 9.5); an
/// attraction that builds up is all there in a contact that never breaks.
#[test]
fn laws_change_what_they_state_by_their_formula() {
    let force = |baseline: &Baseline, name: &str, law: &str, theta: &[f64], pass: &Condition| {
        let effect = *library().iter().find(|e| e.name == name).unwrap();
        let law = effect.laws.iter().position(|l| l.name == law).unwrap();
        lateral_force(baseline, &[Active { effect, law, theta }], pass, &DESIGN)
    };
    let same = |a: f64, b: f64| assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
    let moving = |um: f64| Condition { amplitude: PeakToPeak::from_metres(um * 1e-6), ..Condition::paper() };
    let hertz = ((Condition::paper().normal_force_n * 1.7) / DESIGN.reference_load_n).cbrt();
    let stiffer = Baseline {
        normal_stiffness_n_per_m: BASELINE.normal_stiffness_n_per_m * hertz,
        lateral_stiffness_n_per_m: BASELINE.lateral_stiffness_n_per_m * hertz,
        ..BASELINE
    };
    let pass = Condition { normal_force_n: Condition::paper().normal_force_n * 1.7, ..moving(2.0) };
    let growing = force(&BASELINE, "stiffness_error", "both, growing with the load", &[1.0 / 3.0], &pass);
    same(growing, lateral_force(&stiffer, &[], &pass, &DESIGN));
    for direction in [Direction::Forward, Direction::Backward] {
        let pass = Condition { direction, ..moving(2.0) };
        let faster = force(&BASELINE, "speed_error", "by direction", &[0.4], &pass);
        same(faster, force(&BASELINE, "stiffness_error", "lateral stiffness by direction", &[0.4], &pass));
    }
    for (argument, share) in [(2.404_826, 0.02), (3.831_706, 0.402_759), (0.0, 1.0)] {
        let position_m = 0.01 * argument / std::f64::consts::PI;
        let at = |um| Condition { position_m, frequency_hz: DESIGN.reference_frequency_hz, ..moving(um) };
        let ring = force(&BASELINE, "mode_shape", "rings of a disc", &[1.0, 0.01, 0.0, 0.5, 0.0], &at(4.0));
        same(ring, lateral_force(&BASELINE, &[], &at(4.0 * share), &DESIGN));
    }
    let law = "constant shear on the touching time";
    let [unbroken, parted] = [0.01, 0.5].map(|um| {
        [1e-9, 1e-5].map(|time| force(&BASELINE, "adhesion", law, &[0.1, time], &moving(um)).abs())
    });
    same(unbroken[0], unbroken[1]);
    assert!(parted[1] < 0.99 * parted[0], "{parted:?}");
    // A finger that never leaves loads the plate all the time; a motor slows by a square of the load.
    let plain = |pass: &Condition| lateral_force(&BASELINE, &[], pass, &DESIGN);
    let in_touch = "impedance by the share of the cycle in touch";
    same(force(&BASELINE, "amplitude_droop", in_touch, &[0.25, 1.7], &moving(0.05)), plain(&moving(0.04)));
    let slower =
        |speed_m_s| Condition { speed_m_s, normal_force_n: 2.0 * DESIGN.reference_load_n, ..moving(1.0) };
    let dragged = force(&BASELINE, "speed_error", "constant", &[-0.002, 2.0], &slower(0.02));
    same(dragged, plain(&slower(0.02 - 4.0 * 0.002)));
    // Half of the menisci are there at the onset, and all of them in wet air.
    let humid = |percent| Condition { relative_humidity_pct: Some(percent), ..moving(1.0) };
    let dmt = |newtons: f64| force(&BASELINE, "adhesion", "DMT", &[newtons, 0.0, 0.0, 0.0], &moving(1.0));
    for (percent, share) in [(50.0, 0.5), (500.0, 1.0)] {
        same(force(&BASELINE, "adhesion", "menisci", &[0.1, 50.0, 4.0], &humid(percent)), dmt(0.1 * share));
    }
    // A lever arm as long as the stroke doubles a cross-talk at its end; at twice the reference load half as
    // much comes on top, and at the end of the table a quarter.
    let mean = DESIGN.reference_load_n;
    let still = |position_m, normal_force_n| Condition { position_m, normal_force_n, ..moving(0.0) };
    let read = |pass: &Condition| {
        force(&BASELINE, "force_crosstalk", "normal into lateral", &[0.02, 1.0, 0.5, 0.25], pass)
            - lateral_force(&BASELINE, &[], pass, &DESIGN)
    };
    let late = Condition { time_s: DESIGN.duration_s, ..still(0.0, mean) };
    for (pass, crosstalk) in
        [(still(0.0, mean), 0.02), (still(0.03, mean), 0.04), (still(0.0, 2.0 * mean), 0.03), (late, 0.025)]
    {
        same(read(&pass), crosstalk * pass.normal_force_n);
    }
}
