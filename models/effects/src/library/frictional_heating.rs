//! Rubbing warms the contact and softens what is sheared: friction falls with load times speed. A cause that
//! the library does not name.

use super::prelude::*;
use crate::contact::sweep::root;

pub(super) static EFFECT: Effect = Effect {
    name: "frictional_heating",
    place: Location::Contact,
    summary: "Friction falls with the power that rubbing dissipates.",
    source: "a contact of 3 mm on a poor conductor warms by some kelvin at 10 mW; Archard's flash temperature",
    laws: &[Law::new(
        "softening with the power rubbed",
        &[
            Parameter::positive("inverse_power", "1/W", 40.0, 1000.0),
            Parameter::shape("exponent", "1", 0.8, 0.4),
        ],
    )],
    // Heat goes with mu N U: so do a dependence on speed and one on load with like exponents.
    imitated_by: &["rate_dependent_friction", "load_dependent_friction"],
    words: Some("friction that heats up with load times speed"),
    needs: &[Need::Speeds],
    change: |_, theta, _, _, c| {
        // Heat is made by the friction that is left: mu = mu0 (1 + q mu N U)^-n, whose left side rises faster.
        let full = theta[0] * c.mu0 * c.normal_force * c.speed;
        let least = (1.0 + full).powf(-theta[1]);
        let over = |left: f64| left * (1.0 + full * left).powf(theta[1]) - 1.0;
        c.mu0 *= if full > 0.0 { root(least, 1.0, 0.0, over).unwrap_or(least) } else { 1.0 };
    },
    ..Effect::NONE
};
