//! Global starts: a scan of each law, then fits of the best few. docs/diagnosis/model.md, section 7.

use crate::regression::{Covariance, Fit, Member, NUISANCES, Problem, minimise, weighted};
use effects::{Parameter, Prior};
use nalgebra::{DMatrix, DVector};

/// Rows that the scan looks at.
const SCAN_ROWS: usize = 128;
/// The same beside another cause, where a scan only orders pairs.
const PAIR_SCAN_ROWS: usize = 64;
/// The same where a wavelength is sought: what a stroke shows of a short wave needs many places.
const WAVE_SCAN_ROWS: usize = 512;
/// Rows on which a start is refined: a place from these lies within a few deviations of the whole table's,
/// and the search under form uncertainty goes on from there.
pub(crate) const REFINED_ROWS: usize = 1024;
/// Starts that are fitted on the scan's rows, and those of them refined on all.
const STARTS: (usize, usize) = (4, 2);
/// Rounds of a local fit on the scan's rows before the starts are compared, and after, and on all rows: the
/// search under form uncertainty goes on from there.
const ROUNDS: (usize, usize, usize) = (4, 8, 4);

/// Factor on the best cost and offset beyond which a start is given up, after the first rounds and after the next.
const BEHIND: (f64, f64) = (2.0, 30.0);
const FAR_BEHIND: (f64, f64) = (1.3, 10.0);
/// Starts differ by so much in the coordinate of the size, or of a shape.
const OTHER: (f64, f64) = (0.8, 0.5);
/// Difference in every coordinate within which two fits are at one place, in deviations of the prior.
const SAME_PLACE: f64 = 0.1;
/// Longest linear step of a fixed coordinate while the scan walks.
const LONGEST_STEP: f64 = 2.0;
/// Golden section: its multiples come round nowhere.
const GOLDEN: f64 = 0.618_033_988_749_894_9;
/// Half periods over a stroke by which two wavelengths differ.
const WAVE_STEP: f64 = 0.4;

/// Sizes and shapes at which a law is tried.
fn grid(parameters: &[Parameter], stroke: f64) -> Vec<Vec<f64>> {
    let mut list: Vec<Vec<f64>> = vec![Vec::new()];
    let fine = parameters.iter().any(is_wavelength);
    for (index, p) in parameters.iter().enumerate() {
        let (low, high) = p.coordinate_bounds();
        let values: Vec<f64> = match p.prior {
            // A share has its middle at an end: the other side may have a mode of its own.
            Prior::HalfNormal(_) if p.bends => vec![0.0, 1.0],
            _ if p.bends => vec![0.0],
            Prior::HalfNormal(_) if fine => vec![0.4, 1.5],
            Prior::HalfNormal(_) => vec![0.04, 0.12, 0.35, 0.9, 2.0, 4.5],
            // Further signed parameters enter smoothly: the local fit finds them from zero.
            Prior::Normal(_) if index > 0 => vec![0.0],
            Prior::Normal(_) => vec![-3.0, -1.2, -0.4, -0.1, 0.1, 0.4, 1.2, 3.0],
            // A third parameter bends the curve: the local fit finds it from either side.
            Prior::LogNormal(..) if index > 1 => vec![-1.0, 1.0],
            Prior::LogNormal(..) => vec![-2.0, -1.0, 0.0, 1.0, 2.0],
            Prior::Uniform(a, b) if is_wavelength(p) => {
                // Two wavelengths differ on a stroke if they differ by half a period over it.
                let step = WAVE_STEP / stroke.max(1e-4);
                let count = (((1.0 / a - 1.0 / b) / step).ceil() as usize).clamp(4, 240);
                let waves = |i: usize| 1.0 / b + (1.0 / a - 1.0 / b) * i as f64 / count as f64;
                (0..=count).map(|i| p.coordinate(1.0 / waves(i))).collect()
            }
            // A phase is cyclic over the unit interval inside its bounds.
            Prior::Uniform(..) if fine => [0.0, 0.2, 0.4, 0.6, 0.8].map(|x| p.coordinate(x)).to_vec(),
            Prior::Uniform(..) => vec![-2.4, -1.2, 0.0, 1.2, 2.4],
        };
        let values: Vec<f64> = values.into_iter().filter(|v| *v >= low && *v <= high).collect();
        list =
            list.iter().flat_map(|head| values.iter().map(|v| [head.as_slice(), &[*v]].concat())).collect();
    }
    list
}

fn is_wavelength(p: &Parameter) -> bool {
    p.unit == "m" && matches!(p.prior, Prior::Uniform(..))
}

/// A law's best places after the first rounds of their fits, on the rows that were looked at; best first.
pub struct Sought {
    rows: Vec<usize>,
    fits: Vec<Fit>,
    of: usize,
}

/// Seeks a law alone beside given coordinates of the baseline: a scan, and the first rounds from its best places.
pub fn seek(problem: &Problem, member: Member, nuisances: &[f64], variance: &[f64]) -> Sought {
    let hunt = Hunt { problem, members: &[member], variance };
    let (rows, scored) = hunt.scanned(nuisances);
    let fits = hunt.begun(nuisances.len(), &rows, &scored, STARTS.0);
    Sought { rows, fits, of: problem.len() }
}

impl Sought {
    /// The best cost so far, as if all of the table had been looked at.
    pub fn cost(&self) -> f64 {
        self.fits.first().map_or(f64::INFINITY, |f| f.cost * self.of as f64 / self.rows.len().max(1) as f64)
    }

    /// Local optima on all rows, or on as many as a start is refined on, best first.
    pub fn finished(self, problem: &Problem, member: Member, variance: &[f64]) -> Vec<Fit> {
        Hunt { problem, members: &[member], variance }.finished(&self.rows, self.fits, STARTS.1)
    }

    /// The best place as it is, of a law that is far behind.
    pub fn as_it_is(self, problem: &Problem, member: Member, variance: &[f64]) -> Vec<Fit> {
        let best = self.fits.get(..1).unwrap_or_default();
        Hunt { problem, members: &[member], variance }.refined(best, 0)
    }
}

/// A cost as if all of the table had been looked at: laws are scanned on different numbers of rows.
fn of_all(cost: f64, problem: &Problem, rows: &[usize]) -> f64 {
    cost * problem.len() as f64 / rows.len().max(1) as f64
}

/// At most so many rows, one from each of as many even blocks, at a place in it that steps by the golden
/// section: a table whose conditions come round every so many passes is not met at one condition only.
fn rows(n: usize, limit: usize) -> Vec<usize> {
    if n <= limit {
        return (0..n).collect();
    }
    let row = |block: usize| {
        let (start, end) = (block * n / limit, (block + 1) * n / limit);
        let place = (block as f64 * GOLDEN).fract();
        start + (place * (end - start) as f64) as usize
    };
    (0..limit).map(row).collect()
}

/// A law, alone or beside others, on a problem with these variances.
#[derive(Clone, Copy)]
pub(crate) struct Hunt<'a> {
    pub problem: &'a Problem,
    pub members: &'a [Member],
    pub variance: &'a [f64],
}

impl Hunt<'_> {
    /// Best cost of a coarse scan of the last member about coordinates that it had alone, with the place.
    pub fn coarse_scan(&self, fixed: &[f64], alone: &[f64]) -> Option<(f64, Vec<f64>)> {
        let last = self.members.last()?;
        let (low, high) = last.parameters(&self.problem.design)[0].coordinate_bounds();
        let mut list = vec![alone.to_vec()];
        let reach = if alone[0].abs() > 0.05 { alone[0] } else { 0.3 };
        let own = [0.15, 0.4, 1.0, 2.0, -0.4, -1.0].map(|factor| reach * factor);
        // What it did alone says little of a large size beside another cause.
        for size in own.into_iter().chain([-3.0, -1.2, 1.2, 3.0]) {
            let mut tail = alone.to_vec();
            tail[0] = size.clamp(low, high);
            list.push(tail);
        }
        let rows = rows(self.problem.len(), PAIR_SCAN_ROWS);
        let (cost, u) = self.scan(fixed, &rows, list).into_iter().next()?;
        Some((of_all(cost, self.problem, &rows), u))
    }

    /// Best cost of the whole scan of the last member beside the coordinates of the others, with the place.
    pub fn full_scan(&self, fixed: &[f64]) -> Option<(f64, Vec<f64>)> {
        let (rows, scored) = self.scanned(fixed);
        let (cost, u) = scored.into_iter().next()?;
        Some((of_all(cost, self.problem, &rows), u))
    }

    /// Local fit of a pair from one start.
    pub fn refine_from(&self, start: Vec<f64>) -> Option<Fit> {
        let rows = rows(self.problem.len(), SCAN_ROWS);
        let fixed = start.len() - self.members.last()?.count();
        let fits = self.begun(fixed, &rows, &[(0.0, start)], 1);
        self.finished(&rows, fits, 1).into_iter().next()
    }

    fn part(&self, rows: &[usize]) -> (Problem, Vec<f64>) {
        let sketch = Problem { rough: true, ..self.problem.select(rows) };
        (sketch, rows.iter().map(|&i| self.variance[i]).collect())
    }

    /// The whole grid of the last member, on the rows that show it: those rows, and every place with its
    /// cost, best first.
    fn scanned(&self, fixed: &[f64]) -> (Vec<usize>, Vec<(f64, Vec<f64>)>) {
        let Hunt { problem, members, .. } = self;
        let parameters = members.last().map_or_else(Vec::new, |m| m.parameters(&problem.design));
        let fine = parameters.iter().any(is_wavelength);
        let some = if members.len() > 1 { PAIR_SCAN_ROWS } else { SCAN_ROWS };
        let rows = rows(problem.len(), if fine { WAVE_SCAN_ROWS } else { some });
        let scored = self.scan(fixed, &rows, grid(&parameters, problem.design.stroke_m));
        (rows, scored)
    }

    /// Every place of a grid of the last member with its cost, best first.
    fn scan(&self, fixed: &[f64], rows: &[usize], grid: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
        let members = self.members;
        let (part, part_variance) = self.part(rows);
        // Nuisances (and the other members) follow linearly while the scan walks.
        let others = &members[..members.len() - 1];
        let origin = part.predict(others, fixed);
        let jacobian = part.jacobian(others, fixed, &origin);
        let plain = Covariance::new(&part_variance, &DMatrix::zeros(rows.len(), 0));
        let mut hessian = plain.inner(&jacobian, &jacobian);
        let precision = self.problem.prior_precision(others);
        precision.iter().enumerate().for_each(|(k, p)| hessian[(k, k)] += p.max(1e-9));
        // What the others cost where they are: nuisances that were driven far from their calibration are no bargain.
        let pull = DVector::from_iterator(fixed.len(), fixed.iter().zip(&precision).map(|(x, p)| p * x));
        let penalty = pull.dot(&DVector::from_column_slice(fixed));
        let Some(factor) = hessian.cholesky() else { return Vec::new() };
        let project = weighted(&jacobian, &part_variance);
        let y = DVector::from_column_slice(&part.lateral);
        let mut scored: Vec<(f64, Vec<f64>)> = grid
            .into_iter()
            .map(|tail| {
                let mut u = [fixed, &tail].concat();
                let residual = &y - part.predict(members, &u);
                let score = &project * &residual - &pull;
                let step = factor.solve(&score);
                let misfit: f64 = residual.iter().zip(&part_variance).map(|(r, v)| r * r / v).sum();
                let cost = misfit + penalty - score.dot(&step);
                step.iter().enumerate().for_each(|(k, s)| u[k] += s.clamp(-LONGEST_STEP, LONGEST_STEP));
                (cost, u)
            })
            .collect();
        scored.sort_by(|a, b| a.0.total_cmp(&b.0));
        scored
    }

    /// The first rounds from the best places of a scan that differ.
    fn begun(&self, fixed: usize, rows: &[usize], scored: &[(f64, Vec<f64>)], count: usize) -> Vec<Fit> {
        let (part, part_variance) = self.part(rows);
        // Starts that differ: in the size's sign, or by more than one step of any shape.
        let mut starts: Vec<&Vec<f64>> = Vec::new();
        for (_, u) in scored {
            let fresh = starts.iter().all(|s| {
                (fixed..u.len()).any(|k| (u[k] - s[k]).abs() > if k == fixed { OTHER.0 } else { OTHER.1 })
            });
            if fresh {
                starts.push(u);
            }
            if starts.len() == count {
                break;
            }
        }
        let mut fits: Vec<Fit> =
            starts.into_iter().map(|u| minimise(&part, self.members, u, &part_variance, ROUNDS.0)).collect();
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        fits
    }

    /// The further rounds of those that may still win, and the last ones on all rows.
    fn finished(&self, rows: &[usize], mut fits: Vec<Fit>, count: usize) -> Vec<Fit> {
        let (part, part_variance) = self.part(rows);
        // What is far behind by now does not catch up.
        let ahead = fits.first().map_or(0.0, |f| f.cost);
        fits.retain(|f| f.cost < BEHIND.0 * ahead + BEHIND.1);
        distinct(&mut fits);
        fits.truncate(count + 1);
        fits.iter_mut().for_each(|f| *f = minimise(&part, self.members, &f.u, &part_variance, ROUNDS.1));
        fits.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let best = fits.first().map_or(0.0, |f| f.cost);
        fits.retain(|f| f.cost < FAR_BEHIND.0 * best + FAR_BEHIND.1);
        distinct(&mut fits);
        fits.truncate(count);
        let mut whole = self.refined(&fits, ROUNDS.2);
        whole.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        whole
    }

    /// Fits continued on the whole table, or on so many rows of a large one, their costs as of all of it.
    fn refined(&self, fits: &[Fit], rounds: usize) -> Vec<Fit> {
        let many = rows(self.problem.len(), REFINED_ROWS);
        let part = self.problem.select(&many);
        let part_variance: Vec<f64> = many.iter().map(|&i| self.variance[i]).collect();
        let on = |f: &Fit| {
            let fit = minimise(&part, self.members, &f.u, &part_variance, rounds);
            Fit { cost: of_all(fit.cost, self.problem, &many), ..fit }
        };
        fits.iter().map(on).collect()
    }
}

/// Leaves one fit, the best, of those that converged to the same place.
fn distinct(fits: &mut Vec<Fit>) {
    let mut unique: Vec<Fit> = Vec::with_capacity(fits.len());
    for fit in fits.drain(..) {
        let same = |k: &Fit| k.u.iter().zip(&fit.u).all(|(a, b)| (a - b).abs() < SAME_PLACE);
        if !unique.iter().any(same) {
            unique.push(fit);
        }
    }
    *fits = unique;
}

/// Variances with a floor of `share` of a residual gap: starts are sought on what the gap looks like at
/// large, not on its last per cent.
pub fn tempered(problem: &Problem, gap: &DVector<f64>, share: f64) -> Vec<f64> {
    problem.variance.iter().zip(gap.iter()).map(|(v, g)| v + (share * g).powi(2)).collect()
}

/// Where nuisances start: where they are, and at their calibration if they have been driven far from it to
/// imitate a cause, from where no local fit comes back.
pub fn nuisance_starts(u: &[f64], driven_sd: f64) -> Vec<Vec<f64>> {
    let mut list = vec![u.to_vec()];
    if u[..NUISANCES].iter().any(|x| x.abs() > driven_sd) {
        let mut calibrated = u.to_vec();
        calibrated[..NUISANCES].fill(0.0);
        list.push(calibrated);
    }
    list
}

#[cfg(test)]
mod tests {
    use super::rows;
    use std::collections::BTreeSet;

    /// Conditions that come round every so many passes are all met, whatever the round; each row once, in order.
    #[test]
    fn a_round_of_conditions_is_met_as_a_whole() {
        for n in [1280, 10_000, 50_000] {
            for round in [2, 5, 8, 10, 16] {
                let chosen = rows(n, 128);
                assert_eq!(chosen.len(), 128);
                assert!(chosen.windows(2).all(|w| w[0] < w[1]) && chosen[127] < n);
                let met: BTreeSet<usize> = chosen.iter().map(|i| i % round).collect();
                assert_eq!(met.len(), round, "{n} passes in rounds of {round}");
            }
        }
        assert_eq!(rows(5, 128), [0, 1, 2, 3, 4]);
    }
}
