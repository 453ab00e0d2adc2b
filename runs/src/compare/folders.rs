//! Two runs' folders compared: statistics, what must be minded, what differed.

use super::differences::{Difference, between, warnings};
use super::{Comparison, Reference, Side, compare};
use crate::run_dir::record_facts;
use miette::{IntoDiagnostic, WrapErr};
use models::rig_file::PassNoise;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What `muprime compare` says of two runs.
#[derive(Clone, Debug, Serialize)]
pub struct Compared {
    /// Their folders.
    pub runs: [PathBuf; 2],
    /// What stands against a plain reading: shared seeds, damage.
    pub warnings: Vec<String>,
    /// The statistics.
    pub comparison: Comparison,
    /// What differed in setup, plan, certificates and model.
    pub differences: Vec<Difference>,
    /// What is known of each, for the top of a page.
    #[serde(skip)]
    pub about: [Vec<(&'static str, String)>; 2],
}

impl Compared {
    /// Compares the runs in two folders.
    ///
    /// # Errors
    /// A folder that holds no run, a run without a pass without vibration.
    pub fn of(folders: [&Path; 2]) -> miette::Result<Self> {
        let [a, b] = [crate::run_data::read(folders[0])?, crate::run_data::read(folders[1])?];
        let [facts_a, facts_b] = [record_facts(folders[0])?, record_facts(folders[1])?];
        let [noise_a, noise_b] = [noise(folders[0])?, noise(folders[1])?];
        let sides = [Side::of(&a, noise_a), Side::of(&b, noise_b)];
        let [first, second] = [0, 1].map(|i| reference(&sides[i], folders[i]));
        let comparison = compare([&sides[0], &sides[1]], [first?, second?]);
        let [table_a, table_b] = [table(folders[0])?, table(folders[1])?];
        let mut warnings = warnings(&facts_a, &facts_b, table_a == table_b);
        let comparison = if warnings.is_empty() { comparison } else { comparison.of_one_noise() };
        for (folder, run) in folders.into_iter().zip([&a, &b]) {
            warnings.extend(run.damage.iter().map(|d| format!("{}: {d}", folder.display())));
        }
        Ok(Compared {
            runs: folders.map(Path::to_path_buf),
            warnings,
            comparison,
            differences: between(&facts_a, &facts_b),
            about: [a.about, b.about],
        })
    }
}

/// `mu_0` of a run; the error names its folder.
pub(super) fn reference(side: &Side, folder: &Path) -> miette::Result<Reference> {
    side.reference().map_err(|why| miette::miette!("{}: {why}", folder.display()))
}

pub(super) fn noise(folder: &Path) -> miette::Result<PassNoise> {
    Ok(crate::input::rig_file(&folder.join("rig.toml"))?.noise)
}

fn table(folder: &Path) -> miette::Result<Vec<u8>> {
    let path = folder.join("points.csv");
    std::fs::read(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())
}
