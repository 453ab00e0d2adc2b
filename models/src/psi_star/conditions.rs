//! The passes of each condition, and their mean.

use super::PSI_RANGE;
use crate::condition::Condition;
use crate::psi::PsiEq17;
use crate::quantity::PeakToPeak;
use std::collections::BTreeMap;

/// Amplitude, frequency, speed, load and pressure within these factors are one setting: repeats scatter by
/// less, and steps of a plan are larger.
const SAME_SETTING: [f64; 5] = [1.05, 1.05, 1.05, 1.2, 1.05];
/// The mean of passes under one condition.
pub(super) struct Mean {
    pub(super) condition: Condition,
    pub(super) force_n: f64,
    pub(super) repeats: f64,
}

impl Mean {
    pub(super) fn of(passes: &[(Condition, f64)]) -> Self {
        let repeats = passes.len() as f64;
        let of =
            |value: &dyn Fn(&Condition) -> f64| passes.iter().map(|(c, _)| value(c)).sum::<f64>() / repeats;
        let condition = Condition {
            amplitude: PeakToPeak::from_metres(of(&|c| c.amplitude.metres())),
            frequency_hz: of(&|c| c.frequency_hz),
            speed_m_s: of(&|c| c.speed_m_s),
            normal_force_n: of(&|c| c.normal_force_n),
            ..passes[0].0
        };
        Mean { condition, force_n: passes.iter().map(|(_, force)| force).sum::<f64>() / repeats, repeats }
    }
}

/// The passes of each condition together: both directions and all places, since Psi has neither.
pub(super) fn by_condition(passes: Vec<(Condition, f64)>) -> Vec<Vec<(Condition, f64)>> {
    let settings: [fn(&Condition) -> f64; 5] = [
        |c| c.amplitude.metres(),
        |c| c.frequency_hz,
        |c| c.speed_m_s,
        |c| c.normal_force_n,
        |c| c.ambient_pressure_pa.unwrap_or(0.0),
    ];
    let levels: [Vec<u32>; 5] = std::array::from_fn(|k| {
        levels(&passes.iter().map(|(c, _)| settings[k](c)).collect::<Vec<_>>(), SAME_SETTING[k])
    });
    let mut together = BTreeMap::<[u32; 5], Vec<(Condition, f64)>>::new();
    for (row, pass) in passes.into_iter().enumerate() {
        together.entry(levels.each_ref().map(|levels| levels[row])).or_default().push(pass);
    }
    together.into_values().collect()
}

/// Number of each value's level: a level holds what is within a factor of its least.
fn levels(values: &[f64], same: f64) -> Vec<u32> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|a, b| values[*a].total_cmp(&values[*b]));
    let (mut level, mut least, mut of) = (0, f64::NEG_INFINITY, vec![0; values.len()]);
    for row in order {
        if values[row] > least.max(0.0) * same {
            (level, least) = (level + 1, values[row]);
        }
        of[row] = level;
    }
    of
}

/// The number of passes needed, and the interval that holds nine of ten `Psi*`, each by itself. Infinite if
/// there is no friction below that without vibration.
pub(super) fn single_passes<'a>(
    passes: impl Iterator<Item = &'a (Condition, f64)>,
    mu0: f64,
    poisson_ratio: f64,
) -> Option<(u32, f64, Option<f64>)> {
    let by_hand = |(c, force_n): &(Condition, f64)| {
        let psi = PsiEq17::at(&Condition { mu0, ..*c }, poisson_ratio).0;
        if !(PSI_RANGE[0]..=PSI_RANGE[1]).contains(&psi) {
            return None;
        }
        let left = 1.0 - force_n / (mu0 * c.normal_force_n);
        Some(if left <= 0.0 { f64::INFINITY } else { (-psi / left.ln()).max(0.0) })
    };
    let mut each: Vec<f64> = passes.filter_map(by_hand).collect();
    each.sort_by(f64::total_cmp);
    let beyond = each.len() / 20;
    let high = *each.get(each.len().checked_sub(1 + beyond)?)?;
    let count = u32::try_from(each.len()).unwrap_or(u32::MAX);
    Some((count, each[beyond], Some(high).filter(|high| high.is_finite())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_holds_what_is_near_its_least() {
        assert_eq!(levels(&[2.0, 1.0, 1.05, 1.2, 0.0, 2.1, 0.0], 1.1), [3, 1, 1, 2, 0, 3, 0]);
    }
}
