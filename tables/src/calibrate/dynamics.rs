//! `muprime calibrate step` and `muprime calibrate tap`: bandwidth and dead time of a channel, resonance of its mount.

use super::{Outcome, Sources, columns};
use calibration::certificate::{Finding, Residuals};
use calibration::force::characteristics::outcome;
use calibration::force::dynamics::{Estimate, ring_down, step_response};
use calibration::uncertainty::Input;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// One or more events, as CSV: event (number), time_s (since the event), value (counts or newtons).
    /// Steps: with samples before the event. Taps: the free decay alone, once the hammer is off
    samples: PathBuf,
}

/// One event's answer: what it found, and standard deviation and largest of what the fit left.
type Event = (Vec<Estimate>, [f64; 2]);

/// A step of force: second-order low-pass with dead time.
pub fn step(args: &Args, sources: &mut Sources) -> miette::Result<Outcome> {
    const NAMES: [(&str, &str); 4] = [
        ("step.delay", "s"),
        ("step.natural_frequency", "Hz"),
        ("step.damping_ratio", "1"),
        ("step.bandwidth", "Hz"),
    ];
    let model =
        "value = base + height step(t - delay) of a second-order low-pass; bandwidth where it is 3 dB down";
    run(args, sources, &NAMES, model, f64::NEG_INFINITY, |time, value| {
        let found = step_response(time, value, 0.0)?;
        let all = vec![found.delay_s, found.natural_frequency_hz, found.damping_ratio, found.bandwidth_hz];
        Ok((all, found.residual))
    })
}

/// A tap: the free decay of the mount.
pub fn tap(args: &Args, sources: &mut Sources) -> miette::Result<Outcome> {
    const NAMES: [(&str, &str); 2] = [("mount.resonance", "Hz"), ("mount.damping_ratio", "1")];
    let model = "value = c + exp(-zeta omega t) (p cos(omega_d t) + q sin(omega_d t))";
    run(args, sources, &NAMES, model, 0.0, |time, value| {
        let found = ring_down(time, value)?;
        Ok((vec![found.frequency_hz, found.damping_ratio], found.residual))
    })
}

fn run(
    args: &Args,
    sources: &mut Sources,
    names: &[(&str, &'static str)],
    model: &str,
    from_s: f64,
    fit: impl Fn(&[f64], &[f64]) -> Result<Event, calibration::regression::FitError>,
) -> miette::Result<Outcome> {
    let rows = columns(sources, &args.samples, ["event", "time_s", "value"], &[])?;
    let shown = args.samples.display();
    let mut events: Vec<Event> = Vec::new();
    for event in rows.chunk_by(|a, b| a[0] == b[0]) {
        let (time, value): (Vec<f64>, Vec<f64>) = event.iter().map(|r| (r[1], r[2])).unzip();
        let refused = |why: &dyn std::fmt::Display| miette::miette!("{shown}: event {}: {why}", event[0][0]);
        if time.windows(2).any(|w| w[1] <= w[0]) {
            return Err(refused(&"time_s must rise from row to row"));
        }
        if time[0] < from_s {
            return Err(refused(&"it begins before its tap: only the free decay after it is fitted"));
        }
        events.push(fit(&time, &value).map_err(|e| refused(&format!("no certificate: {e}")))?);
    }
    let mut remarks = Vec::new();
    if events.len() == 2 {
        miette::bail!("{shown}: two events say little of their scatter: give one, or at least three");
    }
    if events.len() == 1 {
        remarks.push(
            "one event: uncertainties are those of its fit, from event to event they are unknown".into(),
        );
    }
    let finding = |(k, (name, unit)): (usize, &(&str, &'static str))| match events.as_slice() {
        // Both models have five parameters.
        [one] => Finding::new(*name, *unit, one.0[k], rows.len() as f64 - 5.0),
        all => {
            let values: Vec<f64> = all.iter().map(|e| e.0[k][0]).collect();
            let mean = Input::type_a(&values);
            Finding::new(*name, *unit, [mean.value, mean.standard_uncertainty], mean.degrees_of_freedom)
        }
    };
    let findings: Vec<Finding> = names.iter().enumerate().map(finding).collect();
    let n = events.len() as f64;
    let count = rows.len() as u64;
    let sd = (events.iter().map(|e| e.1[0].powi(2)).sum::<f64>() / n).sqrt();
    let largest = events.iter().map(|e| e.1[1]).fold(0.0, f64::max);
    let residuals = Residuals { count, sd, largest, unit: "as the values".into(), lack_of_fit_p: None };
    Ok(outcome(model, &findings, residuals, remarks))
}
