//! Bundled instruments that are a file and no more, each against one in Python that knows nothing of ours; bytes on the wire.

use super::lines::{plant, pty, setup, socat_pair};
use drivers::user_profiles::Source;
use drivers::{AxisSetup, InstrumentSetup, InstrumentsSetup};
use realtime::Nanos;
use realtime::safety::{DriveCommand, StageCommand};
use sim::wire::device::Device;
use sim::wire::streams::NetworkStream;
use sim::wire::{Command, Quantity};
use std::io::Write;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Instant;
use tests::peer::start;
use tests::{file, python};
use wall::bench::{self, Bench, eventually, now};

fn axis(signal: &str, gain: f64) -> Option<AxisSetup> {
    Some(AxisSetup { signal: signal.into(), gain, offset_n: 0.0 })
}

/// Opens a rig whose force sensor is the one given, and waits for fifty samples of both axes.
fn expect_forces(force: Vec<InstrumentSetup>, expected: [f64; 2], within: f64) -> drivers::HealthReport {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let mut setup: InstrumentsSetup = setup(others.address());
    setup.force = force;
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let mut read = || {
        let forces = rig.force.read(now(epoch));
        Some((forces.lateral.ok()?, forces.normal.ok()?))
    };
    let (lateral, normal) = eventually("both axes", &mut read);
    assert!((lateral.value - expected[0]).abs() <= within, "{lateral:?}");
    assert!((normal.value - expected[1]).abs() <= within, "{normal:?}");
    let first = lateral.sequence;
    eventually("newer", || read().filter(|(lateral, _)| lateral.sequence.wrapping_sub(first) >= 150));
    rig.links.health().next().unwrap().1
}

#[test]
fn a_labjack_by_pymodbus_is_read_at_registers_that_lie_apart() {
    let (_labjack, port) = start(python().arg(file("tests/peers/labjack_t7.py")).args(["0.0625", "-0.25"]));
    let labjack = InstrumentSetup {
        lateral: axis("ain0", 2.0),
        normal: axis("ain2", -1.0),
        ..InstrumentSetup::new("labjack-t7", &format!("127.0.0.1:{port}"))
    };
    let health = expect_forces(vec![labjack], [0.125, 0.25], 1e-12);
    assert_eq!((health.exceptions, health.corrupt_frames), (0, 0), "{health:?}");
}

#[test]
fn records_in_datagrams_are_samples_and_the_lost_the_doubled_and_the_short_are_not() {
    let (_cell, port) = start(python().arg(file("tests/peers/udp_cell.py")).args(["rdt", "1.5", "-2.25"]));
    let cell = InstrumentSetup {
        lateral: axis("fx", 1.0),
        normal: axis("fz", -1.0),
        ..InstrumentSetup::new("ati-netft-rdt", &format!("127.0.0.1:{port}"))
    };
    let health = expect_forces(vec![cell], [1.5, 2.25], 1e-12);
    assert!(health.lost_samples >= 2 && health.repeats >= 2 && health.corrupt_frames >= 2, "{health:?}");
    assert!(health.last_problem.contains("5 bytes"), "{health:?}");
}

/// Another way round: the instrument is set to send to a port of this machine, lines of text without an end.
#[test]
fn lines_in_datagrams_to_a_port_of_this_machine() {
    let here = std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let (_cell, port) = start(python().arg(file("tests/peers/udp_cell.py")).args([
        "lines",
        &here.to_string(),
        "-123.4",
        "250.5",
    ]));
    let text = datagram_lines(here);
    let source = Source { id: "udp-lines".into(), text, files: Vec::new(), origin: "here".into() };
    let cell = InstrumentSetup {
        source: Some(Arc::new(source)),
        ..InstrumentSetup::new("udp-lines", &format!("127.0.0.1:{port}"))
    };
    expect_forces(vec![cell], [-0.1234, 0.2505], 1e-12);
}

fn datagram_lines(port: u16) -> String {
    let signal =
        |name: &str| format!("[[signal]]\nname = \"{name}\"\nsi = {{ factor = 1e-3, unit = \"N\" }}\n");
    format!(
        "[profile]\nschema = 1\nid = \"udp-lines\"\nmaker = \"own\"\nmodels = [\"m\"]\n\
         roles = [\"force.lateral\", \"force.normal\"]\nprovenance = \"p\"\nverified = \"emulator-only\"\n\
         [link]\nkind = \"udp\"\nlocal_port = {port}\nresponse_timeout_ms = 200\n\
         [stream]\nrate_hz = 500\nline = \"{{lateral:.1}};{{normal:.1}}\"\n{}{}\
         [emulator.measure]\nlateral = \"force.lateral_n\"\nnormal = \"force.normal_n\"\n\
         [[vector]]\nline = \"1.5;-2.5\"\nexpect = {{ lateral = 1.5, normal = -2.5 }}\n",
        signal("lateral"),
        signal("normal")
    )
}

/// Our own emulators over the network, read by our own driver: streams over TCP and in datagrams, both ways round.
#[test]
fn streams_over_the_network_and_their_emulators_mean_the_same() {
    let here = std::net::UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let board = std::fs::read_to_string(file("docs/profiles/bench-board.toml")).unwrap();
    let line = |line: &&str| !(line.starts_with("baud") || line.starts_with("format"));
    let over_tcp = board.lines().filter(line).collect::<Vec<_>>().join("\n");
    let over_tcp = over_tcp.replacen("kind = \"serial\"", "kind = \"tcp\"\nport = 1", 1);
    let rdt = drivers::bundled::text("ati-netft-rdt").unwrap().replace("\"ati-netft-rdt\"", "\"own-rdt\"");
    for (id, text, axes) in [
        ("bench-board", over_tcp, ["lateral", "normal"]),
        ("own-rdt", rdt, ["fx", "fz"]),
        ("udp-lines", datagram_lines(here), ["lateral", "normal"]),
    ] {
        let source = Source { id: id.into(), text, files: Vec::new(), origin: "here".into() };
        let (bench, epoch) = (Bench::default(), Instant::now());
        bench.set(Quantity::LateralForce, 0.125);
        bench.set(Quantity::NormalForce, 0.25);
        let device = Device::new(source.profile().unwrap_or_else(|e| panic!("{id}: {e}"))).unwrap();
        let any = "127.0.0.1:0".parse().unwrap();
        let served = NetworkStream::start(any, device, plant(&bench, epoch)).unwrap();
        let instrument = InstrumentSetup {
            source: Some(Arc::new(source)),
            lateral: axis(axes[0], 1.0),
            normal: axis(axes[1], 1.0),
            ..InstrumentSetup::new(id, &served.address().to_string())
        };
        expect_forces(vec![instrument], [0.125, 0.25], 1e-3);
    }
}

#[test]
fn a_siglent_in_python_is_driven_by_answers_that_name_their_values() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("told");
    let (_generator, port) = start(python().arg(file("tests/peers/siglent_sdg.py")).arg(&log));
    let mut setup = setup(others.address());
    setup.amplifier = InstrumentSetup {
        amplitude_m_per_unit: Some(2e-6),
        ..InstrumentSetup::new("siglent-sdg", &format!("127.0.0.1:{port}"))
    };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let state = eventually("a state", || rig.amplifier.state(now(epoch)).ok());
    assert!((state.echoed_amplitude.metres() - 8e-6).abs() < 1e-15, "4 Vpp at 2 um: {state:?}");
    assert!((state.echoed_frequency_hz - 1000.0).abs() < 1e-9 && !state.output_on && !state.fault);
    let told = || std::fs::read_to_string(&log).unwrap();
    assert!(told().contains("C1:OUTP LOAD,HZ\n") && told().contains("C1:BSWV WVTP,SINE\n"), "{}", told());
    rig.amplifier.command(DriveCommand::off(1, now(epoch).plus(Nanos::from_seconds(5.0))), now(epoch));
    eventually("off", || told().contains("C1:OUTP OFF\n").then_some(()));
    let ends = rig.links.close();
    assert!(ends.iter().any(|end| end.name == "siglent-sdg" && end.closed == drivers::Closed::ReadBackOff));
}

#[test]
fn a_zaber_in_python_moves_stops_and_tells_its_faults() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    let (_pair, ours, theirs) = socat_pair();
    let mut command = python();
    command.arg(file("tests/peers/zaber_stage.py")).arg(&theirs).stdin(Stdio::piped());
    let (mut stage, ready) = start(&mut command);
    assert_eq!(ready, "ready");
    let mut flag = stage.0.stdin.take().unwrap();
    let mut setup = setup(others.address());
    setup.stage = InstrumentSetup { dead_weight_n: Some(0.25), ..InstrumentSetup::new("zaber-x-lsm", &ours) };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let state = eventually("a state", || rig.stage.state(now(epoch)).ok());
    assert!((state.position_m - 100_000.0 * 4.7625e-8).abs() < 1e-9 && !state.fault, "{state:?}");
    let stop = StageCommand::stop(1, now(epoch).plus(Nanos::from_seconds(5.0)));
    rig.stage.command(stop, now(epoch));
    eventually("at rest", || rig.stage.state(now(epoch)).ok().filter(|state| state.velocity_m_s == 0.0));
    writeln!(flag, "FS").unwrap();
    eventually("a fault", || rig.stage.state(now(epoch)).ok().filter(|state| state.fault));
    writeln!(flag, "--").unwrap();
    eventually("none", || rig.stage.state(now(epoch)).ok().filter(|state| !state.fault));
    let ends = rig.links.close();
    assert!(ends.iter().any(|end| end.name == "zaber-x-lsm" && end.closed == drivers::Closed::ReadBackOff));
}

#[test]
fn a_converter_of_the_kernel_is_read_by_its_attributes() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("iio:device0");
    std::fs::create_dir(&place).unwrap();
    let (_tree, ready) =
        start(python().arg(file("tests/peers/iio_tree.py")).arg(&place).args(["-125.0", "250.0"]));
    assert_eq!(ready, "ready");
    let cell = |lateral, normal| InstrumentSetup {
        lateral: axis(lateral, 1.0),
        normal: axis(normal, -2.0),
        ..InstrumentSetup::new("iio-voltage", place.to_str().unwrap())
    };
    // A count is 15 uV.
    let health = expect_forces(vec![cell("voltage0", "voltage1")], [-0.125, -0.5], 4e-5);
    assert_eq!((health.corrupt_frames, health.timeouts), (0, 0), "{health:?}");
    let mut gone = cell("voltage0", "voltage1");
    gone.address = folder.path().join("iio:device1").display().to_string();
    let (endpoint, _port) = drivers::endpoint::Endpoint::force(gone.description().unwrap(), &gone).unwrap();
    let said = drivers::open_one(&gone, endpoint, Instant::now()).err().unwrap().to_string();
    assert!(said.contains("is not a folder"), "{said}");
}

/// The same device by our own emulator, as the virtual rig serves it.
#[test]
fn the_attributes_of_a_virtual_converter_mean_the_same() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, 0.125);
    bench.set(Quantity::NormalForce, 0.25);
    let device = Device::new(drivers::profile("iio-voltage").unwrap()).unwrap();
    let served = sim::wire::sysfs::SysfsFolder::start(device, plant(&bench, epoch)).unwrap();
    let cell = InstrumentSetup {
        lateral: axis("voltage0", 1.0),
        normal: axis("voltage1", 1.0),
        ..InstrumentSetup::new("iio-voltage", served.path().to_str().unwrap())
    };
    expect_forces(vec![cell], [0.125, 0.25], 1e-6);
}

/// Two units of one kind, one for each axis: the virtual rig gave both the normal force.
#[test]
fn each_unit_of_a_cell_of_two_shows_its_own_axis() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, 1.5);
    bench.set(Quantity::NormalForce, 2.25);
    let any = "127.0.0.1:0";
    let unit = |unit: u8, lateral, normal| InstrumentSetup {
        unit: Some(unit),
        lateral,
        normal,
        ..InstrumentSetup::new("hbk-wtx110", any)
    };
    let at = |id: &str| InstrumentSetup::new(id, "127.0.0.1:0");
    let mut setup = InstrumentsSetup {
        force: vec![unit(11, axis("net", -1.0), None), unit(12, None, axis("net", 1.0))],
        amplifier: at("muprime-amplifier"),
        stage: at("muprime-stage"),
        ..Default::default()
    };
    setup.amplifier.unit = Some(2);
    let _served = rig::emulators::serve(&mut setup, &plant(&bench, epoch), false).unwrap();
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let (lateral, normal) = eventually("both axes", || {
        let forces = rig.force.read(now(epoch));
        Some((forces.lateral.ok()?.value, forces.normal.ok()?.value))
    });
    // A count is 10 mg.
    assert!((lateral - 1.5).abs() < 1e-4 && (normal - 2.25).abs() < 1e-4, "{lateral} {normal}");
    assert_eq!(bench.commanded(Command::Enable), None);
}

/// Every byte, both ways, with its port: over a line of text and over Modbus TCP.
#[test]
fn bytes_on_the_wire_are_shown_where_they_are_asked_for_and_nowhere_else() {
    let served = tests::served::ServedRig::start(7, None);
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("told");
    let (_pair, ours, theirs) = socat_pair();
    let mut command = python();
    command.arg(file("tests/peers/ascii_generator.py")).arg(&theirs).arg(&log).stdin(Stdio::piped());
    let (_generator, ready) = start(&mut command);
    assert_eq!(ready, "ready");
    let text = tests::served::setup("traced", served.address);
    let old = format!("[amplifier]\nprofile = \"muprime-amplifier\"\naddress = \"{}\"", served.address);
    let new = format!(
        "[amplifier]\nprofile = \"{}\"\naddress = \"{ours}\"",
        file("docs/profiles/ascii-generator.toml").display()
    );
    assert!(text.contains(&old), "{text}");
    let text =
        text.replacen(&old, &new, 1).replacen("[limits]\n", "[limits]\ntemperature_fitted = false\n", 1);
    let setup = folder.path().join("setup.toml");
    std::fs::write(&setup, text).unwrap();
    let doctor = |filter: &str| {
        let mut command = tests::muprime();
        command.env("MUPRIME_LOG", filter).args(["doctor", "--instruments-only", "--setup"]).arg(&setup);
        tests::texts(&command.output().unwrap()).1
    };
    let said = doctor("warn,wire");
    for line in [
        // The question and the answer of the line, in hexadecimal and as text.
        format!("{ours} -> 2A 49 44 4E 3F 0D 0A  \"*IDN?\\r\\n\""),
        format!("{ours} -> 53 54 41 54 45 3F 0D 0A  \"STATE?\\r\\n\""),
        "\"F=27500.0Hz,AMP=12.5%,OUT=OFF,S=00A1\\r\\n\"".to_string(),
        // Modbus TCP: transaction, protocol, length, unit, function 3, 16 or 20 registers from 0 on.
        format!("{} -> 00 00 00 00 00 06 01 03 00 00", served.address),
        format!("{} <- 00 00 00 00", served.address),
    ] {
        assert!(said.contains(&line), "{line} is not in\n{}", &said[..said.len().min(6000)]);
    }
    assert!(!doctor("warn").contains(" -> "), "nobody asked");
}

/// A pseudo-terminal stands for the line of a stage that is a file and no more, served by its own emulator.
#[test]
fn the_zaber_emulator_and_driver_mean_the_same() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    let others = bench::serve_all(&bench, epoch);
    bench.set(Quantity::Position, 0.01);
    let (port, line) = pty();
    let device = Device::new(drivers::profile("zaber-x-lsm").unwrap()).unwrap();
    let served = sim::wire::lines::LineInstrument::new(device, plant(&bench, epoch));
    let _stage = sim::wire::serial::SerialEmulator::lines(port, served, || None).unwrap();
    let mut setup = setup(others.address());
    setup.stage = InstrumentSetup { dead_weight_n: Some(0.25), ..InstrumentSetup::new("zaber-x-lsm", &line) };
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let state = eventually("a state", || rig.stage.state(now(epoch)).ok());
    assert!((state.position_m - 0.01).abs() < 5e-8 && !state.fault, "{state:?}");
    drop(rig);
    assert_eq!(bench.commanded(Command::Velocity), Some(0.0), "it ends with a stop");
}
