//! Designed next experiments against random ones: how many further passes until the cause is named.
//!
//! A sealed set is thinned until it hardly tells its cause; then batches of passes are measured on the same sealed rig,
//! once as the diagnosis asks for them and once at random conditions of the same grid, until the truth has a
//! probability of 0.9 or the passes run out.

use diagnosis::data::{Rig, Table};
use diagnosis::hypotheses::Options;
use diagnosis::verdict::diagnose;
use models::condition::Condition;
use models::quantity::{Direction, PeakToPeak};
use models::record::Pass;
use rayon::prelude::*;
use serde::Serialize;
use sim::noise::Noise;
use sim::sealed::{Ask, Stratum, generate_with_rig};

/// Passes that a thinned set keeps, of which at least a sixth with the plate still.
const KEPT: usize = 36;
/// Passes of a batch, and batches.
const BATCH: usize = 12;
const BATCHES: usize = 8;
/// Probability at which a cause counts as found.
const FOUND: f64 = 0.9;

/// What it took to name the cause of one set.
#[derive(Debug, Clone, Serialize)]
pub struct Race {
    /// Seed of the set.
    pub seed: u64,
    /// The cause.
    pub truth: String,
    /// Probability of the truth before any further pass.
    pub before: f64,
    /// Further passes as designed; none where they did not suffice.
    pub designed: Option<usize>,
    /// Further passes at random.
    pub random: Option<usize>,
}

/// Races over `count` sets; those whose cause is plain from the start are left out.
///
/// # Errors
/// A set that the diagnosis refuses.
pub fn run(seed: u64, count: usize) -> miette::Result<Vec<Race>> {
    let all: miette::Result<Vec<Option<Race>>> = (0..count as u64)
        .into_par_iter()
        .map(|k| one(seed.wrapping_mul(1_000_003).wrapping_add(k)))
        .collect();
    Ok(all?.into_iter().flatten().collect())
}

fn one(seed: u64) -> miette::Result<Option<Race>> {
    let set = generate_with_rig(seed, Stratum::Single, Ask::Imitators).0;
    let imitated = set.label.imitators.iter().any(|i| i.chi2_left < 10.0 + 0.0225 * set.label.chi2_gain);
    if set.label.chi2_gain < 100.0 || imitated {
        return Ok(None);
    }
    let truth = set.label.causes[0].name.clone();
    let rig: Rig = toml::from_str(&set.rig_toml).map_err(|e| miette::miette!("rig.toml: {e}"))?;
    let start = thinned(&set.passes);
    let before = says(&start, &rig, &truth)?.0;
    if before >= FOUND {
        return Ok(None);
    }
    let race = |designed: bool| -> miette::Result<Option<usize>> {
        // Each side has the rig to itself: the same finger, its own further noise.
        let mut sealed = generate_with_rig(seed, Stratum::Single, Ask::Gain).1;
        let mut noise = Noise::new(seed, "random experiments");
        let mut passes = start.clone();
        for batch in 1..=BATCHES {
            let wanted = if designed { says(&passes, &rig, &truth)?.1 } else { Vec::new() };
            let wanted = if wanted.is_empty() { at_random(&start, &mut noise) } else { wanted };
            let mut further = sealed.measure(&wanted);
            for pass in &mut further {
                pass.run = Some(format!("further {batch}"));
            }
            passes.extend(further);
            if says(&passes, &rig, &truth)?.0 >= FOUND {
                return Ok(Some(batch * BATCH));
            }
        }
        Ok(None)
    };
    Ok(Some(Race { seed, before, designed: race(true)?, random: race(false)?, truth }))
}

/// Every so many passes of a set, as if the sweep had been broken off.
fn thinned(passes: &[Pass]) -> Vec<Pass> {
    let (still, moving): (Vec<&Pass>, Vec<&Pass>) = passes.iter().partition(|p| p.amplitude.metres() == 0.0);
    let some = |list: &[&Pass], count: usize| -> Vec<Pass> {
        let step = list.len().div_ceil(count.max(1)).max(1);
        list.iter().step_by(step).map(|p| (*p).clone()).collect()
    };
    let mut kept = some(&still, KEPT / 6);
    kept.extend(some(&moving, KEPT - KEPT / 6));
    for pass in &mut kept {
        pass.run = Some(pass.run.take().unwrap_or_else(|| "first".to_string()));
    }
    kept
}

/// Probability of the truth, and the conditions asked for next.
fn says(passes: &[Pass], rig: &Rig, truth: &str) -> miette::Result<(f64, Vec<Condition>)> {
    let table = Table::measured(passes).map_err(|e| miette::miette!("table of a sealed set: {e}"))?;
    let options = Options { pairs: false, ..Options::default() };
    let report = diagnose(&table, rig, &options, String::new()).report;
    let probability = report.hypotheses.iter().filter(|h| h.effects == [truth]).map(|h| h.probability).sum();
    let asked = report.next_experiment.iter().find(|e| !e.conditions.is_empty());
    let conditions = asked.map_or_else(Vec::new, |e| {
        e.conditions
            .iter()
            .take(BATCH)
            .map(|c| Condition {
                amplitude: PeakToPeak::from_metres(c.amplitude_pp_m),
                frequency_hz: c.frequency_hz,
                speed_m_s: c.speed_m_s,
                direction: if c.direction < 0.0 { Direction::Backward } else { Direction::Forward },
                normal_force_n: c.normal_force_n,
                mu0: 0.5,
                position_m: passes[0].position_m,
                time_s: 0.0,
                ambient_pressure_pa: c.ambient_pressure_pa,
            })
            .collect()
    });
    Ok((probability, conditions))
}

/// Conditions whose values are drawn independently from those of the passes.
fn at_random(passes: &[Pass], noise: &mut Noise) -> Vec<Condition> {
    (0..BATCH)
        .map(|_| {
            let mut any = || &passes[noise.below(passes.len())];
            Condition {
                amplitude: any().amplitude,
                frequency_hz: any().frequency_hz,
                speed_m_s: any().speed_m_s,
                direction: any().direction,
                normal_force_n: any().normal_force_n,
                mu0: 0.5,
                position_m: any().position_m,
                time_s: 0.0,
                ambient_pressure_pa: any().ambient_pressure_pa,
            }
        })
        .collect()
}
