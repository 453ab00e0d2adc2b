//! The description of a trip: its cause, the unit of its value, and what to do about it.

#![allow(clippy::disallowed_types, reason = "a trip is described for people beside the loop, never in it")]

use super::{RULES, Trip};
use serde::{Deserialize, Serialize};
use std::fmt;

/// One line a cause: what happened, and what a person at the rig does about it. A remark before it says
/// what the words leave out.
macro_rules! causes {
    ($($(#[$doc:meta])* $cause:ident $words:literal => $remedy:expr;)*) => {
        /// Why the rig is, or would be, faulted.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum TripCause {
            $(#[doc = $words] $(#[$doc])* $cause,)*
        }

        impl TripCause {
            /// What happened, in words.
            pub const fn words(self) -> &'static str {
                match self {
                    $(Self::$cause => $words,)*
                }
            }

            /// What a person at the rig does about it, in one sentence or two.
            pub const fn remedy(self) -> &'static str {
                match self {
                    $(Self::$cause => $remedy,)*
                }
            }
        }
    };
}

const FORCE_LINK: &str = "Check the force sensor's cable and power, and `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link.";
const FORCE_VALUES: &str =
    "Check the force sensor: its values are not forces. `muprime doctor --setup` shows the link.";
const FORCE_RANGE: &str = "Unload and zero the force sensor, or use one with a larger range.";
const FORCE_STANDS: &str = "Switch the force sensor off and on: its value stands still. If its noise is below one count, raise `frozen_after`.";
const FORCE_LOSES: &str =
    "Check the force sensor's link: most samples are lost. State the true rate as `rate_hz`.";
const AMPLITUDE_UP: &str =
    "Look for a resonance, a wrong calibration or another controller; ask for less amplitude.";

causes! {
    StartUp "the rig has not been armed since it was started" => "Nothing is wrong: the rig waits to be armed.";
    /// An operator, a signal or the end of a sweep stopped the rig.
    Stopped "stopped on request" => "Nothing is wrong: a stop was requested. Repeat the command with the same --out to resume.";
    /// The dead-man input was released in human-contact mode.
    DeadMan "the dead-man device was released" => "Release the dead-man device, grip it again, and start the run again.";
    /// Vibration on a human finger lasted too long.
    Exposure "vibration on the finger lasted too long without a rest" => "Take the finger off and rest as long as `exposure_rest_s` says; the same command with the same --out then resumes the run.";
    NormalOverforce "the normal force is beyond its limit" => "Lift the finger off and check load, stage and sensor before it is loaded again.";
    LateralOverforce "the lateral force is beyond its limit" => "Look for what holds the finger or the plate; ask for a smaller load.";
    ForceRate "the normal force changes too fast" => "Look for a blow or a loose sensor; load more slowly.";
    /// A lateral sample is older than its age limit, or there is none.
    LateralStale "the lateral force sensor sends no fresh samples" => FORCE_LINK;
    /// A normal sample is older than its age limit, or there is none.
    NormalStale "the normal force sensor sends no fresh samples" => FORCE_LINK;
    /// Three cycles without a valid lateral sample.
    LateralInvalid "the lateral force sensor sends invalid values" => FORCE_VALUES;
    /// Three cycles without a valid normal sample.
    NormalInvalid "the normal force sensor sends invalid values" => FORCE_VALUES;
    LateralSaturated "the lateral force sensor is at the end of its range" => FORCE_RANGE;
    NormalSaturated "the normal force sensor is at the end of its range" => FORCE_RANGE;
    LateralFrozen "the lateral force sensor repeats one value" => FORCE_STANDS;
    NormalFrozen "the normal force sensor repeats one value" => FORCE_STANDS;
    /// Five spikes within fifty cycles on either force.
    Noisy "too many spikes in a force" => "Check the force sensor's cable, shield and ground; keep it away from the drive's cable.";
    /// The amplifier's state is older than its age limit, or there is none.
    AmplifierStale "the amplifier's state is too old" => "Check the amplifier's cable and power, and `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link.";
    AmplifierFault "the amplifier reports a fault" => "Read the fault on the amplifier, remove its cause and reset it there.";
    /// The amplifier's own watchdog has switched it off while it was to be on.
    AmplifierWatchdog "the amplifier's watchdog switched it off" => "No command reached the amplifier within its watchdog's time: check its link, and what else runs on this machine.";
    OverAmplitude "the measured amplitude is above its limit" => AMPLITUDE_UP;
    AmplitudeRunaway "the measured amplitude is above the commanded one" => AMPLITUDE_UP;
    AmplitudeRate "the measured amplitude rises too fast" => "Look for a resonance or another controller; ask for smaller steps of amplitude.";
    DriveNoResponse "the plate does not respond to the drive" => "Check the plate's cable, the amplitude's sensor and the drive frequency: the plate is driven and does not vibrate.";
    EchoMismatch "the amplifier echoes another set-point than it was given" => "Find who else writes to the amplifier, and end it; if nobody does, the amplifier does not take its set-points.";
    RefusesOff "the amplifier stays on after 'off'" => "Switch the amplifier's supply off by hand; do not use the amplifier until it has been repaired.";
    /// Too hot, or the temperature is not known where it must be.
    OverTemperature "too hot, or the temperature is unknown" => "Let the plate and the amplifier cool; with no temperature shown, check its sensor.";
    /// The stage's state is older than its age limit, or there is none.
    StageStale "the stage's state is too old" => "Check the stage's cable and power, and `rate_hz` and `link_stall_s`; `muprime doctor --setup` shows the link.";
    StageFault "the stage reports a fault" => "Read the fault on the stage, remove its cause and reset it there.";
    OverTravel "the stage is outside its travel" => "Move the stage back between its ends by hand; check `travel_min_m` and `travel_max_m`.";
    /// The loop missed too many deadlines in a row, or of a thousand.
    Overrun "the loop missed too many deadlines" => "End what else runs on this machine and give the loop its rights: `muprime doctor` says which.";
    RequestRefused "a request is beyond the limits" => "Ask for what the limits of the setup allow: `muprime check` shows the value and its place in the plan.";
    /// The loop was held up for so long that nothing is known of the rig.
    Suspended "the computer stopped the loop for too long" => "Let nothing stop this program or its machine during a run; `muprime doctor` shows how the machine stalls.";
    /// The stage does not move as commanded: stalled, or faster.
    StageNotFollowing "the stage does not follow its commanded speed" => "Find what blocks the stage or moves it from outside; check the stage's drive.";
    LateralLossy "the lateral force channel loses most of its samples" => FORCE_LOSES;
    NormalLossy "the normal force channel loses most of its samples" => FORCE_LOSES;
    /// The emergency stop is pressed, or nothing is known of it.
    EmergencyStop "the emergency stop is pressed, or its contact does not answer" => "Make the rig safe, release the emergency stop and start the run again; if it was not pressed, check its wire and its input.";
    /// The guard is open, or nothing is known of it.
    Interlock "the guard is open, or its contact does not answer" => "Close the guard and start the run again; if it was closed, check its wire and its input.";
    /// The second switch-off channel does not follow its command, or nothing is known of it.
    SupplySwitch "the supply relay does not do what it is commanded" => "Check the relay in the supply, its mirror contact and their wires: it does not follow its commands.";
    /// What must be there to switch off is not fitted: 1 a second channel beside an amplifier without watchdog;
    /// with a human finger 2 a second channel, 3 an emergency stop, 4 a dead-man device, 5 a watchdog.
    Unguarded "a guard that this rig needs is missing" => "Fit what is missing and state it in the setup: [supply_relay], [safety_inputs].";
    ExposureDuty "the finger was vibrated for too large a share of the last hour" => "Remove the finger: the hourly limit of vibration is reached. Resume after a rest.";
    ExposureDose "the vibration of the last hour was too strong for the finger" => "Remove the finger: the hourly dose of vibration is reached. Resume after a rest, with less amplitude.";
    AmplitudeSaturated "the amplitude sensor is at the end of its range" => "Ask for less amplitude, or set a larger range of the amplitude's sensor.";
    /// The amplitude's channel repeats itself while the plate is driven.
    AmplitudeFrozen "the amplitude sensor repeats one value" => "Check the amplitude's sensor: its value stands still. If its noise is below one count, raise `amplitude_frozen_after`.";
    /// The normal force is not that of the load that the stage was commanded to apply, or to lift off.
    LoadImplausible "the normal force is not the commanded load" => "Check the loading axis and zero the force sensor: the normal force is not the requested load.";
}

impl TripCause {
    /// The requirement whose rule latches it; none for [`TripCause::StartUp`], which is no rule.
    pub fn requirement(self) -> Option<&'static str> {
        RULES.iter().find(|rule| rule.cause == self).map(|rule| rule.id)
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

    /// A value with its unit, to four significant digits; what is infinite was never seen. The unit suits
    /// `other` too, which is printed beside it: nothing is 0 um beside 0.2 um.
    fn beside(self, value: f64, other: f64) -> String {
        if value == f64::INFINITY {
            return "no data".into();
        }
        // Amplitudes and positions are read in micrometres where metres are all zeros.
        let largest = value.abs().max(if other.is_finite() { other.abs() } else { 0.0 });
        let small = self == Self::Metre && largest < 1e-3 && largest != 0.0;
        let (value, symbol) = if small { (1e6 * value, "\u{b5}m") } else { (value, self.symbol()) };
        let magnitude = if value == 0.0 || !value.is_finite() { 0.0 } else { value.abs().log10().floor() };
        let digits = (3.0 - magnitude).clamp(0.0, 9.0) as usize;
        let number = format!("{value:.digits$}");
        let number = if digits > 0 { number.trim_end_matches('0').trim_end_matches('.') } else { &number };
        // What rounds to nothing has no sign.
        let number = if number == "-0" { "0" } else { number };
        if symbol.is_empty() { number.into() } else { format!("{number} {symbol}") }
    }
}

/// What [`TripCause::Unguarded`] misses, by its value.
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
        if self.cause == TripCause::Unguarded {
            let missing = MISSING.get(self.value as usize).copied().unwrap_or_default();
            write!(f, ": there is no {missing}")?;
        }
        if self.unit != Unit::Flag {
            let [value, limit] = [(self.value, self.bound), (self.bound, self.value)]
                .map(|(v, other)| self.unit.beside(v, other));
            write!(f, ": {value} (limit {limit})")?;
        }
        write!(f, ", at {:.3} s", self.at.seconds())?;
        self.cause.requirement().map_or(Ok(()), |id| write!(f, " [{id}]"))
    }
}
