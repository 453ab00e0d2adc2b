//! One operating point of the rig.

use crate::quantity::{Direction, PeakToPeak};
use serde::{Deserialize, Serialize};

/// The conditions of one pass: what a prediction needs to know besides the fingertip. Each is a covariate of
/// the table in [`crate::covariate`]; what was not measured is `None`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Condition {
    /// Peak-to-peak vibration amplitude `w`.
    pub amplitude: PeakToPeak,
    /// Vibration frequency `f` in Hz.
    pub frequency_hz: f64,
    /// Sliding speed `U` (magnitude) in m/s.
    pub speed_m_s: f64,
    /// Direction of sliding.
    pub direction: Direction,
    /// Normal force `F_n` in N, positive in compression.
    pub normal_force_n: f64,
    /// Coulomb friction coefficient without vibration, `mu_0`, as far as it is known at the condition.
    pub mu0: f64,
    /// Mean position along the stroke in m.
    pub position_m: f64,
    /// Time since the start of the table or record in s.
    pub time_s: f64,
    /// Time since the first pass of the run in s, in tables of several runs; `None`: `time_s` counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run_time_s: Option<f64>,
    /// Ambient pressure in Pa.
    pub ambient_pressure_pa: Option<f64>,
    /// Temperature in degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Relative humidity in per cent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_humidity_pct: Option<f64>,
}

/// What is known of the air about the rig, where no channel reads it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ambient {
    /// Ambient pressure in Pa.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_pressure_pa: Option<f64>,
    /// Temperature in degrees Celsius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Relative humidity in per cent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub relative_humidity_pct: Option<f64>,
}

impl Condition {
    /// The paper's nominal point (Fig. 9): 2 um peak-to-peak, 27.5 kHz, 20 mm/s, 0.25 N, `mu_0` 0.5.
    pub const fn paper() -> Self {
        Condition {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            speed_m_s: 0.02,
            direction: Direction::Forward,
            normal_force_n: 0.25,
            mu0: 0.5,
            position_m: 0.0,
            time_s: 0.0,
            run_time_s: None,
            ambient_pressure_pa: None,
            temperature_c: None,
            relative_humidity_pct: None,
        }
    }

    /// The same, with what the condition does not say of the air taken from `ambient`.
    pub fn within(self, ambient: &Ambient) -> Self {
        Condition {
            ambient_pressure_pa: self.ambient_pressure_pa.or(ambient.ambient_pressure_pa),
            temperature_c: self.temperature_c.or(ambient.temperature_c),
            relative_humidity_pct: self.relative_humidity_pct.or(ambient.relative_humidity_pct),
            ..self
        }
    }

    /// Time since the first pass of the run in s; since the start of a table without runs.
    pub fn time_in_run_s(&self) -> f64 {
        self.run_time_s.unwrap_or(self.time_s)
    }

    /// How long a change has gone on that the first pass of the table began, s; this share of its clock
    /// starts again with each run. A pass before the first saw none of it: never negative.
    pub fn elapsed_s(&self, share_in_run: f64) -> f64 {
        let [all, run] = [self.time_s, self.time_in_run_s()].map(|t| t.max(0.0));
        all + share_in_run * (run - all)
    }

    /// The first value that no model can work with, by name, or `Ok`.
    ///
    /// # Errors
    /// Amplitude or speed negative, frequency, normal force or `mu_0` not positive, or anything not finite.
    pub fn check(&self) -> Result<(), OutOfDomain> {
        let (at_least_zero, positive) = ("a finite number, zero or more", "a finite number above zero");
        for (name, value) in [("amplitude_pp_m", self.amplitude.metres()), ("speed_m_s", self.speed_m_s)] {
            OutOfDomain::unless(value.is_finite() && value >= 0.0, name, value, at_least_zero)?;
        }
        let (frequency, load) = (self.frequency_hz, self.normal_force_n);
        for (name, value) in [("frequency_hz", frequency), ("normal_force_n", load), ("mu0", self.mu0)] {
            OutOfDomain::unless(value.is_finite() && value > 0.0, name, value, positive)?;
        }
        Ok(())
    }
}

impl Ambient {
    /// What a condition says of the air.
    pub fn of(condition: &Condition) -> Self {
        Ambient {
            ambient_pressure_pa: condition.ambient_pressure_pa,
            temperature_c: condition.temperature_c,
            relative_humidity_pct: condition.relative_humidity_pct,
        }
    }
}

/// A value outside what a model is defined for.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{name} = {value}: {needed} is needed")]
pub struct OutOfDomain {
    /// The quantity, with its unit in the name.
    pub name: &'static str,
    /// What was given.
    pub value: f64,
    /// What would be accepted.
    pub needed: &'static str,
}

impl OutOfDomain {
    /// The value itself as an error, unless it is accepted.
    ///
    /// # Errors
    /// Where it is not.
    pub fn unless(accepted: bool, name: &'static str, value: f64, needed: &'static str) -> Result<(), Self> {
        if accepted { Ok(()) } else { Err(OutOfDomain { name, value, needed }) }
    }
}
