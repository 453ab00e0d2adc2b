//! What an import writes: the table, the rig.toml with what was assumed, and the log.

use super::grid::csv_of;
use super::map::Map;
use super::values::{middle, sorted};
use miette::{IntoDiagnostic, WrapErr};
use models::PeakToPeak;
use models::covariate::{self, Covariate};
use models::pass::{Pass, read_passes, write_passes};
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

/// Scatter of the passes of one setting: a part that grows with the lateral force, and one that does not.
struct Repeatability {
    relative_sd: f64,
    /// N; none where the pairs do not tell it from the other part.
    force_sd_n: Option<f64>,
    pairs: usize,
}

/// The repeatability, from neighbours in time of one setting: a bad pass and a slow drift hardly count.
/// `None` with fewer than eight such pairs.
fn repeatability(passes: &[Pass]) -> Option<Repeatability> {
    let mut settings: BTreeMap<Vec<i64>, Vec<&Pass>> = BTreeMap::new();
    for p in passes.iter().filter(|p| p.lateral_force_n.is_some()) {
        let condition = p.condition(1.0);
        let level = |c: &&'static Covariate| Some(c.level?(c.of(&condition)?));
        settings.entry(covariate::SETTINGS.iter().filter_map(level).collect()).or_default().push(p);
    }
    let ratio = |p: &Pass| p.lateral_force_n.unwrap_or(0.0) / p.normal_force_n;
    // The lateral force of a pair, and how far its passes lie apart at the same load, in N.
    let mut pairs: Vec<[f64; 2]> = Vec::new();
    for group in settings.values_mut() {
        group.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let pair = |w: &[&Pass]| {
            let load = 0.5 * (w[0].normal_force_n + w[1].normal_force_n);
            [0.5 * (ratio(w[1]) + ratio(w[0])), ratio(w[1]) - ratio(w[0])].map(|r| (r * load).abs())
        };
        pairs.extend(group.windows(2).filter(|w| w[0].run == w[1].run).map(pair).filter(|[l, _]| *l > 0.0));
    }
    if pairs.len() < 8 {
        return None;
    }
    let usual = middle(&sorted(pairs.iter().map(|[lateral, _]| *lateral)))?;
    // Constant over growing part, in N: the most likely of a grid, where the odds are above 20.
    let tries = std::iter::once(0.0).chain((-12..=12).map(|k| usual * 1.4_f64.powi(k)));
    let fits: Vec<[f64; 3]> = tries.filter_map(|offset| split(&pairs, offset)).collect();
    let best = *fits.iter().min_by(|a, b| a[2].total_cmp(&b[2]))?;
    let growing = fits[0];
    let apart = growing[2] - best[2] > 20f64.ln();
    let [relative_sd, offset, _] = if apart { best } else { growing };
    Some(Repeatability { relative_sd, force_sd_n: apart.then_some(relative_sd * offset), pairs: pairs.len() })
}

/// The relative deviation with which pairs scatter as `sd * hypot(lateral, offset)`, with that offset and
/// minus the log likelihood of Student's t with four degrees of freedom: outliers hardly count.
fn split(pairs: &[[f64; 2]], offset: f64) -> Option<[f64; 3]> {
    let sizes =
        || pairs.iter().map(|[lateral, apart]| (lateral.hypot(offset), apart / std::f64::consts::SQRT_2));
    // The median of a normal deviate's size is 0.6745 of its deviation.
    let sd = middle(&sorted(sizes().map(|(size, apart)| apart / size)))? / 0.674_489_75;
    let sd = sd.max(REPEATABILITY[0] * 1e-3);
    let cost =
        |(size, apart): (f64, f64)| (size * sd).ln() + 2.5 * (0.25 * (apart / (size * sd)).powi(2)).ln_1p();
    Some([sd, offset, sizes().map(cost).sum()])
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
    let found = repeatability(passes);
    let (sd, how) = match &found {
        Some(Repeatability { relative_sd, pairs, .. }) => {
            let sd = relative_sd.clamp(REPEATABILITY[0], REPEATABILITY[1]);
            ((sd * 1e4).ceil() / 1e4, format!("from {pairs} pairs of neighbouring passes of one setting"))
        }
        None => {
            assumed.push("repeatability of 1.5 %: the table has too few repeats to tell".into());
            (0.015, "ASSUMED: the table has too few repeats to tell".to_string())
        }
    };
    // A thousandth of the load, in as many digits as it has.
    let least: f64 = format!("{:.1e}", load * 1e-3).parse().into_diagnostic()?;
    let (force_sd, of_force) = match found.and_then(|found| found.force_sd_n) {
        Some(sd) if sd > least => (format!("{sd:.1e}").parse().into_diagnostic()?, how.clone()),
        _ => {
            assumed.push(format!("noise of a pass's mean force: {least} N, a thousandth of the median load"));
            (least, "ASSUMED: a thousandth of the median load".to_string())
        }
    };
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
         force_sd_n = {force_sd}       # {of_force}\n\n\
         # No certificate: nothing that an instrument could do wrong is ruled out. See [calibration] in docs/contract.md.\n",
        finger.normal_stiffness_n_per_m,
        finger.lateral_stiffness_n_per_m,
        finger.stiffness_relative_sd,
        finger.poisson_ratio
    );
    models::rig_file::RigFile::parse(&text).into_diagnostic()?;
    Ok((text, assumed))
}

#[cfg(test)]
mod tests {
    use super::{repeatability, split};
    use models::{Condition, Direction, Pass};

    /// Pairs of passes over loads of 50 mN to 1 N whose friction scatters by a share and by an amount in N.
    fn pairs(relative: f64, force_n: f64) -> Vec<Pass> {
        let mut state = 11u64;
        let mut normal = move || {
            let one = |_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f64 / (1u64 << 24) as f64
            };
            (0..12).map(one).sum::<f64>() - 6.0
        };
        let of = |k: u32| {
            let load = 0.05 * 20f64.powf(f64::from(k / 2 % 60) / 59.0);
            let condition =
                Condition { normal_force_n: load, direction: Direction::Forward, ..Condition::paper() };
            let friction = 0.5 * load * (1.0 + relative * normal()) + force_n * normal();
            let condition = Condition { time_s: f64::from(k), ..condition };
            let mut pass = Pass::at(u64::from(k), &condition, Some(friction));
            pass.replicate = Some(u64::from(k % 2));
            pass
        };
        (0..240).map(of).collect()
    }

    /// Scatter that does not grow with the load is no share of it: else a small load counts for too much.
    #[test]
    fn scatter_is_separated_by_how_it_grows() {
        let found = repeatability(&pairs(0.02, 0.003)).unwrap();
        assert!((0.014..0.026).contains(&found.relative_sd), "{}", found.relative_sd);
        assert!(found.force_sd_n.is_some_and(|sd| (0.0023..0.0037).contains(&sd)), "{:?}", found.force_sd_n);
        let found = repeatability(&pairs(0.03, 0.0)).unwrap();
        assert!((0.025..0.035).contains(&found.relative_sd) && found.force_sd_n.is_none());
        assert!(repeatability(&pairs(0.02, 0.003)[..6]).is_none());
        // Passes without any scatter have a deviation all the same.
        assert!(split(&[[0.1, 0.0]; 8], 0.0).is_some_and(|[sd, ..]| sd > 0.0));
    }
}
