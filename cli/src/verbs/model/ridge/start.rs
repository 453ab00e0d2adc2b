//! Whether a case's answer depends on how the run began: lightly damped ridges have two steady states.

use models::ridge::{self, RidgeCase, RidgeError, RidgeRun, RunSettings};
use serde::Serialize;

/// Mass damping in 1/s below which two states of one case have been found (docs/ridge.md).
pub const LIGHTLY_DAMPED_PER_S: f64 = 5e4;
/// The second run comes down from so many times the amplitude.
const OVERSHOOT: f64 = 2.0;
/// Difference in mu' beyond the tolerance of both runs that counts, in tolerances.
const COUNTS: f64 = 3.0;
/// Difference in the share of time in contact that counts.
const CONTACT_COUNTS: f64 = 0.05;

/// The same case from the other start.
#[derive(Clone, Debug, Serialize)]
pub struct OtherStart {
    /// Whether the two answers differ.
    pub depends_on_start: bool,
    /// mu' of the run that came down.
    pub mu_relative: f64,
    /// Its share of time in contact.
    pub contact_fraction: f64,
    /// Its phase shift in degrees.
    pub phase_shift_deg: Option<f64>,
    /// Whether its period is doubled.
    pub period_doubled: bool,
    /// Whether it became steady.
    pub steady: bool,
}

impl OtherStart {
    /// In a line.
    pub fn words(&self, run: &RidgeRun) -> String {
        let state = |mu: f64, contact: f64, doubled: bool| {
            let doubled = if doubled { ", doubled" } else { "" };
            format!("mu' {mu:.4}, contact {:.0} %{doubled}", 100.0 * contact)
        };
        let rest = state(run.mu_relative, run.contact_fraction, run.period_doubled);
        let above = state(self.mu_relative, self.contact_fraction, self.period_doubled);
        let states =
            if self.depends_on_start { "TWO STATES, the answer depends on the start" } else { "one state" };
        format!("from rest: {rest}; down from twice the amplitude: {above}: {states}")
    }
}

/// Whether two states are to be thought of.
pub fn is_lightly_damped(case: &RidgeCase) -> bool {
    case.mass_damping_per_s < LIGHTLY_DAMPED_PER_S
        && case.stiffness_damping_s == 0.0
        && case.amplitude.metres() > 0.0
}

/// Runs a case down from twice its amplitude and compares it with the run from rest.
pub fn from_above(
    case: &RidgeCase,
    settings: &RunSettings,
    from_rest: &RidgeRun,
) -> Result<OtherStart, RidgeError> {
    let run = ridge::run(case, &RunSettings { overshoot: OVERSHOOT, ..*settings })?;
    let far = (run.mu_relative - from_rest.mu_relative).abs() > COUNTS * settings.steady.tolerance;
    let open = (run.contact_fraction - from_rest.contact_fraction).abs() > CONTACT_COUNTS;
    Ok(OtherStart {
        depends_on_start: far || open || run.period_doubled != from_rest.period_doubled,
        mu_relative: run.mu_relative,
        contact_fraction: run.contact_fraction,
        phase_shift_deg: run.phase_shift_deg,
        period_doubled: run.period_doubled,
        steady: run.steady,
    })
}
