//! ATI Digital F/T: Modbus RTU for the calibration, a stream of gages without sync bytes for the samples.

use super::lines::{axes, device, expect_forces, plant, pty, setup, standing_forces};
use drivers::InstrumentSetup;
use sim::wire::serial::SerialEmulator;
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tests::{file, python};
use wall::bench::{self, Bench, eventually, now};

/// The driver finds the sensor streaming (its last client crashed), stops it, takes over the calibration, starts the
/// stream again and works forces out by the instrument's own matrix; then an independent client does the same.
#[test]
fn gages_become_forces_by_the_instruments_own_matrix() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    standing_forces(&bench);
    let others = bench::serve_all(&bench, epoch);
    let (port, path) = pty();
    let devices = [(10, device("ati-digital-ft"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(port, devices, plant(&bench, epoch)).unwrap();
    {
        let mut crashed = serialport::new(&path, 1_250_000).timeout(Duration::from_secs(2)).open().unwrap();
        // The start frame as the public drivers print it.
        crashed.write_all(&[0x0A, 0x46, 0x55, 0xA3, 0x9D]).unwrap();
        let mut stream = [0; 5 + 13 * 20];
        crashed.read_exact(&mut stream).unwrap();
        assert_eq!(stream[..3], [0x0A, 0x46, 1]);
    }
    let mut setup = setup(others.address());
    setup.force = vec![InstrumentSetup { rate_hz: None, ..axes("ati-digital-ft", &path) }];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    // One count of a gage is 0.6 mN along x and 1.2 mN along z.
    expect_forces(&mut rig, epoch, 0.0015);
    let began = Instant::now();
    let samples = || rig.links.health().next().unwrap().1.samples;
    let before = samples();
    while began.elapsed() < Duration::from_secs(1) {
        rig.force.read(now(epoch)).lateral.unwrap();
        std::thread::sleep(Duration::from_millis(1));
    }
    // A rate is a benchmark's to show; here it must only be a stream, not polls (270 a second on this line).
    assert!(samples() - before > 1_000, "{}", samples() - before);
    drop(rig);

    let output = python().arg(file("tests/peers/ati_digital.py")).arg(&path).arg("115200").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let said: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(said["active"], said["calibration"], "the driver took the gains and offsets over: {said}");
    assert_eq!(said["locked"], 1, "and locked the registers again");
    assert_eq!((said["start"].as_str(), said["started"].as_str()), (Some("0a4655a39d"), Some("0a4601")));
    assert_eq!((said["bad_sums"].as_i64(), said["silent"].as_bool()), (Some(0), Some(true)));
    let forces: Vec<f64> = said["forces"].as_array().unwrap().iter().map(|f| f.as_f64().unwrap()).collect();
    for (found, (wanted, count)) in forces.iter().zip([
        (1.5, 1.5e-3),
        (0.0, 1.5e-3),
        (-2.25, 1.5e-3),
        (0.0, 1e-5),
        (0.0, 1e-5),
        (0.0, 1e-5),
    ]) {
        assert!((found - wanted).abs() < count, "{forces:?}");
    }
}

/// A lost byte shifts every sample behind it: the sums find the place again, and no shifted sample becomes a force.
#[test]
fn a_shifted_stream_never_becomes_a_force() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    standing_forces(&bench);
    let others = bench::serve_all(&bench, epoch);
    let (emulated, inner) = pty();
    let devices = [(10, device("ati-digital-ft"))].into_iter().collect();
    let _emulator = SerialEmulator::modbus_rtu(emulated, devices, plant(&bench, epoch)).unwrap();
    let mut inside = serialport::new(&inner, 1_250_000).timeout(Duration::from_micros(200)).open().unwrap();
    let (mut outside, path) = pty();
    outside.set_timeout(Duration::from_micros(200)).unwrap();
    // A relay that loses one byte in 5003 once the stream runs.
    let end = Arc::new(AtomicBool::new(false));
    let ended = Arc::clone(&end);
    std::thread::spawn(move || {
        let (mut buffer, mut passed) = ([0; 2048], 0_usize);
        while !ended.load(Ordering::SeqCst) {
            // A line that nobody holds open fails at once.
            let pause = |error: std::io::Error| {
                if error.kind() != std::io::ErrorKind::TimedOut {
                    std::thread::sleep(Duration::from_millis(1));
                }
            };
            match outside.read(&mut buffer) {
                Ok(count) => drop(inside.write_all(&buffer[..count])),
                Err(error) => pause(error),
            }
            if let Ok(count) = inside.read(&mut buffer) {
                let kept = |_: &&u8| {
                    passed += 1;
                    passed < 20_000 || passed % 5_003 != 0
                };
                let through: Vec<u8> = buffer[..count].iter().filter(kept).copied().collect();
                let _ = outside.write_all(&through);
            }
        }
    });
    let mut setup = setup(others.address());
    setup.force = vec![axes("ati-digital-ft", &path)];
    let mut rig = drivers::open(&setup, epoch).unwrap();
    let health = |rig: &drivers::Rig| rig.links.health().next().unwrap().1;
    let mut seen = 0;
    eventually("ten lost bytes", || {
        if let Ok(reading) = rig.force.read(now(epoch)).lateral {
            assert!((reading.value - 1.5).abs() < 0.0015, "{reading:?}");
            seen += 1;
        }
        (health(&rig).corrupt_frames >= 10).then_some(())
    });
    end.store(true, Ordering::SeqCst);
    assert!(seen > 100, "{seen}");
    assert_eq!(health(&rig).connections, 1, "{:?}", health(&rig));
}
