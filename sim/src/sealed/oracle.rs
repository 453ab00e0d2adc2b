//! What the generator knows of a set that no diagnoser can know: from its noise-free forces, how large the
//! gap is once the baseline is recalibrated, and how strongly the data speak for the truth.
//!
//! The baseline here is this world's own ideal contact. Recalibration means: stiffnesses and mu0 refitted,
//! the stiffnesses under their stated scatter, by Gauss-Newton steps on their logarithms.

use crate::defects::{Defect, Defects};
use crate::finger::VirtualFinger;
use crate::world::{Point, steady_forces};

/// Nuisances: ln of k_n, k_l, mu0.
pub(super) const NUISANCES: usize = 3;
/// The nuisances' shifts.
pub(super) type Theta = [f64; NUISANCES];
/// Derivatives of a model by each of them, in standard deviations.
pub(super) type Jacobian = [Vec<f64>; NUISANCES];

/// The question put to the oracle.
pub struct Case<'a> {
    /// Points as the diagnoser knows them: the normal force is the measured one, without its noise.
    pub known: &'a [Point],
    /// Noise-free lateral forces, sensor's frame (N).
    pub lateral_n: &'a [f64],
    /// Standard deviation of each (N).
    pub sd_n: &'a [f64],
    /// The nominal fingertip.
    pub nominal: VirtualFinger,
    /// Stated relative scatter of its stiffnesses.
    pub stiffness_sd: f64,
    /// Causes that act in every model, the recalibrated baseline too.
    pub beside: &'a [Defect],
    /// Place among them at which a model's own causes act.
    pub place: usize,
}

/// A fitted model: its chi2 (priors included), its fingertip, its residuals (N).
#[derive(Clone)]
pub struct ImitationFit {
    /// Sum of squares in standard deviations, priors included.
    pub chi2: f64,
    /// The refitted fingertip.
    pub finger: VirtualFinger,
    /// Data less model (N).
    pub residual_n: Vec<f64>,
}

/// A fingertip whose nuisances are moved by these logarithms.
pub(super) fn moved(finger: &VirtualFinger, theta: Theta) -> VirtualFinger {
    let mut out = *finger;
    out.normal_stiffness_n_per_m *= theta[0].exp();
    out.lateral_stiffness_n_per_m *= theta[1].exp();
    out.mu0 *= theta[2].exp();
    out
}

impl Case<'_> {
    /// Lateral forces of a model, at the true normal forces that would have shown as the measured ones.
    pub(super) fn predict(&self, finger: &VirtualFinger, own: &Defects) -> Vec<f64> {
        let mut defects = own.clone();
        let (before, after) = self.beside.split_at(self.place);
        defects.defects.splice(0..0, before.iter().copied());
        defects.defects.extend_from_slice(after);
        let defects = &defects;
        let one = |known: &Point| {
            let mut point = *known;
            let mut forces = steady_forces(finger, defects, &point);
            for _ in 0..4 {
                let miss = forces.normal_n - known.at.normal_force_n;
                if miss.abs() < 1e-7 {
                    break;
                }
                point.at.normal_force_n = (point.at.normal_force_n - miss).max(1e-4);
                forces = steady_forces(finger, defects, &point);
            }
            forces.lateral_n
        };
        self.known.iter().map(one).collect()
    }

    pub(super) fn chi2(&self, model: &[f64], theta: Theta) -> f64 {
        self.standardised(model).into_iter().map(|z| z.powi(2)).sum::<f64>() + self.prior(theta)
    }

    /// What the stiffnesses' shifts cost.
    pub(super) fn prior(&self, theta: Theta) -> f64 {
        (theta[0] / self.stiffness_sd).powi(2) + (theta[1] / self.stiffness_sd).powi(2)
    }

    /// Logarithms of a fingertip's nuisances over the nominal ones.
    pub(super) fn logarithms(&self, finger: &VirtualFinger) -> Theta {
        [
            (finger.normal_stiffness_n_per_m / self.nominal.normal_stiffness_n_per_m).ln(),
            (finger.lateral_stiffness_n_per_m / self.nominal.lateral_stiffness_n_per_m).ln(),
            (finger.mu0 / self.nominal.mu0).ln(),
        ]
    }

    /// The best a model can do with the nuisances refitted from the nominal fingertip.
    pub fn fit(&self, defects: &Defects, iterations: usize) -> ImitationFit {
        self.fit_from(&self.nominal, defects, iterations)
    }

    /// The same from another start.
    pub fn fit_from(&self, start: &VirtualFinger, defects: &Defects, iterations: usize) -> ImitationFit {
        let mut theta = self.logarithms(start);
        let mut model = self.predict(&moved(&self.nominal, theta), defects);
        let mut chi2 = self.chi2(&model, theta);
        for _ in 0..iterations {
            let jacobian = self.jacobian(theta, defects, &model);
            let Some(step) = self.gauss_newton(&jacobian, &model, theta) else { break };
            let mut scale = step.iter().fold(1.0_f64, |s, x| s.min(0.4 / x.abs().max(1e-12)));
            let mut better = false;
            for _ in 0..6 {
                let mut next = theta;
                for (value, change) in next.iter_mut().zip(step) {
                    *value += scale * change;
                }
                let trial = self.predict(&moved(&self.nominal, next), defects);
                let trial_chi2 = self.chi2(&trial, next);
                if trial_chi2 < chi2 {
                    better = chi2 - trial_chi2 > 1e-3;
                    (theta, model, chi2) = (next, trial, trial_chi2);
                    break;
                }
                scale *= 0.3;
            }
            if !better {
                break;
            }
        }
        let residual_n = self.lateral_n.iter().zip(&model).map(|(y, m)| y - m).collect();
        ImitationFit { chi2, finger: moved(&self.nominal, theta), residual_n }
    }

    pub(super) fn jacobian(&self, theta: Theta, defects: &Defects, model: &[f64]) -> Jacobian {
        std::array::from_fn(|k| {
            let mut up = theta;
            up[k] += 1e-3;
            let shifted = self.predict(&moved(&self.nominal, up), defects);
            shifted.iter().zip(model).zip(self.sd_n).map(|((a, b), sd)| (a - b) / 1e-3 / sd).collect()
        })
    }

    fn gauss_newton(&self, jacobian: &Jacobian, model: &[f64], theta: Theta) -> Option<Theta> {
        let weight = self.stiffness_sd.powi(-2);
        let mut a = [[0.0; NUISANCES]; NUISANCES];
        let mut b = [0.0; NUISANCES];
        for i in 0..NUISANCES {
            for j in 0..NUISANCES {
                a[i][j] = jacobian[i].iter().zip(&jacobian[j]).map(|(x, y)| x * y).sum();
            }
            let pull: f64 = jacobian[i]
                .iter()
                .zip(self.lateral_n.iter().zip(model).zip(self.sd_n))
                .map(|(x, ((y, m), sd))| x * (y - m) / sd)
                .sum();
            b[i] = pull - if i < 2 { weight * theta[i] } else { 0.0 };
            a[i][i] = a[i][i] * (1.0 + 1e-9) + if i < 2 { weight } else { 1e-9 };
        }
        solve(&mut a, b, NUISANCES)
    }

    /// chi2 left by a model with the nuisances refitted to first order.
    pub(super) fn left(&self, jacobian: &Jacobian, model: &[f64], theta: Theta) -> f64 {
        let Some(step) = self.gauss_newton(jacobian, model, theta) else { return self.chi2(model, theta) };
        let residual = self.standardised(model).into_iter().enumerate().map(|(i, z)| {
            let shift: f64 = (0..NUISANCES).map(|k| jacobian[k][i] * step[k]).sum();
            (z - shift).powi(2)
        });
        let prior: f64 = (0..2).map(|k| ((theta[k] + step[k]) / self.stiffness_sd).powi(2)).sum();
        residual.sum::<f64>() + prior
    }
}

/// Solves a small symmetric positive system of the first `n` unknowns by elimination; `None` where it is singular.
pub(super) fn solve<const N: usize>(a: &mut [[f64; N]; N], mut b: [f64; N], n: usize) -> Option<[f64; N]> {
    for i in 0..n {
        if a[i][i].abs() < 1e-30 || !a[i][i].is_finite() {
            return None;
        }
        for j in i + 1..n {
            let factor = a[j][i] / a[i][i];
            let upper = a[i];
            for (below, above) in a[j].iter_mut().zip(upper).skip(i) {
                *below -= factor * above;
            }
            b[j] -= factor * b[i];
        }
    }
    for i in (0..n).rev() {
        for k in i + 1..n {
            b[i] -= a[i][k] * b[k];
        }
        b[i] /= a[i][i];
    }
    Some(b)
}
