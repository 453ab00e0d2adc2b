//! Force and position carry different clocks. A steady mean does not show it.

use super::prelude::*;

pub(super) static EFFECT: Effect = Effect {
    name: "time_misalignment",
    place: Location::Instrument,
    summary: "The force is filed under a wrong instant: profiles along the plate shift with the direction.",
    source: "transport delays of buses; loop area grows as speed times skew",
    laws: &[Law::new("constant skew", &[Parameter::signed("skew", "s", 0.01, -1.0, 1.0)])],
    needs: &[Need::Record],
    ..Effect::NONE
};
