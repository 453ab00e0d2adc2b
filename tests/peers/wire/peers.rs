//! Programs that nobody here wrote, as instruments and as clients. `tests/venv` sets them up.

use drivers::{InstrumentSetup, InstrumentsSetup};
use sim::wire::{Command, Quantity};
use std::collections::BTreeMap;
use std::path::Path;
use std::time::{Duration, Instant};
use wall::bench::{self, Bench, now};

use tests::peer::start;
use tests::{file, python};

/// Lateral and normal counts of each row of the recording, by the rule that its README states.
fn recorded_counts(path: &Path) -> Vec<(i64, i64)> {
    let text = std::fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<f64>> = text
        .lines()
        .skip(1)
        .map(|line| line.split_whitespace().map(|x| x.parse().unwrap()).collect())
        .collect();
    let count = |newton: f64| (newton / 1e-5).round_ties_even() as i64;
    rows.iter()
        .map(|row| {
            let normal = 0.25 * row[3] / rows[0][3];
            (count(row[2] * normal), count(normal))
        })
        .collect()
}

/// A measured friction trace, replayed by a pymodbus server: every sample that the driver gives is the
/// row that its sequence names, to the register's resolution, and carries its age.
#[test]
fn a_replayed_friction_trace_comes_out_of_the_driver() {
    let recording = file("tests/recordings/rock-velocity-steps/velstep4_excerpt.txt");
    let trace = recorded_counts(&recording);
    let (_server, port) =
        start(python().arg(file("tests/peers/replay_server.py")).arg(&recording).arg("200"));
    let (bench, epoch) = (Bench::default(), Instant::now());
    let server = bench::serve_all(&bench, epoch);
    let mut setup = InstrumentsSetup {
        force: vec![InstrumentSetup::new("muprime-force2", &format!("127.0.0.1:{port}"))],
        amplifier: InstrumentSetup::new("muprime-amplifier", &server.address().to_string()),
        stage: InstrumentSetup::new("muprime-stage", &server.address().to_string()),
        ..Default::default()
    };
    setup.force[0].rate_hz = Some(500.0);
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let mut seen = BTreeMap::new();
    let last = u32::try_from(trace.len() - 1).unwrap();
    let began = Instant::now();
    while !seen.contains_key(&last) {
        assert!(began.elapsed() < Duration::from_secs(30), "the trace did not end; {} rows seen", seen.len());
        let at = now(epoch);
        let forces = rig.force.read(at);
        if let (Ok(lateral), Ok(normal)) = (forces.lateral, forces.normal) {
            assert_eq!(lateral.sequence, normal.sequence);
            assert!(lateral.taken_at <= at, "a sample from the future");
            seen.insert(lateral.sequence, (lateral, normal));
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    for (row, (lateral, normal)) in &seen {
        let (l, n) = trace[*row as usize];
        assert_eq!((lateral.raw, normal.raw), (l, n), "row {row}");
        let (l, n) = (l as f64 * 1e-5, n as f64 * 1e-5);
        assert!((lateral.value - l).abs() < 1e-12 && (normal.value - n).abs() < 1e-12, "row {row}");
    }
    // The rows' spacing by the instrument's clock survives: 5 ms a row, within the mapping's error.
    let (first, end) = (seen.iter().next().unwrap(), seen.iter().next_back().unwrap());
    let span = end.1.0.taken_at.seconds() - first.1.0.taken_at.seconds();
    let rows = f64::from(end.0 - first.0);
    assert!(seen.len() > trace.len() / 4, "only {} of {} rows were seen", seen.len(), trace.len());
    assert!((span - rows / 200.0).abs() < 0.2, "{rows} rows in {span} s");
}

#[test]
fn pymodbus_reads_and_commands_the_virtual_rig() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, -0.12345);
    bench.set(Quantity::NormalForce, 0.25);
    let server = bench::serve_all(&bench, epoch);
    let output = python()
        .arg(file("tests/peers/modbus_client.py"))
        .arg(server.address().port().to_string())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["magic"], 0x6D75_3246);
    assert_eq!((said["lateral"].as_i64(), said["normal"].as_i64()), (Some(-12345), Some(25000)));
    assert_eq!(
        said["micros"].as_i64().unwrap(),
        1000 * said["counter"].as_i64().unwrap(),
        "one sample, one moment"
    );
    assert_eq!(said["status"], 0);
    assert_eq!((said["written"].as_bool(), said["echo_amplitude"].as_i64()), (Some(true), Some(1500)));
    assert_eq!(said["echo_frequency"], 300_000);
    // Modbus exceptions: 2 illegal address, 3 illegal value, 11 gateway target does not answer.
    assert_eq!(said["beyond_the_end"], 2);
    assert_eq!(said["out_of_range"], 3);
    assert_eq!(said["write_to_a_reading"], 2);
    assert_eq!(said["no_such_unit"], 11);
    assert_eq!(bench.commanded(Command::Amplitude), Some(1500e-9));
    assert_eq!(bench.commanded(Command::Enable), Some(1.0));
}

#[test]
fn mbpoll_reads_and_commands_the_virtual_rig() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, -0.12345);
    bench.set(Quantity::NormalForce, 0.25);
    let server = bench::serve_all(&bench, epoch);
    let port = server.address().port().to_string();
    let mbpoll = |arguments: &[&str]| {
        let output = std::process::Command::new("mbpoll")
            .args(["-m", "tcp", "-p", &port, "-0", "-1", "-q"])
            .args(arguments)
            .output()
            .unwrap_or_else(|error| panic!("mbpoll: {error}: run tests/venv"));
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{said} {}", String::from_utf8_lossy(&output.stderr));
        said
    };
    // 32-bit numbers, high word first.
    let said = mbpoll(&["-a", "1", "-t", "4:int", "-B", "-r", "6", "-c", "2", "127.0.0.1"]);
    let numbers: Vec<i64> = said
        .lines()
        .filter_map(|line| line.strip_prefix('[')?.split_once("]:")?.1.trim().parse().ok())
        .collect();
    assert_eq!(numbers, [-12345, 25000], "{said}");
    mbpoll(&["-a", "2", "-t", "4", "-r", "100", "127.0.0.1", "2000", "4", "12856", "1", "77"]);
    assert_eq!(bench.commanded(Command::Amplitude), Some(2000.0 * 1e-9));
    assert!((bench.commanded(Command::Frequency).unwrap() - 27_500.0).abs() < 1e-9);
    assert_eq!(bench.commanded(Command::DriveHeartbeat), Some(77.0));
}
