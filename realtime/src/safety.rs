//! Safety: limits, the state machine, and the only constructors of commands that move or drive anything.
//!
//! Duties: decide each cycle, before anything else, whether the rig may drive and move; latch what went wrong
//! with its cause, value, bound and cycle; hand out commands that the limits allow. Owners: `limits.rs` the
//! numbers, `watch.rs`, `envelope.rs` and `exposure.rs` the memory, `rules.rs` the rules with their identifiers,
//! `cause.rs` the texts of a trip, `arming.rs` the way to armed; here states, requests and commands.
//!
//! ```text
//!                 reset edge, causes clear             second channel opened and
//!   Faulted(trip) --------------------------> Proving ---- closed, causes clear ----> Armed
//!      ^   ^                                     |                                      |
//!      |   +------- any rule broken, a stop, or a proof that failed --------------------+
//!      +-- start-up                (without a second channel: straight to Armed)
//! ```
//! Faulted and Proving command output off, stage at rest, finger lifted. Armed passes on requests that came
//! since it was armed, clamped to nothing: a request beyond a limit is a trip, not a smaller request.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

mod arming;
mod cause;
mod envelope;
mod exposure;
mod limits;
mod rules;
mod watch;

use crate::signals::{
    AmplifierState, Contacts, Forces, Nanos, NoData, StageState, SupplyCommand, SupplyState,
};
use models::PeakToPeak;
use serde::{Deserialize, Serialize};

pub use arming::Proof;
pub use cause::{TripCause, Unit};
pub use exposure::{Exposed, MINUTE_NS, MINUTES, PART_MINUTES, PARTS};
pub use limits::{ChannelTiming, HARD, HardLimits, LimitError, Limits, Timing};
pub use rules::{RULES, Rule};
use watch::SafetyMemory;

/// An absolute set-point for the amplifier. Only this module can make one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DriveCommand {
    amplitude: PeakToPeak,
    frequency_hz: f64,
    enable: bool,
    sequence: u32,
    expires_at: Nanos,
}

impl DriveCommand {
    /// Peak-to-peak amplitude; zero when not enabled.
    pub const fn amplitude(&self) -> PeakToPeak {
        self.amplitude
    }

    /// Drive frequency in Hz.
    pub const fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// Whether the output is to be on.
    pub const fn enable(&self) -> bool {
        self.enable
    }

    /// Counts commands; doubles as the heartbeat that the amplifier's watchdog watches.
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// When the command must no longer be sent.
    pub const fn expires_at(&self) -> Nanos {
        self.expires_at
    }

    /// The same command on the amplifier's own scale, where a certificate knows that scale: only its amplitude changes.
    /// An amplitude of zero, an answer that is not an amplitude, and one over the hard limit all become zero.
    pub fn on_scale(self, set_point: impl FnOnce(PeakToPeak) -> Option<PeakToPeak>) -> Self {
        let allowed = |w: &PeakToPeak| (0.0..=HARD.amplitude_max.metres()).contains(&w.metres());
        let requested = Some(self.amplitude).filter(|w| self.enable && *w > PeakToPeak::ZERO);
        let amplitude = requested.and_then(set_point).filter(allowed).unwrap_or(PeakToPeak::ZERO);
        DriveCommand { amplitude, ..self }
    }

    /// The command that every state but one gives: output off, amplitude zero.
    pub const fn off(sequence: u32, expires_at: Nanos) -> Self {
        DriveCommand { amplitude: PeakToPeak::ZERO, frequency_hz: 0.0, enable: false, sequence, expires_at }
    }
}

/// Absolute set-points for the stage. Only this module can make one that moves.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct StageCommand {
    velocity_m_s: f64,
    normal_force_n: f64,
    sequence: u32,
    expires_at: Nanos,
}

impl StageCommand {
    /// Velocity along the stroke in m/s, signed.
    pub const fn velocity_m_s(&self) -> f64 {
        self.velocity_m_s
    }

    /// Normal load set-point in N; zero lifts the finger off.
    pub const fn normal_force_n(&self) -> f64 {
        self.normal_force_n
    }

    /// Counts commands.
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// When the command must no longer be sent.
    pub const fn expires_at(&self) -> Nanos {
        self.expires_at
    }

    /// Stand still, lifted off.
    pub const fn stop(sequence: u32, expires_at: Nanos) -> Self {
        StageCommand { velocity_m_s: 0.0, normal_force_n: 0.0, sequence, expires_at }
    }
}

/// What broke a rule, when, and by how much.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trip {
    /// The rule.
    pub cause: TripCause,
    /// The value that broke it; infinite where there was no data at all.
    #[serde(with = "crate::number")]
    pub value: f64,
    /// The bound that it broke.
    #[serde(with = "crate::number")]
    pub bound: f64,
    /// Unit of value and bound.
    #[serde(default)]
    pub unit: Unit,
    /// The cycle in which it was decided.
    pub cycle: u64,
    /// The time at which it was decided.
    pub at: Nanos,
}

/// The state of the rig. Each state carries only what it needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum State {
    /// Off, at rest, lifted; waiting for an explicit reset with every cause clear.
    Faulted(Trip),
    /// Off, at rest, lifted; the second switch-off channel is being proved.
    Proving {
        /// What is proved.
        proof: Proof,
        /// Since when.
        since: Nanos,
    },
    /// Requests within the limits are passed on.
    Armed {
        /// When it was armed.
        since: Nanos,
    },
}

/// What the sweep (or a person) asks for.
#[derive(Clone, Copy, Debug, PartialEq, Default, Serialize, Deserialize)]
pub struct Request {
    /// Peak-to-peak amplitude.
    pub amplitude: PeakToPeak,
    /// Drive frequency in Hz; only looked at where the amplitude is above zero.
    pub frequency_hz: f64,
    /// Velocity along the stroke in m/s, signed.
    pub velocity_m_s: f64,
    /// Normal load in N; zero lifts the finger off.
    pub normal_force_n: f64,
}

/// What arms and stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Controls {
    /// A rising edge arms, if every cause is clear.
    pub reset: bool,
    /// Stops the rig and latches.
    pub stop: bool,
    /// The dead-man key of a trial, where the limits allow one: true while held, and no longer than its age.
    pub dead_man: bool,
    /// A request came in this cycle.
    pub new_request: bool,
    /// The second channel opens, where it is fitted, until it is proved again: somebody is about to reach into the rig.
    #[serde(default)]
    pub open_supply: bool,
    /// The amplitude changes from cycle to cycle: what it should be is judged over a stretch of time.
    #[serde(default)]
    pub modulated: bool,
}

/// Everything that safety looks at in a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Observation {
    /// The forces.
    pub forces: Forces,
    /// The amplifier.
    pub amplifier: Result<AmplifierState, NoData>,
    /// The stage.
    pub stage: Result<StageState, NoData>,
    /// Time from the deadline that was due to the begin of this cycle: deadlines that were missed before it are in it.
    pub lateness: Nanos,
    /// The second switch-off channel.
    #[serde(default = "not_fitted")]
    pub supply: Result<SupplyState, NoData>,
    /// Emergency stop, interlock, dead-man.
    #[serde(default)]
    pub contacts: Contacts,
}

/// Records from before there was a second channel hold none.
const fn not_fitted() -> Result<SupplyState, NoData> {
    Err(NoData::NotFitted)
}

impl Observation {
    /// Deadlines that were missed before this cycle began.
    pub fn missed(&self, cycle: Nanos) -> u32 {
        u32::try_from(self.lateness.0 / cycle.0.max(1)).unwrap_or(u32::MAX)
    }
}

/// What safety decided in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SafetyDecision {
    /// For the amplifier.
    pub drive: DriveCommand,
    /// For the stage.
    pub stage: StageCommand,
    /// For the second switch-off channel.
    pub supply: SupplyCommand,
    /// A trip that was latched in this cycle.
    pub tripped: Option<Trip>,
    /// Whether the rig was armed in this cycle.
    pub armed_now: bool,
    /// The first rule that is broken now, latched or not.
    pub blocking: Option<TripCause>,
    /// What stands in the way of arming: as `blocking`, save what follows from a supply that was cut on purpose (its amplifier may
    /// show a fault, or nothing), and what only a person may put right before a program asks for a reset, or what would trip at once.
    pub waits_for: Option<TripCause>,
    /// Lateral force fit for use: valid, fresh, no spike.
    pub lateral_usable: bool,
    /// Normal force fit for use.
    pub normal_usable: bool,
    /// Something is not as it should be, short of a trip.
    pub remark: Option<Remark>,
}

/// What is not as it should be while the rig may still run: the data are stored, and flagged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remark {
    /// More than 15 % of the lateral samples that were due did not come.
    LateralLossy,
    /// More than 15 % of the normal samples that were due did not come.
    NormalLossy,
    /// The plate moves less than 0.7 of the commanded amplitude: resonance drifted, or a load damps it.
    AmplitudeSags,
}

impl Remark {
    /// What a person reads of it.
    pub const fn words(self) -> &'static str {
        match self {
            Remark::LateralLossy => "more than 15 % of the lateral samples did not come",
            Remark::NormalLossy => "more than 15 % of the normal samples did not come",
            Remark::AmplitudeSags => "the plate moved less than 0.7 of the commanded amplitude",
        }
    }
}

/// Safety's memory. `Copy`: it can hold no lock, no heap and no handle.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    state: State,
    watch: SafetyMemory,
    cycle: u64,
    sequence: u32,
    reset_before: bool,
    /// A request came since the rig was armed.
    requested: bool,
    /// What the second channel was cut for, where it has not been proved since.
    supply_cut: Option<arming::CutFor>,
}

impl Default for Safety {
    /// Starts faulted: nothing drives before an explicit reset.
    fn default() -> Self {
        let (cause, unit) = (TripCause::StartUp, Unit::Flag);
        let start = Trip { cause, value: 0.0, bound: 0.0, unit, cycle: 0, at: Nanos(0) };
        Safety {
            state: State::Faulted(start),
            watch: SafetyMemory::new(),
            cycle: 0,
            sequence: 0,
            reset_before: false,
            requested: false,
            supply_cut: None,
        }
    }
}

impl Safety {
    /// Takes over the exposure of earlier runs. Of use before the first cycle only: what is there is replaced.
    pub fn carry(&mut self, past: &Exposed) {
        self.watch.exposure.carry(past);
    }

    /// Time that the plate was driven in this run, and the squared rms velocity summed over it, in m2/s.
    pub const fn exposure(&self) -> (Nanos, f64) {
        self.watch.exposure.in_all
    }

    /// Whether the second switch-off channel is being proved.
    pub const fn is_proving(&self) -> bool {
        matches!(self.state, State::Proving { .. })
    }

    /// Whether requests are passed on.
    pub const fn is_armed(&self) -> bool {
        matches!(self.state, State::Armed { .. })
    }

    /// One cycle: judge what is seen, then the request, then command.
    pub fn step(
        &mut self,
        limits: &Limits,
        seen: &Observation,
        request: &Request,
        controls: Controls,
        now: Nanos,
    ) -> SafetyDecision {
        self.cycle += 1;
        self.sequence = self.sequence.wrapping_add(1);
        let reset_edge = controls.reset && !self.reset_before;
        self.reset_before = controls.reset;

        self.watch.look(limits, seen, controls, now);
        let armed_since = match self.state {
            State::Armed { since } => Some(since),
            State::Faulted(_) | State::Proving { .. } => None,
        };
        // A request counts from the cycle after arming on: a reset drops earlier requests.
        self.requested = armed_since.is_some() && (self.requested || controls.new_request);
        let request = if self.requested { *request } else { Request::default() };
        let context = rules::Context {
            limits,
            seen,
            request: &request,
            controls,
            watch: &self.watch,
            armed_since,
            now,
        };
        let broken = rules::first_broken_but(&context, &[]);
        let mut decision = SafetyDecision {
            drive: DriveCommand::off(self.sequence, now),
            stage: StageCommand::stop(self.sequence, now),
            supply: SupplyCommand::Cut,
            tripped: None,
            armed_now: false,
            blocking: broken.map(|b| b.cause),
            waits_for: None,
            lateral_usable: self.watch.lateral.usable,
            normal_usable: self.watch.normal.usable,
            remark: rules::remark(&context),
        };
        let step = arming::ArmingStep {
            besides_the_cut: rules::first_broken_but(&context, self.excused(seen.supply)),
            broken,
            cuts_the_supply: rules::cuts_the_supply(&context),
            is_late: rules::is_late(&context),
            supply: seen.supply,
            reset_edge,
            cycle: self.cycle,
            now,
        };
        decision.waits_for = self.waits_for(&step);
        self.advance(&step, &mut decision);

        let expires_at = now.plus(limits.timing.command_expiry);
        (decision.drive, decision.stage) = match self.state {
            State::Armed { .. } => (
                DriveCommand::within(limits, &request, self.sequence, expires_at),
                StageCommand {
                    velocity_m_s: request.velocity_m_s,
                    normal_force_n: request.normal_force_n,
                    sequence: self.sequence,
                    expires_at,
                },
            ),
            State::Faulted(_) | State::Proving { .. } => {
                (DriveCommand::off(self.sequence, expires_at), StageCommand::stop(self.sequence, expires_at))
            }
        };
        decision.supply = self.supply();
        self.watch.commanded(&decision, now);
        decision
    }
}

impl DriveCommand {
    /// The command for a request that the rules have passed. Anything else is off: the last line of defence.
    fn within(limits: &Limits, request: &Request, sequence: u32, expires_at: Nanos) -> Self {
        let wanted = request.amplitude.metres();
        let inside = wanted > 0.0
            && wanted <= limits.amplitude_max.metres()
            && wanted <= HARD.amplitude_max.metres()
            && request.frequency_hz >= limits.frequency_hz.0
            && request.frequency_hz <= limits.frequency_hz.1;
        if !inside {
            return DriveCommand::off(sequence, expires_at);
        }
        DriveCommand {
            amplitude: request.amplitude,
            frequency_hz: request.frequency_hz,
            enable: true,
            sequence,
            expires_at,
        }
    }
}

#[cfg(test)]
mod tests;
