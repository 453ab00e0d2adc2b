//! Levels of a setting: passes of one setting are measured at values that scatter, and a figure shows them as
//! one.

use crate::format::number;

/// How far, as a share, the values of one frequency, of one speed and of one normal force lie apart.
pub const FREQUENCY: f64 = 0.01;
/// See [`FREQUENCY`].
pub const SPEED: f64 = 0.03;
/// See [`FREQUENCY`].
pub const FORCE: f64 = 0.10;
/// See [`FREQUENCY`]; the pressure of the air.
pub const PRESSURE: f64 = 0.02;

/// The levels in some values, rising.
pub struct Levels(Vec<Vec<f64>>);

impl Levels {
    /// Values within a share of a level's least belong to it: a bound between fixed digits would cut through
    /// the scatter of one setting.
    pub fn of(values: impl Iterator<Item = f64>, within: f64) -> Self {
        let mut sorted: Vec<f64> = values.collect();
        sorted.sort_by(f64::total_cmp);
        let mut all: Vec<Vec<f64>> = Vec::new();
        for value in sorted {
            match all.last_mut().filter(|level| value <= (1.0 + within) * level[0]) {
                Some(level) => level.push(value),
                None => all.push(vec![value]),
            }
        }
        Levels(all)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// In which of them a value lies.
    pub fn index(&self, value: f64) -> usize {
        self.0.iter().rposition(|level| level[0] <= value).unwrap_or(0)
    }

    /// Each by its mean.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().map(|level| number(level.iter().sum::<f64>() / level.len() as f64)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_setting_scatters_is_one_level() {
        let loads = [0.2485, 0.5031, 0.2539, 0.2451, 0.4962];
        let levels = Levels::of(loads.into_iter(), FORCE);
        assert_eq!(levels.names(), ["0.249", "0.5"]);
        assert_eq!(loads.map(|load| levels.index(load)), [0, 1, 0, 0, 1]);
        let speeds = Levels::of([12.4999, 12.5001, 5.0, 13.0].into_iter(), SPEED);
        assert_eq!((speeds.count(), speeds.names()), (3, vec!["5".into(), "12.5".into(), "13".into()]));
    }
}
