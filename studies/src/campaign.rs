//! What a campaign answers: the paper's statements, judged from all sessions that are complete, and its page.
//! The file, the order and the sessions of a campaign are [`runs::campaign`].

pub mod claims;
pub mod measured;
mod page;

use measured::Measured;
use miette::IntoDiagnostic;
use runs::campaign::{CampaignFile, FILE, KINDS, is_complete, sessions};
use runs::fingertip::FingertipKind;
use runs::input;
use std::path::Path;

pub use page::page;

/// What was measured of a campaign: the sessions that are complete.
///
/// # Errors
/// A folder without a campaign, a session whose files cannot be read.
pub fn measured(folder: &Path) -> miette::Result<(CampaignFile, Vec<Measured>)> {
    let path = folder.join(FILE);
    let file: CampaignFile = input::parse_toml(&path.display().to_string(), &input::text_of(&path)?)?;
    let kinds: Vec<FingertipKind> =
        serde_json::from_str(&input::text_of(&folder.join(KINDS))?).into_diagnostic()?;
    miette::ensure!(
        kinds.len() == file.cell.len(),
        "{}: {KINDS} belongs to another campaign",
        folder.display()
    );
    let mut all = Vec::new();
    for session in sessions(&file) {
        let run = folder.join(&session.folder);
        if is_complete(&run) {
            let rig = input::rig_file(&run.join("rig.toml"))?;
            let kind = kinds[session.cell];
            all.push(Measured::new(session, kind, rig.finger, &runs::run_dir::passes_in(&run)?));
        }
    }
    Ok((file, all))
}
