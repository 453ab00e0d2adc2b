//! Latency and clocks: withheld delays, bandwidths and drifts of the virtual sensor.

use crate::bench::{Coverage, seed, trials};
use crate::bound::{information, jacobian};
use calibration::force::dynamics::{second_order_step, step_responses};
use calibration::latency::{channel_delay, clock};
use calibration::uncertainty::student::coverage_factor;
use nalgebra::DMatrix;
use realtime::Nanos;
use sim::noise::Noise;
use sim::sensor::{Sensor, SensorConfig};

const TICK_S: f64 = 2.5e-5;
const EDGES: usize = 10;
/// Samples of an edge before and after its event.
const BEFORE: usize = 40;
const AFTER: usize = 80;
/// Jitter of the arrivals in s: Student's t with five degrees of freedom, scaled to this standard deviation.
const JITTER_S: f64 = 2e-4;

/// Cramer-Rao bound of the delay over all edges: delay, height and filter are common to them, the zero is each edge's own.
/// The readings err by white noise, its rounding and a wander (an Ornstein-Uhlenbeck process), in newtons.
fn delay_bound(c: &SensorConfig) -> f64 {
    let n = BEFORE + AFTER;
    let white = c.white_sd_n[0].powi(2) + c.count_n.powi(2) / 12.0;
    let covariance = DMatrix::from_fn(n, n, |i, k| {
        let apart = (i as f64 - k as f64).abs() * c.sample_period_s;
        c.wander_sd_n[0].powi(2) * (-apart / c.wander_time_s).exp() + if i == k { white } else { 0.0 }
    });
    let mut total = DMatrix::zeros(4, 4);
    for edge in 0..EDGES {
        // Where the event lies between two samples: evenly spread over the edges.
        let phase = (edge as f64 + 0.5) / EDGES as f64;
        let step = |b: &[f64]| {
            (0..n)
                .map(|i| {
                    let t = (i as f64 + phase - BEFORE as f64) * c.sample_period_s + c.latency_s;
                    b[4] + b[1] * second_order_step(t - b[0], b[2].exp(), b[3])
                })
                .collect()
        };
        let omega = 2.0 * std::f64::consts::PI * c.bandwidth_hz;
        let truth = [c.latency_s, 0.5, omega.ln(), std::f64::consts::FRAC_1_SQRT_2, 0.0];
        let own = information(&jacobian(step, &truth, &[1e-7, 1e-4, 1e-4, 1e-4, 1e-4]), &covariance);
        // The edge's own zero is eliminated (Schur's complement).
        let zero = own[(4, 4)];
        total += DMatrix::from_fn(4, 4, |i, k| own[(i, k)] - own[(i, 4)] * own[(4, k)] / zero);
    }
    total.try_inverse().expect("a step shows its delay")[(0, 0)].sqrt()
}

#[test]
fn delays_and_clock_drift_are_covered_as_stated() {
    let (mut delay, mut drift) = (Coverage::default(), Coverage::default());
    for trial in 0..trials() {
        let mut draw = Noise::new(seed(trial), "latency bench");
        let config = SensorConfig {
            latency_s: draw.between(0.3e-3, 4e-3),
            bandwidth_hz: draw.between(120.0, 300.0),
            white_sd_n: [2e-3; 2],
            clock_drift: draw.between(-50e-6, 50e-6),
            ..SensorConfig::default()
        };
        let every = (config.sample_period_s / TICK_S).round() as u64;
        let mut sensor = Sensor::new(config, TICK_S, seed(trial));
        let mut tick = 0u64;
        let mut delays = Vec::new();
        for edge in 0..EDGES {
            // A tap of 0.5 N on and off, at an instant that the samples know nothing of.
            let (from, to) = if edge % 2 == 0 { (0.0, 0.5) } else { (0.5, 0.0) };
            let event = tick + (BEFORE as u64) * every + (draw.uniform() * every as f64) as u64;
            let (mut time, mut value) = (Vec::new(), Vec::new());
            while tick < event + (AFTER as u64) * every {
                tick += 1;
                let shown = sensor.feel(if tick < event { from } else { to }, 0.0);
                if tick.is_multiple_of(every) {
                    let sample = sensor.sample(shown, Nanos((tick as f64 * TICK_S * 1e9) as u64));
                    // It arrives one latency later. The event lies between two ticks.
                    time.push((tick as f64 - event as f64 + 0.5) * TICK_S + config.latency_s);
                    value.push(f64::from(sample.counts[0]));
                }
            }
            delays.push(step_responses(&[(time, value)], 0.0).unwrap()[0].delay_s[0]);
        }
        let found = channel_delay("force", &delays, 0.0).unwrap().delay;
        let half = coverage_factor(0.95, found.degrees_of_freedom) * found.standard_uncertainty;
        let bound = delay_bound(&config);
        delay.add_with_bound([found.value - half, found.value + half], config.latency_s, half, bound);

        // Arrivals jitter with heavy tails, as those of a busy host do.
        let (mut host, mut device) = (Vec::new(), Vec::new());
        for i in 0..2_000u64 {
            let now = Nanos(i * 5_000_000);
            let sample = sensor.sample([0.0; 2], now);
            host.push(now.seconds() + config.latency_s + JITTER_S * draw.heavy(5.0));
            device.push(sample.device_time.seconds());
        }
        let found = clock::compare(&host, &device).unwrap();
        let half = coverage_factor(0.95, found.degrees_of_freedom) * found.rate_error[1];
        // Fisher information of a Student t's place: (nu + 1) / (nu + 3) of that of its scale, here 0.8 of its variance.
        let mean = host.iter().sum::<f64>() / host.len() as f64;
        let spread = host.iter().map(|h| (h - mean).powi(2)).sum::<f64>();
        let bound = JITTER_S * (0.8 / spread).sqrt();
        let interval = [found.rate_error[0] - half, found.rate_error[0] + half];
        drift.add_with_bound(interval, config.clock_drift, half, bound);
    }
    delay.judge("delay of the force channel");
    drift.judge("clock drift");
}
