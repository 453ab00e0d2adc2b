//! The control loop with your own force port, in virtual time:
//! `cargo run --release -p muprime-tests --example own_loop`.
//!
//! A port is whatever implements [`ForceSensor`]. This one reads another port and corrects its lateral gain,
//! as a driver for a laboratory's own sensor would apply its calibration. Safety rules, sweep and
//! comparison are those of `muprime run`.

use models::{FrictionModel, SpringSlider};
use realtime::cycle::{Command, CycleState};
use realtime::cycle_io::{Ports, Tick, run_cycle};
use realtime::ports::{ForceSensor, Forces, Nanos};
use runs::plan::{Plan, Resolution};
use runs::{Outcome, Setup, Sweep};
use sim::virtual_rig::VirtualRig;
use sim::world::WorldConfig;
use std::collections::VecDeque;
use std::sync::Arc;

/// A force sensor whose lateral axis shows too much by a factor.
struct Corrected<S> {
    sensor: S,
    factor: f64,
}

impl<S: ForceSensor> ForceSensor for Corrected<S> {
    // The loop calls this in every cycle: it must not block, lock or allocate.
    fn read(&mut self, now: Nanos) -> Forces {
        let mut forces = self.sensor.read(now);
        if let Ok(lateral) = &mut forces.lateral {
            lateral.value /= self.factor;
        }
        forces
    }
}

fn main() {
    println!("{:?}", sweep());
}

/// Runs a sweep, prints relative friction against amplitude, and returns how it ended.
pub fn sweep() -> Outcome {
    let setup = Setup::load("virtual-ideal").expect("a bundled setup");
    let plan = Plan::load("first-sweep").expect("a bundled plan");
    let config = setup.config;
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &config.limits, &resolution).expect("a plan for this rig");
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).expect("a fingertip"));
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise);

    let [force, amplifier, stage] =
        VirtualRig::new(&WorldConfig::bundled(), 7).expect("a virtual rig").split();
    let own = Corrected { sensor: force, factor: 1.0 };
    let mut ports = Ports::new(Box::new(own), Box::new(amplifier), Box::new(stage));
    // What the sweep commands, at most a few at a time, the loop takes in its next cycles.
    let mut commands: VecDeque<Command> = VecDeque::new();
    let (mut state, mut mu0) = (CycleState::default(), f64::NAN);
    println!("   w in um   U in mm/s   mu'");
    for number in 1.. {
        let now = Nanos(number * config.limits.timing.cycle.0);
        let tick = Tick { number, lateness: Nanos(0), now };
        let row = run_cycle(&config, &*model, &mut state, &mut ports, &mut || commands.pop_front(), tick);
        let reaction = sweep.on_row(&row);
        commands.extend(reaction.commands);
        if let Some(done) = reaction.pass {
            let pass = done.pass;
            let mu = pass.lateral_force_n.map_or(f64::NAN, |lateral| lateral.abs() / pass.normal_force_n);
            if done.reference {
                mu0 = mu;
            } else {
                let (w_um, speed_mm_s) = (pass.amplitude.metres() * 1e6, pass.speed_m_s * 1e3);
                println!("{w_um:>10.1} {speed_mm_s:>11.0}   {:.2}", mu / mu0);
            }
        }
        if let Some(outcome) = reaction.outcome {
            return outcome;
        }
    }
    unreachable!("the counter has no end")
}
