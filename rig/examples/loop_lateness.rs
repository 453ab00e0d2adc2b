//! Prints the lateness of the loop's thread with idle ports, as quantiles in us: `p50 p99 p99.9 max`.
//! `benches/lateness` runs it in turn with cyclictest. After the seconds come, in any order, `cpu=1`,
//! `spin_us=100`, `awake`: what a setup's `[loop]` may ask for.
#![allow(clippy::disallowed_methods, reason = "it measures time")]

use models::{Finger, SpringSlider};
use realtime::Ports;
use realtime::pacing::{self, Lifeline, LoopParts, Pacing};
use realtime::ports::{Amplifier, AmplifierState, ForceSensor, Forces, Nanos, NoData, Stage, StageState};
use realtime::safety::{DriveCommand, StageCommand};
use ringbuf::HeapRb;
use ringbuf::traits::Split;
use runs::Setup;
use std::sync::Arc;
use std::sync::atomic::Ordering;

struct Idle;

impl ForceSensor for Idle {
    fn read(&mut self, _: Nanos) -> Forces {
        Forces::missing(NoData::NeverRead)
    }
}

impl Amplifier for Idle {
    fn command(&mut self, _: DriveCommand, _: Nanos) {}
    fn state(&mut self, _: Nanos) -> Result<AmplifierState, NoData> {
        Err(NoData::NeverRead)
    }
}

impl Stage for Idle {
    fn command(&mut self, _: StageCommand, _: Nanos) {}
    fn state(&mut self, _: Nanos) -> Result<StageState, NoData> {
        Err(NoData::NeverRead)
    }
}

fn main() {
    let seconds: f64 = std::env::args().nth(1).and_then(|s| s.parse().ok()).unwrap_or(5.0);
    let mut pacing = Pacing { priority: Some(80), ..Pacing::default() };
    for option in std::env::args().skip(2) {
        match option.split_once('=') {
            Some(("cpu", cpu)) => pacing.cpu = Some(cpu.parse().expect("a number of a CPU")),
            Some(("spin_us", us)) => pacing.spin_ns = us.parse::<u64>().expect("whole us") * 1000,
            None if option == "awake" => pacing.keep_cpus_awake = true,
            _ => panic!("'{option}': cpu=N, spin_us=N or awake"),
        }
    }
    let setup = Setup::load("virtual").expect("bundled");
    let (rows, _keep) = HeapRb::new(16).split();
    let (watch, _keep_too) = HeapRb::new(16).split();
    let life = Arc::new(Lifeline::default());
    let parts = LoopParts {
        config: setup.config,
        model: Arc::new(SpringSlider::new(Finger::paper()).expect("the paper's finger")),
        ports: Ports::new(Box::new(Idle), Box::new(Idle), Box::new(Idle)),
        commands: Arc::new(realtime::queue::CommandQueue::new(4)),
        rows,
        watch,
        life: Arc::clone(&life),
        origin_ns: pacing::monotonic_ns(),
        held: None,
    };
    let looping = std::thread::spawn(move || pacing::run(parts, pacing));
    std::thread::sleep(std::time::Duration::from_secs_f64(seconds));
    life.end.store(true, Ordering::Relaxed);
    let report = looping.join().expect("the loop does not panic");
    let [p50, _, p99, p999, max] = report.lateness_ns.map(|ns| ns as f64 / 1e3);
    if let Some(why) = &report.grants.pace_refused {
        eprintln!("not granted: {why}");
    }
    println!("{p50:.1} {p99:.1} {p999:.1} {max:.1}");
}
