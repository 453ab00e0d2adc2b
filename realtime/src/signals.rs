//! What a rig's instruments deliver: readings and states, each with its time; a missing one is a [`NoData`].
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use models::PeakToPeak;
use serde::{Deserialize, Serialize};

/// Monotonic time in nanoseconds from the start of the run. Never wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Nanos(pub u64);

impl Nanos {
    /// From seconds; negative values are zero.
    pub const fn from_seconds(s: f64) -> Self {
        Nanos((s * 1e9) as u64)
    }

    /// In seconds.
    pub const fn seconds(self) -> f64 {
        self.0 as f64 * 1e-9
    }

    /// The time since `earlier`; zero if `earlier` is later.
    pub const fn since(self, earlier: Nanos) -> Nanos {
        Nanos(self.0.saturating_sub(earlier.0))
    }

    /// This time moved on by a duration.
    pub const fn plus(self, duration: Nanos) -> Nanos {
        Nanos(self.0.saturating_add(duration.0))
    }
}

/// What an instrument says of the sample that it delivers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quality {
    /// Nothing to remark.
    #[default]
    Good,
    /// Usable, with a remark (device warning, degraded link).
    Degraded,
    /// At the end of the range: the true value may be larger.
    Saturated,
}

/// One sample of one channel, with what is needed to trust it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// Calibrated value in SI units.
    #[serde(with = "crate::number")]
    pub value: f64,
    /// What the instrument sent, in its own counts.
    pub raw: i64,
    /// When the sample was taken: arrival less the stated latency, or the device's time mapped to the loop's.
    pub taken_at: Nanos,
    /// The instrument's sample counter, or the driver's count of distinct samples.
    pub sequence: u32,
    /// What the instrument says of it.
    pub quality: Quality,
}

impl Sample {
    /// Age of the sample at `now`.
    pub const fn age(&self, now: Nanos) -> Nanos {
        now.since(self.taken_at)
    }
}

/// Why there is no reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum NoData {
    /// Nothing has arrived since the port was opened.
    #[error("nothing has arrived yet")]
    NeverRead,
    /// The link is down; the driver is reconnecting.
    #[error("the link is down")]
    Disconnected,
    /// The instrument does not have this channel.
    #[error("the instrument has no such channel")]
    NotFitted,
    /// The instrument declared its sample invalid, or the value is not finite.
    #[error("the instrument declared its sample invalid")]
    Invalid,
    /// The answer failed its checks (CRC, function code, length, range).
    #[error("the answer failed its checks")]
    Corrupt,
}

/// A channel's latest reading, or why there is none.
pub type Channel = Result<Sample, NoData>;

/// What a force sensor delivers. The two axes may come from two instruments: each has its own time and sequence.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Forces {
    /// Lateral force in N, signed in the sensor's frame.
    pub lateral: Channel,
    /// Normal force in N, positive in compression.
    pub normal: Channel,
}

impl Forces {
    /// Both axes missing for the same reason.
    pub const fn missing(reason: NoData) -> Self {
        Forces { lateral: Err(reason), normal: Err(reason) }
    }
}

/// What the amplifier says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AmplifierState {
    /// Peak-to-peak amplitude as the amplifier (or a plate sensor behind it) measures it, in m.
    pub amplitude: Channel,
    /// Set-point that the amplifier echoes.
    pub echoed_amplitude: PeakToPeak,
    /// Frequency that the amplifier echoes, in Hz.
    #[serde(with = "crate::number")]
    pub echoed_frequency_hz: f64,
    /// Whether its output is on.
    pub output_on: bool,
    /// Whether its own heartbeat watchdog has switched it off.
    pub watchdog_tripped: bool,
    /// Whether it reports a fault of its own.
    pub fault: bool,
    /// Amplifier or plate temperature in degrees Celsius.
    pub temperature_c: Channel,
    /// When this state was taken.
    pub taken_at: Nanos,
    /// Count of states.
    pub sequence: u32,
}

/// What the stage says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageState {
    /// Position along the stroke in m.
    #[serde(with = "crate::number")]
    pub position_m: f64,
    /// Measured velocity in m/s, signed.
    #[serde(with = "crate::number")]
    pub velocity_m_s: f64,
    /// Whether it is on a limit of its travel.
    pub at_limit: bool,
    /// Whether it reports a fault of its own.
    pub fault: bool,
    /// When this state was taken.
    pub taken_at: Nanos,
    /// Count of states.
    pub sequence: u32,
}

/// The command to the second switch-off channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SupplyCommand {
    /// Open the amplifier's supply: its output is dead whatever its electronics want.
    #[default]
    Cut,
    /// Close it again.
    Restore,
}

/// What the second switch-off channel says of itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SupplyState {
    /// Whether the supply is cut, as read back from the switch (a mirror contact or its output), never as commanded.
    pub cut: bool,
    /// When this was read.
    pub taken_at: Nanos,
    /// Count of readings.
    pub sequence: u32,
}

/// One safety contact. Closed is the safe state of each, so that a broken wire is the unsafe one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SafetyContact {
    /// Whether the contact is closed.
    pub closed: bool,
    /// When this was read.
    pub taken_at: Nanos,
    /// Count of readings.
    pub sequence: u32,
}

/// The safety contacts of a rig; each is [`NoData::NotFitted`] where the rig has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Contacts {
    /// Emergency stop: closed while it is not pressed.
    pub emergency_stop: Result<SafetyContact, NoData>,
    /// Guard or cover: closed while it is shut.
    pub interlock: Result<SafetyContact, NoData>,
    /// Dead-man (enabling) device: closed while it is held.
    pub dead_man: Result<SafetyContact, NoData>,
}

impl Contacts {
    /// A rig without any.
    pub const ABSENT: Contacts = Contacts::missing(NoData::NotFitted);

    /// All missing for the same reason.
    pub const fn missing(reason: NoData) -> Self {
        Contacts { emergency_stop: Err(reason), interlock: Err(reason), dead_man: Err(reason) }
    }
}

impl Default for Contacts {
    fn default() -> Self {
        Self::ABSENT
    }
}
