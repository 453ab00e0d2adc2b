//! `muprime calibrate noise`: spectrum, lines, quantisation of a sensor at rest, and the rule for a frozen value.

use super::{CalibrationResult, Sources, columns};
use calibration::certificate::{Finding, Residuals};
use calibration::force::characteristics::outcome;
use calibration::force::noise::{
    EqualSamples, Spectrum, integrated_autocorrelation_time, mean_with_uncertainty,
    probability_of_equal_samples, quantum,
};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Samples at rest, every one and evenly spaced, as CSV: lateral_counts, normal_counts (whole numbers)
    samples: PathBuf,
    /// Samples per second
    #[arg(long, allow_negative_numbers = true)]
    rate_hz: f64,
    /// Samples of a segment of the spectrum (Welch, Hann, half overlapping)
    #[arg(long, default_value_t = 1024)]
    segment: usize,
    /// Probability per sample that a live channel may be called frozen
    #[arg(long, default_value_t = 1e-9)]
    false_alarm: f64,
    /// Where the spectra go, as CSV: frequency_hz, lateral_counts2_per_hz, normal_counts2_per_hz
    #[arg(long)]
    spectrum: Option<PathBuf>,
}

/// The end at which samples are cut off: there are more at it than anywhere, and ten times as many as at the
/// other end. Noise has its fewest samples at the ends, and a hum as many at both.
fn rail(samples: &[i64]) -> Option<i64> {
    let mut counts = BTreeMap::new();
    samples.iter().for_each(|sample| *counts.entry(*sample).or_insert(0u64) += 1);
    let (low, high) = (counts.first_key_value()?, counts.last_key_value()?);
    let most = counts.values().max()?;
    let cut = |end: (&i64, &u64), other: (&i64, &u64)| end.1 == most && *end.1 > 10 * other.1;
    let found = [(low, high), (high, low)].into_iter().find(|(end, other)| cut(*end, *other));
    found.filter(|_| counts.len() >= 4).map(|(end, _)| *end.0)
}

/// Calibrates.
pub fn calibrate(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    if !(args.rate_hz > 0.0 && args.rate_hz.is_finite()) {
        miette::bail!("--rate-hz {}: above zero", args.rate_hz);
    }
    if !(args.false_alarm > 0.0 && args.false_alarm < 0.01) {
        miette::bail!("--false-alarm {}: above 0 and below 0.01", args.false_alarm);
    }
    let rows = columns(sources, &args.samples, ["lateral_counts", "normal_counts"], &[])?;
    let shown = args.samples.display();
    let (mut findings, mut remarks, mut spectra, mut frozen) =
        (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut largest = 0f64;
    for (axis, name) in ["lateral", "normal"].into_iter().enumerate() {
        let counts: Vec<f64> = rows.iter().map(|r| r[axis]).collect();
        if let Some(row) = counts.iter().position(|c| c.fract() != 0.0) {
            miette::bail!("{shown}, row {}: {name}_counts are whole numbers, raw as they came", row + 1);
        }
        let whole: Vec<i64> = counts.iter().map(|c| *c as i64).collect();
        if let Some(end) = rail(&whole) {
            miette::bail!(
                "{shown}: {name}_counts pile up at {end}, the end of the converter's range: unload the sensor"
            );
        }
        let n = counts.len() as f64;
        let (Some(spectrum), Some(equal)) =
            (Spectrum::welch(&counts, args.rate_hz, args.segment), EqualSamples::of(&whole))
        else {
            miette::bail!(
                "{shown}: {n} samples are too few; at least 100 and one --segment ({})",
                args.segment
            )
        };
        if let Some(from) = equal.frozen_from {
            let (first, last) = (from + 1, from + equal.longest_run);
            miette::bail!(
                help = "find the cause (link, converter, a change of the noise), then record again",
                "{shown}, rows {first} to {last}: {name}_counts repeat one value, which noise of this level does not do"
            );
        }
        let mean = mean_with_uncertainty(&counts);
        let dof = (n / integrated_autocorrelation_time(&counts)).max(2.0) - 1.0;
        let sd = (counts.iter().map(|c| (c - mean.0).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        largest = counts.iter().fold(largest, |m, c| m.max((c - mean.0).abs()));
        let (level, n) = (spectrum.white_level(), spectrum.segments as f64);
        findings.extend([
            Finding::new(format!("{name}.zero"), "counts", [mean.0, mean.1], dof),
            // The relative uncertainty of a standard deviation is 1 / sqrt(2 (n - 1)) (GUM E.4.3).
            Finding::new(format!("{name}.noise_sd"), "counts", [sd, sd / (2.0 * dof).sqrt()], dof),
            Finding::new(format!("{name}.white_density"), "counts^2/Hz", [level, level / n.sqrt()], n),
        ]);
        for line in spectrum.lines(6.0) {
            let (hz, within, rms) = (line.frequency_hz, 0.5 * spectrum.resolution_hz, line.rms);
            remarks
                .push(format!("{name}: a line at {hz:.2} Hz, within {within:.2} Hz, of {rms:.3} counts rms"));
        }
        match quantum(&whole) {
            None => miette::bail!("{shown}: {name}_counts are all equal: this channel is dead or frozen"),
            Some(step) => {
                let white = (level * args.rate_hz / 2.0).sqrt();
                remarks.push(format!(
                    "{name}: the converter's step is {step} counts; {:.3} % of successive samples are equal (white \
                     noise of that level alone: {:.3} %), the longest run is {}",
                    100.0 * equal.share,
                    100.0 * probability_of_equal_samples(white, step as f64),
                    equal.longest_run
                ));
            }
        }
        frozen.push(equal.frozen_after(args.false_alarm));
        spectra.push(spectrum);
    }
    let equal = if let [Some(a), Some(b)] = frozen.as_slice() { Some((*a).max(*b)) } else { None };
    let frozen_after = equal.filter(|n| *n <= 1000).map(|n| n.max(20));
    remarks.push(match equal.zip(frozen_after) {
        Some((n, stated)) => format!(
            "frozen-value rule: {n} equal samples in a row, at most {:.0e} false alarms a sample; in the setup: [limits] \
             frozen_after = {stated}{}",
            args.false_alarm,
            if stated > n { ", the least that a setup takes" } else { "" }
        ),
        None => "no frozen-value rule: the noise is below the converter's step, equal samples say nothing".into(),
    });
    if let Some(path) = &args.spectrum {
        let mut text = String::from("frequency_hz,lateral_counts2_per_hz,normal_counts2_per_hz\n");
        for (k, (l, n)) in spectra[0].density.iter().zip(&spectra[1].density).enumerate().skip(1) {
            let _ = writeln!(text, "{},{l:e},{n:e}", k as f64 * spectra[0].resolution_hz);
        }
        runs::files::write_output(path, text)?;
    }
    let sd =
        findings.iter().filter(|f| f.name.ends_with("noise_sd")).map(|f| f.estimate[0]).fold(0.0, f64::max);
    let residuals =
        Residuals { count: 2 * rows.len() as u64, sd, largest, unit: "counts".into(), lack_of_fit_p: None };
    let mut found = outcome("counts = zero + noise, at rest", &findings, residuals, remarks);
    found.settings.insert("rate_hz".into(), args.rate_hz.to_string());
    if let Some(n) = frozen_after {
        found.settings.insert("frozen_after".into(), n.to_string());
    }
    Ok(found)
}
