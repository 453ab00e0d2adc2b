//! Publishing by MQTT against mosquitto: what is told, and that a broker which is slow, dead or killed changes nothing of a run.

use serde_json::Value;
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tests::{muprime, texts};
use wall::sweep_unless_the_machine_stalls;

/// A program that ends with the test.
struct Peer(Child);

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
}

/// Debian's mosquitto; `tests/venv` installs it.
fn mosquitto(folder: &Path) -> (Peer, u16) {
    let port = free_port();
    let config = folder.join("mosquitto.conf");
    std::fs::write(&config, format!("listener {port} 127.0.0.1\nallow_anonymous true\n")).unwrap();
    let path = format!("{}:/usr/sbin", std::env::var("PATH").unwrap_or_default());
    let started = Command::new("mosquitto")
        .env("PATH", path)
        .arg("-c")
        .arg(&config)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let broker = Peer(started.unwrap_or_else(|e| panic!("mosquitto: {e}; run tests/venv")));
    let began = Instant::now();
    while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
        assert!(began.elapsed() < Duration::from_secs(10), "mosquitto does not listen");
        std::thread::sleep(Duration::from_millis(20));
    }
    (broker, port)
}

type Received = Arc<Mutex<Vec<(String, Value)>>>;

/// mosquitto's own client, which hears everything.
fn listener(port: u16) -> (Peer, Received) {
    let mut child = Command::new("mosquitto_sub")
        .args(["-h", "127.0.0.1", "-p", &port.to_string(), "-t", "#", "-v", "-q", "1"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let heard = Received::default();
    let kept = Arc::clone(&heard);
    std::thread::spawn(move || {
        for line in lines.map_while(Result::ok) {
            let (topic, message) = line.split_once(' ').expect("a topic and a message");
            kept.lock().unwrap().push((topic.into(), serde_json::from_str(message).expect("JSON")));
        }
    });
    std::thread::sleep(Duration::from_millis(300));
    (Peer(child), heard)
}

const PLAN: &str = "name = \"told\"\nseed = 3\nreference_every = 4\n[pass]\nsettle_s = 0.1\nmeasure_s = 0.15\napproach_speed_m_s = 0.2\n\
    [base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.05\nnormal_force_n = 0.25\n\
    [[series]]\nname = \"a\"\namplitude_pp_m = [0.6e-6, 1.2e-6, 2.5e-6]\n";

fn run(folder: &Path, out: &Path, broker: Option<&str>, fast: bool) -> Command {
    std::fs::write(folder.join("plan.toml"), PLAN).unwrap();
    let mut command = muprime();
    let setup = tests::unhurried("virtual-ideal", folder);
    command.arg("run").arg(folder.join("plan.toml")).args(["--setup", &setup, "--out"]).arg(out);
    command.env("MUPRIME_RUNS", folder);
    if fast {
        command.arg("--fast");
    }
    if let Some(broker) = broker {
        command.args(["--publish", broker]);
    }
    command
}

#[test]
fn a_run_is_told_to_the_laboratory() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let (_broker, port) = mosquitto(folder.path());
        let (_listener, heard) = listener(port);
        let address = format!("mqtt://127.0.0.1:{port}/lab/rig-1");
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| {
            heard.lock().unwrap().clear();
            run(folder.path(), out, Some(&address), false)
        });
        assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
        assert!(!texts(&output).1.contains("messages were not"), "{}", texts(&output).1);
        std::thread::sleep(Duration::from_millis(500));
        let all = heard.lock().unwrap().clone();
        let mut by_topic: BTreeMap<&str, Vec<&Value>> = BTreeMap::new();
        for (topic, message) in &all {
            by_topic.entry(topic.strip_prefix("lab/rig-1/").expect("the prefix")).or_default().push(message);
        }
        let passes = models::pass::read_passes(&std::fs::read(out.join("points.csv")).unwrap()[..]).unwrap();
        let told: Vec<u64> = by_topic["pass"].iter().map(|p| p["pass"]["point"].as_u64().unwrap()).collect();
        let made: Vec<u64> = passes.iter().map(|p| p.point).collect();
        assert_eq!(told, made, "every pass once, in order");
        let last = by_topic["progress"].last().unwrap();
        assert_eq!(
            (last["made"].as_u64(), last["planned"].as_u64()),
            (Some(made.len() as u64), Some(made.len() as u64))
        );
        assert_eq!(by_topic["run"][0]["state"], "running");
        assert_eq!(by_topic["run"].last().unwrap()["state"], "ended");
        let states = &by_topic["state"];
        assert!(states.len() > 20, "{} states", states.len());
        let driven = states.iter().filter(|s| s["output_on"] == true && s["armed"] == true).count();
        let told = states
            .iter()
            .filter(|s| s["mu_relative"].is_f64() && s["z"].is_f64() && s["residual"].is_f64())
            .count();
        assert!(driven > 5 && told > 3, "{driven} driven, {told} compared");
        assert!(states.iter().all(|s| s["normal_force_n"].is_f64() && s["position_m"].is_f64()));
        // Whoever comes later hears at once how it ended.
        let (_late, late) = listener(port);
        std::thread::sleep(Duration::from_millis(500));
        let late = late.lock().unwrap();
        assert!(late.iter().any(|(topic, m)| topic == "lab/rig-1/run" && m["state"] == "ended"), "{late:?}");
    });
}

/// Nobody there, somebody who accepts and says nothing, and a broker: the same bytes, and no time lost.
#[test]
fn a_dead_broker_changes_nothing() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let silent = TcpListener::bind("127.0.0.1:0").unwrap();
        let brokers = [
            None,
            Some(format!("mqtt://127.0.0.1:{}/x", free_port())),
            Some(format!("mqtt://127.0.0.1:{}/x", silent.local_addr().unwrap().port())),
            Some("mqtt://no-such-host.invalid/x".into()),
        ];
        let mut tables = Vec::new();
        for (i, broker) in brokers.iter().enumerate() {
            let out = folder.path().join(format!("run-{i}"));
            let began = Instant::now();
            let output = run(folder.path(), &out, broker.as_deref(), true).output().unwrap();
            assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
            assert!(began.elapsed() < Duration::from_secs(20), "{broker:?}");
            let said = texts(&output).1.split_whitespace().collect::<Vec<_>>().join(" ");
            assert_eq!(broker.is_some(), said.contains("the broker never answered: none of"), "{said}");
            assert!(!said.contains(" 0 messages"), "{said}");
            tables.push(std::fs::read(out.join("points.csv")).unwrap());
        }
        assert!(tables.iter().all(|table| *table == tables[0]));
    });
}

/// The broker is killed in the middle of a sweep in wall-clock time: the sweep goes on to its end.
#[test]
fn a_broker_that_is_killed_stops_no_run() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let (broker, port) = mosquitto(folder.path());
        let broker = Arc::new(Mutex::new(Some(broker)));
        let (_listener, heard) = listener(port);
        let address = format!("mqtt://127.0.0.1:{port}/x");
        let (killer, seen) = (Arc::clone(&broker), Arc::clone(&heard));
        let killing = std::thread::spawn(move || {
            let began = Instant::now();
            while !seen.lock().unwrap().iter().any(|(topic, _)| topic == "x/pass") {
                assert!(began.elapsed() < Duration::from_secs(120), "no pass was told");
                std::thread::sleep(Duration::from_millis(5));
            }
            drop(killer.lock().unwrap().take());
        });
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| {
            run(folder.path(), out, Some(&address), false)
        });
        killing.join().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
        let told = heard.lock().unwrap().iter().filter(|(topic, _)| topic == "x/pass").count();
        let passes = models::pass::read_passes(&std::fs::read(out.join("points.csv")).unwrap()[..]).unwrap();
        assert!(
            told >= 1 && told < passes.len(),
            "{told} of {} were told before it was killed",
            passes.len()
        );
    });
}

#[test]
fn what_is_no_broker_is_refused() {
    for wrong in ["127.0.0.1", "mqtt://x:y/z", "mqtt://ann:secret@host/x"] {
        let output = muprime().args(["run", "--fast", "--publish", wrong]).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{wrong}");
    }
}
