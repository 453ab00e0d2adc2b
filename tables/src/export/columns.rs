//! The columns of an export: those of the point table, then the results of the comparison.

use super::unit;
use models::covariate::{self, Covariate};
use realtime::compare::PassComparison;
use runs::MeasuredPass;

/// The cells of a column: numbers or text, missing values as `None`.
pub enum Cells {
    /// Numbers.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Counts(Vec<Option<u64>>),
    /// Text.
    Texts(Vec<Option<String>>),
}

/// A column: its name, which ends with its unit, what it is, and its cells.
pub struct Column {
    /// Name.
    pub name: &'static str,
    /// What it is, in words.
    pub words: &'static str,
    /// The cells.
    pub cells: Cells,
}

impl Column {
    /// Unit in SI symbols, `1` for a ratio or a count; none for text.
    pub fn unit(&self) -> Option<&'static str> {
        (!matches!(self.cells, Cells::Texts(_))).then(|| unit::of(self.name))
    }

    /// How many cells it has.
    pub fn rows(&self) -> usize {
        match &self.cells {
            Cells::Numbers(v) => v.len(),
            Cells::Counts(v) => v.len(),
            Cells::Texts(v) => v.len(),
        }
    }

    /// A cell as text, a number with as many digits as it takes to read it back unchanged.
    pub fn shown(&self, row: usize) -> Option<String> {
        match &self.cells {
            Cells::Numbers(v) => v[row].map(|v| v.to_string()),
            Cells::Counts(v) => v[row].map(|v| v.to_string()),
            Cells::Texts(v) => v[row].clone(),
        }
    }
}

/// Columns of one length.
pub type Table = Vec<Column>;

/// The table of a run's passes.
pub fn of(passes: &[MeasuredPass]) -> Table {
    let column = |name, words, cells| Column { name, words, cells };
    let numbers = |name, words, f: &dyn Fn(&MeasuredPass) -> Option<f64>| {
        column(name, words, Cells::Numbers(passes.iter().map(f).collect()))
    };
    let counts = |name, words, f: &dyn Fn(&MeasuredPass) -> Option<u64>| {
        column(name, words, Cells::Counts(passes.iter().map(f).collect()))
    };
    let texts = |name, words, f: &dyn Fn(&MeasuredPass) -> Option<String>| {
        column(name, words, Cells::Texts(passes.iter().map(f).collect()))
    };
    let compared =
        |name, words, f: &dyn Fn(PassComparison) -> Option<f64>| numbers(name, words, &|p| f(p.comparison?));
    let covariate = |c: &&'static Covariate| numbers(c.name, c.words, &|p| c.of(&p.pass.condition(1.0)));
    let mut table = vec![counts("point", "number of the point in the plan", &|p| Some(p.pass.point))];
    table.extend(covariate::REQUIRED.iter().map(covariate));
    table.extend([
        numbers("lateral_force_n", "mean lateral force, signed as the sensor has it", &|p| {
            p.pass.lateral_force_n
        }),
        numbers("normal_force_sd_n", "standard deviation of the normal force within the pass", &|p| {
            p.pass.normal_force_sd_n
        }),
        numbers("lateral_force_sd_n", "standard deviation of the lateral force within the pass", &|p| {
            p.pass.lateral_force_sd_n
        }),
        counts("samples", "samples behind the means", &|p| p.pass.samples),
    ]);
    table.extend(covariate::OPTIONAL.iter().map(covariate));
    table.extend([
        numbers("phase_shift_deg", "contact phase shift, where a vibrometer gave it", &|p| {
            p.pass.phase_shift_deg
        }),
        counts("replicate", "repeat of the condition", &|p| p.pass.replicate),
        texts("run", "name of the run, in tables of several", &|p| p.pass.run.clone()),
        counts("session", "session of the run, from 1", &|p| p.pass.session),
        compared(
            "mu_relative",
            "relative friction mu' = mu / mu_0, measured; mu_0 of all passes without vibration",
            &|c| c.mu_relative,
        ),
        compared("mu_relative_sd", "standard uncertainty of the measured mu'", &|c| c.mu_relative_sd),
        compared("mu_relative_predicted", "mu' that the model predicts at the measured condition", &|c| {
            Some(c.predicted)
        }),
        compared("mu_relative_predicted_sd", "standard uncertainty of the predicted mu'", &|c| {
            Some(c.predicted_sd)
        }),
        compared("residual_z", "friction less that expected after the passes before, in sd", &|c| Some(c.z)),
        compared("log_evidence", "ln of the evidence against the model so far", &|c| Some(c.log_evidence)),
        numbers("psi_eq17", "Psi of Eq. 17 at the measured condition", &|p| p.psi_eq17),
    ]);
    table
}
