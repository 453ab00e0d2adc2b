//! Where a campaign's plan, setups and tips are, and whether they are still those of its sessions.

use super::{Campaign, FILE, sessions};
use crate::{files, input, run_dir};
use calibration::certificate::sha256_hex;
use miette::IntoDiagnostic;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// In a campaign's folder: where its own files are, and what its tips were.
const ORIGIN: &str = "origin.json";

#[derive(Serialize, Deserialize)]
struct Origin {
    /// The folder that the paths of the campaign are relative to.
    folder: PathBuf,
    /// SHA-256 of the values of each cell's tip: a setup's hash does not contain them.
    tips: Vec<String>,
}

fn stored(folder: &Path) -> miette::Result<Option<Origin>> {
    let file = folder.join(ORIGIN);
    if !file.exists() {
        return Ok(None);
    }
    let read = serde_json::from_str(&input::text_of(&file)?);
    read.map(Some).map_err(|e| miette::miette!("{}: {e}", file.display()))
}

/// The folder that the paths of a campaign's text are relative to, by the folder of its results; of a
/// campaign that an earlier version made the same folder. An error: that folder is gone.
pub(super) fn of_folder(folder: &Path) -> miette::Result<PathBuf> {
    let Some(origin) = stored(folder)? else { return Ok(folder.to_path_buf()) };
    miette::ensure!(
        origin.folder.is_dir(),
        help = format!("name the campaign's own file: `muprime run FILE --out {}`", folder.display()),
        "{}: the plan and the setups of this campaign were in {}, which is gone",
        folder.display(),
        origin.folder.display()
    );
    Ok(origin.folder)
}

impl Campaign {
    fn tips(&self) -> Vec<String> {
        let hash = |setup: &crate::setup::Setup| {
            let tip = serde_json::json!([setup.tip.kind, setup.tip.mu0, setup.tip.finger]);
            sha256_hex(tip.to_string().as_bytes())
        };
        self.setups.iter().map(hash).collect()
    }

    /// Writes where this campaign's files are into the folder of its results.
    pub(super) fn store_origin(&self, folder: &Path) -> miette::Result<()> {
        let origin = Origin { folder: self.folder.canonicalize().into_diagnostic()?, tips: self.tips() };
        files::write_plain(&folder.join(ORIGIN), serde_json::to_string(&origin).into_diagnostic()?)
    }

    /// Refuses to go on where plan, setup or tip are other ones than a session that was made had: the
    /// sessions could not be compared.
    pub(super) fn unchanged(&self, folder: &Path) -> miette::Result<()> {
        let plan = sha256_hex(self.plan.text.as_bytes());
        let (origin, tips) = (stored(folder)?, self.tips());
        for session in sessions(&self.file) {
            let run = folder.join(&session.folder);
            if !run_dir::has_begun(&run) {
                continue;
            }
            let (before, setup) = (run_dir::identity_in(&run)?, &self.setups[session.cell]);
            let tip_was = origin.as_ref().and_then(|origin| origin.tips.get(session.cell));
            let changed = [
                ("plan", &self.plan.origin, before.plan_sha256 == plan),
                ("setup", &setup.origin, before.setup_sha256 == setup.sha256()),
                ("tip", &setup.file.finger.tip, tip_was.is_none_or(|was| *was == tips[session.cell])),
            ];
            if let Some((what, file, _)) = changed.iter().find(|(.., same)| !same) {
                miette::bail!(
                    help =
                        "give another --out, or the file as it was: all sessions of a campaign are compared",
                    "{}: the {what} '{file}' was changed after session {} was made with it ({})",
                    folder.join(FILE).display(),
                    session.number,
                    run.display()
                );
            }
        }
        Ok(())
    }
}
