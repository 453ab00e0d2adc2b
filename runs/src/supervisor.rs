//! The only way to lead a loop: rigs in wall-clock and in virtual time are driven by [`sweep`].
//!
//! Two types implement [`Loop`]: [`VirtualLoop`] here, and `WallClockLoop` in the crate `rig`, which owns
//! queue, lifeline, rings and links. Whatever ends a sweep (an orderly end, an error, a panic, a signal), the
//! stop goes to the loop first, then the links switch off and read back. Only a drive that was read back off is
//! reported as off.

mod virtual_time;

pub use virtual_time::VirtualLoop;

use crate::sweep::{Outcome, Reaction, Sweep};
use drivers::{Closed, LinkEnd, PortRole};
use realtime::{Command, Row};
use serde::{Deserialize, Serialize};

/// The warning if the drive was not read back off.
pub const MAY_BE_ON: &str = "the output may still be on: switch the supply off";

/// A loop at work, in whichever time it runs.
pub trait Loop {
    /// The next row; `None` where none has come yet.
    fn next_row(&mut self) -> Option<Row>;

    /// Hands a command over. False: the loop does not live any more.
    fn send(&mut self, command: Command) -> bool;

    /// Stops at once: the stop waits behind nothing that can be thrown away.
    fn stop(&mut self);

    /// Whether nothing was heard of the loop for so long that it counts as lost.
    fn is_lost(&self) -> bool;
}

/// Why a sweep is to end before its plan does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// On request.
    Requested,
    /// The results cannot be saved.
    NotSaved,
    /// What the finger is exposed to cannot be written.
    ExposureNotSaved,
}

/// What whoever leads a sweep asks of it now.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Requests {
    /// It is to end before its plan does.
    pub end: Option<End>,
    /// It is to rest before the next pass.
    pub pause: bool,
}

/// Feeds a sweep with the loop's rows and sends its commands, until it ends. `ask` returns the requests to
/// the sweep; `each` takes every row with what it led to, after the commands have left.
pub fn sweep(
    rig: &mut impl Loop,
    sweep: &mut Sweep,
    ask: &mut dyn FnMut() -> Requests,
    each: &mut dyn FnMut(&Row, &mut Sweep, Reaction),
) -> Outcome {
    let mut instead = None;
    // Entered once for each pass and not for each row: in virtual time a row takes some microseconds.
    let (mut point, mut span) = (None, None);
    loop {
        let requests = ask();
        if let Some(end) = requests.end {
            // Safe state first: the command goes out before anything else is looked at.
            rig.stop();
            sweep.stop();
            let why = match end {
                End::Requested => None,
                End::NotSaved => Some(Outcome::RecordLost),
                End::ExposureNotSaved => Some(Outcome::ExposureNotSaved),
            };
            instead = instead.or(why);
        }
        sweep.pause(requests.pause);
        let Some(row) = rig.next_row() else {
            if rig.is_lost() {
                return Outcome::LoopLost;
            }
            continue;
        };
        if sweep.pass_under_way() != point {
            // The one before is left first.
            drop(span.take());
            point = sweep.pass_under_way();
            span = point.map(|point| tracing::warn_span!("pass", point).entered());
        }
        let mut reaction = sweep.on_row(&row);
        for command in reaction.commands.drain(..) {
            if !rig.send(command) {
                return Outcome::LoopLost;
            }
        }
        let outcome = reaction.outcome.clone();
        each(&row, sweep, reaction);
        match outcome {
            Some(Outcome::Stopped) => return instead.unwrap_or(Outcome::Stopped),
            Some(outcome) => return outcome,
            None => {}
        }
    }
}

/// Whether the rig was seen off in the end.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct OffReport {
    /// Whether every drive and stage showed, after it was switched off for the last time, that it is off.
    pub read_back: bool,
    /// The instruments that did not show it, each with the reason.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub not_read_back: Vec<NotOff>,
}

/// An instrument that did not show that it is off.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct NotOff {
    /// Id of its profile.
    pub instrument: String,
    /// Whether it drives the plate; else it moves the finger.
    pub drives: bool,
    /// What was seen last.
    pub why: String,
}

impl OffReport {
    /// A rig that was read back off.
    pub fn off() -> Self {
        OffReport { read_back: true, not_read_back: Vec::new() }
    }

    /// From how the links were closed. A supply that was read back open switches the drive off, whatever its
    /// amplifier shows; one that was not takes nothing from an amplifier that was read back off.
    pub fn of(ends: &[LinkEnd]) -> Self {
        let cut = ends.iter().any(|end| end.role == PortRole::Supply && end.closed == Closed::ReadBackOff);
        let not_off = |end: &LinkEnd| match &end.closed {
            Closed::NothingToSwitch | Closed::ReadBackOff => None,
            Closed::NotReadBack(_)
                if end.role == PortRole::Supply || (cut && end.role == PortRole::Amplifier) =>
            {
                None
            }
            Closed::NotReadBack(why) => Some(NotOff {
                instrument: end.name.clone(),
                drives: end.role == PortRole::Amplifier,
                why: why.clone(),
            }),
        };
        let not_read_back: Vec<NotOff> = ends.iter().filter_map(not_off).collect();
        OffReport { read_back: not_read_back.is_empty(), not_read_back }
    }

    /// The message to whoever stands at the rig.
    pub fn words(&self) -> String {
        if self.read_back {
            return "the drive is off: read back".into();
        }
        let line = |one: &NotOff| {
            let what = if one.drives { MAY_BE_ON } else { "the stage may still move: switch its supply off" };
            format!("{what} ({}: {})", one.instrument, one.why)
        };
        self.not_read_back.iter().map(line).collect::<Vec<_>>().join("\n")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn end(role: PortRole, closed: Closed) -> LinkEnd {
        LinkEnd { name: "x".into(), role, closed }
    }

    #[test]
    fn off_is_said_only_of_what_was_read_back() {
        let off = OffReport::of(&[
            end(PortRole::Force, Closed::NothingToSwitch),
            end(PortRole::Amplifier, Closed::ReadBackOff),
        ]);
        assert!(off.read_back && off.words().contains("is off"));
        let on = OffReport::of(&[
            end(PortRole::Stage, Closed::ReadBackOff),
            end(PortRole::Amplifier, Closed::NotReadBack("silent".into())),
        ]);
        assert!(!on.read_back && on.words().contains(MAY_BE_ON) && on.words().contains("silent"), "{on:?}");
        let cut = OffReport::of(&[
            end(PortRole::Amplifier, Closed::NotReadBack("dead".into())),
            end(PortRole::Supply, Closed::ReadBackOff),
        ]);
        assert!(cut.read_back, "an open supply is off: {cut:?}");
        let welded = OffReport::of(&[
            end(PortRole::Amplifier, Closed::NotReadBack("dead".into())),
            end(PortRole::Supply, Closed::NotReadBack("welded".into())),
        ]);
        assert!(!welded.read_back && welded.words().contains(MAY_BE_ON), "{welded:?}");
        let moves = OffReport::of(&[end(PortRole::Stage, Closed::NotReadBack("silent".into()))]);
        assert!(!moves.words().contains("is off") && moves.words().contains("may still move"), "{moves:?}");
        assert!(!OffReport::default().read_back, "nothing known is not 'off'");
    }
}
