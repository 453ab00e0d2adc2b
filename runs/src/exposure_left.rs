//! What is left of a finger's hour of exposure, for whoever arms the rig.

use crate::format::quantity;
use crate::plan::{PassTimes, Point};
use models::PeakToPeak;
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
        let hour = in_the_last_hour(past);
        Left {
            hour_s: (3600.0 * limits.exposure_duty_max - hour.0).max(0.0),
            dose_m2_s: (limits.exposure_dose_max_m2_s - hour.1).max(0.0),
            in_one_go_s: (limits.exposure_max_s - past.in_one_go.seconds()).max(0.0),
        }
    }
}

/// Time driven in the last hour in s, and its dose in m2/s.
pub fn in_the_last_hour(past: &Exposed) -> (f64, f64) {
    past.parts.iter().fold((0.0, 0.0), |(s, dose), part| (s + part.0.seconds(), dose + part.1))
}

/// A remark on passes that vibrate a finger for longer than its limits allow without a rest; none where they
/// fit.
pub fn beyond(limits: &Limits, times: &PassTimes, points: &[Point]) -> Option<String> {
    let vibrated = |p: &&Point| p.condition.amplitude > PeakToPeak::ZERO;
    let slides = |p: &Point| times.sliding_s(p.edges, p.condition.speed_m_s)[0];
    let driven: f64 = points.iter().filter(vibrated).map(slides).sum();
    let of_hour = 3600.0 * limits.exposure_duty_max;
    let (allowed, key, until) = match limits.exposure_max_s < of_hour {
        true => (limits.exposure_max_s, "exposure_max_s", "without a rest"),
        false => (of_hour, "exposure_duty_max", "in an hour"),
    };
    (limits.human_contact && driven > allowed).then(|| {
        format!(
            "the passes vibrate the finger for {}, and `{key}` allows {} {until}: the run ends there, and the same \
             command with the same --out resumes it after a rest",
            quantity(driven.round(), "s"),
            quantity(allowed, "s"),
        )
    })
}
