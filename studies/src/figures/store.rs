//! Cases of the finite element model as a study in the folder of the figures: what is there is not run again.

use crate::cases::file::Header;
use crate::cases::kinds::Cell::{self, Count, Flag, Missing, Number};
use crate::cases::kinds::ridge;
use crate::cases::run::all;
use models::ridge::RidgeCase;
use models::ridge::study::{content_key, fnv1a};
use std::collections::HashMap;
use std::path::Path;

/// The stored results of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredRun {
    /// mu'.
    pub mu_relative: f64,
    /// Its standard error over the cycles.
    pub mu_relative_sd: f64,
    /// Mean reaction force over the applied one.
    pub reaction_over_load: f64,
    /// Share of time in contact.
    pub contact_fraction: f64,
    /// Phase shift in degrees; missing without vibration.
    pub phase_shift_deg: Option<f64>,
    /// Whether the period is doubled.
    pub period_doubled: bool,
    /// Whether the cycles became steady.
    pub steady: bool,
    /// Cycles run.
    pub cycles: u64,
}

impl StoredRun {
    /// From the cells of [`ridge`], behind those of its variables.
    fn of(cells: &[Cell]) -> Option<StoredRun> {
        let [
            Number(mu_relative),
            Number(mu_relative_sd),
            Number(reaction_over_load),
            Number(contact_fraction),
            phase,
            Flag(period_doubled),
            Flag(steady),
            Count(cycles),
        ] = cells.get(ridge::VARIABLES.len()..)?
        else {
            return None;
        };
        let phase_shift_deg = match phase {
            Number(degrees) => Some(*degrees),
            Missing => None,
            _ => return None,
        };
        Some(StoredRun {
            mu_relative: *mu_relative,
            mu_relative_sd: *mu_relative_sd,
            reaction_over_load: *reaction_over_load,
            contact_fraction: *contact_fraction,
            phase_shift_deg,
            period_doubled: *period_doubled,
            steady: *steady,
            cycles: *cycles,
        })
    }
}

/// Results by content key.
pub type Results = HashMap<String, StoredRun>;

/// All results of `cases`, each run once, and how many have none. The cases differ in [`ridge::VARIABLES`] alone.
///
/// # Errors
/// A case that cannot be made, whatever the file system says.
pub fn complete(out: &Path, cases: impl IntoIterator<Item = RidgeCase>) -> miette::Result<(Results, usize)> {
    let settings = super::settings();
    let mut seen = std::collections::HashSet::new();
    let keyed = cases.into_iter().map(|case| (content_key(&case, &settings), case));
    let cases: Vec<(String, RidgeCase)> = keyed.filter(|(key, _)| seen.insert(key.clone())).collect();
    let Some((_, first)) = cases.first() else { return Ok((Results::new(), 0)) };
    let about = ridge::RidgeSettings { case: Some(*first), steady: settings.steady, ..Default::default() };
    let keys: String = cases.iter().map(|(key, _)| key.as_str()).collect();
    let lines: Vec<_> = cases.iter().map(|(_, case)| ridge::line_of(case)).collect();
    let name = format!("ridge-{:016x}", fnv1a(keys.as_bytes()));
    let entries = all(out, &name, Header::of(&ridge::KIND, &about, 0)?, Some(&lines))?;
    let stored = entries.iter().map(|entry| StoredRun::of(entry.outcome.as_ref().ok()?));
    let results: Results =
        cases.iter().zip(stored).filter_map(|((key, _), run)| Some((key.clone(), run?))).collect();
    let failed = cases.len() - results.len();
    Ok((results, failed))
}
