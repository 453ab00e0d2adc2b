//! Real `kill -9`s of a real `muprime run` over Modbus TCP, at random instants: no acknowledged pass is lost,
//! every file reads, and the amplifier's own watchdog drops the drive in time by the amplifier's own clock.
//!
//! Thirty kills by default; `MUPRIME_KILLS=1000 cargo test --release -p muprime-tests-wall --test kills -- --nocapture` makes a thousand.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use sim::wire::SharedPlant;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::world::WorldPlant;
use sim::world::{World, WorldConfig};
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tests::muprime;
use tests::served::{self, AmplifierWatch};

/// Watches the amplifier after the controller's death; the longest time, by its clock, that it was seen on
/// after the last new heartbeat, in us. `None`: it was off already.
fn alone(amplifier: &mut AmplifierWatch) -> Option<u32> {
    let began = Instant::now();
    let mut last = amplifier.read();
    let (mut fed_at, mut longest) = (last.time_us, None);
    loop {
        let state = amplifier.read();
        if state.heartbeat != last.heartbeat {
            fed_at = state.time_us;
        }
        if !state.on {
            return longest;
        }
        longest = longest.max(Some(state.time_us.wrapping_sub(fed_at)));
        last = state;
        assert!(began.elapsed() < Duration::from_secs(60), "the amplifier stays on without its controller");
    }
}

/// Points of the passes that a run's folder holds: none where it was killed before the table was begun.
fn points(run: &Path) -> Vec<u64> {
    if !run.join("points.csv").exists() {
        return Vec::new();
    }
    runs::run_dir::passes_in(run).unwrap().iter().map(|p| p.pass.point).collect()
}

#[test]
fn killed_at_any_instant_nothing_acknowledged_is_lost_and_the_drive_drops() {
    wall::outcome_alone(kills);
}

fn kills() {
    let kills: u64 =
        std::env::var("MUPRIME_KILLS").map_or(30, |n| n.parse().expect("MUPRIME_KILLS is a count"));
    let folder = tempfile::tempdir().unwrap();
    let world = World::new(&WorldConfig::ideal(), 5).unwrap();
    let plant = SharedPlant::new(WorldPlant::new(world), Instant::now());
    let devices =
        rig::emulators::emulators(&runs::setup::Setup::load("virtual").unwrap().instruments()).unwrap();
    let server = ModbusTcpServer::start("127.0.0.1:0".parse().unwrap(), devices, plant).unwrap();
    let (plan, setup_file) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
    std::fs::write(&plan, served::plan("kills", 3, &[0.5e-6, 1e-6, 2e-6, 3e-6])).unwrap();
    std::fs::write(&setup_file, served::setup("kills", server.address())).unwrap();

    let mut rng = ChaCha8Rng::seed_from_u64(20_261_121);
    let mut amplifier = AmplifierWatch::connect(server.address());
    let (mut made, mut driven, mut acknowledged_in_all, mut runs) = (0, 0, 0, 0);
    let (mut worst_us, watched) = (0, wall::Stopwatch::start());
    'runs: loop {
        runs += 1;
        let out = folder.path().join(format!("run-{runs}"));
        let mut acknowledged = BTreeSet::new();
        loop {
            let mut child = muprime()
                .args(["--json", "run"])
                .arg(&plan)
                .arg("--setup")
                .arg(&setup_file)
                .arg("--out")
                .arg(&out)
                .stdout(Stdio::piped())
                .stderr(Stdio::null())
                .spawn()
                .unwrap();
            let wait = Duration::from_micros(20_000 + rng.next_u64() % 1_400_000);
            let pipe = child.stdout.take().unwrap();
            let reader = std::thread::spawn(move || {
                BufReader::new(pipe).lines().map_while(Result::ok).collect::<Vec<_>>()
            });
            std::thread::sleep(wait);
            child.kill().unwrap();
            let on_for = alone(&mut amplifier);
            child.wait().unwrap();
            made += 1;
            if let Some(us) = on_for {
                driven += 1;
                worst_us = worst_us.max(us);
            }
            let mut over = false;
            for line in reader.join().unwrap() {
                // The last line may be cut by the kill: then it acknowledged nothing.
                let Ok(said) = serde_json::from_str::<serde_json::Value>(&line) else { continue };
                if let Some(pass) = said.get("pass") {
                    acknowledged.insert(pass["pass"]["point"].as_u64().unwrap());
                }
                over |= said["summary"]["outcome"] == "complete";
            }
            if out.exists() {
                let kept = points(&out);
                let unique: BTreeSet<u64> = kept.iter().copied().collect();
                assert_eq!(unique.len(), kept.len(), "a pass is there twice: {kept:?}");
                assert!(acknowledged.is_subset(&unique), "acknowledged {acknowledged:?}, kept {kept:?}");
                for record in runs::run_dir::records_in(&out).unwrap() {
                    let read = tests::contents::read(&std::fs::read(&record).unwrap());
                    assert_eq!(read.integrity.damaged_places, 0, "{}", record.display());
                }
            }
            if made == kills {
                acknowledged_in_all += acknowledged.len();
                break 'runs;
            }
            if over || acknowledged.len() >= 7 {
                break;
            }
        }
        acknowledged_in_all += acknowledged.len();
        std::fs::remove_dir_all(&out).unwrap();
    }
    println!(
        "{made} kills, {driven} of them with the plate driven; {acknowledged_in_all} passes acknowledged, 0 lost; \
         seen on at most {:.1} ms after the last heartbeat (timeout 50 ms)",
        f64::from(worst_us) * 1e-3
    );
    // A machine so slow that nothing is driven within 1.4 s shows nothing.
    // A state is up to 1 ms old and the world's step is 0.5 ms.
    let in_time = driven > 0 && worst_us <= 51_500;
    watched.judge(in_time, &format!("{driven} driven, seen on {worst_us} us after the last heartbeat"));
}
