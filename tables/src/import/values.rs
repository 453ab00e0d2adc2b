//! A row of the source in SI: what each target has there, and why a row cannot be taken.

use super::grid::{Cell, Grid, Row};
use super::map::{Map, way};
use super::targets::{COUNT, ColumnKind, Id};
use instruments::{Dimension, Unit};
use models::{Condition, Pass, PeakToPeak, covariate};
use serde::Serialize;

/// Why a cell of a number is not taken.
pub const NO_NUMBER: &str = "no number";
/// Why a cell of a direction is not taken.
pub const NO_WAY: &str = "no direction: 1, -1, forward or backward is needed";
/// Why a cell of a time is not taken.
pub const NO_TIME: &str = "neither a number nor a time of day";

/// A row that is left out, and why.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Dropped {
    /// Line or row of the source, from 1.
    pub row: u64,
    /// Column of the source or of the point table.
    pub column: String,
    /// What stands there.
    pub text: String,
    /// Why that is not taken.
    pub reason: String,
}

/// What a row says, in SI, by the places of the targets.
#[derive(Clone, Debug)]
pub struct Values {
    /// Line or row of the source.
    pub place: u64,
    /// NaN for nothing: a series has many of these.
    numbers: [f64; COUNT],
    /// The name of the run.
    pub run: Option<String>,
}

/// Mean of a value over the rows that have it.
pub fn mean(rows: &[Values], of: impl Fn(&Values) -> Option<f64>) -> Option<f64> {
    let known: Vec<f64> = rows.iter().filter_map(of).collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}

/// Numbers from the least to the largest.
pub fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut all: Vec<f64> = values.collect();
    all.sort_by(f64::total_cmp);
    all
}

/// The one in the middle of sorted numbers.
pub fn middle(sorted: &[f64]) -> Option<f64> {
    sorted.get(sorted.len() / 2).copied()
}

/// Whether values are too many to be alike by chance, and no two of them are.
pub fn all_differ(mut values: Vec<impl Ord>) -> bool {
    values.sort_unstable();
    values.len() > 3 && values.windows(2).all(|pair| pair[0] != pair[1])
}

impl Values {
    /// The value of a target.
    pub fn get(&self, id: Id) -> Option<f64> {
        Some(self.numbers[id as usize]).filter(|v| !v.is_nan())
    }

    /// Reads a row. `clock` is its time where a clock, or its number, says it.
    ///
    /// # Errors
    /// The first cell that cannot be read.
    pub fn read(grid: &Grid, map: &Map, row: &Row, clock: Option<f64>) -> Result<Self, Dropped> {
        let mut values = Values { place: row.place, numbers: [f64::NAN; COUNT], run: None };
        for constant in &map.constants {
            if constant.target.kind == ColumnKind::Text {
                values.run = Some(constant.text.clone());
            } else {
                values.numbers[constant.target.id as usize] = constant.value;
            }
        }
        if let Some(time) = clock {
            values.numbers[Id::Time as usize] = time;
        }
        for column in &map.columns {
            let Some(cell) = row.cells.get(column.index).filter(|c| **c != Cell::Empty) else { continue };
            let drop = |reason: &str| {
                let (column, text) = (column.header.clone(), cell.shown());
                Dropped { row: row.place, column, text, reason: reason.into() }
            };
            let number = || match (cell.ratio(grid.comma), column.target.kind) {
                (None, _) => cell.digits(grid.comma).and_then(|d| column.unit.apply(&d)),
                // A minus before a unit turns these too.
                (Some(ratio), ColumnKind::Number(Dimension::Ratio)) => {
                    Some(ratio * column.unit.factor().signum())
                }
                // Through the decimal digits: a hundred times 0.07 is not 7.
                (Some(ratio), ColumnKind::Number(Dimension::Percentage)) => {
                    Unit::parse(Dimension::Percentage, "1")?.apply(&format!("{ratio:e}"))
                }
                _ => None,
            };
            let value = match column.target.kind {
                ColumnKind::Text => {
                    values.run = Some(cell.shown());
                    continue;
                }
                ColumnKind::Way => {
                    let text = cell.digits(grid.comma).unwrap_or_default();
                    way(&text, &column.unit_text).ok_or_else(|| drop(NO_WAY))?
                }
                ColumnKind::Count => {
                    let whole = |v: &f64| v.fract() == 0.0 && (0.0..9e15).contains(v);
                    number().filter(whole).ok_or_else(|| drop("no whole number"))?
                }
                ColumnKind::Number(_) if column.target.id == Id::Time => {
                    clock.or_else(number).ok_or_else(|| drop(NO_TIME))?
                }
                ColumnKind::Number(_) => number().ok_or_else(|| match cell {
                    Cell::Clock(s) if grid.format.starts_with("workbook") => {
                        // 1970 begins with a workbook's day 25569.
                        let date = calibration::certificate::date::format(*s as i64 - 25_569 * 86_400);
                        drop(&format!("the spreadsheet made a date of it, {date}"))
                    }
                    _ => drop(NO_NUMBER),
                })?,
            };
            values.numbers[column.target.id as usize] = value;
        }
        Ok(values)
    }

    /// Takes means over rows in place of the values of one; time stays.
    pub fn average(&mut self, rows: &[Values]) {
        for k in (0..COUNT).filter(|k| *k != Id::Time as usize) {
            self.numbers[k] = mean(rows, |v| Some(v.numbers[k]).filter(|v| !v.is_nan())).unwrap_or(f64::NAN);
        }
    }

    /// States the motion and the lateral force of a stretch, whatever they were had from.
    pub fn put_motion(&mut self, speed_m_s: f64, direction: f64, lateral_n: Option<f64>) {
        for id in [Id::Velocity, Id::FrictionForce, Id::FrictionCoefficient, Id::Point] {
            self.numbers[id as usize] = f64::NAN;
        }
        self.numbers[Id::Speed as usize] = speed_m_s;
        self.numbers[Id::Direction as usize] = direction;
        self.numbers[Id::LateralForce as usize] = lateral_n.unwrap_or(f64::NAN);
    }

    /// Peak-to-peak amplitude, m.
    pub fn amplitude(&self) -> Option<f64> {
        let peak = || self.get(Id::AmplitudePeak).map(|a| 2.0 * a);
        let rms = || self.get(Id::AmplitudeRms).map(|a| 2.0 * std::f64::consts::SQRT_2 * a);
        self.get(Id::AmplitudePp).or_else(peak).or_else(rms)
    }

    /// Direction of sliding: stated, or the sign of the velocity.
    pub fn direction(&self) -> Option<f64> {
        let sign = || self.get(Id::Velocity).filter(|v| *v != 0.0).map(f64::signum);
        self.get(Id::Direction).or_else(sign)
    }

    /// Sliding speed, m/s.
    pub fn speed(&self) -> Option<f64> {
        self.get(Id::Speed).or_else(|| self.get(Id::Velocity).map(f64::abs))
    }

    /// Lateral force in the sensor's frame, N, for a direction of sliding.
    pub fn lateral(&self, direction: f64) -> Option<f64> {
        let friction = || self.get(Id::FrictionForce).map(|f| direction * f);
        let coefficient =
            || Some(direction * self.get(Id::FrictionCoefficient)? * self.get(Id::NormalForce)?);
        self.get(Id::LateralForce).or_else(friction).or_else(coefficient)
    }

    /// Why a sample cannot be one beside a typical `load` in N: sliding, standing still or without touch, it
    /// has what no pass can have.
    pub fn implausible(&self, load: f64) -> Option<Dropped> {
        let mut probe = self.clone();
        probe.put_motion(0.01, 1.0, self.lateral(1.0));
        let normal = &mut probe.numbers[Id::NormalForce as usize];
        if normal.abs() > 100.0 * load {
            return Some(self.drop("normal_force_n", Some(*normal), "over a hundred median loads"));
        }
        *normal = load;
        probe.pass(1).err().filter(|why| !why.reason.starts_with("empty"))
    }

    /// The row as one that is left out for what it has in a column.
    pub fn drop(&self, column: &str, value: Option<f64>, reason: &str) -> Dropped {
        let text = value.map(|v| v.to_string()).unwrap_or_default();
        Dropped { row: self.place, column: column.into(), text, reason: reason.into() }
    }

    /// The row as a pass.
    ///
    /// # Errors
    /// What is missing, or what no pass can have.
    pub fn pass(&self, number: u64) -> Result<Pass, Dropped> {
        let need = |column: &str, value: Option<f64>| value.ok_or_else(|| self.drop(column, None, "empty"));
        let amplitude = need("amplitude_pp_m", self.amplitude())?;
        let frequency = match self.get(Id::Frequency) {
            Some(frequency) => frequency,
            None if amplitude == 0.0 => Condition::paper().frequency_hz,
            None => return Err(self.drop("frequency_hz", None, "empty, and the plate vibrates")),
        };
        let direction = match self.direction() {
            Some(direction) => direction,
            None if self.get(Id::Velocity) == Some(0.0) => {
                return Err(self.drop("speed_m_s", Some(0.0), "nothing slides, so there is no direction"));
            }
            None => return Err(self.drop("direction", None, "empty")),
        };
        let mut condition = Condition::paper();
        condition.amplitude = PeakToPeak::from_metres(amplitude);
        for (covariate, value) in [
            (&covariate::TIME, Some(need("time_s", self.get(Id::Time))?)),
            (&covariate::FREQUENCY, Some(frequency)),
            (&covariate::SPEED, Some(need("speed_m_s", self.speed())?)),
            (&covariate::DIRECTION, Some(direction)),
            (&covariate::POSITION, self.get(Id::Position).or(Some(0.0))),
            (&covariate::NORMAL_FORCE, Some(need("normal_force_n", self.get(Id::NormalForce))?)),
            (&covariate::AMBIENT_PRESSURE, self.get(Id::Pressure)),
            (&covariate::TEMPERATURE, self.get(Id::Temperature)),
            (&covariate::RELATIVE_HUMIDITY, self.get(Id::Humidity)),
        ] {
            if let Some(value) = value {
                covariate.put(&mut condition, value);
            }
        }
        let lateral = need("lateral_force_n", self.lateral(direction))?;
        let count = |id| self.get(id).map(|v| v as u64);
        let pass = Pass {
            normal_force_sd_n: self.get(Id::NormalForceSd),
            lateral_force_sd_n: self.get(Id::LateralForceSd),
            samples: count(Id::Samples),
            phase_shift_deg: self.get(Id::PhaseShift),
            replicate: count(Id::Replicate),
            run: self.run.clone(),
            session: count(Id::Session),
            ..Pass::at(count(Id::Point).unwrap_or(number), &condition, Some(lateral))
        };
        diagnosis::data::check(&pass).map_err(|error| match error {
            diagnosis::data::DataError::BadValue { column, value, needed, .. } => {
                self.drop(column, Some(value), &format!("{needed} is needed"))
            }
            other => self.drop("", None, &other.to_string()),
        })?;
        Ok(pass)
    }
}
