//! The known dynamics between a wanted friction and its measurement, each part by name in closed form.
//!
//! The plate's envelope rings up with `tau = Q/(pi f)`: a first-order low pass. The loop sets the amplitude
//! once a cycle, one cycle after it has read the position: a hold, and a delay. The sensor's filter is of
//! second order with `Q = 1/sqrt 2` (Butterworth). Delays shift what is rendered and take nothing from its
//! size.

use crate::setup::Setup;
use models::root::bisection;
use models::target::Feedback;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// The known dynamics of a rig at one drive frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Dynamics {
    /// Time constant of the plate's ring-up in s.
    pub ring_time_s: f64,
    /// Time constant of the amplifier's amplitude control in s, where a virtual rig states one.
    #[serde(default)]
    pub amplifier_s: f64,
    /// Period of the loop in s.
    pub cycle_s: f64,
    /// -3 dB bandwidth of the lateral channel in Hz, where its profile states one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_hz: Option<f64>,
    /// Time by which the lateral channel's samples are older than they arrive, in s.
    pub sensor_delay_s: f64,
    /// Lateral stiffness of the finger's pad in N/m, where it is known: friction rises by no more than this
    /// times the way.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pad_n_per_m: Option<f64>,
}

/// What one part leaves of a sine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChainStage {
    /// Name: `plate`, `loop`, `sensor`.
    pub name: String,
    /// Frequency in Hz at which it alone leaves 0.707; none where it never does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub corner_hz: Option<f64>,
    /// Its delay at low frequency in s.
    pub delay_s: f64,
}

/// What is left at -3 dB.
const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;

impl Dynamics {
    /// Of a setup at a drive frequency. A virtual rig states the quality factor of its plate; else the
    /// limit's ring time counts.
    pub fn of(setup: &Setup, frequency_hz: f64) -> Self {
        let timing = &setup.config.limits.timing;
        let world = setup.file.virtual_rig.as_ref().map(|rig| rig.world());
        let ring = world.as_ref().map(|world| world.plate.quality_factor / (PI * frequency_hz));
        Dynamics {
            ring_time_s: ring.unwrap_or(timing.ring_time.seconds()),
            amplifier_s: world.as_ref().map_or(0.0, |world| world.amplifier.response_s),
            cycle_s: timing.cycle.seconds(),
            sensor_hz: world.as_ref().map(|world| world.sensor.bandwidth_hz).or(setup.lateral_passband_hz()),
            sensor_delay_s: world.as_ref().map_or(timing.lateral.latency.seconds(), |w| w.sensor.latency_s),
            pad_n_per_m: world.map(|world| world.finger.pad_stiffness_n_per_m),
        }
    }

    /// What plate and amplifier leave of a small sine of this frequency in Hz.
    pub fn plate(&self, hz: f64) -> f64 {
        let left = |seconds: f64| 1.0 / (2.0 * PI * hz * seconds).hypot(1.0);
        left(self.ring_time_s) * left(self.amplifier_s)
    }

    /// The hold of the loop.
    pub fn hold(&self, hz: f64) -> f64 {
        let x = PI * hz * self.cycle_s;
        if x == 0.0 { 1.0 } else { (x.sin() / x).abs() }
    }

    /// The sensor's filter.
    pub fn sensor(&self, hz: f64) -> f64 {
        self.sensor_hz.map_or(1.0, |corner| 1.0 / (hz / corner).powi(2).hypot(1.0))
    }

    /// All of it: what the measurement shows of a small sine.
    pub fn gain(&self, hz: f64) -> f64 {
        self.plate(hz) * self.hold(hz) * self.sensor(hz)
    }

    /// The frequency in Hz at which `gain` has fallen to 0.707; none below half the loop's rate.
    fn corner(&self, gain: impl Fn(f64) -> f64) -> Option<f64> {
        let nyquist = 0.5 / self.cycle_s;
        (gain(nyquist) < HALF_POWER).then(|| bisection([0.0, nyquist], 64, |hz| gain(hz) > HALF_POWER))
    }

    /// The frequency in Hz where rendering ends: -3 dB of all parts.
    pub fn minus_3_db_hz(&self) -> Option<f64> {
        self.corner(|hz| self.gain(hz))
    }

    /// The parts, by name.
    pub fn parts(&self) -> Vec<ChainStage> {
        let part = |name: &str, corner_hz, delay_s| ChainStage { name: name.into(), corner_hz, delay_s };
        vec![
            part("plate", self.corner(|hz| self.plate(hz)), self.ring_time_s + self.amplifier_s),
            part("loop", self.corner(|hz| self.hold(hz)), 1.5 * self.cycle_s),
            part("sensor", self.corner(|hz| self.sensor(hz)), self.sensor_part_s()),
        ]
    }

    /// Delay of the sensor at low frequency in s.
    pub fn sensor_part_s(&self) -> f64 {
        self.sensor_delay_s + self.sensor_hz.map_or(0.0, |hz| std::f64::consts::SQRT_2 / (2.0 * PI * hz))
    }

    /// Phase lag in rad of all parts at a frequency in Hz.
    fn lag(&self, hz: f64) -> f64 {
        let w = 2.0 * PI * hz;
        let sensor = self.sensor_hz.map_or(0.0, |corner| {
            let x = hz / corner;
            (std::f64::consts::SQRT_2 * x).atan2(1.0 - x * x)
        });
        (w * self.ring_time_s).atan()
            + (w * self.amplifier_s).atan()
            + w * (1.5 * self.cycle_s + self.sensor_delay_s)
            + sensor
    }

    /// Gains of a feedback on the measured friction: its zero cancels the plate's ring-up, its integral
    /// part is half of what the remaining delay allows (internal model control: `1/(lambda + theta)` with
    /// `lambda = theta`; Rivera, Morari and Skogestad, Ind. Eng. Chem. Process Des. Dev. 25 (1986) 252), or
    /// as stated.
    pub fn feedback(&self, integral_per_s: Option<f64>) -> Feedback {
        let delay_s = self.delay_s() - self.ring_time_s;
        let integral_per_s = integral_per_s.unwrap_or(0.5 / delay_s);
        Feedback {
            proportional: integral_per_s * self.ring_time_s,
            integral_per_s,
            delay_cycles: (delay_s / self.cycle_s).round() as usize,
            ring_time_s: self.ring_time_s,
        }
    }

    /// Phase margin in degrees and gain margin (a factor) of a feedback on these dynamics.
    pub fn margins(&self, gains: &Feedback) -> [f64; 2] {
        let of = |hz: f64| {
            let w = 2.0 * PI * hz;
            let (p, i) = (gains.proportional, gains.integral_per_s / w);
            (p.hypot(i) * self.gain(hz), i.atan2(p) + self.lag(hz))
        };
        let nyquist = 0.5 / self.cycle_s;
        let crossover = bisection([1e-3, nyquist], 64, |hz| of(hz).0 > 1.0);
        let turned = bisection([1e-3, nyquist], 64, |hz| of(hz).1 < PI);
        [(PI - of(crossover).1).to_degrees(), 1.0 / of(turned).0]
    }

    /// Delay of all parts at low frequency in s.
    pub fn delay_s(&self) -> f64 {
        self.parts().iter().map(|part| part.delay_s).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A first-order low pass alone ends at `1/(2 pi tau)`, a Butterworth filter at its corner.
    #[test]
    fn the_corners_are_those_of_the_closed_forms() {
        let slow = Dynamics {
            ring_time_s: 5e-3,
            amplifier_s: 0.0,
            cycle_s: 1e-5,
            sensor_hz: None,
            sensor_delay_s: 0.0,
            pad_n_per_m: None,
        };
        let near = |found: Option<f64>, exact: f64| {
            assert!(found.is_some_and(|hz| (hz / exact - 1.0).abs() < 1e-3), "{found:?} {exact}");
        };
        near(slow.minus_3_db_hz(), 1.0 / (2.0 * PI * 5e-3));
        near(Dynamics { ring_time_s: 1e-7, sensor_hz: Some(200.0), ..slow }.minus_3_db_hz(), 200.0);
        near(Dynamics { ring_time_s: 1e-9, cycle_s: 1e-3, ..slow }.minus_3_db_hz(), 442.9);
    }

    /// An integrator with a delay `theta` and the gain `1/(2 theta)` has a phase margin of `90 - 28.6`
    /// degrees and a gain margin of pi (closed form): the proportional part cancels the plate.
    #[test]
    fn the_margins_are_those_of_an_integrator_with_a_delay() {
        let rig = Dynamics {
            ring_time_s: 2e-3,
            amplifier_s: 0.0,
            cycle_s: 1e-4,
            sensor_hz: None,
            sensor_delay_s: 4e-3,
            pad_n_per_m: None,
        };
        let [phase, gain] = rig.margins(&rig.feedback(None));
        assert!((phase - 61.35).abs() < 0.3 && (gain - PI).abs() < 0.02, "{phase} {gain}");
        let thin = rig.margins(&rig.feedback(Some(4.0 * rig.feedback(None).integral_per_s)));
        assert!(thin[1] < 1.0, "{thin:?}");
    }
}
