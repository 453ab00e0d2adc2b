//! The dashboard, with the real program, a real Chromium, an attacker, and the client libraries of Foxglove
//! and Prometheus.
//!
//! Where only what is shown matters, the run is one in virtual time whose updates are held back to the pace of a
//! clock: no busy machine trips it. `MUPRIME_PAGES=FOLDER` keeps the pictures there;
//! `MUPRIME_DASHBOARD_SOAK_S=449` makes the soak as long as that; the run takes some eight minutes.

#[path = "dashboard/served.rs"]
mod served;
#[path = "dashboard/streams.rs"]
mod streams;

use serde_json::Value;
use served::{CLOCK, OPERATOR, Paced, SAMPLE, Served};
use std::io::Read;
use std::net::TcpStream;
use std::os::fd::AsRawFd;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;
use tests::served::resident_bytes;
use tests::{file, muprime, python, texts};

/// The default plan, with a base speed that scatters about a bound of two digits.
fn finished(out: &Path) {
    let bundled = std::fs::read_to_string(file("runs/plans/first-sweep.toml")).unwrap();
    let plan = out.with_extension("toml");
    std::fs::create_dir_all(out.parent().unwrap()).unwrap();
    std::fs::write(&plan, bundled.replace("speed_m_s = 0.02\n", "speed_m_s = 0.0125\n")).unwrap();
    let mut run = muprime();
    run.arg("run")
        .arg(&plan)
        .args(["--fast", "--seed", "3", "--operator", OPERATOR, "--sample", SAMPLE, "--out"])
        .arg(out);
    let made = run.output().unwrap();
    assert!(made.status.code().is_some_and(|code| code < 2), "{}", texts(&made).1);
}

fn browser(what: &str, pictures: &Path, served: &Served) -> Value {
    let mut look = python();
    look.arg(file("tests/peers/dashboard.py"))
        .arg(what)
        .arg(pictures)
        .arg(&served.link)
        .args(["live", "over"]);
    let output = look.output().unwrap();
    let (said, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    serde_json::from_str(&said).unwrap()
}

fn pictures(folder: &Path) -> PathBuf {
    let kept = std::env::var_os("MUPRIME_PAGES").map(PathBuf::from);
    let out = kept.unwrap_or_else(|| folder.join("pictures"));
    std::fs::create_dir_all(&out).unwrap();
    out
}

#[test]
fn every_page_in_a_real_browser() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    finished(&runs.join("over"));
    let live = Paced::start(&runs.join("live"), CLOCK);
    // A page of a run without a pass has no curves, and a quick browser is there before the first.
    live.await_passes(&runs.join("live"), 3);
    let served = Served::start(&runs, &[]);
    let seen = browser("views", &pictures(folder.path()), &served);
    assert_eq!(seen["pictures"].as_array().unwrap().len(), 30, "five pages, three widths, light and dark");
    for list in ["faults", "asked", "ran"] {
        assert_eq!(seen[list], serde_json::json!([]), "{list}");
    }
    assert!(live.passes() > 3);
}

/// What a person does with runs that are over; the record and the contract's files stay as they were.
#[test]
fn runs_are_sorted_annotated_compared_and_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    for (name, seed) in [("over", "3"), ("second", "4"), ("elsewhere", "5")] {
        let out = if name == "elsewhere" { folder.path().join(name) } else { runs.join(name) };
        let mut run = muprime();
        run.args([
            "run",
            "first-sweep",
            "--setup",
            "virtual-ideal",
            "--fast",
            "--sample",
            "pad",
            "--seed",
            seed,
            "--out",
        ]);
        let made = run.arg(&out).output().unwrap();
        assert!(made.status.code().is_some_and(|code| code < 2), "{}", texts(&made).1);
    }
    // A folder that comes from elsewhere is a run like the others.
    let copied = runs.join("copied");
    std::fs::rename(folder.path().join("elsewhere"), &copied).unwrap();
    let contract = ["points.csv", "passes.jsonl", "rig.toml", "run.toml", "summary.json", "sessions.jsonl"];
    let contents = || contract.map(|name| std::fs::read(copied.join(name)).ok());
    let before = contents();
    let served = Served::start(&runs, &[]);
    let pictures = pictures(folder.path());
    let seen = browser("work", &pictures, &served);
    for list in ["faults", "asked", "ran"] {
        assert_eq!(seen[list], serde_json::json!([]), "{list}");
    }
    assert_eq!(contents(), before);
    let notes = runs::catalogue::Annotations::read(&copied).unwrap();
    assert_eq!(notes.tags, ["dry", "tip 3"]);
    assert_eq!(notes.note, "<b onclick=x>second</b> try");
    assert_eq!(std::fs::read(pictures.join("fetched-points.csv")).ok(), before[0], "the table as it is");
    let page = std::fs::read_to_string(pictures.join("fetched-report")).unwrap();
    assert!(page.starts_with("<!doctype html>") && page.contains("run-data"));
}

/// By the keyboard: pause, go on, stop. What a session does when it is told to rest is tried elsewhere, in wall-clock time.
#[test]
fn a_browser_pauses_and_stops_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    finished(&runs.join("over"));
    let live = Paced::start(&runs.join("live"), CLOCK);
    let served = Served::start(&runs, &["--allow-control"]);
    let seen = browser("keys", &pictures(folder.path()), &served);
    assert_eq!(seen["faults"], serde_json::json!([]));
    live.passes();
    let summary = std::fs::read(runs.join("live/summary.json")).unwrap();
    let summary: Value = serde_json::from_slice(&summary).unwrap();
    assert_eq!(summary["outcome"], "stopped");
}

#[test]
fn an_attacker_gets_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let live = Paced::start(&runs.join("live"), CLOCK);
    let served = Served::start(&runs, &[]);
    let mut attack = python();
    attack.arg(file("tests/peers/attack.py")).args([&served.place, served.token(), "live"]);
    let output = attack.output().unwrap();
    let (said, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    println!("{said}");
    let said: Value = serde_json::from_str(&said).unwrap();
    assert_eq!(said["accepted"], serde_json::json!([]));
    assert!(said["open_at_once"].as_u64().unwrap() <= 64, "{said}");
    assert!(said["served_again_after_s"].as_f64().is_some_and(|s| s < 30.0), "{said}");
    assert!(said["too_many"].as_u64().unwrap() >= 40, "{said}");
    assert_eq!(live.signals.stops.load(Ordering::Relaxed), 0, "nobody may stop it");
    assert!(!live.signals.paused.load(Ordering::Relaxed), "nobody may pause it");
    assert!(live.passes() > 3, "it went on");
}

/// Leaves the other end so little room: what is not read waits there, and not in this machine's buffers.
fn with_room(stream: TcpStream, bytes: libc::c_int) -> TcpStream {
    // SAFETY: a socket that is open, and a value of the size that is said.
    let set = unsafe {
        let value = (&raw const bytes).cast();
        let size = size_of::<libc::c_int>() as libc::socklen_t;
        libc::setsockopt(stream.as_raw_fd(), libc::SOL_SOCKET, libc::SO_RCVBUF, value, size)
    };
    assert_eq!(set, 0);
    stream
}

/// What a stream told: passes, states, and whether it told the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Told {
    passes: usize,
    states: usize,
    end: bool,
}

/// Reads a stream to its end and counts its bytes in `read`. It reads at most half of what `first` has read,
/// however fast the machine is.
fn read_all(
    mut stream: TcpStream,
    read: Arc<AtomicUsize>,
    first: Option<Arc<AtomicUsize>>,
) -> JoinHandle<Told> {
    std::thread::spawn(move || {
        let (mut buffer, mut all) = (vec![0; 1 << 12], Vec::new());
        let ahead = |all: usize| first.as_ref().is_some_and(|first| all > first.load(Ordering::Relaxed) / 2);
        while let Ok(more @ 1..) = stream.read(&mut buffer) {
            all.extend_from_slice(&buffer[..more]);
            read.store(all.len(), Ordering::Relaxed);
            while ahead(all.len()) {
                std::thread::sleep(CLOCK / 10);
            }
        }
        read.store(usize::MAX, Ordering::Relaxed);
        let text = String::from_utf8_lossy(&all);
        let count = |about: &str| text.matches(&format!("{{\"about\":\"{about}\"")).count();
        Told { passes: count("pass"), states: count("state"), end: count("ended") == 1 }
    })
}

/// Six that read, a slow one and one that reads nothing: the run goes on, the server stays small, the slow one is told fewer states and no
/// fewer passes, the deaf one is disconnected, and whoever comes again sees all. Ten times as fast as a clock,
/// so that what waits is much.
#[test]
fn viewers_that_do_not_read_hold_nobody_up() {
    let seconds: u64 = std::env::var("MUPRIME_DASHBOARD_SOAK_S").map_or(20, |s| s.parse().unwrap());
    assert!((10..450).contains(&seconds), "the run is over after that");
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let live = Paced::start(&runs.join("live"), if seconds > 40 { CLOCK } else { CLOCK / 10 });
    let served = Served::start(&runs, &[]);
    let reader = |read: &Arc<AtomicUsize>| read_all(served.stream("live"), read.clone(), None);
    let reads: Vec<Arc<AtomicUsize>> = (0..8).map(|_| Arc::default()).collect();
    let readers: Vec<_> = reads[..6].iter().map(reader).collect();
    let slow = read_all(with_room(served.stream("live"), 1 << 15), reads[6].clone(), Some(reads[0].clone()));
    let mut deaf = with_room(served.stream("live"), 1);
    std::thread::sleep(Duration::from_secs(seconds / 4));
    let before = resident_bytes(served.process.id()).unwrap();
    std::thread::sleep(Duration::from_secs(seconds - seconds / 4));
    let after = resident_bytes(served.process.id()).unwrap();
    assert!(after < before + (16 << 20), "{before} bytes, then {after}");
    let again = reader(&reads[7]);
    std::thread::sleep(Duration::from_secs(2));
    let passes = live.passes();
    let told: Vec<Told> = readers.into_iter().map(|reader| reader.join().unwrap()).collect();
    let (slow, again) = (slow.join().unwrap(), again.join().unwrap());
    println!("{seconds} s: {told:?}, slowly {slow:?}, again {again:?}; {before} and {after} bytes resident");
    for one in told.iter().chain([&slow, &again]) {
        assert!(one.end && one.passes == passes, "{one:?} of {passes}");
    }
    if seconds <= 40 {
        assert!(slow.states < told[0].states, "{slow:?} and {:?}", told[0]);
        let mut held = Vec::new();
        let _ = deaf.read_to_end(&mut held);
        let held = String::from_utf8_lossy(&held).matches("\"about\"").count();
        assert!(held < told[0].states / 2, "the deaf one is disconnected: {held} messages were held for it");
    }
}
