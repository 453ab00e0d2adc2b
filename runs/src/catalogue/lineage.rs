//! From a run to its verdict, from there to the corrected model and the next plan, and to the runs that
//! used them. The links are hashes of the files, so they hold wherever the folders were copied from.

use super::RunEntry;
use crate::run_dir::identity_in;
use crate::verdict_text::files::{CORRECTED_MODEL, NEXT_PLAN};
use calibration::certificate::sha256_hex;
use serde::Serialize;
use std::path::Path;

/// What comes before a run and after it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Lineage {
    /// Runs whose verdict made this run's model or plan.
    pub before: Vec<String>,
    /// Runs that were made with this run's corrected model or next plan.
    pub after: Vec<String>,
}

/// Hashes that a run was made with and those of what its verdict left, each of model and plan.
struct Hashes {
    used: [String; 2],
    left: [Option<String>; 2],
}

fn hashes(run: &Path) -> Option<Hashes> {
    let identity = identity_in(run).ok()?;
    let of = |name: &str| std::fs::read(run.join(name)).ok().map(|bytes| sha256_hex(&bytes));
    Some(Hashes { used: [identity.model, identity.plan_sha256], left: [CORRECTED_MODEL, NEXT_PLAN].map(of) })
}

/// The lineage of a run among those of a folder.
pub fn lineage(folder: &Path, runs: &[RunEntry], name: &str) -> Lineage {
    let Some(this) = hashes(&folder.join(name)) else { return Lineage::default() };
    let follows =
        |one: &Hashes, other: &Hashes| one.left.iter().zip(&other.used).any(|(l, u)| l.as_ref() == Some(u));
    let mut found = Lineage::default();
    for other in runs.iter().filter(|run| run.folder != name) {
        let Some(that) = hashes(&folder.join(&other.folder)) else { continue };
        if follows(&that, &this) {
            found.before.push(other.folder.clone());
        }
        if follows(&this, &that) {
            found.after.push(other.folder.clone());
        }
    }
    found
}
