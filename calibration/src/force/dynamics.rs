//! Dynamics of a force channel: bandwidth and delay from a step, resonance of the mount from a tap.

use crate::regression::nonlinear::best;
use crate::regression::{Fit, FitError, ends};
use std::f64::consts::{LN_2, PI};

/// A value with its standard uncertainty.
pub type Estimate = [f64; 2];

/// Response of a channel to a step of force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepResponse {
    /// Time from the step to the start of the response in s (dead time, latency).
    pub delay_s: Estimate,
    /// Undamped natural frequency of the second-order low-pass in Hz, and its damping ratio; `None` where one
    /// of first order describes the steps as well, so that nothing determines the two.
    pub second_order: Option<[Estimate; 2]>,
    /// Frequency where the amplitude is down by the square root of two, in Hz.
    pub bandwidth_hz: Estimate,
    /// Height of the step, in the unit of the samples.
    pub height: Estimate,
    /// Standard deviation of what the fit left, and the largest of it, in the unit of the samples.
    pub residual: [f64; 2],
}

/// Refuses a record that stays at an extreme for four samples or more. Where other values repeat too, the
/// converter is coarser than the noise and nothing is known. A decay may be clipped at `both` ends.
fn refuse_clipped(samples: &[f64], both: bool) -> Result<(), FitError> {
    let extremes = ends(samples.iter().copied());
    let runs = samples.chunk_by(|a, b| a == b).filter(|run| run.len() >= 4);
    let repeated: Vec<f64> = runs.map(|run| run[0]).collect();
    let clipped = repeated.iter().all(|x| extremes.contains(x) && (both || *x == repeated[0]));
    repeated.first().filter(|_| clipped).map_or(Ok(()), |end| Err(FitError::Clipped { end: *end }))
}

/// Fits a low-pass with dead time to records (times in s, samples) around a step at `step_at_s`: of second
/// order, or of first where Akaike's criterion finds all of them described no worse.
///
/// # Errors
/// Too few or clipped samples, no step in them, or no convergence; with the number of the record, from 0.
pub fn step_responses(
    records: &[(Vec<f64>, Vec<f64>)],
    step_at_s: f64,
) -> Result<Vec<StepResponse>, (usize, FitError)> {
    let (mut fits, mut excess) = (Vec::new(), 0.0);
    for (k, (time_s, samples)) in records.iter().enumerate() {
        let around = Around::new(time_s, samples, step_at_s).map_err(|e| (k, e))?;
        let both = (around.first_order(), around.second_order());
        // Where that of second order has no least sum of squares, its damping grows without a bound.
        excess += match &both {
            (Ok(one), Ok(two)) => {
                let ratio = one.residual_sum_of_squares / two.residual_sum_of_squares;
                samples.len() as f64 * ratio.ln() - 2.0
            }
            (Ok(_), Err(_)) => f64::NEG_INFINITY,
            (Err(_), _) => f64::INFINITY,
        };
        fits.push(both);
    }
    let chosen = |(k, (one, two))| {
        let fit: Result<Fit, FitError> = if excess < 0.0 { one } else { two };
        fit.map(|fit| response_of(&fit)).map_err(|e| (k, e))
    };
    fits.into_iter().enumerate().map(chosen).collect()
}

/// What a fit says; of second order it has a fifth parameter.
fn response_of(fit: &Fit) -> StepResponse {
    let at = |k: usize, scale: f64| scale * fit.standard_uncertainty(k);
    let corner = fit.estimates[3].exp() / (2.0 * PI);
    let (mut bandwidth_hz, mut second_order) = ([corner, at(3, corner)], None);
    if let Some(&zeta) = fit.estimates.get(4) {
        let ratio = bandwidth_ratio(zeta);
        let slope = (bandwidth_ratio(zeta + 1e-5) - bandwidth_ratio(zeta - 1e-5)) / 2e-5;
        let u = fit.standard_uncertainty_along(&[0.0, 0.0, 0.0, corner * ratio, corner * slope]);
        bandwidth_hz = [corner * ratio, u];
        second_order = Some([[corner, at(3, corner)], [zeta, at(4, 1.0)]]);
    }
    StepResponse {
        delay_s: [fit.estimates[2], at(2, 1.0)],
        second_order,
        bandwidth_hz,
        height: [fit.estimates[1], at(1, 1.0)],
        residual: [fit.residual_sd(), fit.residuals.amax()],
    }
}

/// Samples around one step, and what a fit starts from.
struct Around<'a> {
    time_s: &'a [f64],
    samples: &'a [f64],
    step_at_s: f64,
    /// Level before and after.
    levels: [f64; 2],
    /// Time to half way up in s, and samples in a second.
    half_s: f64,
    rate_hz: f64,
}

impl<'a> Around<'a> {
    fn new(time_s: &'a [f64], samples: &'a [f64], step_at_s: f64) -> Result<Self, FitError> {
        let before: Vec<f64> =
            time_s.iter().zip(samples).filter(|(t, _)| **t < step_at_s).map(|(_, x)| *x).collect();
        let tail = &samples[samples.len() - samples.len() / 4..];
        if before.len() < 5 || tail.len() < 5 {
            return Err(FitError::TooFew { observations: samples.len(), parameters: 5 });
        }
        refuse_clipped(samples, false)?;
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let (low, high) = (mean(&before), mean(tail));
        let half_s = time_s
            .iter()
            .zip(samples)
            .find(|(t, x)| **t > step_at_s && (**x - low) * (high - low).signum() > 0.5 * (high - low).abs())
            .map_or(step_at_s, |(t, _)| *t)
            - step_at_s;
        let rate_hz = (time_s.len() - 1) as f64 / (time_s[time_s.len() - 1] - time_s[0]);
        Ok(Self {
            time_s,
            samples,
            step_at_s,
            levels: [low, high],
            half_s: half_s.max(0.5 / rate_hz),
            rate_hz,
        })
    }

    /// Parameters: base, height, delay, ln natural angular frequency, damping ratio.
    fn second_order(&self) -> Result<Fit, FitError> {
        let [low, high] = self.levels;
        // A critically damped step is half way after 1.7 / omega.
        let omega = |share: f64| 1.7 / ((1.0 - share) * self.half_s);
        let starts = [(0.2, 0.7), (0.5, 0.7), (0.8, 0.7), (0.5, 0.3), (0.5, 1.2)]
            .map(|(share, zeta)| [low, high - low, share * self.half_s, omega(share).ln(), zeta]);
        self.fit(starts, |t, b| second_order_step(t, b[3].exp(), b[4]), |f| f.estimates[4] > 0.0)
    }

    /// Parameters: base, height, delay, ln of the inverse time constant.
    fn first_order(&self) -> Result<Fit, FitError> {
        let [low, high] = self.levels;
        let starts = [0.2, 0.5, 0.8]
            .map(|share| [low, high - low, share * self.half_s, (LN_2 / ((1.0 - share) * self.half_s)).ln()]);
        self.fit(starts, |t, b| if t > 0.0 { -(-b[3].exp() * t).exp_m1() } else { 0.0 }, |_| true)
    }

    fn fit<const N: usize>(
        &self,
        starts: impl IntoIterator<Item = [f64; N]>,
        response: impl Fn(f64, &[f64]) -> f64,
        possible: impl Fn(&Fit) -> bool,
    ) -> Result<Fit, FitError> {
        let model = |i: usize, b: &[f64], g: &mut [f64]| {
            let response = |b: &[f64]| response(self.time_s[i] - self.step_at_s - b[2], b);
            let (value, r) = (|b: &[f64]| b[0] + b[1] * response(b), response(b));
            (g[0], g[1]) = (1.0, r);
            let mut moved = b.to_vec();
            for k in 2..b.len() {
                let h = if k == 2 { 1e-6 / b[3].exp() } else { 1e-6 };
                moved[k] = b[k] + h;
                let up = value(&moved);
                moved[k] = b[k] - h;
                g[k] = (up - value(&moved)) / (2.0 * h);
                moved[k] = b[k];
            }
            b[0] + b[1] * r
        };
        let wanted = |f: &Fit| possible(f) && f.estimates[2] > -2.0 / self.rate_hz;
        best(&model, self.samples, starts, wanted)?.better_than_a_constant(self.samples)
    }
}

/// Unit step response of a second-order low-pass, zero before the step.
pub fn second_order_step(t: f64, omega: f64, zeta: f64) -> f64 {
    if t <= 0.0 {
        return 0.0;
    }
    let d = 1.0 - zeta * zeta;
    let decay = (-zeta * omega * t).exp();
    let x = omega * t * d.abs().sqrt();
    // sin(x)/x and sinh(x)/x join smoothly at critical damping.
    let (c, s) = if x < 1e-4 {
        (1.0, 1.0)
    } else if d > 0.0 {
        (x.cos(), x.sin() / x)
    } else {
        (x.cosh(), x.sinh() / x)
    };
    1.0 - decay * (c + zeta * omega * t * s)
}

/// -3 dB frequency over natural frequency of a second-order low-pass.
fn bandwidth_ratio(zeta: f64) -> f64 {
    let a = 1.0 - 2.0 * zeta * zeta;
    (a + (a * a + 1.0).sqrt()).sqrt()
}

/// Resonance of a mount that rings after a tap.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RingDown {
    /// Frequency of the ringing in Hz.
    pub frequency_hz: Estimate,
    /// Damping ratio.
    pub damping_ratio: Estimate,
    /// Standard deviation of what the fit left, and the largest of it, in the unit of the samples.
    pub residual: [f64; 2],
}

/// Fits `x = c + exp(-zeta omega t) (p cos + q sin)` to a free decay.
///
/// # Errors
/// Too few or clipped samples, nothing that rings, or no convergence.
pub fn ring_down(time_s: &[f64], samples: &[f64]) -> Result<RingDown, FitError> {
    let n = samples.len();
    if n < 16 {
        return Err(FitError::TooFew { observations: n, parameters: 5 });
    }
    refuse_clipped(samples, true)?;
    let rate = (n - 1) as f64 / (time_s[n - 1] - time_s[0]);
    // The largest line of a coarse spectrum is where to start.
    let length = n.min(1024);
    let spectrum = super::noise::Spectrum::welch(&samples[..length], rate, length)
        .ok_or(FitError::TooFew { observations: n, parameters: 5 })?;
    let peak = (1..spectrum.density.len())
        .max_by(|a, b| spectrum.density[*a].total_cmp(&spectrum.density[*b]))
        .unwrap_or(1);
    let guess_hz = peak as f64 * spectrum.resolution_hz;
    let mean = samples.iter().sum::<f64>() / n as f64;
    let t0 = time_s[0];
    let model = |i: usize, b: &[f64], g: &mut [f64]| {
        let t = time_s[i] - t0;
        let (omega, decay) = (b[3], (-b[4] * t).exp());
        let (s, c) = (omega * t).sin_cos();
        let wave = b[1] * c + b[2] * s;
        g[0] = 1.0;
        g[1] = decay * c;
        g[2] = decay * s;
        g[3] = decay * t * (b[2] * c - b[1] * s);
        g[4] = -t * decay * wave;
        b[0] + decay * wave
    };
    let omega = 2.0 * PI * guess_hz;
    let starts = [0.01, 0.03, 0.1, 0.3].map(|zeta| [mean, samples[0] - mean, 0.0, omega, zeta * omega]);
    let decays = |f: &Fit| f.estimates[3] > 0.0 && f.estimates[4] > 0.0;
    let best = best(&model, samples, starts, decays)?.better_than_a_constant(samples)?;
    let (damped, sigma) = (best.estimates[3], best.estimates[4]);
    let natural = damped.hypot(sigma);
    let n3 = natural.powi(3);
    Ok(RingDown {
        frequency_hz: [damped / (2.0 * PI), best.standard_uncertainty(3) / (2.0 * PI)],
        damping_ratio: [
            sigma / natural,
            best.standard_uncertainty_along(&[0.0, 0.0, 0.0, -sigma * damped / n3, damped * damped / n3]),
        ],
        residual: [best.residual_sd(), best.residuals.amax()],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_response_meets_its_limits() {
        // Critically damped: 1 - (1 + wt) exp(-wt).
        let (w, t) = (100.0_f64, 0.013);
        let exact = 1.0 - (1.0 + w * t) * (-w * t).exp();
        for zeta in [1.0 - 1e-7, 1.0, 1.0 + 1e-7] {
            assert!((second_order_step(t, w, zeta) - exact).abs() < 1e-6);
        }
        // Butterworth: the bandwidth is the natural frequency.
        assert!((bandwidth_ratio(0.5f64.sqrt()) - 1.0).abs() < 1e-12);
    }

    /// It had a natural frequency and a damping that nothing determines, and its delay and bandwidth lay
    /// outside their intervals in more than half of the records.
    #[test]
    fn a_channel_of_first_order_is_one_and_its_intervals_cover() {
        use rand_distr::Distribution as _;
        let normal = rand_distr::Normal::new(0.0, 0.01).unwrap();
        let mut random = <rand_chacha::ChaCha8Rng as rand::SeedableRng>::seed_from_u64(3);
        let (delay_s, tau_s) = (4.3e-3, 8e-3);
        let (mut covered, mut first) = ([0; 2], 0);
        for _ in 0..60 {
            let time: Vec<f64> = (0..200).map(|i| f64::from(i - 50) * 1e-3).collect();
            let step = |t: f64| if t > delay_s { 1.0 - (-(t - delay_s) / tau_s).exp() } else { 0.0 };
            let samples = time.iter().map(|t| 3.0 + step(*t) + normal.sample(&mut random)).collect();
            let found = step_responses(&[(time, samples)], 0.0).unwrap()[0];
            let within = |[value, u]: Estimate, truth: f64| usize::from((value - truth).abs() < 1.96 * u);
            first += usize::from(found.second_order.is_none());
            covered[0] += within(found.delay_s, delay_s);
            covered[1] += within(found.bandwidth_hz, 1.0 / (2.0 * PI * tau_s));
        }
        assert!(first >= 45 && covered.iter().all(|n| *n >= 50), "{first} of first order, {covered:?} of 60");
    }

    #[test]
    fn a_mount_that_rings_at_55_hz_is_found() {
        // A leaf stage with a 55 Hz lateral mode.
        let time: Vec<f64> = (0..1000).map(|i| f64::from(i) * 1e-3).collect();
        let x: Vec<f64> = time
            .iter()
            .enumerate()
            .map(|(i, t)| {
                let noise = [0.01, -0.01, -0.01, 0.01, 0.01, -0.01][i % 6];
                3.0 + (-0.02 * 2.0 * PI * 55.0 * t).exp() * (2.0 * PI * 55.0 * t).cos() + noise
            })
            .collect();
        let found = ring_down(&time, &x).unwrap();
        assert!((found.frequency_hz[0] - 55.0).abs() < 3.0 * found.frequency_hz[1] + 0.01, "{found:?}");
        assert!((found.damping_ratio[0] - 0.02).abs() < 1e-3);
    }
}
