//! `muprime calibrate latency`.

use super::{CalibrationResult, Sources, columns};
use calibration::force::dynamics::step_responses;
use calibration::latency::{channel_delay, clock, outcome};
use calibration::uncertainty::Input;
use std::path::PathBuf;

/// Arguments. Each file is given as CHANNEL=FILE and may be repeated.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Delays of single edges as CSV: delay_s
    #[arg(long, value_name = "CHANNEL=FILE")]
    edges: Vec<String>,
    /// Step responses as CSV: edge (number), time_s (from the stage's event), value
    #[arg(long, value_name = "CHANNEL=FILE")]
    steps: Vec<String>,
    /// Time stamps as CSV: host_s, device_s
    #[arg(long, value_name = "CHANNEL=FILE")]
    clock: Vec<String>,
    /// Resolution of the events' times (stage time stamps) in s
    #[arg(long, default_value_t = 0.0)]
    resolution_s: f64,
}

/// Calibrates.
pub fn calibrate(args: &Args, sources: &mut Sources) -> miette::Result<CalibrationResult> {
    if args.edges.is_empty() && args.steps.is_empty() && args.clock.is_empty() {
        miette::bail!("give --edges, --steps or --clock at least once, as CHANNEL=FILE");
    }
    let mut channels = Vec::new();
    let mut remarks = Vec::new();
    let delay = |channel, delays: &[f64], given: &String| {
        channel_delay(channel, delays, args.resolution_s).map_err(|e| miette::miette!("{given}: {e}"))
    };
    for given in &args.edges {
        let (channel, path) = split(given)?;
        let delays: Vec<f64> = columns(sources, &path, ["delay_s"], &[])?.iter().map(|r| r[0]).collect();
        channels.push(delay(channel, &delays, given)?);
    }
    for given in &args.steps {
        let (channel, path) = split(given)?;
        let rows = columns(sources, &path, ["edge", "time_s", "value"], &[])?;
        let edges: Vec<&[[f64; 3]]> = rows.chunk_by(|a, b| a[0] == b[0]).collect();
        let records: Vec<_> = edges.iter().map(|edge| edge.iter().map(|r| (r[1], r[2])).unzip()).collect();
        let found = step_responses(&records, 0.0)
            .map_err(|(k, e)| miette::miette!("{}: edge {}: {e}", path.display(), edges[k][0][0]))?;
        let (delays, bandwidths): (Vec<f64>, Vec<f64>) =
            found.iter().map(|f| (f.delay_s[0], f.bandwidth_hz[0])).unzip();
        channels.push(delay(channel, &delays, given)?);
        let Input { value, standard_uncertainty: u, .. } = Input::type_a(&bandwidths);
        remarks.push(format!("{channel}: bandwidth {value:.2} Hz, standard uncertainty {u:.2} Hz"));
    }
    let mut clocks = Vec::new();
    for given in &args.clock {
        let (channel, path) = split(given)?;
        let rows = columns(sources, &path, ["host_s", "device_s"], &[])?;
        let (host, device): (Vec<f64>, Vec<f64>) = rows.iter().map(|r| (r[0], r[1])).unzip();
        let found = clock::compare(&host, &device).map_err(|e| miette::miette!("{given}: {e}"))?;
        if found.rate_error[0].abs() > 0.01 {
            let rate = 1.0 + found.rate_error[0];
            let help = "both are in seconds, and a counter that starts over must be unwrapped";
            miette::bail!(help = help, "{given}: device_s rises {rate:.4} times as fast as host_s");
        }
        remarks.push(format!(
            "{channel}: arrivals scatter by {:.2e} s about the device's clock",
            found.arrival_sd_s
        ));
        clocks.push((channel.to_string(), found));
    }
    let mut found = outcome(&channels, &clocks);
    found.remarks.extend(remarks);
    Ok(found)
}

fn split(given: &str) -> miette::Result<(&str, PathBuf)> {
    match given.split_once('=') {
        Some((channel, path)) if !channel.is_empty() && !path.is_empty() => Ok((channel, path.into())),
        _ => miette::bail!("`{given}`: write CHANNEL=FILE, for instance lateral=steps.csv"),
    }
}
