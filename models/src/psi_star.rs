//! `Psi*` of a rig's own passes, with an interval that holds how far its conditions differ.
//!
//! Eq. 20 is an approximation of a rig: each condition gives a `Psi*` of its own by hand, `-Psi / ln(1 -
//! mu')`. The `Psi*` of a rig is the centre of what many such conditions give, and those of a run are a
//! sample of them:
//!
//! 1. The repeats of a condition are averaged, since they share its misfit. `mu_0` is that of the passes
//!    without vibration.
//! 2. `Psi*` is fitted to the forces of the conditions by weighted least squares. A condition weighs by its
//!    noise and by the law's error, 0.055 rms in units of `4 mu' (1 - mu')`, which is never fitted. The pull
//!    of a condition changes its sign at its own value by hand, so the fit lies within the range of those
//!    values.
//! 3. The variance between conditions is that of their pulls (a sandwich, with the leverage of each and
//!    Student's quantile for so many); fewer than four have the law's error at least. The uncertainties that
//!    all conditions share, of `mu_0` and of the gains, are added.

mod conditions;

use crate::condition::Condition;
use crate::pass::Pass;
use crate::psi::{PsiEq17, relative_friction};
use crate::quantity::PeakToPeak;
use crate::rig_file::{CertifiedKey, PassNoise, RigFile};
use conditions::{Mean, by_condition, single_passes};
use serde::{Deserialize, Serialize};
use std::fmt;

/// `Psi` of the true stroke at which passes count: about one, where the readings differ most. A condition at
/// an end has half its weight.
pub const PSI_RANGE: [f64; 2] = [0.4, 4.0];
/// Factor about each end over which the weight goes from all to nothing: a `mu_0` with noise then moves no
/// condition in or out at once.
pub const PSI_EDGE: f64 = 1.25;
/// Ends of the search for `Psi*`.
const SEARCH: [f64; 2] = [0.03, 90.0];
/// The law's error, rms, in units of 4 mu' (1 - mu').
const LAW_SD: f64 = 0.055;
/// Standard deviations at which a condition begins to weigh less: neither a bad pass nor the law's worst
/// condition may decide.
const ROBUST: f64 = 1.5;
/// Half a width of 95 % in standard deviations.
const Z95: f64 = 1.959_963_985;

/// `Psi*` of the true stroke, for a run's summary.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
pub struct PsiStar {
    /// `Psi*` of the peak-to-peak amplitude (-).
    pub psi_star: f64,
    /// Its interval of 95 %, low end.
    pub low: f64,
    /// Its interval of 95 %, high end.
    pub high: f64,
    /// Conditions with vibration behind it.
    pub conditions: u32,
}

impl fmt::Display for PsiStar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let PsiStar { psi_star, low, high, conditions } = self;
        write!(
            f,
            "Psi* = {psi_star:.2} (95 %: {low:.2} to {high:.2}) for the peak-to-peak amplitude, \
             from {conditions} conditions"
        )
    }
}

/// The fit, with what else is known of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PsiStarFit {
    /// `Psi*`.
    pub psi_star: f64,
    /// Its interval of 95 %, low end.
    pub low: f64,
    /// Its interval of 95 %, high end.
    pub high: f64,
    /// Conditions behind it.
    pub conditions: u32,
    /// Variance of `ln Psi*` by noise alone: under the same conditions again.
    pub noise_variance: f64,
    /// Standard deviation of `ln Psi*` by the law's error where all conditions have it in common.
    pub law_sd: f64,
    /// Nine of ten of the passes lie, each by itself, at a `Psi*` from here ...
    pub passes_low: f64,
    /// ... to here; `None` where more than one in twenty has no friction below that without vibration.
    pub passes_high: Option<f64>,
    /// Those passes.
    pub passes: u32,
}

/// What Eq. 20 says of a condition under a `Psi*`.
struct Under {
    /// How much more force there is for less of `ln Psi*`, in N.
    slope: f64,
    /// `4 mu' (1 - mu')` in N: what the law's error is counted in.
    law_n: f64,
    /// Variance of the mean's noise, in N^2.
    noise: f64,
    /// What it adds to the score.
    pull: f64,
    /// How its pull changes with its force, without the slope (N^-2).
    weight: f64,
}

/// The conditions of a table or a sweep, ready for the fit.
struct Means {
    means: Vec<Mean>,
    poisson_ratio: f64,
    noise: PassNoise,
}

/// What certificates of amplitude and speed leave open of Psi, a relative standard uncertainty that all
/// passes share.
pub fn scale_sd(rig: &RigFile) -> f64 {
    let gain = |key| rig.calibration.sd(key).unwrap_or(0.0);
    gain(CertifiedKey::AmplitudeGain).hypot(gain(CertifiedKey::SpeedGain))
}

/// `Psi*` of a run's passes, with the noise that its rig.toml states.
pub fn of_run<'a>(passes: impl IntoIterator<Item = &'a Pass>, rig: &RigFile) -> Option<PsiStar> {
    let passes = passes.into_iter().filter_map(|p| Some((p.condition(1.0), p.friction_force_n()?)));
    let fit = of_passes(passes, rig.finger.poisson_ratio, rig.noise, scale_sd(rig))?;
    Some(PsiStar { psi_star: fit.psi_star, low: fit.low, high: fit.high, conditions: fit.conditions })
}

/// `Psi*` of passes, in any order: each one's measured condition (whose `mu0` is ignored) and mean friction
/// force in N, positive along the sliding direction. `scale_sd` is the relative standard uncertainty of Psi
/// that all passes share, of the gains of amplitude and speed.
///
/// Left out are passes that the law says nothing of (no load, no speed, no finite force) and those whose Psi
/// is far from one ([`PSI_RANGE`]). `None` without a pass of each kind, or where friction under vibration is
/// nowhere between none and that without.
pub fn of_passes(
    passes: impl IntoIterator<Item = (Condition, f64)>,
    poisson_ratio: f64,
    noise: PassNoise,
    scale_sd: f64,
) -> Option<PsiStarFit> {
    let usable = |v: f64| v.is_finite() && v > 0.0;
    let (mut still, mut moving) = (Vec::new(), Vec::new());
    for (c, force_n) in passes {
        if !usable(c.normal_force_n) || !usable(c.speed_m_s) || !force_n.is_finite() {
            continue;
        }
        if c.amplitude == PeakToPeak::ZERO {
            still.push((c, force_n));
        } else if usable(c.frequency_hz) && usable(c.amplitude.metres()) {
            moving.push((c, force_n));
        }
    }
    of_conditions(&still, &by_condition(moving), poisson_ratio, noise, scale_sd)
}

/// The same of passes without vibration, and of those with it by their condition.
pub fn of_conditions(
    still: &[(Condition, f64)],
    conditions: &[Vec<(Condition, f64)>],
    poisson_ratio: f64,
    noise: PassNoise,
    scale_sd: f64,
) -> Option<PsiStarFit> {
    let loads: f64 = still.iter().map(|(c, _)| c.normal_force_n.powi(2)).sum();
    let mu0 = still.iter().map(|(c, force)| c.normal_force_n * force).sum::<f64>() / loads;
    if !(mu0.is_finite() && mu0 > 0.0) {
        return None;
    }
    let force_variance = noise.force_sd_n.powi(2) * (1.0 + mu0 * mu0);
    let of_load = |load: f64| load * load * ((noise.pass_relative_sd * mu0 * load).powi(2) + force_variance);
    let mu0_variance =
        still.iter().map(|(c, _)| of_load(c.normal_force_n)).sum::<f64>() / (mu0 * loads).powi(2);
    let each = single_passes(conditions.iter().flatten(), mu0, poisson_ratio)?;
    let means = conditions.iter().map(|passes| Mean::of(passes)).collect();
    Means { means, poisson_ratio, noise }.fit(mu0, mu0_variance, scale_sd, each)
}

impl Means {
    fn fit(
        &self,
        mu0: f64,
        mu0_variance: f64,
        scale_sd: f64,
        (passes, passes_low, passes_high): (u32, f64, Option<f64>),
    ) -> Option<PsiStarFit> {
        let ln_star = self.centre(mu0)?;
        // The slopes of the score in its unknowns, by differences: with what the conditions are off by, which
        // a linear law has not.
        let step = 1e-4;
        let slope = |f: &dyn Fn(f64) -> f64| (f(step) - f(-step)) / (2.0 * step);
        let in_star = slope(&|h| self.score(ln_star + h, mu0));
        let in_mu0 = slope(&|h| self.score(ln_star, mu0 * h.exp()));
        let all: Vec<Under> = self.means.iter().map(|mean| self.under(mean, ln_star, mu0)).collect();
        let all: Vec<&Under> = all.iter().filter(|u| u.weight > 0.0).collect();
        let whole: f64 = all.iter().map(|u| u.slope * u.slope * u.weight).sum();
        let (mut noise, mut law, mut known, mut seen, mut sums) = (0.0, 0.0, 0.0, 0.0, [0.0; 3]);
        for u in &all {
            let influence = u.slope * u.weight / in_star;
            noise += influence * influence * u.noise;
            law += influence * LAW_SD * u.law_n;
            known += influence * influence * (u.noise + (LAW_SD * u.law_n).powi(2));
            let share = u.slope * u.slope * u.weight / whole;
            let lever = share * share / (1.0 - share);
            seen += (u.pull / in_star).powi(2) / (1.0 - share);
            sums = [sums[0] + share * share, sums[1] + lever, sums[2] + lever * lever];
        }
        // Satterthwaite's number for `seen` where a share is what the inverse of a variance makes it: n - 1
        // for equal ones.
        let free = 1.0 / (sums[0] + sums[1] * sums[1] - sums[2]);
        // Three conditions show too little of their scatter (Student's quantile is 4.3): then it is the law's
        // known error at least.
        let (between, quantile) = if free > 2.5 {
            (seen, student(free))
        } else {
            (known.max(if free > 0.0 { seen } else { 0.0 }), Z95)
        };
        let shared = (in_mu0 / in_star).powi(2) * mu0_variance + scale_sd * scale_sd;
        let half = (quantile * quantile * between + Z95 * Z95 * shared).sqrt();
        let fit = PsiStarFit {
            psi_star: ln_star.exp(),
            low: (ln_star - half).exp(),
            high: (ln_star + half).exp(),
            conditions: u32::try_from(all.len()).unwrap_or(u32::MAX),
            noise_variance: noise + shared,
            law_sd: law,
            passes_low,
            passes_high,
            passes,
        };
        (half.is_finite() && fit.noise_variance.is_finite()).then_some(fit)
    }

    /// `ln Psi*` where the score is nothing. Below what every condition gives by hand the score is negative,
    /// above it positive.
    fn centre(&self, mu0: f64) -> Option<f64> {
        let ends = SEARCH.map(f64::ln);
        let crosses = self.score(ends[0], mu0) < 0.0 && self.score(ends[1], mu0) > 0.0;
        crosses.then(|| crate::root::bisection(ends, 60, |star| self.score(star, mu0) < 0.0))
    }

    /// Half the slope of the weighted squares in `ln Psi*`.
    fn score(&self, ln_star: f64, mu0: f64) -> f64 {
        self.means.iter().map(|mean| self.under(mean, ln_star, mu0).pull).sum()
    }

    /// A condition under a `Psi*`: one that is far off pulls no harder than [`ROBUST`] standard deviations.
    fn under(&self, mean: &Mean, ln_star: f64, mu0: f64) -> Under {
        let c = &Condition { mu0, ..mean.condition };
        let (psi, full) = (PsiEq17::at(c, self.poisson_ratio), mu0 * c.normal_force_n);
        let ratio = psi.0 / ln_star.exp();
        let law = relative_friction(psi, ln_star.exp());
        let [relative, own] = [self.noise.pass_relative_sd, self.noise.force_sd_n];
        let noise =
            ((relative * full * law).powi(2) + own * own * (1.0 + (mu0 * law).powi(2))) / mean.repeats;
        let law_n = full * 4.0 * law * (1.0 - law);
        let (slope, variance) = (full * ratio * (-ratio).exp(), noise + (LAW_SD * law_n).powi(2));
        let off = (mean.force_n - full * law) / variance.sqrt();
        let near = 1.0 + (off / ROBUST).powi(2);
        let weight_by_psi = psi_weight(psi.0);
        Under {
            slope,
            law_n,
            noise,
            pull: weight_by_psi * slope * off / (near * variance).sqrt(),
            weight: weight_by_psi * near.powf(-1.5) / variance,
        }
    }
}

/// The weight of a condition by its Psi: one within [`PSI_RANGE`], nothing far outside, smooth between.
fn psi_weight(psi: f64) -> f64 {
    let edge = |beyond: f64| {
        let t = (0.5 + beyond.ln() / (2.0 * PSI_EDGE.ln())).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    };
    edge(psi / PSI_RANGE[0]) * edge(PSI_RANGE[1] / psi)
}

/// Student's quantile of 97.5 % for any number of degrees of freedom: within 0.2 % from 2 on, 6 % at 1.
fn student(free: f64) -> f64 {
    Z95 * ((1.2104 + (0.736 - 0.021 / free) / free) / free).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn students_quantiles() {
        for (free, exact) in
            [(2.0, 4.3027), (3.0, 3.1824), (4.0, 2.7764), (6.0, 2.4469), (10.0, 2.2281), (30.0, 2.0423)]
        {
            assert!((student(free) / exact - 1.0).abs() < 0.002, "{free}: {}", student(free));
        }
    }
}
