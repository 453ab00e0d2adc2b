//! How far the stiffnesses are from their calibration. docs/diagnosis/model.md, section 10.
//!
//! Only the groups `Fn / (k_n w)` and `k_l U / (pi f mu0 k_n w)` enter the baseline (Eqs. 6-15). So an amplitude whose
//! scale is wrong by a factor is, pass for pass, a normal stiffness wrong by that factor: the stiffness takes it up, no
//! gap is left, and no table of passes can say which of the two it was. The table only shows that the
//! stiffness had to move away from its own calibration. The pull says how far: the shift in units of the
//! deviation that such a shift has when prior and table agree (prior variance less posterior variance).

use crate::regression::{Member, Posterior, Problem};
use effects::{Law, Location, library};
use serde::Serialize;

/// Pull of one stiffness from its prior.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Pull {
    /// `normal_stiffness` or `lateral_stiffness`.
    pub quantity: &'static str,
    /// What rig.toml states, N/m.
    pub stated_n_per_m: f64,
    /// What the verdict's model takes, N/m.
    pub fitted_n_per_m: f64,
    /// Stated relative standard deviation.
    pub stated_relative_sd: f64,
    /// Shift in deviations of a shift when prior and table agree; none where the table says too little of the quantity.
    pub pull_sd: Option<f64>,
    /// Instrument errors that imitate the shift exactly: only an outside calibration tells them from it.
    pub imitated_by: Vec<&'static str>,
}

impl Pull {
    /// Whether prior and table disagree about this stiffness.
    pub fn remarkable(&self) -> bool {
        self.pull_sd.is_some_and(|pull| pull.abs() >= REMARKABLE)
    }

    /// What a reader should know of a remarkable pull.
    pub fn remark(&self) -> Option<String> {
        let pull = self.pull_sd.filter(|_| self.remarkable())?;
        let factor = self.fitted_n_per_m / self.stated_n_per_m;
        let instruments = if self.quantity == "normal_stiffness" {
            format!(
                "an amplitude that is read {:.3} times too large, or a normal force read {factor:.3} times too large",
                1.0 / factor
            )
        } else {
            format!(
                "a lateral force read with another gain, or a sliding speed read {:.3} times too large",
                1.0 / factor
            )
        };
        Some(format!(
            "The model holds only with a {} of {:.3e} N/m, {factor:.3} times the stated {:.3e}: {:.1} standard \
             deviations off, at the stated {:.1} %. Either the finger is not what its calibration says, or an \
             instrument's is wrong: {instruments} looks the same on every pass. No table of passes tells these apart; \
             calibrate the instrument again, or the finger.",
            self.quantity.replace('_', " "),
            self.fitted_n_per_m,
            self.stated_n_per_m,
            pull.abs(),
            100.0 * self.stated_relative_sd,
        ))
    }
}

/// Pull from which the remark is made: one table in 185 passes it by chance, two stiffnesses counted.
pub const REMARKABLE: f64 = 3.0;

/// The stiffnesses, in the order of the baseline's parameters after mu0.
const STIFFNESSES: [&str; 2] = ["normal_stiffness", "lateral_stiffness"];

/// Errors of plate and instruments that do as a change of this parameter of the baseline does, by name.
fn imitators(parameter: usize) -> Vec<&'static str> {
    let acts = |law: &&Law| law.acts_as.is_some_and(|e_folds| e_folds[parameter] != 0.0);
    let outside_finger = library().iter().filter(|e| e.place != Location::Finger);
    let mut names: Vec<&str> =
        outside_finger.filter(|e| e.laws.iter().any(|l| acts(&l))).map(|e| e.name).collect();
    names.sort_unstable();
    names
}

/// Pulls of both stiffnesses in a model. Where `model` explains the table by an error of a stiffness, that
/// error is what was pulled: the recalibrated baseline, `none`, then shows how far; the value is the model's.
pub fn pulls(problem: &Problem, none: &Posterior, model: &Posterior) -> Vec<Pull> {
    let named = model.members.iter().any(errs_in_the_finger);
    let judged = if named { none } else { model };
    let fitted = problem.baseline(&model.u);
    let nominal = &problem.nominal;
    let [on_normal, on_lateral] = stiffness_factors(problem, model);
    let values = [
        (nominal.normal_stiffness_n_per_m, on_normal * fitted.normal_stiffness_n_per_m),
        (nominal.lateral_stiffness_n_per_m, on_lateral * fitted.lateral_stiffness_n_per_m),
    ];
    // Coordinates are standard normal a priori: mu0 first, then the stiffnesses.
    let pull = |(at, (quantity, (stated_n_per_m, fitted_n_per_m)))| {
        let contraction = 1.0 - judged.covariance[(at, at)];
        let seen = contraction > problem.constants.least_contraction;
        Pull {
            quantity,
            stated_n_per_m,
            fitted_n_per_m,
            stated_relative_sd: problem.prior_sd[at],
            pull_sd: seen.then(|| judged.u[at] / contraction.sqrt()),
            imitated_by: imitators(at),
        }
    };
    (1..).zip(STIFFNESSES.into_iter().zip(values)).map(pull).collect()
}

/// Whether a member is an error of the finger's calibration: a change of the baseline itself.
fn errs_in_the_finger(member: &Member) -> bool {
    member.place() == Location::Finger && member.form().acts_as.is_some()
}

/// Factors on normal and lateral stiffness that a named error of a stiffness adds to the baseline's.
fn stiffness_factors(problem: &Problem, model: &Posterior) -> [f64; 2] {
    let thetas = problem.thetas(&model.members, &model.u);
    let mut factors = [1.0; 2];
    for (member, theta) in model.members.iter().zip(thetas).filter(|(m, _)| errs_in_the_finger(m)) {
        let e_folds = member.form().acts_as.unwrap_or_default();
        (0..2).for_each(|k| factors[k] *= (e_folds[k + 1] * theta[0]).exp());
    }
    factors
}
