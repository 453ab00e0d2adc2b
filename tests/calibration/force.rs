//! Force: withheld gains, cross-talk, offsets, load errors and directions are recovered as stated.

use crate::bench::{AVERAGE_S, Coverage, ForceBench, PERIOD_S, seed, trials};
use calibration::certificate::{Certificate, CertificateKind, Circumstances, Instrument, Occasion, RawData};
use calibration::force::apply::ForceCalibration;
use calibration::force::matrix::{ForceError, Linearity, Options, Term, fit};
use calibration::force::series::{LoadReading, Weighing};
use calibration::force::zero::Zero;
use calibration::force::{AXES, Axis};
use calibration::uncertainty::student::coverage_factor;
use nalgebra::DMatrix;

pub fn occasion() -> Occasion {
    Occasion {
        unix_s: 1_800_000_000,
        operator: "A. Operator".into(),
        instrument: Instrument { name: "two-axis force sensor".into(), serial: "F-0017".into() },
        raw_data: RawData::of("series.csv", b"the bytes", 50),
        valid_days: 90.0,
    }
}

pub fn at(kind: CertificateKind, serial: &str) -> Circumstances<'_> {
    Circumstances { kind, serial, now_unix_s: 1_800_000_000 + 86_400, temperature_c: Some(22.0) }
}

/// Cramer-Rao bound of the gains from what the world's noise truly is: white noise, its rounding, and an
/// Ornstein-Uhlenbeck wander averaged over each reading, in the smallest model that holds the truth.
fn cramer_rao(readings: &[LoadReading], bench: &ForceBench, channel: usize) -> DMatrix<f64> {
    let c = &bench.config;
    let n = AVERAGE_S / PERIOD_S;
    let tau = c.wander_time_s;
    let x = AVERAGE_S / tau;
    let per_count = |v: f64| v / (c.count_n * c.count_n);
    let wander = per_count(c.wander_sd_n[channel].powi(2));
    let white = per_count(c.white_sd_n[channel].powi(2)) + 1.0 / 12.0;
    let own = wander * 2.0 / x * (1.0 - (1.0 - (-x).exp()) / x) + white / n;
    let shape = ((x / 2.0).sinh() / (x / 2.0)).powi(2);
    let covariance = DMatrix::from_fn(readings.len(), readings.len(), |i, j| {
        if i == j {
            own
        } else {
            wander * shape * (-(readings[i].time_s - readings[j].time_s).abs() / tau).exp()
        }
    });
    let design = DMatrix::from_fn(readings.len(), 3, |i, k| match k {
        0 => 1.0,
        _ => {
            if readings[i].axis == Some(AXES[k - 1]) {
                readings[i].load_n
            } else {
                0.0
            }
        }
    });
    // (X' V^-1 X)^-1 of generalised least squares.
    let whitened = covariance.cholesky().unwrap().solve(&design);
    (design.transpose() * whitened).try_inverse().unwrap()
}

#[test]
fn gains_and_cross_talk_are_covered_as_stated() {
    let weighing = Weighing::default();
    let mut gains: [Coverage; 4] = Default::default();
    let mut applied: [Coverage; 2] = Default::default();
    let mut refused = 0;
    for trial in 0..trials() {
        let mut bench = ForceBench::new(seed(trial), &weighing);
        let readings = bench.series();
        let found = match fit(&readings, &weighing, &Options::default()) {
            Ok(found) => found,
            Err(error) => {
                println!("trial {trial} refused: {error}");
                refused += 1;
                continue;
            }
        };
        let outcome = found.outcome(&weighing);
        let truth = bench.true_gain();
        for channel in AXES {
            let bound = cramer_rao(&readings, &bench, channel as usize);
            for axis in AXES {
                let k = found.index(channel, Term::Gain(axis)).unwrap();
                let (i, j) = (channel as usize, axis as usize);
                let half = coverage_factor(0.95, found.degrees_of_freedom) * found.type_a[(k, k)].sqrt();
                let sd = bound[(j + 1, j + 1)].sqrt();
                gains[2 * i + j].add_with_bound(outcome.parameters[k].ci95, truth[i][j], half, sd);
            }
        }
        // Through the file and the gate into the loop: a force that was not in the series.
        let text = outcome.certify(&occasion()).to_toml();
        let certificate = Certificate::from_toml(&text).unwrap();
        let verified = certificate.verify(&at(CertificateKind::Force, "F-0017")).unwrap();
        let calibration = ForceCalibration::compile(verified, Some(22.0)).unwrap();
        let row_sd: Vec<f64> = (0..2).map(|a| found.scatter[(a, a)].sqrt()).collect();
        let (zero_counts, time_s, _) = bench.read(0.0, 0.0);
        let zero = Zero { counts: zero_counts, standard_uncertainty: [row_sd[0], row_sd[1]], time_s };
        let force = [0.37, 0.81];
        let (counts, _, _) = bench.read(force[0], force[1]);
        let got = calibration.apply(counts, &zero);
        let sd = calibration.standard_uncertainty(got, &zero);
        // The reading itself scatters as the zero does.
        let inverse = calibration.apply([zero.counts[0] + row_sd[0], zero.counts[1] + row_sd[1]], &zero);
        for a in 0..2 {
            let half = coverage_factor(0.95, found.degrees_of_freedom) * sd[a].hypot(inverse[a]);
            applied[a].add([got[a] - half, got[a] + half], force[a]);
        }
    }
    println!("refused: {refused} of {}", trials());
    assert!(50 * refused <= trials(), "at most 2 % of good series may be refused");
    for (k, name) in ["lateral on lateral", "normal on lateral", "lateral on normal", "normal on normal"]
        .iter()
        .enumerate()
    {
        gains[k].judge(&format!("gain, {name}"));
    }
    applied[0].judge("applied lateral force");
    applied[1].judge("applied normal force");
}

#[test]
fn bad_series_are_refused_with_the_reason() {
    let weighing = Weighing::default();
    let series = || ForceBench::new(seed(0), &weighing).series();
    let refuse = |rows: Vec<LoadReading>, options: &Options| fit(&rows, &weighing, options).unwrap_err();
    let plain = Options::default();

    let few: Vec<_> = series().into_iter().filter(|r| r.axis.is_none() || r.load_n.abs() > 0.9).collect();
    let few: Vec<_> = few.into_iter().filter(|r| r.load_n >= 0.0).collect();
    let error = refuse(few, &plain);
    assert_eq!(error, ForceError::TooFewLoads { axis: Axis::Lateral, found: 2, needed: 3 });

    let no_zeros: Vec<_> = series().into_iter().filter(|r| r.axis.is_some()).collect();
    assert_eq!(refuse(no_zeros, &plain), ForceError::TooFewZeros { found: 0 });

    let mut swapped = series();
    swapped.iter_mut().for_each(|r| r.counts.swap(0, 1));
    assert_eq!(refuse(swapped, &plain), ForceError::SwappedAxes);

    let mut drifting = series();
    drifting.iter_mut().for_each(|r| r.counts[1] += 0.8 * r.time_s);
    let error = refuse(drifting, &plain);
    assert!(matches!(error, ForceError::DriftingZero { axis: Axis::Normal, .. }), "{error}");

    let mut silent = series();
    silent.iter_mut().for_each(|r| r.counts[1] = r.counts[1].min(14_000.0));
    let error = refuse(silent, &plain);
    assert!(matches!(error, ForceError::Saturated { axis: Axis::Normal, .. }), "{error}");

    // The sensor itself says so when it is driven over its range.
    let mut bench = ForceBench::new(seed(0), &weighing);
    let mut over = bench.series();
    over.push(bench.load(Some(Axis::Normal), 4.0, None));
    assert!(matches!(refuse(over, &plain), ForceError::Saturated { .. }));

    let mut bent = series();
    for r in &mut bent {
        if r.axis == Some(Axis::Normal) {
            r.counts[1] *= 1.0 - 0.01 * r.load_n;
        }
    }
    let error = refuse(bent.clone(), &plain);
    assert!(matches!(error, ForceError::LackOfFit { axis: Axis::Normal, .. }), "{error}");
    let quadratic = Options { linearity: Linearity::Quadratic, ..plain };
    assert!(fit(&bent, &weighing, &quadratic).is_ok());

    let mut wandering = series();
    for (i, r) in wandering.iter_mut().enumerate() {
        r.counts[0] += 30.0 * (i as f64 * 0.35).sin();
    }
    let error = refuse(wandering, &plain);
    assert!(matches!(error, ForceError::Correlated { axis: Axis::Lateral, .. }), "{error}");
}
