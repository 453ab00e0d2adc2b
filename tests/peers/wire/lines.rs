//! Serial lines over pseudo-terminals: Modbus RTU, streams, text, slcan, and SCPI over TCP.

use drivers::slcan::Slcan;
use drivers::{AxisSetup, InstrumentSetup, InstrumentsSetup};
use instruments::{CanEvent, CanFrame, CanPort};
use realtime::ports::{Nanos, NoData};
use realtime::safety::DriveCommand;
use serialport::{SerialPort, TTYPort};
use sim::wire::can::{CanDevice, CanEmulator, EmulatedAdapter};
use sim::wire::device::Device;
use sim::wire::lines::{LineInstrument, TcpLines};
use sim::wire::serial::SerialEmulator;
use sim::wire::{Command, Quantity, SharedPlant};
use std::io::{Read, Write};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};
use tests::{file, python};
use wall::bench::{self, Bench, BenchPlant, eventually, now};

/// A pseudo-terminal: the emulator's end, and the path that the other side opens.
pub fn pty() -> (Box<dyn SerialPort>, String) {
    let (master, slave) = TTYPort::pair().unwrap();
    let path = slave.name().unwrap();
    drop(slave);
    (Box::new(master), path)
}

pub fn device(id: &str) -> Device {
    Device::new(drivers::profile(id).unwrap()).unwrap()
}

pub fn plant(bench: &Bench, epoch: Instant) -> SharedPlant {
    SharedPlant::new(BenchPlant::new(bench), epoch)
}

/// A setup whose amplifier and stage stand at a Modbus TCP server, to put one other instrument in.
pub fn setup(server: SocketAddr) -> InstrumentsSetup {
    let address = server.to_string();
    InstrumentsSetup {
        force: vec![InstrumentSetup::new("muprime-force2", &address)],
        amplifier: InstrumentSetup::new("muprime-amplifier", &address),
        stage: InstrumentSetup::new("muprime-stage", &address),
        ..Default::default()
    }
}

pub fn axes(profile: &str, address: &str) -> InstrumentSetup {
    let axis = |signal: &str, gain: f64| Some(AxisSetup { signal: signal.into(), gain, offset_n: 0.0 });
    InstrumentSetup {
        lateral: axis("fx", 1.0),
        normal: axis("fz", -1.0),
        ..InstrumentSetup::new(profile, address)
    }
}

pub fn standing_forces(bench: &Bench) {
    bench.set(Quantity::LateralForce, 1.5);
    bench.set(Quantity::NormalForce, -2.25);
}

/// Waits for a sample and compares it with what stands on the bench, to `count` newtons.
pub fn expect_forces(rig: &mut drivers::Rig, epoch: Instant, count: f64) {
    let (lateral, normal) = eventually("both axes", || {
        let forces = rig.force.read(now(epoch));
        Some((forces.lateral.ok()?, forces.normal.ok()?))
    });
    assert!((lateral.value - 1.5).abs() <= count, "{lateral:?}");
    assert!((normal.value - 2.25).abs() <= count, "{normal:?}: the setup turns the axis round");
    assert_eq!(lateral.sequence, normal.sequence);
    let first = lateral.sequence;
    eventually("newer samples", || {
        rig.force.read(now(epoch)).lateral.ok().filter(|reading| reading.sequence.wrapping_sub(first) >= 10)
    });
}

#[test]
fn ft300_is_polled_and_streamed() {
    for profile in ["robotiq-ft300", "robotiq-ft300-stream"] {
        let (bench, epoch) = (Bench::default(), Instant::now());
        standing_forces(&bench);
        let others = bench::serve_all(&bench, epoch);
        let (port, path) = pty();
        let devices = [(9, device(profile))].into_iter().collect();
        let _emulator = SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap();
        let mut setup = setup(others.address());
        setup.force = vec![axes(profile, &path)];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        expect_forces(&mut rig, epoch, 0.005);
    }
}

/// A client that crashed left the sensor streaming: the next one must still come in.
#[test]
fn a_stream_left_on_is_stopped_before_anything_is_asked() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    standing_forces(&bench);
    let others = bench::serve_all(&bench, epoch);
    let (port, path) = pty();
    let devices = [(9, device("robotiq-ft300-stream"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap();
    {
        let mut crashed = serialport::new(&path, 19_200).timeout(Duration::from_secs(2)).open().unwrap();
        crashed.write_all(&instruments::codec::modbus_rtu::write(9, 410, &[0x0200]).bytes).unwrap();
        let mut stream = [0; 200];
        crashed.read_exact(&mut stream).unwrap();
        assert!(stream.windows(2).any(|pair| pair == [0x20, 0x4E]), "it streams");
    }
    let mut setup = setup(others.address());
    setup.force = vec![axes("robotiq-ft300-stream", &path)];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    expect_forces(&mut rig, epoch, 0.005);
}

/// The whole rig over Modbus RTU, a line an instrument.
#[test]
fn the_rigs_own_instruments_over_rtu() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, -0.125);
    bench.set(Quantity::NormalForce, 0.25);
    let mut emulators = Vec::new();
    let mut at = |unit: u8, id: &str| {
        let (port, path) = pty();
        let devices = [(unit, device(id))].into_iter().collect();
        emulators.push(SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap());
        InstrumentSetup { baud: Some(115_200), ..InstrumentSetup::new(id, &format!("rtu:{path}")) }
    };
    let setup = InstrumentsSetup {
        force: vec![at(1, "muprime-force2")],
        amplifier: at(2, "muprime-amplifier"),
        stage: at(3, "muprime-stage"),
        ..Default::default()
    };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let forces =
        eventually("forces", || Some(rig.force.read(now(epoch))).filter(|forces| forces.normal.is_ok()));
    assert_eq!(forces.lateral.unwrap().raw, -12_500);
    rig.amplifier.command(DriveCommand::off(77, now(epoch).plus(Nanos::from_seconds(5.0))), now(epoch));
    eventually("the heartbeat", || bench.commanded(Command::DriveHeartbeat).filter(|&beat| beat == 77.0));
}

/// How the RTU server below misbehaves.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Prank {
    /// The answer comes after the client's deadline.
    Late,
    /// The answer comes in many pieces.
    Split,
    /// A bit is wrong, and so is the check.
    BadCrc,
    /// A bit is wrong, and the check fits.
    Undetected,
    /// Another unit answers.
    OtherUnit,
}

const WRONG: u16 = 12_345;

/// An FT 300 with a prank from the tenth request on.
fn rtu_prankster(prank: Prank) -> (String, Arc<AtomicUsize>, Arc<AtomicBool>) {
    use instruments::codec::modbus_rtu::{Operation, Parsed, give, hear};
    let (mut port, path) = pty();
    let (count, stop) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
    let (counted, stopped) = (Arc::clone(&count), Arc::clone(&stop));
    std::thread::spawn(move || {
        port.set_timeout(Duration::from_millis(1)).unwrap();
        let (mut heard, mut buffer) = (Vec::new(), [0; 256]);
        while !stopped.load(Ordering::SeqCst) {
            match port.read(&mut buffer) {
                Ok(count) => heard.extend_from_slice(&buffer[..count]),
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
                Err(_) => std::thread::sleep(Duration::from_millis(1)),
            }
            let (address, length) = match hear(&heard, &[]) {
                Parsed::Incomplete => continue,
                Parsed::Noise => {
                    heard.remove(0);
                    continue;
                }
                Parsed::Request(_, Operation::Read { address, .. }, length) => (address, length),
                Parsed::Request(_, _, length) => (0, length),
            };
            heard.drain(..length);
            let request = counted.fetch_add(1, Ordering::SeqCst);
            if address == 514 {
                let _ = port.write_all(&give(9, 3, &[2019]));
                continue;
            }
            let sound = give(9, 3, &[150, 0, 225, 0, 0, 0]);
            let wrong = give(9, 3, &[WRONG, 0, 225, 0, 0, 0]);
            if request < 10 || request > 13 && prank != Prank::Split {
                let _ = port.write_all(&sound);
                continue;
            }
            match prank {
                Prank::Late => {
                    std::thread::sleep(Duration::from_millis(260));
                    let _ = port.write_all(&wrong);
                }
                Prank::Split => {
                    for byte in sound {
                        let _ = port.write_all(&[byte]);
                        std::thread::sleep(Duration::from_micros(300));
                    }
                }
                Prank::BadCrc => {
                    let mut bad = wrong;
                    bad[4] ^= 1;
                    let _ = port.write_all(&bad);
                }
                // 40000 counts are 400 N, beyond the range: the check that is left after the CRC.
                Prank::Undetected => drop(port.write_all(&give(9, 3, &[0x7FFF, 0, 225, 0, 0, 0]))),
                Prank::OtherUnit => drop(port.write_all(&give(8, 3, &[WRONG, 0, 225, 0, 0, 0]))),
            }
        }
    });
    (path, count, stop)
}

#[test]
fn no_prank_on_an_rtu_line_becomes_a_force() {
    for prank in [Prank::Late, Prank::Split, Prank::BadCrc, Prank::Undetected, Prank::OtherUnit] {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let (path, requests, stop) = rtu_prankster(prank);
        let mut setup = setup(others.address());
        setup.force = vec![axes("robotiq-ft300", &path)];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        let (mut wrong, mut saturated) = (0, 0);
        let until = Instant::now() + Duration::from_secs(30);
        while requests.load(Ordering::SeqCst) < 40 {
            assert!(Instant::now() < until, "{prank:?}: the line did not recover");
            if let Ok(reading) = rig.force.read(now(epoch)).lateral {
                wrong += usize::from(reading.raw == i64::from(WRONG));
                saturated += usize::from(reading.quality == realtime::ports::Quality::Saturated);
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        eventually("a good sample again", || {
            rig.force.read(now(epoch)).lateral.ok().filter(|r| r.raw == 150)
        });
        assert_eq!(wrong, 0, "{prank:?}");
        assert_eq!(saturated > 0, prank == Prank::Undetected, "{prank:?}");
        stop.store(true, Ordering::SeqCst);
    }
}

/// espmonitor issue 12: a port that is gone is a disconnection, not an endless loop.
#[test]
fn an_unplugged_port_is_a_disconnection() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    standing_forces(&bench);
    let others = bench::serve_all(&bench, epoch);
    let (port, path) = pty();
    let devices = [(9, device("robotiq-ft300"))].into_iter().collect();
    let emulator = SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap();
    let mut setup = setup(others.address());
    setup.force = vec![axes("robotiq-ft300", &path)];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    drop(emulator); // closes the other end: the path is gone
    eventually("the loop is told", || {
        rig.force.read(now(epoch)).lateral.err().filter(|&e| e == NoData::Disconnected)
    });
    std::thread::sleep(Duration::from_millis(300));
    let (_, health) = rig.links.health().next().unwrap();
    assert!(health.connections <= 2, "{health:?}");
}

/// The amplifier of text and binary blocks, with an error line that comes unasked into the dialogue.
#[test]
fn pdus210_over_its_serial_line() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::Temperature, 41.5);
    let others = bench::serve_all(&bench, epoch);
    let (port, path) = pty();
    let alarms = Arc::new(AtomicBool::new(false));
    let raise = Arc::clone(&alarms);
    let mut last = Instant::now();
    let instrument = LineInstrument::new(device("piezodrive-pdus210"), plant(&bench, epoch));
    let _emulator = SerialEmulator::lines(port, instrument, move || {
        let due = raise.load(Ordering::SeqCst) && last.elapsed() > Duration::from_millis(17);
        due.then(|| {
            last = Instant::now();
            "LPERR".to_string()
        })
    })
    .unwrap();
    let mut setup = setup(others.address());
    setup.amplifier = InstrumentSetup {
        amplitude_m_per_unit: Some(2e-8),
        measured_m_per_unit: Some(1e-5),
        ..InstrumentSetup::new("piezodrive-pdus210", &path)
    };
    bench.set(Quantity::FrequencySetPoint, 27_500.0);
    bench.set(Quantity::Amplitude, 1.5e-6);
    let mut rig = drivers::open(&setup, epoch).unwrap();
    // Nothing commands it yet, so that its own 'off' takes the amplitude back after a while: it is set until it is seen.
    let state = eventually("100 V are 2 um", || {
        bench.set(Quantity::AmplitudeSetPoint, 2e-6);
        let state = rig.amplifier.state(now(epoch)).ok();
        state.filter(|state| (state.echoed_amplitude.metres() - 2e-6).abs() < 1e-12)
    });
    assert!((state.amplitude.unwrap().value - 1.5e-6).abs() < 1e-12);
    assert!((state.temperature_c.unwrap().value - 41.5).abs() < 1e-5);
    assert!(!state.output_on && !state.fault);
    rig.amplifier.command(DriveCommand::off(1, now(epoch).plus(Nanos::from_seconds(5.0))), now(epoch));
    eventually("off", || bench.commanded(Command::Enable).filter(|&on| on == 0.0));
    eventually("and the amplitude after it", || bench.commanded(Command::Amplitude).filter(|&w| w == 0.0));
    // Error lines from now on, also into the binary block and between question and answer.
    alarms.store(true, Ordering::SeqCst);
    eventually("a fault", || rig.amplifier.state(now(epoch)).ok().filter(|state| state.fault));
    let until = Instant::now() + Duration::from_secs(1);
    while Instant::now() < until {
        if let Ok(state) = rig.amplifier.state(now(epoch)) {
            assert!(
                (state.echoed_frequency_hz - 27_500.0).abs() < 1e-6,
                "an error line became a number: {state:?}"
            );
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    alarms.store(false, Ordering::SeqCst);
    eventually("all well again", || rig.amplifier.state(now(epoch)).ok().filter(|state| !state.fault));
}

#[test]
fn a_generator_by_scpi_with_pyvisa_and_pymeasure_as_its_clients() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let instrument = LineInstrument::new(device("keysight-33500b"), plant(&bench, epoch));
    let server = TcpLines::start("127.0.0.1:0".parse().unwrap(), instrument).unwrap();
    let output = python()
        .arg(file("tests/peers/scpi_client.py"))
        .arg(server.address().port().to_string())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["frequency"].as_f64(), Some(27_500.5));
    assert_eq!(said["amplitude"].as_f64(), Some(1.25));
    assert_eq!(
        (said["output"].as_bool(), said["unknown"].as_str()),
        (Some(true), Some("-113,\"Undefined header\""))
    );
    assert_eq!(said["pymeasure_found"], serde_json::json!([27_500.5, 1.25, true]));
    assert_eq!(said["pymeasure_set"], serde_json::json!([31_000.25, 0.75, false]));
    assert!(said["pymeasure_errors"].as_str().unwrap().starts_with("+0,"), "{said}");
    assert!((bench.commanded(Command::Amplitude).unwrap() - 1.25e-6).abs() < 1e-15);

    let mut setup = setup(others.address());
    setup.amplifier = InstrumentSetup::new("keysight-33500b", &server.address().to_string());
    let mut rig = drivers::open(&setup, epoch).unwrap();
    // An output that is found on, and that nobody here ordered, is switched off by the link itself.
    let state = eventually("off", || rig.amplifier.state(now(epoch)).ok().filter(|state| !state.output_on));
    assert!((state.echoed_frequency_hz - 27_500.5).abs() < 1e-9, "{state:?}");
}

pub fn adapter() -> (EmulatedAdapter, String, Arc<AtomicUsize>) {
    let (port, path) = pty();
    let adapter = EmulatedAdapter::new(port);
    let damage = adapter.damage();
    (adapter, path, damage)
}

#[test]
fn forces_over_slcan() {
    for (profile, base, count) in [("ati-netft-can", 432, 2.5e-4), ("me-gsv4-can", 0, 1.6e-4)] {
        let (bench, epoch) = (Bench::default(), Instant::now());
        standing_forces(&bench);
        let others = bench::serve_all(&bench, epoch);
        let (adapter, path, damage) = adapter();
        let devices = vec![CanDevice { device: device(profile), base }];
        let _emulator = CanEmulator::start(adapter, devices, plant(&bench, epoch)).unwrap();
        let mut setup = setup(others.address());
        let address = format!("slcan:{path}");
        setup.force = vec![axes(profile, &address)];
        if profile == "me-gsv4-can" {
            let axis =
                |signal: &str, gain: f64| Some(AxisSetup { signal: signal.into(), gain, offset_n: 0.0 });
            setup.force[0] = InstrumentSetup {
                lateral: axis("lateral", 1.0),
                normal: axis("normal", -1.0),
                ..setup.force[0].clone()
            };
        }
        let mut rig = drivers::open(&setup, epoch).unwrap();
        expect_forces(&mut rig, epoch, count);
        // Lost and doubled frames: never a sample out of halves of two.
        for which in [1, 2, 1, 2] {
            damage.store(which, Ordering::SeqCst);
            std::thread::sleep(Duration::from_millis(30));
        }
        expect_forces(&mut rig, epoch, count);
    }
}

#[test]
fn a_cia402_drive_over_slcan() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::Position, 0.0125);
    bench.set(Quantity::Velocity, -0.02);
    let others = bench::serve_all(&bench, epoch);
    let (adapter, path, _) = adapter();
    let devices = vec![CanDevice { device: device("cia402-profile-velocity"), base: 5 }];
    let _emulator = CanEmulator::start(adapter, devices, plant(&bench, epoch)).unwrap();
    let mut setup = setup(others.address());
    setup.stage = InstrumentSetup {
        dead_weight_n: Some(0.25),
        ..InstrumentSetup::new("cia402-profile-velocity", &format!("slcan:{path}"))
    };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let state = eventually("a state", || rig.stage.state(now(epoch)).ok());
    assert!(
        (state.position_m - 0.0125).abs() < 1e-6 && (state.velocity_m_s + 0.02).abs() < 1e-4,
        "{state:?}"
    );
    assert!(!state.fault);
    // A stop keeps coming; then the loop falls silent.
    for beat in 0..100 {
        let command = realtime::safety::StageCommand::stop(beat, now(epoch).plus(Nanos(50_000_000)));
        rig.stage.command(command, now(epoch));
        std::thread::sleep(Duration::from_millis(3));
    }
    eventually("a velocity set-point", || bench.commanded(Command::Velocity).filter(|&v| v == 0.0));
    assert!(!rig.stage.state(now(epoch)).unwrap().fault);
}

/// socat joins two pseudo-terminals, so that each side opens its own; they end with the first value.
pub fn socat_pair() -> ((tests::peer::Peer, tempfile::TempDir), String, String) {
    let folder = tempfile::tempdir().unwrap();
    let (ours, theirs) = (folder.path().join("ours"), folder.path().join("theirs"));
    let end = |path: &std::path::Path| format!("pty,raw,echo=0,link={}", path.display());
    let socat = std::process::Command::new("socat").args([end(&ours), end(&theirs)]).spawn();
    let socat = tests::peer::Peer(socat.unwrap_or_else(|error| panic!("socat: {error}: run tests/venv")));
    eventually("the pseudo-terminals", || (ours.exists() && theirs.exists()).then_some(()));
    let name = |path: std::path::PathBuf| path.to_str().unwrap().to_string();
    ((socat, folder), name(ours), name(theirs))
}

/// python-can's slcan as the other side of ours.
#[test]
fn python_can_hears_and_answers_our_frames() {
    let (_socat, ours, theirs) = socat_pair();
    let (_echo, ready) = tests::peer::start(python().arg(file("tests/peers/slcan_echo.py")).arg(&theirs));
    assert_eq!(ready, "ready");
    let mut bus = Slcan::open(&ours, 1_000_000).unwrap();
    for i in 0..200_u32 {
        let data = i.to_be_bytes();
        let frame = CanFrame::build(0x100 + i, false, &data[..(i % 5) as usize]).unwrap();
        bus.send(&frame).unwrap();
        let back = bus.receive(Instant::now() + Duration::from_secs(5)).unwrap();
        // The echo adds one to the identifier and turns the data round.
        let mut turned = data[..(i % 5) as usize].to_vec();
        turned.reverse();
        let expected = CanFrame::build(0x101 + i, false, &turned).unwrap();
        assert_eq!(back, Some(CanEvent::Frame(expected, Duration::ZERO)), "frame {i}");
    }
}

/// Random frames through cantools and through our packing, for every signal of the bundled DBC file.
#[test]
fn dbc_signals_agree_with_cantools() {
    let dbc = file("drivers/profiles/muprime-can.dbc");
    let output = python().arg(file("tests/peers/dbc_values.py")).arg(&dbc).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(dbc).unwrap();
    let random = std::fs::read_to_string(file("tests/recordings/odd-signals.dbc")).unwrap();
    let mut messages = instruments::codec::dbc::parse(&text).unwrap();
    messages.extend(instruments::codec::dbc::parse(&random).unwrap());
    let mut compared = 0;
    let output2 = python()
        .arg(file("tests/peers/dbc_values.py"))
        .arg(file("tests/recordings/odd-signals.dbc"))
        .output()
        .unwrap();
    assert!(output2.status.success(), "{}", String::from_utf8_lossy(&output2.stderr));
    let all = [output.stdout, output2.stdout].concat();
    for line in String::from_utf8(all).unwrap().lines() {
        let case: serde_json::Value = serde_json::from_str(line).unwrap();
        let frame = instruments::codec::from_hex(case["hex"].as_str().unwrap()).unwrap();
        let message = &messages[case["message"].as_str().unwrap()];
        let mut packed = vec![0; frame.len()];
        for (name, value) in case["values"].as_object().unwrap() {
            let signal = message.signals[name];
            let (ours, theirs) = (signal.read(&frame).unwrap(), value.as_f64().unwrap());
            assert!(
                (ours - theirs).abs() <= 1e-9 * theirs.abs().max(1.0),
                "{name}: {ours} and {theirs} in {line}"
            );
            signal.write(&mut packed, theirs);
            compared += 1;
        }
        assert_eq!(packed, instruments::codec::from_hex(case["packed"].as_str().unwrap()).unwrap(), "{line}");
    }
    assert!(compared > 5_000, "{compared}");
}
