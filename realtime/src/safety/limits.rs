//! The numbers: hard limits that no configuration can raise, and the soft limits of a setup.

use crate::signals::Nanos;
use models::PeakToPeak;
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
    /// Missed deadlines among the last thousand: beyond one in ten there is no control.
    pub late_cycles_max: u32,
    /// Missed deadlines in a row: from fifty on the loop counts as suspended.
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
    late_in_a_row_max: 50,
};

/// A value that must lie between two others, both permitted.
struct Range {
    low: f64,
    high: f64,
    /// Why not less, why not more.
    why: &'static str,
}

/// Ranges of what a setup states besides: beyond them a rule would be switched off, or could never be met.
mod range {
    use super::{HARD, Range};

    const fn range(low: f64, high: f64, why: &'static str) -> Range {
        Range { low, high, why }
    }

    pub const FORCE_STEP_N: Range =
        range(0.01, HARD.normal_force_max_n, "a larger step is an overforce, a smaller one is noise");
    pub const FORCE_RATE_N_S: Range = range(1.0, 500.0, "500 N/s reach the hard limit of 5 N in 10 ms");
    pub const AMPLITUDE_RATE_M_S: Range =
        range(1e-6, 0.1, "0.1 m/s reach the hard limit of 10 \u{b5}m in 0.1 ms");
    pub const TRAVEL_M: Range = range(-0.5, 0.5, "a bench-top stage");
    pub const STROKE_M: Range = range(1e-3, 1.0, "a shorter travel has no room for a pass");
    pub const FROZEN: Range =
        range(20.0, 1000.0, "fewer repeats come by chance, more are a second of a dead sensor at 1 kHz");
    pub const REST_S: Range = range(10.0, 3600.0, "a shorter pause is no rest");
    pub const DUTY: Range = range(1e-3, 0.5, "share of an hour: a finger rests half the time");
    pub const DOSE_M2_S: Range =
        range(1e-3, 100.0, "100 m2/s are a quarter of an hour at 5 \u{b5}m peak-to-peak and 30 kHz");
    pub const CYCLE_S: Range = range(2.5e-4, 0.1, "the loop runs at 10 to 4000 Hz");
    pub const FORCE_PERIOD_S: Range =
        range(1e-5, 0.05, "a force sensor slower than 20 samples a second shows an overforce too late");
    pub const STATE_PERIOD_S: Range =
        range(1e-5, 0.1, "a state slower than 10 a second shows a refused set-point too late");
    pub const LATENCY_S: Range = range(0.0, 0.05, "an amplifier's own watchdog waits no longer than 0.05 s");
    pub const PERIODS: Range = range(1.0, 5.0, "periods that a channel may be silent");
    pub const RING_S: Range = range(
        1e-5,
        0.05,
        "Q / (pi f): a quality factor of 1500 at 10 kHz rings for 0.05 s, and a plate no longer",
    );
}

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
    /// 50 readings a second with 20 ms of latency: a relay's or a contact's channel by default.
    pub const SLOW: ChannelTiming =
        ChannelTiming { period: Nanos(20_000_000), latency: Nanos(20_000_000), periods: 3 };

    /// Whether a stamp is neither older than the age limit nor as far ahead of the loop's time.
    pub const fn is_fresh(&self, taken_at: Nanos, now: Nanos) -> bool {
        let limit = self.age_limit().0;
        now.since(taken_at).0 <= limit && taken_at.since(now).0 <= limit
    }

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
    /// The second switch-off channel's state.
    #[serde(default = "slow")]
    pub supply: ChannelTiming,
    /// The safety contacts.
    #[serde(default = "slow")]
    pub contacts: ChannelTiming,
    /// How long a command may wait on its way before it must not be sent.
    pub command_expiry: Nanos,
    /// Time constant of the plate's ring-up and ring-down, `Q / (pi f)`.
    pub ring_time: Nanos,
}

const fn slow() -> ChannelTiming {
    ChannelTiming::SLOW
}

const fn rest_by_default() -> f64 {
    60.0
}

const fn duty_by_default() -> f64 {
    0.25
}

const fn dose_by_default() -> f64 {
    25.0
}

const fn yes() -> bool {
    true
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
    /// Equal raw amplitudes in a row, while driven, that count as frozen; `None` where the readback has no
    /// noise to be frozen against: then only a new set-point shows it (SR-08, SR-22).
    pub amplitude_frozen_after: Option<u32>,
    /// A human finger is in the rig: second channel, emergency stop, dead-man device and exposure limits apply.
    pub human_contact: bool,
    /// A key held at the terminal may stand for a dead-man device that is not fitted: for trials.
    #[serde(default)]
    pub dead_man_key: bool,
    /// Longest vibration on a human finger in one go, in s.
    pub exposure_max_s: f64,
    /// Rest in s that ends a go.
    #[serde(default = "rest_by_default")]
    pub exposure_rest_s: f64,
    /// Largest share of the last hour that may be vibrated on a human finger.
    #[serde(default = "duty_by_default")]
    pub exposure_duty_max: f64,
    /// Largest integral of the squared rms velocity of the plate over the last hour on a human finger, in m2/s.
    #[serde(default = "dose_by_default")]
    pub exposure_dose_max_m2_s: f64,
    /// Whether the amplifier switches off by itself when its heartbeat stands still.
    #[serde(default = "yes")]
    pub amplifier_watchdog: bool,
    /// Whether the second channel opens by itself when its heartbeat stands still.
    #[serde(default)]
    pub supply_watchdog: bool,
    /// Whether the setup declares a second channel: then it is missed where the rig shows none.
    #[serde(default)]
    pub supply_required: bool,
    /// Whether the stage applies the commanded load; not where weights load the finger.
    #[serde(default = "yes")]
    pub load_commanded: bool,
    /// Deadlines among the last thousand that may be missed.
    pub late_cycles_max: u32,
    /// Missed deadlines in a row that are one too many.
    pub late_in_a_row_max: u32,
    /// Timing of the channels.
    pub timing: Timing,
}

/// A limit that a setup may not have.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum LimitError {
    /// Above what is compiled in.
    #[error("{name} = {value} is above the hard limit {hard}, which no setup can raise")]
    AboveHard { name: &'static str, value: f64, hard: f64 },
    /// Not a usable number.
    #[error("{name} = {value}: {needed} is needed")]
    Unusable { name: &'static str, value: f64, needed: &'static str },
    /// Outside its hard range.
    #[error("{name} = {value}: {low} to {high} is permitted ({why}), and no setup can widen that")]
    OutOfRange { name: &'static str, value: f64, low: f64, high: f64, why: &'static str },
}

impl LimitError {
    /// Name of the limit, as a setup calls it.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::AboveHard { name, .. } | Self::Unusable { name, .. } | Self::OutOfRange { name, .. } => {
                name
            }
        }
    }
}

impl Range {
    fn check(&self, name: &'static str, value: f64) -> Result<(), LimitError> {
        let Range { low, high, why } = *self;
        let outside = LimitError::OutOfRange { name, value, low, high, why };
        if value >= low && value <= high { Ok(()) } else { Err(outside) }
    }
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
            amplitude_frozen_after: Some(200),
            human_contact: false,
            dead_man_key: false,
            exposure_max_s: 60.0,
            exposure_rest_s: rest_by_default(),
            exposure_duty_max: duty_by_default(),
            exposure_dose_max_m2_s: dose_by_default(),
            amplifier_watchdog: true,
            supply_watchdog: false,
            supply_required: false,
            load_commanded: true,
            late_cycles_max: 10,
            late_in_a_row_max: 3,
            timing: Timing {
                cycle,
                lateral: fast,
                normal: fast,
                amplifier: ChannelTiming { period: cycle, latency: Nanos(4_000_000), periods: 5 },
                stage: ChannelTiming { period: cycle, latency: Nanos(4_000_000), periods: 5 },
                supply: ChannelTiming::SLOW,
                contacts: ChannelTiming::SLOW,
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
            if !(value.is_finite() && value > 0.0) {
                return Err(LimitError::Unusable { name, value, needed: "a finite number above zero" });
            }
            if value > hard {
                return Err(LimitError::AboveHard { name, value, hard });
            }
        }
        range::FORCE_STEP_N.check("force_step_max_n", self.force_step_max_n)?;
        range::FORCE_RATE_N_S.check("force_rate_max_n_s", self.force_rate_max_n_s)?;
        range::AMPLITUDE_RATE_M_S.check("amplitude_rate_max_m_s", self.amplitude_rate_max_m_s)?;
        let (low, high) = self.frequency_hz;
        if !(low >= HARD.frequency_hz.0 && low < high) {
            let needed = "at least the hard limit and less than frequency_max_hz";
            return Err(LimitError::Unusable { name: "frequency_min_hz", value: low, needed });
        }
        let (left, right) = self.travel_m;
        range::TRAVEL_M.check("travel_min_m", left)?;
        range::TRAVEL_M.check("travel_max_m", right)?;
        if right < left {
            let needed = "more than travel_min_m (the two ends are swapped)";
            return Err(LimitError::Unusable { name: "travel_max_m", value: right, needed });
        }
        range::STROKE_M.check("travel_max_m", right - left)?;
        range::FROZEN.check("frozen_after", f64::from(self.frozen_after))?;
        if let Some(after) = self.amplitude_frozen_after {
            range::FROZEN.check("amplitude_frozen_after", f64::from(after))?;
        }
        range::REST_S.check("exposure_rest_s", self.exposure_rest_s)?;
        range::DUTY.check("exposure_duty_max", self.exposure_duty_max)?;
        range::DOSE_M2_S.check("exposure_dose_max_m2_s", self.exposure_dose_max_m2_s)?;
        self.timing.check()?;
        Ok(self)
    }
}

impl Timing {
    /// Time from a new set-point until a fresh state must show it: five ring times, twice the state's age,
    /// two cycles.
    pub const fn response(&self) -> Nanos {
        Nanos(5 * self.ring_time.0 + 2 * self.amplifier.age_limit().0 + 2 * self.cycle.0)
    }

    /// The longest that a command may wait: two cycles, and 20 ms where a cycle is short. A link's thread on a general-purpose
    /// kernel is held up for milliseconds: with two cycles of 1 ms healthy rigs would drop their drive. An amplifier's own
    /// watchdog waits 50 ms, and a newer 'off' replaces an older 'on' at once, so 20 ms never outlive either.
    pub fn longest_expiry(cycle: Nanos) -> Nanos {
        Nanos((2 * cycle.0).max(20_000_000))
    }

    /// A ring time as a setup states it, in s.
    ///
    /// # Errors
    /// One that is outside its hard range.
    pub fn ring_time_of(seconds: f64) -> Result<Nanos, LimitError> {
        range::RING_S.check("plate_ring_time_s", seconds)?;
        Ok(Nanos::from_seconds(seconds))
    }

    fn check(&self) -> Result<(), LimitError> {
        range::CYCLE_S.check("cycle", self.cycle.seconds())?;
        let channels = [
            ("lateral", &self.lateral, range::FORCE_PERIOD_S),
            ("normal", &self.normal, range::FORCE_PERIOD_S),
            ("amplifier", &self.amplifier, range::STATE_PERIOD_S),
            ("stage", &self.stage, range::STATE_PERIOD_S),
            ("supply", &self.supply, range::STATE_PERIOD_S),
            ("contacts", &self.contacts, range::STATE_PERIOD_S),
        ];
        for (name, timing, period) in channels {
            // A loop slower than the channel sees it once a cycle.
            let high = period.high.max(self.cycle.seconds());
            Range { high, ..period }.check(name, timing.period.seconds())?;
            range::LATENCY_S.check(name, timing.latency.seconds())?;
            range::PERIODS.check(name, f64::from(timing.periods))?;
        }
        let (low, high) = (self.cycle.seconds(), Self::longest_expiry(self.cycle).seconds());
        let why = "a command lives for one cycle at least, and for two or 20 ms at most";
        Range { low, high, why }.check("command_expiry", self.command_expiry.seconds())?;
        range::RING_S.check("plate_ring_time_s", self.ring_time.seconds())
    }
}
