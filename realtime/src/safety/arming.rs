//! The way from faulted to armed: one reset edge, the second switch-off channel proved, every cause clear.
//!
//! A reset clears and never restarts: it drops earlier requests, and the outputs stay at zero until a request
//! comes in a later cycle. A fitted second channel is opened and closed before every arming, and its own
//! readback must show both.

use super::cause::{TripCause, Unit};
use super::rules::Breach;
use super::{Safety, SafetyDecision, State, Trip};
use crate::signals::{Nanos, NoData, SupplyCommand, SupplyState};

/// Time within which the second channel must show the commanded state: ten times a contactor's, and a poll.
pub(super) const SUPPLY_ACTS: Nanos = Nanos(500_000_000);
/// Time that an amplifier may take to come back, with every other cause clear, once its supply is closed again.
const RESTART: Nanos = Nanos(5_000_000_000);

/// What is being proved before the rig is armed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Proof {
    /// The second channel is commanded to cut and must read cut.
    Opens,
    /// It is commanded to restore and must read closed; the amplifier must come back.
    Closes,
}

/// Why the second channel was cut for cause, the gravest last: it stays until the channel is proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum CutFor {
    /// Somebody is about to reach into the rig: the program requested the cut, and will request the proof.
    Hands,
    /// Nothing was heard of the emergency stop: no person has done anything, and none has to undo it.
    Silence,
    /// The emergency stop was pressed.
    Pressed,
    /// The amplifier stayed on after 'off'.
    Refusal,
}

impl CutFor {
    /// What a person must look at before anything is armed again; none where nothing but a link or the machine fell silent.
    const fn needs_a_person(self) -> Option<TripCause> {
        match self {
            Self::Hands | Self::Silence => None,
            Self::Pressed => Some(TripCause::EmergencyStop),
            Self::Refusal => Some(TripCause::RefusesOff),
        }
    }
}

/// Causes that a supply cut on purpose brings about by itself.
const WITH_THE_CUT: &[TripCause] = &[
    TripCause::RefusesOff,
    TripCause::AmplifierStale,
    TripCause::AmplifierFault,
    TripCause::AmplifierWatchdog,
    TripCause::AmplitudeSaturated,
    TripCause::OverTemperature,
];

impl TripCause {
    /// Whether an amplifier shows this by itself where its supply is open: then it says nothing of the amplifier.
    pub fn may_be_an_open_supply(self) -> bool {
        WITH_THE_CUT[1..].contains(&self)
    }
}

/// What a cycle of arming looks at.
pub(super) struct ArmingStep {
    /// The first broken rule, and the first one that [`Safety::excused`] does not excuse.
    pub broken: Option<Breach>,
    pub besides_the_cut: Option<Breach>,
    pub cuts_the_supply: Option<CutFor>,
    pub is_late: bool,
    pub supply: Result<SupplyState, NoData>,
    pub reset_edge: bool,
    pub cycle: u64,
    pub now: Nanos,
}

impl ArmingStep {
    /// Whether the second channel reads cut, or closed, by a sample taken since then.
    fn shows(&self, since: Nanos, cut: bool) -> bool {
        self.supply.is_ok_and(|s| s.taken_at > since && s.taken_at <= self.now && s.cut == cut)
    }
}

impl Safety {
    /// Causes that do not stand in the way now, because the supply is cut on purpose.
    pub(super) fn excused(&self, supply: Result<SupplyState, NoData>) -> &'static [TripCause] {
        if supply == Err(NoData::NotFitted) {
            return &[];
        }
        match self.state {
            State::Proving { proof: Proof::Opens, .. } => WITH_THE_CUT,
            // Once it is closed again an amplifier that comes back on by itself is no longer excused.
            State::Proving { proof: Proof::Closes, .. } => &WITH_THE_CUT[1..],
            State::Faulted(_) if self.supply_cut.is_some() => WITH_THE_CUT,
            State::Faulted(_) | State::Armed { .. } => &[],
        }
    }

    /// What a reset that nobody but a program asks for would have to wait for: what is broken now, save what follows from a
    /// supply that was cut on purpose, and what only a person may put right; and missed deadlines that would trip the rig once armed.
    pub(super) fn waits_for(&self, step: &ArmingStep) -> Option<TripCause> {
        let besides = step.besides_the_cut.map(|breach| breach.cause);
        let fitted = step.supply != Err(NoData::NotFitted);
        match self.state {
            State::Faulted(_) => {
                // An amplifier without supply has no fault of its own.
                let open = step.supply.is_ok_and(|s| s.cut);
                let besides = besides
                    .map(|c| if open && c.may_be_an_open_supply() { TripCause::SupplySwitch } else { c });
                let cut = self.supply_cut.max(step.cuts_the_supply).filter(|_| fitted);
                let late = step.is_late.then_some(TripCause::Overrun);
                besides.or(cut.and_then(CutFor::needs_a_person)).or(late)
            }
            // Closed again, the amplifier is waited for.
            State::Proving { proof: Proof::Closes, since } if step.shows(since, false) => {
                step.broken.map(|breach| breach.cause)
            }
            State::Proving { .. } | State::Armed { .. } => besides,
        }
    }

    /// Moves from state to state. Enters what is new into the decision.
    pub(super) fn advance(&mut self, step: &ArmingStep, decision: &mut SafetyDecision) {
        match self.state {
            State::Armed { .. } => {
                if let Some(breach) = step.broken {
                    self.trip(breach, step, decision);
                }
            }
            State::Faulted(_) if step.reset_edge && step.besides_the_cut.is_none() => match step.supply {
                Err(NoData::NotFitted) => self.arm(step.now, decision),
                _ => self.state = State::Proving { proof: Proof::Opens, since: step.now },
            },
            State::Faulted(_) => {}
            State::Proving { proof, since } => self.prove(step, proof, since, decision),
        }
        if !self.is_proving() {
            self.supply_cut = self.supply_cut.max(step.cuts_the_supply);
        }
    }

    fn prove(&mut self, step: &ArmingStep, proof: Proof, since: Nanos, decision: &mut SafetyDecision) {
        let now = step.now;
        if let Some(breach) = step.besides_the_cut {
            return self.trip(breach, step, decision);
        }
        match proof {
            Proof::Opens if step.shows(since, true) => {
                self.state = State::Proving { proof: Proof::Closes, since: now };
                self.watch.supply_is_cut();
            }
            Proof::Closes if step.shows(since, false) && step.broken.is_none() => self.arm(now, decision),
            _ => {
                let closed = step.shows(since, false);
                let within = if proof == Proof::Closes && closed { RESTART } else { SUPPLY_ACTS };
                let waited = now.since(since);
                if waited > within {
                    let cause = step.broken.filter(|_| closed).map_or(TripCause::SupplySwitch, |b| b.cause);
                    let (value, bound) = (waited.seconds(), within.seconds());
                    let breach = Breach { cause, value, bound, unit: Unit::Second };
                    self.trip(breach, step, decision);
                }
            }
        }
    }

    fn arm(&mut self, now: Nanos, decision: &mut SafetyDecision) {
        self.state = State::Armed { since: now };
        (self.supply_cut, self.requested) = (None, false);
        self.watch.lateral.forget_losses();
        self.watch.normal.forget_losses();
        decision.armed_now = true;
    }

    fn trip(&mut self, breach: Breach, step: &ArmingStep, decision: &mut SafetyDecision) {
        let Breach { cause, value, bound, unit } = breach;
        // A sum with 0.0 is never -0.0, which a reader would see as a number below zero.
        let trip =
            Trip { cause, value: value + 0.0, bound: bound + 0.0, unit, cycle: step.cycle, at: step.now };
        self.state = State::Faulted(trip);
        self.requested = false;
        self.watch.forget_the_hand();
        decision.tripped = Some(trip);
    }

    /// The command to the second channel: closed, unless it is being proved, or was cut since its last proof.
    pub(super) fn supply(&self) -> SupplyCommand {
        match self.state {
            State::Proving { proof: Proof::Opens, .. } => SupplyCommand::Cut,
            State::Proving { proof: Proof::Closes, .. } => SupplyCommand::Restore,
            _ if self.supply_cut.is_some() => SupplyCommand::Cut,
            _ => SupplyCommand::Restore,
        }
    }
}
