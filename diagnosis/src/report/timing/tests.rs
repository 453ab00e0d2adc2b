//! The estimator against closed forms and against another program's fit, without the virtual rig.

use super::fit::TimingRegression;
use super::response::Prepared;
use super::*;
use crate::random::deviate;
use models::prediction::{Prediction, Regime, Validity};
use models::{OutOfDomain, PeakToPeak};

/// A law that is straight in the amplitude: an edge of the amplitude is one of friction.
struct Straight;

impl FrictionModel for Straight {
    fn name(&self) -> &str {
        "straight"
    }

    fn predict(&self, c: &Condition) -> Result<Prediction, OutOfDomain> {
        let mu_relative = 1.0 - c.amplitude.metres() / 4e-6;
        let lateral_force_n = mu_relative * c.mu0 * c.normal_force_n;
        let (regime, validity) = (Regime::Intermittent, Validity::Inside);
        Ok(Prediction { mu_relative, mu_relative_sd: 0.0, lateral_force_n, regime, validity })
    }
}

/// Friction falls from 0.2 to 0.1 N in the middle of a step of the simulation, and the channel shows
/// `share` of it.
fn edge(times: impl Iterator<Item = f64>, mut force: impl FnMut(f64) -> f64) -> Edge {
    let end = 0.2;
    Edge {
        against: Against::Amplitude,
        condition: Condition { amplitude: PeakToPeak::ZERO, ..Condition::paper() },
        lateral: times.map(|t| (t, force(t))).collect(),
        amplitude: vec![(-0.1, 0.0), (-2.5e-4, 0.0), (0.0, 2e-6), (end, 2e-6)],
        velocity: vec![(-0.1, 0.02), (end, 0.02)],
    }
}

/// Response of a first-order lag to a unit step.
fn response(t: f64, late_s: f64) -> f64 {
    // The amplitude reaches its end over a step of 0.25 ms: its middle is the instant.
    let t = t + 1.25e-4;
    if t < 0.0 { 0.0 } else { 1.0 - (-t / late_s).exp() }
}

fn milliseconds() -> impl Iterator<Item = f64> {
    (-40..200).map(|i| f64::from(i) * 1e-3)
}

/// `scipy.optimize.curve_fit` (1.17.1) fits `a + b s(t, tau) + c t` to these 240 numbers so: tau in s, and
/// its sd.
const SCIPY: [f64; 2] = [8.113_918_89e-3, 1.409_2e-4];

#[test]
fn one_edge_is_fitted_as_scipy_fits_it() {
    let mut i = 0.0f64;
    let one = edge(milliseconds(), |t| {
        let noise = 2e-3 * 2f64.sqrt() * (i * i).sin();
        i += 1.0;
        0.2 - 0.1 * response(t, 8e-3) + noise
    });
    let edges = [Prepared::of(&one, &Straight).unwrap()];
    let fit = TimingRegression { edges: &edges, stated_s: 0.0 }.fit(ResponseForm::FirstOrder, false);
    println!("{fit:?}");
    assert!((fit.late_s - SCIPY[0]).abs() < 0.05 * SCIPY[1], "{fit:?}");
    let white = fit.sd_s * fit.counts.sqrt();
    assert!((white / SCIPY[1] - 1.0).abs() < 0.05, "{white}");
}

/// The bound of Cramer and Rao for the time constant of a first-order lag in white noise of known size,
/// with level, size and drift free in each edge: the estimator reaches it, and states it.
#[test]
fn the_scatter_of_the_estimate_is_the_cramer_rao_bound() {
    const NOISE_N: f64 = 2e-3;
    for late_s in [5e-3f64, 30e-3] {
        // Information of one edge: the slope 0.1 ds/dtau, less what the three free columns take of it.
        let times: Vec<f64> = milliseconds().collect();
        let late = |t: f64| (t + 1.25e-4).max(0.0);
        let slope =
            times.iter().map(|t| 0.1 * late(*t) / late_s.powi(2) * (-late(*t) / late_s).exp()).collect();
        let shape = times.iter().map(|t| response(*t, late_s)).collect();
        let free = nalgebra::DMatrix::from_columns(&[
            nalgebra::DVector::from_element(times.len(), 1.0),
            nalgebra::DVector::from_vec(shape),
            nalgebra::DVector::from_vec(times),
        ]);
        let slope = nalgebra::DVector::from_vec(slope);
        let taken = free.clone().svd(true, true).solve(&slope, 1e-12).unwrap();
        let (edges_of_a_run, runs) = (12, 60);
        let bound = NOISE_N / ((slope - free * taken).norm() * f64::from(edges_of_a_run).sqrt());
        let mut state = 7;
        let fits: Vec<ResponseFit> = (0..runs)
            .map(|_| {
                let one = |_| {
                    edge(milliseconds(), |t| 0.2 - 0.1 * response(t, late_s) + NOISE_N * deviate(&mut state))
                };
                let edges: Vec<Edge> = (0..edges_of_a_run).map(one).collect();
                let edges: Vec<Prepared> = edges.iter().filter_map(|e| Prepared::of(e, &Straight)).collect();
                TimingRegression { edges: &edges, stated_s: 0.0 }.fit(ResponseForm::FirstOrder, false)
            })
            .collect();
        let n = fits.len() as f64;
        let mean = fits.iter().map(|f| f.late_s).sum::<f64>() / n;
        let scatter = (fits.iter().map(|f| (f.late_s - late_s).powi(2)).sum::<f64>() / n).sqrt();
        let stated = fits.iter().map(|f| f.sd_s).sum::<f64>() / n;
        println!("{late_s}: mean {mean:.6}, scatter {scatter:.2e}, stated {stated:.2e}, bound {bound:.2e}");
        // 60 runs know a scatter to 9 %: three of these either way.
        assert!((0.73..1.27).contains(&(scatter / bound)), "{late_s}: {scatter} {bound}");
        assert!((0.95..1.25).contains(&(stated / bound)), "{late_s}: {stated} {bound}");
    }
}

/// A shift of the whole signal in time, far from the starts of the search, as sharp as the edge itself.
#[test]
fn a_long_delay_of_a_sharp_edge_is_found() {
    for late_s in [0.0113, 0.06, 0.0975] {
        let mut state = 3;
        let mut one = |_| {
            let shown = |t: f64| if t + 1.25e-4 < late_s { 0.2 } else { 0.1 };
            edge(milliseconds(), |t| shown(t) + 2e-3 * deviate(&mut state))
        };
        let edges: Vec<Edge> = (0..6).map(&mut one).collect();
        let found = judge(&edges, &Straight, None).comparisons.remove(0);
        let [low, high] = found.ci95_s.unwrap();
        // Samples come every millisecond: between two of them a sharp step has no instant.
        assert!(low - 5e-4 < late_s && late_s < high + 5e-4, "{found:?}");
        assert_eq!(found.causes, ["time_misalignment"], "{found:?}");
    }
}

/// The odds against a numerical integral of the normal estimate over the prior.
#[test]
fn odds_are_those_of_the_integral_over_the_prior() {
    for (late_s, sd_s) in [(3e-3, 2e-4), (-0.012, 1e-3), (0.06, 1.5e-4), (1e-3, 1.5e-4)] {
        let prior = |t: f64| {
            let z = (t.abs() / 0.01).ln();
            (-0.5 * z * z).exp() / (2.0 * t.abs() * (2.0 * std::f64::consts::PI).sqrt())
        };
        let step = sd_s / 200.0;
        let ratio: f64 = (-1600..=1600)
            .map(|i| late_s + f64::from(i) * step)
            .map(|t| {
                prior(t)
                    * (0.5 * (late_s / sd_s).powi(2) - 0.5 * ((late_s - t) / sd_s).powi(2) - 300.0).exp()
                    * step
            })
            .sum();
        let integral = ratio.ln() + 300.0;
        let odds = log_odds(late_s, sd_s);
        assert!(
            (integral.is_infinite() && odds > 600.0) || (odds - integral).abs() < 0.1,
            "{odds} {integral}"
        );
    }
}

#[test]
fn a_record_without_edges_says_so_and_claims_nothing() {
    let part = judge(&[], &Straight, None);
    for c in &part.comparisons {
        assert_eq!((c.edges, c.late_s, c.ci95_s, c.log10_odds_vs_none), (0, None, None, None));
        assert!(c.because.as_ref().is_some_and(|why| why.contains("edges = 3")), "{c:?}");
    }
}
