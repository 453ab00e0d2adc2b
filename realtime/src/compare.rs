//! Measurement against prediction, pass by pass, and the test that says when the model is rejected.
//!
//! What a pass tells is a force, so forces are compared, never ratios of noisy numbers. `mu_0` and the two
//! stiffnesses are known only within their calibration; every pass of a run shares their error. Left alone
//! that would make residuals agree with each other and look like a departure. So a small Kalman filter
//! carries those three numbers under their priors: its innovations are independent and of unit variance as
//! long as model, calibration and noise are what they claim to be, and only then.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

mod agreement;
mod sequential;

use crate::estimate::Mu0;
use agreement::Power;
pub use agreement::{Agreement, ENOUGH_PASSES, Lack, VISIBLE_DEPARTURE};
use models::prediction::{FrictionModel, Validity};
use models::{Condition, OutOfDomain, PassNoise};
pub use sequential::{ALARM_LEVEL, Sequential};
use sequential::{CAP, pulls};
use serde::{Deserialize, Serialize};

/// A pass compared with the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PassComparison {
    /// Measured `mu'`, with the `mu_0` known so far; `None` while none is known.
    pub mu_relative: Option<f64>,
    /// Standard uncertainty of the measured `mu'`.
    pub mu_relative_sd: Option<f64>,
    /// Predicted `mu'` at the measured condition with the nominal parameters.
    pub predicted: f64,
    /// Predictive standard uncertainty of `mu'`: parameters, law and `mu_0`.
    pub predicted_sd: f64,
    /// Residual in standard deviations, independent of earlier passes under the null hypothesis.
    pub z: f64,
    /// Natural logarithm of the evidence against the model so far (an e-process).
    pub log_evidence: f64,
    /// Whether the measurement disagrees with the model.
    pub departed: bool,
    /// Inside the law's range or not.
    pub validity: Validity,
    /// Passes with vibration that were judged so far, this one included.
    #[serde(default)]
    pub judged: u32,
    /// Root mean square of their residuals in standard deviations; none before the first.
    pub rms_z: Option<f64>,
    /// Departure of `mu'`, the same in all of them, that would have been seen by now with a probability of 90 %.
    pub visible_departure: Option<f64>,
}

/// Carries what passes have in common from one to the next.
#[derive(Clone, Copy, Debug)]
pub struct Comparator {
    /// `mu_0`, and logarithmic deviations of the model's two parameters.
    estimate: [f64; 3],
    covariance: [[f64; 3]; 3],
    noise: PassNoise,
    test: Sequential,
    power: Power,
}

/// Relative width of the prior on `mu_0` before the first pass without vibration.
const MU0_PRIOR_RELATIVE_SD: f64 = 1.0;

impl Comparator {
    /// Before the first pass. `mu0` is what the fingertip library says; it only needs the right order.
    pub fn new(model: &dyn FrictionModel, mu0: f64, noise: PassNoise) -> Self {
        let [first, second] = model.parameter_relative_sd();
        let mut covariance = [[0.0; 3]; 3];
        covariance[0][0] = (mu0 * MU0_PRIOR_RELATIVE_SD).powi(2);
        covariance[1][1] = first * first;
        covariance[2][2] = second * second;
        let (test, power) = Default::default();
        Comparator { estimate: [mu0, 0.0, 0.0], covariance, noise, test, power }
    }

    /// `mu_0` as known now; `None` until a pass has measured it.
    pub fn mu0(&self) -> Option<Mu0> {
        let sd = self.covariance[0][0].sqrt();
        (sd < 0.2 * self.estimate[0]).then_some(Mu0 { value: self.estimate[0], sd })
    }

    /// Whether the measurement disagrees with the model.
    pub fn departed(&self) -> bool {
        self.test.alarmed()
    }

    /// Lateral force in the direction of sliding in N that the model expects with parameters `at`.
    fn force(model: &dyn FrictionModel, c: &Condition, at: &[f64; 3]) -> Result<f64, OutOfDomain> {
        let c = Condition { mu0: at[0].max(1e-6), ..*c };
        let mu = model.mu_relative_with(&c, [at[1], at[2]])?;
        Ok(mu * c.mu0 * c.normal_force_n)
    }

    /// Takes a pass: its measured condition (whose `mu0` is ignored) and mean friction force in N, positive
    /// along the sliding direction.
    ///
    /// # Errors
    /// A condition outside the model's domain, by name; the comparator is unchanged then.
    pub fn pass(
        &mut self,
        model: &dyn FrictionModel,
        condition: &Condition,
        friction_force_n: f64,
    ) -> Result<PassComparison, OutOfDomain> {
        let c = condition;
        let nominal = Condition { mu0: self.estimate[0].max(1e-6), ..*c };
        let prediction = model.predict(&nominal)?;
        let expected = Self::force(model, c, &self.estimate)?;
        let mut slope = [0.0; 3];
        for (i, slope) in slope.iter_mut().enumerate() {
            let step = if i == 0 { 1e-4 * self.estimate[0] } else { 1e-4 };
            let (mut up, mut down) = (self.estimate, self.estimate);
            up[i] += step;
            down[i] -= step;
            *slope = (Self::force(model, c, &up)? - Self::force(model, c, &down)?) / (2.0 * step);
        }
        let load_step = 1e-3 * c.normal_force_n;
        let loaded = |f: f64| Condition { normal_force_n: f, ..*c };
        let load_slope = (Self::force(model, &loaded(c.normal_force_n + load_step), &self.estimate)?
            - Self::force(model, &loaded(c.normal_force_n - load_step), &self.estimate)?)
            / (2.0 * load_step);

        let coulomb = self.estimate[0] * c.normal_force_n;
        let form = model.form_sd(&prediction) * coulomb;
        let noise = (self.noise.pass_relative_sd * expected).powi(2)
            + self.noise.force_sd_n.powi(2) * (1.0 + load_slope * load_slope)
            + form * form;
        let gain = self.covariance.map(|row| dot(&row, &slope));
        let shared = dot(&slope, &gain);
        let variance = shared + noise;
        let innovation = friction_force_n - expected;
        let z = innovation / variance.sqrt();

        // The first pass fixes mu_0; its innovation says nothing about the model.
        let known = self.mu0();
        if known.is_some() {
            self.test.push(z, c);
        }
        let vibrating = c.amplitude.metres() > 0.0;
        let unit = if vibrating { coulomb } else { 0.0 };
        let judged = known.map(|_| pulls(c));
        self.power.push(unit, &slope, &gain, variance, judged, judged.filter(|_| vibrating).map(|_| z));
        // What lies beyond the cap says nothing of the shared parameters: a filter that followed it would take
        // up in one pass what it is there to judge. The first word on mu_0 is taken whole.
        let taken = if known.is_some() { z.clamp(-CAP, CAP) * variance.sqrt() } else { innovation };
        for (estimate, gain) in self.estimate.iter_mut().zip(&gain) {
            *estimate += gain / variance * taken;
        }
        for (row, left) in self.covariance.iter_mut().zip(&gain) {
            for (cell, right) in row.iter_mut().zip(&gain) {
                *cell -= left * right / variance;
            }
        }

        let mu_relative = known.map(|m| friction_force_n / (m.value * c.normal_force_n));
        let sd_of = |(m, mu): (Mu0, f64)| self.noise.mu_relative_sd(mu, c.normal_force_n, [m.value, m.sd]);
        let mu_relative_sd = known.zip(mu_relative).map(sd_of);
        Ok(PassComparison {
            mu_relative,
            mu_relative_sd,
            predicted: prediction.mu_relative,
            predicted_sd: prediction.mu_relative_sd,
            z,
            log_evidence: self.test.log_evidence(),
            departed: self.test.alarmed(),
            validity: prediction.validity,
            judged: self.power.judged,
            rms_z: self.power.rms_z(),
            visible_departure: self.power.visible(),
        })
    }
}

fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests;
