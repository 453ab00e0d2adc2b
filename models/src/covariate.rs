//! The covariates: everything that tells one pass's condition from another's, each described once.
//!
//! Name (the column of the point table), unit, words, how it is read off a condition and put into one, the range that
//! any rig can have, and how the diagnosis sees it. Tables, exports, maps of the gap and the reports go through these
//! lists. A new one: its field in [`Condition`] and in [`crate::pass::Pass`], and its entry here.

use crate::condition::Condition;
use crate::quantity::{Direction, PeakToPeak};

/// What a covariate is, for whoever looks for smooth departures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CovariateRole {
    /// Set by a plan.
    Setting,
    /// Time.
    Time,
    /// Place on the plate.
    Place,
    /// Comes with the day: measured, not set.
    Climate,
}

/// The scale on which equal steps of a covariate matter equally.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// As it is, in these units.
    Linear(f64),
    /// Its logarithm.
    Log,
    /// `ln(1 + x / (share * largest))`: logarithmic, and finite at zero.
    LogFromZero(f64),
}

/// One covariate.
#[derive(Debug)]
pub struct Covariate {
    /// Name with its unit: the column of the point table.
    pub name: &'static str,
    /// In words, as in 'normal force'.
    pub words: &'static str,
    /// Factor and unit in which people read it.
    pub shown: (f64, &'static str),
    /// Smallest and largest value that an instrument of such a rig can report.
    pub range: [f64; 2],
    /// Whether the smallest value itself is within.
    pub from: bool,
    /// What would be accepted, in words, where a value is not.
    pub needed: &'static str,
    /// What it is.
    pub role: CovariateRole,
    /// Its scale.
    pub scale: Scale,
    /// Standard deviation (on the scale) up to which differences are regulation or noise and say nothing.
    pub least_spread: f64,
    /// Level of a value: repeats of one setting share it. `None`: no setting.
    pub level: Option<fn(f64) -> i64>,
    /// Coarser level: passes that share it are neighbours. `None`: no setting.
    pub neighbourhood: Option<fn(f64) -> i64>,
    get: fn(&Condition) -> Option<f64>,
    set: fn(&mut Condition, f64),
}

impl Covariate {
    /// Its value at a condition; `None` where it was not measured.
    pub fn of(&self, condition: &Condition) -> Option<f64> {
        (self.get)(condition)
    }

    /// Its value at each of some conditions; `None` where it was not measured at all of them.
    pub fn of_all(&self, conditions: &[Condition]) -> Option<Vec<f64>> {
        conditions.iter().map(self.get).collect()
    }

    /// Gives a condition this value.
    pub fn put(&self, condition: &mut Condition, value: f64) {
        (self.set)(condition, value);
    }

    /// Whether a rig can have this value.
    pub fn admits(&self, value: f64) -> bool {
        let [low, high] = self.range;
        (if self.from { value >= low } else { value > low }) && value <= high
    }

    /// The value on the covariate's scale; `largest` is the largest one of the table.
    pub fn scaled(&self, value: f64, largest: f64) -> f64 {
        match self.scale {
            Scale::Linear(unit) => value / unit,
            Scale::Log => value.ln(),
            Scale::LogFromZero(share) => (1.0 + value / (share * largest).max(1e-9)).ln(),
        }
    }
}

/// What a covariate is where its entry does not say so.
const LINEAR_SETTING: Covariate = Covariate {
    name: "",
    words: "",
    shown: (1.0, ""),
    range: [f64::NEG_INFINITY, f64::INFINITY],
    from: true,
    needed: "",
    role: CovariateRole::Setting,
    scale: Scale::Linear(1.0),
    least_spread: 0.0,
    level: None,
    neighbourhood: None,
    get: |_| None,
    set: |_, _| (),
};

/// Start of the pass.
pub static TIME: Covariate = Covariate {
    name: "time_s",
    words: "time",
    shown: (1.0, "s"),
    range: [-1e10, 1e10],
    needed: "a number of seconds, at most 1e10",
    role: CovariateRole::Time,
    get: |c| Some(c.time_s),
    set: |c, v| c.time_s = v,
    ..LINEAR_SETTING
};

/// Vibration amplitude, peak to peak.
pub static AMPLITUDE: Covariate = Covariate {
    name: "amplitude_pp_m",
    words: "amplitude",
    shown: (1e6, "\u{b5}m"),
    range: [0.0, 1e-3],
    needed: "a number of metres, zero to 1e-3 (peak to peak)",
    scale: Scale::LogFromZero(0.2),
    level: Some(|v| (v * 1e9).round() as i64),
    neighbourhood: Some(|v| ((1.0 + v * 1e6).ln() / 0.02).round() as i64),
    get: |c| Some(c.amplitude.metres()),
    set: |c, v| c.amplitude = PeakToPeak::from_metres(v),
    ..LINEAR_SETTING
};

/// Vibration frequency.
pub static FREQUENCY: Covariate = Covariate {
    name: "frequency_hz",
    words: "frequency",
    shown: (1e-3, "kHz"),
    range: [0.0, 1e7],
    from: false,
    needed: "a number of hertz above zero, up to 1e7",
    scale: Scale::Log,
    level: Some(|v| v.round() as i64),
    neighbourhood: Some(|v| (v.ln() / 0.02).round() as i64),
    get: |c| Some(c.frequency_hz),
    set: |c, v| c.frequency_hz = v,
    ..LINEAR_SETTING
};

/// Sliding speed.
pub static SPEED: Covariate = Covariate {
    name: "speed_m_s",
    words: "speed",
    shown: (1e3, "mm/s"),
    range: [0.0, 100.0],
    needed: "a speed in m/s, zero to 100 (the sign is 'direction')",
    scale: Scale::Log,
    level: Some(|v| (v.ln() * 50.0).round() as i64),
    neighbourhood: Some(|v| (v.ln() / 0.05).round() as i64),
    get: |c| Some(c.speed_m_s),
    set: |c, v| c.speed_m_s = v,
    ..LINEAR_SETTING
};

/// Direction of sliding.
pub static DIRECTION: Covariate = Covariate {
    name: "direction",
    words: "direction",
    shown: (1.0, ""),
    range: [-1.0, 1.0],
    needed: "1 or -1",
    level: Some(|v| v as i64),
    get: |c| Some(c.direction.sign()),
    set: |c, v| c.direction = if v < 0.0 { Direction::Backward } else { Direction::Forward },
    ..LINEAR_SETTING
};

/// Mean position along the plate.
pub static POSITION: Covariate = Covariate {
    name: "position_m",
    words: "position",
    shown: (1e3, "mm"),
    range: [-100.0, 100.0],
    needed: "a number of metres, -100 to 100",
    role: CovariateRole::Place,
    get: |c| Some(c.position_m),
    set: |c, v| c.position_m = v,
    ..LINEAR_SETTING
};

/// Mean normal force.
pub static NORMAL_FORCE: Covariate = Covariate {
    name: "normal_force_n",
    words: "normal force",
    shown: (1.0, "N"),
    range: [-500.0, 500.0],
    needed: "a number of newtons, -500 to 500",
    scale: Scale::Log,
    // Load is regulated: below a few per cent it carries no information, only noise.
    least_spread: 0.08,
    level: Some(|v| (v.ln() * 8.0).round() as i64),
    neighbourhood: Some(|v| (v.ln() / 0.15).round() as i64),
    get: |c| Some(c.normal_force_n),
    set: |c, v| c.normal_force_n = v,
    ..LINEAR_SETTING
};

/// Ambient pressure.
pub static AMBIENT_PRESSURE: Covariate = Covariate {
    name: "ambient_pressure_pa",
    words: "pressure",
    shown: (1e-3, "kPa"),
    range: [0.0, 1e7],
    needed: "a pressure in Pa, zero to 1e7",
    scale: Scale::Linear(101_325.0),
    level: Some(|v| (v / 500.0).round() as i64),
    neighbourhood: Some(|v| (v / 2000.0).round() as i64),
    get: |c| c.ambient_pressure_pa,
    set: |c, v| c.ambient_pressure_pa = Some(v),
    ..LINEAR_SETTING
};

/// Temperature.
pub static TEMPERATURE: Covariate = Covariate {
    name: "temperature_c",
    words: "temperature",
    shown: (1.0, "\u{b0}C"),
    range: [-273.15, 1000.0],
    needed: "a temperature in degrees Celsius, -273.15 to 1000",
    role: CovariateRole::Climate,
    // The resolution of a thermometer at the plate.
    least_spread: 0.1,
    get: |c| c.temperature_c,
    set: |c, v| c.temperature_c = Some(v),
    ..LINEAR_SETTING
};

/// Relative humidity.
pub static RELATIVE_HUMIDITY: Covariate = Covariate {
    name: "relative_humidity_pct",
    words: "relative humidity",
    shown: (1.0, "%"),
    range: [0.0, 100.0],
    needed: "a percentage, 0 to 100",
    role: CovariateRole::Climate,
    // The repeatability of a capacitive hygrometer.
    least_spread: 2.0,
    get: |c| c.relative_humidity_pct,
    set: |c, v| c.relative_humidity_pct = Some(v),
    ..LINEAR_SETTING
};

/// Columns that every point table has, in its order.
pub static REQUIRED: [&Covariate; 7] =
    [&TIME, &AMPLITUDE, &FREQUENCY, &SPEED, &DIRECTION, &POSITION, &NORMAL_FORCE];

/// Columns that a point table may have, in its order.
pub static OPTIONAL: [&Covariate; 3] = [&AMBIENT_PRESSURE, &TEMPERATURE, &RELATIVE_HUMIDITY];

/// Axes on which friction may depart smoothly. The order is that of the sums over them, and so of their rounding.
pub static SMOOTH: [&Covariate; 9] = [
    &AMPLITUDE,
    &FREQUENCY,
    &SPEED,
    &NORMAL_FORCE,
    &AMBIENT_PRESSURE,
    &TIME,
    &POSITION,
    &TEMPERATURE,
    &RELATIVE_HUMIDITY,
];

/// All covariates in the order of presentation.
pub static COVARIATES: [&Covariate; 10] = [
    &AMPLITUDE,
    &SPEED,
    &NORMAL_FORCE,
    &FREQUENCY,
    &DIRECTION,
    &POSITION,
    &TIME,
    &AMBIENT_PRESSURE,
    &TEMPERATURE,
    &RELATIVE_HUMIDITY,
];

/// Settings that repeats of a pass share, in the order in which passes are grouped.
pub static SETTINGS: [&Covariate; 6] =
    [&AMPLITUDE, &FREQUENCY, &SPEED, &DIRECTION, &NORMAL_FORCE, &AMBIENT_PRESSURE];

/// Settings that identify neighbouring passes, the first one first.
pub static NEIGHBOURS: [&Covariate; 5] = [&AMPLITUDE, &SPEED, &FREQUENCY, &NORMAL_FORCE, &AMBIENT_PRESSURE];

/// What a plan can set: everything but time and the day's climate.
pub fn planned() -> impl Iterator<Item = &'static Covariate> {
    let set = |c: &&Covariate| matches!(c.role, CovariateRole::Setting | CovariateRole::Place);
    REQUIRED.into_iter().chain(OPTIONAL).filter(set)
}

/// The covariate of that name.
pub fn by_name(name: &str) -> Option<&'static Covariate> {
    COVARIATES.into_iter().find(|c| c.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_covariate_is_in_every_list_that_it_belongs_to() {
        for c in REQUIRED.into_iter().chain(OPTIONAL) {
            assert!(by_name(c.name).is_some_and(|same| std::ptr::eq(same, c)), "{} in COVARIATES", c.name);
            let listed = |list: &[&Covariate]| list.iter().any(|other| std::ptr::eq(*other, c));
            assert_eq!(listed(&SMOOTH), c.name != "direction", "{} in SMOOTH", c.name);
            assert_eq!(listed(&SETTINGS), c.level.is_some(), "{} in SETTINGS", c.name);
            assert_eq!(listed(&NEIGHBOURS), c.neighbourhood.is_some(), "{} in NEIGHBOURS", c.name);
        }
        assert_eq!(COVARIATES.len(), REQUIRED.len() + OPTIONAL.len());
    }

    #[test]
    fn what_is_put_in_is_read_back_and_nothing_else_changes() {
        for (k, c) in COVARIATES.into_iter().enumerate() {
            let mut at = Condition::paper();
            c.put(&mut at, -1.0);
            assert_eq!(c.of(&at), Some(-1.0), "{}", c.name);
            for (j, other) in COVARIATES.into_iter().enumerate() {
                let same = other.of(&at) == other.of(&Condition::paper());
                assert!(j == k || same, "{} changes {}", c.name, other.name);
            }
        }
    }

    #[test]
    fn the_papers_point_is_within_every_range_and_absurd_ones_are_not() {
        for c in COVARIATES {
            assert!(c.of(&Condition::paper()).is_none_or(|v| c.admits(v)), "{}", c.name);
            for absurd in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e19] {
                assert!(!c.admits(absurd), "{} = {absurd}", c.name);
            }
        }
    }
}
