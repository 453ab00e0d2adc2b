//! More than two runs: grouped by tip, moisture, day or model, and how the groups differ at each condition.
//!
//! A run is the unit where a group has several: its passes share one mounting, one day and one `mu_0`,
//! so they are not independent. The uncertainty of a group's mean is the scatter between its runs, or what
//! the stated noise makes of it where that is more. A group of one run has the stated noise alone, and its
//! interval does not hold how far another run would lie.

use super::folders::{noise, read_run, reference};
use super::{Reference, Side, air_of, by_condition, set_by};
use crate::plan::SKIN_MOISTURE;
use crate::run_data::RunData;
use crate::run_dir::began;
use clap::ValueEnum;
use miette::WrapErr;
use models::{Ambient, Pass};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};
use std::path::{Path, PathBuf};

/// Runs in a comparison at most.
pub const MOST_COMPARED: usize = 40;
/// Width of a level of moisture, in its unit.
const MOISTURE_STEP: f64 = 10.0;

/// What runs are grouped by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum GroupBy {
    /// Each run by itself
    #[default]
    Run,
    /// Name of the fingertip
    Tip,
    /// Moisture of the skin, or humidity of the air, in steps of 10
    Moisture,
    /// Day of the first session, UTC
    Day,
    /// Model that the run was compared with
    Model,
}

/// Some runs under one name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Its name.
    pub name: String,
    /// Folders of its runs.
    pub runs: Vec<PathBuf>,
    /// `mu_0` of each.
    pub mu0: Vec<f64>,
}

/// The mean of a group at one condition.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GroupMean {
    /// Mean of its runs' relative friction.
    pub mu_relative: f64,
    /// Standard uncertainty, `mu_0` included.
    pub sd: f64,
    /// Degrees of freedom of that; none where the stated noise decides.
    pub degrees: Option<f64>,
    /// Runs that have the condition.
    pub runs: usize,
}

/// A later group less the first one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GroupDifference {
    /// Difference of relative friction.
    pub difference: f64,
    /// Its interval of 95 %.
    pub interval_95: [f64; 2],
    /// Whether both groups have several runs: else the interval does not hold the scatter between runs.
    pub between_runs: bool,
}

/// One condition.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct AtCondition {
    /// Peak-to-peak amplitude in m.
    pub amplitude_pp_m: f64,
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Speed in m/s, signed by the direction.
    pub velocity_m_s: f64,
    /// Normal force in N.
    pub normal_force_n: f64,
    /// The levels of the air that a plan sets.
    #[serde(flatten)]
    pub air: Ambient,
    /// The mean of each group; none where it lacks the condition.
    pub means: Vec<Option<GroupMean>>,
    /// Each group after the first less the first; none where either lacks the condition.
    pub differences: Vec<Option<GroupDifference>>,
}

/// What `muprime compare` says of more than two runs.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Grouped {
    /// What they are grouped by.
    pub by: GroupBy,
    /// The groups, by name; by the order of the runs where each is one.
    pub groups: Vec<Group>,
    /// Every condition of any run.
    pub conditions: Vec<AtCondition>,
    /// What speaks against a plain reading.
    pub warnings: Vec<String>,
}

struct Read {
    data: RunData,
    side: Side,
    group: String,
    reference: Reference,
}

impl Grouped {
    /// Reads runs and compares their groups.
    ///
    /// # Errors
    /// A folder that holds no run, a run that is given twice or has no pass without vibration, fewer than two
    /// groups.
    pub fn of(folders: &[PathBuf], by: GroupBy) -> miette::Result<Self> {
        let mut given = std::collections::BTreeSet::new();
        for folder in folders {
            if !given.insert(folder.canonicalize().unwrap_or_else(|_| folder.clone())) {
                miette::bail!(help = "give each run once", "{}: the run is given twice", folder.display());
            }
        }
        let runs: Vec<Read> = folders.iter().map(|folder| read(folder, by)).collect::<miette::Result<_>>()?;
        let mut names: Vec<String> = runs.iter().map(|run| run.group.clone()).collect();
        if by != GroupBy::Run {
            names.sort();
        }
        let mut seen = std::collections::BTreeSet::new();
        names.retain(|name| seen.insert(name.clone()));
        if names.len() < 2 {
            miette::bail!(
                help = "group them by something else",
                "all of these runs are in one group: {}",
                names.concat()
            );
        }
        let conditions = conditions(&runs, &names);
        let group = |name: &String| {
            let of = || runs.iter().zip(folders).filter(|(run, _)| run.group == *name);
            let mu0 = of().map(|(run, _)| run.reference.mu0).collect();
            Group { name: name.clone(), runs: of().map(|(_, folder)| folder.clone()).collect(), mu0 }
        };
        let (groups, warnings) = (names.iter().map(group).collect(), warnings(&runs, folders));
        Ok(Grouped { by, groups, conditions, warnings })
    }

    /// Later groups' differences whose interval leaves zero out, and all differences.
    pub fn apart(&self) -> [usize; 2] {
        let all = || self.conditions.iter().flat_map(|c| c.differences.iter().flatten());
        let apart = all().filter(|d| d.interval_95[0] > 0.0 || d.interval_95[1] < 0.0);
        [apart.count(), all().count()]
    }

    /// The result in one sentence, with what chance alone would do.
    pub fn words(&self) -> String {
        let [apart, all] = self.apart();
        if all == 0 {
            return "cannot tell: no group has a condition in common with the first".into();
        }
        format!(
            "{apart} of {all} differences of mu' from '{}' have a 95 % interval without zero; chance alone would \
             give about {:.0}",
            self.groups[0].name,
            0.05 * all as f64
        )
    }
}

fn read(folder: &Path, by: GroupBy) -> miette::Result<Read> {
    let data = read_run(folder)?;
    let noise = noise(folder)?;
    let side = Side::of(&data, noise);
    let reference = reference(&side, folder)?;
    let group = group_of(folder, &data, by).wrap_err_with(|| folder.display().to_string())?;
    Ok(Read { data, side, group, reference })
}

fn group_of(folder: &Path, data: &RunData, by: GroupBy) -> miette::Result<String> {
    let fact = |name: &str| data.facts.get(name).cloned().unwrap_or_else(|| "not stated".into());
    Ok(match by {
        GroupBy::Run => folder.file_name().unwrap_or(folder.as_os_str()).to_string_lossy().into(),
        GroupBy::Tip => fact("fingertip"),
        GroupBy::Model => fact("model"),
        GroupBy::Day => began(folder)?.map_or("not stated".into(), |at| at.chars().take(10).collect()),
        GroupBy::Moisture => moisture(data),
    })
}

/// The level of moisture: typed at the rig, else the air's humidity.
fn moisture(data: &RunData) -> String {
    let mean =
        |values: Vec<f64>| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
    let level = |value: f64| {
        let low = (value / MOISTURE_STEP).floor() * MOISTURE_STEP;
        format!("{low:.0} to {:.0}", low + MOISTURE_STEP)
    };
    let levels = data.passes.iter().flat_map(|p| &p.levels);
    let skin = mean(levels.filter(|l| l.quantity == SKIN_MOISTURE).map(|l| l.value).collect());
    let air = mean(data.passes.iter().filter_map(|p| p.pass.relative_humidity_pct).collect());
    match (skin, air) {
        (Some(skin), _) => format!("skin moisture {} a.u.", level(skin)),
        (None, Some(air)) => format!("humidity {} %", level(air)),
        (None, None) => "moisture not stated".into(),
    }
}

fn conditions(runs: &[Read], groups: &[String]) -> Vec<AtCondition> {
    let sides: Vec<&Side> = runs.iter().map(|run| &run.side).collect();
    let (set, mut found) = (set_by(&sides), by_condition(&sides));
    let at = |(first, passes): &(&Pass, Vec<Vec<&Pass>>)| {
        let of_group = |name: &String| {
            let has = |(i, run): &(usize, &Read)| run.group == *name && !passes[*i].is_empty();
            let mean = |(i, run): (usize, &Read)| {
                let mean = sides[i].mean(&passes[i], run.reference);
                (mean.mu_relative, mean.sd.hypot(mean.mu_relative * run.reference.relative_sd))
            };
            group_mean(&runs.iter().enumerate().filter(has).map(mean).collect::<Vec<_>>())
        };
        let means: Vec<Option<GroupMean>> = groups.iter().map(of_group).collect();
        let differences = means[1..].iter().map(|mean| Some(difference(&means[0]?, &(*mean)?))).collect();
        AtCondition {
            amplitude_pp_m: first.amplitude.metres(),
            frequency_hz: first.frequency_hz,
            velocity_m_s: first.direction.sign() * first.speed_m_s,
            normal_force_n: first.normal_force_n,
            air: air_of(first, &set),
            means,
            differences,
        }
    };
    let setting =
        |p: &Pass| [p.normal_force_n, p.frequency_hz, p.amplitude.metres(), p.direction.sign() * p.speed_m_s];
    found.sort_by(|a, b| setting(a.0).partial_cmp(&setting(b.0)).unwrap_or(std::cmp::Ordering::Equal));
    found.iter().map(at).collect()
}

/// The mean of runs, each with the standard uncertainty that its stated noise makes.
fn group_mean(runs: &[(f64, f64)]) -> Option<GroupMean> {
    let n = runs.len() as f64;
    let mu_relative = runs.iter().map(|r| r.0).sum::<f64>() / n;
    let stated = runs.iter().map(|r| r.1 * r.1).sum::<f64>() / (n * n);
    let between = runs.iter().map(|r| (r.0 - mu_relative).powi(2)).sum::<f64>() / (n - 1.0) / n;
    let scatters = runs.len() > 1 && between > stated;
    let (variance, degrees) = if scatters { (between, Some(n - 1.0)) } else { (stated, None) };
    (!runs.is_empty()).then(|| GroupMean { mu_relative, sd: variance.sqrt(), degrees, runs: runs.len() })
}

/// By Welch's interval: degrees of freedom after Satterthwaite, those of stated noise without end.
fn difference(first: &GroupMean, later: &GroupMean) -> GroupDifference {
    let [a, b] = [first, later].map(|m| m.sd * m.sd);
    let spent: f64 = [(a, first), (b, later)].iter().filter_map(|(v, m)| Some(v * v / m.degrees?)).sum();
    let student = StudentsT::new(0.0, 1.0, (a + b).powi(2) / spent.max(f64::MIN_POSITIVE));
    let wide = match student {
        Ok(law) if spent > 0.0 => law.inverse_cdf(0.975),
        _ => Normal::standard().inverse_cdf(0.975),
    };
    let (difference, half) = (later.mu_relative - first.mu_relative, wide * (a + b).sqrt());
    GroupDifference {
        difference,
        interval_95: [difference - half, difference + half],
        between_runs: first.runs > 1 && later.runs > 1,
    }
}

/// Runs on the virtual rig that share a seed, and damage.
fn warnings(runs: &[Read], folders: &[PathBuf]) -> Vec<String> {
    let mut all = Vec::new();
    for (i, run) in runs.iter().enumerate() {
        let twin = runs[..i].iter().position(|other| {
            !super::differences::warnings(&other.data.facts, &run.data.facts, false).is_empty()
        });
        if let Some(twin) = twin {
            let [a, b] = [&folders[twin], &folders[i]].map(|f| f.display());
            all.push(format!("{a} and {b} have one seed on the virtual rig: their noise is the same"));
        }
        all.extend(run.data.damage.iter().map(|d| format!("{}: {d}", folders[i].display())));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A run that counted twice would make an interval too narrow.
    #[test]
    fn a_run_that_is_given_twice_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let twice = [folder.path().join("."), folder.path().to_path_buf()];
        let why = Grouped::of(&twice, GroupBy::Day).unwrap_err().to_string();
        assert!(why.contains("given twice"), "{why}");
    }

    #[test]
    fn scatter_between_runs_makes_welchs_interval_and_one_run_says_so() {
        let a = group_mean(&[(0.5, 1e-4), (0.54, 1e-4), (0.46, 1e-4)]).unwrap();
        let b = group_mean(&[(0.6, 1e-4), (0.7, 1e-4)]).unwrap();
        assert!((a.mu_relative - 0.5).abs() < 1e-12 && a.degrees == Some(2.0));
        assert!((a.sd - 0.04 / 3f64.sqrt()).abs() < 1e-12, "{a:?}");
        let d = difference(&a, &b);
        // Degrees: (a + b)^2 / (a^2 / 2 + b^2 / 1) with a = 0.0016 / 3, b = 0.005 / 2.
        let (va, vb): (f64, f64) = (0.0016 / 3.0, 0.005 / 2.0);
        let degrees = (va + vb).powi(2) / (va * va / 2.0 + vb * vb);
        let half = StudentsT::new(0.0, 1.0, degrees).unwrap().inverse_cdf(0.975) * (va + vb).sqrt();
        assert!(d.between_runs && (d.interval_95[1] - d.difference - half).abs() < 1e-9, "{d:?}");
        let one = group_mean(&[(0.6, 0.01)]).unwrap();
        let d = difference(&one, &group_mean(&[(0.7, 0.01)]).unwrap());
        let half = 1.959_963_985 * (2e-4f64).sqrt();
        assert!(!d.between_runs && (d.interval_95[1] - d.difference - half).abs() < 1e-6, "{d:?}");
        assert_eq!(group_mean(&[]), None, "what is missing is no zero");
        // Runs that agree by chance are as uncertain as their noise.
        let alike = group_mean(&[(0.5, 0.02), (0.5, 0.02)]).unwrap();
        assert!((alike.sd - 0.02 / 2f64.sqrt()).abs() < 1e-12 && alike.degrees.is_none());
    }
}
