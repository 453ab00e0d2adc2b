//! The remarks of a run's summary and page: what a reader must know of its passes.

use crate::job::Summary;
use crate::sweep::{MeasuredPass, ZeroLevels, Zeros};
use models::PeakToPeak;
use models::pass::{REVERSED, is_reversed};
use serde::Serialize;

/// The summary of a run with what is to be remarked of its passes, as summary.json and `run --json` have it.
#[derive(Serialize)]
pub struct Remarked<'a> {
    #[serde(flatten)]
    summary: &'a Summary,
    /// Sentences for people.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
}

impl<'a> Remarked<'a> {
    /// Of the passes in the run's folder, as far as they can be read.
    pub fn of(summary: &'a Summary) -> Self {
        Remarked {
            summary,
            remarks: of_passes(
                &crate::run_dir::passes_in(&summary.folder).unwrap_or_default(),
                &summary.zeros,
            ),
        }
    }
}

/// What a reader of the passes must know: what `mu_0` is, zeros that are off, and a load that all of them
/// missed. Without a pass without vibration the loop has `mu_0` from the model, and the record has it: the
/// measured values then contain the model.
pub fn of_passes(passes: &[MeasuredPass], zeros: &Zeros) -> Vec<String> {
    let refers = |p: &MeasuredPass| p.pass.amplitude == PeakToPeak::ZERO && p.pass.lateral_force_n.is_some();
    let measured = passes.iter().any(|p| p.comparison.is_some_and(|c| c.mu_relative.is_some()));
    let rests = measured && !passes.iter().any(refers);
    let reversed = is_reversed(passes.iter().map(|p| &p.pass));
    let all = [(rests, NO_REFERENCE), (reversed, REVERSED)];
    all.into_iter()
        .filter(|(is, _)| *is)
        .map(|(_, words)| words.to_string())
        .chain(zeros_off(passes, zeros))
        .chain(load_missed(passes, zeros))
        .collect()
}

/// Share of the smallest force of an axis from which a zero, or its way in the run, is remarked.
pub const ZERO_SHARE: f64 = 0.05;

/// The remarks on zeros that are off, or that moved. The smallest force is the smallest commanded load, and
/// the smallest lateral force of a pass without vibration.
fn zeros_off(passes: &[MeasuredPass], zeros: &Zeros) -> Vec<String> {
    let still = passes.iter().filter(|p| p.pass.amplitude == PeakToPeak::ZERO);
    let friction = still.filter_map(|p| p.pass.lateral_force_n).map(f64::abs).reduce(f64::min);
    let load = passes.iter().filter_map(|p| p.commanded_normal_force_n).reduce(f64::min);
    let axes: [(_, _, fn(&ZeroLevels) -> Option<f64>); 2] =
        [("lateral", friction, |z| z.lateral_n), ("normal", load, |z| z.normal_n)];
    let mut all = Vec::new();
    for (axis, least, of) in axes {
        let [before, after] = [zeros.before, zeros.after].map(|zero| of(&zero?));
        let moved = before.zip(after).map(|(b, a)| a - b);
        for (what, found) in [("was off by", before), ("moved in the run by", moved)] {
            let Some((found, least)) = found.zip(least).filter(|(f, l)| f.abs() > ZERO_SHARE * l) else {
                continue;
            };
            all.push(format!(
                "the zero of the {axis} force {what} {:+.1} mN, {:.0} % of the smallest force on that axis, \
                 and the readings contain it: zero the sensor, let it warm up, and measure again",
                found * 1e3,
                100.0 * found.abs() / least
            ));
        }
    }
    all
}

/// The remark of a run whose passes all had a fifth more, or all a fifth less, than the commanded load. SR-43
/// does not see it of a light touch. What the zero before the sweep adds is no part of it.
fn load_missed(passes: &[MeasuredPass], zeros: &Zeros) -> Option<String> {
    let zero = zeros.before.and_then(|zero| zero.normal_n).unwrap_or(0.0);
    let share = |p: &MeasuredPass| Some((p.pass.normal_force_n - zero) / p.commanded_normal_force_n? - 1.0);
    let shares = passes.iter().map(share).collect::<Option<Vec<f64>>>().filter(|all| !all.is_empty())?;
    let missed = shares.iter().all(|s| *s > 0.2) || shares.iter().all(|s| *s < -0.2);
    let mean = 100.0 * shares.iter().sum::<f64>() / shares.len() as f64;
    missed.then(|| {
        format!(
            "all passes missed the commanded load, by {mean:+.0} % on average: check `factor` and unit of the normal force, its \
             `gain` or certificate, and what applies the load"
        )
    })
}

/// The remark of a run without references.
const NO_REFERENCE: &str =
    "no pass without vibration: mu_0 is that of the model, so measured mu' rests on the model";

#[cfg(test)]
mod tests {
    use super::*;
    use models::{Condition, Pass};

    fn pass(normal_force_n: f64, commanded_normal_force_n: Option<f64>) -> MeasuredPass {
        MeasuredPass {
            pass: Pass::at(1, &Condition { normal_force_n, ..Condition::paper() }, None),
            reference: false,
            comparison: None,
            regime: None,
            psi_eq17: None,
            temperature_flags: Vec::new(),
            commanded_normal_force_n,
            levels: Vec::new(),
        }
    }

    /// A sensor 299 mN off at a load of 250 mN ran to the end with a word on its factor; one that drifted by
    /// 99 mN had none.
    #[test]
    fn a_zero_that_is_off_or_moves_is_remarked_and_is_no_load_that_was_missed() {
        let zero = |normal_n| Some(ZeroLevels { lateral_n: Some(1e-4), normal_n: Some(normal_n) });
        let of = |before, after| {
            of_passes(&[pass(0.25 + before, Some(0.25))], &Zeros { before: zero(before), after: zero(after) })
        };
        let off = of(0.299, 0.3).join("\n");
        assert!(off.starts_with("the zero of the normal force was off by +299.0 mN, 120 %"), "{off}");
        assert!(!off.contains("missed the commanded load"), "{off}");
        let moved = of(0.0, 0.099).join("\n");
        assert!(
            moved.starts_with("the zero of the normal force moved in the run by +99.0 mN, 40 %"),
            "{moved}"
        );
        assert!(of(0.01, -0.002).is_empty());
    }

    /// Half of the load in every pass, by a wrong factor: the run was complete and nothing remarked it.
    #[test]
    fn a_load_that_every_pass_missed_is_remarked_and_one_that_some_missed_is_not() {
        let of = |found: &[f64], commanded: Option<f64>| {
            let passes: Vec<_> = found.iter().map(|found| pass(*found, commanded)).collect();
            of_passes(&passes, &Zeros::default()).join("\n")
        };
        let half = of(&[0.12, 0.13], Some(0.25));
        assert!(half.contains("missed the commanded load, by -50 % on average: check `factor`"), "{half}");
        assert!(of(&[0.5, 0.6], Some(0.25)).contains("+120 %"));
        for (found, commanded) in
            [(&[0.12, 0.24][..], Some(0.25)), (&[0.12, 0.4], Some(0.25)), (&[0.12], None), (&[], Some(0.25))]
        {
            assert_eq!(of(found, commanded), "", "{found:?}");
        }
    }
}
