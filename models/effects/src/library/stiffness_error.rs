//! A stiffness of the finger is not what its certificate says.

use super::prelude::*;

/// See the module.
pub struct StiffnessError;

static LAWS: [Law; 3] = [
    Law::new("lateral stiffness", &[Parameter::signed("log_lateral_factor", "1", 0.5, -2.0, 2.0)])
        .acts_as([0.0, 0.0, 1.0]),
    Law::new("normal stiffness", &[Parameter::signed("log_normal_factor", "1", 0.5, -2.0, 2.0)])
        .acts_as([0.0, 1.0, 0.0]),
    Law::new("both", &[Parameter::signed("log_common_factor", "1", 0.5, -2.0, 2.0)]).acts_as([0.0, 1.0, 1.0]),
];

impl Effect for StiffnessError {
    fn name(&self) -> &'static str {
        "stiffness_error"
    }
    fn place(&self) -> Place {
        Place::Finger
    }
    fn summary(&self) -> &'static str {
        "Normal or lateral stiffness lies outside the range that its calibration states."
    }
    fn source(&self) -> &'static str {
        "spread of ultrasonic stiffness in the paper (0.2 to 4 MN/m); rig.toml's prior is the nuisance"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn near(&self) -> &'static [&'static str] {
        &["speed_error", "amplitude_miscalibration", "subsurface_relaxation"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        let factor = theta[0].exp();
        if law != 1 {
            c.lateral_stiffness *= factor;
        }
        if law != 0 {
            c.normal_stiffness *= factor;
        }
    }
}
