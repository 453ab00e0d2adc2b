//! Sliding charges the plate, and the charge pulls the finger. A cause that the library does not name.

use super::prelude::*;
use crate::contact::gap;

pub(super) static EFFECT: Effect = Effect {
    name: "charging",
    place: Location::Contact,
    summary: "An attraction that grows with the sliding speed and falls across the gap.",
    source: "contact charging on insulators: rubbing brings charge in proportion to the speed, a leak takes it away, and the pull goes \
             with the square of the charge (Coulomb); tens of mN where the field is near that of a discharge in air, 3 MV/m",
    laws: &[Law::new(
        "charge against a leak",
        &[
            Parameter::positive("attraction", "N", 0.06, 1.0),
            Parameter::shape("speed_of_half_charge", "m/s", 0.015, 0.8),
            Parameter::shape("reach", "m", 1e-6, 0.8),
        ],
    )],
    words: Some("sliding that charges the plate"),
    needs: &[Need::Speeds],
    change: |_, theta, _, _, c| {
        let charge = c.speed / (c.speed + theta[1]);
        c.normal_force = gap::carried(c, theta[0] * charge * charge, theta[2]);
    },
    ..Effect::NONE
};
