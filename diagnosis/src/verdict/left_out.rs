//! The gap left in regions that the fit did not see. docs/diagnosis/model.md, section 9, steps 2 and 3.

use crate::constants::Constants;
use crate::hypotheses::Fitted;
use crate::regression::{
    Covariance, Fit, Freedom, Member, Posterior, Problem, Recalibration, laplace, minimise, product,
    rows_times, without_member,
};
use models::Condition;
use models::covariate::{AMBIENT_PRESSURE, AMPLITUDE, Covariate, FREQUENCY, NORMAL_FORCE, SPEED, TIME};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Mean squares over a region, in units of what repeatability and an open baseline leave: one where nothing is left.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors {
    /// Number of passes.
    pub passes: usize,
    /// Of the recalibrated baseline.
    pub recalibrated: f64,
    /// Of the hypothesis.
    pub after: f64,
}

impl Errors {
    /// `1 - sqrt(left / G)`; `None` where there is no gap to close.
    pub fn closed(&self) -> Option<f64> {
        let gap = self.recalibrated - 1.0;
        (gap > 0.0).then(|| 1.0 - ((self.after - 1.0).max(0.0) / gap).sqrt())
    }
}

/// A part of the operating space that was left out and predicted from the rest.
#[derive(Debug, Clone)]
pub struct LeftOutRegion {
    /// What it is, in words.
    pub name: String,
    /// Errors there.
    pub errors: Errors,
    /// Whether the rest of the table holds enough of the gap, and of each cause's own part, to learn from.
    pub informed: bool,
    /// Whether it judges at all: not where the rest has one level of a covariate and so tells nothing of the cause.
    pub judges: bool,
}

/// Ratio of the largest to the smallest value within which a covariate has one level.
const ONE_LEVEL: f64 = 1.05;
/// The same with the scatter of a setting that is measured.
const SAME_LEVEL: f64 = 1.1;
/// Share of a pass by which a count may miss a bound for rounding.
const ROUNDING: f64 = 1e-6;
/// Relative difference within which two frequencies are one.
const ONE_FREQUENCY: f64 = 1e-3;

/// Passes at one end of a covariate, or at one level of it.
pub struct LeftOutPart {
    /// In words.
    pub name: String,
    /// The covariate that tells them from the rest.
    pub over: &'static Covariate,
    /// Their rows.
    pub rows: Vec<usize>,
}

/// Parts of the operating space that are worth leaving out: ends of each covariate, each frequency, late passes.
pub fn regions(problem: &Problem) -> Vec<LeftOutPart> {
    let n = problem.len();
    let p = &problem.passes;
    let mut list: Vec<LeftOutPart> = Vec::new();
    let k = &problem.constants;
    let fits = |rows: &[usize], most: f64| {
        rows.len() >= k.region_least && rows.len() as f64 <= most * n as f64 + ROUNDING
    };
    let ends = |over: &'static Covariate, name: &str, of: &[usize], list: &mut Vec<LeftOutPart>| {
        let value = |i: usize| over.of(&p[i]).unwrap_or(f64::NAN);
        let mut sorted: Vec<f64> = of.iter().map(|&i| value(i)).collect();
        sorted.sort_by(f64::total_cmp);
        if sorted.len() < 2 * k.region_least || sorted[sorted.len() - 1] <= sorted[0] * ONE_LEVEL {
            return;
        }
        let cut = |q: f64| sorted[((sorted.len() - 1) as f64 * q.min(1.0)) as usize];
        let (low, high) = (cut(k.region_cuts[0]), cut(k.region_cuts[1]));
        let below: Vec<usize> = of.iter().copied().filter(|&i| value(i) <= low).collect();
        let above: Vec<usize> = of.iter().copied().filter(|&i| value(i) >= high).collect();
        for (word, rows) in [("low", below), ("high", above)] {
            if fits(&rows, k.region_most) {
                list.push(LeftOutPart { name: format!("{word} {name}"), over, rows });
            }
        }
    };
    let all: Vec<usize> = (0..n).collect();
    let vibrating: Vec<usize> = (0..n).filter(|&i| p[i].amplitude.metres() > 0.0).collect();
    ends(&AMPLITUDE, "amplitude", &vibrating, &mut list);
    ends(&SPEED, "speed", &all, &mut list);
    ends(&NORMAL_FORCE, "load", &all, &mut list);
    let mut frequencies: Vec<f64> = p.iter().map(|q| q.frequency_hz).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup_by(|a, b| (*a / *b - 1.0).abs() < ONE_FREQUENCY);
    if (2..=4).contains(&frequencies.len()) {
        for f in frequencies {
            let rows: Vec<usize> =
                (0..n).filter(|&i| (p[i].frequency_hz / f - 1.0).abs() < ONE_FREQUENCY).collect();
            if fits(&rows, k.region_most_level) {
                list.push(LeftOutPart { name: format!("{f:.0} Hz"), over: &FREQUENCY, rows });
            }
        }
    }
    let late: Vec<_> = all.iter().copied().filter(|&i| i as f64 >= (1.0 - k.late_share) * n as f64).collect();
    list.push(LeftOutPart { name: "late".to_string(), over: &TIME, rows: late });
    let pressures: Vec<f64> = p.iter().filter_map(|q| q.ambient_pressure_pa).collect();
    if pressures.len() == n {
        let top = pressures.iter().copied().fold(0.0, f64::max);
        let rows: Vec<usize> = (0..n).filter(|&i| pressures[i] < k.low_pressure * top).collect();
        if fits(&rows, k.region_most_level) {
            list.push(LeftOutPart { name: "low pressure".to_string(), over: &AMBIENT_PRESSURE, rows });
        }
    }
    // A region needs a rest to be predicted from.
    list.retain(|part| part.rows.len() < n);
    list
}

/// Measured less expected at rows that a refit to the others did not see, N; and the refit.
///
/// By least squares: a departure from form would take up part of what the rest shows of the cause, and leave the form
/// to predict less than it can. On sealed sets causes close more that way (a cause whose standing wave is not the
/// library's 0.83 of the gap instead of 0.62), and pairs that imitate a cause outside the library less.
fn left_out(rest: &Problem, out: &Problem, members: &[Member], start: &[f64]) -> (DVector<f64>, Fit) {
    let refit = minimise(rest, members, start, &rest.variance, ROUNDS);
    let expected = out.predict(members, &refit.u);
    (DVector::from_column_slice(&out.lateral) - expected, refit)
}

/// The same of a cause whose function of few covariates is bent: what the rest shows of the function is
/// part of the mechanism.
fn left_out_bent(
    fitted: &Fitted,
    best: &Posterior,
    rest: &Problem,
    out: &Problem,
    rows: [&[usize]; 2],
) -> DVector<f64> {
    let freedom = Freedom { share: 0.0, ..best.freedom };
    let [others, rows] = rows;
    let refit = laplace(rest, &best.members, &best.u, &fitted.basis.select(others), freedom, ROUNDS);
    let shift = Recalibration::of(rest, &refit.u, &refit.prediction).shift;
    let plain = out.predict(&best.members, &refit.u);
    let there = refit.change.at(out, &best.members, &refit.u, &plain, &shift);
    let expected = plain + there.columns(&fitted.basis.select(rows), 0.0) * &refit.departure;
    DVector::from_column_slice(&out.lateral) - expected
}

/// Covariance of a region's passes: scatter, and what the rest leaves open of the baseline.
///
/// Stiffnesses that the rest does not tell carry baseline and hypothesis off together where they begin to
/// matter; that says nothing of the cause. What the rest leaves open of the hypothesis is not granted:
/// unlisted that a free shape imitates would close by it.
fn metric(rest: &Problem, out: &Problem, baseline: &Fit) -> Covariance {
    let whitened = |p: &Problem| {
        let inverse_sd = DVector::from_fn(p.len(), |i, _| 1.0 / p.variance[i].sqrt());
        rows_times(p.jacobian(&[], &baseline.u, &p.predict(&[], &baseline.u)), &inverse_sd)
    };
    let (seen, left) = (whitened(rest), whitened(out));
    let precision = seen.transpose() * &seen + DMatrix::from_diagonal(&rest.prior_precision(&[]).into());
    let root = precision.cholesky().and_then(|c| c.l().solve_lower_triangular(&left.transpose()));
    let open = root.map_or_else(|| DMatrix::zeros(out.len(), 0), |r| r.transpose());
    out.covariance(&rows_times(open, &DVector::from_fn(out.len(), |i, _| out.variance[i].sqrt())))
}

/// Whether the rest of a table has one level of a covariate that has more in the whole, and what the cause
/// changes there is but another baseline: a law cannot be learnt from one level.
fn tells_nothing(problem: &Problem, rest: &Problem, best: &Posterior) -> bool {
    let levels: [fn(&Condition) -> f64; 4] =
        [|p| p.amplitude.metres(), |p| p.speed_m_s, |p| p.normal_force_n, |p| p.frequency_hz];
    let one = |p: &Problem, value: fn(&Condition) -> f64| {
        let seen = p.passes.iter().map(value).filter(|v| *v > 0.0);
        let (low, high) = seen.fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
        high <= low * SAME_LEVEL
    };
    if !levels.into_iter().any(|value| one(rest, value) && !one(problem, value)) {
        return false;
    }
    let there = Recalibration::of(rest, &best.u, &rest.predict(&best.members, &best.u)).net();
    let whole = product(problem, &best.change.net, &best.change.net);
    product(rest, &there, &there) < problem.constants.informed_share * whole
}

/// Rounds of a refit without a region.
const ROUNDS: usize = 6;

/// Squared changes by each of two effects beside the other, in deviations of a pass; of a single effect
/// nothing: what it does is the gap.
fn own_changes(problem: &Problem, best: &Posterior) -> Vec<Vec<f64>> {
    if best.members.len() < 2 {
        return Vec::new();
    }
    (0..best.members.len())
        .map(|i| {
            let beside = without_member(problem, &best.members, &best.u, i);
            let change = best.prediction.iter().zip(beside.iter()).zip(&problem.variance);
            change.map(|((with, without), v)| (with - without).powi(2) / v).collect()
        })
        .collect()
}

/// Predicts each region from the rest, by the hypothesis' form alone.
pub fn left_out_regions(fitted: &Fitted, best: &Posterior) -> Vec<LeftOutRegion> {
    let problem = &fitted.problem;
    let k = &problem.constants;
    let whole = problem.misfit(&fitted.baseline.prediction) - problem.len() as f64;
    let own = own_changes(problem, best);
    regions(problem)
        .into_par_iter()
        .map(|LeftOutPart { name, over, rows }| {
            let others: Vec<_> = (0..problem.len()).filter(|i| rows.binary_search(i).is_err()).collect();
            let shown = own.iter().all(|change| {
                let seen: f64 = others.iter().map(|&i| change[i]).sum();
                seen > k.informed_share * change.iter().sum::<f64>()
            });
            let (rest, out) = (problem.select(&others), problem.select(&rows));
            let hypothesis = if best.freedom.bend > 0.0 {
                left_out_bent(fitted, best, &rest, &out, [&others, &rows])
            } else {
                left_out(&rest, &out, &best.members, &best.u).0
            };
            let (baseline, refit) = left_out(&rest, &out, &[], &fitted.baseline.u);
            let metric = metric(&rest, &out, &refit);
            let n = out.len();
            let mean = |r: &DVector<f64>| metric.quadratic(r) / n.max(1) as f64;
            let errors = Errors { passes: n, recalibrated: mean(&baseline), after: mean(&hypothesis) };
            let gap = rest.misfit(&refit.prediction) - rest.len() as f64;
            let scatter = (2.0 * rest.len() as f64).sqrt();
            let informed = shown && gap > k.carrying_sd * scatter && gap > k.informed_share * whole;
            // A function that may be any says nothing of values that it was not seen at.
            let judges = !tells_nothing(problem, &rest, best) && !best.change.bends_over(over);
            LeftOutRegion { name, errors, informed, judges }
        })
        .collect()
}

/// What the left-out regions say about a hypothesis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegionScore {
    /// Share of the gap closed, pooled over the regions.
    pub pooled: f64,
    /// Regions that carry gap.
    pub carrying: usize,
    /// Those of them closed by more than half.
    pub closed: usize,
}

impl RegionScore {
    /// Share of a candidate's probability that survives: one half where it closes just so much as a mimic
    /// may, and ever less below that.
    ///
    /// A single cause may close the less, the further its evidence leads the open set's, by `lead` nats: what
    /// imitates a cause outside of the library leads by little. Two causes imitate nearly anything, and what
    /// they lead by says nothing.
    pub fn survival(&self, k: &Constants, effects: usize, lead: f64) -> f64 {
        let two = usize::from(effects > 1);
        let open = |closure: f64| 1.0 - closure.min(1.0) + k.closure_rest;
        let closed = (open(k.closure[two]) / open(self.pooled)).powf(k.closure_power[two]);
        let odds = if two == 0 { closed * (1.0 + lead.max(0.0)) } else { closed };
        let pooled = odds / (1.0 + odds);
        let half_open = 2 * self.closed < self.carrying && self.carrying >= k.few_regions;
        if half_open { pooled.min(k.half_open_survival) } else { pooled }
    }
}

/// Judges the regions: those count whose gap stands above the floor's own scatter.
///
/// What is left is granted its sampling error, the root of twice the number of passes in units of the floor:
/// a small gap cannot be shown to stay open by noise alone.
pub fn score_of(k: &Constants, regions: &[LeftOutRegion]) -> RegionScore {
    let share = |gap: f64, left: f64| (gap > 0.0).then(|| 1.0 - (left.max(0.0) / gap).sqrt());
    let (mut gap, mut left, mut passes) = (0.0, 0.0, 0.0);
    let (mut carrying, mut closed) = (0, 0);
    for r in regions.iter().filter(|r| r.judges) {
        let e = &r.errors;
        let n = e.passes as f64;
        let scatter = (2.0 * n).sqrt();
        let own_gap = (e.recalibrated - 1.0) * n;
        // A region that stays wholly open is open, however far off the refit ran: it must not outweigh all others.
        let own_left = ((e.after - 1.0) * n).min(own_gap.max(0.0));
        let weight = if r.informed { 1.0 } else { k.uninformed_weight };
        gap += weight * own_gap;
        left += weight * own_left;
        passes += weight * n;
        if own_gap > k.carrying_sd * scatter {
            carrying += 1;
            if share(own_gap, own_left - k.region_allowance_sd * scatter).is_some_and(|c| c > k.region_closed)
            {
                closed += 1;
            }
        }
    }
    let pooled = share(gap, left - k.pooled_allowance_sd * (2.0 * passes).sqrt()).unwrap_or(1.0);
    RegionScore { pooled, carrying, closed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{Deviates, rig, table};

    /// Where true causes of a foreign form and mimics close as much, neither is ruled out; a cause that
    /// closes nothing is, and one that closes nearly all stays.
    #[test]
    fn a_half_survives_where_causes_and_mimics_close_as_much() {
        let k = Constants::default();
        let survives = |pooled: f64, effects, lead| {
            RegionScore { pooled, carrying: 6, closed: 5 }.survival(&k, effects, lead)
        };
        for effects in [1, 2] {
            let [little, part, much] = [0.1, 0.55, 1.0].map(|pooled| survives(pooled, effects, 3.0));
            assert!(little < 0.1 && (0.05..0.95).contains(&part) && much > 0.99, "{little} {part} {much}");
        }
        // What a name needs, as docs/diagnosis/rules.md has it.
        for (pooled, lead) in [(0.75, 10.0), (0.64, 30.0), (0.5, 80.0)] {
            let named = survives(pooled, 1, lead);
            assert!((named - 0.9).abs() < 0.005, "{named} at {lead} nats");
        }
        // Evidence makes up for what a foreign form leaves open; two causes get nothing for it.
        assert!(survives(0.6, 1, 100.0) > 0.9 && survives(0.6, 1, 3.0) < 0.6);
        assert_eq!(survives(0.6, 2, 100.0), survives(0.6, 2, 0.0));
        assert!(RegionScore { pooled: 0.95, carrying: 6, closed: 2 }.survival(&k, 1, 100.0) <= 0.1);
    }

    /// One vibrating pass, predicted from passes with the plate still, which tell nothing of the stiffnesses:
    /// a miss along them counts in deviations of scatter and of the stiffnesses' prior together.
    #[test]
    fn a_miss_that_the_rest_leaves_open_counts_for_little() {
        let table = table(&mut Deviates(3), 0.0);
        let mut rig = rig();
        rig.finger.stiffness_relative_sd = 0.3;
        let mut problem = Problem::new(&table, &rig, &Default::default());
        crate::scatter::noise::settle(&table, &rig, &mut problem, &crate::scatter::Belief::ByResidual);
        let still: Vec<usize> =
            (0..problem.len()).filter(|&i| problem.passes[i].amplitude.metres() == 0.0).collect();
        let nominal = problem.jacobian(&[], &[0.0; 3], &problem.predict(&[], &[0.0; 3]));
        let telling = nominal.column(1).iamax();
        let (rest, out) = (problem.select(&still), problem.select(&[telling]));
        let fit = minimise(&rest, &[], &[0.0; 3], &rest.variance, 6);
        let slope = |p: &Problem| p.jacobian(&[], &fit.u, &p.predict(&[], &fit.u));
        let (seen, left) = (slope(&rest), slope(&out));
        // Plate still: friction is mu0 times load, whatever the stiffnesses.
        assert!(seen.column(1).amax() < 1e-9 && seen.column(2).amax() < 1e-9);
        let mu0: f64 = (0..rest.len()).map(|i| seen[(i, 0)].powi(2) / rest.variance[i]).sum();
        let open = (left[(0, 1)].powi(2) + left[(0, 2)].powi(2) + left[(0, 0)].powi(2) / (1.0 + mu0))
            / out.variance[0];
        assert!(open > 0.5, "{open}");
        let miss = DVector::from_element(1, 2.5 * out.variance[0].sqrt());
        let counted = metric(&rest, &out, &fit).quadratic(&miss);
        assert!((counted - 6.25 / (1.0 + open)).abs() < 1e-9 * counted, "{counted} {open}");
    }
}
