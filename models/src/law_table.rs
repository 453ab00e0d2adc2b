//! A law of friction as a table: a full grid over some of w, f, U, F_n and mu_0, read multilinearly.
//!
//! A variable without a column is one that the law does not depend on. Outside the grid the law has no
//! answer: it never extrapolates. Without vibration mu' is one by definition (Eq. 5), whatever the grid.

pub mod grid;

use crate::condition::{Condition, OutOfDomain};
use crate::covariate::{self, Covariate};
use crate::prediction::{FrictionModel, Prediction, Regime, Validity};
use crate::quantity::PeakToPeak;

/// A variable that a law may depend on: a column of its table.
#[derive(Debug)]
pub struct Variable {
    /// Column, with its unit.
    pub name: &'static str,
    /// Smallest and largest value; a wrong unit is mostly outside.
    pub range: [f64; 2],
    /// What is accepted, in words.
    pub needed: &'static str,
    /// Where it is read; none for mu_0.
    covariate: Option<&'static Covariate>,
}

impl Variable {
    /// Its value at a condition.
    pub fn of(&self, condition: &Condition) -> f64 {
        self.covariate.map_or(condition.mu0, |c| c.of(condition).unwrap_or(f64::NAN))
    }

    /// Gives a condition this value.
    pub fn put(&self, condition: &mut Condition, value: f64) {
        match self.covariate {
            Some(c) => c.put(condition, value),
            None => condition.mu0 = value,
        }
    }

    /// Whether a law table can have this value.
    pub fn admits(&self, value: f64) -> bool {
        value >= self.range[0] && value <= self.range[1]
    }

    /// The variable of a column of a law.
    pub fn by_name(name: &str) -> Option<&'static Variable> {
        VARIABLES[..OF_LAWS].iter().find(|v| v.name == name)
    }
}

/// So many of the variables, the first, are those that a law may depend on; an effect may depend on all.
pub const OF_LAWS: usize = 5;

/// The variables in their order.
pub static VARIABLES: [Variable; 9] = [
    variable(&covariate::AMPLITUDE, [0.0, 1e-3], "metres peak to peak, 0 to 1e-3"),
    variable(&covariate::FREQUENCY, [1e3, 1e7], "hertz, 1e3 to 1e7"),
    variable(&covariate::SPEED, [0.0, 10.0], "m/s, 0 to 10"),
    variable(&covariate::NORMAL_FORCE, [1e-6, 100.0], "newtons, 1e-6 to 100"),
    Variable { name: "mu0", range: [1e-3, 10.0], needed: "a number, 1e-3 to 10", covariate: None },
    variable(&covariate::TEMPERATURE, [-50.0, 150.0], "degrees Celsius, -50 to 150"),
    variable(&covariate::AMBIENT_PRESSURE, [1.0, 1e6], "pascals, 1 to 1e6"),
    variable(&covariate::POSITION, [-1.0, 1.0], "metres, -1 to 1"),
    variable(&covariate::TIME, [0.0, 1e7], "seconds, 0 to 1e7"),
];

const fn variable(c: &'static Covariate, range: [f64; 2], needed: &'static str) -> Variable {
    Variable { name: c.name, range, needed, covariate: Some(c) }
}

/// What a table answers, and over what.
pub struct TabulatedQuantity {
    /// The kind of table, in words with an article.
    pub what: &'static str,
    /// How many of [`VARIABLES`] it may have.
    pub variables: usize,
    /// Columns of the answer, with their ranges; the first is needed.
    pub columns: &'static [(&'static str, [f64; 2])],
    /// What the first one is.
    pub meaning: &'static str,
    /// The first one without vibration, where it is one by definition.
    pub still: Option<f64>,
}

/// What a law answers.
const LAW: TabulatedQuantity = TabulatedQuantity {
    what: "a law table",
    variables: OF_LAWS,
    columns: &ANSWERS,
    meaning: "mu' = mu / mu0",
    still: Some(1.0),
};

/// Columns of a law's answer, with their ranges: mu' and its standard uncertainty.
pub const ANSWERS: [(&str, [f64; 2]); 2] = [("mu_relative", [0.0, 2.0]), ("mu_relative_sd", [0.0, 1.0])];
/// Most rows of a table.
pub const MOST_ROWS: usize = 1_000_000;
/// Departure from one that a table may show at amplitude zero.
const STILL: f64 = 1e-3;
/// Share of an axis by which a value may lie outside for rounding alone.
const ROUNDING: f64 = 1e-9;

/// Why a law table was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {problem}; {remedy}")]
pub struct LawTableError {
    /// Line of the file, from 1.
    pub line: u64,
    /// What is wrong.
    pub problem: String,
    /// What to do.
    pub remedy: String,
}

#[derive(Clone, Debug)]
struct LawAxis {
    variable: &'static Variable,
    nodes: Vec<f64>,
    stride: usize,
}

/// The table, ready to be read.
#[derive(Clone, Debug)]
pub struct LawTable {
    axes: Vec<LawAxis>,
    /// mu' and its standard uncertainty, the last axis fastest.
    values: Vec<[f64; 2]>,
}

fn bad(line: u64, problem: impl Into<String>, remedy: impl Into<String>) -> LawTableError {
    LawTableError { line, problem: problem.into(), remedy: remedy.into() }
}

enum Column {
    Variable(&'static Variable),
    Answer(usize),
}

fn column(of: &TabulatedQuantity, name: &str, line: u64) -> Result<Column, LawTableError> {
    let variables = &VARIABLES[..of.variables];
    let answer = of.columns.iter().position(|a| a.0 == name).map(Column::Answer);
    variables.iter().find(|v| v.name == name).map(Column::Variable).or(answer).ok_or_else(|| {
        let names = variables.iter().map(|v| v.name).chain(of.columns.iter().map(|a| a.0));
        let names = names.collect::<Vec<_>>().join(", ");
        bad(
            line,
            format!("{} has no column '{name}'", of.what),
            format!("convert it to SI and name it, or remove it; {} may have {names}", of.what),
        )
    })
}

impl LawTable {
    /// Reads a table from CSV; lines that begin with `#` are comments.
    ///
    /// # Errors
    /// Columns without a meaning, cells out of range, a grid that is not full, rows that repeat: the line and
    /// the remedy.
    pub fn from_csv(text: &str) -> Result<LawTable, LawTableError> {
        Self::answering(&LAW, text)
    }

    /// The same of a table that answers something else.
    ///
    /// # Errors
    /// As [`LawTable::from_csv`].
    pub fn answering(of: &TabulatedQuantity, text: &str) -> Result<LawTable, LawTableError> {
        let text = text.trim_start_matches('\u{feff}');
        let mut builder = csv::ReaderBuilder::new();
        let mut reader = builder.trim(csv::Trim::All).comment(Some(b'#')).from_reader(text.as_bytes());
        let malformed = |e: csv::Error| {
            let line = e.position().map_or(1, csv::Position::line);
            let remedy = "complete it or remove it; a number has a decimal point, not a comma";
            bad(line, "the row has another number of cells than the header", remedy)
        };
        let header = reader.headers().map_err(malformed)?.clone();
        // The reader counts comments before the header as part of it.
        let blank = |line: &&str| line.trim().is_empty() || line.starts_with('#');
        let head = 1 + text.lines().take_while(blank).count() as u64;
        if let Some(cells) = header.get(0).filter(|cells| header.len() == 1 && cells.contains([';', '\t'])) {
            let by = if cells.contains(';') { "semicolons" } else { "tabs" };
            let remedy =
                "separate them by commas, and give numbers a decimal point in place of a decimal comma";
            return Err(bad(head, format!("its columns are separated by {by}"), remedy));
        }
        let columns = header.iter().map(|name| column(of, name, head)).collect::<Result<Vec<_>, _>>()?;
        if let Some(twice) = (1..header.len()).find(|&i| header.iter().take(i).any(|h| h == &header[i])) {
            return Err(bad(head, format!("two columns are '{}'", &header[twice]), "remove one"));
        }
        if !columns.iter().any(|c| matches!(c, Column::Answer(0))) {
            let problem = format!("the column '{}' is missing", of.columns[0].0);
            return Err(bad(head, problem, format!("add it: {}", of.meaning)));
        }
        let mut axes: Vec<LawAxis> = VARIABLES
            .iter()
            .filter(|v| header.iter().any(|h| h == v.name))
            .map(|variable| LawAxis { variable, nodes: Vec::new(), stride: 1 })
            .collect();
        let mut rows: Vec<(u64, [f64; VARIABLES.len()], [f64; 2])> = Vec::new();
        for record in reader.records() {
            let record = record.map_err(malformed)?;
            let line = record.position().map_or(0, csv::Position::line);
            let (mut at, mut answer) = ([0.0; VARIABLES.len()], [0.0; 2]);
            for (cell, (name, column)) in record.iter().zip(header.iter().zip(&columns)) {
                let refuse =
                    |needed: &str| bad(line, format!("'{name}' is '{cell}'"), format!("needed: {needed}"));
                let value = cell.parse::<f64>().ok().filter(|v| v.is_finite());
                match column {
                    Column::Variable(v) => {
                        let value = value.filter(|x| v.admits(*x)).ok_or_else(|| refuse(v.needed))?;
                        let place =
                            axes.iter().position(|a| std::ptr::eq(a.variable, *v)).unwrap_or_default();
                        at[place] = value;
                    }
                    Column::Answer(k) => {
                        let [low, high] = of.columns[*k].1;
                        let value = value.filter(|x| *x >= low && *x <= high);
                        answer[*k] =
                            value.ok_or_else(|| refuse(&format!("a number from {low} to {high}")))?;
                    }
                }
            }
            if axes.first().is_some_and(|a| a.variable.name == VARIABLES[0].name)
                && at[0] == 0.0
                && of.still.is_some_and(|still| (answer[0] - still).abs() > STILL)
            {
                let problem = format!("mu_relative is {} without vibration", answer[0]);
                return Err(bad(line, problem, "divide by mu0, the friction at amplitude 0: mu' is 1 there"));
            }
            rows.push((line, at, answer));
            if rows.len() > MOST_ROWS {
                return Err(bad(line, format!("more than {MOST_ROWS} rows"), "make the grid coarser"));
            }
        }
        if axes.is_empty() {
            return Err(bad(head, "no column is a variable", "add those that it depends on"));
        }
        for (k, axis) in axes.iter_mut().enumerate() {
            axis.nodes = rows.iter().map(|r| r.1[k]).collect();
            axis.nodes.sort_by(f64::total_cmp);
            axis.nodes.dedup();
            if axis.nodes.len() < 2 {
                let problem = format!("'{}' has fewer than two values", axis.variable.name);
                return Err(bad(head, problem, "add rows, or remove the column if nothing depends on it"));
            }
        }
        Self::filled(axes, &rows, head)
    }

    fn filled(
        mut axes: Vec<LawAxis>,
        rows: &[(u64, [f64; VARIABLES.len()], [f64; 2])],
        head: u64,
    ) -> Result<LawTable, LawTableError> {
        let size = axes.iter().map(|a| a.nodes.len()).fold(1_usize, usize::saturating_mul);
        let counts: Vec<String> =
            axes.iter().map(|a| format!("{} of {}", a.nodes.len(), a.variable.name)).collect();
        let shape =
            format!("the grid ({}) needs {size} rows, and there are {}", counts.join(", "), rows.len());
        if size > MOST_ROWS {
            return Err(bad(head, shape, "give a row for every combination of the values"));
        }
        for k in (1..axes.len()).rev() {
            axes[k - 1].stride = axes[k].stride * axes[k].nodes.len();
        }
        let mut values = vec![[f64::NAN; 2]; size];
        let mut lines = vec![0_u64; size];
        for (line, at, answer) in rows {
            let place = |(axis, v): (&LawAxis, &f64)| {
                axis.stride * axis.nodes.binary_search_by(|n| n.total_cmp(v)).unwrap_or_default()
            };
            let index: usize = axes.iter().zip(at).map(place).sum();
            if lines[index] > 0 {
                let problem = format!("the conditions are those of line {}", lines[index]);
                return Err(bad(*line, problem, "remove one of the two rows"));
            }
            (lines[index], values[index]) = (*line, *answer);
        }
        if let Some(missing) = lines.iter().position(|line| *line == 0) {
            let at = |a: &LawAxis| {
                format!("{} = {}", a.variable.name, a.nodes[missing / a.stride % a.nodes.len()])
            };
            let place: Vec<String> = axes.iter().map(at).collect();
            return Err(bad(head, shape, format!("add the row for {}, and any other", place.join(", "))));
        }
        Ok(LawTable { axes, values })
    }

    /// mu' and its standard uncertainty. Allocates nothing.
    ///
    /// # Errors
    /// A condition outside the grid, by the first variable that is.
    pub fn at(&self, condition: &Condition) -> Result<[f64; 2], OutOfDomain> {
        let mut share = [0.0; VARIABLES.len()];
        let mut first = 0;
        for (axis, share) in self.axes.iter().zip(&mut share) {
            let value = axis.variable.of(condition);
            let (low, high) = (axis.nodes[0], axis.nodes[axis.nodes.len() - 1]);
            let slack = ROUNDING * (high - low);
            let inside = value >= low - slack && value <= high + slack;
            OutOfDomain::unless(inside, axis.variable.name, value, INSIDE)?;
            let cell = axis.nodes.partition_point(|n| *n <= value).clamp(1, axis.nodes.len() - 1) - 1;
            *share = ((value - axis.nodes[cell]) / (axis.nodes[cell + 1] - axis.nodes[cell])).clamp(0.0, 1.0);
            first += cell * axis.stride;
        }
        let mut sum = [0.0; 2];
        for corner in 0..1_usize << self.axes.len() {
            let (mut weight, mut index) = (1.0, first);
            for (k, (axis, share)) in self.axes.iter().zip(&share).enumerate() {
                let upper = corner >> k & 1;
                weight *= if upper == 1 { *share } else { 1.0 - share };
                index += upper * axis.stride;
            }
            // A corner without weight may lie beyond the last node.
            if weight > 0.0 {
                sum[0] += weight * self.values[index][0];
                sum[1] += weight * self.values[index][1];
            }
        }
        Ok(sum)
    }
}

/// What a law needs that cannot tell.
const INSIDE: &str = "a value inside the grid of the law table, which cannot tell beyond it,";

/// A prediction of a law that knows mu' alone. Such a law does not say how finger and plate meet: less
/// friction means that contact is lost.
pub(crate) fn prediction(condition: &Condition, [mu_relative, mu_relative_sd]: [f64; 2]) -> Prediction {
    Prediction {
        mu_relative,
        mu_relative_sd,
        lateral_force_n: mu_relative * condition.mu0 * condition.normal_force_n,
        regime: if mu_relative > 0.998 { Regime::FullContact } else { Regime::Intermittent },
        validity: Validity::Inside,
    }
}

impl FrictionModel for LawTable {
    fn name(&self) -> &str {
        "law table"
    }

    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        condition.check()?;
        let still = condition.amplitude == PeakToPeak::ZERO;
        Ok(prediction(condition, if still { [1.0, 0.0] } else { self.at(condition)? }))
    }

    fn form_sd(&self, of: &Prediction) -> f64 {
        of.mu_relative_sd
    }
}

#[cfg(test)]
mod tests;
