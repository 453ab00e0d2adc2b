//! Clients that hold a dashboard's places without reading answers or ending requests are disconnected.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use tests::muprime;

struct Served {
    process: Child,
    place: String,
    token: String,
}

impl Served {
    fn start(runs: &Path) -> Self {
        let mut command = muprime();
        command.args(["--json", "dashboard", "--listen", "127.0.0.1:0", "--folder"]).arg(runs);
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut said).unwrap();
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        let text = |key: &str| said[key].as_str().unwrap().to_string();
        let token = text("dashboard").rsplit_once('=').unwrap().1.to_string();
        Served { process, place: text("address"), token }
    }

    /// Whether somebody new is answered.
    fn answers(&self) -> bool {
        let Ok(mut stream) = TcpStream::connect(&self.place) else { return false };
        let _ = stream.set_read_timeout(Some(Duration::from_secs(10)));
        let asked = write!(stream, "GET / HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.place);
        let mut answer = String::new();
        asked.is_ok() && stream.read_to_string(&mut answer).is_ok() && answer.starts_with("HTTP/1.1 200")
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// All places are held by clients that ask for a script again and again and read nothing: somebody new is served again.
#[test]
fn clients_that_read_nothing_are_let_go() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path());
    assert!(served.answers());
    let ask = format!("GET /uplot.js HTTP/1.1\r\nHost: {}\r\n\r\n", served.place).repeat(100);
    let held: Vec<_> = (0..64)
        .map(|_| {
            let mut stream = TcpStream::connect(&served.place).unwrap();
            stream.write_all(ask.as_bytes()).unwrap();
            stream
        })
        .collect();
    let began = Instant::now();
    while !served.answers() {
        assert!(began.elapsed() < Duration::from_secs(120), "64 clients that read nothing hold it");
        std::thread::sleep(Duration::from_millis(200));
    }
    drop(held);
}

/// A body that never ends is answered as such, or its connection is closed: with the token too.
#[test]
fn a_body_that_never_ends_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let served = Served::start(folder.path());
    let mut stream = TcpStream::connect(&served.place).unwrap();
    let (place, token) = (&served.place, &served.token);
    write!(
        stream,
        "POST /api/runs/x/ask HTTP/1.1\r\nHost: {place}\r\nAuthorization: Bearer {token}\r\n\
         Content-Type: application/json\r\nContent-Length: 200\r\n\r\n"
    )
    .unwrap();
    let mut answers = stream.try_clone().unwrap();
    let (done, over) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let mut answer = Vec::new();
        let _ = answers.read_to_end(&mut answer);
        let _ = done.send(String::from_utf8_lossy(&answer).into_owned());
    });
    // A byte at a time, so that something always comes.
    for _ in 0..199 {
        let _ = stream.write_all(b" ");
        if let Ok(answer) = over.recv_timeout(Duration::from_millis(300)) {
            assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 408"), "{answer}");
            return;
        }
    }
    panic!("a body that takes a minute is waited for");
}
