//! What is to be sent to an instrument, and whether it was read back off.
//!
//! Two rules stand here for every transport. A command that drives or moves leaves only before its expiry and
//! never after a newer 'off'. An 'off' is owed until the instrument itself has shown it: it is handed out
//! again wherever it was refused, or a state that came after it still says 'on'.

use super::{ALARM_HOLDS, Endpoint, Part};
use crate::PortRole;
use crate::mailbox::Mailbox;
use crate::off::PendingOff;
use crate::ports::SetPoint;
use instruments::{Profile, SetId};
use realtime::Clock;
use realtime::ports::{Nanos, NoData};
use ringbuf::traits::Producer;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Set-points that switch an output off leave before all others, in this order.
const OFF_FIRST: [&str; 3] = ["enable", "velocity", "amplitude"];

/// What a transport is to send now.
#[derive(Debug, Clone, PartialEq)]
pub enum Due {
    /// Nothing new.
    Nothing,
    /// These set-points, in their units: the loop's own command.
    SetPoints(Vec<(SetId, f64)>),
    /// The safe set-points, since no command is valid any more.
    Safe(Vec<(SetId, f64)>),
}

/// What was wanted last, until it expires.
#[derive(Debug, Clone, PartialEq)]
struct Wanted {
    set_points: Vec<(SetId, f64)>,
    /// Whether it drives or moves.
    on: bool,
    expires_at: Nanos,
    sent: bool,
}

/// The orders of one instrument and what it showed of them.
#[derive(Debug, Default)]
pub(super) struct Orders {
    /// Out of the loop; a sensor's stays empty.
    commands: Mailbox<SetPoint>,
    wanted: Option<Wanted>,
    /// An order that drives or moves was handed out, and the instrument has not shown 'off' since.
    driven: bool,
    /// What the last state showed: whether the instrument is on, and when that arrived.
    shown: Option<(bool, Nanos)>,
    /// When an 'off' was last handed out.
    off_sent: Option<Nanos>,
    /// It was refused, wholly or in part.
    refused: bool,
    /// Heartbeats that a supply's switch was sent. They count what leaves: of a coil that has two values, none may be skipped.
    beats: u32,
}

impl Orders {
    pub(super) fn of(commands: Mailbox<SetPoint>) -> Self {
        Self { commands, ..Self::default() }
    }

    /// A state came: whether the instrument drives or moves.
    pub(super) fn read_back(&mut self, on: bool, arrived: Nanos) {
        self.shown = Some((on, arrived));
        if !on && self.off_sent.is_some_and(|sent| sent < arrived) {
            self.driven = false;
        }
    }

    /// Whether the instrument showed 'off' after an 'off' had been sent.
    fn shown_off(&self) -> bool {
        self.shown.zip(self.off_sent).is_some_and(|((on, arrived), sent)| !on && sent < arrived)
    }
}

impl Endpoint {
    /// Tells the loop at once that nothing will come, and why. Commands that wait are dropped: what
    /// was wanted before the link went down must not be sent when it comes back.
    pub fn link_down(&mut self, reason: NoData) {
        self.seen.fill(false);
        self.discard_commands();
        let _ = match &mut self.part {
            Part::Force { lateral, normal, last, ring } => {
                for (axis, force) in [(lateral, &mut last.lateral), (normal, &mut last.normal)] {
                    *force = Err(if axis.is_some() { reason } else { NoData::NotFitted });
                }
                ring.try_push(*last).is_ok()
            }
            Part::Amplifier { states, .. } => states.try_push(Err(reason)).is_ok(),
            Part::Stage { states, .. } => states.try_push(Err(reason)).is_ok(),
            Part::Supply { states, .. } => states.try_push(Err(reason)).is_ok(),
            Part::Contacts(contacts) => {
                contacts.lost(reason);
                true
            }
        };
    }

    /// Drops all commands that wait.
    pub fn discard_commands(&mut self) {
        self.orders.commands.drop_waiting();
        self.orders.wanted = None;
    }

    /// What is due to be sent at `now`: the newest command, if its time has not passed; else the safe
    /// set-points, where the instrument has been on and has not shown since that it is off.
    pub fn due(&mut self, now: Nanos) -> Due {
        let newest = self.newest_command();
        let off_came = self.orders.commands.take_off();
        if let Some(newest) = newest {
            self.orders.wanted = Some(newest);
        }
        if off_came && self.orders.wanted.as_ref().is_some_and(|wanted| wanted.on) {
            // An 'off' came before it. The loop repeats what it wants in its next cycle.
            self.orders.wanted = None;
            return self.safe(now);
        }
        match &mut self.orders.wanted {
            Some(wanted) if now <= wanted.expires_at => {
                if wanted.sent {
                    return if wanted.on { Due::Nothing } else { self.once_more(now) };
                }
                if let Some(refused) =
                    wanted.set_points.iter().find_map(|(set, value)| self.profile.allows(*set, *value).err())
                {
                    self.health.count(&self.health.commands_refused);
                    self.health.problem(refused.to_string());
                    self.orders.wanted = None;
                    return self.safe(now);
                }
                wanted.sent = true;
                let (mut set_points, on) = (wanted.set_points.clone(), wanted.on);
                if matches!(self.part, Part::Supply { .. }) {
                    // Each is a new command of the loop: a loop that is dead feeds no watchdog.
                    self.orders.beats = self.orders.beats.wrapping_add(1);
                    let beat = heartbeat(&self.profile, self.orders.beats);
                    // Before what closes, behind what opens.
                    let at = if on { 0 } else { set_points.len() };
                    drop(set_points.splice(at..at, beat));
                }
                self.orders.driven |= on;
                self.orders.off_sent = if on { None } else { Some(now) };
                self.orders.commands.handed_out(on);
                self.health.count(&self.health.commands_sent);
                Due::SetPoints(set_points)
            }
            Some(wanted) => {
                if !wanted.sent {
                    self.health.count(&self.health.commands_expired);
                }
                self.orders.wanted = None;
                self.once_more(now)
            }
            None => self.once_more(now),
        }
    }

    /// Whether a command that drives or moves, of which a part has left, may continue. Checked before each
    /// set-point that leaves by itself: the one before may have taken its time, and an 'off' may have come
    /// meanwhile. A newer command that drives or moves as well keeps it alive, and is handed out next.
    pub fn still_wanted(&mut self, now: Nanos) -> bool {
        if let Some(mut newest) = self.newest_command() {
            newest.sent =
                self.orders.wanted.as_ref().is_some_and(|wanted| wanted.set_points == newest.set_points);
            self.orders.wanted = Some(newest);
        }
        !self.orders.commands.off_waits()
            && self.orders.wanted.as_ref().is_some_and(|wanted| wanted.on && now <= wanted.expires_at)
    }

    /// Whether what was handed out last drives or moves.
    pub fn wants_on(&self) -> bool {
        self.orders.wanted.as_ref().is_some_and(|wanted| wanted.on)
    }

    /// The set-points that make the rig safe, those that switch off first; they may be sent at any time.
    pub fn safe_set_points(&self) -> Vec<(SetId, f64)> {
        safe_set_points(&self.profile)
    }

    /// Hands out the safe set-points: from `now` on a state that shows 'off' counts as their read-back.
    pub fn hand_out_off(&mut self, now: Nanos) -> Vec<(SetId, f64)> {
        self.orders.wanted = None;
        self.orders.off_sent = Some(now);
        self.orders.refused = false;
        let _ = self.orders.commands.take_off();
        self.orders.commands.handed_out(false);
        self.health.count(&self.health.safe_sent);
        self.safe_set_points()
    }

    /// What was handed out last was refused, wholly or in part, or its answer made no sense. An 'off' stays owed; a command
    /// that drives or moves is dropped, an 'off' is owed for it, and the state shows a fault: else the loop's next command
    /// would switch on again what was switched off a moment before, and the run would go on through the gap.
    pub fn refused(&mut self) {
        self.orders.refused = true;
        if self.wants_on() {
            self.orders.wanted = None;
            self.alarm_until = self.arrived.plus(ALARM_HOLDS);
        }
    }

    /// Whether an 'off' is pending, `stop` was set, or what drives has expired.
    pub(crate) fn pending_off(&self, stop: &Arc<AtomicBool>, clock: &Clock) -> PendingOff {
        let (commands, stop) = (self.orders.commands.clone(), Arc::clone(stop));
        PendingOff { commands, stop, clock: Some(clock.clone()) }
    }

    /// What the instrument is to the rig.
    pub fn role(&self) -> PortRole {
        match self.part {
            Part::Force { .. } => PortRole::Force,
            Part::Amplifier { .. } => PortRole::Amplifier,
            Part::Stage { .. } => PortRole::Stage,
            Part::Supply { .. } => PortRole::Supply,
            Part::Contacts(_) => PortRole::Contacts,
        }
    }

    /// Whether there is anything to switch off: a drive, a stage or a supply that takes safe set-points.
    pub fn is_actuator(&self) -> bool {
        !self.role().only_measures() && !self.safe_set_points().is_empty()
    }

    /// Whether the instrument may be on: it was driven, or showed itself on, and has not shown 'off' since.
    pub fn owes_off(&self) -> bool {
        self.is_actuator() && (self.orders.driven || self.orders.shown.is_some_and(|(on, _)| on))
    }

    /// Whether the instrument has shown 'off' after the last 'off' that it was sent.
    pub fn reads_off(&self) -> bool {
        self.orders.shown_off() && !self.orders.driven
    }

    /// The safe set-points where 'off' is owed and was not sent yet, was refused, or a later state still shows 'on'.
    fn once_more(&mut self, now: Nanos) -> Due {
        let ignored = match (self.orders.off_sent, self.orders.shown) {
            (None, _) => true,
            (Some(sent), Some((true, arrived))) => sent < arrived || self.orders.refused,
            // What the instrument shows counts, not what it says of a set-point.
            (Some(_), _) => self.orders.refused && !self.orders.shown_off(),
        };
        if ignored { self.safe(now) } else { Due::Nothing }
    }

    fn safe(&mut self, now: Nanos) -> Due {
        if self.owes_off() { Due::Safe(self.hand_out_off(now)) } else { Due::Nothing }
    }

    fn newest_command(&self) -> Option<Wanted> {
        let SetPoint { values, on, sequence, expires_at } = self.orders.commands.take()?;
        let profile = &self.profile;
        if let Part::Stage { dead_weight_n: Some(weight), .. } = self.part
            && let Some((_, wanted)) = values.into_iter().find(|(name, _)| *name == "load")
            && wanted != 0.0
            && (wanted - weight).abs() > 1e-6
        {
            let text = format!("the load stands on a weight of {weight} N: {wanted} N cannot be had");
            self.health.count(&self.health.commands_refused);
            self.health.problem(text);
            return None;
        }
        let mut set_points: Vec<(SetId, f64)> = if !on && matches!(self.part, Part::Amplifier { .. }) {
            // Off leaves the frequency as it is: there may be no valid one.
            safe_set_points(profile)
        } else {
            let set = |(name, si)| {
                profile.set(name).map(|set| (set, si / profile.description.set[set.0].si.factor))
            };
            values.into_iter().filter_map(set).collect()
        };
        set_points.extend(sequence.and_then(|count| heartbeat(profile, count)));
        Some(Wanted { set_points, on, expires_at, sent: false })
    }
}

/// The heartbeat of a count, where the profile has one.
fn heartbeat(profile: &Profile, count: u32) -> Option<(SetId, f64)> {
    let set = profile.set("heartbeat")?;
    Some((set, profile.heartbeat_value(set, count)))
}

fn safe_set_points(profile: &Profile) -> Vec<(SetId, f64)> {
    let sets = profile.description.set.iter().enumerate();
    let mut safe: Vec<_> = sets.filter_map(|(i, set)| set.safe.map(|safe| (SetId(i), safe))).collect();
    let place = |(set, _): &(SetId, f64)| {
        let name = profile.description.set[set.0].name.as_ref();
        OFF_FIRST.iter().position(|first| first == name).unwrap_or(OFF_FIRST.len())
    };
    safe.sort_by_key(place);
    safe
}

#[cfg(test)]
mod tests;
