//! The study of Fig. 9 in CPU seconds, and what its faster ways change in its results.
//!
//! `cargo bench -p muprime-models --bench ridge_study`: every sixteenth case, by default (soft layers in longer steps, mass added
//! about the tip) beside all layers in one step and no mass added. `-- all`: the whole study (two minutes of CPU).
//! `mass=0.001`: with that share. `half`: half the step instead, to see what the step itself is worth. `like=TEXT`: only cases with this in their name. CPU time of one thread; the machine may be shared.
#![allow(clippy::disallowed_methods, reason = "it reads its arguments")]

#[path = "peers/turns.rs"]
mod turns;

use muprime_models::ridge::study::{content_key, fig_9};
use muprime_models::ridge::{RidgeCase, RidgeRun, RunSettings, run};
use std::collections::BTreeSet;
use turns::{spread, timed};

fn has_argument(word: &str) -> bool {
    std::env::args().any(|a| a == word)
}

fn main() {
    let one_in = if has_argument("all") { 1 } else { 16 };
    let new = RunSettings { energy: false, ..RunSettings::default() };
    let old = RunSettings { one_step: true, added_mass: 0.0, ..new };
    let share = std::env::args().find_map(|a| a.strip_prefix("mass=").map(|v| v.parse().expect("a number")));
    let like = std::env::args().find_map(|a| a.strip_prefix("like=").map(str::to_owned));
    beside(
        one_in,
        &like.unwrap_or_default(),
        &old,
        &RunSettings { added_mass: share.unwrap_or(new.added_mass), ..new },
    );
}

/// Cases with their panel and value.
fn cases(one_in: usize) -> Vec<(String, RidgeCase)> {
    let mut seen = BTreeSet::new();
    let distinct = fig_9(RidgeCase::paper())
        .into_iter()
        .filter(|p| seen.insert(content_key(&p.case, &RunSettings::default())))
        .map(|p| {
            let um = p.case.amplitude.micrometres();
            (format!("{} {}, {um:.2} um", p.panel.variable(), p.value), p.case)
        });
    distinct.step_by(one_in).collect()
}

/// The study under both settings.
fn beside(one_in: usize, like: &str, old: &RunSettings, new: &RunSettings) {
    let mut cases = cases(one_in);
    cases.retain(|(name, _)| name.contains(like));
    let (mut seconds, mut cycles, mut steps) = ([0.0; 2], [0; 2], [0; 2]);
    let (mut mu, mut phase) = (Vec::new(), Vec::new());
    for (name, case) in &cases {
        let mut results = Vec::new();
        for (k, mut settings) in [*old, *new].into_iter().enumerate() {
            if let (Some((first, _)), true) = (results.first(), has_argument("half")) {
                let first: &RidgeRun = first;
                settings = RunSettings { step_s: Some(0.5 * first.step_s), ..*old };
            }
            let mut result = None;
            let own = timed(|| result = Some(run(case, &settings).expect("runs")));
            seconds[k] += own;
            let result = result.expect("ran");
            cycles[k] += result.cycles;
            steps[k] += result.steps;
            results.push((result, own));
        }
        let [(one, before), (longer, after)] = &results[..] else { unreachable!("two runs") };
        let off = longer.mu_relative - one.mu_relative;
        mu.push(off);
        let turned = longer.phase_shift_deg.unwrap_or(0.0) - one.phase_shift_deg.unwrap_or(0.0);
        phase.push((turned + 180.0).rem_euclid(360.0) - 180.0);
        println!(
            "{name}: mu' {:.4} {off:+.4} (sd {:.4}), phase {:.1} deg {:+.1}, {} and {} cycles, {before:.2} and {after:.2} s",
            one.mu_relative,
            one.mu_relative_sd,
            one.phase_shift_deg.unwrap_or(0.0),
            phase[phase.len() - 1],
            one.cycles,
            longer.cycles,
        );
    }
    let rms = |v: &[f64]| (v.iter().map(|x| x * x).sum::<f64>() / v.len() as f64).sqrt();
    let size = |v: &[f64]| spread(v.iter().map(|x| x.abs()));
    println!(
        "{} cases of Fig. 9, 800 elements, CPU seconds of one thread: before {:.1}, now {:.1}, ratio {:.2}; \
         cycles {} and {}, steps {} and {}",
        cases.len(),
        seconds[0],
        seconds[1],
        seconds[0] / seconds[1],
        cycles[0],
        cycles[1],
        steps[0],
        steps[1]
    );
    println!(
        "difference of mu': rms {:.5}, median {:.5}, worst {:.5}; of the phase: rms {:.2}, median {:.2}, worst {:.2} deg",
        rms(&mu),
        size(&mu).median,
        size(&mu).most,
        rms(&phase),
        size(&phase).median,
        size(&phase).most
    );
}
