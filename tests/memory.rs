//! A plan on a world in virtual time, of which nothing is stored but what the caller takes: for statistics.

use models::FrictionModel;
use realtime::compare::Agreement;
use realtime::{Ports, Row};
use runs::ambient::{AmbientControl, OperatorAnswers, SimulatedAir};
use runs::plan::{Plan, Resolution};
use runs::supervisor::{self, Requests, VirtualLoop};
use runs::{MeasuredPass, Outcome, Setup, Sweep};
use sim::virtual_rig::VirtualRig;
use std::sync::Arc;

/// What a sweep in memory comes to.
#[derive(Clone, Debug)]
pub struct MemorySweep {
    /// The passes.
    pub passes: Vec<MeasuredPass>,
    /// How it ended.
    pub outcome: Outcome,
    /// What they say of the model in the end.
    pub agreement: Agreement,
    /// Cycles run.
    pub cycles: u64,
}

/// Runs a plan on a world in virtual time and stores nothing: for statistics. `each` takes every row.
///
/// # Errors
/// A plan that the limits do not allow, or a world that cannot be.
pub fn sweep_in_memory(
    setup: &Setup,
    plan: &Plan,
    seed: u64,
    world: &sim::world::WorldConfig,
    model: Arc<dyn FrictionModel>,
    each: &mut dyn FnMut(&Row),
) -> Result<MemorySweep, Box<dyn std::error::Error>> {
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(seed, &setup.config.limits, &resolution)?;
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise)
        .at_rig(plan, setup);
    let [force, amplifier, stage] = VirtualRig::new(world, seed)?.split();
    let air = SimulatedAir::Virtual(force.clone());
    let mut ambient_control = AmbientControl::open(&sweep, None, Some(air), OperatorAnswers::Simulated)?;
    let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut rig = VirtualLoop::new(setup.config, model, ports);
    let (mut passes, mut cycles) = (Vec::new(), 0);
    let outcome =
        supervisor::sweep(&mut rig, &mut sweep, &mut Requests::default, &mut |row, sweep, reaction| {
            ambient_control.serve(row.now, sweep, &reaction);
            each(row);
            cycles += 1;
            passes.extend(reaction.pass);
        });
    let agreement = sweep.agreement(outcome == Outcome::Complete);
    Ok(MemorySweep { passes, outcome, agreement, cycles })
}
