//! Conditions that a next experiment may choose: every setting of a plan, within what the table has shown to be safe.

use crate::data::Table;
use models::{Condition, Direction, FrictionModel, PeakToPeak};

/// Conditions that a design looks at: the product of the levels, evenly thinned to so many.
const MOST: usize = 240;
/// Levels of amplitude above zero, of speed, of load, and of position; frequencies and pressures are the table's own.
const AMPLITUDES: usize = 5;
const SPEEDS: usize = 4;
const LOADS: usize = 3;
const POSITIONS: usize = 3;
const FREQUENCIES: usize = 4;
const PRESSURES: usize = 3;
/// Stroke below which all passes lie at one place, m.
const ONE_PLACE_M: f64 = 1e-3;
/// Passes into a run at which further passes are expected.
const INTO_RUN: f64 = 6.0;

/// The conditions. Time is that of a further run, the environment that of the last pass.
pub fn conditions(table: &Table) -> Vec<Condition> {
    let passes = &table.passes;
    let of = |f: &dyn Fn(&Condition) -> f64| -> Vec<f64> { passes.iter().map(f).collect() };
    let vibrating: Vec<f64> = passes.iter().map(|p| p.amplitude.metres()).filter(|w| *w > 0.0).collect();
    let mut amplitudes = vec![0.0];
    if !vibrating.is_empty() {
        amplitudes.extend(in_ratio(vibrating, AMPLITUDES));
    }
    let mut frequencies = of(&|p| p.frequency_hz);
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-3);
    let pressures = spread(&pressures(passes), PRESSURES);
    let positions = places(of(&|p| p.position_m));
    let amplitudes: Vec<PeakToPeak> = amplitudes.into_iter().map(PeakToPeak::from_metres).collect();
    let list = with_each(&[further(table)], &amplitudes, |c| &mut c.amplitude);
    let list = with_each(&list, &spread(&frequencies, FREQUENCIES), |c| &mut c.frequency_hz);
    let list = with_each(&list, &in_ratio(of(&|p| p.speed_m_s), SPEEDS), |c| &mut c.speed_m_s);
    let list = with_each(&list, &in_ratio(of(&|p| p.normal_force_n), LOADS), |c| &mut c.normal_force_n);
    let list = with_each(&list, &positions, |c| &mut c.position_m);
    let list = with_each(&list, &pressures, |c| &mut c.ambient_pressure_pa);
    let seen = |d: &Direction| passes.iter().any(|p| p.direction == *d);
    let directions = [Direction::Forward, Direction::Backward].into_iter().filter(seen).collect::<Vec<_>>();
    let mut list = with_each(&list, &directions, |c| &mut c.direction);
    let (low, high) = (positions[0], positions[positions.len() - 1]);
    let shown = |p: &Condition| {
        let as_fast = || passes.iter().filter(|q| q.speed_m_s > 0.95 * p.speed_m_s);
        // A fast pass takes a long stroke: at the ends only as fast as passes were made there.
        (p.position_m > low || as_fast().any(|q| q.position_m <= low))
            && (p.position_m < high || as_fast().any(|q| q.position_m >= high))
    };
    if high > low {
        list.retain(shown);
    }
    thinned(&list)
}

/// Pressures of the passes, at least 2 % apart: what a gauge reads of one pressure scatters.
fn pressures(passes: &[Condition]) -> Vec<Option<f64>> {
    let mut list: Vec<Option<f64>> = passes.iter().map(|p| p.ambient_pressure_pa).collect();
    list.sort_by(|a, b| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    list.dedup_by(|a, b| a.is_some() == b.is_some() && a.zip(*b).is_none_or(|(a, b)| a <= 1.02 * b));
    list
}

/// Every condition with each of these values of one setting.
fn with_each<T: Copy>(
    list: &[Condition],
    values: &[T],
    setting: fn(&mut Condition) -> &mut T,
) -> Vec<Condition> {
    let with = |condition: &Condition, value: &T| {
        let mut condition = *condition;
        *setting(&mut condition) = *value;
        condition
    };
    list.iter().flat_map(|c| values.iter().map(move |v| with(c, v))).collect()
}

/// Change of the lateral force from the reference without vibration, `(1 - mu') mu_0 F_n` (Eq. 5), in N; of
/// a condition without vibration the friction itself. None outside the model's domain.
pub fn expected_change_n(wanted: &Condition, model: &dyn FrictionModel, mu0: f64) -> Option<f64> {
    let coulomb_n = mu0 * wanted.normal_force_n;
    if wanted.amplitude == PeakToPeak::ZERO {
        return Some(coulomb_n);
    }
    let prediction = model.predict(&Condition { mu0, ..*wanted }).ok()?;
    Some((1.0 - prediction.mu_relative).abs() * coulomb_n)
}

/// Evenly in the logarithm from the smallest to the largest.
fn in_ratio(mut values: Vec<f64>, count: usize) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let (low, high) = (values[0], values[values.len() - 1]);
    if high <= low * 1.05 {
        return vec![0.5 * (low + high)];
    }
    (0..count).map(|i| low * (high / low).powf(i as f64 / (count - 1) as f64)).collect()
}

/// Across the stretch that was used, less a tenth of the passes at each end; one place where there is but one.
fn places(mut values: Vec<f64>) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let (low, high) = (values[0], values[values.len() - 1]);
    if high - low < ONE_PLACE_M {
        return vec![values[values.len() / 2]];
    }
    let share = |i: usize| 0.1 + 0.8 * i as f64 / (POSITIONS - 1) as f64;
    (0..POSITIONS).map(|i| values[((values.len() - 1) as f64 * share(i)).round() as usize]).collect()
}

/// At most so many of a sorted list, both ends among them.
fn spread<T: Copy>(sorted: &[T], most: usize) -> Vec<T> {
    if sorted.len() <= most {
        return sorted.to_vec();
    }
    (0..most).map(|i| sorted[i * (sorted.len() - 1) / (most - 1)]).collect()
}

/// Steps through the product by a share that is far from every fraction, so that every pair of levels stays in.
fn thinned(list: &[Condition]) -> Vec<Condition> {
    if list.len() <= MOST {
        return list.to_vec();
    }
    let golden = 0.5 * (5f64.sqrt() - 1.0);
    let mut rows: Vec<usize> =
        (0..MOST).map(|k| ((k as f64 * golden).fract() * list.len() as f64) as usize).collect();
    rows.sort_unstable();
    rows.dedup();
    rows.into_iter().map(|i| list[i]).collect()
}

/// A pass some way into a further run. Where the runs of a table follow each other in time the run comes
/// last, else each run counts its own time.
fn further(table: &Table) -> Condition {
    let passes = &table.passes;
    let last = *passes.last().expect("a table has passes");
    let pace = passes.iter().map(Condition::time_in_run_s).fold(0.0, f64::max) * table.run_count as f64
        / passes.len() as f64;
    let follow = table.run_count > 1 && table.runs.windows(2).all(|w| w[1] >= w[0]);
    let into = INTO_RUN * pace;
    Condition { run_time_s: Some(into), time_s: if follow { last.time_s + into } else { into }, ..last }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_pressure_that_a_gauge_reads_twice_is_one() {
        let at = |pressure| Condition { ambient_pressure_pa: pressure, ..Condition::paper() };
        let passes = [50_005.13, 101_320.0, 50_005.97, 101_325.0].map(|p| at(Some(p)));
        assert_eq!(pressures(&passes), [Some(50_005.13), Some(101_320.0)]);
        assert_eq!(pressures(&[at(None), at(None)]), [None]);
    }
}
