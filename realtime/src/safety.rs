//! Safety: limits, the state machine, and the only constructors of commands that move or drive anything.
//!
//! Duties: decide each cycle, before anything else, whether the rig may drive and move; latch what went wrong with
//! its cause, value, bound and cycle; hand out commands that the limits allow.
//! Owners: `limits.rs` the numbers, `watch.rs` what must be remembered of each channel, `rules.rs` the rules with
//! their requirement identifiers. This file: states, requests, and commands.
//!
//! ```text
//!                 reset edge, every cause clear
//!   Faulted(trip) ------------------------------> Armed
//!      ^   ^                                        |
//!      |   +---- any rule broken, or a stop --------+
//!      +-- start-up
//! ```
//! Faulted commands output off, stage at rest, finger lifted. Armed passes requests on, clamped to nothing: a
//! request beyond a limit is a trip, not a smaller request.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

mod limits;
mod rules;
mod watch;

use crate::ports::{AmplifierState, Forces, Nanos, NoData, StageState};
use models::quantity::PeakToPeak;
use serde::{Deserialize, Serialize};

pub use limits::{ChannelTiming, HARD, HardLimits, LimitError, Limits, Timing};
pub use rules::{Cause, RULES, Rule};
use watch::Watch;

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
    /// An amplitude of zero, an answer that is no amplitude, and one over the hard limit all become zero.
    #[must_use]
    pub fn on_scale(self, set_point: impl FnOnce(PeakToPeak) -> Option<PeakToPeak>) -> Self {
        let allowed = |w: &PeakToPeak| (0.0..=HARD.amplitude_max.metres()).contains(&w.metres());
        let asked = Some(self.amplitude).filter(|w| self.enable && *w > PeakToPeak::ZERO);
        let amplitude = asked.and_then(set_point).filter(allowed).unwrap_or(PeakToPeak::ZERO);
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
    pub cause: Cause,
    /// The value that broke it, in the unit of the rule's bound; infinite where there was no data at all.
    #[serde(with = "crate::number")]
    pub value: f64,
    /// The bound that it broke.
    #[serde(with = "crate::number")]
    pub bound: f64,
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
    /// The dead-man input of human-contact mode: true while held.
    pub dead_man: bool,
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
    /// How late this cycle began.
    pub lateness: Nanos,
}

/// What safety decided in a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Decision {
    /// For the amplifier.
    pub drive: DriveCommand,
    /// For the stage.
    pub stage: StageCommand,
    /// Whether the second switch-off channel is to be opened.
    pub cut_supply: bool,
    /// A trip that was latched in this cycle.
    pub tripped: Option<Trip>,
    /// Whether the rig was armed in this cycle.
    pub armed_now: bool,
    /// The first rule that is broken now, latched or not: what a reset would have to wait for.
    pub blocking: Option<Cause>,
    /// Lateral force fit for use: valid, fresh, no spike.
    pub lateral_usable: bool,
    /// Normal force fit for use.
    pub normal_usable: bool,
    /// Something is not as it should be, short of a trip.
    pub remark: Option<Remark>,
}

/// What is not as it should be while the rig may still run: the data are kept, and flagged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Remark {
    /// More than 15 % of the lateral samples that were due did not come.
    LateralLossy,
    /// More than 15 % of the normal samples that were due did not come.
    NormalLossy,
    /// The plate moves less than 0.7 of what it is told: resonance drifted, or a load damps it.
    AmplitudeSags,
}

/// Safety's memory. `Copy`: it can hold no lock, no heap and no handle.
#[derive(Clone, Copy, Debug)]
pub struct Safety {
    state: State,
    watch: Watch,
    cycle: u64,
    sequence: u32,
    reset_before: bool,
}

impl Default for Safety {
    fn default() -> Self {
        Self::new()
    }
}

impl Safety {
    /// Starts faulted: nothing drives before an explicit reset.
    pub const fn new() -> Self {
        let start = Trip { cause: Cause::StartUp, value: 0.0, bound: 0.0, cycle: 0, at: Nanos(0) };
        Safety {
            state: State::Faulted(start),
            watch: Watch::new(),
            cycle: 0,
            sequence: 0,
            reset_before: false,
        }
    }

    /// The present state.
    pub const fn state(&self) -> State {
        self.state
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
    ) -> Decision {
        self.cycle += 1;
        self.sequence = self.sequence.wrapping_add(1);
        let reset_edge = controls.reset && !self.reset_before;
        self.reset_before = controls.reset;

        self.watch.look(limits, seen, now);
        let armed_since = match self.state {
            State::Armed { since } => Some(since),
            State::Faulted(_) => None,
        };
        let context =
            rules::Context { limits, seen, request, controls, watch: &self.watch, armed_since, now };
        let broken = rules::first_broken(&context);
        let remark = rules::remark(&context);

        let mut tripped = None;
        let mut armed_now = false;
        match (self.state, broken) {
            (State::Armed { .. }, Some(breach)) => {
                let trip = Trip {
                    cause: breach.cause,
                    value: breach.value,
                    bound: breach.bound,
                    cycle: self.cycle,
                    at: now,
                };
                self.state = State::Faulted(trip);
                tripped = Some(trip);
            }
            (State::Faulted(_), None) if reset_edge => {
                self.state = State::Armed { since: now };
                armed_now = true;
                self.watch.lateral.forget_losses();
                self.watch.normal.forget_losses();
            }
            _ => {}
        }

        let expires_at = now.plus(limits.timing.command_expiry);
        let (drive, stage) = match self.state {
            State::Armed { .. } => (
                DriveCommand::within(limits, request, self.sequence, expires_at),
                StageCommand {
                    velocity_m_s: request.velocity_m_s,
                    normal_force_n: request.normal_force_n,
                    sequence: self.sequence,
                    expires_at,
                },
            ),
            State::Faulted(_) => {
                (DriveCommand::off(self.sequence, expires_at), StageCommand::stop(self.sequence, expires_at))
            }
        };
        self.watch.commanded(&drive, &stage, now);
        Decision {
            drive,
            stage,
            cut_supply: self.watch.refuses_off(limits, now),
            tripped,
            armed_now,
            blocking: broken.map(|b| b.cause),
            lateral_usable: self.watch.lateral.usable,
            normal_usable: self.watch.normal.usable,
            remark,
        }
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
