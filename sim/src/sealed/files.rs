//! A sealed set on disk: what a diagnoser may read in one folder, what only the scorer may read in another.

use super::Set;
use std::path::Path;
use std::{fs, io};

impl Set {
    /// Writes `points.csv`, `rig.toml` and `conditions.csv` to `open`, `label.toml` and `truth.csv` to
    /// `sealed`. Both folders are made where they are missing.
    ///
    /// # Errors
    /// A folder or file that cannot be written.
    pub fn write(&self, open: &Path, sealed: &Path) -> io::Result<()> {
        fs::create_dir_all(open)?;
        fs::create_dir_all(sealed)?;
        let table = |path: &Path, passes: &[models::pass::Pass]| -> io::Result<()> {
            models::pass::write_passes(passes, fs::File::create(path)?).map_err(io::Error::other)
        };
        table(&open.join("points.csv"), &self.passes)?;
        table(&open.join("conditions.csv"), &self.conditions)?;
        fs::write(open.join("rig.toml"), &self.rig_toml)?;
        let label = toml::to_string(&self.label).map_err(io::Error::other)?;
        fs::write(sealed.join("label.toml"), label)?;
        let mut truth = String::from(
            "point,lateral_force_n,lateral_force_without_n,lateral_force_recalibrated_n,lateral_force_sd_n\n",
        );
        for (i, with) in self.truth_n.iter().enumerate() {
            let (without, recalibrated, sd) = (self.without_n[i], self.recalibrated_n[i], self.sd_n[i]);
            truth.push_str(&format!("{},{with:?},{without:?},{recalibrated:?},{sd:?}\n", i + 1));
        }
        fs::write(sealed.join("truth.csv"), truth)
    }
}
