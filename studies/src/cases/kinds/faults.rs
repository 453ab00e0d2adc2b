//! One scene of the fault bench a case: case `i` is the seed `first + i`.

use super::{Case, CaseKind, Cell, count, document, no_lines, settings, text, word};
use crate::cases::{file::Header, run::here};
use crate::validation::faults::search::{judged, scene_of};
use crate::validation::faults::{Pace, ROWS, SceneResult, Tally};
use serde::{Deserialize, Serialize};

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "faults",
    words: "a scene of the fault bench a seed, as `muprime faults` runs them",
    model: 2,
    columns: &[
        count("seed", "seed of the scene"),
        text("phase", "what the rig did"),
        text("faults", "the faults that struck, joined by +"),
        text("trip", "the cause of the trip; none where there was none"),
        count("cycles", "cycles simulated"),
        count("command_off_cycles", "worst number of cycles until the drive was commanded off"),
        count("measured_off_cycles", "cycles from the command until the plate was quiet"),
        count("wrong", "how much was not as it must be: 0 is good"),
        text("what", "what was wrong"),
        text("document", "all that was found, as JSON"),
    ],
    prepare,
};

/// What all cases share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FaultSettings {
    /// Seed of case 0.
    pub first: u64,
    /// Two faults in each scene.
    pub pairs: bool,
    /// The limits that the scenes run at.
    pub pace: Pace,
    /// Each scene twice, with equal hashes and a replay of its rows.
    pub twice: bool,
}

impl Default for FaultSettings {
    fn default() -> Self {
        FaultSettings { first: 1, pairs: false, pace: Pace::Fast, twice: false }
    }
}

fn prepare(header: &Header, _: &std::path::Path) -> miette::Result<super::Make> {
    no_lines(header)?;
    let FaultSettings { first, pairs, pace, twice } = settings(header)?;
    Ok(Box::new(move |index, _| {
        let seed = first.wrapping_add(index);
        let run = move || {
            let scene = scene_of(seed, pairs, pace);
            let found = judged(&scene, twice);
            let struck: Vec<&str> = scene.strikes.iter().map(|s| ROWS[s.row].name).collect();
            let whole = serde_json::to_string(&found).map_err(|e| e.to_string())?;
            Ok(vec![
                seed.into(),
                word(scene.moment)?.into(),
                struck.join("+").into(),
                found.trip.map(|trip| word(trip.cause)).transpose()?.into(),
                found.cycles.into(),
                found.command_off.iter().flatten().max().copied().into(),
                found.measured_off.into(),
                (found.wrong.len() as u64).into(),
                if found.wrong.is_empty() { Cell::Missing } else { found.wrong.join("; ").into() },
                whole.into(),
            ])
        };
        Ok(Case { inputs: format!("{seed} {pairs} {pace:?} {twice}"), run: Box::new(run) })
    }))
}

/// Runs so many scenes here, and tallies them; `watch` gets the tally after each.
///
/// # Errors
/// A fault of the program in a scene.
pub fn search(settings: &FaultSettings, seeds: u64, watch: &mut dyn FnMut(&Tally)) -> miette::Result<Tally> {
    let (mut tally, mut next) = (Tally::default(), settings.first);
    here(&KIND, settings, seeds, &mut |cells| {
        let found: SceneResult = document(&cells)?;
        tally.count(&scene_of(next, settings.pairs, settings.pace), found, settings.twice);
        next = next.wrapping_add(1);
        watch(&tally);
        Ok(())
    })?;
    Ok(tally)
}
