//! The virtual rig seen through the loop's ports, in virtual time.

use realtime::ports::{Amplifier, ForceSensor, Nanos, NoData, Stage};
use realtime::safety::{DriveCommand, StageCommand};
use sim::amplifier::AmplifierInput;
use sim::stage::StageInput;
use sim::virtual_rig::VirtualRig;
use sim::world::{World, WorldConfig};

const MS: u64 = 1_000_000;

/// A stroke with vibration: every delivered force sample's bytes, and the mean lateral and normal force over
/// the steady part.
fn stroke(config: &WorldConfig, seed: u64, pp_m: f64, speed: f64, load: f64) -> (Vec<u8>, f64, f64) {
    let mut world = World::new(config, seed).unwrap();
    let (mut bytes, mut sums, mut last) = (Vec::new(), [0.0, 0.0, 0.0], 0);
    for ms in 0..1500_u64 {
        world.advance_to(Nanos(ms * MS));
        let amplitude = models::quantity::PeakToPeak::from_metres(pp_m);
        let heartbeat = ms as u32;
        world.command_amplifier(AmplifierInput {
            amplitude,
            frequency_hz: 27_500.0,
            enable: pp_m > 0.0,
            heartbeat,
        });
        let velocity_m_s = if ms < 500 { 0.0 } else { speed };
        world.command_stage(StageInput { velocity_m_s, normal_force_n: load });
        if let Some(sample) = world.force_sample()
            && sample.sequence != last
        {
            last = sample.sequence;
            for count in sample.counts {
                bytes.extend_from_slice(&count.to_le_bytes());
            }
            bytes.extend_from_slice(&sample.device_time.0.to_le_bytes());
            if ms >= 1000 {
                sums = [sums[0] + sample.force_n[0], sums[1] + sample.force_n[1], sums[2] + 1.0];
            }
        }
    }
    (bytes, sums[0] / sums[2], sums[1] / sums[2])
}

#[test]
fn nothing_is_read_before_the_first_sample_and_ages_are_true() {
    let mut rig = VirtualRig::new(&WorldConfig::ideal(), 1).unwrap();
    assert_eq!(rig.read(Nanos(0)).lateral, Err(NoData::NeverRead));
    let now = Nanos(100 * MS);
    let reading = rig.read(now).lateral.unwrap();
    // Sampled each half millisecond, delivered half a millisecond later.
    assert_eq!(reading.age(now), Nanos(MS / 2));
    assert!(!Amplifier::state(&mut rig, now).unwrap().output_on);
    Amplifier::command(&mut rig, DriveCommand::off(1, now), now);
    Stage::command(&mut rig, StageCommand::stop(1, now), now);
    assert_eq!(Stage::state(&mut rig, now).unwrap().velocity_m_s, 0.0);
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_seed_others() {
    for config in [WorldConfig::ideal(), WorldConfig::bundled()] {
        let (first, ..) = stroke(&config, 7, 2e-6, 0.02, 0.25);
        let (again, ..) = stroke(&config, 7, 2e-6, 0.02, 0.25);
        let (other, ..) = stroke(&config, 8, 2e-6, 0.02, 0.25);
        assert!(first == again && first != other && first.len() > 10_000);
    }
}

#[test]
fn an_ideal_stroke_shows_coulomb_friction_and_its_reduction() {
    let mut config = WorldConfig::ideal();
    config.finger.stiffness_relative_sd = 0.0;
    config.pass_relative_sd = 0.0;
    config.sensor.wander_sd_n = [0.0; 2];
    let (_, lateral, normal) = stroke(&config, 3, 0.0, 0.05, 0.5);
    assert!((lateral / normal - 0.5).abs() < 2e-3, "{lateral} {normal}");
    let (_, backward, normal) = stroke(&config, 3, 0.0, -0.05, 0.5);
    assert!((backward / normal + 0.5).abs() < 2e-3, "{backward} {normal}");
    // Fig. 14's springs at 5 um peak-to-peak: mu' = 0.136 by an independent computation.
    let (_, lateral, normal) = stroke(&config, 3, 5e-6, 0.02, 0.5);
    assert!((lateral / normal / 0.5 - 0.136).abs() < 3e-3, "{}", lateral / normal / 0.5);
}

#[test]
fn marching_every_cycle_and_averaging_agree_in_the_mean() {
    let mut config = WorldConfig::ideal();
    config.finger.stiffness_relative_sd = 0.0;
    config.finger.ridge_mass_kg = 5e-7;
    config.finger.ridge_damping_ratio = 0.5;
    for (pp, speed) in [(1e-6, 0.03), (3e-6, 0.08)] {
        let (_, averaged, _) = stroke(&config, 3, pp, speed, 0.3);
        let every = WorldConfig { contact: sim::world::ContactMode::Resolved, ..config.clone() };
        let (_, marched, normal) = stroke(&every, 3, pp, speed, 0.3);
        let error = (averaged - marched) / (0.5 * normal);
        println!("{pp:e} m, {speed} m/s: averaged less marched {error:.4} of mu0 Fn");
        assert!(error.abs() < 0.01, "{averaged} against {marched}");
    }
}

#[test]
fn repeatability_and_pass_noise_are_those_that_the_world_states() {
    let config = WorldConfig::ideal();
    assert_eq!(config.pass_relative_sd, 0.015);
    let n = 400;
    let strokes: Vec<_> = (0..n).map(|seed| stroke(&config, 1000 + seed, 0.0, 0.05, 0.5)).collect();
    let ratio: Vec<f64> = strokes.iter().map(|(_, l, f)| l / f / 0.5 - 1.0).collect();
    let mean = ratio.iter().sum::<f64>() / n as f64;
    let sd = (ratio.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / (n as f64 - 1.0)).sqrt();
    // Repeatability, and the stated scatter of either axis at 0.25 and 0.5 N. Mean over t of a wander with
    // correlation time T: variance 2 T/t (1 - T/t (1 - exp(-t/T))), and white noise.
    let [lateral_sd, normal_sd] = [0, 1].map(|axis| {
        let (s, seconds) = (&config.sensor, 0.5);
        let r = s.wander_time_s / seconds;
        let share: f64 = 2.0 * r * (1.0 - r * (1.0 - (-1.0 / r).exp()));
        (s.wander_sd_n[axis] * share.sqrt()).hypot(s.white_sd_n[axis] * (s.sample_period_s / seconds).sqrt())
    });
    let expected = (0.015_f64.powi(2) + (lateral_sd / 0.25).powi(2) + (normal_sd / 0.5).powi(2)).sqrt();
    println!("pass-to-pass sd {sd:.4}, expected {expected:.4}, n {n}");
    assert!((sd / expected - 1.0).abs() < 0.15, "{sd} against {expected}");
}

#[test]
fn forces_stay_bounded_whatever_is_commanded() {
    use proptest::prelude::*;
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 48,
        failure_persistence: None,
        ..Default::default()
    });
    let command = (-1.0..1.0_f64, -1.0..4.0_f64, -1e-6..2e-5_f64, 0.0..1e5_f64, any::<bool>());
    runner
        .run(&(any::<u64>(), proptest::collection::vec(command, 1..60)), |(seed, commands)| {
            let mut world = World::new(&WorldConfig::bundled(), seed).unwrap();
            for (i, (velocity_m_s, normal_force_n, pp, frequency_hz, enable)) in
                commands.into_iter().enumerate()
            {
                let amplitude = models::quantity::PeakToPeak::from_metres(pp);
                world.command_amplifier(AmplifierInput {
                    amplitude,
                    frequency_hz,
                    enable,
                    heartbeat: i as u32,
                });
                world.command_stage(StageInput { velocity_m_s, normal_force_n });
                world.advance_to(Nanos((i as u64 + 1) * 40 * MS));
                let truth = world.truth;
                let bound = 0.5 * truth.normal_force_n * (1.0 + 6.0 * 0.015) + 1e-9;
                prop_assert!(truth.lateral_force_n.abs() <= bound, "{:?}", truth);
                prop_assert!(truth.normal_force_n <= 2.0 * 1.06);
                prop_assert!(truth.amplitude_pp_m <= 8.000_001e-6 && truth.position_m.abs() <= 0.05);
                prop_assert!(world.force_sample().unwrap().force_n.iter().all(|f| f.is_finite()));
            }
            Ok(())
        })
        .unwrap();
}
