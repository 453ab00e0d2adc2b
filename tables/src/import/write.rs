//! What an import writes: the table, the rig.toml with what was assumed, and the log.

use super::grid::csv_of;
use super::map::Map;
use super::values::{middle, sorted};
use miette::{IntoDiagnostic, WrapErr};
use models::covariate::{self, Covariate};
use models::pass::{Pass, read_passes, write_passes};
use models::quantity::PeakToPeak;
use runs::fingertip::{Fingertip, FingertipSetup};
use std::collections::BTreeMap;
use std::path::Path;

/// Columns that the table gets: what the source gives, and what every table has. What it does not give is left out.
pub fn columns(map: &Map, series: bool) -> Vec<&'static str> {
    let of_series = ["normal_force_sd_n", "lateral_force_sd_n", "samples"];
    let required = covariate::REQUIRED.iter().map(|c| c.name);
    let optional = covariate::OPTIONAL.iter().map(|c| c.name);
    let all = required.chain(["lateral_force_n"]).chain(of_series).chain(optional);
    let all = all.chain(["phase_shift_deg", "replicate", "run", "session"]);
    let may_lack = |c: &str| !["time_s", "speed_m_s", "direction"].contains(&c);
    let columns = all.filter(|c| map.gives(c) || !may_lack(c) || series && of_series.contains(c));
    std::iter::once("point").chain(columns).collect()
}

/// The point table with these columns, numbers with as many digits as it takes to read them back unchanged.
fn table(passes: &[Pass], columns: &[&str]) -> miette::Result<String> {
    let mut whole = Vec::new();
    write_passes(passes, &mut whole).into_diagnostic()?;
    let mut reader = csv::Reader::from_reader(&whole[..]);
    let header = reader.headers().into_diagnostic()?.clone();
    let places: Vec<usize> = (0..header.len()).filter(|k| columns.contains(&&header[*k])).collect();
    let rows = reader.records().collect::<Result<Vec<_>, _>>().into_diagnostic()?;
    csv_of(columns, rows.iter().map(|row| places.iter().map(|k| &row[*k])))
}

/// The table as CSV. What is written must be what was meant: it is read back as a diagnosis would.
///
/// # Errors
/// A table that reads back as another one.
pub fn written(passes: &[Pass], columns: &[&str], states_frequency: bool) -> miette::Result<String> {
    let table = table(passes, columns)?;
    let mut back = read_passes(table.as_bytes()).into_diagnostic().wrap_err("the table that was made")?;
    if !states_frequency {
        back.iter_mut().zip(passes).for_each(|(b, p)| b.frequency_hz = p.frequency_hz);
    }
    if back != passes {
        miette::bail!(
            "the table that was made does not read back as it was written: please report this file"
        );
    }
    Ok(table)
}

/// Relative standard deviation from pass to pass, from neighbours in time of one setting: a bad pass and a
/// slow drift hardly count. `None` with fewer than eight such pairs.
fn repeatability(passes: &[Pass]) -> Option<(f64, usize)> {
    let mut settings: BTreeMap<Vec<i64>, Vec<&Pass>> = BTreeMap::new();
    for p in passes.iter().filter(|p| p.lateral_force_n.is_some()) {
        let condition = p.condition(1.0);
        let level = |c: &&'static Covariate| Some(c.level?(c.of(&condition)?));
        settings.entry(covariate::SETTINGS.iter().filter_map(level).collect()).or_default().push(p);
    }
    let ratio = |p: &Pass| p.lateral_force_n.unwrap_or(0.0) / p.normal_force_n;
    let mut steps = Vec::new();
    for group in settings.values_mut() {
        group.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let step = |w: &[&Pass]| ((ratio(w[1]) - ratio(w[0])) / (0.5 * (ratio(w[1]) + ratio(w[0])))).abs();
        steps.extend(group.windows(2).filter(|w| w[0].run == w[1].run).map(step).filter(|s| s.is_finite()));
    }
    let steps = sorted(steps.into_iter());
    // The median of a difference of two normal values is 0.6745 times root two of their deviation.
    let sd = middle(&steps)? / (0.674_489_75 * std::f64::consts::SQRT_2);
    (steps.len() >= 8).then_some((sd, steps.len()))
}

/// Least and largest repeatability that is taken from a table.
const REPEATABILITY: [f64; 2] = [1e-3, 0.3];

/// The rig.toml of a table of which little else is known, and what was assumed in it.
///
/// # Errors
/// A fingertip that is not there.
pub fn rig(passes: &[Pass], source: &str, tip: Option<&str>) -> miette::Result<(String, Vec<String>)> {
    let mut assumed = Vec::new();
    let vibrates = passes.iter().any(|p| p.amplitude > PeakToPeak::ZERO);
    let (finger, from) = match tip {
        Some(name) => {
            let setup: FingertipSetup =
                toml::from_str(&format!("tip = {}", toml::Value::from(name))).into_diagnostic()?;
            let tip = Fingertip::resolve(&setup, Path::new("."))
                .map_err(|(_, problem)| miette::miette!("--tip {name}: {problem}"))?;
            (tip.finger, format!("of the fingertip '{}'", tip.name))
        }
        None => {
            let paper = models::finger::Finger::paper();
            let from = if vibrates {
                "of a human fingertip, known to half of their size"
            } else {
                "of a human fingertip; a still plate does not ask for them"
            };
            assumed.push(format!("stiffnesses {from}"));
            let stiffness_relative_sd = if vibrates { 0.5 } else { 0.05 };
            let finger = models::finger::Finger { stiffness_relative_sd, young_modulus_pa: None, ..paper };
            (finger, format!("ASSUMED {from}"))
        }
    };
    let load = middle(&sorted(passes.iter().map(|p| p.normal_force_n))).unwrap_or(0.25);
    let (sd, how) = match repeatability(passes) {
        Some((sd, pairs)) => {
            let sd = sd.clamp(REPEATABILITY[0], REPEATABILITY[1]);
            ((sd * 1e4).ceil() / 1e4, format!("from {pairs} pairs of neighbouring passes of one setting"))
        }
        None => {
            assumed.push("repeatability of 1.5 %: the table has too few repeats to tell".into());
            (0.015, "ASSUMED: the table has too few repeats to tell".to_string())
        }
    };
    // A thousandth of the load, in as many digits as it has.
    let force_sd: f64 = format!("{:.1e}", load * 1e-3).parse().into_diagnostic()?;
    assumed.push(format!("noise of a pass's mean force: {force_sd} N, a thousandth of the median load"));
    let text = format!(
        "# What is known of the rig of {source}, and what was assumed. Replace what is assumed by what a calibration says.\n\
         [finger]\n\
         # Stiffnesses {from}.\n\
         normal_stiffness_n_per_m = {:e}\n\
         lateral_stiffness_n_per_m = {:e}\n\
         stiffness_relative_sd = {}       # one standard deviation\n\
         poisson_ratio = {}\n\n\
         [noise]\n\
         pass_relative_sd = {sd}       # {how}\n\
         force_sd_n = {force_sd}       # ASSUMED: a thousandth of the median load\n\n\
         # No certificate: nothing that an instrument could do wrong is ruled out. See [calibration] in docs/contract.md.\n",
        finger.normal_stiffness_n_per_m,
        finger.lateral_stiffness_n_per_m,
        finger.stiffness_relative_sd,
        finger.poisson_ratio
    );
    models::rig_file::RigFile::parse(&text).into_diagnostic()?;
    Ok((text, assumed))
}
