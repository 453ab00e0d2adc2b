//! What a rig is put together of, where commands come from, and what a row takes over from a cycle.
#![allow(clippy::disallowed_types)]

use super::*;
use crate::cycle::Command;
use crate::ports::{AmplifierState, Contacts, Forces, NoData, SafetyContact, StageState, SupplyState};
use crate::safety::{DriveCommand, SafetyDecision, StageCommand};

/// A rig of which only the switch and the contacts are there.
struct Rig;

const SUPPLY: SupplyState = SupplyState { cut: true, taken_at: Nanos(3), sequence: 4 };
const CLOSED: SafetyContact = SafetyContact { closed: true, taken_at: Nanos(5), sequence: 6 };

impl ForceSensor for Rig {
    fn read(&mut self, _: Nanos) -> Forces {
        Forces::missing(NoData::Disconnected)
    }
}

impl Amplifier for Rig {
    fn command(&mut self, _: DriveCommand, _: Nanos) {}

    fn state(&mut self, _: Nanos) -> Result<AmplifierState, NoData> {
        Err(NoData::Corrupt)
    }
}

impl Stage for Rig {
    fn command(&mut self, _: StageCommand, _: Nanos) {}

    fn state(&mut self, _: Nanos) -> Result<StageState, NoData> {
        Err(NoData::Invalid)
    }
}

impl SupplySwitch for Rig {
    fn command(&mut self, _: SupplyCommand, _: Nanos) {}

    fn state(&mut self, _: Nanos) -> Result<SupplyState, NoData> {
        Ok(SUPPLY)
    }
}

impl SafetyInputs for Rig {
    fn read(&mut self, _: Nanos) -> Contacts {
        Contacts { emergency_stop: Ok(CLOSED), ..Contacts::ABSENT }
    }
}

fn bare() -> Ports {
    Ports::new(Box::new(Rig), Box::new(Rig), Box::new(Rig))
}

/// What the loop would see of the second channel and of the contacts.
fn seen(mut ports: Ports) -> (Result<SupplyState, NoData>, Result<SafetyContact, NoData>) {
    (ports.supply.state(Nanos(0)), ports.contacts.read(Nanos(0)).emergency_stop)
}

#[test]
fn a_rig_has_what_was_put_into_it() {
    let none = NoData::NotFitted;
    assert_eq!(seen(bare()), (Err(none), Err(none)));
    let whole = Ports { supply: Box::new(Rig), contacts: Box::new(Rig), ..bare() };
    assert_eq!(seen(whole), (Ok(SUPPLY), Ok(CLOSED)));
}

#[test]
fn a_row_is_what_the_cycle_said() {
    let seen = Observation {
        forces: Forces::missing(NoData::Disconnected),
        amplifier: Err(NoData::Corrupt),
        stage: Err(NoData::Invalid),
        lateness: Nanos(17),
        supply: Ok(SUPPLY),
        contacts: Contacts::ABSENT,
    };
    let inputs = Inputs { commands: [Some(Command::Reset), None, None, None], seen };
    for (supply, cut) in [(SupplyCommand::Cut, true), (SupplyCommand::Restore, false)] {
        let decision = SafetyDecision {
            drive: DriveCommand::off(1, Nanos(50)),
            stage: StageCommand::stop(1, Nanos(50)),
            supply,
            tripped: None,
            armed_now: false,
            blocking: Some(TripCause::Stopped),
            waits_for: Some(TripCause::EmergencyStop),
            lateral_usable: !cut,
            normal_usable: !cut,
            remark: Some(Remark::AmplitudeSags),
        };
        let out = Outputs {
            decision,
            armed: !cut,
            proving: cut,
            marker: Marker { point: 9, ..Marker::default() },
            mu_relative: Err(NoMu::NoContact),
            online: None,
            usable: !cut,
            rendered: Some(Rendered {
                wanted: 0.6,
                amplitude: models::quantity::PeakToPeak::from_metres(1e-6),
                expected: 0.59,
                slope_per_m: -3e5,
                reach: models::inverse::Reach::Within,
                correction: None,
            }),
        };
        let row = Row::of(12, Nanos(34), &inputs, &out);
        assert_eq!((row.cycle, row.now, row.inputs), (12, Nanos(34), inputs));
        assert_eq!((row.drive_pp_m, row.drive_hz, row.velocity_m_s, row.load_n), (0.0, 0.0, 0.0, 0.0));
        assert_eq!((row.supply_cut, row.proving, row.armed, row.usable), (cut, cut, !cut, !cut));
        assert_eq!(
            (row.marker, row.tripped, row.blocking),
            (out.marker, decision.tripped, decision.blocking)
        );
        assert_eq!((row.waits_for, row.remark), (decision.waits_for, decision.remark));
        assert_eq!((row.mu_relative, row.online), (out.mu_relative, out.online));
        assert_eq!(row.rendered, out.rendered);
    }
}
