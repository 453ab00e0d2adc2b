//! Five instruments that this program does not know, each a file written from `docs/profiles.md` alone (`tests/wall/own/`) against one in
//! Python that shares nothing with ours (`tests/peers/own/`): looked at by `doctor`, thirty passes of a sweep, and faults of the wire
//! while the plate is driven. `docs/own-instruments.md` holds the table of the faults.
//!
//! Every fault: `MUPRIME_OWN_CAMPAIGN=1 cargo test --release -p muprime-tests-wall --test own_instruments --
//! --nocapture`; otherwise two of each instrument.

#[path = "own/rows.rs"]
mod rows;

use realtime::safety::{Trip, TripCause};
use rows::{Fate, ROWS, Row};
use runs::{Outcome, Summary};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::time::{Duration, Instant};
use tests::served::{self, AmplifierWatch, ServedRig};
use tests::{file, muprime, python, texts};

/// The instruments, by what they are to the rig.
const FORCE: [&str; 3] = ["strain-gauge", "can-force", "board"];

/// Sweeps and faults one after the other: each wants the processors.
static ALONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

/// A process that ends with the test.
struct Peer(Child);

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// One of the five in Python, in front of a served rig.
struct Own {
    name: &'static str,
    _peer: Peer,
    _line: Option<Peer>,
    faults: ChildStdin,
    address: String,
}

impl Own {
    fn start(name: &'static str, rig: SocketAddr, folder: &Path) -> Self {
        let mut command = python();
        command.arg(file(&format!("tests/peers/own/{}.py", name.replace('-', "_"))));
        let mut line = None;
        let mut address = String::new();
        if name != "strain-gauge" {
            let ends = ["ours", "theirs"].map(|end| folder.join(format!("{name}-{end}")));
            let pty = |path: &Path| format!("pty,raw,echo=0,link={}", path.display());
            line = Some(Peer(Command::new("socat").args(ends.iter().map(|end| pty(end))).spawn().unwrap()));
            let began = Instant::now();
            while !ends.iter().all(|end| end.exists()) {
                assert!(began.elapsed().as_secs() < 10, "no line");
                std::thread::sleep(Duration::from_millis(2));
            }
            command.arg(&ends[1]);
            address = format!("{}{}", if name == "can-force" { "slcan:" } else { "" }, ends[0].display());
        }
        let mut peer =
            command.arg(rig.port().to_string()).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(peer.stdout.take().unwrap()).read_line(&mut said).unwrap();
        assert!(!said.is_empty(), "{name} ended without a word");
        if address.is_empty() {
            address = format!("127.0.0.1:{}", said.trim());
        }
        let faults = peer.stdin.take().unwrap();
        Own { name, _peer: Peer(peer), _line: line, faults, address }
    }

    fn fault(&mut self, name: &str) {
        // One that has pulled itself out hears no end of it.
        let _ = writeln!(self.faults, "{name}");
    }
}

/// A setup over a served rig in which these of the five stand, and their files beside it.
fn setup(rig: SocketAddr, own: &[&Own], folder: &Path) -> PathBuf {
    let mut text = served::setup("own", rig);
    for one in own {
        let (table, bundled) = match one.name {
            "generator" => ("[amplifier]", "muprime-amplifier"),
            "stage" => ("[stage]", "muprime-stage"),
            _ => ("[[force]]", "muprime-force2"),
        };
        let old = format!("{table}\nprofile = \"{bundled}\"\naddress = \"{rig}\"\n");
        assert!(text.contains(&old), "{text}");
        // Python on a busy machine may pause as an instrument does not: at 20 samples a second it may for 195 ms.
        let new = format!(
            "{table}\nprofile = \"{}.toml\"\naddress = \"{}\"\nrate_hz = 20\n",
            one.name, one.address
        );
        text = text.replacen(&old, &new, 1);
        for end in ["toml", "dbc"] {
            let name = format!("{}.{end}", one.name);
            if file("tests/wall/own").join(&name).exists() {
                std::fs::copy(file("tests/wall/own").join(&name), folder.join(&name)).unwrap();
            }
        }
        if one.name == "generator" {
            let relay =
                format!("[supply_relay]\nprofile = \"muprime-relay\"\naddress = \"{rig}\"\n\n[finger]");
            text = text.replacen("[finger]", &relay, 1);
        }
    }
    let path = folder.join("setup.toml");
    std::fs::write(&path, text).unwrap();
    path
}

fn serve(own: &[&str]) -> ServedRig {
    let name = if own.contains(&"generator") { "virtual-relay" } else { "virtual-ideal" };
    ServedRig::of(name, 5, None)
}

#[test]
fn each_of_the_five_is_good_to_check_and_doctor_and_makes_thirty_passes() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        // One after another: beside each other they cut each other's sweeps on two cores.
        let rigs = [&["strain-gauge", "generator", "stage"][..], &["can-force"], &["board"]];
        rigs.into_iter().for_each(thirty_passes);
    });
}

/// `check`, `doctor` and a sweep of thirty passes on a rig with these of the five.
fn thirty_passes(own: &[&'static str]) {
    let folder = tempfile::tempdir().unwrap();
    let rig = serve(own);
    let peers: Vec<Own> = own.iter().map(|name| Own::start(name, rig.address, folder.path())).collect();
    let setup = setup(rig.address, &peers.iter().collect::<Vec<_>>(), folder.path());
    for name in own {
        let checked =
            muprime().arg("check").arg(file(&format!("tests/wall/own/{name}.toml"))).output().unwrap();
        assert_eq!(checked.status.code(), Some(0), "{}", texts(&checked).1);
    }
    // What the machine holds up looks poor, and is: only beside a recorded stall is it looked at again.
    let doctor = || {
        let monitor = realtime::stall_monitor::StallMonitor::start(realtime::pacing::monotonic_ns()).unwrap();
        let seen = muprime().args(["doctor", "--instruments-only", "--setup"]).arg(&setup).output().unwrap();
        (seen, monitor.finish().count)
    };
    let excused = |(seen, stalls): &(Output, _)| seen.status.code() != Some(0) && *stalls > 0;
    let looks = std::iter::repeat_with(doctor).take(4).find(|look| !excused(look));
    let (seen, _) = looks.unwrap_or_else(doctor);
    assert_eq!(seen.status.code(), Some(0), "{own:?}: {:?}", texts(&seen));
    let amplitudes: Vec<f64> = (0..30).map(|n| 0.5e-6 + 0.1e-6 * f64::from(n)).collect();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, served::timed_plan("own", 0, &amplitudes, [0.1, 0.15])).unwrap();
    let out = folder.path().join("run");
    let output = wall::sweep_taken_up_again(&out, || {
        let mut command = muprime();
        command.arg("run").arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out);
        command
    });
    let said = texts(&output).1;
    assert!(output.status.success(), "{own:?}: {said}");
    let passes = std::fs::read_to_string(out.join("passes.jsonl")).unwrap();
    let found: Vec<(f64, f64)> = passes
        .lines()
        .filter_map(|line| {
            let pass: runs::sweep::MeasuredPass = serde_json::from_str(line).unwrap();
            Some((pass.pass.amplitude.metres(), pass.comparison?.mu_relative?))
        })
        .collect();
    assert!(passes.lines().count() >= 30 && found.len() >= 30, "{own:?}: {} passes", found.len());
    // Friction falls as the rig behind the instruments has it.
    let mean = |low: f64, high: f64| {
        let at: Vec<f64> = found.iter().filter(|(w, _)| (low..high).contains(w)).map(|(_, mu)| *mu).collect();
        at.iter().sum::<f64>() / at.len() as f64
    };
    let (weak, strong) = (mean(0.4e-6, 1.0e-6), mean(2.5e-6, 4e-6));
    assert!(weak > strong + 0.1, "{own:?}: {weak} at weak, {strong} at strong vibration");
}

/// Velocity of the virtual stage behind it all, in m/s.
fn velocity_m_s(rig: SocketAddr) -> f64 {
    let mut stream = TcpStream::connect(rig).unwrap();
    stream.write_all(&[0, 1, 0, 0, 0, 6, 3, 3, 0, 8, 0, 2]).unwrap();
    let mut answer = [0; 13];
    stream.read_exact(&mut answer).unwrap();
    f64::from(i32::from_be_bytes(answer[9..13].try_into().unwrap())) * 1e-9
}

/// What became of a fault.
struct Seen {
    trip: Option<Trip>,
    status: Option<i32>,
    /// From the strike until the output was seen off.
    off_ms: Option<f64>,
    summary: Summary,
    at_rest: bool,
}

/// Strikes while the plate is driven.
///
/// # Errors
/// A run that ended before that.
fn strike(row: &Row) -> Result<Seen, String> {
    let folder = tempfile::tempdir().unwrap();
    let rig = serve(&[row.instrument]);
    let mut own = Own::start(row.instrument, rig.address, folder.path());
    let setup = setup(rig.address, &[&own], folder.path());
    let plan = folder.path().join("plan.toml");
    // Long passes: the plate is driven nearly all the time.
    std::fs::write(&plan, served::timed_plan("faults", 0, &[2e-6, 2.5e-6, 3e-6, 3.5e-6], [0.1, 1.5]))
        .unwrap();
    let out = folder.path().join("run");
    let mut command = muprime();
    command.args(["--json", "run"]).arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out);
    let log = std::fs::File::create(folder.path().join("said")).unwrap();
    let mut controller = Peer(command.stdout(Stdio::null()).stderr(log).spawn().unwrap());
    let mut watch = AmplifierWatch::connect(rig.address);
    let (begun, mut on) = (Instant::now(), 0);
    while on < 100 {
        on = if watch.read().on { on + 1 } else { 0 };
        if controller.0.try_wait().unwrap().is_some() {
            // Nothing was done to it yet: the machine kept the emulator or the loop waiting.
            let said = std::fs::read_to_string(folder.path().join("said")).unwrap();
            return Err(format!("never driven: {said}"));
        }
        assert!(begun.elapsed().as_secs() < 30, "{row}: never driven");
        std::thread::sleep(Duration::from_millis(2));
    }
    own.fault(row.fault);
    let struck = Instant::now();
    let (mut ended, mut asked, mut off_ms) = (false, false, None);
    while controller.0.try_wait().unwrap().is_none() {
        let elapsed = struck.elapsed();
        if !watch.read().on {
            off_ms = off_ms.or(Some(elapsed.as_secs_f64() * 1e3));
        }
        if !ended && elapsed > Duration::from_millis(row.lasts_ms) {
            own.fault("");
            ended = true;
        }
        // What goes on is asked to stop, as a person would.
        if !asked
            && !matches!(row.fate, Fate::Trips(..))
            && elapsed > Duration::from_millis(row.lasts_ms + 1500)
        {
            // SAFETY: a signal to a child that has not been waited for.
            unsafe { libc::kill(controller.0.id() as i32, libc::SIGINT) };
            asked = true;
        }
        assert!(elapsed.as_secs() < 40, "{row}: it does not end");
        std::thread::sleep(Duration::from_millis(2));
    }
    let status = controller.0.wait().unwrap().code();
    assert!(!watch.read().on, "{row}: the output is on after the program has ended");
    let at_rest = velocity_m_s(rig.address).abs() < 1e-3;
    let said = std::fs::read(out.join("summary.json")).unwrap();
    let summary: Summary = serde_json::from_slice(&said).unwrap();
    let trip = match &summary.outcome {
        Outcome::Tripped(trip) => Some(*trip),
        _ => None,
    };
    Ok(Seen { trip, status, off_ms, summary, at_rest })
}

/// What is wrong with what was seen, if anything.
fn judge(row: &Row, seen: &Seen) -> Result<String, String> {
    let link = &seen.summary.links;
    let problems = || serde_json::to_string(link).unwrap();
    let counted = |counter: &str| link.get(row.instrument).and_then(|l| l[counter].as_u64()).unwrap_or(0);
    match (&row.fate, seen.trip) {
        (Fate::Trips(causes, within_ms), Some(trip)) => {
            let off_ms = seen.off_ms.unwrap_or(f64::INFINITY);
            let line = format!("{row}: {:?}, off after {off_ms:.0} ms, status {:?}", trip.cause, seen.status);
            let at_rest = seen.at_rest || row.cut_off();
            let right =
                causes.contains(&trip.cause) && off_ms <= *within_ms && seen.status == Some(1) && at_rest;
            if right { Ok(line) } else { Err(format!("{line}; at rest: {}; {}", seen.at_rest, problems())) }
        }
        (Fate::GoesOn(counter), None) if counted(counter) > 0 => Ok(format!("{row}: goes on; {counter}")),
        (Fate::Unseen(why), None) => Ok(format!("{row}: goes on unseen; {why}")),
        (_, trip) => Err(format!("{row}: {trip:?}, {:?}; {}", seen.summary.outcome, problems())),
    }
}

fn campaign(rows: impl Iterator<Item = &'static Row>) -> Vec<String> {
    let mut wrong = Vec::new();
    for row in rows {
        let mut last = String::new();
        for attempt in 1..=8 {
            let seen = match strike(row) {
                Ok(seen) => seen,
                Err(stalled) => {
                    last = format!("{row}: {stalled}");
                    continue;
                }
            };
            match judge(row, &seen) {
                Ok(line) => {
                    println!("{line}");
                    last.clear();
                    break;
                }
                Err(said) => last = said,
            }
            // Only a stall of the machine excuses: then again.
            let stalled = seen.summary.stalls.as_ref().is_some_and(|stalls| {
                seen.trip.is_some_and(|trip| {
                    let before = realtime::ports::Nanos(trip.at.0.saturating_sub(300_000_000));
                    stalls.within(before, trip.at).is_some()
                })
            });
            println!("attempt {attempt}{}: {last}", if stalled { ", the machine stalled" } else { "" });
            if !stalled {
                break;
            }
        }
        if !last.is_empty() {
            wrong.push(last);
        }
    }
    wrong
}

#[test]
fn each_fault_of_a_wire_trips_with_its_cause_and_leaves_the_drive_off() {
    wall::in_wall_clock_time(|| {
        let _alone = ALONE.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let all = std::env::var_os("MUPRIME_OWN_CAMPAIGN");
        let only = all.as_ref().and_then(|v| v.to_str()).filter(|v| *v != "1");
        let chosen = |row: &&Row| match only {
            Some(part) => row.to_string().contains(part),
            None => all.is_some() || row.always,
        };
        let wrong = campaign(ROWS.iter().filter(chosen));
        assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
    });
}

/// Twelve faults or more of each, and the page holds what this file expects.
#[test]
fn the_page_holds_the_table_of_faults() {
    let mut page = String::from(
        "| instrument | fault | lasts, ms | what follows | output off within, ms |\n|---|---|---|---|---|\n",
    );
    for row in ROWS {
        let (what, off) = match &row.fate {
            Fate::Trips(causes, ms) => {
                let names: Vec<String> = causes.iter().map(|cause| format!("{cause:?}")).collect();
                (format!("trip: {}", names.join(" or ")), format!("{ms:.0}"))
            }
            Fate::Unseen(why) => (format!("goes on unseen: {why}"), "-".into()),
            Fate::GoesOn(counter) => (format!("goes on; the link counts `{counter}`"), "-".into()),
        };
        page += &format!("| {} | {} | {} | {what} | {off} |\n", row.instrument, row.words, row.lasts_ms);
    }
    for name in ["strain-gauge", "can-force", "board", "generator", "stage"] {
        let count = ROWS.iter().filter(|row| row.instrument == name).count();
        assert!(count >= 12, "{name}: {count} faults");
    }
    let path = file("docs/own-instruments.md");
    let text = std::fs::read_to_string(&path).unwrap();
    let begin = text.find("| instrument | fault |").unwrap();
    let end = text[begin..].find("\n\n").map_or(text.len(), |at| begin + at + 1);
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&path, format!("{}{page}{}", &text[..begin], &text[end..])).unwrap();
    } else {
        assert!(text[begin..end] == page, "docs/own-instruments.md must hold this table:\n{page}");
    }
}

/// The causes that the rows name are the safety core's own; none is named in vain.
#[test]
fn silence_is_never_taken_for_a_force() {
    for row in ROWS.iter().filter(|row| row.fault == "silence" && FORCE.contains(&row.instrument)) {
        let Fate::Trips(causes, _) = &row.fate else { panic!("{row}: silence goes on") };
        assert!(
            causes.iter().all(|cause| matches!(cause, TripCause::LateralStale | TripCause::NormalStale)),
            "{row}"
        );
    }
}
