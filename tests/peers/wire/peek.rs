//! `muprime doctor peek`: an instrument of other people's programs, before it has a profile.

use super::lines::{pty, socat_pair};
use std::io::Write;
use std::time::Duration;
use tests::peer::start;
use tests::{file, muprime, python, texts};

/// The documents of a peek, a line each.
fn peek(arguments: &[&str]) -> (Option<i32>, Vec<serde_json::Value>) {
    let output = muprime().args(["--json", "doctor", "peek"]).args(arguments).output().unwrap();
    let (out, err) = texts(&output);
    println!("{out}{err}");
    (output.status.code(), out.lines().map(|line| serde_json::from_str(line).unwrap()).collect())
}

/// pymodbus over TCP: the sensor's magic number in both orders, and what is beyond the last register.
#[test]
fn registers_of_pymodbus_over_tcp() {
    let recording = file("tests/recordings/rock-velocity-steps/velstep4_excerpt.txt");
    let (_server, port) =
        start(python().arg(file("tests/peers/replay_server.py")).arg(&recording).arg("200"));
    let address = format!("tcp:127.0.0.1:{port}");
    let (status, found) = peek(&[&address, "0..11"]);
    assert_eq!((status, found.len()), (Some(0), 12));
    assert_eq!(found[0]["u32"][0], 0x6D75_3246);
    assert_eq!(found[0]["u32"][1], 0x3246_6D75);
    assert_eq!(found[11]["u32"], serde_json::Value::Null, "no register follows the last one");
    // For people: the same register, 80 columns at most.
    let (out, _) = texts(&muprime().args(["doctor", "peek", &address, "0..1"]).output().unwrap());
    assert!(out.contains("0x6d75") && out.lines().all(|line| line.chars().count() <= 80), "{out}");
    let (status, found) = peek(&[&address, "10..14"]);
    assert_eq!(status, Some(2));
    assert!(found[0]["error"].as_str().unwrap().contains("it has no such register"), "{found:?}");
    let (status, found) = peek(&["tcp:127.0.0.1:1", "0..1"]);
    assert_eq!(status, Some(2));
    assert!(!found[0]["error"].as_str().unwrap().contains("os error"), "{found:?}");
}

/// pymodbus over a serial line, and a unit that it does not have: it refuses that.
#[test]
fn registers_of_pymodbus_over_a_serial_line() {
    let (_pair, ours, theirs) = socat_pair();
    let (_server, _) =
        start(python().arg(file("tests/peers/rtu_server.py")).arg(&theirs).args(["-1234", "25"]));
    let address = format!("rtu:{ours}");
    let (status, found) = peek(&[&address, "180..183", "--unit", "9"]);
    assert_eq!((status, found.len()), (Some(0), 4));
    assert_eq!((&found[0]["i16"], &found[2]["u16"]), (&(-1234).into(), &25.into()));
    let (status, found) = peek(&[&address, "180", "--unit", "44"]);
    assert_eq!(status, Some(2));
    assert!(found[0]["error"].as_str().unwrap().contains("the instrument refused"), "{found:?}");
    assert_eq!(peek(&[&address]).0, Some(2), "registers are needed");
}

/// Lines and CAN frames that come without a question; the look ends by itself and writes nothing.
#[test]
fn lines_and_frames_that_come_by_themselves() {
    let talk = |said: &'static [u8]| {
        let (mut port, path) = pty();
        std::thread::spawn(move || {
            // Nobody has opened the line yet, or has left it: then a write fails, and the next may not.
            for _ in 0..500 {
                let _ = port.write_all(said);
                std::thread::sleep(Duration::from_millis(20));
            }
        });
        path
    };
    let (status, found) = peek(&[&talk(b"+0.250 N\r\n\x00"), "--seconds", "0.5"]);
    assert_eq!(status, Some(0));
    assert!(found.iter().any(|line| line["line"].as_str().unwrap().contains("+0.250 N\\r\\n")), "{found:?}");
    let (status, found) = peek(&[&format!("slcan:{}", talk(b"t1232AABB\r")), "--seconds", "0.5"]);
    assert_eq!(status, Some(0));
    assert_eq!((&found[0]["id"], &found[0]["data"]), (&0x123.into(), &"aa bb".into()), "{found:?}");

    let server = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", server.local_addr().unwrap());
    let heard = std::thread::spawn(move || {
        let (mut client, _) = server.accept().unwrap();
        client.write_all(b"READY\r\n").unwrap();
        let mut questions = Vec::new();
        let _ = std::io::Read::read_to_end(&mut client, &mut questions);
        questions
    });
    let (status, found) = peek(&[&address, "--seconds", "0.5"]);
    assert_eq!((status, &found[0]["line"]), (Some(0), &"\"READY\\r\\n\"".into()));
    assert!(heard.join().unwrap().is_empty(), "it writes nothing");
}

/// The foreign controller of `examples/` starts a rig, reads its forces and ends it.
#[test]
fn the_example_in_python_reads_a_rig() {
    let output = python().arg(file("examples/read_rig.py")).arg(muprime().get_program()).output().unwrap();
    let (out, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    let rows: Vec<&str> =
        out.lines().filter(|line| line.starts_with("sample ") && line.ends_with(" mN")).collect();
    assert_eq!(rows.len(), 5, "{out}");
}
