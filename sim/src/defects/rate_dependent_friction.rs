//! Friction that holds up to a speed and beyond it changes with the logarithm of the speed, until fast
//! sliding warms the bonds. A bond lasts as long as a junction takes to pass, so the knee goes with its
//! width: less than the cube root of the load (Hertz), as there are more junctions too. Unchanged at 20
//! mm/s and 0.3 N.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("relative_slope", 0.004, 0.3),
        Parameter::log("knee_m_s", 2e-3, 2e-2),
        Parameter::linear("fall_per_50_mm_s", 0.0, 0.8),
    ],
    act: Act::Contact(|v, _, contact| {
        let wider = (contact.normal_force_n.max(0.0) / REFERENCE_N).powf(WIDENING);
        let rise =
            |speed: f64, wider: f64| (speed / (v[1] * wider)).powf(SHARP).ln_1p() / SHARP - v[2] * speed / 0.05;
        let factor = 1.0 + v[0] * (rise(contact.speed_m_s, wider.max(0.1)) - rise(REFERENCE_M_S, 1.0));
        contact.friction *= factor.clamp(0.2, 3.0);
    }),
    ..DefectKind::cause(DefectSite::Contact, "the coefficient of friction depends on the sliding speed")
};

const REFERENCE_M_S: f64 = 0.02;
const REFERENCE_N: f64 = 0.3;
/// Power of the load by which a junction widens.
const WIDENING: f64 = 1.0 / 6.0;
/// Sharpness of the knee.
const SHARP: f64 = 6.0;
