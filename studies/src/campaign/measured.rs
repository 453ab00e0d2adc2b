//! What a campaign's sessions measured, and effects of one factor in them.
//!
//! A session is the unit of evidence: passes of one session share its tip, its day and its mu_0. An effect is
//! computed in each session by itself, as a difference between the ends of a factor's range at otherwise
//! equal settings, and its interval is Student's over sessions; of what differs between cells, over cells.

use models::covariate::{self, Covariate};
use models::pass::coulomb_coefficient;
use models::prediction::Regime;
use models::{Condition, Finger, PeakToPeak};
use runs::MeasuredPass;
use runs::campaign::CampaignRun;
use runs::fingertip::FingertipKind;
use runs::report::levels::Levels;
use runs::report::plots::ends;
use statrs::distribution::{ContinuousCDF, StudentsT};
use std::collections::BTreeMap;

/// Settings that a pass has; all but one are equal where an effect is looked for.
pub const FACTORS: [&Covariate; 5] = [
    &covariate::AMPLITUDE,
    &covariate::FREQUENCY,
    &covariate::SPEED,
    &covariate::NORMAL_FORCE,
    &covariate::AMBIENT_PRESSURE,
];
/// Values within this share of the least of a level belong to it.
const LEVEL: f64 = 0.1;

/// A pass with vibration.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// Its condition, with its session's `mu_0`.
    pub condition: Condition,
    /// Relative friction, over the session's `mu_0`.
    pub mu: f64,
    /// Whether the model expects intermittent contact.
    pub intermittent: bool,
}

/// What one complete session measured.
pub struct Measured {
    /// The session.
    pub session: CampaignRun,
    /// Kind of its tip.
    pub kind: FingertipKind,
    /// Its finger, as `rig.toml` has it.
    pub finger: Finger,
    /// Coulomb friction coefficient of its passes without vibration; `None` without any.
    pub mu0: Option<f64>,
    /// Its passes with vibration; none without a `mu_0`.
    pub driven: Vec<Driven>,
}

impl Measured {
    /// The passes of a session.
    pub fn new(session: CampaignRun, kind: FingertipKind, finger: Finger, passes: &[MeasuredPass]) -> Self {
        let mu0 = coulomb_coefficient(passes.iter().map(|p| &p.pass)).filter(|mu0| *mu0 > 0.0);
        let driven = |p: &MeasuredPass| {
            let (mu0, friction) = (mu0?, p.pass.friction_force_n()?);
            (p.pass.amplitude > PeakToPeak::ZERO && p.pass.normal_force_n > 0.0).then(|| Driven {
                condition: p.pass.condition(mu0),
                mu: friction / (mu0 * p.pass.normal_force_n),
                intermittent: p.regime == Some(Regime::Intermittent),
            })
        };
        let driven = passes.iter().filter_map(driven).collect();
        Measured { session, kind, finger, mu0, driven }
    }

    /// Mean relative friction of its passes with vibration.
    pub fn mean_mu(&self) -> Option<f64> {
        mean(self.driven.iter().map(|d| d.mu))
    }
}

/// Mean of some values; `None` of none.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<f64> {
    let (n, sum) = values.fold((0.0, 0.0), |(n, s), v| (n + 1.0, s + v));
    (n > 0.0).then(|| sum / n)
}

/// Mean of some values, its variance, and their number; `None` of fewer than two.
fn mean_and_variance(values: &[f64]) -> Option<(f64, f64, f64)> {
    let (m, n) = (mean(values.iter().copied())?, values.len() as f64);
    (n > 1.0).then(|| (m, values.iter().map(|v| (v - m).powi(2)).sum::<f64>() / (n - 1.0) / n, n))
}

/// A change of relative friction with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MeasuredChange {
    /// Change of mu'.
    pub change: f64,
    /// Its 95 % interval.
    pub ci95: [f64; 2],
    /// Sessions that it rests on; cells where it is of what differs between cells.
    pub sessions: usize,
}

impl MeasuredChange {
    /// A value with its standard error on so many degrees of freedom, and a standard uncertainty that all
    /// sessions share.
    pub fn new(change: f64, error: f64, freedom: f64, shared: f64, sessions: usize) -> Option<Self> {
        let t = StudentsT::new(0.0, 1.0, freedom).ok()?.inverse_cdf(0.975);
        let half = (t * error).hypot(1.96 * shared);
        Some(MeasuredChange { change, ci95: [change - half, change + half], sessions })
    }

    /// The mean of one value a session; `None` with fewer than two.
    pub fn mean_of(values: &[f64], shared: f64) -> Option<Self> {
        let (m, variance, n) = mean_and_variance(values)?;
        MeasuredChange::new(m, variance.sqrt(), n - 1.0, shared, values.len())
    }

    /// Difference of the means of two groups of cells, Welch's; beside each its cells' least variance.
    pub fn between((a, least_a): (Vec<[f64; 1]>, f64), (b, least_b): (Vec<[f64; 1]>, f64)) -> Option<Self> {
        let (a, b) = (a.as_flattened(), b.as_flattened());
        let ((ma, va, na), (mb, vb, nb)) = (mean_and_variance(a)?, mean_and_variance(b)?);
        let (va, vb) = (va.max(least_a / na), vb.max(least_b / nb));
        let freedom =
            (va + vb).powi(2) / (va * va / (na - 1.0) + vb * vb / (nb - 1.0)).max(f64::MIN_POSITIVE);
        MeasuredChange::new(ma - mb, (va + vb).sqrt(), freedom.clamp(1.0, 1e6), 0.0, a.len() + b.len())
    }

    /// Change over the range of `x` by a straight line through one point a cell, others of its covariates
    /// held; a point has the variance `least` at least. `None` with too few cells, or where `x` and another
    /// change together.
    pub fn slope(x: &[f64], y: &[f64], other: Option<&[f64]>, least: f64) -> Option<Self> {
        let one: Vec<f64> = vec![1.0; x.len()];
        let centred = |v: &[f64]| without(v, &one);
        let (mut x0, mut y0) = (centred(x), centred(y));
        let before = dot(&x0, &x0);
        if let Some(other) = other.map(centred) {
            (x0, y0) = (without(&x0, &other), without(&y0, &other));
        }
        let (xx, n) = (dot(&x0, &x0), x.len());
        let freedom = n as f64 - 2.0 - f64::from(u8::from(other.is_some()));
        if freedom < 1.0 || xx < 0.2 * before || before <= 0.0 {
            return None;
        }
        let slope = dot(&x0, &y0) / xx;
        let left = x0.iter().zip(&y0).map(|(x, y)| (y - slope * x).powi(2)).sum::<f64>();
        let [low, high] = ends(x);
        let range = high - low;
        MeasuredChange::new(slope * range, range * ((left / freedom).max(least) / xx).sqrt(), freedom, 0.0, n)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// What is left of `v` beside its part along `along`.
fn without(v: &[f64], along: &[f64]) -> Vec<f64> {
    let share = dot(v, along) / dot(along, along).max(f64::MIN_POSITIVE);
    v.iter().zip(along).map(|(v, a)| v - share * a).collect()
}

/// Passes at equal settings of all other factors, by those settings and the level of this one.
pub fn groups(factor: &Covariate, driven: &[Driven]) -> BTreeMap<Vec<usize>, BTreeMap<usize, Vec<Driven>>> {
    let levels = |f: &&Covariate| Levels::of(driven.iter().filter_map(|d| f.of(&d.condition)), LEVEL);
    let all: Vec<Levels> = FACTORS.iter().map(levels).collect();
    let mut groups = BTreeMap::<Vec<usize>, BTreeMap<usize, Vec<Driven>>>::new();
    for pass in driven {
        let place = |i: usize| FACTORS[i].of(&pass.condition).map_or(0, |v| all[i].index(v));
        let own = FACTORS.iter().position(|f| f.name == factor.name).unwrap_or(0);
        let others = (0..FACTORS.len()).filter(|i| *i != own).map(place).collect();
        if factor.of(&pass.condition).is_some() {
            groups.entry(others).or_default().entry(place(own)).or_default().push(*pass);
        }
    }
    groups
}

/// Change of mu' from the lowest to the highest level of a factor in a session, at equal settings of the
/// others, and those levels; only settings over nearly the widest range count. `None` where nothing varies
/// it.
pub fn contrast(factor: &Covariate, driven: &[Driven]) -> Option<(f64, [f64; 2])> {
    let of_group = |levels: &BTreeMap<usize, Vec<Driven>>| {
        let (first, last) = (levels.first_key_value()?, levels.last_key_value()?);
        let value = |passes: &[Driven]| mean(passes.iter().filter_map(|d| factor.of(&d.condition)));
        let mu = |passes: &[Driven]| mean(passes.iter().map(|d| d.mu));
        (first.0 < last.0).then_some(())?;
        Some((mu(last.1)? - mu(first.1)?, [value(first.1)?, value(last.1)?]))
    };
    let all: Vec<(f64, [f64; 2])> = groups(factor, driven).values().filter_map(of_group).collect();
    let range = |[low, high]: [f64; 2]| (high / low).ln();
    let widest = all.iter().map(|(_, ends)| range(*ends)).reduce(f64::max)?;
    let wide: Vec<_> = all.into_iter().filter(|(_, ends)| range(*ends) > 0.9 * widest).collect();
    let change = mean(wide.iter().map(|(change, _)| *change))?;
    let end = |i: usize| mean(wide.iter().map(|(_, ends)| ends[i]));
    Some((change, [end(0)?, end(1)?]))
}
