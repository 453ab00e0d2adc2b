//! Coverage of the parameter intervals: sets made with the library's own forms and Gaussian noise as stated.
//!
//! The inverse crime on purpose: an interval is one of the library's form, so only data of that form can say
//! whether it covers. These sets say nothing about naming, and no figure of naming is taken from them.

use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Verdict, diagnose};
use effects::{Active, Baseline, Need, Prior, library};
use rayon::prelude::*;
use serde::Serialize;
use sim::noise::Noise;
use sim::sealed::{Ask, Stratum, generate};
use studies::validation::blind::share;

/// The size of the effect from one set.
#[derive(Debug, Clone, Serialize)]
struct Covered {
    /// Seed of the set.
    seed: u64,
    /// The effect and its law.
    effect: &'static str,
    /// The law.
    law: &'static str,
    /// True size.
    truth: f64,
    /// Interval of the size; none where the effect was not named in its own law.
    ci95: Option<[f64; 2]>,
}

/// Makes and diagnoses `count` sets.
pub fn run(seed: u64, count: u64) {
    let own = |k| seed.wrapping_mul(1_000_003).wrapping_add(k);
    let sets: Vec<Covered> = (0..count).into_par_iter().map(|k| one(own(k))).inspect(super::line).collect();
    let stated = sets.iter().filter_map(|s| Some((s.truth, s.ci95?)));
    let covered = stated.map(|(truth, ci)| ci[0] <= truth && truth <= ci[1]).collect();
    let figure = share("size inside its 95 % interval, same form", "0.92 to 0.98", covered);
    println!(
        "{}: {:.3} {:.3?}, n {} of {count} sets (the others were not named in their own form)",
        figure.name,
        figure.value.unwrap_or(f64::NAN),
        figure.ci95.unwrap_or([f64::NAN; 2]),
        figure.n,
    );
}

fn one(seed: u64) -> Covered {
    let set = generate(seed, Stratum::None, Ask::Gain);
    let rig = RigFile::parse(&set.rig_toml).expect("rig.toml of a sealed set");
    let clean = Table::measured(&set.passes).expect("a sealed table");
    let mut noise = Noise::new(seed, "same form");
    let seen: Vec<usize> = (0..library().len())
        .filter(|&i| {
            let needs = library()[i].needs;
            !needs.contains(&Need::Record) && clean.lacks(needs).is_none()
        })
        .collect();
    let effect = library()[seen[noise.below(seen.len())]];
    let law = noise.below(effect.laws.len());
    let form = &effect.laws[law];
    // From the prior's upper part: a size that the table can show.
    let theta: Vec<f64> = form
        .parameters
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let u = match p.prior {
                Prior::HalfNormal(_) => noise.between(0.3, 2.0),
                Prior::Normal(_) if i == 0 => {
                    noise.between(0.3, 2.0) * if noise.chance(0.5) { 1.0 } else { -1.0 }
                }
                Prior::Uniform(..) => noise.between(-2.5, 2.5),
                _ => 0.7 * noise.normal(),
            };
            p.at_load(clean.design.reference_load_n).value(u)
        })
        .collect();
    let active = [Active { effect, law, theta: &theta }];
    let mu0 = clean.still_coefficient().unwrap_or(set.label.true_mu0);
    let sd = rig.finger.stiffness_relative_sd;
    let baseline = Baseline {
        mu0,
        normal_stiffness_n_per_m: rig.finger.normal_stiffness_n_per_m * (sd * noise.normal()).exp(),
        lateral_stiffness_n_per_m: rig.finger.lateral_stiffness_n_per_m * (sd * noise.normal()).exp(),
    };
    // The table keeps its own order of passes; they are found again by their points.
    let mut passes = set.passes.clone();
    for (pass, point) in clean.passes.iter().zip(&clean.points) {
        let force = effects::lateral_force(&baseline, &active, pass, &clean.design);
        let own = passes.iter_mut().find(|p| p.point == *point).expect("a table keeps its points");
        own.lateral_force_n = Some(
            force * (1.0 + rig.noise.pass_relative_sd * noise.normal())
                + rig.noise.force_sd_n * noise.normal(),
        );
        own.normal_force_n += rig.noise.force_sd_n * noise.normal();
    }
    let table = Table::measured(&passes).expect("a sealed table");
    let options = Options { pairs: false, ..Options::default() };
    let result = diagnose(&table, &rig, &options, String::new());
    let first = &result.report.hypotheses[0];
    let own = result.report.verdict == Verdict::Named
        && first.effects == [effect.name]
        && first.laws == [form.name];
    Covered {
        seed,
        effect: effect.name,
        law: form.name,
        truth: theta[0],
        ci95: own.then(|| first.parameters[0].ci95),
    }
}
