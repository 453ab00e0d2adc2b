//! The friction limit is not proportional to the load.

use super::prelude::*;

/// See the module.
pub struct LoadDependentFriction;

static LAWS: [Law; 3] = [
    Law::new("power of the momentary load", &[Parameter::signed("exponent_minus_one", "1", 0.2, -0.6, 0.4)]),
    Law::new("power of the mean load", &[Parameter::signed("exponent_minus_one", "1", 0.2, -0.8, 0.6)]),
    Law::new("saturating with the mean load", &[Parameter::signed("inverse_load", "1/N", 0.8, -0.6, 8.0)]),
];

impl Effect for LoadDependentFriction {
    fn name(&self) -> &'static str {
        "load_dependent_friction"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "The friction coefficient depends on the load, as area-controlled (non-Coulombic) friction has it."
    }
    fn source(&self) -> &'static str {
        "F = k W^n with n from 2/3 to 1 (Dzidek 2014); n scatters in active touch (Inoue 2022)"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn near(&self) -> &'static [&'static str] {
        &["adhesion", "normal_offset"]
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Loads]
    }
    fn change(&self, law: usize, theta: &[f64], _: &Condition, design: &Design, c: &mut Contact) {
        let relative = (c.normal_force / design.reference_load_n).max(1e-3);
        match law {
            0 => c.load_exponent = theta[0],
            1 => c.mu0 *= relative.powf(theta[0]),
            _ => {
                let k = theta[0] * design.reference_load_n;
                c.mu0 *= (1.0 + k).max(0.05) / (1.0 + k * relative).max(0.05);
            }
        }
    }
}
