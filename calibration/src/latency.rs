//! Latency: delay and jitter of each channel against the stage, alignment between channels, clock drift.
//!
//! Delays of single edges (reversals of the stage, taps, bursts) come from [`crate::force::dynamics`] or
//! from their correlation; this module makes of them one delay with its uncertainty, and a jitter.

pub mod clock;

use crate::certificate::{BudgetLine, CalibrationResult, CertificateKind, Finding, Residuals, parameters};
use crate::uncertainty::Input;
use statrs::distribution::{ChiSquared, ContinuousCDF};
use std::collections::BTreeMap;

/// Why there is no latency.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum LatencyError {
    /// Too few edges.
    #[error(
        "channel `{channel}`: {found} edges are too few for a delay and its scatter, {needed} are needed"
    )]
    TooFew { channel: String, found: usize, needed: usize },
    /// Edges that differ by nothing.
    #[error(
        "channel `{channel}`: all its delays are equal: they differ by less than their resolution; state it \
         (--resolution-s), or give more digits"
    )]
    Equal { channel: String },
    /// A response before its cause.
    #[error(
        "channel `{channel}`: its mean delay is {delay_s:.2e} s, an answer before its cause: its clock is ahead, or \
         its edges are attributed to the wrong commands"
    )]
    Acausal { channel: String, delay_s: f64 },
}

/// Delay of one channel.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelDelay {
    /// The channel's name.
    pub channel: String,
    /// Mean delay with its standard uncertainty (statistics and resolution) and degrees of freedom.
    pub delay: Input,
    /// Standard deviation from edge to edge in s, with its 95 % interval.
    pub jitter_s: f64,
    /// 95 % interval of the jitter (chi squared).
    pub jitter_ci95_s: [f64; 2],
    /// Smallest and largest delay seen in s.
    pub range_s: [f64; 2],
    /// Number of edges.
    pub edges: usize,
}

/// One delay out of the delays of many edges.
/// `resolution_s` is the resolution of the reference (stage time stamps), taken as rectangular.
///
/// # Errors
/// Fewer than eight edges, all equal without a resolution, or a mean delay below zero by more than three of
/// its uncertainties.
pub fn channel_delay(
    channel: &str,
    delays_s: &[f64],
    resolution_s: f64,
) -> Result<ChannelDelay, LatencyError> {
    const NEEDED: usize = 8;
    if delays_s.len() < NEEDED {
        return Err(LatencyError::TooFew { channel: channel.into(), found: delays_s.len(), needed: NEEDED });
    }
    let [least, largest] = crate::regression::ends(delays_s.iter().copied());
    if least == largest && resolution_s == 0.0 {
        return Err(LatencyError::Equal { channel: channel.into() });
    }
    let mut delay = Input::type_a(delays_s);
    let statistical = delay.standard_uncertainty;
    delay.standard_uncertainty = statistical.hypot(resolution_s / 12f64.sqrt());
    delay.degrees_of_freedom *= (delay.standard_uncertainty / statistical).powi(4);
    if delay.value < -3.0 * delay.standard_uncertainty {
        return Err(LatencyError::Acausal { channel: channel.into(), delay_s: delay.value });
    }
    let n = delays_s.len() as f64;
    let jitter_s = statistical * n.sqrt();
    let chi = |p: f64| ChiSquared::new(n - 1.0).map_or(f64::NAN, |c| c.inverse_cdf(p));
    let bound = |p: f64| jitter_s * ((n - 1.0) / chi(p)).sqrt();
    Ok(ChannelDelay {
        channel: channel.into(),
        delay,
        jitter_s,
        jitter_ci95_s: [bound(0.975), bound(0.025)],
        range_s: [least, largest],
        edges: delays_s.len(),
    })
}

/// Everything that a latency certificate states: delays of the channels, and clocks where they were compared.
pub fn outcome(channels: &[ChannelDelay], clocks: &[(String, clock::ClockFit)]) -> CalibrationResult {
    let mut findings = Vec::new();
    let mut budget = Vec::new();
    for c in channels {
        let (delay, edges) = (&c.delay, c.edges as f64);
        let estimate = [delay.value, delay.standard_uncertainty];
        findings.push(Finding::new(format!("{}.delay", c.channel), "s", estimate, delay.degrees_of_freedom));
        // The standard uncertainty of a standard deviation of n Gaussian values (GUM E.4.3).
        let estimate = [c.jitter_s, c.jitter_s / (2.0 * (edges - 1.0)).sqrt()];
        findings.push(Finding::new(format!("{}.jitter", c.channel), "s", estimate, edges - 1.0));
        let scatter = format!("scatter of {edges} edges of {}", c.channel);
        budget.push(BudgetLine::a(scatter, c.jitter_s / edges.sqrt(), "s"));
    }
    for (channel, clock) in clocks {
        let name = format!("{channel}.clock_rate_error");
        findings.push(Finding::new(name, "1", clock.rate_error, clock.degrees_of_freedom));
    }
    let covariance = Finding::covariance(&findings, &[]);
    let jitter = channels.iter().map(|c| c.jitter_s).fold(0.0, f64::max);
    let largest = channels.iter().map(|c| (c.range_s[1] - c.delay.value).max(c.delay.value - c.range_s[0]));
    CalibrationResult {
        kind: CertificateKind::Latency,
        model: "t_channel = t_event + delay + jitter; t_device = (1 + clock_rate_error) t_host + constant"
            .into(),
        settings: BTreeMap::new(),
        remarks: channels
            .iter()
            .map(|c| {
                format!(
                    "{}: jitter {:.2e} s, 95 % interval {:.2e} to {:.2e} s, delays from {:.2e} to {:.2e} s",
                    c.channel, c.jitter_s, c.jitter_ci95_s[0], c.jitter_ci95_s[1], c.range_s[0], c.range_s[1]
                )
            })
            .collect(),
        parameters: parameters(&findings, &covariance),
        covariance,
        residuals: Residuals {
            count: channels.iter().map(|c| c.edges as u64).sum(),
            sd: jitter,
            largest: largest.fold(0.0, f64::max),
            unit: "s".into(),
            lack_of_fit_p: None,
        },
        temperature_c: None,
        range: BTreeMap::new(),
        budget,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_the_mean_with_its_t_interval() {
        let delays = [1.0, 1.2, 0.8, 1.1, 0.9, 1.0, 1.3, 0.7].map(|ms| ms * 1e-3);
        let found = channel_delay("force", &delays, 0.0).unwrap();
        // Sample sd of these: sqrt(0.28 / 7) = 0.2 ms.
        assert!((found.delay.value - 1e-3).abs() < 1e-12);
        assert!((found.jitter_s - 0.2e-3).abs() < 1e-12);
        assert!((found.delay.standard_uncertainty - 0.2e-3 / 8f64.sqrt()).abs() < 1e-12);
        // chi squared with 7 degrees of freedom: 1.690 and 16.013.
        assert!((found.jitter_ci95_s[0] - 0.2e-3 * (7.0f64 / 16.013).sqrt()).abs() < 1e-7);
        assert!((found.jitter_ci95_s[1] - 0.2e-3 * (7.0f64 / 1.690).sqrt()).abs() < 1e-7);
    }

    #[test]
    fn an_answer_before_its_cause_is_refused() {
        let error =
            channel_delay("force", &[-1e-3, -1.1e-3, -0.9e-3, -1e-3, -1e-3, -1.05e-3, -0.95e-3, -1e-3], 0.0);
        assert!(matches!(error, Err(LatencyError::Acausal { .. })));
    }
}
