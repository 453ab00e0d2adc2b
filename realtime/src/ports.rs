//! The seams between the loop and the rig.
//!
//! A port never blocks, locks or allocates when the loop calls it: a driver beside the loop has done the talking
//! and a ring holds its result. Time is an argument. A missing reading is a [`NoData`] with its reason.

use crate::safety::{DriveCommand, StageCommand};
pub use crate::signals::{
    AmplifierState, Channel, Contacts, Forces, Nanos, NoData, Quality, SafetyContact, Sample, StageState,
    SupplyCommand, SupplyState,
};

/// Reads the two forces.
pub trait ForceSensor: Send {
    /// The latest sample of each axis. Old samples come back with their old `taken_at`; judging age is the loop's.
    fn read(&mut self, now: Nanos) -> Forces;
}

/// Drives the plate.
pub trait Amplifier: Send {
    /// Hands over an absolute set-point. It is sent at once or, once past its expiry, never.
    fn command(&mut self, command: DriveCommand, now: Nanos);

    /// The latest state.
    ///
    /// # Errors
    /// Why there is none.
    fn state(&mut self, now: Nanos) -> Result<AmplifierState, NoData>;
}

/// Slides the finger along the plate and loads it.
pub trait Stage: Send {
    /// Hands over absolute set-points: velocity along the stroke and normal load.
    fn command(&mut self, command: StageCommand, now: Nanos);

    /// The latest state.
    ///
    /// # Errors
    /// Why there is none.
    fn state(&mut self, now: Nanos) -> Result<StageState, NoData>;
}

/// The second, independent way to switch off: a relay in the amplifier's supply, or an enable line of its own.
///
/// The loop hands over the absolute command every cycle; a port sends it when it is new, and again from time
/// to time. A switch that loses its own supply or its link must fall open by itself where its hardware can.
pub trait SupplySwitch: Send {
    /// Hands over what the switch is to do.
    fn command(&mut self, command: SupplyCommand, now: Nanos);

    /// The latest state, read back.
    ///
    /// # Errors
    /// Why there is none; [`NoData::NotFitted`] where the rig has no second channel.
    fn state(&mut self, now: Nanos) -> Result<SupplyState, NoData>;
}

/// Reads the safety contacts.
pub trait SafetyInputs: Send {
    /// The latest reading of each contact. Old ones come back with their old `taken_at`; judging age is the loop's.
    fn read(&mut self, now: Nanos) -> Contacts;
}

/// What stands in a port's place where a rig has none: every reading is [`NoData::NotFitted`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Absent;

impl SupplySwitch for Absent {
    fn command(&mut self, _: SupplyCommand, _: Nanos) {}

    fn state(&mut self, _: Nanos) -> Result<SupplyState, NoData> {
        Err(NoData::NotFitted)
    }
}

impl SafetyInputs for Absent {
    fn read(&mut self, _: Nanos) -> Contacts {
        Contacts::ABSENT
    }
}
