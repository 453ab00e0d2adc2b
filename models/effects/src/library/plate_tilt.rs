//! The plate is not level in the sensor's frame.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "plate_tilt",
    place: Location::Instrument,
    summary: "A component of the load is read as lateral force, and one of the friction as normal force.",
    source: "rotation of the frame by the angle: Fx' = Fx cos + Fz sin, Fz' = Fz cos - Fx sin",
    // A plate is bowed, and its mount yields under the load, or creeps. A plate that turns shows in both
    // axes. A lateral cell that is askew by itself reads a share of the normal force: that is a cross-talk by
    // its definition.
    laws: &[Law::new(
        "rotation",
        &[Parameter::signed("angle", "rad", 0.03, -0.3, 0.3), ALONG, LOADED, LATER],
    )
    .certified_by(CertifiedKey::Tilt)
    .seen_by("Put a spirit level (or the sensor, unloaded and turned by 180 degrees) on the plate.", 0.002)],
    departs_by: 0.05,
    acts: Some(Acts { on: Input::Crosstalk, over: &[&covariate::NORMAL_FORCE, &covariate::POSITION] }),
    needs: &[Need::Directions],
    change: |_, theta, pass, design, c| {
        if theta[0] != 0.0 {
            let angle = bent(theta, pass, design);
            unload(c, pass.direction.sign(), angle.tan());
            c.normal_force /= angle.cos();
        }
    },
    read: |_, theta, pass, design, reading| {
        let (sin, cos) = bent(theta, pass, design).sin_cos();
        reading.gain *= cos;
        reading.crosstalk += sin;
    },
    ..Effect::NONE
};

/// Restores the true normal force where a share of the (signed) friction force was taken from the reading.
pub fn unload(c: &mut Contact, direction: f64, share: f64) {
    if share != 0.0 {
        let friction = direction * crate::contact::mean_friction(c);
        c.normal_force = (c.normal_force + share * friction).max(LEAST_SHARE * c.normal_force);
    }
}
