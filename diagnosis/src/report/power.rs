//! From which size of each effect this table would claim a gap. docs/diagnosis/model.md, section 10.

use crate::hypotheses::{Candidate, Fitted};
use crate::regression::{Layout, Posterior, Recalibration};
use serde::Serialize;

/// The size of an effect from which a table like this would claim a gap.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct SeenFrom {
    /// Name of the effect.
    pub effect: &'static str,
    /// The law by which it would.
    pub law: &'static str,
    /// The size; none where no size within the law's bounds would show.
    pub size: Option<f64>,
    /// Its parameter.
    pub parameter: &'static str,
    /// Unit of the size.
    pub unit: &'static str,
    /// Gap of that size over the table, root mean square over full friction, recalibration taken off; none with the size.
    pub gap_rmse: Option<f64>,
}

/// Halvings of the range of a size.
const HALVINGS: u32 = 24;

/// Each single effect that was tried, most visible first.
///
/// An effect of a size adds half the chi2 of its change, net of recalibration, to its log evidence; it must make up what the
/// law is behind for its volume, and the prior (tempered as all evidence is), and leave no gap less than the probability at which a gap is claimed.
pub fn seen_from(fitted: &Fitted) -> Vec<SeenFrom> {
    let k = &fitted.problem.constants;
    let singles: Vec<&Candidate> = fitted.candidates.iter().filter(|c| c.effects.len() == 1).collect();
    let prior = (k.prior_no_gap * singles.len() as f64 / k.prior_single).ln();
    let threshold = k.temper * (prior + ((1.0 - k.claim_probability) / k.claim_probability).ln());
    let mut list: Vec<SeenFrom> = singles.into_iter().map(|c| one(fitted, c, threshold)).collect();
    let gap = |s: &SeenFrom| s.gap_rmse.unwrap_or(f64::INFINITY);
    list.sort_by(|a, b| gap(a).total_cmp(&gap(b)).then(a.effect.cmp(b.effect)));
    list
}

/// By the law that fits best, else by the first that shows: the shapes of a law that fits nothing may be such that it does nothing.
fn one(fitted: &Fitted, candidate: &Candidate, threshold: f64) -> SeenFrom {
    let behind = (fitted.baseline.log_evidence - candidate.log_evidence).max(0.0);
    let own = by_law(fitted, &candidate.best, threshold + behind);
    let mut others = candidate.laws.iter().map(|(_, law)| by_law(fitted, law, threshold + behind));
    if own.size.is_some() { own } else { others.find(|s| s.size.is_some()).unwrap_or(own) }
}

fn by_law(fitted: &Fitted, law: &Posterior, threshold: f64) -> SeenFrom {
    let (problem, law) = (&fitted.problem, law.by_law());
    let (member, place) = (law.members[0], Layout::of(&law.members).size(0));
    let parameter = member.parameters(&problem.design)[0];
    let change = |size: f64| {
        let mut u = law.u.clone();
        u[place] = size;
        Recalibration::of(problem, &u, &problem.predict(&law.members, &u)).net()
    };
    let seen = |size: f64| 0.5 * problem.chi2(&change(size)) > threshold;
    let most = parameter.coordinate_bounds().1;
    let found = seen(most).then(|| models::root::halved([0.0, most], HALVINGS, |size| !seen(size))[1]);
    let rms = |size: f64| {
        let squares = change(size);
        let over = squares.iter().zip(problem.full_friction()).map(|(c, full)| (c / full).powi(2));
        (over.sum::<f64>() / problem.len() as f64).sqrt()
    };
    SeenFrom {
        effect: member.name(),
        law: member.form().name,
        size: found.map(|u| parameter.value(u)),
        parameter: parameter.name,
        unit: parameter.unit,
        gap_rmse: found.map(rms),
    }
}

/// The same in a sentence, for a verdict of no gap.
pub fn remark(list: &[SeenFrom]) -> Option<String> {
    let shown: Vec<&SeenFrom> = list.iter().filter(|s| s.gap_rmse.is_some()).collect();
    let (first, last) = (shown.first()?, shown.last()?);
    let unseen: Vec<&str> = list.iter().filter(|s| s.gap_rmse.is_none()).map(|s| s.effect).collect();
    let hidden = if unseen.is_empty() {
        String::new()
    } else {
        format!(" Not detectable at any size: {}.", unseen.join(", "))
    };
    Some(format!(
        "The smallest detectable gap depends on the effect: {:.4} of full friction ({}) to {:.4} ({}), root mean square; \
         `seen_from` has each.{hidden}",
        first.gap_rmse?, first.effect, last.gap_rmse?, last.effect
    ))
}

#[cfg(test)]
mod tests {
    use crate::regression::Layout;
    use crate::tests::{Deviates, rig, table};
    use crate::{Options, Table, Verdict, diagnose};

    /// A gap of 0.4 of what is stated is rarely claimed, one of twice as much mostly: what noise adds to the
    /// evidence, and what a gap adds to the estimate of the noise, is of the order of the limit itself.
    #[test]
    fn a_gap_shows_from_the_size_that_is_stated() {
        let effects = ["load_dependent_friction", "lateral_offset_drift", "rate_dependent_friction"];
        let (mut small, mut large, mut tables) = (0, 0, 0);
        let options = Options { pairs: false, ..Options::default() };
        let claims =
            |table: &Table| diagnose(table, &rig(), &options, String::new()).report.verdict != Verdict::NoGap;
        for seed in 1..=5 {
            let own = table(&mut Deviates(seed), 0.0);
            let result = diagnose(&own, &rig(), &options, String::new());
            assert_eq!(result.report.verdict, Verdict::NoGap, "{}", result.report.text);
            for seen in result.report.seen_from.iter().filter(|s| effects.contains(&s.effect)) {
                let size = seen.size.expect("a size that shows");
                let candidate = result.fitted.candidates.iter().find(|c| c.names() == [seen.effect]);
                let (problem, best) = (&result.fitted.problem, &candidate.expect("a single effect").best);
                let parameter = best.members[0].parameters(&problem.design)[0];
                let planted = |share: f64| {
                    let mut u = best.u.clone();
                    u[Layout::of(&best.members).size(0)] = parameter.coordinate(share * size);
                    let with = problem.predict(&best.members, &u);
                    let without = problem.predict(&[], &u[..crate::regression::layout::NUISANCES]);
                    let change = with - without;
                    let lateral = own.lateral.iter().zip(change.iter()).map(|(l, c)| l + c).collect();
                    claims(&Table { lateral, ..own.clone() })
                };
                tables += 1;
                small += usize::from(planted(0.4));
                large += usize::from(planted(2.0));
            }
        }
        assert_eq!(tables, 15);
        assert!(small <= 3 && large >= 12, "{small} and {large} of {tables}");
    }
}
