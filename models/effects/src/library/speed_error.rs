//! The stage does not move at the commanded speed.

use super::prelude::*;

/// See the module.
pub struct SpeedError;

/// What sees it without friction.
const CHECK: &str = "Time the stage over its stroke, or read its encoder.";

static LAWS: [Law; 3] = [
    Law::new("gain", &[Parameter::signed("log_gain", "1", 0.15, -1.0, 1.0)])
        .certified_by(CertifiedKey::SpeedGain)
        .acts_as([0.0, 0.0, 1.0])
        .seen_by(CHECK, 0.003),
    Law::new("constant", &[Parameter::signed("excess", "m/s", 0.003, -0.02, 0.05)]).seen_by(CHECK, 6e-5),
    // Slip and lag of a drive change with its speed: the error of the gain by this share for each factor of e.
    Law::new(
        "gain that changes with speed",
        &[
            Parameter::signed("log_gain", "1", 0.15, -1.0, 1.0),
            Parameter::signed("growth_with_log_speed", "1", 0.1, -0.5, 0.5),
        ],
    )
    .seen_by(CHECK, 0.003),
];

impl Effect for SpeedError {
    fn name(&self) -> &'static str {
        "speed_error"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "True speed is a factor (or a constant) away from the commanded one; the factor may change with speed."
    }
    fn source(&self) -> &'static str {
        "wrong lead or step count; separable from a stiffness only with an encoder"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn near(&self) -> &'static [&'static str] {
        &["amplitude_miscalibration"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, design: &Design, c: &mut Contact) {
        match law {
            0 => c.speed *= theta[0].exp(),
            1 => c.speed = (c.speed + theta[0]).max(0.05 * c.speed),
            _ => c.speed *= (theta[0] * (1.0 + theta[1] * (c.speed / design.reference_speed_m_s).ln())).exp(),
        }
    }
}
