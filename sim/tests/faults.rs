//! Faults of the rig's devices, as the world lives through them.

use models::PeakToPeak;
use muprime_sim::amplifier::AmplifierInput;
use muprime_sim::defects::Defects;
use muprime_sim::stage::StageInput;
use muprime_sim::world::{World, WorldConfig};
use realtime::Nanos;

fn world(defects: &str) -> World {
    let defects = Defects::parse(defects).unwrap();
    World::new(&WorldConfig { defects, ..WorldConfig::ideal() }, 1).unwrap()
}

fn drive(world: &mut World, ms: u64, enable: bool) {
    let amplitude = PeakToPeak::from_metres(2e-6);
    world.command_amplifier(AmplifierInput {
        amplitude,
        frequency_hz: 27_500.0,
        enable,
        heartbeat: ms as u32,
    });
    world.command_stage(StageInput { velocity_m_s: 0.02, normal_force_n: 0.25 });
    world.advance_to(Nanos((ms + 1) * 1_000_000));
}

#[test]
fn an_amplifier_that_refuses_off_is_stopped_by_its_supply() {
    let mut world = world("[[defect]]\nname = \"amplifier_refuses_off\"\n");
    for ms in 0..50 {
        drive(&mut world, ms, true);
    }
    for ms in 50..90 {
        drive(&mut world, ms, false);
    }
    assert!(world.truth.amplitude_pp_m > 1.9e-6);
    world.amplifier.cut_supply();
    // Ring-down: under 5 % within three time constants of Q / (pi f) = 1.74 ms.
    for ms in 90..96 {
        drive(&mut world, ms, false);
    }
    assert!(world.truth.amplitude_pp_m < 0.05 * 2e-6, "{:?}", world.truth);
    let status = world.amplifier_status().unwrap();
    assert!(!status.output_on && !status.supply_closed);
}

#[test]
fn a_controller_that_dies_is_noticed_by_the_amplifier_itself() {
    let mut world = world("");
    for ms in 0..50 {
        drive(&mut world, ms, true);
    }
    assert!(world.truth.amplitude_pp_m > 1.9e-6);
    // Nothing is commanded any more; the watchdog's 50 ms and three time constants later the plate is still.
    world.advance_to(Nanos(107_000_000));
    assert!(world.truth.amplitude_pp_m < 0.05 * 2e-6);
    assert!(world.amplifier_status().unwrap().watchdog_tripped);
}

#[test]
fn a_link_that_is_off_lets_no_command_through() {
    let mut world = world("[[channel]]\nchannel = \"amplifier\"\nfault = \"off\"\nfrom_s = 0.03\n");
    for ms in 0..200 {
        drive(&mut world, ms, true);
    }
    // Commands went on, yet none arrived: the watchdog has switched off.
    assert_eq!(world.truth.amplitude_pp_m, 0.0);
    assert!(world.amplifier_status().unwrap().taken_at < Nanos(30_000_000), "the last state is from before");
}

#[test]
fn a_stalled_stage_stands_still() {
    let mut world = world("[[defect]]\nname = \"stage_stall\"\nparameters = { from_s = 0.2 }\n");
    for ms in 0..400 {
        drive(&mut world, ms, true);
    }
    let truth = world.truth;
    assert!(truth.velocity_m_s == 0.0 && (truth.position_m - 0.004).abs() < 2e-4, "{truth:?}");
    assert!(world.stage_status().unwrap().velocity_m_s == 0.0);
}
