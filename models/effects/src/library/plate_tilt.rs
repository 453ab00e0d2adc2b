//! The plate is not level in the sensor's frame.

use super::prelude::*;

/// See the module.
pub struct PlateTilt;

// A plate that turns shows in both axes. A lateral cell that is askew by itself reads a share of the normal
// force: that is a cross-talk by its definition.
static LAWS: [Law; 1] = [Law::new("rotation", &[Parameter::signed("angle", "rad", 0.03, -0.3, 0.3)])
    .certified_by(CertifiedKey::Tilt)
    .seen_by("Put a spirit level (or the sensor, unloaded and turned by 180 degrees) on the plate.", 0.002)];

impl Effect for PlateTilt {
    fn name(&self) -> &'static str {
        "plate_tilt"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "A component of the load is read as lateral force, and one of the friction as normal force."
    }
    fn source(&self) -> &'static str {
        "rotation of the frame by the angle: Fx' = Fx cos + Fz sin, Fz' = Fz cos - Fx sin"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn departs_by(&self) -> f64 {
        0.05
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Directions]
    }
    fn change(&self, _: usize, theta: &[f64], pass: &Condition, _: &Design, c: &mut Contact) {
        if theta[0] != 0.0 {
            unload(c, pass.direction.sign(), theta[0].tan());
            c.normal_force /= theta[0].cos();
        }
    }
    fn read(&self, _: usize, theta: &[f64], _: &Condition, _: &Design, reading: &mut Reading) {
        reading.gain *= theta[0].cos();
        reading.crosstalk += theta[0].sin();
    }
}

/// Restores the true normal force where a share of the (signed) friction force was taken from the reading.
pub fn unload(c: &mut Contact, direction: f64, share: f64) {
    if share != 0.0 {
        let friction = direction * crate::contact::mean_friction(c);
        c.normal_force = (c.normal_force + share * friction).max(LEAST_SHARE * c.normal_force);
    }
}
