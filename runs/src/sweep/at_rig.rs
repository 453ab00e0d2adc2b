//! What a sweep waits for at the rig, outside the loop: levels of the air, and steps of a person.
//!
//! ```text
//! before a pass whose level is not there, before the first pass and after the last:
//!   no person:  drive off, lifted, armed ----------------------> set -> there -> next pass
//!   a person:   Disarm -> read back off, supply open, at rest -> ask -> answer (-> timer, -> there)
//!               -> Arm -> Zero -> next pass
//! ```
//! Nothing vibrates and nothing moves while it waits. Answers and readings come from whoever serves the sweep
//! ([`crate::ambient::AmbientControl`]); this file only decides, so it runs in virtual time as in wall-clock time.

use super::{Event, Outcome, QUIET_WITHIN, Reaction, STANDS_M_S, State, Sums, Sweep, awake};
use crate::ambient::{AIR, AirLevel, By, Level, Means, OfAir, Source, possible, shown};
use crate::input::{unit_meant, unit_of};
use crate::plan::{SKIN_MOISTURE, Step, When};
use models::{Ambient, Condition};
use realtime::estimate::Moments;
use realtime::ports::{Nanos, NoData};
use realtime::safety::{Request, TripCause};
use realtime::{Command, Phase, Row};
use std::collections::{BTreeMap, VecDeque};

/// A level counts as reached once it was within its tolerance for this long.
const HOLDS_FOR: Nanos = Nanos(1_000_000_000);
/// Time within which a disarmed rig must be read back off.
const OFF_WITHIN: Nanos = Nanos(5_000_000_000);
/// Time in which the finger leaves the plate, and the plate rings down: no question or zero before.
const LIFTED_AFTER: Nanos = Nanos(1_000_000_000);
/// How often an operator who types a value beyond the tolerance gets the question again.
const ASKS: u32 = 5;
/// The answer that has the step before done once more.
const AGAIN: &str = "again";
/// A reading older than this is none.
const STALE_S: f64 = 10.0;

/// One thing to wait for.
#[derive(Clone, Debug, PartialEq)]
enum Task {
    /// A quantity of the air (its place in [`AIR`]) at a level.
    Level(usize, f64),
    /// A step of the protocol.
    Step(Step),
}

impl Task {
    /// What is to be done.
    fn words(&self) -> String {
        match self {
            Task::Level(at, wanted) => format!("set {}", shown(*at, *wanted)),
            Task::Step(step) => step.instruction().to_string(),
        }
    }

    /// The number of that name in an answer, with or without a unit; an error says why it is none.
    fn number(&self, name: &str, typed: &str) -> Result<f64, String> {
        let value = crate::parse_quantity::parse(typed, unit_of(name))?;
        let [low, high] = match self {
            Task::Level(at, _) => possible(AIR[*at].0),
            Task::Step(_) if name == SKIN_MOISTURE => [0.0, 200.0],
            Task::Step(_) => [f64::MIN, f64::MAX],
        };
        let admits = (low..=high).contains(&value);
        admits.then_some(value).ok_or_else(|| match unit_meant(name, value, [low, high]) {
            Some(meant) => meant,
            None if low == f64::MIN => "a finite number is needed".into(),
            None => format!("{low} to {high} {} is needed", unit_of(name)),
        })
    }
}

/// What a task waits for now, and since when: the rig to be read back off, the next task to begin, an answer,
/// a level (and since when it is within its tolerance), a timer.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Wait {
    Off {
        since: Nanos,
    },
    #[default]
    Begin,
    Answer {
        since: Nanos,
    },
    There {
        since: Nanos,
        within: Option<Nanos>,
    },
    Timer {
        since: Nanos,
        until: Nanos,
    },
}

/// What is known of the rig's surroundings, and what is waited for there.
#[derive(Default)]
pub(super) struct AtRig {
    /// Of a quantity that somebody sets and reads: its column holds that, and no other channel's value.
    pub(super) means: OfAir<Option<Means>>,
    tolerance: OfAir<f64>,
    reached_within_s: f64,
    steps: Vec<Step>,
    /// The rig is a virtual one.
    pub(super) simulated: bool,
    found: OfAir<Option<AirLevel>>,
    /// The level that was set and reached last.
    level: OfAir<Option<f64>>,
    typed: BTreeMap<String, AirLevel>,
    answer: Option<(String, Source)>,
    tasks: VecDeque<Task>,
    previous: Option<Task>,
    wait: Wait,
    /// Once everything was waited for the sweep ends; else the next pass comes.
    ends: bool,
    /// The rig was disarmed for a person.
    pub(super) disarmed: bool,
    repeats: u32,
    begun: bool,
    /// When the rig was last seen off and at rest while a person was at it.
    quiet: Nanos,
    /// What was read during the pass that is under way.
    pub(super) over: OfAir<AirReadings>,
}

/// What was read of a quantity during a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct AirReadings {
    moments: Moments,
    range: Option<[f64; 2]>,
    last: Option<Nanos>,
}

/// A question for whoever stands at the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Question {
    /// The number that is expected, where one is.
    pub usual: Option<f64>,
    /// The quantity of the air (its place in [`AIR`]) that the person sets, and the level.
    pub level: Option<(usize, f64)>,
}

impl AtRig {
    fn steps(&self, when: When) -> impl Iterator<Item = Task> + '_ {
        self.steps.iter().filter(move |step| step.when == when).cloned().map(Task::Step)
    }

    /// Whether a person types what is read of a quantity.
    fn by_hand(&self, at: usize) -> bool {
        self.means[at].is_some_and(|means| means.reads == By::Operator)
    }

    /// Name of the number that a person types for a task.
    fn types<'a>(&self, task: &'a Task) -> Option<&'a str> {
        match task {
            Task::Level(at, _) => self.by_hand(*at).then_some(AIR[*at].0.name),
            Task::Step(step) => step.number_name(),
        }
    }

    fn needs_a_person(&self, task: &Task) -> bool {
        match task {
            Task::Step(_) => true,
            Task::Level(at, _) => self.means[*at].is_some_and(|means| means.needs_a_person()),
        }
    }

    /// A reading that is fresh enough; what a person confirmed holds until another level is requested.
    fn reading(&self, at: usize, now: Nanos) -> Option<AirLevel> {
        let typed = |found: &AirLevel| matches!(found.source, Source::Operator | Source::AnswersFile);
        self.found[at].filter(|f| self.by_hand(at) || typed(f) || now.since(f.at).seconds() <= STALE_S)
    }

    fn within(&self, at: usize, wanted: f64, now: Nanos) -> bool {
        self.reading(at, now).is_some_and(|f| (f.value - wanted).abs() <= self.tolerance[at])
    }

    /// What has to be done before a pass at this condition.
    fn before(&self, condition: &Condition, now: Nanos) -> VecDeque<Task> {
        let mut tasks: VecDeque<Task> =
            if self.begun { VecDeque::new() } else { self.steps(When::Before).collect() };
        let mut changes = false;
        for (at, (covariate, _)) in AIR.iter().enumerate() {
            let Some(wanted) = covariate.of(condition).filter(|_| self.means[at].is_some()) else { continue };
            if self.level[at] != Some(wanted) || !self.within(at, wanted, now) {
                changes |= self.level[at].is_some_and(|before| before != wanted);
                tasks.push_back(Task::Level(at, wanted));
            }
        }
        if changes {
            tasks.extend(self.steps(When::Between));
        }
        tasks
    }

    /// The air as it was found, and as the setup states it where nobody looks.
    pub(super) fn air(&self, stated: &Ambient, now: Nanos) -> Ambient {
        let mut condition = Condition::paper().within(stated);
        for (at, (covariate, _)) in AIR.iter().enumerate() {
            if let Some(found) = self.reading(at, now) {
                covariate.put(&mut condition, found.value);
            }
        }
        Ambient::of(&condition)
    }

    /// Takes in what is read during a pass.
    pub(super) fn during_pass(&mut self) {
        for (found, span) in self.found.iter().zip(&mut self.over) {
            if let Some(found) = found
                && span.last != Some(found.at)
            {
                span.moments.push(found.value);
                let [low, high] = span.range.unwrap_or([found.value; 2]);
                (span.range, span.last) =
                    (Some([low.min(found.value), high.max(found.value)]), Some(found.at));
            }
        }
    }

    /// Puts what was found into the condition of a pass, and says how each value came about.
    pub(super) fn levels(&self, planned: &Condition, condition: &mut Condition, now: Nanos) -> Vec<Level> {
        let level = |quantity: &str, planned, value, range, found: &AirLevel, lost| {
            let (quantity, age_s) = (quantity.into(), now.since(found.at).seconds());
            Level { quantity, planned, value, range, source: found.source, age_s, lost }
        };
        let mut levels = Vec::new();
        for (at, (covariate, _)) in AIR.iter().enumerate() {
            if self.means[at].is_none() {
                continue;
            }
            let span = &self.over[at];
            let wanted = covariate.of(planned);
            let (Some(found), Some(value)) = (self.found[at], span.moments.mean()) else { continue };
            covariate.put(condition, value);
            let range = span.range.unwrap_or([value; 2]);
            // A gauge that fell silent does not say that the level is still there.
            let silent = self.reading(at, now).is_none();
            let off = |w: f64| silent || range.iter().any(|v| (v - w).abs() > self.tolerance[at]);
            levels.push(level(covariate.name, wanted, value, range, &found, wanted.is_some_and(off)));
        }
        let typed = |(name, found): (&String, &AirLevel)| {
            level(name, None, found.value, [found.value; 2], found, false)
        };
        levels.extend(self.typed.iter().map(typed));
        levels
    }
}

impl Sweep {
    /// The same, for a plan whose levels and steps are waited for at the rig, in the air that the setup states;
    /// what the plan or a channel says of it goes first.
    pub fn at_rig(self, plan: &crate::plan::Plan, setup: &crate::setup::Setup) -> Self {
        let (sets, means, tolerances) = (plan.sets_air(), setup.file.means(), &plan.file.tolerances);
        let at_rig = AtRig {
            means: std::array::from_fn(|at| means[at].filter(|_| sets[at])),
            tolerance: tolerances.of_air(),
            reached_within_s: tolerances.reached_within_s,
            steps: plan.file.step.clone(),
            simulated: setup.file.virtual_rig.is_some(),
            ..AtRig::default()
        };
        let frozen_after = setup.config.limits.frozen_after;
        Sweep { at_rig, ambient: setup.file.stated_air(), frozen_after, ..self }
    }

    /// Which quantities something has to read for this sweep: those that no person types.
    pub fn reads_air(&self) -> OfAir<bool> {
        self.at_rig.means.map(|means| means.is_some_and(|means| means.reads != By::Operator))
    }

    /// Whether the sweep sets any quantity of the air.
    pub fn sets_air(&self) -> bool {
        self.at_rig.means.iter().any(Option::is_some)
    }

    /// Takes in what was found of a quantity, by its place in [`AIR`].
    pub fn found(&mut self, at: usize, found: AirLevel) {
        self.at_rig.found[at] = Some(found);
    }

    /// Takes in an answer to the question that is open.
    pub fn answer(&mut self, text: String, source: Source) {
        self.at_rig.answer = Some((text, source));
    }

    /// Before the first arming: steps of a person come while nothing was ever armed.
    pub(super) fn first_steps(&mut self, row: &Row, out: &mut Reaction) -> bool {
        let first = !self.at_rig.begun && self.at_rig.steps(When::Before).next().is_some();
        if first && let Some(point) = self.points.get(self.next) {
            let tasks = self.at_rig.before(&point.condition, row.now);
            self.wait_for(tasks, false, row, out);
        }
        self.at_rig.begun = true;
        first
    }

    /// Whether something has to be waited for before the next pass; it is begun then.
    pub(super) fn waits_at_rig(&mut self, row: &Row, out: &mut Reaction) -> bool {
        let tasks = self.at_rig.before(&self.points[self.next].condition, row.now);
        self.at_rig.begun = true;
        self.wait_for(tasks, false, row, out)
    }

    /// After the last pass: steps, and then the end.
    pub(super) fn last_steps(&mut self, row: &Row, out: &mut Reaction) -> bool {
        let tasks = self.at_rig.steps(When::After).collect();
        self.wait_for(tasks, true, row, out)
    }

    /// Whether there is anything to wait for.
    fn wait_for(&mut self, tasks: VecDeque<Task>, ends: bool, row: &Row, out: &mut Reaction) -> bool {
        if tasks.is_empty() {
            return false;
        }
        let person = tasks.iter().any(|task| self.at_rig.needs_a_person(task));
        // Neither a cycle nor a sample from here on belongs to the pass before.
        out.commands.push(Command::Set(Request::default(), self.marker(Phase::Idle)));
        self.sums = Sums::default();
        let a = &mut self.at_rig;
        (a.tasks, a.ends, a.disarmed, a.answer, a.wait) = (tasks, ends, person, None, Wait::Begin);
        if person {
            out.commands.push(Command::Disarm);
            a.wait = Wait::Off { since: row.now };
        }
        self.state = State::AtRig;
        true
    }

    pub(super) fn wait_at_rig(&mut self, row: &Row, out: &mut Reaction) {
        // While a person is at the rig it shows itself off and at rest, as a paused one does. Forces are the
        // person's: tips are changed.
        if self.at_rig.disarmed && !matches!(self.at_rig.wait, Wait::Off { .. }) {
            let loud = awake(row);
            let quiet = if loud.is_none() { row.now } else { self.at_rig.quiet };
            self.at_rig.quiet = quiet;
            if let Some(cause) = loud.filter(|_| row.now.since(quiet) > QUIET_WITHIN) {
                out.events.push(Event::PauseNotQuiet { cause });
                return self.finish(out, Outcome::WouldNotArm { blocking: Some(cause) });
            }
        }
        match self.at_rig.wait {
            Wait::Begin => self.next_task(row, out),
            Wait::Off { since } => {
                if is_off(row) && row.now.since(since) >= LIFTED_AFTER {
                    self.at_rig.quiet = row.now;
                    out.events.push(Event::Disarmed {
                        supply_open: row.inputs.seen.supply.is_ok_and(|supply| supply.cut),
                    });
                    self.next_task(row, out);
                } else if row.now.since(since) > OFF_WITHIN {
                    self.finish(out, Outcome::WouldNotArm { blocking: Some(TripCause::RefusesOff) });
                }
            }
            Wait::Answer { since } => self.take_answer(row, since, out),
            Wait::There { since, within } => self.look_at_level(row, since, within, out),
            Wait::Timer { since, until } if row.now >= until => {
                if let Some(task) = self.at_rig.tasks.front() {
                    let (step, waited_s) = (task.words(), row.now.since(since).seconds());
                    out.events.push(Event::Waited { step, waited_s });
                }
                self.done(row, out);
            }
            Wait::Timer { .. } => {}
        }
    }

    fn done(&mut self, row: &Row, out: &mut Reaction) {
        self.at_rig.previous = self.at_rig.tasks.pop_front();
        self.next_task(row, out);
    }

    /// Begins the first task that is left; with none, what comes then.
    fn next_task(&mut self, row: &Row, out: &mut Reaction) {
        let Some(task) = self.at_rig.tasks.front().cloned() else { return self.go_on(row, out) };
        if self.at_rig.needs_a_person(&task) {
            self.ask(&task, row, out);
        } else {
            self.at_rig.wait = Wait::There { since: row.now, within: None };
        }
        if let Task::Level(at, wanted) = task {
            self.at_rig.level[at] = None;
            if self.at_rig.means[at].is_some_and(|means| means.sets != By::Operator) {
                out.set_level = Some((at, wanted));
                out.events.push(Event::LevelSet { quantity: AIR[at].0.name.to_string(), wanted });
            }
        }
    }

    fn ask(&mut self, task: &Task, row: &Row, out: &mut Reaction) {
        let (usual, level) = match task {
            Task::Level(at, wanted) => (Some(*wanted), Some((*at, *wanted))),
            // What a virtual rig answers: the paper's moist skin by default.
            Task::Step(step) => (Some(step.usual.unwrap_or(35.0)), None),
        };
        let types = self.at_rig.types(task).map(String::from);
        out.question = Some(Question { usual: usual.filter(|_| types.is_some()), level });
        out.events.push(Event::OperatorStep { step: task.words(), types });
        self.at_rig.answer = None;
        self.at_rig.wait = Wait::Answer { since: row.now };
    }

    fn take_answer(&mut self, row: &Row, since: Nanos, out: &mut Reaction) {
        let Some((text, source)) = self.at_rig.answer.take() else { return };
        let Some(task) = self.at_rig.tasks.front().cloned() else { return };
        let typed = text.trim().replace(',', ".");
        let again = typed.eq_ignore_ascii_case(AGAIN);
        let needed = self.at_rig.types(&task).filter(|_| !again);
        let needs = needed.is_some();
        let judged = match needed {
            Some(name) => task.number(name, &typed).map(Some),
            None => Ok(typed.parse::<f64>().ok().filter(|v| v.is_finite())),
        };
        let (step, refused) = (task.words(), judged.as_ref().err().cloned());
        let (number, after_s) = (judged.unwrap_or(None), row.now.since(since).seconds());
        let taken = refused.is_none();
        out.events.push(Event::Answered {
            step,
            answer: text,
            number,
            answered_by: source,
            after_s,
            refused,
        });
        if again {
            // The step before comes once more, and then this one.
            if let Some(previous) = self.at_rig.previous.take() {
                self.at_rig.tasks.push_front(previous);
            }
            return self.next_task(row, out);
        }
        if !taken && source == Source::Operator {
            // The question comes again; what does not fit is in the record too.
            return self.next_task(row, out);
        }
        if !taken {
            // The next line of a file answers the next question.
            out.commands.push(Command::Stop);
            return self.finish(out, Outcome::Stopped);
        }
        let found = |value: f64| AirLevel { value, at: row.now, source };
        match task {
            Task::Level(at, _) => {
                if let Some(value) = number.filter(|_| needs) {
                    self.at_rig.found[at] = Some(found(value));
                }
                self.at_rig.wait = Wait::There { since: row.now, within: None };
            }
            Task::Step(step) => {
                if let (Some(name), Some(value)) = (step.number_name(), number) {
                    self.at_rig.typed.insert(name.into(), found(value));
                }
                // Nobody waits for a finger that is none.
                if step.wait_s > 0.0 && !self.at_rig.simulated {
                    let until = row.now.plus(Nanos::from_seconds(step.wait_s));
                    self.at_rig.wait = Wait::Timer { since: row.now, until };
                } else {
                    self.done(row, out);
                }
            }
        }
    }

    fn look_at_level(&mut self, row: &Row, since: Nanos, within: Option<Nanos>, out: &mut Reaction) {
        let Some(Task::Level(at, wanted)) = self.at_rig.tasks.front().cloned() else { return };
        let quantity = AIR[at].0.name.to_string();
        let by_hand = self.at_rig.by_hand(at);
        let after_s = row.now.since(since).seconds();
        let now = self.at_rig.within(at, wanted, row.now).then(|| within.unwrap_or(row.now));
        let found = self.at_rig.reading(at, row.now);
        if let (Some(found), Some(from)) = (found, now)
            && (by_hand || row.now.since(from) >= HOLDS_FOR)
        {
            let (value, source) = (found.value, found.source);
            out.events.push(Event::LevelReached { quantity, wanted, found: value, source, after_s });
            (self.at_rig.level[at], self.at_rig.repeats) = (Some(wanted), 0);
            return self.done(row, out);
        }
        if by_hand && self.at_rig.repeats < ASKS {
            // A gauge that shows something else: the question comes again.
            self.at_rig.repeats += 1;
            return self.next_task(row, out);
        }
        if by_hand || after_s > self.at_rig.reached_within_s {
            let found = found.map(|found| found.value);
            out.events.push(Event::LevelNotReached { quantity: quantity.clone(), wanted, last: found });
            out.commands.push(Command::Stop);
            return self.finish(out, Outcome::LevelNotReached { quantity, wanted, found });
        }
        self.at_rig.wait = Wait::There { since, within: now };
    }

    fn go_on(&mut self, row: &Row, out: &mut Reaction) {
        self.at_rig.wait = Wait::Begin;
        if self.at_rig.ends {
            self.finish(out, Outcome::Complete);
        } else if std::mem::take(&mut self.at_rig.disarmed) {
            self.arming = self.arming.afresh(true);
            self.state = State::Arm;
        } else {
            self.begin_next(row, out);
        }
    }
}

/// Whether the rig was read back off and at rest, its second channel open where it has one.
fn is_off(row: &Row) -> bool {
    let seen = &row.inputs.seen;
    let open = match seen.supply {
        Err(NoData::NotFitted) => None,
        Ok(supply) => Some(supply.cut),
        Err(_) => Some(false),
    };
    let drive_off = open.unwrap_or_else(|| seen.amplifier.is_ok_and(|a| !a.output_on));
    let at_rest = seen.stage.is_ok_and(|stage| stage.velocity_m_s.abs() < STANDS_M_S);
    !row.armed && !row.proving && drive_off && at_rest
}
