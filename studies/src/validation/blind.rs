//! The diagnosis scored blind on sealed sets of the independent simulation.
//!
//! The diagnoser gets the table, rig.toml and the hidden conditions of a set; label and truth are opened only
//! by [`score`], after the verdict stands. Every figure comes with its number of sets and an interval.

pub mod distance;
pub mod reliability;
pub mod rough;

use diagnosis::constants::Constants;
use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Verdict, diagnose};
use miette::IntoDiagnostic;
use models::{Condition, covariate};
use reliability::{StatedChance, identifiable};
use serde::{Deserialize, Serialize};
use sim::sealed::{Ask, DETECTABLE, PAIR_LEAVES, Set, Stratum, generate};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Which sets are made and how they are diagnosed: options of the command line, and settings of cases.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, clap::Args)]
#[serde(default, deny_unknown_fields)]
pub struct BlindStudy {
    /// Seed of the first set
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// One stratum only: none, single, pair, alias or outside; all in their shares without it
    #[arg(long, value_parser = stratum_of)]
    pub stratum: Option<Stratum>,
    /// Try single effects only
    #[arg(long)]
    pub no_pairs: bool,
    /// Leave an effect out of the library (may be repeated)
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
    /// Set a constant of the diagnosis for this study (may be repeated); docs/diagnosis/constants.md lists them.
    #[arg(long, value_name = "NAME=VALUE", hide = true)]
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub constant: Vec<String>,
}

impl BlindStudy {
    /// How the sets are diagnosed.
    ///
    /// # Errors
    /// A constant that there is not.
    pub fn options(&self) -> miette::Result<Options> {
        let mut constants = Constants::default();
        for setting in &self.constant {
            let (name, value) = setting
                .split_once('=')
                .ok_or_else(|| miette::miette!("--constant {setting}: NAME=VALUE is needed"))?;
            constants.set(name.trim(), value).map_err(|e| miette::miette!("--constant {setting}: {e}"))?;
        }
        let (constants, without) = (Arc::new(constants), self.without.clone());
        Ok(Options { constants, pairs: !self.no_pairs, without, ..Options::default() })
    }
}

/// A stratum by its name.
fn stratum_of(text: &str) -> Result<Stratum, String> {
    serde_json::from_value(serde_json::Value::String(text.into()))
        .map_err(|_| "none, single, pair, alias or outside is needed".to_string())
}

impl Default for BlindStudy {
    fn default() -> Self {
        BlindStudy { seed: 1, stratum: None, no_pairs: false, without: Vec::new(), constant: Vec::new() }
    }
}

/// rms gap over floor on the hidden passes that the truth must leave to be detectable.
const ABOVE_FLOOR: f64 = 1.0;
/// A diagnoser's answer on one set, beside the truth.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Scored {
    /// Seed of the set.
    pub seed: u64,
    /// Stratum.
    pub stratum: Stratum,
    /// True causes.
    pub truth: Vec<String>,
    /// Oracle: gain of the truth.
    pub chi2_gain: f64,
    /// Oracle: rms gap over floor on the hidden passes, recalibrated.
    pub gap_over_floor: f64,
    /// Oracle: no other effect imitates the truth.
    pub decidable: bool,
    /// Oracle: share of the gap that the best single of a pair leaves.
    pub best_single_leaves: Option<f64>,
    /// The verdict.
    pub verdict: Verdict,
    /// Names of the first entry.
    pub named: Vec<String>,
    /// Class that the verdict states: that of the first entry with effects, or the name alone where it names one.
    pub class: Vec<String>,
    /// Stated probability of the truth (`unknown` for causes outside the library, none for no cause).
    pub probability_of_truth: f64,
    /// Stated probability of the first entry.
    pub top_probability: f64,
    /// Whether the first entry is the truth.
    pub top_right: bool,
    /// Every entry of the list of hypotheses, and whether it is the truth.
    pub entries: Vec<StatedChance>,
    /// Distance of the cause from the library's law of its name; see [`distance`].
    pub distance: Option<f64>,
    /// Claimed shrinkage.
    pub claimed: Option<f64>,
    /// Its interval.
    pub claimed_ci95: Option<[f64; 2]>,
    /// Share of hidden passes, as they would be measured, inside their 95 % predictive intervals (expected over the noise).
    pub covered: f64,
    /// Achieved on the hidden passes against noise-free truth.
    pub achieved: Option<f64>,
    /// The same by the named effects in the library's own form alone.
    pub achieved_form: Option<f64>,
    /// F1 of the stated regions against the passes whose noise-free gap stands out by two deviations.
    pub region_f1: Option<f64>,
}

/// Diagnoses one set and opens its label.
///
/// # Errors
/// A set that the diagnosis refuses.
pub fn score(set: &Set, options: &Options) -> miette::Result<Scored> {
    let rig: RigFile =
        RigFile::parse(&set.rig_toml).map_err(|e| miette::miette!("rig.toml of a sealed set: {e}"))?;
    let table = Table::measured(&set.passes).map_err(|e| miette::miette!("table of a sealed set: {e}"))?;
    let conditions = Table::conditions(&set.conditions, &table.origin(&set.passes))
        .map_err(|e| miette::miette!("conditions of a sealed set: {e}"))?;
    let result = diagnose(&table, &rig, options, String::new());
    let forecasts = result.predict(&conditions).into_diagnostic()?;
    let report = &result.report;

    // Only from here on are label and truth open.
    let label = &set.label;
    let mut truth: Vec<String> = label.causes.iter().map(|c| c.name.clone()).collect();
    truth.sort_unstable();
    let withheld = truth.iter().any(|t| options.without.contains(t));
    let outside = label.causes.iter().any(|c| !c.in_library) || withheld;
    let says_truth = |effects: &[String]| -> bool {
        let mut own = effects.to_vec();
        own.sort_unstable();
        if outside { own == ["unknown"] } else { own == truth }
    };
    let probability_of_truth =
        report.hypotheses.iter().filter(|h| says_truth(&h.effects)).map(|h| h.probability).sum();
    let first = &report.hypotheses[0];
    // The class that the verdict states: a name stands alone, whatever else the data would allow.
    let class = match report.verdict {
        Verdict::Named => vec![first.effects.join("+")],
        _ => report
            .hypotheses
            .iter()
            .find(|h| !h.effects.is_empty() && h.effects != ["unknown"])
            .map(|h| h.alias_class.clone())
            .unwrap_or_default(),
    };

    // Hidden passes: errors over mu0 F against noise-free truth, in the order of the conditions as given.
    let mu0 = table.still_coefficient().unwrap_or(label.true_mu0);
    let place: BTreeMap<u64, usize> = set.conditions.iter().enumerate().map(|(i, p)| (p.point, i)).collect();
    let (mut recalibrated, mut after, mut form, mut covered) = (0.0, 0.0, 0.0, 0.0);
    let mut wanted = Vec::new();
    for (point, (pass, f)) in conditions.points.iter().zip(conditions.passes.iter().zip(&forecasts)) {
        let i = place[point];
        let full = mu0 * pass.normal_force_n;
        let t = set.truth_n[i];
        recalibrated += ((t - f.recalibrated) / full).powi(2);
        after += ((t - f.corrected) / full).powi(2);
        form += ((t - f.form) / full).powi(2);
        covered += inside(t - f.corrected, set.sd_n[i], Z95 * f.corrected_sd) / forecasts.len() as f64;
        let relative = rig.noise.pass_relative_sd * t;
        let sd = (relative * relative + rig.noise.force_sd_n.powi(2) * (1.0 + mu0 * mu0)).sqrt();
        wanted.push((t - f.recalibrated).abs() > 2.0 * sd);
    }
    let shrink = |left: f64| (recalibrated > 0.0).then(|| 1.0 - (left / recalibrated).sqrt());
    let is_named = |p: &Condition| {
        let value = |name: &str| covariate::by_name(name).and_then(|c| c.of(p)).unwrap_or(f64::NAN);
        let holds = |(name, [low, high]): (&&str, &[f64; 2])| (*low..=*high).contains(&value(name));
        report.location.regions.iter().any(|r| r.bounds.iter().all(holds))
    };
    let named: Vec<bool> = conditions.passes.iter().map(is_named).collect();
    let both = named.iter().zip(&wanted).filter(|(a, b)| **a && **b).count() as f64;
    let sizes = (named.iter().filter(|x| **x).count() + wanted.iter().filter(|x| **x).count()) as f64;
    let entries = report.hypotheses.iter();
    let entries = entries.map(|h| StatedChance { probability: h.probability, right: says_truth(&h.effects) });
    let region_f1 = wanted.iter().any(|x| *x).then(|| 2.0 * both / sizes.max(1.0));

    Ok(Scored {
        seed: label.seed,
        stratum: label.stratum,
        chi2_gain: label.chi2_gain,
        gap_over_floor: label.hidden_recalibrated_rmse / label.hidden_floor_rmse.max(1e-12),
        decidable: label.decidable(),
        best_single_leaves: label.best_single_leaves,
        verdict: report.verdict,
        named: first.effects.clone(),
        class,
        probability_of_truth,
        top_probability: first.probability,
        top_right: says_truth(&first.effects),
        entries: entries.collect(),
        distance: distance::distance(set),
        claimed: report.gap.shrinkage,
        claimed_ci95: report.gap.shrinkage_ci95,
        covered,
        achieved: shrink(after),
        achieved_form: shrink(form),
        region_f1,
        truth,
    })
}

/// Deviations of a 95 % interval.
const Z95: f64 = 1.959_963_985;

/// Probability that a normal number of this mean and deviation lies within a reach of zero.
fn inside(mean: f64, sd: f64, reach: f64) -> f64 {
    let below = |x: f64| 0.5 * statrs::function::erf::erfc(-(x - mean) / (sd * std::f64::consts::SQRT_2));
    below(reach) - below(-reach)
}

/// The sets of a study, one after another.
pub fn sets(seed: u64, count: usize, stratum: Option<Stratum>) -> impl Iterator<Item = Set> {
    (0..count as u64).map(move |k| set(seed, k, stratum))
}

/// The `k`th of them, from 0.
pub fn set(seed: u64, k: u64, stratum: Option<Stratum>) -> Set {
    let own = seed.wrapping_mul(1_000_003).wrapping_add(k);
    let stratum = stratum.unwrap_or_else(|| Stratum::draw(own));
    let ask = match stratum {
        Stratum::Single | Stratum::Alias | Stratum::Pair => Ask::Imitators,
        _ => Ask::Gain,
    };
    generate(own, stratum, ask)
}

/// One figure of the table.
#[derive(Debug, Clone, Serialize)]
pub struct Figure {
    /// What it measures.
    pub name: &'static str,
    /// Its value; none where no set counts.
    pub value: Option<f64>,
    /// 95 % interval: Wilson for shares, bootstrap for others, of which one value has none.
    pub ci95: Option<[f64; 2]>,
    /// Number of sets behind it.
    pub n: usize,
    /// The requirement.
    pub target: &'static str,
}

/// A share with Wilson's interval.
pub fn share(name: &'static str, target: &'static str, outcomes: Vec<bool>) -> Figure {
    let n = outcomes.len();
    let hits = outcomes.iter().filter(|x| **x).count() as f64;
    let (p, m) = (hits / n.max(1) as f64, n as f64);
    let z = 1.96;
    let centre = (p + z * z / (2.0 * m)) / (1.0 + z * z / m);
    let half = z / (1.0 + z * z / m) * (p * (1.0 - p) / m + z * z / (4.0 * m * m)).sqrt();
    let value = (n > 0).then_some(p);
    let ci95 = value.map(|_| [(centre - half).max(0.0), (centre + half).min(1.0)]);
    Figure { name, value, ci95, n, target }
}

/// A statistic with the interval of a bootstrap.
pub fn statistic<T: Copy>(
    name: &'static str,
    target: &'static str,
    values: &[T],
    of: impl Fn(&mut [T]) -> f64,
) -> Figure {
    if values.is_empty() {
        return Figure { name, value: None, ci95: None, n: 0, target };
    }
    let mut state = 1u64;
    let mut drawn = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        values[((state >> 33) as usize) % values.len()]
    };
    let mut again = || of(&mut (0..values.len()).map(|_| drawn()).collect::<Vec<T>>());
    let mut draws: Vec<f64> = (0..400).map(|_| again()).collect();
    draws.sort_by(f64::total_cmp);
    // One value drawn again and again says nothing of how far others lie from it.
    let ci95 = (values.len() > 1).then_some([draws[10], draws[389]]);
    Figure { name, value: Some(of(&mut values.to_vec())), ci95, n: values.len(), target }
}

fn mean(v: &mut [f64]) -> f64 {
    v.iter().sum::<f64>() / v.len() as f64
}

/// The median; sorts the values.
pub fn median(v: &mut [f64]) -> f64 {
    v.sort_by(f64::total_cmp);
    0.5 * (v[(v.len() - 1) / 2] + v[v.len() / 2])
}

/// The figures of a study over scored sets: each with what it counts and out of how many.
pub fn figures(all: &[Scored]) -> Vec<Figure> {
    let single = |s: &&Scored| matches!(s.stratum, Stratum::Single | Stratum::Alias);
    // Both words of the definition: the data speak for the truth, and its gap stands above the floor.
    let faint = |s: &&Scored| s.chi2_gain >= DETECTABLE && s.gap_over_floor < ABOVE_FLOOR;
    let detectable = |s: &&Scored| s.chi2_gain >= DETECTABLE && s.gap_over_floor >= ABOVE_FLOOR;
    let named_right = |s: &Scored| s.verdict == Verdict::Named && s.top_right;
    let named_wrong = |s: &Scored| s.verdict == Verdict::Named && !s.top_right;
    let clear: Vec<&Scored> = all.iter().filter(single).filter(detectable).filter(|s| s.decidable).collect();
    let faint_singles: Vec<_> = all.iter().filter(single).filter(faint).filter(|s| s.decidable).collect();
    let murky: Vec<&Scored> = all.iter().filter(single).filter(detectable).filter(|s| !s.decidable).collect();
    let none: Vec<&Scored> = all.iter().filter(|s| s.stratum == Stratum::None).collect();
    let outside: Vec<_> = all.iter().filter(|s| s.stratum == Stratum::Outside).filter(detectable).collect();
    let leaves = |s: &&Scored| s.best_single_leaves.is_some_and(|share| share >= PAIR_LEAVES);
    let pairs = all.iter().filter(|s| s.stratum == Stratum::Pair).filter(leaves).filter(detectable);
    let of = |list: &[&Scored], f: &dyn Fn(&Scored) -> bool| list.iter().map(|s| f(s)).collect::<Vec<bool>>();
    // A class joins names in the library's order, the truth stands in that of the alphabet.
    let in_class = |s: &Scored| {
        s.class.iter().any(|entry| {
            let mut names: Vec<&str> = entry.split('+').collect();
            names.sort_unstable();
            names == s.truth
        })
    };
    let both_lead = |s: &Scored| s.top_right;
    let any_of = |s: &Scored| s.named.iter().any(|n| s.truth.contains(n));
    let log: Vec<f64> = clear.iter().map(|s| s.probability_of_truth.max(1e-6).ln()).collect();
    let probability: Vec<f64> = clear.iter().map(|s| s.probability_of_truth).collect();
    let gapped: Vec<&Scored> =
        clear.iter().copied().filter(|s| s.gap_over_floor >= 4.0 && s.verdict == Verdict::Named).collect();
    let closed: Vec<f64> = gapped.iter().filter_map(|s| s.achieved_form).collect();
    let closed_full: Vec<f64> = gapped.iter().filter_map(|s| s.achieved).collect();
    let honest: Vec<f64> = gapped.iter().filter_map(|s| Some((s.claimed? - s.achieved?).abs())).collect();
    let regions: Vec<f64> = all.iter().filter(detectable).filter_map(|s| s.region_f1).collect();
    let faint_regions: Vec<f64> = all.iter().filter(faint).filter_map(|s| s.region_f1).collect();
    let (pairs, murky_pairs): (Vec<&Scored>, Vec<&Scored>) = pairs.partition(|s| s.decidable);
    let identifiable_sets = all.iter().filter(|s| identifiable(s));
    let coverage: Vec<f64> = all.iter().map(|s| s.covered).collect();
    let promised = |s: &&Scored| Some((s.claimed_ci95?, s.achieved?));
    let contained = gapped.iter().filter_map(promised).map(|(ci, a)| ci[0] <= a && a <= ci[1]).collect();
    let near = |s: &&&Scored, band: usize| {
        s.distance.is_some_and(|d| distance::BANDS.partition_point(|b| *b <= d) == band)
    };
    let at =
        |band: usize| of(&clear.iter().filter(|s| near(s, band)).copied().collect::<Vec<_>>(), &named_right);
    vec![
        share("singles, detectable and decidable: named right", ">= 0.90", of(&clear, &named_right)),
        share("  confidently wrong", "<= 0.02", of(&clear, &named_wrong)),
        share("  cause within 0.05 of a law: named right", "reported", at(0)),
        share("  cause 0.05 to 0.15 from every law: named right", "reported", at(1)),
        share("  cause 0.15 and more from every law: named right", "reported", at(2)),
        statistic("  mean probability on the truth", ">= 0.85", &probability, mean),
        statistic("  mean log score, nats", "reported", &log, mean),
        share("  gap below the floor: named right", "reported", of(&faint_singles, &named_right)),
        share("  gap below the floor: confidently wrong", "reported", of(&faint_singles, &named_wrong)),
        share("no gap: an effect named", "<= 0.01", of(&none, &|s| s.verdict == Verdict::Named)),
        share("  gap claimed", "<= 0.05", of(&none, &|s| s.verdict != Verdict::NoGap)),
        share("outside the library: unknown", ">= 0.85", of(&outside, &|s| s.verdict == Verdict::Unknown)),
        share("  confidently misnamed", "<= 0.05", of(&outside, &|s| s.verdict == Verdict::Named)),
        share("undecidable: truth in the stated class", ">= 0.90", of(&murky, &in_class)),
        share("  named exactly right", "reported", of(&murky, &named_right)),
        share("  confidently wrong", "<= 0.03", of(&murky, &named_wrong)),
        share("pairs, decidable, best single leaves 25 %: both lead", ">= 0.80", of(&pairs, &both_lead)),
        share("  at least one leads", ">= 0.97", of(&pairs, &any_of)),
        share("  an undecidable member: both lead", "reported", of(&murky_pairs, &both_lead)),
        share("  an undecidable member: truth in the stated class", "reported", of(&murky_pairs, &in_class)),
        statistic("gap closed by the named form alone, median", ">= 0.75", &closed, median),
        statistic("gap closed by the verdict's model, median", "reported", &closed_full, median),
        statistic("claimed against achieved, median difference", "<= 0.05", &honest, median),
        statistic("where: mean F1 of the regions", ">= 0.80", &regions, mean),
        statistic("  gap below the floor: mean F1", "reported", &faint_regions, mean),
        calibration("calibration error of the first entry, debiased", all.iter()),
        calibration("  of sets with an identifiable truth", identifiable_sets),
        share("achieved shrinkage inside its 95 % interval", "0.90 to 0.98", contained),
        statistic("hidden passes inside 95 % predictive intervals", "0.90 to 0.98", &coverage, mean),
    ]
}

/// Debiased calibration error of the first entry's probability, in ten bins of equal count.
fn calibration<'a>(name: &'static str, sets: impl Iterator<Item = &'a Scored>) -> Figure {
    let mut list: Vec<_> = sets.map(|s| (s.top_probability, f64::from(u8::from(s.top_right)))).collect();
    list.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut error = 0.0;
    for bin in list.chunks(list.len().div_ceil(10).max(1)) {
        let n = bin.len() as f64;
        let stated = bin.iter().map(|b| b.0).sum::<f64>() / n;
        let right = bin.iter().map(|b| b.1).sum::<f64>() / n;
        // The square of a binomial share is too large by its variance.
        let bias = right * (1.0 - right) / (n - 1.0).max(1.0);
        error += n / list.len() as f64 * ((stated - right).powi(2) - bias).max(0.0).sqrt();
    }
    let value = (list.len() >= 50).then_some(error);
    Figure { name, value, ci95: None, n: list.len(), target: "<= 0.05" }
}

/// Truth by answer, counted.
pub fn confusion(all: &[Scored]) -> BTreeMap<String, BTreeMap<String, usize>> {
    let mut table: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for s in all {
        let truth = if s.truth.is_empty() { "none".to_string() } else { s.truth.join("+") };
        let answer = match s.verdict {
            Verdict::NoGap => "no_gap".to_string(),
            Verdict::Unknown => "unknown".to_string(),
            Verdict::Named => s.named.join("+"),
            Verdict::Ambiguous => {
                format!("ambiguous({})", s.class.iter().take(3).cloned().collect::<Vec<_>>().join(","))
            }
        };
        *table.entry(truth).or_default().entry(answer).or_default() += 1;
    }
    table
}
