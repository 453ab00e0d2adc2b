//! A user's own law as a table.

use crate::{MuprimeError, refused};
use models::law_table::grid::LawGrid;
use pyo3::prelude::*;
use std::path::Path;
use tables::law::{file_of, grid_over};
use tables::passes::parse_passes;

/// Nodes of a grid by variable.
type Nodes = Vec<(String, Vec<f64>)>;

fn grid_of(nodes: &Nodes) -> PyResult<LawGrid> {
    let nodes: Vec<_> = nodes.iter().map(|(name, nodes)| (name.as_str(), nodes.clone())).collect();
    LawGrid::of(&nodes).map_err(MuprimeError::new_err)
}

/// A grid over the passes of a point table (`name` is how messages call it) for these variables.
#[pyfunction]
pub fn law_grid(name: &str, table: Vec<u8>, variables: Vec<String>) -> PyResult<Nodes> {
    let passes = parse_passes(Path::new(name), &table).map_err(refused)?;
    grid_over(&passes, &variables).map_err(refused)
}

/// Names and values of the columns that a law is evaluated on: the nodes, `checks` places between them, some
/// nodes again.
#[pyfunction]
pub fn law_conditions(nodes: Nodes, checks: usize) -> PyResult<(Vec<&'static str>, Vec<Vec<f64>>)> {
    let grid = grid_of(&nodes)?;
    let rows = grid.conditions(checks);
    let columns = (0..grid.columns().len()).map(|k| rows.iter().map(|row| row[k]).collect()).collect();
    Ok((grid.columns(), columns))
}

/// The file of a law from its answers to [`law_conditions`], and as JSON its hash and its interpolation
/// error.
#[pyfunction]
pub fn law_table(
    nodes: Nodes,
    checks: usize,
    answers: Vec<[f64; 2]>,
    origin: &str,
    tolerance: f64,
) -> PyResult<(String, String)> {
    let made = grid_of(&nodes)?.table(checks, &answers).map_err(MuprimeError::new_err)?;
    let (text, sha256) = file_of(&made, origin, tolerance).map_err(refused)?;
    let about = serde_json::json!({
        "sha256": sha256, "rows": answers.len() - made.checks, "checks": made.checks, "error_greatest": made.greatest,
        "error_greatest_at": made.place, "error_rms": made.rms,
    });
    Ok((text, about.to_string()))
}
