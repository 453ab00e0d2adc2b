//! Who answers in a run's place: another user's process is not believed, and a stop counts as done only where the run shows it.

use std::os::linux::net::SocketAddrExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};
use tests::{muprime, python, unhurried};

/// Where viewers look for a run.
fn name_of(out: &Path) -> String {
    let name = calibration::certificate::sha256_hex(out.as_os_str().as_encoded_bytes());
    format!("muprime-run-{}", &name[..32])
}

struct Run(Child);

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A run of minutes on the virtual rig, once it holds its folder.
fn begun(folder: &Path, out: &Path) -> Run {
    let plan = folder.join("plan.toml");
    std::fs::write(&plan, tests::served::timed_plan("long", 0, &tests::served::some::<20>(), [0.1, 4.0]))
        .unwrap();
    let mut run = muprime();
    run.arg("run").arg(&plan).args(["--setup", &unhurried("virtual-ideal", folder), "--out"]).arg(out);
    let run = Run(run.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    until("the run begins", || out.join("sessions.jsonl").exists());
    run
}

fn until(what: &str, mut done: impl FnMut() -> bool) {
    let began = Instant::now();
    while !done() {
        assert!(began.elapsed() < Duration::from_secs(60), "{what}: never");
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Somebody has taken the place where the run tells, says nothing and does nothing. A stop is then sent to
/// the process that leads the run, and is answered when that shows it.
#[test]
fn a_stop_that_nobody_heard_goes_to_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().canonicalize().unwrap().join("run");
    let _impostor = UnixListener::bind_addr(&SocketAddr::from_abstract_name(name_of(&out)).unwrap()).unwrap();
    let mut run = begun(folder.path(), &out);
    let answer = rig::live::stop(&out).unwrap();
    assert!(answer.contains("SIGINT"), "{answer}");
    assert!(!runs::run_dir::is_held(&out), "answered as done while the run went on");
    until("it ends", || run.0.try_wait().unwrap().is_some());
    assert!(rig::live::stop(&out).is_err(), "nothing is stopped twice");
}

#[test]
fn a_stop_by_the_feed_is_answered_when_the_run_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().canonicalize().unwrap().join("run");
    let mut run = begun(folder.path(), &out);
    until("it tells", || rig::live::Viewer::connect(&out).is_ok());
    rig::live::stop(&out).unwrap();
    until("it ends", || run.0.try_wait().unwrap().is_some());
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    assert!(summary.contains("\"stopped\"") || summary.contains("\"tripped\""), "{summary}");
}

/// Another user's process in the place of the run: not believed, whatever it tells. Only root can play
/// another user; anybody else shows here that a process of their own is believed.
#[test]
fn another_users_process_is_no_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().canonicalize().unwrap();
    // SAFETY: asks for a number.
    let root = unsafe { libc::geteuid() } == 0;
    // The interpreter of the peers may stand where another user cannot go.
    let mut impostor = if root { std::process::Command::new("/usr/bin/python3") } else { python() };
    let script = "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.bind('\\0' + sys.argv[1])\ns.listen()\n\
                  held = []\nprint('up', flush=True)\nwhile True: held.append(s.accept())";
    impostor.args(["-c", script, &name_of(&out)]).stdout(Stdio::piped());
    if root {
        std::os::unix::process::CommandExt::uid(&mut impostor, 65534);
    }
    let mut impostor = Run(impostor.spawn().unwrap());
    let mut up = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(impostor.0.stdout.take().unwrap()), &mut up)
        .unwrap();
    assert_eq!(up, "up\n");
    match rig::live::Viewer::connect(&out) {
        Err(why) => assert!(root && why.to_string().contains("another user"), "{why}"),
        Ok(_) => assert!(!root, "another user's process was believed"),
    }
}
