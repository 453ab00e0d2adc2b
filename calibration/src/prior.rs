//! What certificates leave open, as the `[calibration]` section of rig.toml: the diagnosis blames an
//! instrument only within what its certificate leaves.

use crate::amplitude::apply::AmplitudeCalibration;
use crate::certificate::{Kind, Refusal, Verified};
use crate::force::apply::ForceCalibration;
use serde::Serialize;

/// Standard uncertainties that remain after calibration; missing where no certificate speaks of them.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize)]
pub struct CalibrationPriors {
    /// Of the amplitude's gain, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub amplitude_gain_sd: Option<f64>,
    /// Of the lateral force's gain, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lateral_gain_sd: Option<f64>,
    /// Of the normal force's gain, relative.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_gain_sd: Option<f64>,
    /// Of the cross-talk of normal onto lateral force, N/N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub crosstalk_sd: Option<f64>,
    /// Of the normal force's zero, N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub normal_offset_sd_n: Option<f64>,
    /// Of the level of the plate in the sensor's frame, rad: the direction of the normal pull.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tilt_sd_rad: Option<f64>,
}

impl CalibrationPriors {
    /// Takes in one verified certificate. Kinds that say nothing of the readings change nothing.
    ///
    /// # Errors
    /// A certificate that cannot be compiled.
    pub fn take(&mut self, verified: Verified) -> Result<(), Refusal> {
        match verified.certificate().kind {
            Kind::Force => {
                let priors = ForceCalibration::compile(verified, None)?.priors();
                self.lateral_gain_sd = Some(priors.lateral_gain_sd);
                self.normal_gain_sd = Some(priors.normal_gain_sd);
                self.crosstalk_sd = Some(priors.cross_talk_sd[0]);
                let budget = &verified.certificate().budget;
                self.tilt_sd_rad = budget
                    .iter()
                    .find(|line| line.source == "direction of the normal pull")
                    .map(|line| line.standard_uncertainty);
            }
            Kind::Amplitude => {
                self.amplitude_gain_sd = Some(AmplitudeCalibration::compile(verified)?.gain_relative_sd());
            }
            Kind::Latency | Kind::Phase | Kind::Finger | Kind::Sensor => {}
        }
        Ok(())
    }

    /// Takes in the zeros of a run: what the normal zero may be off by, in N.
    pub fn with_normal_zero(self, standard_uncertainty_n: f64) -> Self {
        CalibrationPriors { normal_offset_sd_n: Some(standard_uncertainty_n), ..self }
    }
}
