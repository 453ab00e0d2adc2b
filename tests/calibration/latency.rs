//! Latency and clocks: withheld delays, bandwidths and drifts of the virtual sensor.

use crate::bench::{Coverage, TRIALS, seed};
use calibration::force::dynamics::step_response;
use calibration::latency::{channel_delay, clock};
use calibration::uncertainty::student::coverage_factor;
use realtime::ports::Nanos;
use sim::noise::Noise;
use sim::sensor::{Sensor, SensorConfig};

const TICK_S: f64 = 2.5e-5;
const EDGES: usize = 10;

#[test]
fn delays_and_clock_drift_are_covered_as_stated() {
    let (mut delay, mut drift) = (Coverage::default(), Coverage::default());
    for trial in 0..TRIALS {
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
            let event = tick + 800 + (draw.uniform() * every as f64) as u64;
            let (mut time, mut value) = (Vec::new(), Vec::new());
            while tick < event + 1_600 {
                tick += 1;
                let shown = sensor.feel(if tick < event { from } else { to }, 0.0);
                if tick.is_multiple_of(every) {
                    let sample = sensor.sample(shown, Nanos((tick as f64 * TICK_S * 1e9) as u64));
                    // It arrives one latency later. The event lies between two ticks.
                    time.push((tick as f64 - event as f64 + 0.5) * TICK_S + config.latency_s);
                    value.push(f64::from(sample.counts[0]));
                }
            }
            delays.push(step_response(&time, &value, 0.0).unwrap().delay_s[0]);
        }
        let found = channel_delay("force", &delays, 0.0).unwrap().delay;
        let half = coverage_factor(0.95, found.degrees_of_freedom) * found.standard_uncertainty;
        delay.add([found.value - half, found.value + half], config.latency_s);

        // Arrivals jitter with heavy tails, as those of a busy host do.
        let (mut host, mut device) = (Vec::new(), Vec::new());
        for i in 0..2_000u64 {
            let now = Nanos(i * 5_000_000);
            let sample = sensor.sample([0.0; 2], now);
            host.push(now.seconds() + config.latency_s + 2e-4 * draw.heavy(5.0));
            device.push(sample.device_time.seconds());
        }
        let found = clock::compare(&host, &device).unwrap();
        let half = coverage_factor(0.95, found.degrees_of_freedom) * found.rate_error[1];
        drift.add([found.rate_error[0] - half, found.rate_error[0] + half], config.clock_drift);
    }
    delay.judge("delay of the force channel");
    drift.judge("clock drift");
}
