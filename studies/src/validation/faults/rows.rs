//! The list: what strikes, what must follow, for which cause, within how many cycles. Add a fault: one line.
//!
//! Numbers to 50 are those of the project's fault list (docs/safety.md); what no row of it names comes after.
//! Bounds count from the first cycle whose inputs show the fault, that cycle included. They are stated in
//! what the limits allow for (the age of a force sample or of a state, the time in which a set-point must
//! show), so that they hold at every [`Pace`]. Garbage is random over 400 N: one sample in some hundreds is
//! plausible by chance, so its bound allows for that. Two spikes side by side are an overforce.

use super::tamper::Tamper;
use realtime::Nanos;
use realtime::fault::{FaultMode, FaultTarget};
use realtime::safety::{ChannelTiming, Limits, Timing, TripCause};
use serde::{Deserialize, Serialize};

/// What the rig is doing when a fault strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// Armed, nothing requested.
    Idle,
    /// Sliding, the amplitude climbing in steps.
    Ramp,
    /// Loaded and vibrating at rest.
    Hold,
    /// Steady sliding under vibration.
    Slide,
    /// Rendering a grating of friction while it slides: the amplitude changes in every cycle. Not among the
    /// moments of the rows: every row that may strike while the rig slides may strike then.
    Render,
}

/// All moments.
pub const ALL: &[Moment] = &[Moment::Idle, Moment::Ramp, Moment::Hold, Moment::Slide];
/// Those in which the plate is driven and loaded.
pub const DRIVEN: &[Moment] = &[Moment::Ramp, Moment::Hold, Moment::Slide];
/// Those in which the stage moves.
pub const MOVING: &[Moment] = &[Moment::Ramp, Moment::Slide];
const STILL: &[Moment] = &[Moment::Idle];
/// Those in which the amplitude's set-point stands.
const STEADY: &[Moment] = &[Moment::Hold, Moment::Slide];

/// What strikes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// A fault of a channel: where, which, its strength, and for how many ms.
    Channel(FaultTarget, FaultMode, f64, u64),
    /// The instruments show something that must not be.
    Shown(Tamper),
    /// Cycles begin late.
    Late {
        /// How many.
        cycles: u64,
        /// One in so many.
        every: u64,
        /// By how many tenths of a period.
        tenths: u64,
    },
    /// The controller stands still for so many ms; the rig does not.
    Paused(u64),
    /// A stop is requested.
    Stop,
    /// A stop is requested, and the amplifier does not obey its enable.
    StopRefused,
    /// The dead-man input is released, with a human finger.
    DeadMan,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The guard is opened.
    Guard,
    /// The relay of the second channel falls open.
    RelayFalls,
    /// Vibration on a human finger goes on.
    Exposure,
    /// The slide stands still.
    StageStalls,
    /// Somebody else sends set-points to the amplifier.
    RogueMaster,
    /// The model answers with no number.
    ModelDiverges,
    /// A request beyond the limits.
    Request,
}

/// The limits that a scene runs at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pace {
    /// Links that answer within 2 and 4 ms, commands that live for two cycles: what the loop itself can do.
    #[default]
    Fast,
    /// What a setup has that says nothing else: links that may be held up for 20 ms, commands that live as long.
    Default,
}

impl Pace {
    /// Its timing at the bench's period and ring time.
    pub fn timing(self, cycle: Nanos, ring_time: Nanos) -> Timing {
        let timing = Timing { ring_time, ..Limits::paper(cycle).timing };
        if self == Pace::Fast {
            return timing;
        }
        let link = ChannelTiming { period: cycle, latency: Nanos(20_000_000), periods: 3 };
        let command_expiry = Timing::longest_expiry(cycle);
        Timing { lateral: link, normal: link, amplifier: link, stage: link, command_expiry, ..timing }
    }
}

/// A bound: so many cycles, and so many times what the limits allow for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Within {
    cycles: u64,
    force_ages: u64,
    state_ages: u64,
    responses: u64,
    /// Samples every twentieth cycle are stale at once where their age is smaller; else their loss is counted.
    by_loss: bool,
    /// A set-point that changes again before it had its time to show is not judged: a ramp of 50 ms steps, then, to its end.
    by_ramp: bool,
}

/// So many cycles.
const fn cycles(cycles: u64) -> Within {
    Within { cycles, force_ages: 0, state_ages: 0, responses: 0, by_loss: false, by_ramp: false }
}

impl Within {
    /// In cycles, at that timing.
    pub fn at(&self, timing: &Timing) -> u64 {
        let age = |of: &ChannelTiming| of.age_limit().0.div_ceil(timing.cycle.0);
        let (force_age, state_age) = (age(&timing.normal), age(&timing.amplifier));
        let response = response(timing);
        let sum = self.cycles
            + self.force_ages * force_age
            + self.state_ages * state_age
            + self.responses * response;
        let loss = if self.by_loss && force_age >= 20 { LOSS } else { 0 };
        let ramp = if self.by_ramp && response >= RAMP_STEP { RAMP } else { 0 };
        sum.max(loss) + ramp
    }
}

/// Time from a new set-point until a state must show it, in cycles: five ring times, twice the state's age, two cycles.
fn response(timing: &Timing) -> u64 {
    (5 * timing.ring_time.0 + 2 * timing.amplifier.age_limit().0).div_ceil(timing.cycle.0) + 2
}

/// Cycles between two steps of the ramp, and from the first strike to its end.
const RAMP_STEP: u64 = 50;
const RAMP: u64 = 250;
/// Two windows of a hundred samples, and two cycles.
const LOSS: u64 = 202;

/// What must follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expect {
    /// The drive is commanded off, in time and for one of the row's causes.
    Off(Within),
    /// No trip; a remark within so many cycles.
    Remark(Within),
    /// A remark or off within so many cycles.
    RemarkOrOff(u64),
    /// No trip at all.
    NoTrip,
    /// No trip, and no `mu'` from the next cycle on.
    NoMu,
}

/// One line of the list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultRow {
    /// Number in the fault list.
    pub number: u32,
    /// Name, unique.
    pub name: &'static str,
    /// What strikes.
    pub what: What,
    /// What must follow.
    pub expect: Expect,
    /// Causes that a trip may name.
    pub causes: &'static [TripCause],
    /// When it can strike.
    pub moments: &'static [Moment],
}

/// Equal samples that count as frozen.
pub const FROZEN: u64 = 50;
/// Equal amplitudes that count as frozen.
pub const AMPLITUDE_FROZEN: u64 = 200;
/// For ever, as far as a run is concerned.
const ON: u64 = 100_000;
/// A delay in s that is longer than a sample's age limit, at whatever pace.
pub const TOO_LATE: f64 = 0.0;

macro_rules! rows {
    ($($number:literal $name:literal $moments:ident $what:expr => $expect:expr $(, $($cause:ident)|+)?;)*) => {
        /// The list.
        pub const ROWS: &[FaultRow] = &[$(FaultRow {
            number: $number, name: $name, what: $what, expect: $expect, causes: &[$($(TripCause::$cause),+)?], moments: $moments,
        },)*];
    };
}

use Expect::{NoMu, NoTrip, Off, Remark, RemarkOrOff};
use FaultMode as F;
use FaultTarget as T;
use What::{Channel, Late, Paused, Shown};

rows! {
    1 "forces_silent" ALL Channel(T::Force, F::Off, 0.0, ON) => Off(Within { force_ages: 1, ..cycles(1) }), LateralStale | NormalStale;
    1 "lateral_silent" ALL Channel(T::Lateral, F::Off, 0.0, ON) => Off(Within { force_ages: 1, ..cycles(1) }), LateralStale;
    1 "normal_silent" ALL Channel(T::Normal, F::Off, 0.0, ON) => Off(Within { force_ages: 1, ..cycles(1) }), NormalStale;
    2 "forces_stuck" ALL Channel(T::Force, F::Stuck, 0.0, ON) => Off(cycles(FROZEN + 1)), LateralFrozen | NormalFrozen;
    2 "normal_stuck" ALL Channel(T::Normal, F::Stuck, 0.0, ON) => Off(cycles(FROZEN + 1)), NormalFrozen;
    2 "amplitude_stuck" STEADY Shown(Tamper::AmplitudeStuck) => Off(cycles(AMPLITUDE_FROZEN + 2)), AmplitudeFrozen;
    2 "normal_counter_stuck_at_40_n" ALL Shown(Tamper::NormalStuckCounter(40.0)) => Off(cycles(4)), NormalOverforce;
    3 "forces_invalid" ALL Channel(T::Force, F::Invalid, 0.0, ON) => Off(cycles(4)), LateralInvalid | NormalInvalid;
    3 "lateral_invalid" ALL Channel(T::Lateral, F::Invalid, 0.0, ON) => Off(cycles(4)), LateralInvalid;
    3 "two_invalid_samples" ALL Channel(T::Force, F::Invalid, 0.0, 2) => NoTrip;
    4 "single_spike" ALL Channel(T::Force, F::Spikes, 1e9, ON) => NoTrip;
    5 "repeated_spikes" DRIVEN Channel(T::Force, F::Spikes, 8.0, ON) => Off(cycles(51)), Noisy | NormalOverforce | LateralOverforce;
    6 "forces_saturated" ALL Channel(T::Force, F::Saturated, 0.0, ON) => Off(cycles(2)), LateralSaturated | NormalSaturated;
    6 "normal_saturated" ALL Channel(T::Normal, F::Saturated, 0.0, ON) => Off(cycles(2)), NormalSaturated;
    6 "normal_saturated_by_turns" ALL Shown(Tamper::NormalRailsByTurns) => Off(cycles(10)), NormalSaturated;
    6 "amplitude_saturated" DRIVEN Shown(Tamper::AmplitudeRails) => Off(cycles(2)), AmplitudeSaturated;
    7 "forces_garbage" ALL Channel(T::Force, F::Garbage, 0.0, ON) => Off(cycles(8)), NormalOverforce | LateralOverforce | ForceRate | LateralInvalid | NormalInvalid | Noisy;
    7 "normal_garbage" ALL Channel(T::Normal, F::Garbage, 0.0, ON) => Off(cycles(8)), NormalOverforce | ForceRate | NormalInvalid | Noisy;
    7 "forces_times_twenty" DRIVEN Channel(T::Force, F::Wrong, 20.0, ON) => Off(cycles(2)), NormalOverforce | LateralOverforce;
    7 "subtly_wrong_gain" DRIVEN Channel(T::Lateral, F::Wrong, 0.5, ON) => NoTrip;
    7 "amplifier_garbage" DRIVEN Channel(T::Amplifier, F::Garbage, 0.0, ON) => Off(cycles(4)), OverAmplitude | AmplitudeRunaway | AmplitudeRate | AmplifierFault | EchoMismatch | OverTemperature | DriveNoResponse;
    7 "stage_garbage" ALL Channel(T::Stage, F::Garbage, 0.0, ON) => Off(cycles(4)), StageFault | OverTravel | StageNotFollowing;
    8 "forces_at_half_rate" ALL Channel(T::Force, F::Slow, 2.0, ON) => Remark(cycles(LOSS));
    8 "forces_at_a_twentieth" ALL Channel(T::Force, F::Slow, 20.0, ON) => Off(Within { force_ages: 2, by_loss: true, ..cycles(2) }), LateralStale | NormalStale | LateralLossy | NormalLossy;
    9 "forces_delayed" ALL Channel(T::Force, F::Delayed, TOO_LATE, ON) => Off(cycles(1)), LateralStale | NormalStale;
    9 "amplifier_delayed" ALL Channel(T::Amplifier, F::Delayed, TOO_LATE, ON) => Off(cycles(1)), AmplifierStale;
    9 "stage_delayed" ALL Channel(T::Stage, F::Delayed, TOO_LATE, ON) => Off(cycles(1)), StageStale;
    10 "a_third_lost" ALL Channel(T::Force, F::Intermittent, 0.3, ON) => RemarkOrOff(LOSS), LateralStale | NormalStale;
    10 "nine_in_ten_lost" ALL Channel(T::Force, F::Intermittent, 0.9, ON) => Off(cycles(LOSS)), LateralStale | NormalStale | LateralLossy | NormalLossy;
    11 "forces_disconnected" ALL Channel(T::Force, F::Disconnected, 0.0, ON) => Off(cycles(1)), LateralStale | NormalStale;
    11 "amplifier_disconnected" ALL Channel(T::Amplifier, F::Disconnected, 0.0, ON) => Off(cycles(1)), AmplifierStale;
    11 "stage_disconnected" ALL Channel(T::Stage, F::Disconnected, 0.0, ON) => Off(cycles(1)), StageStale;
    14 "answers_corrupt" ALL Channel(T::Force, F::Corrupt, 0.0, ON) => Off(cycles(4)), LateralInvalid | NormalInvalid;
    18 "samples_out_of_order" ALL Channel(T::Force, F::Disordered, 0.0, ON) => RemarkOrOff(LOSS), LateralStale | NormalStale | LateralLossy | NormalLossy;
    20 "drive_commands_late" DRIVEN Channel(T::Drive, F::Delayed, 0.03, ON) => Off(Within { state_ages: 1, ..cycles(50) }), AmplifierWatchdog | EchoMismatch | DriveNoResponse;
    22 "device_clock_back" ALL Channel(T::Force, F::ClockJump, -1.0, ON) => Off(cycles(1)), LateralStale | NormalStale;
    22 "device_clock_ahead" ALL Channel(T::Force, F::ClockJump, 1.0, ON) => Off(cycles(4)), LateralInvalid | NormalInvalid;
    22 "amplifier_clock_ahead" ALL Channel(T::Amplifier, F::ClockJump, 1.0, ON) => Off(cycles(1)), AmplifierStale;
    23 "controller_suspended" ALL Paused(500) => Off(cycles(1)), Suspended;
    24 "one_late_cycle" ALL Late { cycles: 1, every: 1, tenths: 25 } => NoTrip;
    24 "three_late_cycles" ALL Late { cycles: 3, every: 1, tenths: 15 } => Off(cycles(3)), Overrun;
    24 "thirty_deadlines_skipped" ALL Late { cycles: 1, every: 1, tenths: 300 } => Off(cycles(1)), Overrun;
    24 "one_in_fifty_late" ALL Late { cycles: 40, every: 50, tenths: 15 } => Off(cycles(560)), Overrun;
    29 "stop_asked_for" ALL What::Stop => Off(cycles(1)), Stopped;
    31 "amplifier_refuses_off" DRIVEN What::StopRefused => Off(cycles(1)), Stopped;
    32 "amplifier_link_cut" DRIVEN Channel(T::Drive, F::Off, 0.0, ON) => Off(Within { state_ages: 1, ..cycles(50) }), AmplifierWatchdog | EchoMismatch | DriveNoResponse;
    32 "amplifier_states_silent" ALL Channel(T::Amplifier, F::Off, 0.0, ON) => Off(Within { state_ages: 1, ..cycles(1) }), AmplifierStale;
    33 "amplitude_times_ten" DRIVEN Shown(Tamper::AmplitudeTimes(10.0)) => Off(cycles(2)), OverAmplitude | AmplitudeRunaway;
    33 "amplitude_times_two" DRIVEN Shown(Tamper::AmplitudeTimes(2.0)) => Off(cycles(2)), AmplitudeRunaway | AmplitudeRate | OverAmplitude;
    34 "amplitude_sensor_zero" DRIVEN Shown(Tamper::AmplitudeTimes(0.0)) => Off(Within { responses: 1, by_ramp: true, ..cycles(56) }), DriveNoResponse;
    34 "amplitude_sensor_lost" DRIVEN Shown(Tamper::AmplitudeLost) => Off(Within { responses: 1, by_ramp: true, ..cycles(56) }), DriveNoResponse;
    35 "resonance_lost" DRIVEN Shown(Tamper::AmplitudeTimes(0.5)) => Remark(Within { responses: 1, by_ramp: true, ..cycles(71) });
    36 "normal_overforce_step" ALL Shown(Tamper::NormalStep(3.0)) => Off(cycles(2)), NormalOverforce;
    36 "lateral_overforce_step" ALL Shown(Tamper::LateralStep(-4.0)) => Off(cycles(2)), LateralOverforce;
    36 "normal_overforce_creeps" ALL Shown(Tamper::NormalRamp(20.0)) => Off(cycles(1)), NormalOverforce;
    36 "normal_force_too_fast" ALL Shown(Tamper::NormalFast(90.0)) => Off(cycles(4)), ForceRate;
    37 "too_hot" ALL Shown(Tamper::Hot) => Off(cycles(1)), OverTemperature;
    37 "temperature_lost" ALL Shown(Tamper::TemperatureLost) => Off(cycles(1)), OverTemperature;
    37 "amplifier_reports_a_fault" ALL Shown(Tamper::AmplifierFault) => Off(cycles(1)), AmplifierFault;
    37 "amplifier_watchdog_fired" DRIVEN Shown(Tamper::WatchdogFired) => Off(cycles(1)), AmplifierWatchdog;
    38 "over_travel" ALL Shown(Tamper::OverTravel) => Off(cycles(1)), OverTravel;
    38 "end_switch" ALL Channel(T::Stage, F::Saturated, 0.0, ON) => Off(cycles(1)), OverTravel;
    38 "stage_stalls" MOVING What::StageStalls => Off(Within { state_ages: 1, ..cycles(0) }), StageNotFollowing;
    38 "stage_runs_away" ALL Shown(Tamper::StageFast) => Off(cycles(2)), StageNotFollowing;
    38 "stage_states_silent" ALL Channel(T::Stage, F::Off, 0.0, ON) => Off(Within { state_ages: 1, ..cycles(1) }), StageStale;
    39 "contact_lost" DRIVEN Shown(Tamper::ContactLost) => NoMu;
    40 "dead_man_released" ALL What::DeadMan => Off(cycles(1)), DeadMan;
    40 "exposure_too_long" DRIVEN What::Exposure => Off(cycles(2)), Exposure;
    43 "model_diverges" ALL What::ModelDiverges => NoTrip;
    47 "request_beyond_limits" ALL What::Request => Off(cycles(1)), RequestRefused;
    48 "rogue_master" DRIVEN What::RogueMaster => Off(Within { responses: 1, state_ages: 1, by_ramp: true, ..cycles(2) }), EchoMismatch | DriveNoResponse | AmplitudeRunaway;
    48 "amplifier_echo_stuck_when_idle" STILL Channel(T::Amplifier, F::Stuck, 0.0, ON) => NoTrip;
    51 "emergency_stop_pressed" ALL What::EmergencyStop => Off(cycles(1)), EmergencyStop;
    51 "guard_opened" ALL What::Guard => Off(cycles(1)), Interlock;
    52 "relay_falls_open" ALL What::RelayFalls => Off(Within { state_ages: 1, ..cycles(2) }), AmplifierFault | SupplySwitch | AmplifierStale;
}
