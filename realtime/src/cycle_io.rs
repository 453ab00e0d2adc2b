//! One cycle of the loop over ports, and the row that it leaves for the record.
//!
//! [`run_cycle`] reads the [`Ports`], takes the decision of [`cycle::decide`] to them, and only then lets
//! [`cycle::judge`] compare with the model. The loop's thread, virtual time and fault bench call it alike.
//! [`Row`] is plain data: what came in and what was decided, enough to run the cycle again.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::cycle::{self, COMMANDS_PER_CYCLE, Config, CycleState, Inputs, Marker, Online, Outputs};
use crate::estimate::{MuRelative, NoMu};
use crate::ports::{Absent, Amplifier, ForceSensor, Nanos, SafetyInputs, Stage, SupplyCommand, SupplySwitch};
use crate::render::Rendered;
use crate::safety::{Observation, Remark, Trip, TripCause};
use models::FrictionModel;
use serde::{Deserialize, Serialize};

/// The rig as the loop holds it.
pub struct Ports {
    /// Reads the forces.
    pub force: Box<dyn ForceSensor>,
    /// Drives the plate.
    pub amplifier: Box<dyn Amplifier>,
    /// Moves and loads the finger.
    pub stage: Box<dyn Stage>,
    /// The second switch-off channel; [`Absent`] where the rig has none.
    pub supply: Box<dyn SupplySwitch>,
    /// Emergency stop, interlock and dead-man; [`Absent`] where the rig has none.
    pub contacts: Box<dyn SafetyInputs>,
}

impl Ports {
    /// A rig without a second switch-off channel and without safety contacts.
    pub fn new(force: Box<dyn ForceSensor>, amplifier: Box<dyn Amplifier>, stage: Box<dyn Stage>) -> Self {
        Ports { force, amplifier, stage, supply: Box::new(Absent), contacts: Box::new(Absent) }
    }
}

/// One cycle for the record: what came in, what was decided. Plain data, `Copy`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Number of the cycle, from 1.
    pub cycle: u64,
    /// Loop time.
    pub now: Nanos,
    /// Everything the cycle saw; enough to run it again.
    pub inputs: Inputs,
    /// Drive amplitude commanded, peak-to-peak in m; zero is off.
    pub drive_pp_m: f64,
    /// Drive frequency commanded in Hz.
    pub drive_hz: f64,
    /// Velocity commanded in m/s.
    pub velocity_m_s: f64,
    /// Normal load commanded in N.
    pub load_n: f64,
    /// Which pass the cycle belongs to.
    pub marker: Marker,
    /// Whether the rig is armed.
    pub armed: bool,
    /// Whether the second switch-off channel was being proved.
    #[serde(default)]
    pub proving: bool,
    /// Whether the supply was commanded to be cut.
    #[serde(default)]
    pub supply_cut: bool,
    /// A trip latched in this cycle.
    pub tripped: Option<Trip>,
    /// The first rule that is broken now, latched or not.
    pub blocking: Option<TripCause>,
    /// What stands in the way of arming: for whoever asks for a reset. It follows from the inputs, and is not recorded.
    #[serde(skip)]
    pub waits_for: Option<TripCause>,
    /// Running `mu'`, or why there is none.
    pub mu_relative: Result<MuRelative, NoMu>,
    /// Comparison with the model.
    pub online: Option<Online>,
    /// Both forces fit for use.
    pub usable: bool,
    /// Something is not as it should be, short of a trip.
    pub remark: Option<Remark>,
    /// What a target wants here, and the amplitude that the next cycle requests for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rendered: Option<Rendered>,
}

impl Row {
    /// The row of a cycle.
    pub fn of(cycle: u64, now: Nanos, inputs: &Inputs, out: &Outputs) -> Self {
        let decision = &out.decision;
        Row {
            cycle,
            now,
            inputs: *inputs,
            drive_pp_m: decision.drive.amplitude().metres(),
            drive_hz: decision.drive.frequency_hz(),
            velocity_m_s: decision.stage.velocity_m_s(),
            load_n: decision.stage.normal_force_n(),
            marker: out.marker,
            armed: out.armed,
            proving: out.proving,
            supply_cut: decision.supply == SupplyCommand::Cut,
            tripped: decision.tripped,
            blocking: decision.blocking,
            waits_for: decision.waits_for,
            mu_relative: out.mu_relative,
            online: out.online,
            usable: out.usable,
            remark: decision.remark,
            rendered: out.rendered,
        }
    }
}

/// The time of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Tick {
    /// Number of the cycle, from 1.
    pub number: u64,
    /// How late it began.
    pub lateness: Nanos,
    /// Loop time now.
    pub now: Nanos,
}

/// One cycle: read the ports, decide, command the ports, and only then estimate and compare: a slow model delays no 'off'.
/// `next_command` gives the commands that wait, oldest first.
pub fn run_cycle(
    config: &Config,
    model: &dyn FrictionModel,
    state: &mut CycleState,
    ports: &mut Ports,
    next_command: &mut dyn FnMut() -> Option<cycle::Command>,
    tick: Tick,
) -> Row {
    let Tick { number, lateness, now } = tick;
    let mut taken = [None; COMMANDS_PER_CYCLE];
    for slot in &mut taken {
        *slot = next_command();
        if slot.is_none() {
            break;
        }
    }
    let seen = Observation {
        forces: ports.force.read(now),
        amplifier: ports.amplifier.state(now),
        stage: ports.stage.state(now),
        lateness,
        supply: ports.supply.state(now),
        contacts: ports.contacts.read(now),
    };
    let inputs = Inputs { commands: taken, seen };
    let decision = cycle::decide(config, state, &inputs, now);
    ports.amplifier.command(decision.drive, now);
    ports.supply.command(decision.supply, now);
    ports.stage.command(decision.stage, now);
    let out = cycle::judge(config, model, state, &inputs, &decision, now);
    Row::of(number, now, &inputs, &out)
}

#[cfg(test)]
mod tests;
