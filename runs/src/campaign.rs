//! A campaign: the same plan with several tips and conditions, on several days, as sessions in random order.
//!
//! ```text
//! campaign.toml: cells (tip, condition, setup) x blocks (days)
//!   -> sessions: every cell once a block, in an order that the seed gives
//!   -> FOLDER/sessions/NN-CELL: a run's folder each; those that are complete are not made again
//!   -> claims: each of the paper's statements, answered from all sessions that are complete
//! ```
//! A block is a day or half of one: what drifts from day to day is then the same for all cells of it.

mod origin;

use crate::input::{self, Problems};
use crate::run_dir::Identity;
use crate::{Plan, Setup};
use miette::IntoDiagnostic;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha12Rng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Name and text of every bundled campaign. Add one: a file in `runs/campaigns/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[("part2-campaign", include_str!("../campaigns/part2-campaign.toml"))];
/// The campaign's file in its folder.
pub const FILE: &str = "campaign.toml";
/// What kind of tip each cell has, beside it: a folder that was copied has no setups.
pub const KINDS: &str = "tips.json";
/// Sessions that one campaign may have.
const SESSIONS_MAX: usize = 1000;

/// A campaign file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CampaignFile {
    /// Name, for the page.
    pub name: String,
    /// What it is for.
    #[serde(default)]
    pub about: String,
    /// The plan of every session: a bundled name, or a file beside this one.
    pub plan: String,
    /// Seed of the order of sessions and, with a session's number, of the order of its passes.
    #[serde(default)]
    pub seed: u64,
    /// Blocks, as days: every cell is measured once in each.
    pub blocks: u32,
    /// Repeats of every condition in a session, in place of the plan's.
    pub replicates: Option<u32>,
    /// Change of relative friction up to which a factor does not matter (1).
    #[serde(default = "margin")]
    pub margin: f64,
    /// What is compared: a tip in one condition.
    pub cell: Vec<Cell>,
}

/// A tip in one condition, on the setup that it is measured with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cell {
    /// Name: letters, digits, `-` and `_`; part of the names of its folders.
    pub name: String,
    /// Setup: a bundled name, or a file beside this one.
    pub setup: String,
    /// Fingertip in place of the setup's: a name of the library, or a file beside the setup.
    pub tip: Option<String>,
    /// Coulomb friction coefficient to expect, in place of the tip's.
    pub mu0: Option<f64>,
    /// Condition of the tip, as dry or moist: for record and page.
    #[serde(default)]
    pub condition: String,
}

const fn margin() -> f64 {
    0.02
}

/// A campaign that was read, with its plan and setups.
pub struct Campaign {
    /// The file's contents.
    pub file: CampaignFile,
    /// The file's text, for its folder.
    pub text: String,
    /// The plan of every session.
    pub plan: Plan,
    /// The setup of each cell.
    pub setups: Vec<Setup>,
    /// The folder that its paths are relative to.
    pub folder: PathBuf,
}

/// The run of one session: a cell in a block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CampaignRun {
    /// Number in the order of measurement, from 1.
    pub number: usize,
    /// Block, from 1.
    pub block: u32,
    /// Index of the cell.
    pub cell: usize,
    /// Seed of its passes.
    pub seed: u64,
    /// Its folder in that of the campaign.
    pub folder: PathBuf,
}

/// The text of a campaign and the folder that its paths are relative to; `None` where the name is that of a
/// plan. A folder of results names the one where its campaign was begun.
///
/// # Errors
/// A file that cannot be read; results whose campaign's folder is gone.
pub fn text_of(name_or_path: &str) -> miette::Result<Option<(String, PathBuf)>> {
    if let Some((_, text)) = BUNDLED.iter().find(|(name, _)| *name == name_or_path) {
        return Ok(Some(((*text).to_string(), PathBuf::from("."))));
    }
    let named = Path::new(name_or_path);
    let path = if named.is_dir() { named.join(FILE) } else { named.to_path_buf() };
    if !path.is_file() {
        return Ok(None);
    }
    let text = input::text_of(&path)?;
    // A file that is not TOML at all is refused as a plan, with its place.
    let is = toml::from_str::<toml::Table>(&text)
        .is_ok_and(|t| t.contains_key("cell") || t.contains_key("blocks"));
    if !is {
        return Ok(None);
    }
    if named.is_dir() {
        return Ok(Some((text, origin::of_folder(named)?)));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Ok(Some((text, folder.to_path_buf())))
}

impl Campaign {
    /// Parses and checks a campaign, its plan and its setups; a refusal has the place in the file.
    pub fn parse(origin: &str, text: &str, folder: &Path) -> miette::Result<Self> {
        let file: CampaignFile = input::parse_toml(origin, text)?;
        let mut wrong = Problems::of(origin, text);
        if file.cell.is_empty() {
            wrong.add(&["cell"], "a campaign has at least one [[cell]]", None);
        }
        let sessions = file.cell.len().saturating_mul(file.blocks as usize);
        if !(1..=SESSIONS_MAX).contains(&sessions) {
            let problem =
                format!("cells times blocks are {sessions} sessions; 1 to {SESSIONS_MAX} can be had");
            wrong.add(&["blocks"], problem, None);
        }
        if !(file.margin.is_finite() && file.margin > 0.0 && file.margin < 1.0) {
            let problem =
                format!("margin = {}: above 0 and below 1, a change of relative friction", file.margin);
            wrong.add(&["margin"], problem, None);
        }
        let mut names = BTreeSet::new();
        for (index, Cell { name, .. }) in file.cell.iter().enumerate() {
            let place = input::place_in(text, "cell", index, "name");
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            if name.is_empty() || !name.chars().all(plain) {
                let problem =
                    format!("a cell's name '{name}' has other characters than letters, digits, - and _");
                wrong.add_at(place.clone(), problem, None);
            }
            if !names.insert(name) {
                wrong.add_at(place, format!("two cells are named '{name}'"), None);
            }
        }
        wrong.end()?;
        let plan = match crate::bundled::text(crate::plan::BUNDLED, &file.plan) {
            Some(text) => Plan::parse(&file.plan, text)?,
            None => Plan::load(&folder.join(&file.plan).display().to_string())?,
        };
        let replicates = file.replicates.map(|n| ("replicates", toml::Value::Integer(n.into())));
        let plan = match replicates {
            None => plan,
            some => Plan::parse(&plan.origin, &edited(&plan.text, &[], some)?)?,
        };
        let setups = file.cell.iter().map(|cell| cell.setup(folder)).collect::<miette::Result<_>>()?;
        Ok(Campaign { file, text: text.to_string(), plan, setups, folder: folder.to_path_buf() })
    }

    /// Makes the campaign's folder, or takes up that of the same campaign, for sessions as `now`.
    ///
    /// # Errors
    /// A folder of another campaign, or one that cannot be written; a plan, setup, model or defects that were
    /// changed after a session was made.
    pub fn open(&self, folder: &Path, now: &Identity) -> miette::Result<()> {
        let stored = folder.join(FILE);
        if stored.exists() {
            miette::ensure!(
                input::text_of(&stored)? == self.text,
                help = "give another --out, or the campaign as it was",
                "{} holds another campaign than this one",
                folder.display()
            );
            return self.unchanged(folder, now);
        }
        crate::files::make_folder(&folder.join("sessions"))?;
        self.store_origin(folder)?;
        let kinds: Vec<_> = self.setups.iter().map(|setup| setup.tip.kind).collect();
        crate::files::write_plain(&folder.join(KINDS), serde_json::json!(kinds).to_string())?;
        crate::files::write_plain(&stored, &self.text)
    }
}

impl Cell {
    /// Its setup, with the fingertip that the cell names.
    fn setup(&self, folder: &Path) -> miette::Result<Setup> {
        let (origin, text, beside) = match crate::bundled::text(crate::setup::BUNDLED, &self.setup) {
            Some(text) => (self.setup.clone(), text.to_string(), folder.to_path_buf()),
            None => {
                let path = folder.join(&self.setup);
                let beside = path.parent().map(Path::to_path_buf).unwrap_or_default();
                (path.display().to_string(), input::text_of(&path)?, beside)
            }
        };
        let own = [
            self.tip.clone().map(|tip| ("tip", toml::Value::String(tip))),
            self.mu0.map(|mu0| ("mu0", toml::Value::Float(mu0))),
        ];
        let text = match self.tip.is_none() && self.mu0.is_none() {
            true => text,
            false => edited(&text, &["finger"], own.into_iter().flatten())?,
        };
        Setup::parse(&origin, &text, &beside)
    }
}

/// A TOML text with values of its own in one of its tables; a text that is none stays as it is, to be refused
/// by its reader.
fn edited(
    text: &str,
    table: &[&str],
    values: impl IntoIterator<Item = (&'static str, toml::Value)>,
) -> miette::Result<String> {
    let Ok(mut document) = toml::from_str::<toml::Table>(text) else { return Ok(text.to_string()) };
    let mut at = &mut document;
    for name in table {
        let inner = at.entry(*name).or_insert_with(|| toml::Value::Table(toml::Table::new()));
        let Some(inner) = inner.as_table_mut() else { return Ok(text.to_string()) };
        at = inner;
    }
    values.into_iter().for_each(|(key, value)| drop(at.insert(key.to_string(), value)));
    toml::to_string(&document).into_diagnostic()
}

/// All sessions of a campaign in the order of measurement: in each block every cell, in an order of its own.
pub fn sessions(file: &CampaignFile) -> Vec<CampaignRun> {
    let mut random = ChaCha12Rng::seed_from_u64(file.seed);
    let mut all = Vec::new();
    for block in 1..=file.blocks {
        let mut cells: Vec<usize> = (0..file.cell.len()).collect();
        cells.shuffle(&mut random);
        for cell in cells {
            let number = all.len() + 1;
            let folder = Path::new("sessions").join(format!("{number:02}-{}", file.cell[cell].name));
            // Sessions apart by far more than replicates are.
            let seed = file.seed.wrapping_mul(1_000_003).wrapping_add(number as u64) & i64::MAX as u64;
            all.push(CampaignRun { number, block, cell, seed, folder });
        }
    }
    all
}

/// Whether the run in a folder was completed.
pub fn is_complete(run: &Path) -> bool {
    crate::job::Summary::written_in(run)
        .is_some_and(|summary| summary.outcome == crate::sweep::Outcome::Complete)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first cell's line was shown, whichever it was.
    #[test]
    fn a_cell_whose_name_is_wrong_is_shown_at_its_own_line() {
        let cell = |name: &str| format!("[[cell]]\nname = \"{name}\"\nsetup = \"virtual\"\n");
        for wrong in ["b/c", "a"] {
            let text =
                format!("name = \"c\"\nplan = \"first-sweep\"\nblocks = 1\n{}{}", cell("a"), cell(wrong));
            let why = Campaign::parse("c", &text, Path::new(".")).err().unwrap();
            assert!(format!("{why:?}").contains("c:8:8"), "{why:?}");
        }
    }
}
