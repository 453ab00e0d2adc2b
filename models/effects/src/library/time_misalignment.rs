//! Force and position carry different clocks. A steady mean does not show it.

use super::prelude::*;

/// See the module.
pub struct TimeMisalignment;

static LAWS: [Law; 1] = [Law::new("constant skew", &[Parameter::signed("skew", "s", 0.01, -1.0, 1.0)])];

impl Effect for TimeMisalignment {
    fn name(&self) -> &'static str {
        "time_misalignment"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "The force is filed under a wrong instant: profiles along the plate shift with the direction."
    }
    fn source(&self) -> &'static str {
        "transport delays of buses; loop area grows as speed times skew"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Record]
    }
}
