//! The friction coefficient depends on the sliding speed.

use super::prelude::*;

/// See the module.
pub struct RateDependentFriction;

static LAWS: [Law; 4] = [
    Law::new("power", &[Parameter::signed("exponent", "1", 0.12, -0.6, 0.8)]),
    Law::new(
        "Stribeck",
        &[
            Parameter::signed("static_excess", "1", 0.4, -0.8, 3.0),
            Parameter::shape("stribeck_speed", "m/s", 0.025, 0.8),
        ],
    ),
    Law::new("linear", &[Parameter::signed("slope", "s/m", 4.0, -4.0, 60.0)]),
    // Thermally activated sliding; the first term of rate-and-state friction.
    Law::new("logarithmic", &[Parameter::signed("slope_per_log_speed", "1", 0.12, -0.4, 0.6)]),
];

impl Effect for RateDependentFriction {
    fn name(&self) -> &'static str {
        "rate_dependent_friction"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "Faster or slower sliding changes mu0 itself; seen with the plate still."
    }
    fn source(&self) -> &'static str {
        "exponents of -0.2 to 0.3 on skin; Stribeck minimum near 10 mm/s on steel (Luo 2024)"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Speeds]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, design: &Design, c: &mut Contact) {
        let reference = design.reference_speed_m_s;
        c.mu0 *= match law {
            0 => (c.speed / reference).powf(theta[0]),
            1 => {
                let part = |u: f64| 1.0 + theta[0] * (-(u / theta[1]).powi(2)).exp();
                part(c.speed)
            }
            2 => (1.0 + theta[0] * (c.speed - reference)).max(0.05),
            _ => (1.0 + theta[0] * (c.speed / reference).ln()).max(0.05),
        };
    }
}
