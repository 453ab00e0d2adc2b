//! The columns of an export: those of the point table, then what the comparison said.

use crate::sequence::MeasuredPass;
use models::covariate::{self, Covariate};

/// A column: numbers or text, missing values as `None`.
pub enum Column {
    /// Numbers.
    Numbers(Vec<Option<f64>>),
    /// Whole numbers.
    Counts(Vec<Option<u64>>),
    /// Text.
    Texts(Vec<Option<String>>),
}

/// Name and contents.
pub type Table = Vec<(&'static str, Column)>;

/// The table of a run's passes.
pub fn of(passes: &[MeasuredPass]) -> Table {
    let numbers = |f: &dyn Fn(&MeasuredPass) -> Option<f64>| Column::Numbers(passes.iter().map(f).collect());
    let counts = |f: &dyn Fn(&MeasuredPass) -> Option<u64>| Column::Counts(passes.iter().map(f).collect());
    let texts = |f: &dyn Fn(&MeasuredPass) -> Option<String>| Column::Texts(passes.iter().map(f).collect());
    let covariate = |c: &&'static Covariate| (c.name, numbers(&|p| c.of(&p.pass.condition(1.0))));
    let mut table = vec![("point", counts(&|p| Some(p.pass.point)))];
    table.extend(covariate::REQUIRED.iter().map(covariate));
    table.extend([
        ("lateral_force_n", numbers(&|p| p.pass.lateral_force_n)),
        ("normal_force_sd_n", numbers(&|p| p.pass.normal_force_sd_n)),
        ("lateral_force_sd_n", numbers(&|p| p.pass.lateral_force_sd_n)),
        ("samples", counts(&|p| p.pass.samples)),
    ]);
    table.extend(covariate::OPTIONAL.iter().map(covariate));
    table.extend([
        ("phase_shift_deg", numbers(&|p| p.pass.phase_shift_deg)),
        ("replicate", counts(&|p| p.pass.replicate)),
        ("run", texts(&|p| p.pass.run.clone())),
        ("session", counts(&|p| p.pass.session)),
        ("mu_relative", numbers(&|p| p.comparison.and_then(|c| c.mu_relative))),
        ("mu_relative_sd", numbers(&|p| p.comparison.and_then(|c| c.mu_relative_sd))),
        ("mu_relative_predicted", numbers(&|p| p.comparison.map(|c| c.predicted))),
        ("mu_relative_predicted_sd", numbers(&|p| p.comparison.map(|c| c.predicted_sd))),
        ("residual_z", numbers(&|p| p.comparison.map(|c| c.z))),
        ("log_evidence", numbers(&|p| p.comparison.map(|c| c.log_evidence))),
        ("psi_eq17", numbers(&|p| p.psi_eq17)),
    ]);
    table
}

/// Rows of a table.
pub fn rows(table: &Table) -> usize {
    table.first().map_or(0, |(_, column)| match column {
        Column::Numbers(v) => v.len(),
        Column::Counts(v) => v.len(),
        Column::Texts(v) => v.len(),
    })
}
