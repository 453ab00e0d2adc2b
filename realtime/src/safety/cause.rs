//! The description of a trip: its cause, the unit of its value, and what to do about it.

#![allow(clippy::disallowed_types, reason = "a trip is described for people beside the loop, never in it")]

use super::{RULES, Trip};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why the rig is, or would be, faulted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The rig has not been armed since it was started.
    StartUp,
    /// An operator, a signal or the end of a sweep stopped the rig.
    Stopped,
    /// The dead-man input was released in human-contact mode.
    DeadMan,
    /// Vibration on a human finger lasted too long.
    Exposure,
    /// Normal force above its limit.
    NormalOverforce,
    /// Lateral force above its limit.
    LateralOverforce,
    /// Normal force changes too fast.
    ForceRate,
    /// A lateral sample is older than its age limit, or there is none.
    LateralStale,
    /// A normal sample is older than its age limit, or there is none.
    NormalStale,
    /// Three cycles without a valid lateral sample.
    LateralInvalid,
    /// Three cycles without a valid normal sample.
    NormalInvalid,
    /// The lateral channel is at the end of its range.
    LateralSaturated,
    /// The normal channel is at the end of its range.
    NormalSaturated,
    /// The lateral channel repeats itself.
    LateralFrozen,
    /// The normal channel repeats itself.
    NormalFrozen,
    /// Five spikes within fifty cycles on either force.
    Noisy,
    /// The amplifier's state is older than its age limit, or there is none.
    AmplifierStale,
    /// The amplifier reports a fault.
    AmplifierFault,
    /// The amplifier's own watchdog has switched it off while it was to be on.
    AmplifierWatchdog,
    /// Measured amplitude above its limit.
    OverAmplitude,
    /// Measured amplitude above what was commanded.
    AmplitudeRunaway,
    /// Measured amplitude rises too fast.
    AmplitudeRate,
    /// The plate does not respond to the drive.
    DriveNoResponse,
    /// The amplifier echoes another set-point than it was given.
    EchoMismatch,
    /// The amplifier stays on although it was commanded off.
    RefusesOff,
    /// Too hot, or the temperature is not known where it must be.
    OverTemperature,
    /// The stage's state is older than its age limit, or there is none.
    StageStale,
    /// The stage reports a fault.
    StageFault,
    /// The stage is outside its travel.
    OverTravel,
    /// The loop missed too many deadlines in a row, or of a thousand.
    Overrun,
    /// A request beyond the limits.
    RequestRefused,
    /// The loop was held up for so long that nothing is known of the rig.
    Suspended,
    /// The stage does not move as commanded: stalled, or faster.
    StageNotFollowing,
    /// Most lateral samples are lost.
    LateralLossy,
    /// Most normal samples are lost.
    NormalLossy,
    /// The emergency stop is pressed, or nothing is known of it.
    EmergencyStop,
    /// The guard is open, or nothing is known of it.
    Interlock,
    /// The second switch-off channel does not follow its command, or nothing is known of it.
    SupplySwitch,
    /// What must be there to switch off is not fitted: 1 a second channel beside an amplifier without
    /// watchdog; with a human finger 2 a second channel, 3 an emergency stop, 4 a dead-man device.
    Unguarded,
    /// With a human finger: too large a share of the last hour was vibrated.
    ExposureDuty,
    /// With a human finger: the vibration of the last hour was too strong for its length.
    ExposureDose,
    /// The amplitude's channel is at the end of its range.
    AmplitudeSaturated,
    /// The amplitude's channel repeats itself while the plate is driven.
    AmplitudeFrozen,
    /// The normal force is not that of the load that the stage was commanded to apply, or to lift off.
    LoadImplausible,
}

impl Cause {
    /// The requirement whose rule latches it; none for [`Cause::StartUp`], which is no rule.
    pub fn requirement(self) -> Option<&'static str> {
        RULES.iter().find(|rule| rule.cause == self).map(|rule| rule.id)
    }

    /// What happened, in words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::StartUp => "the rig has not been armed since it was started",
            Self::Stopped => "stopped on request",
            Self::DeadMan => "the dead-man device was released",
            Self::Exposure => "vibration on the finger lasted too long without a rest",
            Self::NormalOverforce => "the normal force is above its limit",
            Self::LateralOverforce => "the lateral force is above its limit",
            Self::ForceRate => "the normal force changes too fast",
            Self::LateralStale => "the lateral force sensor sends no fresh samples",
            Self::NormalStale => "the normal force sensor sends no fresh samples",
            Self::LateralInvalid => "the lateral force sensor sends invalid values",
            Self::NormalInvalid => "the normal force sensor sends invalid values",
            Self::LateralSaturated => "the lateral force sensor is at the end of its range",
            Self::NormalSaturated => "the normal force sensor is at the end of its range",
            Self::LateralFrozen => "the lateral force sensor repeats one value",
            Self::NormalFrozen => "the normal force sensor repeats one value",
            Self::Noisy => "too many spikes in a force",
            Self::AmplifierStale => "the amplifier's state is too old",
            Self::AmplifierFault => "the amplifier reports a fault",
            Self::AmplifierWatchdog => "the amplifier's watchdog switched it off",
            Self::OverAmplitude => "the measured amplitude is above its limit",
            Self::AmplitudeRunaway => "the measured amplitude is above the commanded one",
            Self::AmplitudeRate => "the measured amplitude rises too fast",
            Self::DriveNoResponse => "the plate does not respond to the drive",
            Self::EchoMismatch => "the amplifier echoes another set-point than it was given",
            Self::RefusesOff => "the amplifier stays on after 'off'",
            Self::OverTemperature => "too hot, or the temperature is unknown",
            Self::StageStale => "the stage's state is too old",
            Self::StageFault => "the stage reports a fault",
            Self::OverTravel => "the stage is outside its travel",
            Self::Overrun => "the loop missed too many deadlines",
            Self::RequestRefused => "a request is beyond the limits",
            Self::Suspended => "the computer stopped the loop for too long",
            Self::StageNotFollowing => "the stage does not follow its commanded speed",
            Self::LateralLossy => "the lateral force channel loses most of its samples",
            Self::NormalLossy => "the normal force channel loses most of its samples",
            Self::EmergencyStop => "the emergency stop is pressed, or its contact is not heard",
            Self::Interlock => "the guard is open, or its contact is not heard",
            Self::SupplySwitch => "the supply relay does not do what it is commanded",
            Self::Unguarded => "a guard that this rig needs is missing",
            Self::ExposureDuty => "the finger was vibrated for too large a share of the last hour",
            Self::ExposureDose => "the vibration of the last hour was too strong for the finger",
            Self::AmplitudeSaturated => "the amplitude sensor is at the end of its range",
            Self::AmplitudeFrozen => "the amplitude sensor repeats one value",
            Self::LoadImplausible => "the normal force is not the commanded load",
        }
    }

    /// What a person at the rig does about it, in one sentence or two.
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::StartUp => "Nothing is wrong: the rig waits to be armed.",
            Self::Stopped => {
                "Nothing is wrong: a stop was requested. Repeat the command with the same --out to resume."
            }
            Self::DeadMan => "Release the dead-man device, grip it again, and start the run again.",
            Self::Exposure => {
                "Take the finger off and rest as long as `exposure_rest_s` says; plan shorter passes."
            }
            Self::NormalOverforce => {
                "Lift the finger off and look at load, stage and sensor before it is loaded again."
            }
            Self::LateralOverforce => "Look for what holds the finger or the plate; ask for a smaller load.",
            Self::ForceRate => "Look for a blow or a loose sensor; load more slowly.",
            Self::LateralStale | Self::NormalStale => {
                "Look at the force sensor's cable and power, and at `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link."
            }
            Self::LateralInvalid | Self::NormalInvalid => {
                "Look at the force sensor: its values are no forces. `muprime doctor --setup` shows the link."
            }
            Self::LateralSaturated | Self::NormalSaturated => {
                "Unload and zero the force sensor, or use one with a larger range."
            }
            Self::LateralFrozen | Self::NormalFrozen => {
                "Switch the force sensor off and on: its value stands still. If its noise is below one count, raise `frozen_after`."
            }
            Self::Noisy => {
                "Look at the force sensor's cable, shield and ground; keep it away from the drive's cable."
            }
            Self::AmplifierStale => {
                "Look at the amplifier's cable and power, and at `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link."
            }
            Self::AmplifierFault => "Read the fault on the amplifier, remove its cause and reset it there.",
            Self::AmplifierWatchdog => {
                "The amplifier heard nothing for longer than its watchdog waits: look at its link and at what else runs on this machine."
            }
            Self::OverAmplitude | Self::AmplitudeRunaway => {
                "Look for a resonance, a wrong calibration or another controller; ask for less amplitude."
            }
            Self::AmplitudeRate => {
                "Look for a resonance or another controller; ask for smaller steps of amplitude."
            }
            Self::DriveNoResponse => {
                "Look at the plate's cable, at the amplitude's sensor and at the drive frequency: the plate is driven and does not vibrate."
            }
            Self::EchoMismatch => {
                "Find who else writes to the amplifier, and end it; if nobody does, the amplifier does not take its set-points."
            }
            Self::RefusesOff => {
                "Switch the amplifier's supply off by hand; use the amplifier no more until it has been repaired."
            }
            Self::OverTemperature => {
                "Let the plate and the amplifier cool; with no temperature shown, look at its sensor."
            }
            Self::StageStale => {
                "Look at the stage's cable and power, and at `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link."
            }
            Self::StageFault => "Read the fault on the stage, remove its cause and reset it there.",
            Self::OverTravel => {
                "Move the stage back between its ends by hand; look at `travel_min_m` and `travel_max_m`."
            }
            Self::Overrun => {
                "End what else runs on this machine and give the loop its rights: `muprime doctor` says which."
            }
            Self::RequestRefused => {
                "Ask for what the limits of the setup allow: `muprime check` shows the value and its place in the plan."
            }
            Self::Suspended => {
                "Let nothing stop this program or its machine during a run; `muprime doctor` shows how the machine stalls."
            }
            Self::StageNotFollowing => {
                "Find what blocks the stage or moves it from outside; check the stage's drive."
            }
            Self::LateralLossy | Self::NormalLossy => {
                "Look at the force sensor's link: most samples are lost. State the true rate as `rate_hz`."
            }
            Self::EmergencyStop => {
                "Make the rig safe, release the emergency stop and start the run again; if it was not pressed, look at its \
                 wire and its input."
            }
            Self::Interlock => {
                "Close the guard and start the run again; if it was closed, look at its wire and its input."
            }
            Self::SupplySwitch => {
                "Look at the relay in the supply, its mirror contact and their wires: it does not follow its commands."
            }
            Self::Unguarded => {
                "Fit what is missing and state it in the setup: [supply_relay], [safety_inputs]."
            }
            Self::ExposureDuty => {
                "Remove the finger: the hourly limit of vibration is reached. Resume after a rest."
            }
            Self::ExposureDose => {
                "Remove the finger: the hourly dose of vibration is reached. Resume after a rest, with less amplitude."
            }
            Self::AmplitudeSaturated => {
                "Ask for less amplitude, or set a larger range of the amplitude's sensor."
            }
            Self::AmplitudeFrozen => {
                "Look at the amplitude's sensor: its value stands still. If its noise is below one count, raise `amplitude_frozen_after`."
            }
            Self::LoadImplausible => {
                "Look at the loading axis and zero the force sensor: the normal force is not the requested load."
            }
        }
    }
}

/// Unit of a trip's value and bound, in the record by its symbol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum Unit {
    /// It is, or it is not: the numbers say nothing more than the cause. Records from before there were units read so.
    #[default]
    #[serde(rename = "")]
    Flag,
    /// Number of cycles, samples or states.
    #[serde(rename = "1")]
    Count,
    /// Share of what was due, 0 to 1.
    #[serde(rename = "share")]
    Share,
    /// Force.
    #[serde(rename = "N")]
    Newton,
    /// Rate of a force.
    #[serde(rename = "N/s")]
    NewtonPerSecond,
    /// Amplitude (peak-to-peak) or position.
    #[serde(rename = "m")]
    Metre,
    /// Speed, or rate of an amplitude.
    #[serde(rename = "m/s")]
    MetrePerSecond,
    /// Drive frequency.
    #[serde(rename = "Hz")]
    Hertz,
    /// Age, lateness or time driven.
    #[serde(rename = "s")]
    Second,
    /// Temperature.
    #[serde(rename = "degC")]
    Celsius,
    /// Squared rms velocity, summed over time.
    #[serde(rename = "m2/s")]
    SquareMetrePerSecond,
}

impl Unit {
    /// The symbol, empty for what has none.
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Flag | Self::Count => "",
            Self::Share => "of those due",
            Self::Newton => "N",
            Self::NewtonPerSecond => "N/s",
            Self::Metre => "m",
            Self::MetrePerSecond => "m/s",
            Self::Hertz => "Hz",
            Self::Second => "s",
            Self::Celsius => "degC",
            Self::SquareMetrePerSecond => "m2/s",
        }
    }

    /// A value with its unit, to four significant digits; what is infinite was never seen.
    pub fn of(self, value: f64) -> String {
        if value == f64::INFINITY {
            return "no data".into();
        }
        // Amplitudes and positions are read in micrometres where metres are all zeros.
        let small = self == Self::Metre && value.abs() < 1e-3 && value != 0.0;
        let (value, symbol) = if small { (1e6 * value, "um") } else { (value, self.symbol()) };
        let magnitude = if value == 0.0 || !value.is_finite() { 0.0 } else { value.abs().log10().floor() };
        let digits = (3.0 - magnitude).clamp(0.0, 9.0) as usize;
        let number = format!("{value:.digits$}");
        let number = if digits > 0 { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
        if symbol.is_empty() { number.into() } else { format!("{number} {symbol}") }
    }
}

/// What [`Cause::Unguarded`] misses, by its value.
const MISSING: [&str; 6] = [
    "guard",
    "second channel beside an amplifier without watchdog",
    "second channel",
    "emergency stop",
    "dead-man device",
    "watchdog at the amplifier or at its supply",
];

/// One line: cause, requirement, value and bound with their unit, time and cycle.
impl fmt::Display for Trip {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.cause.words())?;
        if self.cause == Cause::Unguarded {
            let missing = MISSING.get(self.value as usize).copied().unwrap_or_default();
            write!(f, ": there is no {missing}")?;
        }
        if self.unit != Unit::Flag {
            write!(f, ": {} (limit {})", self.unit.of(self.value), self.unit.of(self.bound))?;
        }
        write!(f, ", at {:.3} s", self.at.seconds())?;
        self.cause.requirement().map_or(Ok(()), |id| write!(f, " [{id}]"))
    }
}
