//! One cycle of the loop: a pure function of configuration, state, inputs and the time passed in.
//!
//! Order: commands and safety ([`decide`]), then estimate and comparison ([`judge`]), so that a decision can
//! leave before a model runs. Everything that a cycle can reach is `Copy` (checked below), so it holds no
//! lock, no heap and no handle. The model is reached through `&`, and models hold plain tables.
#![deny(clippy::disallowed_types, clippy::disallowed_methods)]

use crate::estimate::{EstimateConfig, Mu0, MuRelative, NoMu, Window};
use crate::ports::Nanos;
use crate::render::{Render, Rendered};
use crate::safety::{Controls, Exposed, Limits, Observation, Request, Safety, SafetyDecision};
use models::{Ambient, Condition, Direction, FrictionModel, PeakToPeak};
use serde::{Deserialize, Serialize};

/// What the loop is doing, as the sweep sees it. It goes into the record with every cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Nothing is requested.
    #[default]
    Idle,
    /// Going to the start of a pass.
    Approach,
    /// Loaded and sliding; amplitude and transients settle.
    Settle,
    /// The steady part that is averaged.
    Measure,
    /// Behind it: the drive goes off and on while the finger slides on, and the stage turns round.
    Edges,
    /// Lifted off: the force zeros are read.
    Zero,
}

/// Which pass a cycle belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Marker {
    /// Number of the point in the plan.
    pub point: u32,
    /// Phase of it.
    pub phase: Phase,
}

/// What reaches the loop from outside, in the order it was sent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// New set-points, and what they are for.
    Set(Request, Marker),
    /// The same, with the amplitude that the model's target wants at each position; that of the request is
    /// the largest.
    Render(Request, Marker),
    /// A reset edge.
    Reset,
    /// Stop and latch.
    Stop,
    /// Stop, latch, and open the second switch-off channel until it is proved again:
    /// before a person reaches into the rig.
    Disarm,
    /// The dead-man key of a trial: held, to be repeated before [`KEY_AGE`] is over, or released.
    DeadMan(bool),
    /// `mu_0` as known now.
    Mu0(Mu0),
    /// What is known of the air from now on, where no channel reads it.
    Ambient(Ambient),
}

/// Time after which a dead-man key without a repeat counts as released. A terminal repeats a held key after
/// half a second at the latest.
pub const KEY_AGE: Nanos = Nanos(700_000_000);

/// Commands taken in one cycle at most; the rest wait for the next.
pub const COMMANDS_PER_CYCLE: usize = 4;

/// What does not change while the loop runs.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Config {
    /// Limits and timing.
    pub limits: Limits,
    /// The running estimate.
    pub estimate: EstimateConfig,
    /// With a human finger: its exposure in earlier runs.
    #[serde(default, skip_serializing_if = "Exposed::is_none")]
    pub exposed: Exposed,
}

/// What changes from cycle to cycle.
#[derive(Clone, Copy, Debug, Default)]
pub struct CycleState {
    safety: Safety,
    window: Window,
    request: Request,
    marker: Marker,
    begun: bool,
    key_held_at: Option<Nanos>,
    mu0: Option<Mu0>,
    ambient: Ambient,
    render: Option<Render>,
}

impl CycleState {
    /// Time that the plate was driven in this run, and the squared rms velocity summed over it, in m2/s.
    pub const fn exposure(&self) -> (Nanos, f64) {
        self.safety.exposure()
    }
}

/// Everything a cycle sees.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Inputs {
    /// Commands, oldest first.
    pub commands: [Option<Command>; COMMANDS_PER_CYCLE],
    /// Forces, amplifier, stage and lateness.
    pub seen: Observation,
}

/// The online comparison of one cycle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Online {
    /// Predicted `mu'` at the measured condition.
    pub predicted: f64,
    /// Its standard uncertainty.
    pub predicted_sd: f64,
    /// Measured less predicted, in standard deviations of the difference.
    pub z: f64,
}

/// Everything a cycle says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outputs {
    /// What safety decided.
    pub decision: SafetyDecision,
    /// Whether the rig is armed after this cycle.
    pub armed: bool,
    /// Whether the second switch-off channel is being proved.
    pub proving: bool,
    /// Which pass the cycle belongs to.
    pub marker: Marker,
    /// Running `mu'`, or why there is none.
    pub mu_relative: Result<MuRelative, NoMu>,
    /// Comparison with the model, where there is a `mu'` and the model has an answer.
    pub online: Option<Online>,
    /// Both forces fit for use in this cycle.
    pub usable: bool,
    /// What the target wants here, and the amplitude that the next cycle requests for it.
    pub rendered: Option<Rendered>,
}

const fn assert_copy<T: Copy>() {}
const _: () = {
    assert_copy::<Config>();
    assert_copy::<CycleState>();
    assert_copy::<Inputs>();
    assert_copy::<Outputs>();
};

/// One cycle. No clock: `now` is passed in.
pub fn step(
    config: &Config,
    model: &dyn FrictionModel,
    state: &mut CycleState,
    inputs: &Inputs,
    now: Nanos,
) -> Outputs {
    let decision = decide(config, state, inputs, now);
    judge(config, model, state, inputs, &decision, now)
}

/// The first half of a cycle: commands and safety. What it decides is ready to leave.
pub fn decide(config: &Config, state: &mut CycleState, inputs: &Inputs, now: Nanos) -> SafetyDecision {
    if !state.begun {
        // What earlier runs did is carried over. A key that was not heard yet may be held all the same: it is
        // released when it has not been heard for its age.
        (state.begun, state.key_held_at) = (true, Some(now));
        state.safety.carry(&config.exposed);
    }
    let controls = take_commands(state, inputs, now);
    state.safety.step(&config.limits, &inputs.seen, &state.request, controls, now)
}

/// The second half: estimate and comparison. Nothing that is commanded depends on it.
pub fn judge(
    config: &Config,
    model: &dyn FrictionModel,
    state: &mut CycleState,
    inputs: &Inputs,
    decision: &SafetyDecision,
    now: Nanos,
) -> Outputs {
    let seen = &inputs.seen;
    let usable = decision.lateral_usable && decision.normal_usable;
    if let (true, Ok(lateral), Ok(normal)) = (usable, &seen.forces.lateral, &seen.forces.normal) {
        state.window.push(&config.estimate, lateral, normal);
    }
    let direction = direction_of(state.request.velocity_m_s);
    let newest = [seen.forces.lateral, seen.forces.normal].into_iter().flatten();
    let age = newest.map(|sample| sample.age(now)).max().unwrap_or_default();
    // Contact that is lost now is no `mu'` now, whatever the window still remembers.
    let lost = usable && seen.forces.normal.is_ok_and(|r| r.value < config.estimate.normal_force_min_n);
    let mu_relative = if lost {
        Err(NoMu::NoContact)
    } else {
        state.window.mu_relative(&config.estimate, direction, state.mu0, age)
    };
    let online = mu_relative.ok().and_then(|mu| compare(config, model, state, seen, &mu, now));
    let rendered = render(config, model, state, seen, now);

    Outputs {
        decision: *decision,
        armed: state.safety.is_armed(),
        proving: state.safety.is_proving(),
        marker: state.marker,
        mu_relative,
        online,
        usable,
        rendered,
    }
}

/// What the next cycle requests, where a target is rendered: decided behind this cycle's command, so that
/// no law delays an 'off'.
fn render(
    config: &Config,
    model: &dyn FrictionModel,
    state: &mut CycleState,
    seen: &Observation,
    now: Nanos,
) -> Option<Rendered> {
    let mut render = state.render?;
    let found = model.target().and_then(|target| {
        let normal_force_n = state.window.means()?.1;
        let condition = condition_now(config, state, seen, normal_force_n, now)?;
        let frequency_hz = state.request.frequency_hz;
        let lateral = seen.forces.lateral.ok().map(|r| r.value);
        render.next(model, target, &Condition { frequency_hz, ..condition }, lateral, &config.limits)
    });
    // Without a target here, a position, a load or a mu_0 nothing is driven.
    state.request.amplitude = found.map_or(PeakToPeak::ZERO, |found| found.amplitude);
    state.render = Some(render);
    found
}

fn take_commands(state: &mut CycleState, inputs: &Inputs, now: Nanos) -> Controls {
    let mut controls = Controls::default();
    for command in inputs.commands.iter().flatten() {
        match command {
            Command::Set(request, marker) => {
                if *marker != state.marker || *request != state.request {
                    state.window.clear();
                }
                (state.request, state.marker, state.render) = (*request, *marker, None);
                controls.new_request = true;
            }
            Command::Render(request, marker) => {
                // What is driven goes on until the target's amplitude is known; a phase changes nothing.
                let held = state.request.amplitude.metres().min(request.amplitude.metres());
                let amplitude = PeakToPeak::from_metres(held.max(0.0));
                if *marker != state.marker {
                    state.window.clear();
                }
                state.render.get_or_insert_default().largest = request.amplitude;
                (state.request, state.marker) = (Request { amplitude, ..*request }, *marker);
                controls.new_request = true;
            }
            Command::Reset => controls.reset = true,
            Command::Stop => controls.stop = true,
            Command::Disarm => (controls.stop, controls.open_supply) = (true, true),
            Command::DeadMan(held) => state.key_held_at = held.then_some(now),
            Command::Mu0(mu0) => state.mu0 = Some(*mu0),
            Command::Ambient(ambient) => state.ambient = *ambient,
        }
    }
    controls.modulated = state.render.is_some();
    controls.dead_man = state.key_held_at.is_some_and(|at| now.since(at) <= KEY_AGE);
    controls
}

fn direction_of(velocity_m_s: f64) -> Direction {
    if velocity_m_s < 0.0 { Direction::Backward } else { Direction::Forward }
}

/// The condition that is measured now; none without amplifier, stage or `mu_0`.
fn condition_now(
    config: &Config,
    state: &CycleState,
    seen: &Observation,
    normal_force_n: f64,
    now: Nanos,
) -> Option<Condition> {
    let amplifier = seen.amplifier.ok()?;
    let stage = seen.stage.ok()?;
    let mu0 = state.mu0?;
    let amplitude = if amplifier.output_on { amplifier.amplitude.ok()?.value } else { 0.0 };
    Some(
        Condition {
            amplitude: PeakToPeak::from_metres(amplitude.max(0.0)),
            frequency_hz: if amplitude > 0.0 {
                amplifier.echoed_frequency_hz
            } else {
                config.limits.frequency_hz.0
            },
            speed_m_s: stage.velocity_m_s.abs(),
            direction: direction_of(stage.velocity_m_s),
            normal_force_n,
            mu0: mu0.value,
            position_m: stage.position_m,
            time_s: now.seconds(),
            // The table of a run holds this channel's temperature: what a model was diagnosed on.
            temperature_c: amplifier.temperature_c.ok().map(|r| r.value).filter(|t| t.is_finite()),
            ..Condition::paper()
        }
        .within(&state.ambient),
    )
}

/// The prediction at what is measured now: amplitude and speed as read back, normal force as sensed.
fn compare(
    config: &Config,
    model: &dyn FrictionModel,
    state: &CycleState,
    seen: &Observation,
    mu: &MuRelative,
    now: Nanos,
) -> Option<Online> {
    let (_, normal_force_n, _) = state.window.means()?;
    let condition = condition_now(config, state, seen, normal_force_n, now)?;
    let prediction = model.predict(&condition).ok()?;
    let sd = mu.sd.hypot(prediction.mu_relative_sd);
    // A model that has diverged has no opinion; nothing that is commanded depends on it.
    (prediction.mu_relative.is_finite() && sd.is_finite() && sd > 0.0).then(|| Online {
        predicted: prediction.mu_relative,
        predicted_sd: prediction.mu_relative_sd,
        z: (mu.value - prediction.mu_relative) / sd,
    })
}
