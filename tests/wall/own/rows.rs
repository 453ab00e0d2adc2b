//! The faults of the five instruments, and what must follow.

use realtime::safety::TripCause::{self, *};
use std::fmt;

/// What follows a fault.
pub enum Fate {
    /// A trip with one of these causes; the output is off within so many ms of the strike.
    Trips(&'static [TripCause], f64),
    /// No trip; this counter of the instrument's link has gone up.
    GoesOn(&'static str),
    /// No trip, and nobody can know of it: why.
    Unseen(&'static str),
}

/// One fault of one instrument.
pub struct Row {
    /// The instrument's file.
    pub instrument: &'static str,
    /// Its name in the emulator.
    pub fault: &'static str,
    /// For people.
    pub words: &'static str,
    /// How long it lasts.
    pub lasts_ms: u64,
    /// What follows.
    pub fate: Fate,
    /// In every run of the tests, not only in the whole campaign.
    pub always: bool,
}

impl Row {
    /// The instrument can be reached no more, by nobody.
    pub fn cut_off(&self) -> bool {
        self.fault == "closed"
    }
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.instrument, self.words)
    }
}

macro_rules! rows {
    ($($instrument:literal $fault:literal $words:literal $lasts:literal $fate:expr $(, $always:ident)?;)*) => {
        /// All of them.
        pub const ROWS: &[Row] = &[$(Row {
            instrument: $instrument, fault: $fault, words: $words, lasts_ms: $lasts, fate: $fate,
            always: !stringify!($($always)?).is_empty(),
        },)*];
    };
}

use Fate::{GoesOn, Trips, Unseen};

const SILENT: &[TripCause] = &[LateralStale, NormalStale];
const LOSSY: &[TripCause] = &[LateralStale, NormalStale, LateralLossy, NormalLossy];
const STILL: &[TripCause] = &[LateralFrozen, NormalFrozen];
const INVALID: &[TripCause] = &[LateralInvalid, NormalInvalid];
const RAIL: &[TripCause] = &[LateralSaturated, NormalSaturated];
const WILD: &[TripCause] = &[LateralOverforce, ForceRate, Noisy];
const DRIVE_GONE: &[TripCause] = &[AmplifierStale];
const STAGE_GONE: &[TripCause] = &[StageStale];

rows! {
    "strain-gauge" "silence" "silence" 1000 Trips(SILENT, 800.0), always;
    "strain-gauge" "late" "answers 400 ms late" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "garbage" "random bytes" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "echo" "the request itself" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "frozen" "frozen values, the count goes on" 4000 Trips(STILL, 2500.0);
    "strain-gauge" "nan" "NaN" 1000 Trips(INVALID, 800.0), always;
    "strain-gauge" "refused" "every read is refused" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "refused" "one read is refused" 15 GoesOn("exceptions");
    "strain-gauge" "closed" "the connection is closed" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "wrong-unit" "another unit's answer" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "jump" "2.5 N more at once" 1000 Trips(WILD, 800.0);
    "strain-gauge" "half" "half an answer" 1000 Trips(SILENT, 800.0);
    "strain-gauge" "repeated" "the same sample again and again" 1000 Trips(SILENT, 800.0);

    "can-force" "silence" "silence" 1000 Trips(SILENT, 800.0);
    "can-force" "late" "held back, then all at once" 1000 Trips(SILENT, 800.0);
    "can-force" "garbage" "random bytes from the adapter" 1000 Trips(SILENT, 800.0);
    "can-force" "half" "half lines from the adapter" 1000 Trips(SILENT, 800.0);
    "can-force" "frozen" "frozen values, the count goes on" 4000 Trips(STILL, 2500.0);
    "can-force" "nan" "status: not valid" 1000 Trips(INVALID, 800.0);
    "can-force" "closed" "the adapter is pulled out" 1000 Trips(SILENT, 800.0);
    "can-force" "wrong-identifier" "another identifier" 1000 Trips(SILENT, 800.0);
    "can-force" "wrong-kind" "the same number with 29 bits" 1000 Trips(SILENT, 800.0), always;
    "can-force" "short" "messages of 4 bytes" 1000 Trips(SILENT, 800.0);
    "can-force" "jump" "2.5 N more at once" 1000 Trips(WILD, 800.0), always;
    "can-force" "repeated" "the same sample again and again" 1000 Trips(SILENT, 800.0);
    "can-force" "lost" "one message of 50 arrives" 3000 Trips(LOSSY, 3000.0);
    "can-force" "garbage" "random bytes for 20 ms" 20 GoesOn("lost_samples");

    "board" "silence" "silence" 1000 Trips(SILENT, 800.0);
    "board" "late" "held back, then all at once" 1000 Trips(SILENT, 800.0);
    "board" "garbage" "random bytes" 1000 Trips(SILENT, 800.0);
    "board" "wrong-crc" "every CRC is wrong" 1000 Trips(SILENT, 800.0), always;
    "board" "wrong-crc" "wrong CRCs for 30 ms" 30 GoesOn("lost_samples");
    "board" "half" "half frames" 1000 Trips(SILENT, 800.0);
    "board" "frozen" "frozen values, the count goes on" 4000 Trips(STILL, 2500.0);
    "board" "nan" "NaN" 1000 Trips(INVALID, 800.0);
    "board" "closed" "unplugged" 1000 Trips(SILENT, 800.0), always;
    "board" "repeated" "the same sample again and again" 1000 Trips(SILENT, 800.0);
    "board" "lost" "one frame of 60 arrives" 3000 Trips(LOSSY, 3000.0);
    "board" "jump" "2.5 N more at once" 1000 Trips(WILD, 800.0);
    "board" "rail" "beyond its range" 1000 Trips(RAIL, 800.0);
    "board" "supply" "status: the bridge's supply has failed" 1000 Trips(INVALID, 800.0);

    "generator" "silence" "silence" 1000 Trips(DRIVE_GONE, 3000.0), always;
    "generator" "late" "answers 350 ms late" 1000 Trips(DRIVE_GONE, 3000.0), always;
    "generator" "garbage" "random bytes" 1000 Trips(DRIVE_GONE, 3000.0);
    "generator" "echo" "the request itself" 1000 Trips(DRIVE_GONE, 3000.0);
    "generator" "half" "half an answer" 1000 Trips(DRIVE_GONE, 3000.0);
    "generator" "refused" "every set-point is refused" 2500 Trips(&[AmplifierFault], 3000.0), always;
    "generator" "closed" "unplugged, it goes on vibrating" 1000 Trips(DRIVE_GONE, 3000.0);
    "generator" "nan" "a level that is not a number" 1000 Trips(DRIVE_GONE, 3000.0);
    "generator" "jump" "shows 3 um more than it was told" 1000 Trips(&[EchoMismatch, OverAmplitude], 3000.0);
    "generator" "drops" "drops its output, and shows it on" 500 Unseen("nothing measures this plate: give the rig an amplifier that does, or a vibrometer");
    "generator" "alarm" "an alarm with a number" 1000 Trips(&[AmplifierFault], 3000.0);
    "generator" "out-of-step" "each answer is the one before" 3000 Trips(&[AmplifierFault], 3000.0);
    "generator" "deaf" "takes set-points and does nothing" 30000 Trips(&[EchoMismatch, RefusesOff], 8000.0);

    "stage" "silence" "silence" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "late" "answers 350 ms late" 1000 Trips(STAGE_GONE, 800.0), always;
    "stage" "garbage" "random bytes" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "wrong-crc" "every CRC is wrong" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "echo" "the request itself" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "frozen" "frozen position and velocity" 4000 Trips(&[StageNotFollowing], 2500.0);
    "stage" "refused" "every set-point is refused" 1500 Trips(&[StageStale, StageFault], 3000.0);
    "stage" "closed" "unplugged" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "wrong-unit" "another unit's answer" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "jump" "300 mm further at once" 1000 Trips(&[OverTravel], 800.0);
    "stage" "shift" "30 mm further at once, within its travel" 1000 Unseen("no rule compares a stage's position with its speed");
    "stage" "half" "half an answer" 1000 Trips(STAGE_GONE, 800.0);
    "stage" "fault" "status: fault" 1000 Trips(&[StageFault], 800.0), always;
    "stage" "deaf" "takes set-points and does nothing" 4000 Trips(&[StageNotFollowing], 2500.0);
}
