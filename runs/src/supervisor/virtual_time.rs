//! The loop in virtual time: one turn a call, in the caller's thread, without a clock.

use super::{Loop, NotOff, OffReport};
use models::FrictionModel;
use realtime::Nanos;
use realtime::cycle::{Command, Config, CycleState};
use realtime::cycle_io::{Ports, Row, Tick, run_cycle};
use std::collections::VecDeque;
use std::sync::Arc;

/// Cycles that carry a stop to the rig and its echo back.
const CYCLES_TO_STOP: u64 = 20;

/// A loop whose time is counted, not waited for.
pub struct VirtualLoop {
    config: Config,
    model: Arc<dyn FrictionModel>,
    ports: Ports,
    state: CycleState,
    queue: VecDeque<Command>,
    number: u64,
    start: Nanos,
    last: Option<Row>,
}

impl VirtualLoop {
    /// A loop over a rig, before its first cycle.
    pub fn new(config: Config, model: Arc<dyn FrictionModel>, ports: Ports) -> Self {
        let (state, queue) = (CycleState::default(), VecDeque::new());
        VirtualLoop { config, model, ports, state, queue, number: 0, start: Nanos(0), last: None }
    }

    /// The same, with a loop time that goes on from an earlier session's.
    pub fn from(self, start: Nanos) -> Self {
        VirtualLoop { start, ..self }
    }

    /// The next cycle, on time.
    pub fn cycle(&mut self) -> Row {
        let now = self.start.plus(Nanos((self.number + 1) * self.config.limits.timing.cycle.0));
        self.cycle_at(now, Nanos(0))
    }

    /// The next cycle at a time that the caller chooses, and so much too late.
    pub fn cycle_at(&mut self, now: Nanos, lateness: Nanos) -> Row {
        self.number += 1;
        let tick = Tick { number: self.number, lateness, now };
        let VirtualLoop { config, model, ports, state, queue, .. } = self;
        let row = run_cycle(config, &**model, state, ports, &mut || queue.pop_front(), tick);
        self.last = Some(row);
        row
    }

    /// Time from one cycle to the next.
    pub fn period(&self) -> Nanos {
        self.config.limits.timing.cycle
    }

    /// Stops the rig and lets the stop reach it, so that the last rows show the safe state.
    pub fn end(mut self, each: &mut dyn FnMut(&Row)) -> OffReport {
        self.stop();
        for _ in 0..CYCLES_TO_STOP {
            each(&self.cycle());
        }
        let amplifier = self.last.map(|row| row.inputs.seen.amplifier);
        match amplifier {
            Some(Ok(state)) if !state.output_on => OffReport::off(),
            seen => {
                let why = match seen {
                    Some(Ok(_)) => "its output was read back on",
                    Some(Err(_)) => "it does not answer",
                    None => "it was never read",
                };
                let why = why.to_string();
                let instrument = "amplifier of the virtual rig".into();
                OffReport { read_back: false, not_read_back: vec![NotOff { instrument, drives: true, why }] }
            }
        }
    }
}

impl Loop for VirtualLoop {
    fn next_row(&mut self) -> Option<Row> {
        Some(self.cycle())
    }

    fn send(&mut self, command: Command) -> bool {
        self.queue.push_back(command);
        true
    }

    fn stop(&mut self) {
        self.queue.clear();
        self.queue.push_back(Command::Stop);
    }

    fn is_lost(&self) -> bool {
        false
    }
}
