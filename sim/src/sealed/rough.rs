//! Sealed sets whose scatter is not what rig.toml states: bad passes, heavy tails, scatter that lasts, shifts
//! between runs, a repeatability stated too small.

use super::design::{Design, Planned};
use super::set_maker::SetMaker;
use crate::defects::{DefectKind, Defects};
use crate::noise::Noise;
use models::Pass;
use serde::{Deserialize, Serialize};

/// How the scatter of a set departs from normal, independent scatter of the stated size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Roughness {
    /// Not at all.
    Gaussian,
    /// Student's t with three degrees of freedom, of the stated variance.
    Heavy,
    /// A first-order autoregression from pass to pass with correlation 0.7, of the stated variance.
    Serial,
    /// So large a share of the passes is off by 8 to 30 deviations, either way.
    Gross(f64),
    /// The true scatter is 1.5 times the stated one.
    Understated,
    /// Each of the six runs has a level of its own, normal by 3.7 % of friction.
    Runs,
}

impl Roughness {
    /// The six of a study, with their names on the command line.
    pub const ALL: [(&'static str, Roughness); 6] = [
        ("gaussian", Roughness::Gaussian),
        ("heavy", Roughness::Heavy),
        ("serial", Roughness::Serial),
        ("gross", Roughness::Gross(0.03)),
        ("understated", Roughness::Understated),
        ("runs", Roughness::Runs),
    ];
}

/// A set with its truth.
#[derive(Clone, Debug, PartialEq)]
pub struct RoughSet {
    /// The table.
    pub passes: Vec<Pass>,
    /// The rig.toml beside it.
    pub rig_toml: String,
    /// Points of the bad passes: for the scorer.
    pub bad: Vec<u64>,
}

/// Runs of a set, and its passes, about.
const RUNS: usize = 6;
const PASSES: usize = 176;
/// Rms of the recalibrated gap in deviations of a pass: a cause is there to be seen.
const GAP: [f64; 2] = [4.0, 8.0];
/// Correlation of neighbours' scatter, deviation of a run's level, understatement, and distance of bad passes.
const CORRELATION: f64 = 0.7;
const RUN_SD: f64 = 0.037;
const UNDERSTATED: f64 = 1.5;
const BAD_SD: [f64; 2] = [8.0, 30.0];

/// The set of a seed: one cause, or none. Sets of one seed and cause differ in their scatter alone.
pub fn rough(seed: u64, kind: Option<&'static DefectKind>, roughness: Roughness) -> RoughSet {
    let mut noise = Noise::new(seed, "rough");
    let design = Design {
        runs: RUNS,
        passes: PASSES - PASSES / 8,
        reference_every: 7,
        frequencies_hz: vec![27_500.0, 40_000.0],
        amplitudes_pp_m: vec![0.6e-6, 1.2e-6, 1.8e-6, 2.6e-6, 4e-6],
        speeds_m_s: vec![6e-3, 15e-3, 40e-3, 120e-3],
        normal_forces_n: vec![0.12, 0.25, 0.45, 0.8],
        pressures_pa: vec![101_325.0, 20_000.0],
        reach_m: 0.02,
        replicates: 1.3,
        pace_s: 5.0,
    };
    let mut planned = design.plan(&mut noise);
    one_clock(&mut planned, design.pace_s);
    let mut maker = SetMaker::draw(&mut noise, seed);
    maker.scatter.tail = 0.0;
    maker.stated = if roughness == Roughness::Understated { 1.0 / UNDERSTATED } else { 1.0 };
    let seen = maker.circumstances(&planned, true, &mut noise);
    let defects = kind.map_or_else(Defects::none, |kind| maker.sized(&[kind], &seen, GAP, &mut noise));
    let truth = maker.noise_free(&seen, &defects);

    let mut own = Noise::new(seed, "rough scatter");
    let n = planned.len();
    let count = if let Roughness::Gross(share) = roughness { (share * n as f64).round() as usize } else { 0 };
    let mut bad: Vec<usize> = Vec::new();
    while bad.len() < count {
        let row = own.below(n);
        if !bad.contains(&row) {
            bad.push(row);
        }
    }
    let runs: Vec<f64> = (0..RUNS).map(|_| own.normal()).collect();
    let mut last = [own.normal(), own.normal()];
    let mut deviate = |own: &mut Noise, which: usize| match roughness {
        Roughness::Heavy => own.heavy(3.0),
        Roughness::Serial => {
            last[which] = CORRELATION * last[which] + (1.0 - CORRELATION * CORRELATION).sqrt() * own.normal();
            last[which]
        }
        _ => own.normal(),
    };
    let mut passes: Vec<Pass> = (planned.iter().enumerate())
        .map(|(i, plan)| {
            let s = maker.scatter;
            let level = if roughness == Roughness::Runs { 1.0 + RUN_SD * runs[plan.run] } else { 1.0 };
            let repeat = 1.0 + s.pass_relative_sd * deviate(&mut own, 0);
            let lateral = truth.lateral_n[i] * level * repeat + s.force_sd_n * deviate(&mut own, 1);
            let normal = truth.known[i].at.normal_force_n + s.force_sd_n * own.normal();
            let (far, up) = (own.between(BAD_SD[0], BAD_SD[1]), own.chance(0.5));
            let off =
                if bad.contains(&i) { far * if up { truth.sd_n[i] } else { -truth.sd_n[i] } } else { 0.0 };
            let mut pass = maker.row(i, plan, &seen[i], normal.max(1e-3));
            pass.lateral_force_n = Some(lateral + off);
            pass
        })
        .collect();
    let mut bad: Vec<u64> = bad.iter().map(|&i| passes[i].point).collect();
    bad.sort_unstable();
    passes.truncate(PASSES);
    bad.retain(|point| passes.iter().any(|p| p.point == *point));
    let rig_toml = maker.rig_file().to_toml().expect("a sealed set's rig is within every range");
    RoughSet { passes, rig_toml, bad }
}

/// Puts the runs one after another in time.
fn one_clock(planned: &mut [Planned], pace_s: f64) {
    let (mut run, mut before, mut last) = (0, 0.0, 0.0);
    for p in planned {
        if p.run != run {
            (run, before) = (p.run, last + pace_s);
        }
        last = before + p.condition.time_s;
        p.condition.time_s = last;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One seed is one maker: kinds of scatter differ in scatter, by what they say.
    #[test]
    fn kinds_of_scatter_do_what_they_say() {
        let plain = rough(7, None, Roughness::Gaussian);
        assert_eq!(plain.passes.len(), PASSES);
        assert!(plain.passes.windows(2).all(|w| w[0].time_s < w[1].time_s), "one clock");
        let gross = rough(7, None, Roughness::Gross(0.03));
        assert_eq!(gross.bad.len(), 5);
        for (a, b) in plain.passes.iter().zip(&gross.passes) {
            assert_eq!((a.point, a.amplitude, a.time_s), (b.point, b.amplitude, b.time_s));
        }
        let understated = rough(7, None, Roughness::Understated);
        let stated =
            |set: &RoughSet| models::rig_file::RigFile::parse(&set.rig_toml).unwrap().noise.pass_relative_sd;
        assert!((stated(&plain) / stated(&understated) - UNDERSTATED).abs() < 0.01);
        assert!(understated.bad.is_empty());
    }
}
