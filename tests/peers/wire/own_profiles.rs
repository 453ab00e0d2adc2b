//! The profiles of `docs/profiles.md`, as a laboratory would write them: each against an instrument in
//! Python, and its own emulator against its own driver.

use super::lines::{plant, pty, setup, socat_pair};
use drivers::InstrumentSetup;
use drivers::user_profiles::Source;
use realtime::Nanos;
use realtime::safety::DriveCommand;
use sim::wire::device::Device;
use sim::wire::lines::LineInstrument;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::serial::SerialEmulator;
use sim::wire::{Command, Quantity};
use std::io::Write;
use std::process::Stdio;
use std::sync::Arc;
use std::time::Instant;
use tests::peer::start;
use tests::{file, python};
use wall::bench::{self, Bench, eventually, now};

fn source(name: &str) -> Source {
    Source::read(&file(&format!("docs/profiles/{name}.toml"))).unwrap_or_else(|error| panic!("{error}"))
}

fn own(name: &str, address: &str) -> InstrumentSetup {
    InstrumentSetup { source: Some(Arc::new(source(name))), ..InstrumentSetup::new(name, address) }
}

fn device(name: &str) -> Device {
    Device::new(source(name).profile().unwrap()).unwrap()
}

fn expect_forces(rig: &mut drivers::Rig, epoch: Instant, expected: [f64; 2], within: f64) {
    let read = |rig: &mut drivers::Rig| {
        let forces = rig.force.read(now(epoch));
        Some((forces.lateral.ok()?, forces.normal.ok()?))
    };
    let (lateral, normal) = eventually("both axes", || read(rig));
    assert!((lateral.value - expected[0]).abs() <= within, "{lateral:?}");
    assert!((normal.value - expected[1]).abs() <= within, "{normal:?}");
    assert_eq!(lateral.quality, realtime::ports::Quality::Good);
    let first = lateral.sequence;
    eventually("fifty newer samples", || {
        read(rig).filter(|(lateral, _)| lateral.sequence.wrapping_sub(first) >= 50)
    });
    let health: Vec<_> = rig.links.health().map(|(_, health)| health).collect();
    assert_eq!((health[0].corrupt_frames, health[0].last_problem.as_str()), (0, ""), "{:?}", health[0]);
}

#[test]
fn a_board_in_python_that_sends_by_itself() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let (_pair, ours, theirs) = socat_pair();
        let (_board, ready) =
            start(python().arg(file("tests/peers/bench_board.py")).arg(&theirs).args(["-123.45", "250.01"]));
        assert_eq!(ready, "ready");
        let mut setup = setup(others.address());
        setup.force = vec![own("bench-board", &ours)];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        expect_forces(&mut rig, epoch, [-0.12345, 0.25001], 1e-9);
    });
}

/// The same board behind a device server: socat passes its line on over TCP.
#[test]
fn a_board_behind_a_device_server() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let folder = tempfile::tempdir().unwrap();
        let line = folder.path().join("line");
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let ends =
            [format!("pty,raw,echo=0,link={}", line.display()), format!("tcp-listen:{port},bind=127.0.0.1")];
        let _server = tests::peer::Peer(std::process::Command::new("socat").args(ends).spawn().unwrap());
        eventually("the line", || line.exists().then_some(()));
        let (_board, ready) =
            start(python().arg(file("tests/peers/bench_board.py")).arg(&line).args(["-123.45", "250.01"]));
        assert_eq!(ready, "ready");
        let mut setup = setup(others.address());
        setup.force = vec![own("bench-board", &format!("tcp:127.0.0.1:{port}"))];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        expect_forces(&mut rig, epoch, [-0.12345, 0.25001], 1e-9);
    });
}

/// A board that prints lines: the half line at the beginning and lines that are none are no samples.
#[test]
fn a_board_that_prints_lines() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let whole = source("bench-board").text;
        let (head, _) = whole.split_once("[stream]").unwrap();
        let signal =
            |name: &str| format!("[[signal]]\nname = \"{name}\"\nsi = {{ factor = 1e-3, unit = \"N\" }}\n");
        let text = format!(
            "{head}[stream]\nrate_hz = 100\nline = \"{{*}}: {{lateral:.2}} {{normal:.2}} mN\"\n{}{}\
         [[vector]]\nline = \"7: 125.00 -250.00 mN\"\nexpect = {{ lateral = 125, normal = -250 }}\n",
            signal("lateral"),
            signal("normal")
        );
        let source = Source { text, ..source("bench-board") };
        let profile = source.profile().unwrap_or_else(|error| panic!("{error}"));
        let lateral = profile.signal("lateral").unwrap();
        assert!(
            (profile.lsb_si(lateral, &profile.values()) - 1e-5).abs() < 1e-15,
            "two decimals of a millinewton"
        );
        let (mut port, path) = pty();
        let ended = Arc::new(std::sync::atomic::AtomicBool::new(false));
        let end = Arc::clone(&ended);
        let board = std::thread::spawn(move || {
            port.set_timeout(std::time::Duration::from_millis(5)).unwrap();
            for count in 0.. {
                let line = match count % 10 {
                    3 => "12: 99.9 mN".to_string(),
                    6 => "3: nan 1 mN".into(),
                    _ => format!("{count}: -123.45 250.01 mN"),
                };
                // While nobody listens it is lost, as on a real line.
                let _ = port.write_all(format!("{line}\n").as_bytes());
                std::thread::sleep(std::time::Duration::from_millis(10));
                if end.load(std::sync::atomic::Ordering::Relaxed) {
                    return;
                }
            }
        });
        let mut setup = setup(others.address());
        setup.force = vec![InstrumentSetup {
            source: Some(Arc::new(source)),
            ..InstrumentSetup::new("bench-board", &path)
        }];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        let read = |rig: &mut drivers::Rig| {
            let forces = rig.force.read(now(epoch));
            Some((forces.lateral.ok()?, forces.normal.ok()?))
        };
        let first = eventually("both axes", || read(&mut rig)).0.sequence;
        eventually("forty samples, each of them right", || {
            let (lateral, normal) = read(&mut rig)?;
            let right = (lateral.value + 0.12345).abs() < 1e-12 && (normal.value - 0.25001).abs() < 1e-12;
            assert!(right, "{lateral:?} {normal:?}");
            (lateral.sequence.wrapping_sub(first) >= 40).then_some(())
        });
        let health = rig.links.health().next().unwrap().1;
        assert!(health.corrupt_frames >= 4 && health.last_problem.contains("mN"), "{health:?}");
        ended.store(true, std::sync::atomic::Ordering::Relaxed);
        board.join().unwrap();
    });
}

#[test]
fn a_strain_gauge_amplifier_by_pymodbus_gets_its_filter_and_gives_floats() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let (_amplifier, port) =
            start(python().arg(file("tests/peers/strain_amp.py")).args(["-0.1234567", "0.25"]));
        let mut setup = setup(others.address());
        setup.force = vec![own("strain-amp", &format!("127.0.0.1:{port}"))];
        let mut rig = drivers::open(&setup, epoch).unwrap();
        // Its status is a fault until the filter's registers were written.
        expect_forces(&mut rig, epoch, [f64::from(-0.123_456_7_f32), 0.25], 1e-12);
    });
}

#[test]
fn a_generator_in_python_with_names_words_hexadecimal_and_numbered_alarms() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let others = bench::serve_all(&bench, epoch);
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("told");
        let (_pair, ours, theirs) = socat_pair();
        let mut command = python();
        command.arg(file("tests/peers/ascii_generator.py")).arg(&theirs).arg(&log).stdin(Stdio::piped());
        let (mut generator, ready) = start(&mut command);
        assert_eq!(ready, "ready");
        let mut to = generator.0.stdin.take().unwrap();
        let mut setup = setup(others.address());
        setup.amplifier =
            InstrumentSetup { amplitude_m_per_unit: Some(2e-7), ..own("ascii-generator", &ours) };
        let mut rig = drivers::open(&setup, epoch).unwrap();
        let state = eventually("a state", || rig.amplifier.state(now(epoch)).ok());
        assert!((state.echoed_amplitude.metres() - 2.5e-6).abs() < 1e-15, "12.5 % at 200 nm: {state:?}");
        assert!((state.echoed_frequency_hz - 27_500.0).abs() < 1e-9 && !state.output_on && !state.fault);
        writeln!(to, "2A").unwrap();
        eventually("a fault", || rig.amplifier.state(now(epoch)).ok().filter(|state| state.fault));
        let health = rig.links.health().find(|(id, _)| *id == "ascii-generator").unwrap().1;
        assert!(health.alarms > 0 && health.last_problem.contains("ALARM 2A"), "{health:?}");
        writeln!(to).unwrap();
        eventually("all well again", || rig.amplifier.state(now(epoch)).ok().filter(|state| !state.fault));
        rig.amplifier.command(DriveCommand::off(1, now(epoch).plus(Nanos::from_seconds(5.0))), now(epoch));
        let told = || std::fs::read_to_string(&log).unwrap();
        eventually("off", || (told().contains("OUT=OFF\n") && told().contains("AMP=0.0%\n")).then_some(()));
        let silent = |rig: &mut drivers::Rig| {
            rig.amplifier.state(now(epoch)).ok().filter(|s| s.echoed_amplitude.metres() == 0.0)
        };
        eventually("its echo", || silent(&mut rig));
    });
}

#[test]
fn each_examples_own_emulator_and_driver_mean_the_same() {
    wall::again_beside_a_stall(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        bench.set(Quantity::LateralForce, 0.125);
        bench.set(Quantity::NormalForce, 0.25);
        bench.set(Quantity::FrequencySetPoint, 27_500.0);
        let others = bench::serve_all(&bench, epoch);
        let (port, board) = pty();
        let _board = SerialEmulator::stream(port, device("bench-board"), plant(&bench, epoch)).unwrap();
        let (port, line) = pty();
        let served = LineInstrument::new(device("ascii-generator"), plant(&bench, epoch));
        let _generator = SerialEmulator::lines(port, served, || None).unwrap();
        let units = [(7, device("strain-amp"))].into_iter().collect();
        let any = "127.0.0.1:0".parse().unwrap();
        let amplifier = ModbusTcpServer::start(any, units, plant(&bench, epoch)).unwrap();
        for force in [own("bench-board", &board), own("strain-amp", &amplifier.address().to_string())] {
            let mut setup = setup(others.address());
            setup.force = vec![force];
            // The rig before ended with an 'off'.
            bench.set(Quantity::AmplitudeSetPoint, 2e-6);
            setup.amplifier = own("ascii-generator", &line);
            let mut rig = drivers::open(&setup, epoch).unwrap();
            expect_forces(&mut rig, epoch, [0.125, 0.25], 1e-9);
            let state = eventually("a state", || rig.amplifier.state(now(epoch)).ok());
            assert!((state.echoed_amplitude.metres() - 2e-6).abs() < 1e-15, "{state:?}");
            rig.amplifier
                .command(DriveCommand::off(1, now(epoch).plus(Nanos::from_seconds(5.0))), now(epoch));
            eventually("off", || bench.commanded(Command::Enable).filter(|&on| on == 0.0));
        }
    });
}

/// A whole sweep whose forces come by way of the board in Python: the virtual rig's friction, behind a
/// protocol that this program knows from the file alone.
#[test]
fn a_sweep_with_the_board_as_its_force_sensor() {
    wall::again_beside_a_stall(|| {
        let served = tests::served::ServedRig::start(5, None);
        let (_pair, ours, theirs) = socat_pair();
        let modbus = served.address.port().to_string();
        let (_board, ready) =
            start(python().arg(file("tests/peers/bench_board.py")).arg(&theirs).arg(&modbus));
        assert_eq!(ready, "ready");
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let instrument = format!("profile = \"muprime-force2\"\naddress = \"{}\"", served.address);
        let text = tests::served::setup("own-board", served.address);
        assert!(text.contains(&instrument), "{text}");
        // Python on a busy machine may pause for longer than a board does: at 25 samples a second it may for 165 ms.
        let own = format!("profile = \"bench-board.toml\"\naddress = \"{ours}\"\nrate_hz = 25");
        std::fs::write(at("setup.toml"), text.replacen(&instrument, &own, 1)).unwrap();
        std::fs::copy(file("docs/profiles/bench-board.toml"), at("bench-board.toml")).unwrap();
        let plan = tests::served::timed_plan("own", 3, &[0.5e-6, 1e-6, 2e-6, 3e-6], [0.12, 0.2]);
        std::fs::write(at("plan.toml"), plan).unwrap();
        let (out, output) = wall::sweep_unless_the_machine_stalls(folder.path(), |out| {
            let mut command = tests::muprime();
            command
                .arg("run")
                .arg(at("plan.toml"))
                .arg("--setup")
                .arg(at("setup.toml"))
                .arg("--out")
                .arg(out);
            command
        });
        let (_, said) = tests::texts(&output);
        assert!(output.status.success(), "{said}");
        let passes = std::fs::read_to_string(out.join("passes.jsonl")).unwrap();
        let found: Vec<(f64, f64, f64)> = passes
            .lines()
            .filter_map(|line| {
                let pass: runs::sweep::MeasuredPass = serde_json::from_str(line).unwrap();
                let compared = pass.comparison?;
                let amplitude = pass.pass.amplitude.metres();
                Some((amplitude, compared.mu_relative?, compared.mu_relative_sd?))
            })
            .filter(|(amplitude, ..)| *amplitude > 0.0)
            .collect();
        assert!(found.len() >= 4, "{passes}");
        let mean = |pp_m: f64| {
            let at: Vec<f64> =
                found.iter().filter(|(w, ..)| (w - pp_m).abs() < 1e-8).map(|(_, mu, _)| *mu).collect();
            at.iter().sum::<f64>() / at.len() as f64
        };
        // Friction falls with the amplitude, as the rig behind the board has it.
        assert!(mean(0.5e-6) > mean(2e-6) + 0.1 && mean(2e-6) > mean(3e-6), "{found:?}");
        assert!(!said.contains("disagrees with the model"), "an ideal rig: {said}");
    });
}
