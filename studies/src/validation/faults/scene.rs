//! One scene: a virtual rig, the real cycle, one or two faults, and what came of it. Everything from the
//! seed.

use super::rows::{Expect, Moment, Pace, ROWS, TOO_LATE, What};
use super::tamper::{Tamper, Tampered};
use calibration::certificate::sha256_hex;
use models::law::Rendering;
use models::prediction::{FrictionModel, Prediction, SpringSlider};
use models::{Condition, Finger, OutOfDomain, PeakToPeak, Target};
use realtime::cycle::{Command, Config, Marker, Phase};
use realtime::estimate::{EstimateConfig, Mu0};
use realtime::fault::{Fault, FaultMode, FaultyAmplifier, FaultyForce, FaultyStage};
use realtime::replay::replay;
use realtime::safety::{Exposed, Limits, Request, Trip, TripCause};
use realtime::{Nanos, Ports, Row};
use runs::supervisor::{Loop, VirtualLoop};
use serde::{Deserialize, Serialize};
use sim::amplifier::AmplifierInput;
use sim::virtual_rig::{SharedRig, VirtualRig};
use sim::world::{Operator, WorldConfig};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// The loop's period.
pub const T: Nanos = Nanos(1_000_000);
/// Cycle of the reset, and of the first request.
const RESET_AT: u64 = 60;
const REQUEST_AT: u64 = 80;
/// Cycle from which a target is rendered, where one is.
const RENDER_AT: u64 = 450;
/// Cycle from which faults strike: load, speed and amplitude are steady by then.
pub const STEADY_AT: u64 = 600;
/// Ring time of the plate: Q = 150 at 27.5 kHz.
pub const RING: Nanos = Nanos(1_740_000);
/// The virtual amplifier's own heartbeat timeout in cycles.
pub const WATCHDOG: u64 = 50;

/// One fault and the cycle in which it strikes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Strike {
    /// Index into [`ROWS`].
    pub row: usize,
    /// Cycle, from [`STEADY_AT`] on.
    pub at: u64,
}

/// What is run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Scene {
    /// What the rig does meanwhile.
    pub moment: Moment,
    /// Seed of the world and of the faults.
    pub seed: u64,
    /// Faults, none for a control.
    pub strikes: Vec<Strike>,
    /// The limits that it runs at.
    #[serde(default)]
    pub pace: Pace,
}

/// The core that a scene runs with: any but the sound one is a negative control, which the bench must find
/// wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Core {
    /// As it is.
    #[default]
    Sound,
    /// The loop does not run for a second from the first strike on.
    Sleeps,
    /// What strikes never reaches it.
    Deaf,
    /// It trips in time, and says that a deadline was missed, or a stop requested.
    Mistaken,
}

/// What came of a scene.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct SceneResult {
    /// Cycles that were simulated.
    pub cycles: u64,
    /// The trip, if there was one.
    pub trip: Option<Trip>,
    /// For each strike the cycle whose inputs showed it first.
    pub shown: Vec<u64>,
    /// For each strike the cycles until the drive was commanded off, the first that showed it included.
    pub command_off: Vec<Option<u64>>,
    /// Cycles from the command until the plate's true amplitude was below 5 %.
    pub measured_off: Option<u64>,
    /// What was not as it must be; empty is good.
    pub wrong: Vec<String>,
    /// SHA-256 over the rows, if requested.
    pub hash: Option<String>,
}

/// A model that has diverged from a time on.
struct Diverging(SpringSlider, Option<Nanos>);

impl FrictionModel for Diverging {
    fn name(&self) -> &str {
        self.0.name()
    }
    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        let mut prediction = self.0.predict(condition)?;
        if self.1.is_some_and(|from| condition.time_s >= from.seconds()) {
            prediction.mu_relative = f64::NAN;
        }
        Ok(prediction)
    }
}

/// A grating of 2 mm over more than the travel, at amplitudes of 1.6 to 2.8 um peak-to-peak.
fn grating() -> Target {
    let step_m = 1e-4;
    let at = |k: i32| 0.28 + 0.05 * (std::f64::consts::PI * f64::from(k) * step_m / 1e-3).sin();
    let mu_relative = (-1000..=1000).map(at).collect();
    Target { start_m: -0.1, step_m, mu_relative, lead_s: 0.0, feedback: None }
}

fn time_of(cycle: u64) -> Nanos {
    Nanos(cycle * T.0)
}

impl Scene {
    fn first(&self, wanted: impl Fn(What) -> bool) -> Option<u64> {
        self.strikes.iter().find(|s| wanted(ROWS[s.row].what)).map(|s| s.at)
    }

    fn faults(&self) -> Vec<Fault> {
        let fault = |s: &Strike| match ROWS[s.row].what {
            What::Channel(target, mode, strength, ms) => {
                let timing = self.pace.timing(T, RING);
                let age = timing.amplifier.age_limit().0.max(timing.normal.age_limit().0);
                let too_late = mode == FaultMode::Delayed && strength == TOO_LATE;
                let strength = if too_late { Nanos(age + 11 * T.0).seconds() } else { strength };
                Some(Fault { target, mode, from: time_of(s.at), until: time_of(s.at + ms), strength })
            }
            _ => None,
        };
        self.strikes.iter().filter_map(fault).collect()
    }

    fn limits(&self) -> Limits {
        let mut limits = Limits::paper(T);
        limits.timing = self.pace.timing(T, RING);
        limits.human_contact = self.first(|w| matches!(w, What::DeadMan | What::Exposure)).is_some();
        if let Some(at) = self.first(|w| w == What::Exposure) {
            // The drive has been on since the request; the limit falls due when the fault strikes.
            limits.exposure_max_s = (at - REQUEST_AT) as f64 * T.seconds();
            limits.exposure_rest_s = 10.0;
        }
        limits
    }

    fn world(&self) -> WorldConfig {
        let mut world = WorldConfig::ideal();
        world.amplifier.refuses_off = self.first(|w| w == What::StopRefused).is_some();
        if let Some(at) = self.first(|w| w == What::StageStalls) {
            world.stage.stalls_at_s = time_of(at).seconds();
        }
        world
    }

    /// The request to the loop in a cycle.
    fn request(&self, cycle: u64) -> Request {
        let driven = |amplitude: f64, velocity_m_s: f64| Request {
            amplitude: PeakToPeak::from_metres(amplitude),
            frequency_hz: 27_500.0,
            velocity_m_s,
            normal_force_n: 0.25,
        };
        match self.moment {
            Moment::Idle => Request::default(),
            Moment::Hold => driven(2e-6, 0.0),
            Moment::Slide => driven(2e-6, 0.02),
            Moment::Render => driven(if cycle < RENDER_AT { 2e-6 } else { 4e-6 }, 0.02),
            // A step of 0.4 um every 50 ms.
            Moment::Ramp => driven(0.4e-6 * (1 + cycle.saturating_sub(450) / 50).min(8) as f64, 0.02),
        }
    }

    /// Cycles that the scene lasts.
    fn length(&self) -> u64 {
        let longest = |s: &Strike| {
            s.at + match ROWS[s.row].expect {
                Expect::Off(within) | Expect::Remark(within) => within.at(&self.pace.timing(T, RING)),
                Expect::RemarkOrOff(n) => n,
                Expect::NoTrip | Expect::NoMu => 100,
            }
        };
        self.strikes.iter().map(longest).max().unwrap_or(STEADY_AT + 600) + 200
    }

    fn commands(&self, cycle: u64, before: &Request) -> Vec<Command> {
        let mut out = Vec::new();
        if cycle == 1 {
            out.push(Command::Mu0(Mu0 { value: 0.5, sd: 0.01 }));
        }
        if cycle == RESET_AT {
            out.push(Command::Reset);
        }
        for strike in self.strikes.iter().filter(|s| s.at == cycle) {
            match ROWS[strike.row].what {
                What::Stop | What::StopRefused => out.push(Command::Stop),
                What::Request => {
                    let wild = Request { normal_force_n: 4.0, ..self.request(cycle) };
                    out.push(Command::Set(wild, Marker { point: 1, phase: Phase::Measure }));
                    return out;
                }
                _ => {}
            }
        }
        if cycle >= REQUEST_AT && self.first(|w| w == What::Request).is_none_or(|at| cycle < at) {
            let request = self.request(cycle);
            if request != *before || cycle == REQUEST_AT {
                let renders = self.moment == Moment::Render && cycle >= RENDER_AT;
                let command = if renders { Command::Render } else { Command::Set };
                out.push(command(request, Marker { point: 1, phase: Phase::Measure }));
            }
        }
        out
    }

    /// What hands do at the contacts and the relay in a cycle.
    fn hands(&self, cycle: u64, world: &SharedRig) {
        for strike in self.strikes.iter().filter(|s| s.at == cycle) {
            let mut rig = world.rig();
            let operator = &mut rig.world.operator;
            match ROWS[strike.row].what {
                What::DeadMan => operator.holds_dead_man_from = None,
                What::EmergencyStop => operator.presses_emergency_stop = true,
                What::Guard => operator.opens_guard = true,
                What::RelayFalls => rig.world.amplifier.cut_supply(),
                _ => {}
            }
        }
    }

    fn lateness(&self, cycle: u64) -> Nanos {
        let late = self.strikes.iter().find_map(|s| match ROWS[s.row].what {
            What::Late { cycles, every, tenths } => {
                let since = cycle.checked_sub(s.at)?;
                (since % every == 0 && since / every < cycles).then_some(Nanos(tenths * T.0 / 10))
            }
            _ => None,
        });
        late.unwrap_or_default()
    }
}

/// Runs a scene with the core as it is. With `keep` its rows are hashed, and run again through the cycle.
pub fn run(scene: &Scene, keep: bool) -> SceneResult {
    run_with(scene, keep, Core::Sound)
}

/// Runs a scene.
///
/// # Panics
/// Only if the bench's own limits or world are not allowed: a fault of this module.
pub fn run_with(scene: &Scene, keep: bool, core: Core) -> SceneResult {
    let limits = scene.limits().checked().expect("the bench's limits are within the hard ones");
    let estimate = EstimateConfig::default();
    let config = Config { limits, estimate, exposed: Exposed::default() };
    let slider = SpringSlider::new(Finger::paper()).expect("the paper's finger is one");
    let diverges = scene.first(|w| w == What::ModelDiverges).map(time_of);
    let model = Arc::new(Rendering { law: Arc::new(Diverging(slider, diverges)), target: grating() });
    let deaf = core == Core::Deaf;
    let shown = Arc::new(AtomicU64::new(0));
    let (world, ports) = wired(scene, deaf, &shown);
    let mut controller = VirtualLoop::new(config, Arc::clone(&model) as Arc<dyn FrictionModel>, ports);
    let mut watch = SceneNotes { shown: vec![None; scene.strikes.len()], ..SceneNotes::default() };
    let mut rows = Vec::new();
    let mut request = Request::default();
    let rogue = scene.first(|w| w == What::RogueMaster);
    let pause = scene.strikes.iter().find_map(|s| match ROWS[s.row].what {
        What::Paused(ms) => Some((s.at, ms)),
        _ => None,
    });
    let mut paused = 0;
    for cycle in 1..=scene.length() {
        let mut lateness = scene.lateness(cycle);
        if let Some((_, ms)) = pause.filter(|(at, _)| *at == cycle) {
            // The controller stands still; the rig's time goes on.
            for i in 0..ms {
                let mut rig = world.rig();
                rig.world.advance_to(time_of(cycle + i));
                watch.alone(i, rig.world.truth.amplitude_pp_m);
            }
            paused = ms;
            lateness = time_of(ms);
        }
        if core == Core::Sleeps && scene.strikes.iter().any(|s| (s.at..s.at + 1000).contains(&cycle)) {
            continue;
        }
        if deaf {
            lateness = Nanos(0);
        } else {
            scene.hands(cycle, &world);
        }
        let now = Nanos(time_of(cycle + paused).0 + lateness.0.min(T.0 - 1));
        let mut commands = scene.commands(cycle, &request);
        if deaf {
            commands.retain(|c| !matches!(c, Command::Stop));
            for command in &mut commands {
                if let Command::Set(request, _) = command {
                    *request = scene.request(cycle);
                }
            }
        }
        for command in commands {
            controller.send(command);
        }
        if cycle >= REQUEST_AT {
            request = scene.request(cycle);
        }
        let mut row = controller.cycle_at(now, lateness);
        if let (Core::Mistaken, Some(trip)) = (core, &mut row.tripped) {
            trip.cause =
                if trip.cause == TripCause::Overrun { TripCause::Stopped } else { TripCause::Overrun };
        }
        if rogue.is_some_and(|at| cycle >= at) && !deaf {
            world.rig().world.command_amplifier(AmplifierInput {
                amplitude: PeakToPeak::from_metres(1.0e-6),
                frequency_hz: 31_000.0,
                enable: true,
                heartbeat: cycle as u32 ^ 0x8000_0000,
            });
        }
        let truth = world.rig().world.truth.amplitude_pp_m;
        watch.row(cycle, &row, truth, shown.load(Ordering::Relaxed), paused);
        if keep {
            rows.push(row);
        }
    }
    let mut found = watch.judge(scene);
    if keep {
        run_again(&config, &*model, &rows, &mut found);
    }
    found
}

/// The virtual rig of a scene, and its ports with the scene's faults in them; a deaf core has none.
fn wired(scene: &Scene, deaf: bool, shown: &Arc<AtomicU64>) -> (SharedRig, Ports) {
    let rig = VirtualRig::new(&scene.world(), scene.seed).expect("the bench's world can be");
    let [force, amplifier, stage] = rig.split();
    let world = force.clone();
    let faults = if deaf { Vec::new() } else { scene.faults() };
    let tamper = scene.strikes.iter().find_map(|s| match ROWS[s.row].what {
        What::Shown(tamper) if !deaf => Some((tamper, time_of(s.at))),
        _ => None,
    });
    let tampered = |inner| Tampered::new(inner, tamper, shown);
    let holds_dead_man_from = Some(time_of(20));
    world.rig().world.operator = Operator { holds_dead_man_from, ..Operator::default() };
    let ports = Ports::new(
        Box::new(FaultyForce::new(tampered(force), &faults, scene.seed)),
        Box::new(FaultyAmplifier::new(tampered(amplifier), &faults, scene.seed)),
        Box::new(FaultyStage::new(tampered(stage), &faults, scene.seed)),
    );
    let ports = Ports { supply: Box::new(world.clone()), contacts: Box::new(world.clone()), ..ports };
    (world, ports)
}

/// What a record would hold, run again: the decisions must be the same.
fn run_again(config: &Config, model: &dyn FrictionModel, rows: &[Row], found: &mut SceneResult) {
    let written: Vec<u8> = rows.iter().flat_map(|row| serde_json::to_vec(row).unwrap_or_default()).collect();
    found.hash = Some(sha256_hex(&written));
    let written = rows.iter().filter_map(|r| serde_json::from_slice(&serde_json::to_vec(r).ok()?).ok());
    let again = replay(config, model, written.collect::<Vec<Row>>());
    if again.cycles as usize != rows.len() || !again.holds() {
        found.wrong.push(format!("replayed, the decisions differ: {again:?}"));
    }
}

/// What is noted while a scene runs.
#[derive(Default)]
struct SceneNotes {
    shown: Vec<Option<u64>>,
    off_at: Option<u64>,
    trip: Option<Trip>,
    quiet_at: Option<u64>,
    amplitude_at_off: f64,
    remark_at: Option<u64>,
    mu_after: Option<u64>,
    armed: bool,
    last_used: [Nanos; 2],
    alone_quiet_at: Option<u64>,
    alone_amplitude: f64,
    wrong: Vec<String>,
}

impl SceneNotes {
    /// The plate while the controller stands still.
    fn alone(&mut self, ms: u64, amplitude: f64) {
        if ms == 0 {
            self.alone_amplitude = amplitude;
        }
        if amplitude <= 0.05 * self.alone_amplitude {
            self.alone_quiet_at = self.alone_quiet_at.or(Some(ms));
        }
    }

    fn row(&mut self, cycle: u64, row: &Row, amplitude: f64, shown_ns: u64, paused: u64) {
        self.armed |= row.armed;
        if let Some(trip) = row.tripped {
            if self.trip.is_some() {
                self.wrong.push(format!("a second trip in cycle {cycle}: {trip:?}"));
            }
            self.trip = self.trip.or(Some(trip));
            (self.off_at, self.amplitude_at_off) = (Some(cycle), amplitude);
        }
        if self.off_at.is_some() {
            if row.drive_pp_m != 0.0 || row.velocity_m_s != 0.0 || row.load_n != 0.0 || row.armed {
                self.wrong.push(format!("driven, moved or armed after the trip, in cycle {cycle}"));
            }
            if amplitude <= 0.05 * self.amplitude_at_off.max(1e-8) {
                self.quiet_at = self.quiet_at.or(Some(cycle));
            }
        }
        if row.drive_pp_m > 6e-6 {
            self.wrong.push(format!("commanded {} m in cycle {cycle}", row.drive_pp_m));
        }
        let seen = &row.inputs.seen.forces;
        if row.usable {
            for (last, reading) in self.last_used.iter_mut().zip([&seen.lateral, &seen.normal]) {
                if let Ok(reading) = reading {
                    if reading.taken_at < *last || !reading.value.is_finite() {
                        self.wrong.push(format!("an overtaken or invalid sample was used in cycle {cycle}"));
                    }
                    *last = reading.taken_at;
                }
            }
        }
        if row.mu_relative.is_ok_and(|mu| !mu.value.is_finite()) {
            self.wrong.push(format!("mu' is not a number in cycle {cycle}"));
        }
        let at = (shown_ns / T.0).saturating_sub(paused);
        for shown in self.shown.iter_mut().filter(|_| shown_ns > 0) {
            *shown = shown.or(Some(at));
        }
        if cycle > STEADY_AT && row.remark.is_some() {
            self.remark_at = self.remark_at.or(Some(cycle));
        }
        if row.mu_relative.is_ok() && cycle > STEADY_AT {
            self.mu_after = Some(cycle);
        }
    }

    fn judge(mut self, scene: &Scene) -> SceneResult {
        if !self.armed {
            self.wrong.push("the rig would not arm".into());
        }
        let (mut shown_cycles, mut command_off) = (Vec::new(), Vec::new());
        let alone = scene.strikes.len() == 1;
        let timing = scene.pace.timing(T, RING);
        let mut may: Vec<_> = scene.strikes.iter().flat_map(|s| ROWS[s.row].causes).copied().collect();
        if scene.moment == Moment::Render && may.contains(&TripCause::AmplitudeFrozen) {
            // A reading that stands while the command falls is too high before it counts as frozen.
            may.push(TripCause::AmplitudeRunaway);
        }
        if let Some(trip) = self.trip.filter(|t| !scene.strikes.is_empty() && !may.contains(&t.cause)) {
            self.wrong.push(format!("tripped for {:?}, which is none of {may:?}", trip.cause));
        }
        let bounds = scene.strikes.iter().filter_map(|s| match ROWS[s.row].expect {
            Expect::Off(within) => Some((s.at, within.at(&timing))),
            _ => None,
        });
        let slower = bounds.reduce(|a, b| (a.0.max(b.0), a.1.max(b.1)));
        let in_the_slower = self.off_at.zip(slower).is_some_and(|(off, (at, bound))| off < at + bound);
        for (i, strike) in scene.strikes.iter().enumerate() {
            let row = &ROWS[strike.row];
            let shown = match row.what {
                What::Shown(_) => self.shown[i].unwrap_or(u64::MAX),
                _ => strike.at,
            };
            shown_cycles.push(shown);
            let took = self.off_at.and_then(|off| off.checked_sub(shown)).map(|n| n + 1);
            command_off.push(took);
            let already = self.off_at.is_some_and(|off| off < shown);
            let mut late = |what: &str, bound: u64| {
                self.wrong.push(format!("{}: {what}; {took:?} cycles, bound {bound}", row.name));
            };
            let in_time = |at: Option<u64>, bound: u64| at.is_some_and(|at| at <= shown + bound);
            let off_in_time = |bound: u64| took.is_some_and(|n| n <= bound);
            let tripped = self.off_at.is_some();
            match row.expect {
                Expect::Off(within) if !already => {
                    // A reading that may be late is too high only above all that was commanded meanwhile.
                    let changes =
                        scene.moment == Moment::Render && row.causes.contains(&TripCause::AmplitudeRunaway);
                    let meanwhile = if changes { timing.response().0 / T.0 } else { 0 };
                    let bound = within.at(&timing) + meanwhile;
                    let masked = interact(scene) && in_the_slower;
                    if !off_in_time(bound) && !masked {
                        late("not off in time", bound);
                    }
                }
                Expect::Remark(within) => {
                    let bound = within.at(&timing);
                    if alone && (tripped || !in_time(self.remark_at, bound)) {
                        late("a remark without a trip was due", bound);
                    }
                }
                Expect::RemarkOrOff(bound)
                    if alone && !in_time(self.remark_at, bound) && !off_in_time(bound) =>
                {
                    late("neither remark nor off in time", bound);
                }
                Expect::NoTrip if alone && tripped => late("a trip without need", 0),
                Expect::NoMu if alone && (tripped || self.mu_after.is_some_and(|at| at > shown)) => {
                    late("no mu' and no trip was due", 1);
                }
                _ => {}
            }
        }
        if scene.strikes.is_empty() && self.off_at.is_some() {
            self.wrong.push(format!("a trip without a fault: {:?}", self.trip));
        }
        let measured_off = self.quiet_at.zip(self.off_at).map(|(quiet, off)| quiet - off);
        // A trip in the last cycles of a scene leaves no time to see the plate ring down.
        if let (Some(off), bound) = (self.off_at, measured_bound(scene))
            && off + bound <= scene.length()
            && measured_off.is_none_or(|n| n > bound)
        {
            self.wrong.push(format!("the plate vibrates on: {measured_off:?} cycles, bound {bound}"));
        }
        if self.alone_amplitude > 0.0 && self.alone_quiet_at.is_none_or(|n| n > WATCHDOG + ring_cycles()) {
            self.wrong.push(format!("the amplifier's own watchdog: {:?} ms", self.alone_quiet_at));
        }
        let (cycles, trip, wrong) = (scene.length(), self.trip, self.wrong);
        SceneResult { cycles, trip, shown: shown_cycles, command_off, measured_off, wrong, hash: None }
    }
}

/// Two faults of one amplifier can hide each other: a rogue master that sets half the amplitude makes a
/// readback of twice the amplitude right, and its heartbeat feeds the watchdog that a cut link would have let
/// fire. What then counts is the slower of the two bounds, from the later strike on.
fn interact(scene: &Scene) -> bool {
    use realtime::fault::FaultTarget;
    let amplifier = |s: &Strike| {
        matches!(
            ROWS[s.row].what,
            What::RogueMaster
                | What::StopRefused
                | What::Channel(FaultTarget::Drive | FaultTarget::Amplifier, ..)
                | What::Shown(Tamper::AmplitudeTimes(_) | Tamper::AmplitudeLost | Tamper::AmplitudeStuck)
        )
    };
    scene.strikes.len() > 1 && scene.strikes.iter().all(amplifier)
}

/// Cycles until a plate that is off has rung down to 5 %: three ring times, and two cycles on the way.
pub fn ring_cycles() -> u64 {
    (3 * RING.0).div_ceil(T.0) + 2
}

/// Cycles from the command until the plate is quiet.
pub fn measured_bound(scene: &Scene) -> u64 {
    let has = |wanted: fn(What) -> bool| scene.first(wanted).is_some();
    if has(|w| matches!(w, What::StopRefused | What::RogueMaster)) {
        // A fresh state must show it, ten cycles of patience, then the supply is cut.
        let state_age = scene.pace.timing(T, RING).amplifier.age_limit().0.div_ceil(T.0);
        // States that are garbage say by turns that the output is on and that it is off: the first 'on' after
        // that time counts.
        let garbage = has(|w| {
            matches!(w, What::Channel(realtime::fault::FaultTarget::Amplifier, FaultMode::Garbage, ..))
        });
        state_age + 10 + ring_cycles() + if garbage { 20 } else { 0 }
    } else if has(|w| matches!(w, What::Channel(realtime::fault::FaultTarget::Drive, ..))) {
        WATCHDOG + ring_cycles()
    } else {
        ring_cycles()
    }
}
