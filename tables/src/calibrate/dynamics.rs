//! `muprime calibrate step` and `muprime calibrate tap`: bandwidth and dead time of a channel, resonance of its mount.

use super::{CalibrationResult, Sources, columns};
use calibration::certificate::{Finding, Residuals};
use calibration::force::characteristics::outcome;
use calibration::force::dynamics::{Estimate, StepResponse, ring_down, step_responses};
use calibration::regression::FitError;
use calibration::uncertainty::Input;
use std::path::PathBuf;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// One or more events, as CSV: event (number), time_s (since the event), value (counts or newtons).
    /// Steps: with samples before the event. Taps: the free decay alone, once the hammer is off
    samples: PathBuf,
}

/// Times in s and values of one event.
type Record = (Vec<f64>, Vec<f64>);

/// Names, units and values of what an event shows, and standard deviation and largest of what the fit left.
type Event = (Vec<(&'static str, &'static str, Estimate)>, [f64; 2]);

/// Steps of force: a low-pass with dead time, of second order or of first.
pub fn step(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    run(args, sources, f64::NEG_INFINITY, |records| {
        let found = step_responses(records, 0.0)?;
        let event = |step: &StepResponse| {
            let mut all = vec![("step.delay", "s", step.delay_s)];
            if let Some([natural_hz, damping]) = step.second_order {
                let frequency = ("step.natural_frequency", "Hz", natural_hz);
                all.extend([frequency, ("step.damping_ratio", "1", damping)]);
            }
            all.push(("step.bandwidth", "Hz", step.bandwidth_hz));
            (all, step.residual)
        };
        let second = "value = base + height step(t - delay) of a second-order low-pass; \
                      bandwidth where it is 3 dB down";
        let first = "value = base + height (1 - exp(-(t - delay) 2 pi bandwidth)): a first-order low-pass, \
                     whose natural frequency and damping nothing determines";
        let model = if found[0].second_order.is_some() { (second, 5.0) } else { (first, 4.0) };
        Ok((model, found.iter().map(event).collect()))
    })
}

/// Taps: the free decay of the mount.
pub fn tap(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    run(args, sources, 0.0, |records| {
        let event = |(k, (time, value)): (usize, &Record)| {
            let found = ring_down(time, value).map_err(|e| (k, e))?;
            let damping = ("mount.damping_ratio", "1", found.damping_ratio);
            Ok((vec![("mount.resonance", "Hz", found.frequency_hz), damping], found.residual))
        };
        let model = "value = c + exp(-zeta omega t) (p cos(omega_d t) + q sin(omega_d t))";
        Ok(((model, 5.0), records.iter().enumerate().map(event).collect::<Result<_, _>>()?))
    })
}

/// `fit` gives the model with the number of its parameters, and what each event found.
fn run(
    args: &Args,
    sources: &mut Sources,
    from_s: f64,
    fit: impl Fn(&[Record]) -> Result<((&'static str, f64), Vec<Event>), (usize, FitError)>,
) -> miette::Result<CalibrationResult> {
    let rows = columns(sources, &args.samples, ["event", "time_s", "value"], &[])?;
    let shown = args.samples.display();
    let numbered: Vec<&[[f64; 3]]> = rows.chunk_by(|a, b| a[0] == b[0]).collect();
    let refused = |k: usize, why: &dyn std::fmt::Display| {
        miette::miette!("{shown}: event {}: {why}", numbered[k][0][0])
    };
    let records: Vec<Record> =
        numbered.iter().map(|event| event.iter().map(|r| (r[1], r[2])).unzip()).collect();
    for (k, (time, _)) in records.iter().enumerate() {
        if time.windows(2).any(|w| w[1] <= w[0]) {
            return Err(refused(k, &"time_s must rise from row to row"));
        }
        if time[0] < from_s {
            return Err(refused(k, &"it begins before its tap: only the free decay after it is fitted"));
        }
    }
    let fitted = fit(&records).map_err(|(k, e)| refused(k, &format!("no certificate: {e}")))?;
    let ((model, parameters), events) = fitted;
    let mut remarks = Vec::new();
    if events.len() == 2 {
        miette::bail!("{shown}: two events say little of their scatter: give one, or at least three");
    }
    if events.len() == 1 {
        remarks.push(
            "one event: uncertainties are those of its fit, from event to event they are unknown".into(),
        );
    }
    let finding = |k: usize| {
        let (name, unit, estimate) = events[0].0[k];
        match events.as_slice() {
            [_] => Finding::new(name, unit, estimate, rows.len() as f64 - parameters),
            all => {
                let mean = Input::type_a(&all.iter().map(|e| e.0[k].2[0]).collect::<Vec<f64>>());
                Finding::new(name, unit, [mean.value, mean.standard_uncertainty], mean.degrees_of_freedom)
            }
        }
    };
    let findings: Vec<Finding> = (0..events[0].0.len()).map(finding).collect();
    let n = events.len() as f64;
    let count = rows.len() as u64;
    let sd = (events.iter().map(|e| e.1[0].powi(2)).sum::<f64>() / n).sqrt();
    let largest = events.iter().map(|e| e.1[1]).fold(0.0, f64::max);
    let residuals = Residuals { count, sd, largest, unit: "as the values".into(), lack_of_fit_p: None };
    Ok(outcome(model, &findings, residuals, remarks))
}
