//! The ultrasonic amplifier: quantised set-points, an enable, a heartbeat watchdog, a supply relay.
//!
//! The watchdog is the amplifier's: when no command with a new heartbeat has come for its timeout it switches
//! the output off by itself and stays off until commanded off and on again. The supply relay is a second,
//! independent way to switch off: it works even where the amplifier refuses its enable.

use models::PeakToPeak;
use realtime::Nanos;
use serde::{Deserialize, Serialize};

/// What the amplifier is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AmplifierConfig {
    /// Step of the amplitude set-point, peak-to-peak (m).
    pub amplitude_step_m: f64,
    /// Step of the frequency set-point (Hz).
    pub frequency_step_hz: f64,
    /// Largest amplitude set-point taken, peak-to-peak (m); larger ones are clipped and echoed so.
    pub amplitude_max_m: f64,
    /// Lowest and highest frequency taken (Hz).
    pub frequency_range_hz: [f64; 2],
    /// Time constant with which its amplitude control follows the set-point (s); 0: at once. 'Off' is at once
    /// in any case.
    pub response_s: f64,
    /// Heartbeat timeout of its watchdog (s).
    pub watchdog_s: f64,
    /// Relative noise of the amplitude read back (-).
    pub readback_relative_sd: f64,
    /// Absolute noise of the amplitude read back, peak-to-peak (m).
    pub readback_sd_m: f64,
    /// Time between two states that it publishes (s).
    pub state_period_s: f64,
    /// Temperature at which it reports a fault and switches off (deg C).
    pub temperature_max_c: f64,
    /// Warming over the plate's warming (-).
    pub warming_ratio: f64,
    /// Fault: the enable input is ignored once the output is on; only the supply relay stops it.
    pub refuses_off: bool,
    /// Fault: the contact of the supply relay is welded; it does not open.
    pub relay_welded: bool,
}

impl Default for AmplifierConfig {
    fn default() -> Self {
        Self {
            amplitude_step_m: 1e-9,
            frequency_step_hz: 1.0,
            amplitude_max_m: 8e-6,
            frequency_range_hz: [10_000.0, 100_000.0],
            response_s: 0.0,
            watchdog_s: 0.05,
            readback_relative_sd: 1e-3,
            readback_sd_m: 1e-9,
            state_period_s: 1e-3,
            temperature_max_c: 70.0,
            warming_ratio: 1.5,
            refuses_off: false,
            relay_welded: false,
        }
    }
}

/// A set-point as the amplifier's inputs take it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplifierInput {
    /// Amplitude, peak-to-peak.
    pub amplitude: PeakToPeak,
    /// Frequency (Hz); not positive: the frequency stays as it is.
    pub frequency_hz: f64,
    /// Output on.
    pub enable: bool,
    /// Heartbeat: any change feeds the watchdog.
    pub heartbeat: u32,
}

/// What the amplifier publishes of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmplifierStatus {
    /// Amplitude as it measures it (m), peak-to-peak.
    pub measured_pp_m: f64,
    /// The same in its own counts (amplitude steps).
    pub measured_counts: i64,
    /// Set-point after quantisation.
    pub echoed_amplitude: PeakToPeak,
    /// Frequency after quantisation (Hz).
    pub echoed_frequency_hz: f64,
    /// Output on.
    pub output_on: bool,
    /// Its watchdog has switched it off.
    pub watchdog_tripped: bool,
    /// It has a fault of its own.
    pub fault: bool,
    /// The supply relay is closed.
    pub supply_closed: bool,
    /// Temperature (deg C).
    pub temperature_c: f64,
    /// When this was taken, in the world's time.
    pub taken_at: Nanos,
    /// Count of states.
    pub sequence: u32,
}

/// The amplifier's state.
#[derive(Clone, Debug)]
pub struct Amplifier {
    config: AmplifierConfig,
    amplitude: PeakToPeak,
    frequency_hz: f64,
    output_on: bool,
    heartbeat: Option<u32>,
    fed_at: Nanos,
    watchdog_tripped: bool,
    fault: bool,
    /// The supply relay is closed, by its mirror contact; the output then stays off until it is commanded on
    /// again.
    pub supply_closed: bool,
    temperature_c: f64,
    /// Drive that its amplitude control has reached (m), and when.
    drive_m: f64,
    stepped_at: Nanos,
}

impl Amplifier {
    /// An amplifier with its output off.
    pub fn new(config: AmplifierConfig, temperature_c: f64) -> Self {
        let middle = 27_500.0_f64.clamp(config.frequency_range_hz[0], config.frequency_range_hz[1]);
        Self {
            config,
            amplitude: PeakToPeak::ZERO,
            frequency_hz: middle,
            output_on: false,
            heartbeat: None,
            fed_at: Nanos(0),
            watchdog_tripped: false,
            fault: false,
            supply_closed: true,
            temperature_c,
            drive_m: 0.0,
            stepped_at: Nanos(0),
        }
    }

    /// The set-point nearest to a wanted one that this amplifier can do.
    pub fn quantise(config: &AmplifierConfig, amplitude: PeakToPeak, frequency_hz: f64) -> (PeakToPeak, f64) {
        let clipped = amplitude.metres().clamp(0.0, config.amplitude_max_m);
        let [low, high] = config.frequency_range_hz;
        let step = config.frequency_step_hz;
        (
            PeakToPeak::from_metres((clipped / config.amplitude_step_m).round() * config.amplitude_step_m),
            (frequency_hz.clamp(low, high) / step).round() * step,
        )
    }

    /// Takes a command at a time. A value that is not finite leaves that set-point as it was.
    pub fn command(&mut self, input: AmplifierInput, now: Nanos) {
        if self.heartbeat != Some(input.heartbeat) {
            self.heartbeat = Some(input.heartbeat);
            self.fed_at = now;
        }
        let wanted = if input.amplitude.metres().is_finite() { input.amplitude } else { self.amplitude };
        let usable = input.frequency_hz.is_finite() && input.frequency_hz > 0.0;
        let frequency = if usable { input.frequency_hz } else { self.frequency_hz };
        (self.amplitude, self.frequency_hz) = Self::quantise(&self.config, wanted, frequency);
        if !input.enable {
            // 'Off': this also re-arms a tripped watchdog.
            self.watchdog_tripped = false;
            if !self.config.refuses_off {
                self.output_on = false;
            }
        } else if !self.watchdog_tripped && !self.fault && self.supply_closed {
            self.output_on = true;
        }
    }

    /// Opens the supply relay: the output is dead whatever the electronics want.
    pub fn cut_supply(&mut self) {
        if !self.config.relay_welded {
            self.supply_closed = false;
            self.output_on = false;
        }
    }

    /// Moves on to `now`; returns the drive (m peak-to-peak at resonance) and its frequency (Hz).
    pub fn step(&mut self, now: Nanos, room_c: f64, plate_warming_k: f64) -> (f64, f64) {
        if self.output_on && now.since(self.fed_at) > Nanos::from_seconds(self.config.watchdog_s) {
            // What refuses its enable refuses its own watchdog: only its supply switches it off.
            self.output_on = self.config.refuses_off;
            self.watchdog_tripped = true;
        }
        self.temperature_c = room_c + self.config.warming_ratio * plate_warming_k;
        if self.temperature_c > self.config.temperature_max_c {
            self.fault = true;
            self.output_on = false;
        }
        let dt = now.since(self.stepped_at).seconds();
        self.stepped_at = now;
        let wanted = self.amplitude.metres();
        let missing = if self.config.response_s > 0.0 {
            (wanted - self.drive_m) * (-dt / self.config.response_s).exp()
        } else {
            0.0
        };
        self.drive_m = if self.output_on { wanted - missing } else { 0.0 };
        (self.drive_m, self.frequency_hz)
    }

    /// Its state, with an amplitude measured with the given standard normal error.
    pub fn status(&self, plate_pp_m: f64, error: f64, now: Nanos, sequence: u32) -> AmplifierStatus {
        let c = &self.config;
        let sd = (c.readback_relative_sd * plate_pp_m).hypot(c.readback_sd_m);
        let counts = ((plate_pp_m + sd * error).max(0.0) / c.amplitude_step_m).round();
        AmplifierStatus {
            measured_pp_m: counts * c.amplitude_step_m,
            measured_counts: counts as i64,
            echoed_amplitude: self.amplitude,
            echoed_frequency_hz: self.frequency_hz,
            output_on: self.output_on,
            watchdog_tripped: self.watchdog_tripped,
            fault: self.fault,
            supply_closed: self.supply_closed,
            temperature_c: self.temperature_c,
            taken_at: now,
            sequence,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on(heartbeat: u32) -> AmplifierInput {
        AmplifierInput {
            amplitude: PeakToPeak::from_metres(1.234_567e-6),
            frequency_hz: 27_500.4,
            enable: true,
            heartbeat,
        }
    }

    #[test]
    fn the_watchdog_drops_the_drive_and_stays_dropped_until_told_off() {
        let mut amplifier = Amplifier::new(AmplifierConfig { watchdog_s: 0.005, ..Default::default() }, 22.0);
        amplifier.command(on(1), Nanos(0));
        assert!(amplifier.step(Nanos(5_000_000), 22.0, 0.0).0 > 0.0);
        // The same heartbeat again feeds nothing.
        amplifier.command(on(1), Nanos(5_000_000));
        assert_eq!(amplifier.step(Nanos(5_000_001), 22.0, 0.0).0, 0.0);
        amplifier.command(on(2), Nanos(6_000_000));
        assert_eq!(amplifier.step(Nanos(6_000_000), 22.0, 0.0).0, 0.0, "a late heartbeat does not switch on");
        amplifier.command(AmplifierInput { enable: false, ..on(3) }, Nanos(7_000_000));
        amplifier.command(on(4), Nanos(8_000_000));
        assert!(amplifier.step(Nanos(8_000_000), 22.0, 0.0).0 > 0.0);
    }

    /// A first-order control: 63 % after its time constant, and 'off' at once.
    #[test]
    fn a_slow_amplitude_control_follows_with_its_time_constant() {
        let config = AmplifierConfig { response_s: 4e-3, watchdog_s: 1.0, ..Default::default() };
        let mut amplifier = Amplifier::new(config, 22.0);
        amplifier.step(Nanos(0), 22.0, 0.0);
        amplifier.command(on(1), Nanos(0));
        let reached = (1..=40).map(|k| amplifier.step(Nanos(k * 100_000), 22.0, 0.0).0).last().unwrap();
        let expected = 1.235e-6 * (1.0 - (-1.0f64).exp());
        assert!((reached / expected - 1.0).abs() < 1e-9, "{reached} {expected}");
        amplifier.command(AmplifierInput { enable: false, ..on(2) }, Nanos(4_000_000));
        assert_eq!(amplifier.step(Nanos(4_100_000), 22.0, 0.0).0, 0.0);
    }

    #[test]
    fn set_points_are_quantised_clipped_and_echoed() {
        let mut amplifier = Amplifier::new(AmplifierConfig::default(), 22.0);
        amplifier.command(on(1), Nanos(0));
        let status = amplifier.status(0.0, 0.0, Nanos(0), 0);
        assert!((status.echoed_amplitude.metres() - 1.235e-6).abs() < 1e-15);
        assert_eq!(status.echoed_frequency_hz, 27_500.0);
        amplifier.command(AmplifierInput { amplitude: PeakToPeak::from_metres(1.0), ..on(2) }, Nanos(0));
        assert!((amplifier.status(0.0, 0.0, Nanos(0), 0).echoed_amplitude.metres() - 8e-6).abs() < 1e-15);
        amplifier.command(AmplifierInput { amplitude: PeakToPeak::from_metres(f64::NAN), ..on(3) }, Nanos(0));
        assert!(amplifier.status(0.0, 0.0, Nanos(0), 0).echoed_amplitude.metres().is_finite());
    }

    #[test]
    fn the_supply_relay_works_where_the_enable_does_not() {
        let mut amplifier = Amplifier::new(AmplifierConfig { refuses_off: true, ..Default::default() }, 22.0);
        amplifier.command(on(1), Nanos(0));
        amplifier.command(AmplifierInput { enable: false, ..on(2) }, Nanos(1));
        assert!(amplifier.step(Nanos(2), 22.0, 0.0).0 > 0.0, "it refuses off");
        assert!(amplifier.step(Nanos(2_000_000_000), 22.0, 0.0).0 > 0.0, "and its watchdog");
        amplifier.cut_supply();
        amplifier.command(on(3), Nanos(3));
        assert_eq!(amplifier.step(Nanos(3), 22.0, 0.0).0, 0.0);
    }

    #[test]
    fn over_temperature_is_a_latched_fault() {
        let mut amplifier = Amplifier::new(AmplifierConfig::default(), 22.0);
        amplifier.command(on(1), Nanos(0));
        assert_eq!(amplifier.step(Nanos(1), 22.0, 40.0).0, 0.0);
        amplifier.command(on(2), Nanos(2));
        assert_eq!(amplifier.step(Nanos(2), 22.0, 0.0).0, 0.0);
    }
}
