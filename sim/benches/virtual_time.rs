//! How much faster than real time the virtual rig runs on one core, loop included, and what its parts cost.
//!
//! `cargo bench -p muprime-sim`: each item is a simulated second (or a cycle's solution); a second of the
//! world in 1 ms is a factor of a thousand.

use divan::{Bencher, black_box};
use models::PeakToPeak;
use muprime_sim::amplifier::AmplifierInput;
use muprime_sim::contact::{Contact, StretchRecovery};
use muprime_sim::defects::Defects;
use muprime_sim::stage::StageInput;
use muprime_sim::virtual_rig::VirtualRig;
use muprime_sim::world::{ContactMode, WorldConfig};
use realtime::ports::{Amplifier, ForceSensor, Nanos, Stage};

fn main() {
    divan::main();
}

/// A second of sliding under vibration at a 1 kHz loop that reads every port and commands every millisecond.
fn second(rig: &mut VirtualRig, from_ms: u64) {
    for ms in from_ms..from_ms + 1000 {
        let now = Nanos(ms * 1_000_000);
        black_box(rig.read(now));
        let _ = black_box(Amplifier::state(rig, now));
        let _ = black_box(Stage::state(rig, now));
        let world = &mut rig.world;
        world.command_amplifier(AmplifierInput {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            enable: true,
            heartbeat: ms as u32,
        });
        let forward = (ms / 1000).is_multiple_of(2);
        world.command_stage(StageInput {
            velocity_m_s: if forward { 0.02 } else { -0.02 },
            normal_force_n: 0.25,
        });
    }
}

fn run(bencher: Bencher, config: &WorldConfig) {
    let mut rig = VirtualRig::new(config, 1).expect("a bundled configuration");
    let mut at = 0;
    second(&mut rig, at);
    bencher.bench_local(|| {
        at += 1000;
        second(&mut rig, at);
    });
}

#[divan::bench(args = ["none", "squeeze_film", "ridge_inertia", "lateral_recovery", "contact_ageing", "moisture_drift", "second_harmonic"])]
fn simulated_second(bencher: Bencher, defect: &str) {
    let mut config = WorldConfig::ideal();
    if defect != "none" {
        config.defects = Defects::sealed(defect, 1).expect("a known kind");
    }
    run(bencher, &config);
}

/// Every cycle of the plate solved: `massless` has no memory from cycle to cycle, a ridge with mass is marched.
#[divan::bench(args = ["massless", "mass"])]
fn simulated_second_every_cycle(bencher: Bencher, ridge: &str) {
    let mut config = WorldConfig { contact: ContactMode::Resolved, ..WorldConfig::ideal() };
    if ridge == "mass" {
        config.finger.ridge_mass_kg = 1e-6;
        config.finger.ridge_damping_ratio = 0.3;
    }
    run(bencher, &config);
}

fn contact() -> Contact {
    Contact::ideal(3.9e6, 1.5e6, 0.5, 0.25, 1e-6, 27_500.0, 0.02)
}

#[divan::bench]
fn steady_exact(bencher: Bencher) {
    bencher.bench(|| black_box(contact()).steady());
}

#[divan::bench]
fn steady_sampled(bencher: Bencher) {
    let mut contact = contact();
    contact.recovery = StretchRecovery::Rate(5e-3);
    bencher.bench(|| black_box(contact).steady());
}

#[divan::bench]
fn steady_with_mass(bencher: Bencher) {
    let mut contact = contact();
    contact.ridge.mass_kg = 2e-6;
    contact.ridge.damping_n_s_per_m = 1.0;
    bencher.bench(|| black_box(contact).steady());
}
