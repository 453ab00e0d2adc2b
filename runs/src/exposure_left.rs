//! What is left of a finger's hour of exposure, for whoever arms the rig.

use realtime::safety::{Exposed, Limits};
use serde::{Deserialize, Serialize};

/// What is left of what a finger may be exposed to.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Left {
    /// Of the hour's share, in s.
    pub hour_s: f64,
    /// Of the hour's dose, in m2/s.
    pub dose_m2_s: f64,
    /// In one go, in s.
    pub in_one_go_s: f64,
}

impl Left {
    /// Of limits, after an exposure.
    pub fn of(limits: &Limits, past: &Exposed) -> Self {
        let hour =
            past.parts.iter().fold((0.0, 0.0), |(s, dose), part| (s + part.0.seconds(), dose + part.1));
        Left {
            hour_s: (3600.0 * limits.exposure_duty_max - hour.0).max(0.0),
            dose_m2_s: (limits.exposure_dose_max_m2_s - hour.1).max(0.0),
            in_one_go_s: (limits.exposure_max_s - past.in_one_go.seconds()).max(0.0),
        }
    }
}
