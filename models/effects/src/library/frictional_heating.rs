//! Rubbing warms the contact and softens what is sheared: friction falls with load times speed. A cause that
//! the library does not name.

use super::prelude::*;
use crate::contact::sweep::root;

/// See the module.
pub struct FrictionalHeating;

static LAWS: [Law; 1] = [Law::new(
    "softening with the power rubbed",
    &[Parameter::positive("inverse_power", "1/W", 40.0, 1000.0), Parameter::shape("exponent", "1", 0.8, 0.4)],
)];

impl Effect for FrictionalHeating {
    fn name(&self) -> &'static str {
        "frictional_heating"
    }
    fn place(&self) -> Place {
        Place::Contact
    }
    fn summary(&self) -> &'static str {
        "Friction falls with the power that rubbing dissipates."
    }
    fn source(&self) -> &'static str {
        "a contact of 3 mm on a poor conductor warms by some kelvin at 10 mW; Archard's flash temperature"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn imitated_by(&self) -> &'static [&'static str] {
        // Heat goes with mu N U: so do a dependence on speed and one on load with like exponents.
        &["rate_dependent_friction", "load_dependent_friction"]
    }
    fn words(&self) -> &'static str {
        "friction that heats up with load times speed"
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Speeds]
    }
    fn change(&self, _: usize, theta: &[f64], _: &Condition, _: &Design, c: &mut Contact) {
        // Heat is made by the friction that is left: mu = mu0 (1 + q mu N U)^-n, whose left side rises faster.
        let full = theta[0] * c.mu0 * c.normal_force * c.speed;
        let least = (1.0 + full).powf(-theta[1]);
        let over = |left: f64| left * (1.0 + full * left).powf(theta[1]) - 1.0;
        c.mu0 *= if full > 0.0 { root(least, 1.0, 0.0, over).unwrap_or(least) } else { 1.0 };
    }
}
