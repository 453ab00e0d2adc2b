//! Thirty minutes of wall-clock time over Modbus TCP to a rig in another process: nothing trips but for the machine, nothing grows.
//!
//! Short by default; `MUPRIME_SOAK_WIRE_S=1800 cargo test --release -p muprime-tests-wall --test soak -- --nocapture`.

use realtime::Nanos;
use runs::{Outcome, Summary};
use std::process::Stdio;
use std::time::{Duration, Instant};
use tests::muprime;
use tests::served::{self, ServedRig, resident_bytes};

const MIB: u64 = 1 << 20;

fn seconds(name: &str, short: u64) -> u64 {
    std::env::var(name).map_or(short, |s| s.parse().unwrap_or_else(|_| panic!("{name} is whole seconds")))
}

/// One session of `muprime run` against a rig in another process.
struct SessionSeen {
    lasted: Duration,
    /// Resident memory of the controller after it warmed up, and at the end, in bytes.
    warm_and_last: Option<(u64, u64)>,
    summary: Summary,
}

/// Wall-clock time, real Modbus TCP, two processes. A trip needs a stall of the machine that the monitor
/// recorded; the sweep is then taken up again, as its user would.
#[test]
fn half_an_hour_over_the_wire_without_a_trip_that_the_machine_did_not_cause() {
    wall::in_wall_clock_time(|| {
        let wanted = Duration::from_secs(seconds("MUPRIME_SOAK_WIRE_S", 12));
        // Allocators, thread stacks and the record's chunks come to rest within a minute.
        let warm_up = (wanted / 5).min(Duration::from_secs(60));
        let folder = tempfile::tempdir().unwrap();
        let rig = ServedRig::start(5, None);
        let amplitudes: Vec<f64> = (1..=10).map(|i| f64::from(i) * 0.5e-6).collect();
        let plan = served::timed_plan("soak", 4, &amplitudes, [0.2, 1.0])
            .replace("seed = 3", &format!("seed = 3\nreplicates = {}", 1 + wanted.as_secs() / 10));
        let (plan_file, setup_file) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
        std::fs::write(&plan_file, plan).unwrap();
        let setup = served::setup("soak", rig.address).replace("rate_hz = 250", "rate_hz = 1000");
        std::fs::write(&setup_file, setup).unwrap();
        let rig_warm = resident_bytes(rig.process.id()).unwrap();
        let (begun, mut sessions) = (Instant::now(), Vec::new());
        while begun.elapsed() < wanted {
            let left = wanted - begun.elapsed();
            let mut child = muprime()
                .args(["--json", "run"])
                .arg(&plan_file)
                .arg("--setup")
                .arg(&setup_file)
                .arg("--out")
                .arg(folder.path().join("run"))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            let (started, mut seen) = (Instant::now(), Vec::new());
            let status = loop {
                std::thread::sleep(Duration::from_millis(200));
                if let Some(status) = child.try_wait().unwrap() {
                    break status;
                }
                if started.elapsed() >= left {
                    // SIGINT: an orderly stop.
                    // SAFETY: a signal to a child that has not been waited for: its id is still its own.
                    unsafe { libc::kill(child.id() as i32, libc::SIGINT) };
                    break child.wait().unwrap();
                }
                seen.extend(resident_bytes(child.id()).map(|bytes| (started.elapsed(), bytes)));
            };
            let said = std::fs::read(folder.path().join("run/summary.json")).unwrap();
            let summary: Summary = serde_json::from_slice(&said).unwrap();
            let lasted = started.elapsed();
            match &summary.outcome {
                Outcome::Complete => assert_eq!(status.code(), Some(0)),
                Outcome::Stopped => assert_eq!(status.code(), Some(1)),
                Outcome::Tripped(trip) => {
                    let before = Nanos(trip.at.0.saturating_sub(300_000_000));
                    let stalls = summary.stalls.as_ref().unwrap();
                    let stall = stalls.within(before, trip.at);
                    let stall = stall.unwrap_or_else(|| panic!("{trip:?} without a recorded stall"));
                    println!(
                        "session {}: {:?} after {:.0} s, the machine stalled for {:.0} ms",
                        sessions.len() + 1,
                        trip.cause,
                        lasted.as_secs_f64(),
                        stall.lasted.seconds() * 1e3
                    );
                }
                other => panic!("{other:?}"),
            }
            // After the loop's end the report is written: its memory is not the loop's.
            let looped = Duration::from_millis(summary.loop_report.as_ref().unwrap().cycles);
            let mut steady =
                seen.iter().filter(|(at, _)| *at >= warm_up && *at <= looped).map(|(_, bytes)| *bytes);
            let warm = steady.next();
            sessions.push(SessionSeen { lasted, warm_and_last: warm.zip(steady.next_back()), summary });
        }
        let longest = sessions.iter().max_by_key(|s| s.lasted).unwrap();
        let (warm, last) = longest.warm_and_last.expect("no session was longer than its warm-up");
        let grown = last.saturating_sub(warm);
        let report = longest.summary.loop_report.as_ref().unwrap();
        let cycles: u64 =
            sessions.iter().filter_map(|s| s.summary.loop_report.as_ref()).map(|r| r.cycles).sum();
        let rig_grown = resident_bytes(rig.process.id()).unwrap().saturating_sub(rig_warm);
        println!(
            "{:.0} s over Modbus TCP, {cycles} cycles, {} session(s), {} trip(s), each with a recorded stall; the longest, {:.0} s: \
         {} passes, {} overruns, {} rows dropped, memory {:.1} MiB and {} KiB more at its end; the rig's {} KiB more since its \
         start",
            begun.elapsed().as_secs_f64(),
            sessions.len(),
            sessions.iter().filter(|s| matches!(s.summary.outcome, Outcome::Tripped(_))).count(),
            longest.lasted.as_secs_f64(),
            longest.summary.passes,
            report.overruns,
            report.ring_drops,
            warm as f64 / MIB as f64,
            grown / 1024,
            rig_grown / 1024
        );
        assert!(grown < MIB, "memory grew by {grown} bytes");
    });
}
