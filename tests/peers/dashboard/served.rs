//! A dashboard that is served, and a run whose messages come at the pace of a clock.

use rig::live::{Ended, Feed, Run};
use runs::job::{Job, Notes, Signals, Update};
use runs::{Event, Plan, Setup};
use serde_json::Value;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tests::muprime;

/// Names as an attacker, or a careless hand, writes them.
pub const OPERATOR: &str = "\"><img src=x onerror=alert(1)>";
pub const SAMPLE: &str = "</p><script>alert(document.domain)</script><svg onload=alert(2)>";

/// The pace of a clock.
pub const CLOCK: Duration = Duration::from_millis(100);

/// A `muprime dashboard` of a folder of runs.
pub struct Served {
    pub process: Child,
    pub link: String,
    pub place: String,
}

impl Served {
    pub fn start(runs: &Path, more: &[&str]) -> Self {
        let mut command = muprime();
        command.args(["--json", "dashboard", "--listen", "127.0.0.1:0", "--folder"]).arg(runs).args(more);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut said).unwrap();
        let said: Value = serde_json::from_str(&said).unwrap();
        let text = |key: &str| said[key].as_str().unwrap().to_string();
        Served { process, link: text("dashboard"), place: text("address") }
    }

    pub fn token(&self) -> &str {
        self.link.rsplit_once('=').unwrap().1
    }

    /// A live stream of a run, opened.
    pub fn stream(&self, run: &str) -> TcpStream {
        let mut stream = TcpStream::connect(&self.place).unwrap();
        let key = "dGhlIHNhbXBsZSBub25jZQ==";
        write!(
            stream,
            "GET /api/live/{run} HTTP/1.1\r\nHost: {}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: muprime, {}\r\n\r\n",
            self.place,
            self.token()
        )
        .unwrap();
        let mut head = Vec::new();
        while !head.ends_with(b"\r\n\r\n") {
            let mut byte = [0];
            stream.read_exact(&mut byte).unwrap();
            head.push(byte[0]);
        }
        assert!(head.starts_with(b"HTTP/1.1 101"), "{}", String::from_utf8_lossy(&head));
        stream
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A run in virtual time, told at the pace of a clock, until it is over or this is dropped.
pub struct Paced {
    pub signals: Signals,
    runs: Option<JoinHandle<usize>>,
}

impl Paced {
    /// With so long from one state to the next: 100 ms are the pace of a clock.
    pub fn start(out: &Path, pace: Duration) -> Self {
        let setup = Setup::load("virtual-ideal").unwrap();
        let model = Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
        let plan = Plan::load("part2-validation").unwrap();
        let job = Job {
            seed: 5,
            setup,
            plan,
            model,
            model_file: None,
            defects: None,
            out: out.to_path_buf(),
            fast: true,
            notes: Notes { operator: Some(OPERATOR.into()), sample: Some(SAMPLE.into()), ..Notes::default() },
            answers: None,
        };
        let signals = Signals::default();
        let asked = signals.clone();
        let runs = std::thread::spawn(move || {
            let planned = job.points().unwrap().len();
            let as_by_a_clock = Run { fast: false, ..Run::of(&job, planned, 0) };
            let mut feed = Feed::new(as_by_a_clock, Vec::new(), &asked);
            let summary = rig::wall_clock_run::run(job, &asked, &mut |update| {
                feed.update(&update);
                if matches!(update, Update::State(_)) {
                    std::thread::sleep(pace);
                }
                let waits = || asked.paused.load(Ordering::Relaxed);
                if matches!(update, Update::Pass(_)) && waits() {
                    feed.update(&Update::Event(&Event::Paused { point: 0 }));
                    while waits() && asked.stops.load(Ordering::Relaxed) == 0 {
                        std::thread::sleep(Duration::from_millis(20));
                    }
                    feed.update(&Update::Event(&Event::Resumed));
                }
            });
            feed.end(Ended::of(&summary));
            summary.unwrap().passes
        });
        let began = Instant::now();
        while rig::live::Viewer::connect(out).is_err() {
            assert!(began.elapsed().as_secs() < 60 && !runs.is_finished(), "it is never told");
            std::thread::sleep(Duration::from_millis(20));
        }
        Paced { signals, runs: Some(runs) }
    }

    /// Waits until so many passes are on disk.
    pub fn await_passes(&self, out: &Path, least: usize) {
        let began = Instant::now();
        let made =
            || std::fs::read_to_string(out.join("passes.jsonl")).map_or(0, |text| text.lines().count());
        while made() < least {
            assert!(began.elapsed().as_secs() < 300, "no {least} passes after five minutes");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    pub fn passes(mut self) -> usize {
        self.signals.stops.store(1, Ordering::Relaxed);
        self.runs.take().unwrap().join().unwrap()
    }
}
