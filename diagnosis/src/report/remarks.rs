//! Remarks beside a verdict, in words: what is missing from the table, what was assumed, what its scatter says.

use crate::data::Table;
use crate::hypotheses::{Candidate, Fitted};
use crate::regression::{Bends, scaled};
use crate::report::format::{probability, three_digits};
use crate::report::with_suspects::{WithSuspects, leading};
use crate::scatter::Scatter;
use crate::verdict::{Decision, Verdict};
use models::PeakToPeak;
use models::covariate::{AMPLITUDE, CovariateRole, SMOOTH};

/// Most suspect passes that the text lists, the farthest first.
const LISTED: usize = 8;

/// Relative departure of the scatter from the statement below which the statement was used.
const AS_STATED: f64 = 0.01;

/// Family-wise p-value below which the text reports structure.
const STRUCTURED: f64 = 0.01;

/// What a table lacks.
pub fn of_table(fitted: &Fitted, table: &Table, decision: &Decision) -> Vec<String> {
    let mut remarks = Vec::new();
    if decision.leader().is_none() {
        let text =
            "No effect of the library could be tried on this table: `not_testable` says what is missing.";
        remarks.push(text.into());
    }
    if table.passes.iter().all(|pass| pass.amplitude > PeakToPeak::ZERO) {
        remarks.push("No pass has the plate still: mu0 is unknown and was fitted; add w = 0 passes.".into());
    }
    if fitted.pure.variance_ratio.is_none() {
        let used = fitted.scatter.scale;
        let stands = if (used - 1.0).abs() < AS_STATED {
            "the repeatability is that of rig.toml.".to_string()
        } else {
            format!(
                "the repeatability is the scatter about the recalibrated baseline, {used:.2} times what rig.toml \
                 states."
            )
        };
        remarks.push(format!("No repeats close in time: {stands}"));
    }
    let found = fitted.structure.as_ref().filter(|s| s.p < STRUCTURED && decision.verdict != Verdict::Named);
    remarks.extend(found.map(|s| {
        format!(
            "The residuals of the recalibrated baseline are not scatter: {} is conspicuous (p = {:.1e} over everything \
             searched).",
            s.place, s.p
        )
    }));
    remarks.extend(together(table));
    remarks.extend(two_levels(fitted, table, decision));
    remarks.extend(silent_regions(fitted, decision));
    remarks.extend(bent(fitted, decision));
    remarks.extend(decision.misfit.map(|sd| {
        format!(
            "The leading pair leaves a misfit: chi2 is {sd:.0} deviations above what the scatter makes. The causes are \
             others, or have another form; so it is not named."
        )
    }));
    remarks
}

/// Left-out regions that do not judge the leading cause, and why.
fn silent_regions(fitted: &Fitted, decision: &Decision) -> Option<String> {
    let list = decision.regions.iter().filter(|r| !r.judges);
    let silent: Vec<&str> = list.map(|r| r.name.as_str()).collect();
    let bent = decision.leader().is_some_and(|l| !fitted.candidates[l].best.change.bent.is_empty());
    let why = if bent {
        "Its size there may be any smooth function, or the rest of the table tells nothing of it."
    } else {
        "The rest of the table tells nothing of it."
    };
    let regions = silent.join(", ");
    (!silent.is_empty()).then(|| {
        format!(
            "Left-out regions that do not judge the leading cause: {regions}. {why} A further level would."
        )
    })
}

/// The leading cause of a verdict that names one.
fn led_by<'a>(fitted: &'a Fitted, decision: &Decision) -> Option<&'a Candidate> {
    let led = matches!(decision.verdict, Verdict::Named | Verdict::Ambiguous);
    Some(&fitted.candidates[decision.leader().filter(|_| led)?])
}

/// Nats by which a bent cause must explain the table better than its law for the law to be called another.
const BENT_NATS: f64 = 5.0;

/// Says of a named cause that the table speaks against its law.
fn bent(fitted: &Fitted, decision: &Decision) -> Option<String> {
    let leader = led_by(fitted, decision)?;
    let nats = leader.best.log_evidence - leader.best.plain.as_ref()?.log_evidence;
    let of = leader.best.members.iter().filter(|m| leader.best.change.bends(m.effect)).map(|m| {
        let effect = effects::at(m.effect);
        let name = effect.name.replace('_', " ");
        let over = effect.acts.map_or(&[][..], |acts| acts.over).iter().map(|c| c.words);
        match leader.best.freedom.bends {
            Bends::Input => {
                format!("{name} as a function of {} of a free form", over.collect::<Vec<_>>().join(" and "))
            }
            Bends::Size => format!("{name} whose size goes with the place or the weather"),
        }
    });
    let of: Vec<String> = of.collect();
    (nats > BENT_NATS).then(|| {
        format!(
            "The table speaks against the library's law: {} explains it better, by {nats:.0} nats. \
             Predictions follow that form. Parameters, their intervals and the saved model are those of the library's \
             law.",
            of.join(" and ")
        )
    })
}

/// Share of a covariate's range that parts two levels of it.
const PARTED: f64 = 0.8;

/// Settings that the leading cause needs and that have two levels: that it acts shows, its law does not.
fn two_levels(fitted: &Fitted, table: &Table, decision: &Decision) -> Option<String> {
    let leader = led_by(fitted, decision)?;
    let needs = leader.effects.iter().flat_map(|e| effects::at(*e).needs);
    let largest = table.design.largest_amplitude_m;
    let mut words: Vec<&str> = needs
        .filter_map(|need| need.levels_of())
        .filter(|c| {
            let moving =
                table.passes.iter().filter(|p| p.amplitude > PeakToPeak::ZERO || c.name != AMPLITUDE.name);
            let mut values: Vec<f64> = moving.filter_map(|p| c.of(p)).map(|v| c.scaled(v, largest)).collect();
            values.sort_by(f64::total_cmp);
            let range = values.last().unwrap_or(&0.0) - values.first().unwrap_or(&0.0);
            range > 0.0 && values.windows(2).any(|w| w[1] - w[0] > PARTED * range)
        })
        .map(|c| c.words)
        .collect();
    words.dedup();
    (!words.is_empty()).then(|| {
        format!(
            "Two levels only of {}: they show that the leading cause acts, but not by which law. Add a third level.",
            words.join(" and ")
        )
    })
}

/// Correlation from which two covariates change together.
const TOGETHER: f64 = 0.9;

/// Covariates that change together: what one does this table cannot tell from what the other does.
fn together(table: &Table) -> Vec<String> {
    let largest = table.design.largest_amplitude_m;
    let axes: Vec<(&str, Vec<f64>)> = SMOOTH
        .iter()
        .filter(|c| c.role != CovariateRole::Climate)
        .filter_map(|c| {
            let mut values = scaled(c, &table.passes, largest)?;
            let n = values.len() as f64;
            let mean = values.iter().sum::<f64>() / n;
            values.iter_mut().for_each(|v| *v -= mean);
            let norm = values.iter().map(|v| v * v).sum::<f64>().sqrt();
            values.iter_mut().for_each(|v| *v /= norm);
            (norm > c.least_spread.max(1e-9) * n.sqrt()).then_some((c.words, values))
        })
        .collect();
    let mut remarks = Vec::new();
    for (k, (a, x)) in axes.iter().enumerate() {
        for (b, y) in &axes[k + 1..] {
            let r: f64 = x.iter().zip(y).map(|(p, q)| p * q).sum();
            if r.abs() > TOGETHER {
                remarks.push(format!(
                    "{a} and {b} change together (correlation {r:.2}): this table cannot tell what one does from what the other \
                     does. Vary one while the other stays."
                ));
            }
        }
    }
    remarks
}

/// What a table's scatter says.
pub fn of_scatter(fitted: &Fitted, decision: &Decision, with_suspects: Option<&WithSuspects>) -> Vec<String> {
    let k = &fitted.problem.constants;
    let scatter = &fitted.scatter;
    let mut remarks = Vec::new();
    let misstated = |scale: f64| scale > k.misstated || scale < 1.0 / k.misstated;
    let repeats = fitted.pure.excludes_the_used().filter(|repeats| misstated(*repeats));
    if let Some(repeats) = repeats {
        remarks.push(format!(
            "Passes under the same conditions scatter {} times as much as rig.toml states; a scatter of \
             {:.2} times the stated one was used. Correct [noise] in rig.toml, or say which passes are no repeats.",
            three_digits(repeats),
            scatter.scale
        ));
    } else if misstated(scatter.scale) {
        remarks.push(format!(
            "Passes scatter {:.2} times as much as rig.toml states; the measured scatter was used.{}",
            scatter.scale,
            match fitted.pure.variance_ratio {
                None =>
                    " A deviation that looks like scatter would do the same: repeat some conditions to tell.",
                Some(_) => "",
            }
        ));
    }
    if let Some(sd) = scatter.run_relative_sd.filter(|sd| *sd > 0.0) {
        remarks.push(format!(
            "The level of friction shifts from run to run by {:.1} % (one standard deviation): counted as scatter of the runs, \
             without a cause.",
            100.0 * sd
        ));
    }
    if scatter.serial_correlation > 0.0 {
        remarks.push(format!(
            "Neighbouring passes scatter alike (correlation {:.2}): only a slow change of friction that is larger can be seen.",
            scatter.serial_correlation
        ));
    }
    if let Some(other) = with_suspects {
        remarks.push(suspects(scatter, &leading(fitted, decision).0, decision.verdict, other));
    }
    if let Some(place) = &scatter.together_in {
        remarks.push(format!(
            "Passes that stand out lie together ({place}): they count as a departure, not as bad passes."
        ));
    }
    remarks
}

fn suspects(scatter: &Scatter, effects: &[String], verdict: Verdict, other: &WithSuspects) -> String {
    let mut list: Vec<_> = scatter.suspects.iter().collect();
    list.sort_by(|a, b| b.deviations.abs().total_cmp(&a.deviations.abs()));
    let points: Vec<String> = list
        .iter()
        .take(LISTED)
        .map(|s| format!("{} (off by {:+.3} N, {:+.1} sd)", s.point, s.residual_n, s.deviations))
        .collect();
    let more = match list.len().saturating_sub(LISTED) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let with = if other.verdict == verdict && other.effects == effects {
        format!("The verdict is the same with them (probability {})", probability(other.probability))
    } else {
        format!("With them it would be {} (probability {})", other.words(), probability(other.probability))
    };
    format!(
        "Suspect passes, which count for little: points {}{more}. {with}. Look them up in the record.",
        points.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};
    use crate::{Options, diagnose};

    /// A load that rises with time is reported; a table in random order has no such pair.
    #[test]
    fn covariates_that_change_together_are_reported() {
        let mut table = table(&mut Deviates(5), 0.0);
        assert!(together(&table).is_empty(), "{:?}", together(&table));
        table.passes.iter_mut().for_each(|p| p.normal_force_n = 0.15 * (1.0 + p.time_s / 60.0));
        let list = together(&table);
        assert!(list.len() == 1 && list[0].contains("time") && list[0].contains("force"), "{list:?}");
    }

    /// Two speeds are enough to name friction that depends on speed: without one of them the rest tells
    /// nothing, so that region does not judge, and the text reports it.
    #[test]
    fn a_law_of_two_levels_is_not_judged_without_one_of_them() {
        let mut table = table(&mut Deviates(8), 0.0);
        let mut draw = Deviates(9);
        for (i, (p, l)) in table.passes.iter_mut().zip(&mut table.lateral).enumerate() {
            let faster = (i / 2) % 2 == 0;
            p.speed_m_s = if faster { 0.09 } else { 0.01 };
            p.amplitude = models::quantity::PeakToPeak::ZERO;
            let mu = if faster { 0.6 } else { 0.5 };
            *l = p.direction.sign() * p.normal_force_n * mu * (1.0 + 0.02 * draw.normal());
        }
        let result = diagnose(&table, &rig(), &Options { pairs: false, ..Options::default() }, String::new());
        let silent: Vec<&str> =
            result.decision.regions.iter().filter(|r| !r.judges).map(|r| r.name.as_str()).collect();
        assert_eq!(silent, ["low speed", "high speed"], "{}", result.report.text);
        assert!(
            result.report.remarks.iter().any(|r| r.starts_with("Two levels only of speed")),
            "{:?}",
            result.report.remarks
        );
        assert_eq!(result.report.verdict, Verdict::Named, "{}", result.report.text);
        assert_eq!(result.report.hypotheses[0].effects, ["rate_dependent_friction"]);
    }
}
