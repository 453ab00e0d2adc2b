//! The scene of a seed, the tally of many scenes' reactions, and a failure made small.

use super::rows::{Expect, Moment, Pace, ROWS};
use super::scene::{RING, STEADY_AT, Scene, SceneResult, Strike, T, measured_bound, run};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use std::collections::BTreeMap;

/// Reactions to one fault in one moment.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Reactions {
    /// Scenes.
    pub runs: u64,
    /// Worst number of cycles until the drive was commanded off.
    pub command_off: Option<u64>,
    /// Its bound; `None` where no trip is due.
    pub command_bound: Option<u64>,
    /// Worst number of cycles from the command until the plate was quiet.
    pub measured_off: Option<u64>,
    /// Its bound.
    pub measured_bound: u64,
}

/// A scene that went wrong.
#[derive(Clone, Debug, Serialize)]
pub struct Failure {
    /// Its seed.
    pub seed: u64,
    /// The smallest scene that still goes wrong.
    pub smallest: Scene,
    /// What was wrong with that.
    pub wrong: Vec<String>,
}

/// What a search came to.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Tally {
    /// Scenes run.
    pub scenes: u64,
    /// Cycles simulated, replays not counted.
    pub cycles: u64,
    /// By number and name of the fault, and by moment.
    pub reactions: BTreeMap<(u32, &'static str, Moment), Reactions>,
    /// Scenes that went wrong, at most a hundred.
    pub failures: Vec<Failure>,
    /// How many went wrong.
    pub failed: u64,
}

/// The scene of a seed: moment, faults and the cycles in which they strike.
pub fn scene_of(seed: u64, pairs: bool, pace: Pace) -> Scene {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut strike = || {
        let row = rng.random_range(0..ROWS.len());
        Strike { row, at: STEADY_AT + rng.random_range(0..100u64) }
    };
    let one = strike();
    let mut strikes = vec![one];
    if pairs {
        // Some faults go with no other: then the scene has one.
        strikes.extend((0..200).map(|_| strike()).find(|s| compatible(one.row, s.row)));
    }
    let both = |m: &&Moment| strikes.iter().all(|s| ROWS[s.row].moments.contains(m));
    let moments: Vec<_> = ROWS[one.row].moments.iter().filter(both).collect();
    let moment = *moments[rng.random_range(0..moments.len())];
    Scene { moment, seed, strikes, pace }
}

/// Two faults can strike together where they share a moment and neither hides the other: what strikes one
/// channel twice, or alters what an instrument shows before a channel loses it, is judged one by one only.
fn compatible(a: usize, b: usize) -> bool {
    use super::rows::What::{Channel, Paused, Shown};
    use realtime::fault::FaultTarget;
    let share = ROWS[a].moments.iter().any(|m| ROWS[b].moments.contains(m));
    let apart = match (ROWS[a].what, ROWS[b].what) {
        (Channel(one, ..), Channel(other, ..)) => {
            let channel = |t| {
                if matches!(t, FaultTarget::Lateral | FaultTarget::Normal) { FaultTarget::Force } else { t }
            };
            channel(one) != channel(other)
        }
        (Channel(..), Shown(_)) | (Shown(_), Channel(..)) | (Shown(_), Shown(_)) => false,
        // Time stands still for one of them.
        (Paused(_), _) | (_, Paused(_)) => false,
        (one, other) => std::mem::discriminant(&one) != std::mem::discriminant(&other),
    };
    share && apart
}

impl Tally {
    /// Counts what came of a scene.
    pub fn count(&mut self, scene: &Scene, found: SceneResult, twice: bool) {
        self.scenes += 1;
        self.cycles += found.cycles * if twice { 2 } else { 1 };
        for (i, strike) in scene.strikes.iter().enumerate() {
            let row = &ROWS[strike.row];
            let entry = self.reactions.entry((row.number, row.name, scene.moment)).or_default();
            entry.runs += 1;
            if let Expect::Off(within) = row.expect {
                let bound = within.at(&scene.pace.timing(T, RING));
                entry.command_bound = Some(bound);
                entry.command_off = entry.command_off.max(found.command_off[i]);
                entry.measured_off = entry.measured_off.max(found.measured_off);
                entry.measured_bound = entry.measured_bound.max(measured_bound(scene));
            }
        }
        if !found.wrong.is_empty() {
            self.failed += 1;
            if self.failures.len() < 100 {
                let (smallest, wrong) = smallest(scene, twice, found.wrong);
                self.failures.push(Failure { seed: scene.seed, smallest, wrong });
            }
        }
    }
}

/// Runs a scene; with `twice` two runs must leave equal hashes.
pub fn judged(scene: &Scene, twice: bool) -> SceneResult {
    let mut found = run(scene, twice);
    if twice && run(scene, true).hash != found.hash {
        found.wrong.push("two runs of one seed differ".into());
    }
    found
}

/// Makes a failing scene small: without one of its faults, then with every fault as early as it can strike.
fn smallest(scene: &Scene, twice: bool, wrong: Vec<String>) -> (Scene, Vec<String>) {
    let without = |i: usize| {
        let mut fewer = scene.clone();
        fewer.strikes.remove(i);
        let wrong = judged(&fewer, twice).wrong;
        (!wrong.is_empty()).then_some((fewer, wrong))
    };
    let best = (0..scene.strikes.len()).find_map(without).unwrap_or_else(|| (scene.clone(), wrong));
    let mut early = best.0.clone();
    for strike in &mut early.strikes {
        strike.at = STEADY_AT;
    }
    let found = judged(&early, twice);
    if found.wrong.is_empty() { best } else { (early, found.wrong) }
}
