//! Independent peers on serial lines and on CANopen, both ways.

use super::lines::{adapter, axes, device, expect_forces, plant, pty, setup, socat_pair, standing_forces};
use drivers::InstrumentSetup;
use realtime::Nanos;
use sim::wire::can::{CanDevice, CanEmulator};
use sim::wire::serial::SerialEmulator;
use sim::wire::{Command, Quantity};
use std::time::{Duration, Instant};
use tests::peer::start;
use tests::{file, python};
use wall::bench::{self, Bench, eventually, now};

fn json(command: &mut std::process::Command) -> serde_json::Value {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// pymodbus, minimalmodbus and mbpoll on the serial line of our emulators.
#[test]
fn three_clients_read_and_command_our_rtu_emulators() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    standing_forces(&bench);
    let (port, path) = pty();
    let devices = [(9, device("robotiq-ft300")), (2, device("muprime-amplifier"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap();

    let said = json(python().arg(file("tests/peers/rtu_client.py")).arg(&path).arg("19200"));
    assert_eq!(said["pymodbus"], serde_json::json!([150, 0, 65536 - 225, 0, 0, 0]));
    assert_eq!(said["minimalmodbus"], serde_json::json!([150, 0, -225, 0, 0, 0]));
    assert_eq!(said["minimalmodbus_n"], 1.5);
    // The amplifier's set-points: written by one client, echoed to the other.
    assert_eq!(
        (said["pymodbus_written"].as_bool(), said["echo_amplitude"].as_i64()),
        (Some(true), Some(1500))
    );
    assert_eq!(said["echo_after_minimalmodbus"], 1250);
    assert_eq!(bench.commanded(Command::Amplitude), Some(1250.0 * 1e-9));
    // Modbus exceptions: 2 illegal address, 3 illegal value.
    assert_eq!(
        (said["pymodbus_out_of_range"].as_i64(), said["pymodbus_no_such_register"].as_i64()),
        (Some(3), Some(2))
    );
    assert!(said["minimalmodbus_no_such_register"].is_string(), "{said}");

    let output = std::process::Command::new("mbpoll")
        .args(["-m", "rtu", "-b", "19200", "-P", "none", "-a", "9", "-t", "4", "-0", "-r", "180", "-c", "6"])
        .args(["-1", "-q", &path])
        .output()
        .unwrap_or_else(|error| panic!("mbpoll: {error}: run tests/venv"));
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said} {}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("150") && said.contains("(-225)"), "{said}");
}

/// Our driver on a serial line whose other end is a pymodbus server.
#[test]
fn our_rtu_driver_reads_a_pymodbus_server() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let (_pair, ours, theirs) = socat_pair();
    let (_server, ready) =
        start(python().arg(file("tests/peers/rtu_server.py")).arg(&theirs).args(["150", "-225"]));
    assert_eq!(ready, "ready");
    let mut setup = setup(others.address());
    setup.force = vec![axes("robotiq-ft300", &ours)];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    expect_forces(&mut rig, epoch, 1e-9);
}

/// Two units of a pymodbus server on one line, an axis each.
#[test]
fn two_units_share_a_line() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let (_pair, ours, theirs) = socat_pair();
    let (_server, ready) =
        start(python().arg(file("tests/peers/rtu_server.py")).arg(&theirs).args(["150", "0", "0", "-225"]));
    assert_eq!(ready, "ready");
    let both = axes("robotiq-ft300", &ours);
    let lateral = InstrumentSetup { normal: None, unit: Some(9), rate_hz: Some(25.0), ..both.clone() };
    let normal = InstrumentSetup { lateral: None, unit: Some(10), rate_hz: Some(25.0), ..both };
    let mut setup = setup(others.address());
    setup.force = vec![lateral, normal];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let read = |rig: &mut drivers::Rig| {
        let forces = rig.force.read(now(epoch));
        Some((forces.lateral.ok()?, forces.normal.ok()?))
    };
    let first = wall::bench::eventually("both axes", || read(&mut rig));
    assert!((first.0.value - 1.5).abs() < 1e-9 && (first.1.value - 2.25).abs() < 1e-9, "{first:?}");
    let newer = |now: u32, then: u32| now.wrapping_sub(then) >= 25;
    wall::bench::eventually("newer samples of both", || {
        read(&mut rig)
            .filter(|(l, n)| newer(l.sequence, first.0.sequence) && newer(n.sequence, first.1.sequence))
    });
    for (_, health) in rig.links.health().take(2) {
        assert_eq!((health.corrupt_frames, health.timeouts), (0, 0), "{health:?}");
    }
}

/// python-canopen as the master of our drive: service data, network management, process data, the
/// state machine of CiA 402, the guard's emergency, and a fault that only a reset ends.
#[test]
fn python_canopen_commands_our_cia402_emulator() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::Position, 0.0125);
    bench.set(Quantity::Velocity, -0.02);
    let (adapter, path, _) = adapter();
    let devices = vec![CanDevice { device: device("cia402-profile-velocity"), base: 5 }];
    let _emulator = CanEmulator::start(adapter, devices, plant(&bench, epoch)).unwrap();
    let said = json(python().arg(file("tests/peers/cia402_master.py")).arg(&path));
    assert_eq!(
        (said["before"].as_str(), said["after"].as_str()),
        (Some("PRE-OPERATIONAL"), Some("OPERATIONAL"))
    );
    assert_eq!((said["device_type"].as_i64(), said["vendor"].as_i64()), (Some(0x0002_0192), Some(1)));
    assert_eq!((said["mode"].as_i64(), said["acceleration"].as_i64()), (Some(3), Some(123_456)));
    // 0x0601_0002: an object that cannot be written (CiA 301).
    assert_eq!(said["refused"], 0x0601_0002);
    assert_eq!(said["silent_before_start"], true);
    // CiA 402: switch on disabled, ready to switch on, switched on, operation enabled.
    assert_eq!(said["states"], serde_json::json!([0x40, 0x21, 0x23, 0x27]));
    assert_eq!((said["velocity"].as_i64(), said["position"].as_i64()), (Some(-200), Some(12_500)));
    // 0x8130: life guard error (CiA 301).
    assert_eq!((said["emergency"].as_i64(), said["error_code"].as_i64()), (Some(0x8130), Some(0x8130)));
    assert_eq!((said["fault"].as_i64(), said["still_fault"].as_i64()), (Some(0x08), Some(0x08)));
    assert_eq!(said["reset"], 0x40);
    assert_eq!(bench.commanded(Command::Velocity), Some(0.0), "the guard stopped the stage");
}

/// Our driver as the master of a python-canopen node, whose state machine lets no step be left out.
#[test]
fn our_driver_commands_a_python_canopen_node() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let (_pair, ours, theirs) = socat_pair();
    let (_node, ready) = start(python().arg(file("tests/peers/cia402_node.py")).arg(&theirs));
    assert_eq!(ready, "ready");
    let mut setup = setup(others.address());
    setup.stage = InstrumentSetup {
        dead_weight_n: Some(0.25),
        ..InstrumentSetup::new("cia402-profile-velocity", &format!("slcan:{ours}"))
    };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let at = |rig: &mut drivers::Rig, metres: f64| {
        let state = rig.stage.state(now(epoch)).ok()?;
        assert!((state.velocity_m_s + 0.02).abs() < 1e-9 && !state.fault, "{state:?}");
        ((state.position_m - metres).abs() < 1e-9).then_some(())
    };
    eventually("the node's process data", || at(&mut rig, 0.012_345));
    // Fresh commands walk the drive up to 'operation enabled'; the position says so.
    let mut beat = 0;
    eventually("an enabled drive", || {
        beat += 1;
        let command = realtime::safety::StageCommand::stop(beat, now(epoch).plus(Nanos(100_000_000)));
        rig.stage.command(command, now(epoch));
        std::thread::sleep(Duration::from_millis(3));
        at(&mut rig, 0.013_345)
    });
    // The loop falls silent: the driver takes the drive out of it.
    eventually("a drive that is no longer enabled", || at(&mut rig, 0.012_345));
}

/// Our reading of the drive's data sheet and python-canopen's own: the same objects, types, access and defaults.
#[test]
fn the_data_sheet_means_the_same_to_python_canopen() {
    const NODE: i64 = 5;
    let path = file("drivers/profiles/cia402-profile-velocity.eds");
    let said = json(python().arg(file("tests/peers/eds_objects.py")).arg(&path).arg(NODE.to_string()));
    let ours = instruments::codec::eds::parse(&std::fs::read_to_string(path).unwrap()).unwrap();
    let theirs = said.as_array().unwrap();
    assert_eq!(theirs.len(), ours.len());
    for entry in theirs {
        let number = |i: usize| entry[i].as_u64().unwrap();
        let key = (u16::try_from(number(0)).unwrap(), u8::try_from(number(1)).unwrap());
        let object = &ours[&key];
        assert_eq!(Some(object.name.rsplit('.').next().unwrap()), entry[2].as_str(), "{entry}");
        assert_eq!(u64::from(object.data_type), number(3), "{entry}");
        assert_eq!(Some(object.access.as_str()), entry[4].as_str(), "{entry}");
        let default = object.default.map(|d| d.value + if d.plus_node { NODE } else { 0 });
        assert_eq!(default, entry[5].as_i64(), "{entry}");
    }
}
