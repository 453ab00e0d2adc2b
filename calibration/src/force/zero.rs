//! The zero of both channels with the finger lifted, taken explicitly.

use crate::certificate::Certificate;

/// A zero reading of both channels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zero {
    /// Mean counts, lateral and normal.
    pub counts: [f64; 2],
    /// Standard uncertainty of the means in counts, from the samples and their autocorrelation.
    pub standard_uncertainty: [f64; 2],
    /// Middle of the reading, in s on the run's clock.
    pub time_s: f64,
}

impl Zero {
    /// The zero that a force certificate states, counted from its own time; `None` where it states none.
    pub fn of_certificate(certificate: &Certificate) -> Option<Self> {
        let lateral = certificate.parameter("lateral.offset")?;
        let normal = certificate.parameter("normal.offset")?;
        Some(Zero {
            counts: [lateral.value, normal.value],
            standard_uncertainty: [lateral.standard_uncertainty, normal.standard_uncertainty],
            time_s: 0.0,
        })
    }
}
