//! The force sensor is slow. A steady mean does not show it.

use super::prelude::*;

/// See the module.
pub struct SensorLag;

static LAWS: [Law; 1] = [Law::new("first order", &[Parameter::positive("time_constant", "s", 0.01, 1.0)])];

impl Effect for SensorLag {
    fn name(&self) -> &'static str {
        "sensor_lag"
    }
    fn place(&self) -> Place {
        Place::Instrument
    }
    fn summary(&self) -> &'static str {
        "A lagging force channel rounds edges and opens loops at reversals, but leaves steady means alone."
    }
    fn source(&self) -> &'static str {
        "first-order lag; reversal 10-90 time (models::transient)"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Record]
    }
}
