//! The table: what was measured, and what the design can show. docs/diagnosis/model.md, section 1.

use effects::{Design, Need};
use models::covariate::{self, Scale};
pub use models::rig_file::RigFile;
use models::{Condition, Pass, PeakToPeak};

/// A table that the diagnosis refuses, and what would mend it.
#[derive(Debug, thiserror::Error, PartialEq)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum DataError {
    /// Too few passes to say anything.
    #[error("{0} passes with a lateral force; at least 12 are needed")]
    TooFew(usize),
    /// A value no pass can have.
    #[error("point {point}: {column} = {value}; {needed} is needed")]
    BadValue { point: u64, column: &'static str, value: f64, needed: &'static str },
    /// Forces of one sign in both directions of motion.
    #[error(
        "lateral_force_n has one sign in both directions of motion, and the same size: friction turns with the direction. \
         Give signed forces (along the plate's axis, not magnitudes)"
    )]
    Unsigned,
    /// Friction that pushes along the sliding.
    #[error("{}", models::pass::REVERSED)]
    Reversed,
    /// A point number that stands twice.
    #[error("point {0} stands twice; number the points apart")]
    DoublePoint(u64),
    /// One reading under two numbers.
    #[error(
        "points {0} and {1} are one reading: time, conditions and forces are equal to the last digit. Was a table appended to \
         itself? Remove the second copy, for a pass that counts twice makes every probability too sure; two passes have a time each"
    )]
    DoubleReading(u64, u64),
}

/// Points of a reading that stands under two numbers. Where the table knows no time, equal numbers may be two passes.
fn read_twice(passes: &[&Pass]) -> Option<[u64; 2]> {
    let bits = |p: &Pass| {
        [
            p.time_s,
            p.normal_force_n,
            p.lateral_force_n.unwrap_or(0.0),
            p.speed_m_s,
            p.amplitude.metres(),
            p.frequency_hz,
            p.direction.sign(),
            p.position_m,
        ]
        .map(f64::to_bits)
    };
    let mut rows: Vec<_> = passes.iter().map(|p| (bits(p), p.run.as_deref(), p.session, p.point)).collect();
    rows.sort_unstable();
    let knows_time = rows.first()?.0[0] != rows.last()?.0[0];
    let twice = rows.windows(2).find(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1))?;
    knows_time.then_some([twice[0].3, twice[1].3])
}

/// Least guess of mu0 where no pass has the plate still.
const LEAST_MU0: f64 = 0.05;
/// Relative difference below which two frequencies are one.
const SAME_FREQUENCY: f64 = 1e-3;
/// Range of temperatures below which a table shows nothing of them, K.
const SAME_TEMPERATURE_K: f64 = 0.3;
/// Range of relative humidity below which it counts as one, percent.
const SAME_HUMIDITY_PCT: f64 = 3.0;

/// Passes in the order of measurement, with the groups that are held out together.
#[derive(Debug, Clone)]
pub struct Table {
    /// Numbers of the points.
    pub points: Vec<u64>,
    /// Conditions.
    pub passes: Vec<Condition>,
    /// Measured lateral force, N (zero in a table of conditions).
    pub lateral: Vec<f64>,
    /// Run of each pass, numbered in the order of appearance.
    pub runs: Vec<usize>,
    /// Number of runs that the table tells apart; of conditions to predict, the number of runs of the table
    /// that was diagnosed: runs from this number on are new.
    pub run_count: usize,
    /// Reference scales.
    pub design: Design,
}

impl Table {
    /// Takes a table of measured passes.
    ///
    /// # Errors
    /// Fewer than 12 passes, values that no pass can have, forces without a sign or with the other one, points
    /// or readings that stand twice.
    pub fn measured(passes: &[Pass]) -> Result<Self, DataError> {
        let measured: Vec<&Pass> = passes.iter().filter(|p| p.lateral_force_n.is_some()).collect();
        if measured.len() < 12 {
            return Err(DataError::TooFew(measured.len()));
        }
        if let Some([first, second]) = read_twice(&measured) {
            return Err(DataError::DoubleReading(first, second));
        }
        let reversed = models::pass::is_reversed(measured.iter().copied());
        let table = Self::build(measured, None)?;
        if table.is_unsigned() {
            return Err(DataError::Unsigned);
        }
        if reversed { Err(DataError::Reversed) } else { Ok(table) }
    }

    /// Whether lateral forces are magnitudes: of one sign in both directions, and as large in one as in the
    /// other. An offset that hides the turn of friction makes the two differ by far.
    fn is_unsigned(&self) -> bool {
        let of = |forward: bool| -> Vec<f64> {
            let rows = self.passes.iter().zip(&self.lateral);
            let own = rows.filter(|(p, _)| (p.direction.sign() > 0.0) == forward);
            own.map(|(p, l)| l / p.normal_force_n).collect()
        };
        let (forward, backward) = (of(true), of(false));
        if forward.len().min(backward.len()) < FEWEST_OF_A_DIRECTION {
            return false;
        }
        let one_sign = |list: &[f64]| {
            let up = list.iter().filter(|r| **r > 0.0).count() as f64 / list.len() as f64;
            i8::from(up >= ONE_SIGN) - i8::from(up <= 1.0 - ONE_SIGN)
        };
        let mean = |list: &[f64]| list.iter().sum::<f64>() / list.len() as f64;
        let ratio = mean(&forward) / mean(&backward);
        one_sign(&forward) != 0
            && one_sign(&forward) == one_sign(&backward)
            && (1.0 / AS_LARGE..=AS_LARGE).contains(&ratio)
    }

    /// Takes a table of conditions to predict, on the scales of the table that was diagnosed.
    ///
    /// # Errors
    /// Values that no pass can have, points that stand twice.
    pub fn conditions(passes: &[Pass], origin: &Origin) -> Result<Self, DataError> {
        Self::build(passes.iter().collect(), Some(origin))
    }

    fn build(mut rows: Vec<&Pass>, origin: Option<&Origin>) -> Result<Self, DataError> {
        // Row order carries no meaning: the order of measurement is time, ties by number.
        rows.sort_by(|a, b| a.time_s.total_cmp(&b.time_s).then(a.point.cmp(&b.point)));
        let mut numbers: Vec<u64> = rows.iter().map(|p| p.point).collect();
        numbers.sort_unstable();
        if let Some(pair) = numbers.windows(2).find(|w| w[0] == w[1]) {
            return Err(DataError::DoublePoint(pair[0]));
        }
        rows.iter().try_for_each(|p| check(p))?;
        let start = origin.map_or_else(|| rows.first().map_or(0.0, |p| p.time_s), |o| o.time_s);
        let known = origin.map_or(&[][..], |o| &o.runs);
        let mut names: Vec<(Option<&str>, f64)> = known.iter().map(|(n, t)| (n.as_deref(), *t)).collect();
        let mut runs = Vec::with_capacity(rows.len());
        for p in &rows {
            let name = p.run.as_deref();
            let index = names.iter().position(|(n, _)| *n == name).unwrap_or_else(|| {
                names.push((name, p.time_s));
                names.len() - 1
            });
            runs.push(index);
        }
        let passes: Vec<Condition> = rows
            .iter()
            .zip(&runs)
            .map(|(p, &run)| Condition {
                time_s: p.time_s - start,
                run_time_s: Some(p.time_s - names[run].1),
                // What friction is without vibration is the baseline's to say, not the condition's.
                ..p.condition(1.0)
            })
            .collect();
        let design = origin.map_or_else(|| scales(&passes), |o| o.design);
        Ok(Table {
            points: rows.iter().map(|p| p.point).collect(),
            lateral: rows.iter().map(|p| p.lateral_force_n.unwrap_or(0.0)).collect(),
            passes,
            run_count: origin.map_or(names.len(), |o| o.runs.len()),
            runs,
            design,
        })
    }

    /// A pass with its load in units of the table's mean load: levels of the load then do not depend on the unit of force.
    pub(crate) fn in_its_loads(&self, pass: &Condition) -> Condition {
        Condition { normal_force_n: pass.normal_force_n / self.design.reference_load_n, ..*pass }
    }

    /// Some rows of the table, on its own scales.
    pub fn select(&self, rows: &[usize]) -> Self {
        Table {
            points: rows.iter().map(|&i| self.points[i]).collect(),
            passes: rows.iter().map(|&i| self.passes[i]).collect(),
            lateral: rows.iter().map(|&i| self.lateral[i]).collect(),
            runs: rows.iter().map(|&i| self.runs[i]).collect(),
            ..*self
        }
    }

    /// Number of passes.
    pub fn len(&self) -> usize {
        self.passes.len()
    }

    /// True without passes.
    pub fn is_empty(&self) -> bool {
        self.passes.is_empty()
    }

    /// `sum(direction L F) / sum(F^2)` over the passes with the plate still; `None` without such passes.
    pub fn still_coefficient(&self) -> Option<f64> {
        let (mut top, mut bottom) = (0.0, 0.0);
        for (p, l) in self.passes.iter().zip(&self.lateral) {
            if p.amplitude == PeakToPeak::ZERO {
                top += p.direction.sign() * l * p.normal_force_n;
                bottom += p.normal_force_n * p.normal_force_n;
            }
        }
        (bottom > 0.0 && top > 0.0).then(|| top / bottom)
    }

    /// mu_0 before any fit. Without still passes the largest friction seen is the best first word on it.
    pub(crate) fn nominal_mu0(&self) -> f64 {
        let seen = self.passes.iter().zip(&self.lateral);
        let seen = seen.map(|(p, l)| p.direction.sign() * l / p.normal_force_n);
        self.still_coefficient().unwrap_or_else(|| seen.fold(LEAST_MU0, f64::max))
    }

    /// Rows in the order of measurement, run by run.
    pub(crate) fn order(&self) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.len()).collect();
        rows.sort_by_key(|&i| self.runs[i]);
        rows
    }

    /// The first need of an effect that this table does not meet, in words.
    pub fn lacks(&self, needs: &[Need]) -> Option<String> {
        let p = &self.passes;
        let spread = |f: &dyn Fn(&Condition) -> f64| -> f64 {
            // What acts with the plate still as well is judged on all passes.
            let moves = |q: &&Condition| !needs.contains(&Need::Vibration) || q.amplitude > PeakToPeak::ZERO;
            let [low, high] = range(p.iter().filter(moves).map(f));
            if low > 0.0 { high.max(0.0) / low } else { f64::INFINITY }
        };
        // Known at every pass, and over more than this range.
        let changes = |f: &dyn Fn(&Condition) -> Option<f64>, same: f64| {
            let known: Vec<f64> = p.iter().filter_map(f).collect();
            let [low, high] = range(known.iter().copied());
            known.len() == p.len() && high - low > same
        };
        needs.iter().find_map(|need| {
            let missing = match need {
                Need::Vibration => !p.iter().any(|q| q.amplitude > PeakToPeak::ZERO),
                Need::Amplitudes => spread(&|q| q.amplitude.metres()) < 1.2,
                Need::Loads => spread(&|q| q.normal_force_n) < 1.25,
                Need::Speeds => spread(&|q| q.speed_m_s) < 1.3,
                Need::Directions => p.iter().all(|q| q.direction == p[0].direction),
                Need::Positions => self.design.stroke_m < 1e-3,
                Need::Time => self.design.duration_s <= 0.0,
                Need::Frequencies => {
                    !p.iter().any(|q| (q.frequency_hz / p[0].frequency_hz - 1.0).abs() > SAME_FREQUENCY)
                }
                Need::Runs => self.run_count < 2,
                Need::Temperatures => !changes(&|q| q.temperature_c, SAME_TEMPERATURE_K),
                Need::Humidities => !changes(&|q| q.relative_humidity_pct, SAME_HUMIDITY_PCT),
                Need::Record | Need::OutsideStandard | Need::NormalStandard => true,
            };
            missing.then(|| need.missing().to_string())
        })
    }

    /// Where time starts and what the scales are, for tables of conditions that belong to this one.
    pub fn origin(&self, passes: &[Pass]) -> Origin {
        let measured = || passes.iter().filter(|p| p.lateral_force_n.is_some());
        let start = measured().map(|p| p.time_s).fold(f64::INFINITY, f64::min);
        let mut runs: Vec<(Option<String>, f64)> = Vec::new();
        for p in measured() {
            match runs.iter_mut().find(|(n, _)| *n == p.run) {
                Some((_, t)) => *t = t.min(p.time_s),
                None => runs.push((p.run.clone(), p.time_s)),
            }
        }
        Origin { time_s: start, runs, design: self.design }
    }
}

/// Where the time of a table starts, and its scales.
#[derive(Debug, Clone)]
pub struct Origin {
    time_s: f64,
    runs: Vec<(Option<String>, f64)>,
    design: Design,
}

/// Passes in each direction from which signs are judged, the share of one sign, and the ratio of mean forces
/// within which both directions are as large.
const FEWEST_OF_A_DIRECTION: usize = 4;
const ONE_SIGN: f64 = 0.95;
const AS_LARGE: f64 = 1.4;

/// Largest lateral force over normal force that a finger on a plate can have, offsets of the sensor included.
const LARGEST_RATIO: f64 = 100.0;

/// Looks for the first value of a pass that no pass can have.
///
/// # Errors
/// The column, its value and what would be accepted.
pub fn check(p: &Pass) -> Result<(), DataError> {
    let refuse = |column, value, needed| Err(DataError::BadValue { point: p.point, column, value, needed });
    let condition = p.condition(1.0);
    for c in covariate::COVARIATES {
        let Some(value) = c.of(&condition) else { continue };
        if c.scale == Scale::Log && value.is_nan() | (value <= 0.0) {
            return refuse(c.name, value, "a finite number above zero");
        }
        if !c.admits(value) {
            return refuse(c.name, value, c.needed);
        }
    }
    if let Some(l) = p.lateral_force_n {
        if !l.is_finite() {
            return refuse("lateral_force_n", l, "a finite number");
        }
        if l.abs() > LARGEST_RATIO * p.normal_force_n {
            return refuse("lateral_force_n", l, "a force of at most a hundred times the normal force");
        }
    }
    Ok(())
}

/// Smallest and largest of some values; infinite the other way round of none.
pub(crate) fn range(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
}

fn scales(passes: &[Condition]) -> Design {
    let mean = |f: &dyn Fn(&Condition) -> f64| {
        (passes.iter().map(|p| f(p).ln()).sum::<f64>() / passes.len().max(1) as f64).exp()
    };
    let width = |f: &dyn Fn(&Condition) -> f64| {
        let [low, high] = range(passes.iter().map(f));
        (high - low).max(0.0)
    };
    Design {
        duration_s: width(&|p| p.time_s),
        reference_load_n: mean(&|p| p.normal_force_n),
        reference_speed_m_s: mean(&|p| p.speed_m_s),
        reference_frequency_hz: mean(&|p| p.frequency_hz),
        reference_temperature_c: passes.iter().find_map(|p| p.temperature_c).unwrap_or(20.0),
        stroke_m: width(&|p| p.position_m),
        largest_amplitude_m: passes.iter().map(|p| p.amplitude.metres()).fold(0.0, f64::max),
    }
}

#[cfg(test)]
mod tests;
