//! Where a campaign's plan, setups and tips are, and whether they are still those of its sessions.

use super::{Campaign, FILE, sessions};
use crate::print::quoted;
use crate::run_dir::{self, Identity};
use crate::{files, input};
use miette::IntoDiagnostic;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// In a campaign's folder: where its own files are.
const ORIGIN: &str = "origin.json";

#[derive(Serialize, Deserialize)]
struct Origin {
    /// The folder that the paths of the campaign are relative to.
    folder: PathBuf,
}

/// The folder that the paths of a campaign's text are relative to, by the folder of its results; of a
/// campaign that an earlier version made the same folder. An error: that folder is gone.
pub(super) fn of_folder(folder: &Path) -> miette::Result<PathBuf> {
    let file = folder.join(ORIGIN);
    if !file.exists() {
        return Ok(folder.to_path_buf());
    }
    let origin: Origin = serde_json::from_str(&input::text_of(&file)?)
        .map_err(|e| miette::miette!("{}: {e}", file.display()))?;
    miette::ensure!(
        origin.folder.is_dir(),
        help = format!("name the campaign's own file: `muprime run FILE --out {}`", quoted(folder.display())),
        "{}: the plan and the setups of this campaign were in {}, which is gone",
        folder.display(),
        origin.folder.display()
    );
    Ok(origin.folder)
}

impl Campaign {
    /// Writes where this campaign's files are into the folder of its results.
    pub(super) fn store_origin(&self, folder: &Path) -> miette::Result<()> {
        let origin = Origin { folder: self.folder.canonicalize().into_diagnostic()? };
        files::write_plain(&folder.join(ORIGIN), serde_json::to_string(&origin).into_diagnostic()?)
    }

    /// Refuses to go on where a session that was made had another plan, setup (with the files that it names),
    /// model or other defects than `now`: the sessions could not be compared.
    pub(super) fn unchanged(&self, folder: &Path, now: &Identity) -> miette::Result<()> {
        for session in sessions(&self.file) {
            let run = folder.join(&session.folder);
            if !run_dir::has_begun(&run) {
                continue;
            }
            let (before, setup) = (run_dir::identity_in(&run)?, &self.setups[session.cell]);
            let now = Identity { setup_sha256: setup.sha256(), seed: before.seed, ..now.clone() };
            if let Some(what) = now.other_than(&before).first() {
                let files = match *what {
                    "plan" => format!(" '{}' or its target", self.plan.origin),
                    "setup" => {
                        format!(
                            " '{}', its tip '{}', a certificate or a profile",
                            setup.origin, setup.file.finger.tip
                        )
                    }
                    _ => String::new(),
                };
                miette::bail!(
                    help =
                        "give another --out, or the file as it was: all sessions of a campaign are compared",
                    "{}: the {what}{files} was changed after session {} was made with it ({})",
                    folder.join(FILE).display(),
                    session.number,
                    run.display()
                );
            }
        }
        Ok(())
    }
}
