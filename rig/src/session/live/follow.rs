//! The sweep's thread: feeds the sequence with the loop's rows and sends its commands.

use super::{Note, Signals};
use crate::sequence::{Outcome, Sequence};
use realtime::cycle::Command;
use realtime::pacing::Lifeline;
use realtime::queue::CommandQueue;
use realtime::turn::Row;
use ringbuf::traits::Consumer;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::time::{Duration, Instant};

/// The loop counts as lost when nothing is heard of it for this long.
const LOST_AFTER: Duration = Duration::from_millis(2000);

/// What ties this thread to the others.
pub(super) struct Strands<'a> {
    pub commands: &'a CommandQueue,
    pub life: &'a Lifeline,
    pub signals: &'a Signals,
    /// Set where the record cannot be kept.
    pub lost: &'a AtomicBool,
    pub notes: Sender<Note>,
}

/// Runs the sequence to its end.
pub(super) fn follow(
    sequence: &mut Sequence,
    watch: &mut impl Consumer<Item = Row>,
    strands: Strands<'_>,
) -> Outcome {
    let mut heard = Instant::now();
    let mut stops = 0;
    let mut lost = false;
    loop {
        let asked = strands.signals.stops.load(Ordering::Relaxed);
        if asked > stops {
            stops = asked;
            // Safe state first: the command goes out before anything else is looked at.
            let _ = strands.commands.force_push(Command::Stop);
            sequence.stop();
        }
        if !lost && strands.lost.load(Ordering::Relaxed) {
            lost = true;
            let _ = strands.commands.force_push(Command::Stop);
            sequence.stop();
        }
        let Some(row) = watch.try_pop() else {
            if heard.elapsed() > LOST_AFTER {
                return Outcome::LoopLost;
            }
            std::thread::sleep(Duration::from_micros(500));
            continue;
        };
        heard = Instant::now();
        let reaction = sequence.on_row(&row);
        for command in &reaction.commands {
            if !send(*command, &strands) {
                return Outcome::LoopLost;
            }
        }
        if !reaction.events.is_empty() || reaction.pass.is_some() {
            let (done, all) = sequence.progress();
            let note = Note {
                at: row.now,
                events: reaction.events,
                pass: reaction.pass,
                progress: (done, all, sequence.remaining_s()),
            };
            // The other end lives as long as this one: it reads until this end is dropped.
            let _ = strands.notes.send(note);
        }
        match reaction.outcome {
            Some(Outcome::Stopped) if lost => return Outcome::RecordLost,
            Some(outcome) => return outcome,
            None => {}
        }
    }
}

/// Puts a command into the queue. After a pause of this thread its rows come in a burst, and so do its commands: a full
/// queue means only that the loop has not taken them yet, as long as its heart beats. False: it does not.
fn send(command: Command, strands: &Strands<'_>) -> bool {
    let mut beat = strands.life.heartbeat.load(Ordering::Relaxed);
    let mut since = Instant::now();
    let mut waiting = command;
    while let Err(back) = strands.commands.push(waiting) {
        waiting = back;
        let now = strands.life.heartbeat.load(Ordering::Relaxed);
        if now != beat {
            (beat, since) = (now, Instant::now());
        } else if since.elapsed() > LOST_AFTER {
            return false;
        }
        std::thread::sleep(Duration::from_micros(500));
    }
    true
}
