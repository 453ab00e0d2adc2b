//! The zero of both channels with the finger lifted, taken explicitly.

use super::Axis;
use super::matrix::Term;
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
    /// The zero that a force certificate states at a temperature, counted from its own time; `None` where it
    /// states none.
    pub fn of_certificate(certificate: &Certificate, temperature_c: Option<f64>) -> Option<Self> {
        let (c, kelvin) = (certificate.covariance_matrix(), certificate.kelvin(temperature_c));
        let parameters = &certificate.parameters;
        let of = |channel: Axis| {
            let find = |term: Term| parameters.iter().position(|p| p.name == term.name(channel).0);
            let offset = find(Term::Offset)?;
            let (i, by) = find(Term::ZeroTemperature).map_or((offset, 0.0), |slope| (slope, kelvin));
            let variance = c[(offset, offset)] + by * (2.0 * c[(offset, i)] + by * c[(i, i)]);
            Some((parameters[offset].value + by * parameters[i].value, variance.max(0.0).sqrt()))
        };
        let [(lateral, lateral_sd), (normal, normal_sd)] = [of(Axis::Lateral)?, of(Axis::Normal)?];
        Some(Zero { counts: [lateral, normal], standard_uncertainty: [lateral_sd, normal_sd], time_s: 0.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::{Instrument, Occasion, RawData};
    use crate::force::matrix::{Options, fit, tests::series};
    use crate::force::series::Weighing;

    #[test]
    fn the_zero_follows_the_temperature() {
        let weighing = Weighing::default();
        let outcome = fit(&series(0.0), &weighing, &Options::default()).unwrap().outcome(&weighing);
        let certificate = outcome.certify(&Occasion {
            unix_s: 1_800_000_000,
            operator: "A".into(),
            instrument: Instrument { name: "force sensor".into(), serial: "F".into() },
            raw_data: RawData::of("series.csv", b"", 0),
            valid_days: 90.0,
        });
        let at = |temperature_c| Zero::of_certificate(&certificate, temperature_c).unwrap();
        // The sensor's true zero: 118 and 3300 counts at 22 deg C, 3 and -2 counts/K.
        for (celsius, truth) in [(22.0, [118.0, 3_300.0]), (26.0, [130.0, 3_292.0])] {
            let zero = at(Some(celsius));
            for a in 0..2 {
                let off = (zero.counts[a] - truth[a]).abs();
                assert!(off < 3.0 * zero.standard_uncertainty[a] && off < 1.0, "{celsius}: {zero:?}");
            }
        }
        assert!(at(Some(26.0)).standard_uncertainty[0] > at(None).standard_uncertainty[0]);
    }
}
