//! Who sets and reads the air for a sweep, and who answers for the person at the rig.
//!
//! It works beside the loop, on the thread that leads the sweep: nothing here waits.
#![allow(clippy::disallowed_methods, reason = "a gauge's reading has an age by the wall clock")]

use super::{AIR, AirLevel, OfAir, Source};
use crate::setup::Setup;
use crate::sweep::{Outcome, Question, Reaction, Sweep};
use drivers::chamber::Chamber;
use miette::IntoDiagnostic;
use realtime::{Nanos, threads};
use sim::room::Air;
use sim::virtual_rig::SharedRig;
use sim::wire::{Command, Quantity, SharedPlant};
use std::collections::VecDeque;
use std::io::{BufRead, IsTerminal};
use std::path::Path;
use std::sync::mpsc::{Receiver, sync_channel};

/// Time of the loop from one look at the air to the next.
const POLL_EVERY: Nanos = Nanos(100_000_000);
/// Time that a virtual hand waits for a level before it says what the gauge shows.
const PATIENCE: Nanos = Nanos(30_000_000_000);
const AIRS: OfAir<Air> = [Air::Pressure, Air::Temperature, Air::Humidity];
const QUANTITIES: OfAir<Quantity> =
    [Quantity::AmbientPressure, Quantity::AirTemperature, Quantity::RelativeHumidity];
const COMMANDS: OfAir<Command> =
    [Command::AmbientPressure, Command::AirTemperature, Command::RelativeHumidity];

/// The world of a virtual rig, in either time.
pub enum SimulatedAir {
    /// In virtual time.
    Virtual(SharedRig),
    /// Behind its protocols.
    Served(SharedPlant),
}

impl SimulatedAir {
    fn read(&self, at: usize) -> f64 {
        match self {
            SimulatedAir::Virtual(rig) => rig.rig().world.room.of(AIRS[at]),
            SimulatedAir::Served(plant) => plant.now().0.measure(QUANTITIES[at]),
        }
    }

    fn set(&self, at: usize, value: f64) {
        match self {
            SimulatedAir::Virtual(rig) => rig.rig().world.room.set(AIRS[at], value),
            SimulatedAir::Served(plant) => plant.now().0.command(&[(COMMANDS[at], value)]),
        }
    }
}

/// Where the answers of a person come from.
pub enum OperatorAnswers {
    /// No questions: a virtual rig gives the answers.
    Simulated,
    /// The lines of a file, one an answer.
    File(VecDeque<String>),
    /// The lines of the terminal.
    Terminal(Receiver<String>),
}

impl OperatorAnswers {
    /// The answers of a file: one a line; empty lines and those that begin with # are left out.
    fn of_file(path: &Path) -> miette::Result<Self> {
        let text = crate::input::text_of(path)?;
        let line =
            |line: &str| Some(line.trim().to_string()).filter(|l| !l.is_empty() && !l.starts_with('#'));
        Ok(OperatorAnswers::File(text.trim_start_matches('\u{feff}').lines().filter_map(line).collect()))
    }

    /// The terminal's lines, read on a thread of their own.
    fn of_terminal() -> miette::Result<Self> {
        if !std::io::stdin().is_terminal() {
            miette::bail!(
                help =
                    "run it at a terminal, or give the answers beforehand with --answers FILE (one a line)",
                "the plan asks a person at the rig, and the input is not a terminal"
            );
        }
        let (into, lines) = sync_channel(1);
        let read =
            move || std::io::stdin().lock().lines().map_while(Result::ok).try_for_each(|l| into.send(l));
        threads::spawn("answers", read).into_diagnostic()?;
        Ok(OperatorAnswers::Terminal(lines))
    }

    /// The answer to the open question, where it has come; an error where none can come any more.
    fn next(&mut self, question: Question) -> Result<Option<(String, Source)>, &'static str> {
        match self {
            OperatorAnswers::Simulated => {
                let words = question.usual.map_or_else(|| "done".to_string(), |usual| usual.to_string());
                Ok(Some((words, Source::Simulated)))
            }
            OperatorAnswers::File(lines) => match lines.pop_front() {
                Some(line) => Ok(Some((line, Source::AnswersFile))),
                None => Err("the file of answers has none for this question"),
            },
            OperatorAnswers::Terminal(lines) => match lines.try_recv() {
                Ok(line) => Ok(Some((line, Source::Operator))),
                Err(std::sync::mpsc::TryRecvError::Empty) => Ok(None),
                Err(std::sync::mpsc::TryRecvError::Disconnected) => Err("the terminal's input has ended"),
            },
        }
    }
}

/// What serves a sweep at the rig: the chamber, and whoever answers its questions.
pub struct AmbientControl {
    chamber: Option<Chamber>,
    world: Option<SimulatedAir>,
    answers: OperatorAnswers,
    source: Source,
    question: Option<Question>,
    looked: Option<Nanos>,
    problem: Option<String>,
    valve_turned: Option<Nanos>,
}

impl AmbientControl {
    /// The rig's side of a sweep on a setup whose chamber is at `chamber`, where it is connected to.
    ///
    /// # Errors
    /// A chamber that does not answer.
    pub fn open(
        sweep: &Sweep,
        chamber: Option<&drivers::InstrumentSetup>,
        world: Option<SimulatedAir>,
        answers: OperatorAnswers,
    ) -> miette::Result<Self> {
        let used = chamber.filter(|_| sweep.sets_air());
        let chamber = used.map(Chamber::open).transpose().map_err(|why| {
            miette::miette!(help = "check its address and power", "the chamber does not answer: {why}")
        })?;
        let source = if world.is_some() { Source::Simulated } else { Source::Instrument };
        let (question, looked, problem, valve_turned) = (None, None, None, None);
        Ok(AmbientControl { chamber, world, answers, source, question, looked, problem, valve_turned })
    }

    /// Serves what a row led to: set-points out, readings and answers in.
    pub fn serve(&mut self, now: Nanos, sweep: &mut Sweep, reaction: &Reaction) {
        if let Some((at, level)) = reaction.set_level {
            match (&self.chamber, &self.world) {
                (Some(chamber), _) => chamber.set(at, level),
                (None, Some(world)) => world.set(at, level),
                (None, None) => {}
            }
        }
        self.question = reaction.question.or(self.question);
        if let Some(outcome) = &reaction.outcome {
            self.question = None;
            if let (Outcome::Complete, OperatorAnswers::File(left)) = (outcome, &self.answers)
                && !left.is_empty()
            {
                let (left, which) = (left.len(), "did the others answer the questions that they are for?");
                tracing::warn!("{left} lines of the file of answers were not needed: {which}");
            }
        }
        if self.question.is_some_and(|question| self.has_set(question, now))
            && let Some(question) = self.question
        {
            match self.answers.next(question) {
                Ok(None) => {}
                Ok(Some((text, source))) => {
                    self.question = None;
                    sweep.answer(text, source);
                }
                Err(why) => {
                    self.question = None;
                    tracing::error!("{why}: the sweep stops");
                    sweep.stop();
                }
            }
        }
        if self.looked.is_none_or(|at| now.since(at) >= POLL_EVERY) {
            self.looked = Some(now);
            self.look(now, sweep);
        }
    }

    /// On a virtual rig a hand that is none turns the chamber's valve, and waits for the level as a person
    /// would.
    fn has_set(&mut self, question: Question, now: Nanos) -> bool {
        let (Some((at, level)), Some(world)) = (question.level, &self.world) else { return true };
        let since = *self.valve_turned.get_or_insert_with(|| {
            world.set(at, level);
            now
        });
        let there = (world.read(at) - level).abs() <= 1e-3 * level.abs();
        let has_set = there || now.since(since) >= PATIENCE;
        if has_set {
            self.valve_turned = None;
            // What is typed is what the gauge shows.
            self.question = Some(Question { usual: question.usual.map(|_| world.read(at)), ..question });
        }
        has_set
    }

    fn look(&mut self, now: Nanos, sweep: &mut Sweep) {
        let reads = sweep.reads_air();
        let air = self.chamber.as_ref().map(Chamber::air);
        if let Some(air) = &air
            && self.problem != air.problem
        {
            self.problem.clone_from(&air.problem);
            if let Some(why) = &self.problem {
                tracing::warn!("the chamber: {why}");
            }
        }
        for at in (0..AIR.len()).filter(|at| reads[*at]) {
            let found = match (&air, &self.world) {
                (Some(air), _) => air.readings[at].map(|(value, taken)| {
                    let age = u64::try_from(taken.elapsed().as_nanos()).unwrap_or(u64::MAX);
                    AirLevel { value, at: Nanos(now.0.saturating_sub(age)), source: self.source }
                }),
                (None, Some(world)) => Some(AirLevel { value: world.read(at), at: now, source: self.source }),
                (None, None) => None,
            };
            if let Some(found) = found {
                sweep.found(at, found);
            }
        }
    }
}

impl Setup {
    /// Who answers for the person at the rig: a file, on a virtual rig nobody, else the terminal.
    ///
    /// # Errors
    /// A file that cannot be read; no terminal where one is needed.
    pub fn answers(&self, file: Option<&Path>, asks: bool) -> miette::Result<OperatorAnswers> {
        match file {
            Some(path) => OperatorAnswers::of_file(path),
            None if self.file.virtual_rig.is_some() || !asks => Ok(OperatorAnswers::Simulated),
            None => OperatorAnswers::of_terminal(),
        }
    }
}
