//! How far a sealed cause lies from the library's law of its name: no diagnosis should be scored on its own formulae alone.
//!
//! The noise-free forces of a set are fitted by every law of the true effect, sizes, shapes, stiffnesses and
//! `mu0` free (least squares, noise of a tenth of a per cent). The distance is what the best of them leaves,
//! over what the recalibrated baseline leaves, root mean square in units of full friction: 0 for the
//! library's own formula, 1 for a cause of which the law explains nothing.

use super::Scored;
use diagnosis::data::{RigFile, Table};
use diagnosis::hypotheses::{Options, fit_all};
use diagnosis::regression::least_squares::minimise;
use effects::library;
use models::PassNoise;
use sim::sealed::Set;
use std::collections::BTreeMap;

/// Stated scatter for the fit of noise-free forces: of a pass, relative, and of a force over the mean one.
const EXACT: f64 = 1e-3;
/// Rounds of the last search.
const ROUNDS: usize = 30;
/// Ends of the three bands in which figures are printed.
pub const BANDS: [f64; 2] = [0.05, 0.15];

/// Distance of a set's one cause from the library's law of its name; none for sets of no, two, or other
/// causes, and where the hidden passes cannot be fitted.
pub fn distance(set: &Set) -> Option<f64> {
    let [cause] = set.label.causes.as_slice() else { return None };
    if !cause.in_library {
        return None;
    }
    let mut passes = set.conditions.clone();
    for (pass, force) in passes.iter_mut().zip(&set.truth_n) {
        pass.lateral_force_n = Some(*force);
    }
    let table = Table::measured(&passes).ok()?;
    let mean = set.truth_n.iter().map(|f| f.abs()).sum::<f64>() / set.truth_n.len() as f64;
    let mut rig = RigFile::parse(&set.rig_toml).ok()?;
    rig.noise = PassNoise { pass_relative_sd: EXACT, force_sd_n: EXACT * mean };
    let without = library().iter().map(|e| e.name.to_string()).filter(|n| *n != cause.name).collect();
    let options = Options { pairs: false, without, ..Options::default() };
    let fitted = fit_all(&table, &rig, &options);
    let problem = &fitted.problem;
    let candidate = fitted.candidates.first()?;
    let sd: Vec<f64> = problem.passes.iter().map(|p| (EXACT * p.normal_force_n).powi(2)).collect();
    let left = |members: &[_], u: &[f64]| -> f64 {
        let fit = minimise(problem, members, u, &sd, ROUNDS);
        let squares = problem.lateral.iter().zip(fit.prediction.iter()).zip(&problem.passes);
        squares.map(|((y, m), p)| ((y - m) / p.normal_force_n).powi(2)).sum::<f64>().sqrt()
    };
    let none = left(&[], &fitted.baseline.u);
    let best = candidate.laws.iter().map(|(_, law)| left(&law.members, &law.u)).fold(f64::INFINITY, f64::min);
    (none > 0.0).then_some(best / none)
}

/// Median distance and number of sets of each cause.
pub fn by_cause(all: &[Scored]) -> BTreeMap<String, (f64, usize)> {
    let mut lists: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (s, d) in all.iter().filter_map(|s| Some((s, s.distance?))) {
        lists.entry(s.truth.join("+")).or_default().push(d);
    }
    lists.into_iter().map(|(name, mut d)| (name, (super::median(&mut d), d.len()))).collect()
}
