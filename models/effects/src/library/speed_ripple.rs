//! The stage's speed ripples with the pitch of its screw.

use super::prelude::*;
use std::f64::consts::PI;

/// See the module.
pub struct SpeedRipple;

static LAWS: [Law; 1] = [Law::new(
    "sine along the plate",
    &[
        Parameter::positive("relative_ripple", "1", 0.2, 0.9),
        Parameter::between("pitch", "m", 0.0008, 0.012),
        Parameter::between("phase", "1", -0.25, 1.25),
    ],
)];

impl Effect for SpeedRipple {
    fn name(&self) -> &'static str {
        "speed_ripple"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "Speed varies along the stroke with the screw's pitch, and friction follows where it depends on speed."
    }
    fn source(&self) -> &'static str {
        "lead screws of 1 to 10 mm pitch"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn near(&self) -> &'static [&'static str] {
        &["mode_shape"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration, Need::Positions]
    }
    fn change(&self, _: usize, theta: &[f64], pass: &Condition, _: &Design, c: &mut Contact) {
        let wave = (2.0 * PI * (pass.position_m / theta[1] + theta[2])).sin();
        c.speed *= (1.0 + theta[0] * wave).max(0.05);
    }
}
