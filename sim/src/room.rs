//! The air around the rig and the chamber that changes it: a first-order lag towards a set-point, and a leak
//! to the room outside.

use serde::{Deserialize, Serialize};

/// The room around the rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RoomConfig {
    /// Ambient pressure (Pa).
    pub ambient_pressure_pa: f64,
    /// Temperature (deg C).
    pub temperature_c: f64,
    /// Relative humidity (%).
    pub relative_humidity_pct: f64,
    /// The chamber.
    pub chamber: ChamberConfig,
}

impl Default for RoomConfig {
    fn default() -> Self {
        Self {
            ambient_pressure_pa: 101_325.0,
            temperature_c: 22.0,
            relative_humidity_pct: 45.0,
            chamber: ChamberConfig::default(),
        }
    }
}

/// A chamber around the rig.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ChamberConfig {
    /// Time constant towards a set-point (s).
    pub time_constant_s: f64,
    /// Share of the difference to the room outside that leaks in a second (1/s).
    pub leak_per_s: f64,
    /// It takes set-points and does nothing.
    pub stuck: bool,
    /// Its valve opens at this time, and what it held escapes (s).
    pub vents_at_s: f64,
}

impl Default for ChamberConfig {
    fn default() -> Self {
        Self { time_constant_s: 1.0, leak_per_s: 1e-4, stuck: false, vents_at_s: f64::MAX }
    }
}

/// A quantity of the air.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Air {
    /// Pressure (Pa).
    Pressure,
    /// Temperature (deg C).
    Temperature,
    /// Relative humidity (%).
    Humidity,
}

/// The air as it is.
#[derive(Clone, Copy, Debug)]
pub struct Room {
    chamber: ChamberConfig,
    outside: [f64; 3],
    now: [f64; 3],
    set: [Option<f64>; 3],
}

impl Room {
    /// The air of a room whose chamber is open.
    pub fn new(config: &RoomConfig) -> Self {
        let outside = [config.ambient_pressure_pa, config.temperature_c, config.relative_humidity_pct];
        Self { chamber: config.chamber, outside, now: outside, set: [None; 3] }
    }

    /// The value now.
    pub fn of(&self, air: Air) -> f64 {
        self.now[air as usize]
    }

    /// Gives the chamber a set-point, at least zero for pressure and humidity.
    pub fn set(&mut self, air: Air, value: f64) {
        self.set[air as usize] = Some(if air == Air::Temperature { value } else { value.max(0.0) });
    }

    /// A step of `dt` s up to `time_s`.
    pub fn step(&mut self, time_s: f64, dt: f64) {
        let ChamberConfig { time_constant_s, leak_per_s, stuck, vents_at_s } = self.chamber;
        for ((now, set), outside) in self.now.iter_mut().zip(self.set).zip(self.outside) {
            let Some(set) = set.filter(|_| !stuck) else { continue };
            let goal = if time_s >= vents_at_s { outside } else { set };
            let (pull, leak) = (1.0 / time_constant_s, leak_per_s);
            let end = (pull * goal + leak * outside) / (pull + leak);
            *now = end + (*now - end) * (-dt * (pull + leak)).exp();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(config: ChamberConfig, seconds: f64) -> Room {
        let mut room = Room::new(&RoomConfig { chamber: config, ..RoomConfig::default() });
        room.set(Air::Pressure, 50_000.0);
        for n in 1..=(seconds * 1000.0) as u64 {
            room.step(n as f64 * 1e-3, 1e-3);
        }
        room
    }

    /// The closed form: an exponential towards the balance of pump and leak.
    #[test]
    fn a_chamber_follows_its_set_point_as_a_first_order_lag_and_leaks() {
        let config = ChamberConfig { leak_per_s: 0.02, ..ChamberConfig::default() };
        let end = (50_000.0 + 0.02 * 101_325.0) / 1.02;
        let expected = end + (101_325.0 - end) * (-1.02f64 * 1.5).exp();
        assert!((run(config, 1.5).of(Air::Pressure) - expected).abs() < 1e-3);
        assert!((run(config, 30.0).of(Air::Pressure) - end).abs() < 1e-3);
        assert_eq!(run(config, 1.0).of(Air::Temperature), 22.0, "what was not set stays");
    }

    #[test]
    fn a_stuck_chamber_shows_the_set_point_and_keeps_the_room() {
        let room = run(ChamberConfig { stuck: true, ..ChamberConfig::default() }, 10.0);
        assert_eq!((room.set[0], room.of(Air::Pressure)), (Some(50_000.0), 101_325.0));
        let vented = run(ChamberConfig { vents_at_s: 10.0, ..ChamberConfig::default() }, 20.0);
        assert!((vented.of(Air::Pressure) - 101_325.0).abs() < 10.0);
    }
}
