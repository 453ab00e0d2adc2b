//! The list: what strikes, what must follow, within how many cycles. Add a fault: one line.
//!
//! Numbers are those of the project's fault list (`docs/safety.md`). Bounds count from the first cycle whose inputs show
//! the fault, that cycle included, at the bench's timing: a 1 kHz loop, forces at 1 kHz that may be five periods old
//! (three and the stated latency), states of amplifier and stage that may be nine. Garbage is random over 400 N: one sample
//! in some hundreds is plausible by chance, so its bound allows for that.

use super::tamper::Tamper;
use realtime::wrap::fault::{FaultMode, Target};
use serde::{Deserialize, Serialize};

/// What the rig is doing when a fault strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Moment {
    /// Armed, nothing asked for.
    Idle,
    /// Sliding, the amplitude climbing in steps.
    Ramp,
    /// Loaded and vibrating at rest.
    Hold,
    /// Steady sliding under vibration.
    Slide,
}

/// All moments.
pub const ALL: &[Moment] = &[Moment::Idle, Moment::Ramp, Moment::Hold, Moment::Slide];
/// Those in which the plate is driven and loaded.
pub const DRIVEN: &[Moment] = &[Moment::Ramp, Moment::Hold, Moment::Slide];
/// Those in which the stage moves.
pub const MOVING: &[Moment] = &[Moment::Ramp, Moment::Slide];
const STILL: &[Moment] = &[Moment::Idle];

/// What strikes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum What {
    /// A fault of a channel: where, which, its strength, and for how many ms.
    Channel(Target, FaultMode, f64, u64),
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
    /// A stop is asked for.
    Stop,
    /// A stop is asked for, and the amplifier does not obey its enable.
    StopRefused,
    /// The dead-man input is released, with a human finger.
    DeadMan,
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

/// What must follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expect {
    /// The drive is commanded off within so many cycles.
    Off(u64),
    /// No trip; a remark within so many cycles.
    Remark(u64),
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
    /// When it can strike.
    pub moments: &'static [Moment],
}

/// Age that a force sample may have, in cycles of the bench.
pub const FORCE_AGE: u64 = 5;
/// Age that a state of amplifier or stage may have, in cycles of the bench.
pub const STATE_AGE: u64 = 9;
/// Time from a new set-point until a state must show it: five ring times, twice the state's age, two cycles.
pub const RESPONSE: u64 = 29;
/// Equal samples that count as frozen.
pub const FROZEN: u64 = 50;
/// For ever, as far as a run is concerned.
const ON: u64 = 100_000;

macro_rules! rows {
    ($($number:literal $name:literal $moments:ident $what:expr => $expect:expr;)*) => {
        /// The list.
        pub const ROWS: &[FaultRow] = &[$(FaultRow {
            number: $number, name: $name, what: $what, expect: $expect, moments: $moments,
        },)*];
    };
}

use Expect::{NoMu, NoTrip, Off, Remark, RemarkOrOff};
use FaultMode as F;
use Target as T;
use What::{Channel, Late, Paused, Shown};

rows! {
    1 "forces_silent" ALL Channel(T::Force, F::Off, 0.0, ON) => Off(FORCE_AGE + 1);
    1 "lateral_silent" ALL Channel(T::Lateral, F::Off, 0.0, ON) => Off(FORCE_AGE + 1);
    1 "normal_silent" ALL Channel(T::Normal, F::Off, 0.0, ON) => Off(FORCE_AGE + 1);
    2 "forces_stuck" ALL Channel(T::Force, F::Stuck, 0.0, ON) => Off(FROZEN + 1);
    2 "normal_stuck" ALL Channel(T::Normal, F::Stuck, 0.0, ON) => Off(FROZEN + 1);
    3 "forces_invalid" ALL Channel(T::Force, F::Invalid, 0.0, ON) => Off(4);
    3 "lateral_invalid" ALL Channel(T::Lateral, F::Invalid, 0.0, ON) => Off(4);
    3 "two_invalid_samples" ALL Channel(T::Force, F::Invalid, 0.0, 2) => NoTrip;
    4 "single_spike" ALL Channel(T::Force, F::Spikes, 1e9, ON) => NoTrip;
    5 "repeated_spikes" DRIVEN Channel(T::Force, F::Spikes, 8.0, ON) => Off(51);
    6 "forces_saturated" ALL Channel(T::Force, F::Saturated, 0.0, ON) => Off(2);
    6 "normal_saturated" ALL Channel(T::Normal, F::Saturated, 0.0, ON) => Off(2);
    7 "forces_garbage" ALL Channel(T::Force, F::Garbage, 0.0, ON) => Off(8);
    7 "normal_garbage" ALL Channel(T::Normal, F::Garbage, 0.0, ON) => Off(8);
    7 "forces_times_twenty" DRIVEN Channel(T::Force, F::Wrong, 20.0, ON) => Off(2);
    7 "subtly_wrong_gain" DRIVEN Channel(T::Lateral, F::Wrong, 0.5, ON) => NoTrip;
    7 "amplifier_garbage" DRIVEN Channel(T::Amplifier, F::Garbage, 0.0, ON) => Off(4);
    7 "stage_garbage" ALL Channel(T::Stage, F::Garbage, 0.0, ON) => Off(4);
    8 "forces_at_half_rate" ALL Channel(T::Force, F::Slow, 2.0, ON) => Remark(202);
    8 "forces_at_a_twentieth" ALL Channel(T::Force, F::Slow, 20.0, ON) => Off(2 * FORCE_AGE + 2);
    9 "forces_delayed" ALL Channel(T::Force, F::Delayed, 0.02, ON) => Off(1);
    9 "amplifier_delayed" ALL Channel(T::Amplifier, F::Delayed, 0.02, ON) => Off(1);
    9 "stage_delayed" ALL Channel(T::Stage, F::Delayed, 0.02, ON) => Off(1);
    10 "a_third_lost" ALL Channel(T::Force, F::Intermittent, 0.3, ON) => RemarkOrOff(202);
    10 "nine_in_ten_lost" ALL Channel(T::Force, F::Intermittent, 0.9, ON) => Off(202);
    11 "forces_disconnected" ALL Channel(T::Force, F::Disconnected, 0.0, ON) => Off(1);
    11 "amplifier_disconnected" ALL Channel(T::Amplifier, F::Disconnected, 0.0, ON) => Off(1);
    11 "stage_disconnected" ALL Channel(T::Stage, F::Disconnected, 0.0, ON) => Off(1);
    14 "answers_corrupt" ALL Channel(T::Force, F::Corrupt, 0.0, ON) => Off(4);
    18 "samples_out_of_order" ALL Channel(T::Force, F::Disordered, 0.0, ON) => RemarkOrOff(202);
    20 "drive_commands_late" DRIVEN Channel(T::Drive, F::Delayed, 0.03, ON) => Off(50 + STATE_AGE);
    22 "device_clock_back" ALL Channel(T::Force, F::ClockJump, -1.0, ON) => Off(1);
    22 "device_clock_ahead" ALL Channel(T::Force, F::ClockJump, 1.0, ON) => Off(4);
    22 "amplifier_clock_ahead" ALL Channel(T::Amplifier, F::ClockJump, 1.0, ON) => Off(1);
    23 "controller_suspended" ALL Paused(500) => Off(1);
    24 "one_late_cycle" ALL Late { cycles: 1, every: 1, tenths: 25 } => NoTrip;
    24 "three_late_cycles" ALL Late { cycles: 3, every: 1, tenths: 15 } => Off(3);
    24 "one_in_fifty_late" ALL Late { cycles: 40, every: 50, tenths: 15 } => Off(560);
    29 "stop_asked_for" ALL What::Stop => Off(1);
    31 "amplifier_refuses_off" DRIVEN What::StopRefused => Off(1);
    32 "amplifier_link_cut" DRIVEN Channel(T::Drive, F::Off, 0.0, ON) => Off(50 + STATE_AGE);
    32 "amplifier_states_silent" ALL Channel(T::Amplifier, F::Off, 0.0, ON) => Off(STATE_AGE + 1);
    33 "amplitude_times_ten" DRIVEN Shown(Tamper::AmplitudeTimes(10.0)) => Off(2);
    33 "amplitude_times_two" DRIVEN Shown(Tamper::AmplitudeTimes(2.0)) => Off(2);
    34 "amplitude_sensor_zero" DRIVEN Shown(Tamper::AmplitudeTimes(0.0)) => Off(85);
    34 "amplitude_sensor_lost" DRIVEN Shown(Tamper::AmplitudeLost) => Off(85);
    35 "resonance_lost" DRIVEN Shown(Tamper::AmplitudeTimes(0.5)) => Remark(100);
    36 "normal_overforce_step" ALL Shown(Tamper::NormalStep(3.0)) => Off(2);
    36 "lateral_overforce_step" ALL Shown(Tamper::LateralStep(-4.0)) => Off(2);
    36 "normal_overforce_creeps" ALL Shown(Tamper::NormalRamp(20.0)) => Off(1);
    36 "normal_force_too_fast" ALL Shown(Tamper::NormalFast(90.0)) => Off(4);
    37 "too_hot" ALL Shown(Tamper::Hot) => Off(1);
    37 "temperature_lost" ALL Shown(Tamper::TemperatureLost) => Off(1);
    37 "amplifier_reports_a_fault" ALL Shown(Tamper::AmplifierFault) => Off(1);
    37 "amplifier_watchdog_fired" DRIVEN Shown(Tamper::WatchdogFired) => Off(1);
    38 "over_travel" ALL Shown(Tamper::OverTravel) => Off(1);
    38 "end_switch" ALL Channel(T::Stage, F::Saturated, 0.0, ON) => Off(1);
    38 "stage_stalls" MOVING What::StageStalls => Off(STATE_AGE);
    38 "stage_runs_away" ALL Shown(Tamper::StageFast) => Off(2);
    38 "stage_states_silent" ALL Channel(T::Stage, F::Off, 0.0, ON) => Off(STATE_AGE + 1);
    39 "contact_lost" DRIVEN Shown(Tamper::ContactLost) => NoMu;
    40 "dead_man_released" ALL What::DeadMan => Off(1);
    40 "exposure_too_long" DRIVEN What::Exposure => Off(2);
    43 "model_diverges" ALL What::ModelDiverges => NoTrip;
    47 "request_beyond_limits" ALL What::Request => Off(1);
    48 "rogue_master" DRIVEN What::RogueMaster => Off(RESPONSE + STATE_AGE + 2);
    48 "amplifier_echo_stuck_when_idle" STILL Channel(T::Amplifier, F::Stuck, 0.0, ON) => NoTrip;
}
