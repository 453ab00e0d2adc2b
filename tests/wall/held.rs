//! The held clock of a virtual rig: a run outlives a computer that pauses, and no instrument can have it.

use realtime::Clock;
use sim::wire::SharedPlant;
use sim::wire::world::WorldPlant;
use sim::world::{World, WorldConfig};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tests::{muprime, served, texts};

fn summary(run: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(run.join("summary.json")).unwrap()).unwrap()
}

/// Stopped in the middle of a pass for much longer than any rule allows (SR-31: fifty periods), again and
/// again.
#[test]
fn a_run_whose_process_is_stopped_ends_with_every_pass() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (folder.path().join("plan.toml"), folder.path().join("run"));
    std::fs::write(&plan, served::plan("held", 6, &[1e-6, 2e-6, 3e-6, 4e-6, 1.5e-6, 2.5e-6])).unwrap();
    let mut run = muprime();
    run.args(["--json", "run", "--setup", "virtual-ideal"]).arg(&plan).arg("--out").arg(&out);
    let mut run = run.stdout(Stdio::piped()).spawn().unwrap();
    let mut news = BufReader::new(run.stdout.take().unwrap()).lines().map_while(Result::ok);
    assert!(news.any(|line| line.contains("\"pass\"")), "no pass");
    let reading = std::thread::spawn(move || news.count());
    let pid = run.id() as libc::pid_t;
    let mut stopped = Duration::ZERO;
    for _ in 0..4 {
        // SAFETY: a signal to a child that was not waited for yet.
        unsafe { libc::kill(pid, libc::SIGSTOP) };
        let began = Instant::now();
        std::thread::sleep(Duration::from_millis(400));
        let lasted = began.elapsed();
        // SAFETY: as above.
        unsafe { libc::kill(pid, libc::SIGCONT) };
        std::thread::sleep(Duration::from_millis(60));
        if run.try_wait().unwrap().is_none() {
            stopped += lasted;
        }
    }
    assert_eq!(run.wait().unwrap().code(), Some(0), "a trip, or not every pass");
    reading.join().unwrap();
    let summary = summary(&out);
    assert_eq!((&summary["outcome"], &summary["passes"]), (&"complete".into(), &summary["planned"]));
    let seconds = summary["held"]["seconds"].as_f64().unwrap();
    assert!(seconds >= 0.9 * stopped.as_secs_f64(), "{seconds} s of {stopped:?}");
    assert!((0.0..1.0).contains(&summary["held"]["share"].as_f64().unwrap()));
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.contains("The clock of the virtual rig was held back for"), "the report says so");
}

/// The rig of `muprime virtual-rig` is an instrument to a run, on loopback and on this machine too: however
/// its run ends, nothing is held.
#[test]
fn a_rig_in_another_process_is_never_held() {
    let folder = tempfile::tempdir().unwrap();
    let rig = served::ServedRig::start(1, None);
    let [setup, plan, out] = ["rig.toml", "plan.toml", "run"].map(|name| folder.path().join(name));
    std::fs::write(&setup, served::setup("elsewhere", rig.address)).unwrap();
    std::fs::write(&plan, served::plan("held", 2, &[2e-6])).unwrap();
    let mut run = muprime();
    run.args(["run", "--setup"]).arg(&setup).arg(&plan).arg("--out").arg(&out);
    let said = texts(&run.output().unwrap());
    let summary = summary(&out);
    assert!(summary["stalls"].is_object() && summary.get("held").is_none(), "{said:?} {summary}");
}

/// The same within a process: one instrument that another emulator serves, and the clock of the whole rig
/// runs.
#[test]
fn one_foreign_instrument_lets_the_clock_of_the_whole_rig_run() {
    let world = || WorldPlant::new(World::new(&WorldConfig::ideal(), 1).unwrap());
    let setup = runs::setup::Setup::load("virtual-ideal").unwrap();
    let (mut own, mut foreign) = (setup.instruments(), setup.instruments());
    let epoch = Instant::now();
    let clock = Clock::holdable(epoch);
    let _emulators =
        rig::emulators::serve(&mut own, &SharedPlant::new(world(), clock.clone()), false).unwrap();
    let _elsewhere = rig::emulators::serve(&mut foreign, &SharedPlant::new(world(), epoch), false).unwrap();
    let rig = wall::bench::opened(&own, clock.clone());
    assert!(rig.links.clock().held_back().is_some(), "all its instruments are served here");
    drop(rig);
    own.stage.address = foreign.stage.address;
    // On a busy machine it may not open in time: nothing waits for it any more.
    let _ = drivers::open(&own, clock.clone());
    assert!(clock.held_back().is_none(), "one of them is not");
}
