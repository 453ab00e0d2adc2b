//! What a world is made of.

use crate::amplifier::AmplifierConfig;
use crate::defects::Defects;
use crate::finger::FingerConfig;
use crate::plate::PlateConfig;
use crate::room::RoomConfig;
use crate::sensor::SensorConfig;
use crate::stage::StageConfig;
use serde::{Deserialize, Serialize};

/// Everything a world is built from, besides its seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct WorldConfig {
    /// Step of the world (ns). Bodies are stepped exactly for inputs that are constant over it.
    pub tick_ns: u64,
    /// Repeatability: relative standard deviation of the lateral force from stroke to stroke (-).
    pub pass_relative_sd: f64,
    /// Whether the contact is marched cycle by cycle or averaged over cycles.
    pub contact: ContactMode,
    /// The fingertip.
    pub finger: FingerConfig,
    /// The plate.
    pub plate: PlateConfig,
    /// The amplifier.
    pub amplifier: AmplifierConfig,
    /// The force sensor.
    pub sensor: SensorConfig,
    /// The stage.
    pub stage: StageConfig,
    /// The room.
    pub room: RoomConfig,
    /// What is wrong.
    #[serde(skip)]
    pub defects: Defects,
}

/// How the contact is solved while the world runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ContactMode {
    /// The mean of the periodic state, at each tick: fast; blind to transients shorter than a tick.
    #[default]
    Averaged,
    /// Every cycle of the plate in turn: shows the transients of a burst; slower.
    Resolved,
}

/// A configuration that no world can be built from.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{field} = {value}: {needed}")]
pub struct ConfigError {
    /// Which value.
    pub field: &'static str,
    /// What it is.
    pub value: f64,
    /// What would do.
    pub needed: &'static str,
}

impl Default for WorldConfig {
    fn default() -> Self {
        Self {
            tick_ns: 500_000,
            pass_relative_sd: 0.015,
            contact: ContactMode::Averaged,
            finger: FingerConfig::default(),
            plate: PlateConfig::default(),
            amplifier: AmplifierConfig::default(),
            sensor: SensorConfig::default(),
            stage: StageConfig::default(),
            room: RoomConfig::default(),
            defects: Defects::none(),
        }
    }
}

impl WorldConfig {
    /// The world of the model's own assumptions: massless, no defects. Noise, repeatability and the
    /// fingertip's scatter about its nominal stiffnesses are those its rig.toml states.
    pub fn ideal() -> Self {
        Self::default()
    }

    /// The rig bundled with the program: it departs from the model by one sealed effect.
    pub fn bundled() -> Self {
        let (name, seed) = BUNDLED;
        Self { defects: Defects::sealed(name, seed).unwrap_or_default(), ..Self::default() }
    }

    /// Checks what the bodies rely on.
    ///
    /// # Errors
    /// The first value that cannot be.
    pub fn check(&self) -> Result<(), ConfigError> {
        let tick = self.tick_ns as f64 * 1e-9;
        let positive = [
            ("tick_ns", self.tick_ns as f64),
            ("finger.normal_stiffness_n_per_m", self.finger.normal_stiffness_n_per_m),
            ("finger.lateral_stiffness_n_per_m", self.finger.lateral_stiffness_n_per_m),
            ("finger.mu0", self.finger.mu0),
            ("finger.pad_stiffness_n_per_m", self.finger.pad_stiffness_n_per_m),
            ("plate.quality_factor", self.plate.quality_factor),
            ("plate.warming_time_s", self.plate.warming_time_s),
            ("amplifier.amplitude_step_m", self.amplifier.amplitude_step_m),
            ("amplifier.frequency_step_hz", self.amplifier.frequency_step_hz),
            ("amplifier.watchdog_s", self.amplifier.watchdog_s),
            ("room.chamber.time_constant_s", self.room.chamber.time_constant_s),
            ("sensor.bandwidth_hz", self.sensor.bandwidth_hz),
            ("sensor.count_n", self.sensor.count_n),
            ("sensor.full_scale_n", self.sensor.full_scale_n),
            ("sensor.wander_time_s", self.sensor.wander_time_s),
            ("stage.acceleration_m_s2", self.stage.acceleration_m_s2),
            ("stage.load_time_s", self.stage.load_time_s),
            ("stage.encoder_m", self.stage.encoder_m),
            ("stage.load_wander_s", self.stage.load_wander_s),
        ];
        let refused = |field, value, needed| Err(ConfigError { field, value, needed });
        if let Some((field, value)) = positive.into_iter().find(|(_, v)| !(v.is_finite() && *v > 0.0)) {
            return refused(field, value, "a finite number above zero is needed");
        }
        let not_negative = [
            ("pass_relative_sd", self.pass_relative_sd),
            ("amplifier.response_s", self.amplifier.response_s),
            ("finger.stiffness_relative_sd", self.finger.stiffness_relative_sd),
            ("finger.ridge_mass_kg", self.finger.ridge_mass_kg),
            ("finger.ridge_damping_ratio", self.finger.ridge_damping_ratio),
            ("finger.lateral_recovery_m_s", self.finger.lateral_recovery_m_s),
            ("finger.ridge_table_strokes", self.finger.ridge_table_strokes),
            ("sensor.latency_s", self.sensor.latency_s),
            ("sensor.unstated_latency_s", self.sensor.unstated_latency_s),
            ("room.ambient_pressure_pa", self.room.ambient_pressure_pa),
            ("room.chamber.leak_per_s", self.room.chamber.leak_per_s),
        ];
        if let Some((field, value)) = not_negative.into_iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
            return refused(field, value, "a finite number, zero or more, is needed");
        }
        let scatter = self.finger.stiffness_relative_sd;
        if scatter > 0.3 {
            let needed = "at most 0.3, so that a stiffness stays positive";
            return refused("finger.stiffness_relative_sd", scatter, needed);
        }
        for (field, value) in [
            ("sensor.sample_period_s", self.sensor.sample_period_s),
            ("amplifier.state_period_s", self.amplifier.state_period_s),
            ("stage.state_period_s", self.stage.state_period_s),
        ] {
            let ticks = value / tick;
            if !(ticks >= 0.999 && (ticks - ticks.round()).abs() < 1e-6) {
                return refused(field, value, "a whole number of ticks (tick_ns) is needed");
            }
        }
        let [first, second] = self.stage.travel_m;
        if second <= first {
            return refused("stage.travel_m", second, "the second end must lie above the first");
        }
        Ok(())
    }
}

/// The bundled rig's departure from the model: a kind of defect and the seed its parameters are drawn from.
const BUNDLED: (&str, u64) = ("squeeze_film", 3);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bundled_rig_has_its_one_defect() {
        assert_eq!(WorldConfig::bundled().defects.defects.len(), 1);
        assert!(WorldConfig::ideal().defects.defects.is_empty());
    }

    #[test]
    fn a_configuration_that_cannot_be_is_refused_by_name() {
        let mut config = WorldConfig::ideal();
        config.sensor.sample_period_s = 7e-4;
        assert_eq!(config.check().unwrap_err().field, "sensor.sample_period_s");
        let mut config = WorldConfig::ideal();
        config.finger.mu0 = f64::NAN;
        assert_eq!(config.check().unwrap_err().field, "finger.mu0");
    }
}
