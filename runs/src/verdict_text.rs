//! A verdict for people: what a terminal shows, and the plan of the best next experiment.

pub mod files;

use crate::format::{quantity, with_interval};
use diagnosis::report::certificates;
use diagnosis::report::format::{plain, probability};
use diagnosis::report::intervals::{Estimate, ProfileShape};
use diagnosis::report::locate::GapRegion;
use diagnosis::{Diagnosis, Hypothesis};
use miette::IntoDiagnostic;
use models::covariate::{self, Covariate};
use models::{Condition, RigFile};
use std::path::PathBuf;

/// Parts of the operating space that are named, the largest first.
const PARTS: usize = 6;
/// p-value below which a region is listed for people, and the least share of the gap in it.
const SIGNIFICANT: f64 = 0.05;
const LEAST_SHARE: f64 = 0.01;
/// Causes that a hypothesis cannot be separated from, by name; of more the number.
const ALIASES: usize = 4;
/// Probability from which a hypothesis is explained: its parameters, and what it cannot be separated from.
pub const EXPLAINED: f64 = 0.05;

/// The verdict for a person, certificates included.
pub fn words(result: &Diagnosis, rig: &RigFile) -> String {
    let mut text = terminal(result);
    let faults = certificates::at_fault(result, rig);
    let doubts = certificates::in_doubt(rig, &result.report.stiffness_pulls);
    for more in faults.iter().map(|f| f.text()).chain(doubts.iter().map(|d| d.text())) {
        text.push_str(&more);
        text.push('\n');
    }
    text
}

/// The corrected model as TOML; none where no effect of the library explains most of the gap.
///
/// # Errors
/// A model that TOML cannot hold.
pub fn corrected_model(result: &Diagnosis) -> miette::Result<Option<String>> {
    result.saved_model().map(|model| toml::to_string(&model)).transpose().into_diagnostic()
}

/// The plan of the experiment that tells most, after these runs; none where no conditions would tell more.
pub fn next_plan(result: &Diagnosis, continues: &[PathBuf]) -> Option<String> {
    result.report.next_experiment.iter().find(|e| !e.conditions.is_empty()).map(|e| plan(e, continues))
}

/// The plan of a designed experiment, one series with a name a condition: those that tell most first, grouped
/// by pressure, since a chamber is changed once. It names the runs that it continues.
pub fn plan(experiment: &diagnosis::report::next::Experiment, continues: &[PathBuf]) -> String {
    let mut conditions = experiment.conditions.clone();
    let pressure = |c: &Condition| c.ambient_pressure_pa.unwrap_or(0.0);
    conditions.sort_by(|a, b| pressure(b).total_cmp(&pressure(a)));
    let Some(base) = conditions.first() else { return String::new() };
    let about = toml::Value::String(experiment.text.clone());
    // Every plan has the settings that every table has, but the direction; a series names what the base cannot.
    let based = |c: &&Covariate| covariate::REQUIRED.iter().any(|r| r.name == c.name);
    // Six digits: what was measured of a setting is no more than that.
    let short = |v: f64| format!("{v:.5e}").parse().unwrap_or(v);
    let of = |c: &Condition, k: &Covariate| k.of(c).map(|v| (k.name, short(v)));
    let listed = |k: &&Covariate| k.name != covariate::DIRECTION.name;
    let runs: Vec<_> = continues.iter().map(|run| run.display().to_string()).collect();
    let runs = match runs.is_empty() {
        true => String::new(),
        false => format!("continues = {}\n", toml::Value::from(runs)),
    };
    let mut text = format!(
        "# Written by muprime diagnose.\nname = \"next-experiment\"\nabout = {about}\n{runs}randomise = false\n\n[base]\n"
    );
    let common = covariate::planned().filter(|k| listed(k) && based(k)).filter_map(|k| of(base, k));
    text.extend(common.map(|(name, value)| format!("{name} = {value:e}\n")));
    for (c, number) in conditions.iter().zip(1..) {
        let direction = i8::from(c.direction);
        text.push_str(&format!("\n[[series]]\nname = \"pass {number}\"\ndirections = [{direction}]\n"));
        let own = covariate::planned().filter(listed).filter_map(|k| of(c, k));
        text.extend(own.map(|(name, value)| format!("{name} = [{value:e}]\n")));
    }
    text
}

/// The name of a hypothesis with these effects.
pub(crate) fn name(effects: &[String]) -> String {
    if effects.is_empty() { "no gap".into() } else { plain(&effects.join(" + ")) }
}

/// A parameter's value with its interval, or as assumed where the table adds nothing to the prior.
pub fn estimate(p: &Estimate) -> String {
    match p.shape {
        ProfileShape::Prior => {
            format!("{} (as assumed; this table does not determine it)", quantity(p.value, p.unit))
        }
        _ => with_interval(p.value, p.ci95, p.unit),
    }
}

/// What a likely hypothesis cannot be separated from, the first few by name; `None` where nothing is.
pub fn aliases(h: &Hypothesis) -> Option<String> {
    let others = h.alias_class.get(1..).filter(|others| !others.is_empty() && h.probability > EXPLAINED)?;
    let more = others.len().saturating_sub(ALIASES);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    Some(plain(&others[..others.len().min(ALIASES)].join(", ")) + &more)
}

/// What an unknown departure looks like, a line a structure; none of structures that the best cause beats.
pub fn looks_like(result: &Diagnosis) -> impl Iterator<Item = String> + '_ {
    let all = result.report.description.iter().filter(|d| d.leads());
    let odds = |log: f64| if log > 6.0 { "above 10^6".into() } else { format!("of {:.0}", 10f64.powf(log)) };
    all.map(move |d| format!("{} (odds {} to 1 against no gap)", d.text, odds(d.log10_odds_vs_no_gap)))
}

/// Regions with passes in which the gap shows, the largest first and no more than `most`; and a line that
/// counts the others.
pub fn listed(regions: &[GapRegion], most: usize) -> (Vec<&str>, Option<String>) {
    let shows = |g: &&GapRegion| g.measured && g.p_value < SIGNIFICANT && g.share_of_gap >= LEAST_SHARE;
    let shown: Vec<&str> = regions.iter().filter(shows).take(most).map(|g| &*g.text).collect();
    let empty = regions.iter().filter(|g| !g.measured).count();
    let weak = regions.iter().filter(|g| g.measured && g.p_value >= SIGNIFICANT).count();
    let small = regions.len() - shown.len() - empty - weak;
    let counts = [
        (small, "with a smaller share".to_string()),
        (empty, "without passes".to_string()),
        (weak, format!("with p of {SIGNIFICANT} or more")),
    ];
    let rest: Vec<String> =
        counts.iter().filter(|(n, _)| *n > 0).map(|(n, words)| format!("{n} {words}")).collect();
    let rest = (!rest.is_empty()).then(|| format!("Further regions: {}", rest.join(", ")));
    (shown, rest)
}

/// What a terminal shows.
pub fn terminal(result: &Diagnosis) -> String {
    let r = &result.report;
    let mut text = format!("{}\n\nHypotheses\n", r.text);
    for h in r.hypotheses.iter().filter(|h| h.probability > 0.005).take(8) {
        text.push_str(&format!("  {:>7}  {}", probability(h.probability), name(&h.effects)));
        if let Some(others) = aliases(h) {
            text.push_str(&format!("  (cannot be separated from {others})"));
        }
        text.push('\n');
        if h.probability > EXPLAINED {
            for p in &h.parameters {
                text.push_str(&format!("         {} = {}\n", plain(p.name), estimate(p)));
            }
        }
    }
    for (at, line) in looks_like(result).enumerate() {
        text.push_str(if at == 0 { "\nWhat the departure looks like\n  " } else { "  " });
        text.push_str(&format!("{line}\n"));
    }
    if !r.at_least.is_empty() {
        text.push_str(&format!("\nAt least {}; the rest is open\n", plain(&r.at_least.join(", "))));
    }
    let g = &r.gap;
    let share = |rmse: Option<f64>| {
        rmse.map_or_else(|| "- (the table is too short)".to_string(), |v| format!("{v:.4}"))
    };
    text.push_str(&format!(
        "\nGap on passes that were not fitted, as a share of full friction\n  nominal baseline      {}\n  recalibrated baseline {}\n  verdict's model       {}\n  repeatability         {}\n",
        share(g.before_rmse), share(g.recalibrated_rmse), share(g.after_rmse), share(g.noise_floor_rmse)
    ));
    if let Some((verb, percent, Some([low, high]))) = g.change() {
        text.push_str(&format!("  the removable gap {verb} by {percent:.0} % [{low:.0}, {high:.0}]\n"));
    }
    // Without edges the reason is among what cannot be tested.
    if let Some(record) = r.record.as_ref().filter(|record| record.is_judged()) {
        text.push_str("\nTime, by the edges in the run's record\n");
        record.comparisons.iter().for_each(|c| text.push_str(&format!("  {}\n", c.text)));
    }
    if !r.location.regions.is_empty() {
        text.push_str("\nWhere\n");
        let (shown, rest) = listed(&r.location.regions, PARTS);
        shown.iter().for_each(|line| text.push_str(&format!("  {line}\n")));
        if let Some(rest) = rest {
            text.push_str(&format!("  {rest} (--json lists them)\n"));
        }
    }
    if !r.next_experiment.is_empty() {
        text.push_str("\nNext\n");
        for e in r.next_experiment.iter().take(4) {
            text.push_str(&format!("  {}", e.text));
            if e.conditions.is_empty() {
                text.push_str(&format!(" {}", e.worth()));
            }
            text.push('\n');
        }
    }
    if !r.not_testable.is_empty() {
        text.push_str("\nThis table cannot test\n");
        text.extend(r.not_testable.iter().map(|n| format!("  {}: {}\n", plain(&n.effect), n.because)));
    }
    text.extend(r.remarks.iter().map(|remark| format!("\n{remark}\n")));
    text
}

#[cfg(test)]
mod tests {
    use super::{plan, probability};
    use crate::plan::{Plan, Resolution};
    use diagnosis::report::next::Experiment;
    use models::{Condition, Direction, PeakToPeak};
    use realtime::{Limits, Nanos};
    use std::path::PathBuf;

    #[test]
    fn neither_certainty_nor_impossibility_is_claimed() {
        assert_eq!([0.0, 0.5, 1.0].map(probability), ["< 0.001", "0.500", "> 0.999"]);
    }

    #[test]
    fn a_saved_plan_asks_for_the_designed_passes() {
        let one = Condition {
            amplitude: PeakToPeak::from_metres(3e-6),
            direction: Direction::Backward,
            normal_force_n: 0.4,
            position_m: 0.001,
            ambient_pressure_pa: Some(101_325.0),
            ..Condition::paper()
        };
        let thin = Condition { ambient_pressure_pa: Some(20_000.0), direction: Direction::Forward, ..one };
        let conditions = vec![thin, one, Condition { speed_m_s: 0.01, ..thin }, one];
        let experiment = Experiment {
            conditions: conditions.clone(),
            separates: ["a".to_string(), "b".to_string()],
            expected_nats: 3.0,
            expected_odds: None,
            text: "4 passes that part \"a\" from b".to_string(),
        };
        let plan = Plan::parse("next.toml", &plan(&experiment, &["runs/a \"b\"".into()]))
            .expect("a plan that can be read");
        assert_eq!(plan.file.continues, [PathBuf::from("runs/a \"b\"")]);
        let resolution = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        let points =
            plan.points(1, &Limits::paper(Nanos(1_000_000)), &resolution).expect("a plan within limits");
        let mut planned: Vec<[f64; 4]> = points
            .iter()
            .filter(|p| !p.reference)
            .map(|p| {
                let c = &p.condition;
                [c.speed_m_s, c.direction.sign(), c.position_m, c.ambient_pressure_pa.unwrap_or(0.0)]
            })
            .collect();
        let mut wanted: Vec<[f64; 4]> = conditions
            .iter()
            .map(|c| [c.speed_m_s, c.direction.sign(), c.position_m, c.ambient_pressure_pa.unwrap_or(0.0)])
            .collect();
        let order = |a: &[f64; 4], b: &[f64; 4]| a.partial_cmp(b).expect("finite settings");
        planned.sort_by(order);
        wanted.sort_by(order);
        assert_eq!(planned, wanted);
        // Each pressure is set once.
        let mut pressures: Vec<_> = points.iter().map(|p| p.condition.ambient_pressure_pa).collect();
        pressures.dedup();
        assert_eq!(pressures.len(), 2);
    }
}
