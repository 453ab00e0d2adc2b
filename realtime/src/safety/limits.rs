//! The numbers: hard limits that no configuration can raise, and the soft limits of a setup.

use crate::ports::Nanos;
use models::quantity::PeakToPeak;
use serde::{Deserialize, Serialize};

/// Limits that are compiled in. A setup may only stay below them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HardLimits {
    /// N. The paper's sweeps end at 1 N; light touch exploration stays below 2 N, and 5 N leaves room for the
    /// inertia of a loading axis while it cannot bruise (ISO/TS 15066 allows 140 N quasi-static on a finger).
    pub normal_force_max_n: f64,
    /// N. Coulomb friction at the paper's largest `mu_0` (2) under the largest normal force.
    pub lateral_force_max_n: f64,
    /// The paper's sweeps end at 5 um; twice that bounds plate stress and emitted ultrasound.
    pub amplitude_max: PeakToPeak,
    /// Hz. The paper's range is 10 to 100 kHz; below 16 kHz the plate is audible at full drive.
    pub frequency_hz: (f64, f64),
    /// m/s. Ten times the paper's fastest slide.
    pub speed_max_m_s: f64,
    /// Degrees Celsius. EN ISO 13732-1: 1 min contact with bare metal burns from 51, 10 min from 48.
    pub temperature_max_c: f64,
    /// s of vibration on a human finger in one go.
    pub exposure_max_s: f64,
    /// Late cycles among the last thousand: beyond one in ten there is no control.
    pub late_cycles_max: u32,
    /// Late cycles in a row.
    pub late_in_a_row_max: u32,
}

/// The hard limits.
pub const HARD: HardLimits = HardLimits {
    normal_force_max_n: 5.0,
    lateral_force_max_n: 10.0,
    amplitude_max: PeakToPeak::from_metres(10e-6),
    frequency_hz: (5_000.0, 120_000.0),
    speed_max_m_s: 1.0,
    temperature_max_c: 48.0,
    exposure_max_s: 600.0,
    late_cycles_max: 100,
    late_in_a_row_max: 20,
};

/// When a channel counts as stale: a number of its own sample periods plus its stated latency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChannelTiming {
    /// The channel's own sample period.
    pub period: Nanos,
    /// What its maker or a calibration states as delay from event to delivery.
    pub latency: Nanos,
    /// How many periods may pass without a new sample.
    pub periods: u32,
}

impl ChannelTiming {
    /// The greatest age that is not stale.
    pub const fn age_limit(&self) -> Nanos {
        Nanos(self.period.0 * self.periods as u64 + self.latency.0)
    }
}

/// Times that the rules count in.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Period of the loop.
    pub cycle: Nanos,
    /// Lateral force channel.
    pub lateral: ChannelTiming,
    /// Normal force channel.
    pub normal: ChannelTiming,
    /// Amplifier state.
    pub amplifier: ChannelTiming,
    /// Stage state.
    pub stage: ChannelTiming,
    /// How long a command may wait on its way before it must not be sent.
    pub command_expiry: Nanos,
    /// Time constant of the plate's ring-up and ring-down, `Q / (pi f)`.
    pub ring_time: Nanos,
}

/// The limits of a setup. Made only by [`Limits::checked`] (reading them back included), so they never exceed [`HARD`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self")]
#[non_exhaustive]
pub struct Limits {
    /// Largest normal force in N.
    pub normal_force_max_n: f64,
    /// Largest lateral force in N, either sign.
    pub lateral_force_max_n: f64,
    /// A change of either force between two samples that no finger can make, in N: a single one is a spike.
    pub force_step_max_n: f64,
    /// Largest lasting rate of change of the normal force in N/s.
    pub force_rate_max_n_s: f64,
    /// Largest amplitude.
    pub amplitude_max: PeakToPeak,
    /// Largest rate of rise of the measured amplitude in m/s.
    pub amplitude_rate_max_m_s: f64,
    /// Lowest and highest drive frequency in Hz.
    pub frequency_hz: (f64, f64),
    /// Largest speed in m/s.
    pub speed_max_m_s: f64,
    /// Ends of the travel in m.
    pub travel_m: (f64, f64),
    /// Highest temperature in degrees Celsius.
    pub temperature_max_c: f64,
    /// Whether a temperature channel is fitted: if so, losing it is a trip.
    pub temperature_fitted: bool,
    /// Equal raw samples in a row that count as frozen, 20 to 1000 (from the noise: `ceil(ln 1e-9 / ln p_equal)`).
    pub frozen_after: u32,
    /// A human finger is in the rig: dead-man input and exposure limit apply.
    pub human_contact: bool,
    /// Longest vibration on a human finger in one go, in s.
    pub exposure_max_s: f64,
    /// Cycles among the last thousand that may begin more than a period late.
    pub late_cycles_max: u32,
    /// Late cycles in a row that are one too many.
    pub late_in_a_row_max: u32,
    /// Timing of the channels.
    pub timing: Timing,
}

/// A limit that a setup may not have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum LimitError {
    /// Above what is compiled in.
    #[error("{name} = {value} is above the hard limit {hard}, which no setup can raise")]
    AboveHard {
        /// Name of the limit, with its unit.
        name: &'static str,
        /// What the setup says.
        value: f64,
        /// The hard limit.
        hard: f64,
    },
    /// Not a usable number.
    #[error("{name} = {value}: {needed} is needed")]
    Unusable {
        /// Name of the limit, with its unit.
        name: &'static str,
        /// What the setup says.
        value: f64,
        /// What would be accepted.
        needed: &'static str,
    },
}

impl Serialize for Limits {
    fn serialize<S: serde::Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        Limits::serialize(self, to)
    }
}

impl<'a> Deserialize<'a> for Limits {
    fn deserialize<D: serde::Deserializer<'a>>(from: D) -> Result<Self, D::Error> {
        Limits::deserialize(from)?.checked().map_err(serde::de::Error::custom)
    }
}

impl Limits {
    /// Limits for the paper's ranges and a 1 kHz loop: a starting point for a setup and for tests.
    pub const fn paper(cycle: Nanos) -> Self {
        let fast = ChannelTiming { period: cycle, latency: Nanos(2_000_000), periods: 3 };
        Limits {
            normal_force_max_n: 1.5,
            lateral_force_max_n: 2.0,
            force_step_max_n: 0.5,
            force_rate_max_n_s: 60.0,
            amplitude_max: PeakToPeak::from_metres(6e-6),
            amplitude_rate_max_m_s: 20e-3,
            frequency_hz: (10_000.0, 100_000.0),
            speed_max_m_s: 0.25,
            travel_m: (-0.06, 0.06),
            temperature_max_c: 45.0,
            temperature_fitted: true,
            frozen_after: 50,
            human_contact: false,
            exposure_max_s: 60.0,
            late_cycles_max: 10,
            late_in_a_row_max: 3,
            timing: Timing {
                cycle,
                lateral: fast,
                normal: fast,
                amplifier: ChannelTiming { period: cycle, latency: Nanos(4_000_000), periods: 5 },
                stage: ChannelTiming { period: cycle, latency: Nanos(4_000_000), periods: 5 },
                command_expiry: Nanos(2 * cycle.0),
                ring_time: Nanos(2_500_000),
            },
        }
    }

    /// These limits, if they are usable and none is above its hard limit.
    ///
    /// # Errors
    /// The first limit that is not, by name.
    pub fn checked(self) -> Result<Self, LimitError> {
        let hard = [
            ("normal_force_max_n", self.normal_force_max_n, HARD.normal_force_max_n),
            ("lateral_force_max_n", self.lateral_force_max_n, HARD.lateral_force_max_n),
            ("amplitude_max_pp_m", self.amplitude_max.metres(), HARD.amplitude_max.metres()),
            ("frequency_max_hz", self.frequency_hz.1, HARD.frequency_hz.1),
            ("speed_max_m_s", self.speed_max_m_s, HARD.speed_max_m_s),
            ("temperature_max_c", self.temperature_max_c, HARD.temperature_max_c),
            ("exposure_max_s", self.exposure_max_s, HARD.exposure_max_s),
            ("late_cycles_max", f64::from(self.late_cycles_max), f64::from(HARD.late_cycles_max)),
            ("late_in_a_row_max", f64::from(self.late_in_a_row_max), f64::from(HARD.late_in_a_row_max)),
        ];
        for (name, value, hard) in hard {
            positive(name, value)?;
            if value > hard {
                return Err(LimitError::AboveHard { name, value, hard });
            }
        }
        positive("force_step_max_n", self.force_step_max_n)?;
        positive("force_rate_max_n_s", self.force_rate_max_n_s)?;
        positive("amplitude_rate_max_m_s", self.amplitude_rate_max_m_s)?;
        let refuse = |name, value, needed| Err(LimitError::Unusable { name, value, needed });
        let (low, high) = self.frequency_hz;
        if !(low >= HARD.frequency_hz.0 && low < high) {
            return refuse("frequency_min_hz", low, "at least the hard limit and less than frequency_max_hz");
        }
        let (left, right) = self.travel_m;
        if !(left.is_finite() && right.is_finite() && left < right) {
            return refuse("travel_min_m", left, "a number below travel_max_m");
        }
        if !(20..=1000).contains(&self.frozen_after) {
            return refuse("frozen_after", f64::from(self.frozen_after), "a count from 20 to 1000");
        }
        if self.timing.cycle.0 == 0 {
            return refuse("cycle", 0.0, "a loop period above zero");
        }
        Ok(self)
    }
}

fn positive(name: &'static str, value: f64) -> Result<(), LimitError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(LimitError::Unusable { name, value, needed: "a finite number above zero" })
    }
}
