//! The intervals of the finger's certificate stay within what a stiffness, a loss, a modulus or a time can
//! be, and still hold the truth as often as they say.

use muprime_calibration::certificate::{Certificate, Instrument, Occasion, Parameter, RawData, Refusal};
use muprime_calibration::finger::FingerFit;
use muprime_calibration::finger::friction::{FrictionPoint, friction};
use muprime_calibration::finger::stiffness::{UltrasonicPoint, ultrasonic};
use muprime_calibration::identify::Identified;
use muprime_calibration::identify::skin::{IdentifiedSkin, ProfileInterval};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

const TRIALS: u64 = 400;

fn normal(draw: &mut ChaCha12Rng) -> f64 {
    let (a, b): (f64, f64) = (draw.random(), draw.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (2.0 * std::f64::consts::PI * b).cos()
}

fn certified(fit: &FingerFit) -> Certificate {
    fit.outcome().certify(&Occasion {
        unix_s: 1_700_000_000,
        operator: "O".into(),
        instrument: Instrument { name: String::new(), serial: "index".into() },
        raw_data: RawData::of("data", b"", 0),
        valid_days: 1.0,
    })
}

fn parameter<'a>(certificate: &'a Certificate, name: &str) -> &'a Parameter {
    certificate.parameter(name).unwrap_or_else(|| panic!("{name}: {:?}", certificate.parameters))
}

/// Stiffness and loss of an ultrasonic measurement with this much noise, four amplitudes.
fn measured(stiffness: f64, loss_tangent: f64, noise_n: f64, draw: &mut ChaCha12Rng) -> Option<FingerFit> {
    let points: Vec<UltrasonicPoint> = (1..=4)
        .map(|i| {
            let amplitude_m = f64::from(i) * 1e-8;
            UltrasonicPoint {
                amplitude_m,
                in_phase_n: stiffness * amplitude_m + noise_n * normal(draw),
                quadrature_n: loss_tangent * stiffness * amplitude_m + noise_n * normal(draw),
            }
        })
        .collect();
    let found = ultrasonic(&points, f64::INFINITY, 0.0).ok()?;
    Some(FingerFit { stiffness: vec![("normal_ultrasonic".into(), found)], ..FingerFit::default() })
}

/// Two-sided binomial test of 95 % at 0.001 with 400 trials: 366 to 393.
fn as_stated(what: &str, covered: u64, trials: u64) {
    println!("{what}: {:.1} % of {trials}", 100.0 * covered as f64 / trials as f64);
    let (mean, sd) = (0.95 * trials as f64, (0.95 * 0.05 * trials as f64).sqrt());
    assert!((covered as f64 - mean).abs() <= 3.29 * sd, "{what}: {covered} of {trials}");
}

#[test]
fn a_stiffness_and_a_loss_near_zero_have_intervals_that_begin_there() {
    let (stiffness, mut cut, mut refused) = (3.9e6, [0u64; 2], 0u64);
    let mut covered = [0u64; 2];
    for trial in 0..TRIALS {
        let mut draw = ChaCha12Rng::seed_from_u64(trial);
        // No loss at all; the noise is 40 % of the smallest force: the symmetric interval of the loss is half
        // below zero. A measurement that is refused covers nothing.
        let Some(fit) = measured(stiffness, 0.0, 0.4 * stiffness * 1e-8, &mut draw) else {
            refused += 1;
            continue;
        };
        let certificate = certified(&fit);
        certificate.verify_content().expect("sound");
        for (k, (name, truth)) in
            [("normal_ultrasonic.stiffness", stiffness), ("normal_ultrasonic.loss_tangent", 0.0)]
                .into_iter()
                .enumerate()
        {
            let p = parameter(&certificate, name);
            assert!(p.ci95[0] >= 0.0 && p.ci95[0] <= p.value.max(0.0) && p.value <= p.ci95[1], "{p:?}");
            covered[k] += u64::from(p.ci95[0] <= truth && truth <= p.ci95[1]);
            cut[k] += u64::from(p.ci95[0] == 0.0);
            let told =
                certificate.remarks.iter().any(|r| r.starts_with(name) && r.contains("upper bound only"));
            assert_eq!(told, p.ci95[0] == 0.0, "{:?}", certificate.remarks);
        }
    }
    // With no loss the symmetric interval goes below zero nearly always: the case is what it is meant to be.
    assert!(cut[1] > TRIALS / 2, "{cut:?}");
    println!("{refused} of {TRIALS} refused: negative loss beyond its scatter");
    // What is refused for its loss says nothing of the stiffness.
    as_stated("stiffness", covered[0], TRIALS - refused);
    as_stated("loss tangent", covered[1], TRIALS);
}

#[test]
fn the_stratum_corneum_keeps_the_ends_of_its_profiles() {
    let profile = |best, ci95| ProfileInterval { best, ci95, closed: [true; 2], gaps: false };
    let elastic = Identified {
        young_modulus_pa: 28e6,
        ci95_pa: [21e6, 90e6],
        closed: [true; 2],
        objective_deg2: 60.0,
        residual_deg: [3.0, 6.0],
        chi2: 7.0,
        points: 7,
        typical_sd_deg: 3.0,
        sd_estimated: false,
        cannot_tell: Vec::new(),
    };
    // Skewed far enough that value - 2 u lies below zero for each of the three.
    let skin = IdentifiedSkin {
        young_modulus_pa: profile(12e6, [9e6, 60e6]),
        penalty_ratio: profile(0.8, [0.5, 5.0]),
        retardation_time_s: profile(2e-6, [4e-7, 3e-5]),
        chi2: 5.0,
        chi2_elastic: 40.0,
        objective_deg2: 40.0,
        correlation: [0.0; 3],
        cannot_tell: Vec::new(),
    };
    let fit = FingerFit { modulus: Some(elastic), skin: Some(skin.clone()), ..FingerFit::default() };
    let certificate = Certificate::from_toml(&certified(&fit).to_toml()).expect("read back");
    certificate.verify_content().expect("sound");
    for (name, profile) in [
        ("stratum_corneum.young_modulus", skin.young_modulus_pa),
        ("stratum_corneum.penalty_ratio", skin.penalty_ratio),
        ("stratum_corneum.retardation_time", skin.retardation_time_s),
    ] {
        let p = parameter(&certificate, name);
        assert_eq!(p.ci95, profile.ci95, "{name}");
        assert!(
            p.value - 1.96 * p.standard_uncertainty < 0.0,
            "{name}: the symmetric interval would fail here"
        );
    }
}

#[test]
fn friction_that_decays_with_time_keeps_its_growth_above_minus_one() {
    let mut draw = ChaCha12Rng::seed_from_u64(7);
    let points: Vec<FrictionPoint> = (0..36)
        .map(|i| {
            let pick = |of: [f64; 3], k: usize| of[(i / k) % 3];
            let (load, speed, time) =
                (pick([0.1, 0.3, 1.0], 1), pick([0.01, 0.03, 0.1], 3), pick([0.5, 5.0, 60.0], 9));
            let mu = 0.5 * (1.0 - 0.9 * (1.0 - f64::exp(-time / 4.0))) * (0.3 * normal(&mut draw)).exp();
            FrictionPoint {
                normal_force_n: load,
                speed_m_s: speed,
                lateral_force_n: mu * load,
                contact_time_s: Some(time),
            }
        })
        .collect();
    let fit = FingerFit { friction: Some(friction(&points).unwrap()), ..FingerFit::default() };
    let certificate = certified(&fit);
    certificate.verify_content().expect("sound");
    let growth = parameter(&certificate, "friction.growth");
    assert!(growth.ci95[0] >= -1.0 && growth.ci95[0] < -0.9, "{growth:?}");
    let remark = &certificate.remarks[0];
    assert!(remark.contains("95 %"), "{remark}");
}

#[test]
fn an_interval_that_does_not_hold_its_value_is_refused() {
    let mut draw = ChaCha12Rng::seed_from_u64(1);
    let mut certificate = certified(&measured(3.9e6, 0.1, 1e-4, &mut draw).unwrap());
    certificate.parameters[0].ci95 = [1e6, 2e6];
    let refused = certificate.seal().verify_content().unwrap_err();
    assert!(
        matches!(&refused, Refusal::Malformed { reason } if reason.contains("does not hold its value")),
        "{refused}"
    );
}
