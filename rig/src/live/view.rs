//! The picture that messages add up to: what a viewer shows, and what a new one gets first.

use super::{Ended, Message, Progress, Run, State, TimedEvent};
use realtime::safety::Trip;
use runs::{Event, MeasuredPass};
use std::collections::VecDeque;

/// States that are remembered: a minute of them.
const STATES: usize = 600;
/// Events that are remembered.
const EVENTS: usize = 500;

/// A run as far as it has come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct View {
    /// What it is of; `None` before the first message.
    pub run: Option<Run>,
    /// The last states, oldest first.
    pub states: VecDeque<State>,
    /// Its passes, those of earlier sessions too, in the order of measurement.
    pub passes: Vec<MeasuredPass>,
    /// The last events, oldest first.
    pub events: VecDeque<TimedEvent>,
    /// How far it is.
    pub progress: Progress,
    /// The trip that is latched.
    pub trip: Option<Trip>,
    /// Whether it rests before a pass.
    pub paused: bool,
    /// The warning about a drive that was not read back off.
    pub not_off: Option<String>,
    /// How it ended.
    pub ended: Option<Ended>,
}

impl View {
    /// Takes a message.
    pub fn take(&mut self, message: Message) {
        match message {
            Message::Run(run) => {
                // A new picture: everything seen before comes again.
                let progress = Progress { made: run.made_before, planned: run.planned, remaining_s: 0.0 };
                *self = View { run: Some(*run), progress, ..View::default() };
            }
            Message::State(state) => push(&mut self.states, *state, STATES),
            Message::Pass(pass) => self.passes.push(*pass),
            Message::Event(event) => {
                match &event.event {
                    Event::Tripped(trip) => self.trip = Some(*trip),
                    Event::Paused { .. } => self.paused = true,
                    Event::Resumed => self.paused = false,
                    _ => {}
                }
                push(&mut self.events, event, EVENTS);
            }
            Message::Progress(progress) => self.progress = progress,
            Message::Off(words) => self.not_off = Some(words),
            Message::Ended(ended) => self.ended = Some(*ended),
        }
    }

    /// The messages that another viewer needs to have the same picture.
    pub fn messages(&self) -> Vec<Message> {
        let run = self.run.iter().map(|run| Message::Run(Box::new(run.clone())));
        let passes = self.passes.iter().map(|pass| Message::Pass(Box::new(pass.clone())));
        let events = self.events.iter().map(|event| Message::Event(event.clone()));
        let progress = self.run.iter().map(|_| Message::Progress(self.progress));
        let states = self.states.iter().map(|state| Message::State(Box::new(state.clone())));
        let not_off = self.not_off.iter().map(|words| Message::Off(words.clone()));
        let ended = self.ended.iter().map(|ended| Message::Ended(Box::new(ended.clone())));
        run.chain(passes).chain(events).chain(progress).chain(states).chain(not_off).chain(ended).collect()
    }

    /// Loop time in s of the last state.
    pub fn now_s(&self) -> f64 {
        self.states.back().map_or(0.0, |state| state.time_s)
    }
}

fn push<T>(queue: &mut VecDeque<T>, item: T, most: usize) {
    if queue.len() == most {
        queue.pop_front();
    }
    queue.push_back(item);
}
