//! The lateral gain is wrong. In a table of means mu0 takes it up, and what is left looks like another lateral stiffness.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::factor("factor", 0.03, 0.5)],
    in_tables: false,
    act: Act::Forces(|v, _, forces| forces.lateral_n *= v[0]),
    ..DefectKind::cause(DefectSite::Instrument, "the gain of the lateral force is wrong")
};
