//! Listeners that take nothing: a terminal that stands still, a pipe that is full or closed, viewers that are
//! slow or deaf, a broker that is silent, and a disk that is slow. A sweep is kept whole, is read back off
//! and ends all the same; and what a person must know goes every way.

use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::served::{self, AmplifierWatch, ServedRig};
use tests::{muprime, rounds, unhurried};
use wall::{Stopwatch, cut_by_a_stall, unless_the_machine_stalls, wait_until};

/// No sweep here takes a tenth of it: one that still runs then waits for somebody.
const WAITS_FOR_EVER: Duration = Duration::from_secs(90);

/// A sweep with any two listeners: alone it takes 4 s, and each listener has one bound of some seconds for everything.
const NO_LONGER: Duration = Duration::from_secs(25);

const PLAN: &str = "name = \"told\"\nseed = 3\nreference_every = 4\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.1\napproach_speed_m_s = 0.2\n\
    [base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.05\nnormal_force_n = 0.25\n\
    [[series]]\nname = \"a\"\namplitude_pp_m = [0.6e-6, 0.9e-6, 1.2e-6, 1.8e-6, 2.5e-6]\n";

/// A terminal that takes what fits into it and is never read; stopped as by Ctrl-S where `stopped`.
fn terminal(stopped: bool) -> (OwnedFd, File) {
    let (mut near, mut far) = (0, 0);
    // SAFETY: both places are integers that live through the call, and the other arguments may be null.
    let opened = unsafe {
        libc::openpty(&mut near, &mut far, std::ptr::null_mut(), std::ptr::null(), std::ptr::null())
    };
    assert_eq!(opened, 0, "no pseudo-terminal");
    // SAFETY: both were opened just now, and nobody else has them.
    let (near, far) = unsafe { (OwnedFd::from_raw_fd(near), File::from_raw_fd(far)) };
    if stopped {
        // SAFETY: a terminal that is open.
        assert_eq!(unsafe { libc::tcflow(far.as_raw_fd(), libc::TCOOFF) }, 0);
    } else {
        fill(&far);
    }
    (near, far)
}

/// A pipe whose reader takes nothing.
fn full_pipe() -> (OwnedFd, File) {
    let (reader, writer) = std::io::pipe().unwrap();
    let writer = File::from(OwnedFd::from(writer));
    fill(&writer);
    (reader.into(), writer)
}

/// Writes until nothing more is taken.
fn fill(mut to: &File) {
    let set = |flags: libc::c_int| {
        // SAFETY: a descriptor that is open, and flags of it.
        assert_eq!(unsafe { libc::fcntl(to.as_raw_fd(), libc::F_SETFL, flags) }, 0);
    };
    set(libc::O_RDWR | libc::O_NONBLOCK);
    while to.write(&[b'x'; 64]).is_ok() {}
    set(libc::O_RDWR);
}

fn closed_pipe() -> Stdio {
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    writer.into()
}

/// A sweep on the virtual rig, in wall-clock time.
fn sweep(folder: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = muprime();
    arguments(&mut command, folder, out, more);
    command
}

/// The same on a disk that takes 50 ms to confirm that bytes are safe: `strace` delays the two calls, and
/// stops no thread that makes neither.
fn sweep_on_a_slow_disk(folder: &Path, out: &Path, more: &[&str]) -> Command {
    let mut command = Command::new("strace");
    command.args(["-f", "--seccomp-bpf", "-qq", "-o"]).arg(out.with_extension("strace"));
    command.args(["-e", "trace=fsync,fdatasync", "-e", "inject=fsync,fdatasync:delay_enter=50000"]);
    command.arg(muprime().get_program());
    arguments(&mut command, folder, out, more);
    command
}

fn arguments(command: &mut Command, folder: &Path, out: &Path, more: &[&str]) {
    std::fs::write(folder.join("plan.toml"), PLAN).unwrap();
    command.args(more).arg("run").arg(folder.join("plan.toml"));
    command
        .args(["--setup", &unhurried("virtual-ideal", folder), "--out"])
        .arg(out)
        .env("MUPRIME_RUNS", folder);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
}

/// Waits for the end of a program, which waits for nobody.
fn ended(child: &mut Child, what: &str) -> Option<i32> {
    let began = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status.code();
        }
        if began.elapsed() > WAITS_FOR_EVER {
            let _ = child.kill();
            panic!("{what}: it waits for somebody who takes nothing");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// Every pass of the plan is kept, in table, journal and record, and the rig was read back off.
fn is_whole(out: &Path, what: &str) {
    let passes = models::pass::read_passes(&std::fs::read(out.join("points.csv")).unwrap()[..]).unwrap();
    let summary: serde_json::Value =
        serde_json::from_slice(&std::fs::read(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!(summary["outcome"], "complete", "{what}: {summary}");
    assert_eq!(summary["off"]["read_back"], true, "{what}");
    assert_eq!(summary["planned"].as_u64(), Some(passes.len() as u64), "{what}");
    let record = tests::contents::read(&std::fs::read(out.join("run-1.mcap")).unwrap());
    assert!(tests::contents::complete(&record.integrity), "{what}: {:?}", record.integrity);
    assert_eq!(record.passes().count(), passes.len(), "{what}: passes made and kept");
    assert!(out.join("report.html").exists(), "{what}");
}

/// One sweep with listeners of a kind, which `begin` starts; tried again where a stall of the machine cut it.
/// How long it took.
fn keeps_all(what: &str, begin: impl Fn(&Path, &Path) -> (Child, Box<dyn std::any::Any>)) -> Duration {
    let folder = tempfile::tempdir().unwrap();
    let took = std::cell::Cell::new(Duration::ZERO);
    unless_the_machine_stalls(|n| {
        let out = folder.path().join(format!("run-{n}"));
        let began = Instant::now();
        let (mut child, listeners) = begin(folder.path(), &out);
        let status = ended(&mut child, what);
        took.set(began.elapsed());
        drop(listeners);
        if status == Some(1) && cut_by_a_stall(&out).is_some() {
            return Some(out);
        }
        assert_eq!(status, Some(0), "{what}");
        is_whole(&out, what);
        None
    });
    took.get()
}

/// Who listens to a run, or keeps it, and takes nothing or little.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Listener {
    StoppedTerminal,
    FullPipe,
    ClosedPipe,
    SlowViewer,
    DeafViewer,
    SilentBroker,
    SlowDisk,
}

impl Listener {
    const ALL: [Listener; 7] = [
        Listener::StoppedTerminal,
        Listener::FullPipe,
        Listener::ClosedPipe,
        Listener::SlowViewer,
        Listener::DeafViewer,
        Listener::SilentBroker,
        Listener::SlowDisk,
    ];

    /// The stream that it is the other end of, with what holds that end open; `None` for one that is no
    /// stream.
    fn stream(self) -> Option<(Stdio, Box<dyn std::any::Any>)> {
        match self {
            Listener::StoppedTerminal => {
                let (near, far) = terminal(true);
                Some((far.try_clone().unwrap().into(), Box::new((near, far))))
            }
            Listener::FullPipe => {
                let (reader, writer) = full_pipe();
                Some((writer.into(), Box::new(reader)))
            }
            Listener::ClosedPipe => Some((closed_pipe(), Box::new(()))),
            _ => None,
        }
    }
}

/// A sweep with two listeners: streams are its standard error, and as documents its standard output.
fn with_both(pair: [Listener; 2], folder: &Path, out: &Path) -> (Child, Box<dyn std::any::Any>) {
    let folder = folder.canonicalize().unwrap();
    let out = folder.join(out.file_name().unwrap());
    let mut held: Vec<Box<dyn std::any::Any>> = Vec::new();
    let (mut more, mut streams) = (vec!["--json".to_string()], Vec::new());
    for listener in pair {
        streams.extend(listener.stream());
        match listener {
            Listener::SlowViewer => held.push(Box::new(viewer(out.clone(), 60))),
            Listener::DeafViewer => held.push(Box::new(viewer(out.clone(), 0))),
            Listener::SilentBroker if more.len() == 1 => {
                let silent = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
                let broker = format!("mqtt://{}/x", silent.local_addr().unwrap());
                more.extend(["--publish".to_string(), broker]);
                held.push(Box::new(silent));
            }
            _ => {}
        }
    }
    // `--json` belongs before the verb, what is published after it.
    let (before, after) = more.split_at(1);
    let before: Vec<&str> = before.iter().map(String::as_str).collect();
    let make = if pair.contains(&Listener::SlowDisk) { sweep_on_a_slow_disk } else { sweep };
    let mut command = make(&folder, &out, &before);
    command.args(after);
    let mut streams = streams.into_iter();
    if let Some((stream, end)) = streams.next() {
        command.stderr(stream);
        held.push(end);
    }
    if let Some((stream, end)) = streams.next() {
        command.stdout(stream);
        held.push(end);
    }
    (command.spawn().unwrap(), Box::new(held))
}

/// Each listener beside each, and beside another of its own kind: every pass made is kept, the rig is read
/// back off, and the sweep ends as one without listeners does. By default each listener in two pairs.
#[test]
fn each_listener_beside_each_holds_up_nothing() {
    wall::in_wall_clock_time(|| {
        let all = Listener::ALL;
        let each: Vec<_> =
            (0..all.len()).flat_map(|i| (i..all.len()).map(move |j| [all[i], all[j]])).collect();
        let few = (0..all.len()).map(|i| [all[i], all[(i + 3) % all.len()]]).collect();
        let pairs = rounds(few, each);
        let mut slowest = Duration::ZERO;
        for &pair in &pairs {
            let what = format!("{pair:?}");
            let watch = Stopwatch::start();
            let took = keeps_all(&what, |folder, out| with_both(pair, folder, out));
            watch.judge(took < NO_LONGER, &format!("{what}: ended after {took:.1?}"));
            println!("{what}: ended after {:.1} s", took.as_secs_f64());
            slowest = slowest.max(took);
        }
        println!(
            "{} pairs, passes made = passes kept, off read back in all; slowest {slowest:.1?}",
            pairs.len()
        );
    });
}

/// A terminal that nobody reads, and the picture on one that is stopped.
#[test]
fn a_terminal_that_takes_nothing_holds_up_nothing() {
    wall::in_wall_clock_time(|| {
        for (what, stopped, more) in [
            ("a terminal that is not read", false, None),
            ("a stopped terminal under a picture", true, Some("--tui")),
        ] {
            keeps_all(what, |folder, out| {
                let (near, far) = terminal(stopped);
                let ends = || Stdio::from(far.try_clone().unwrap());
                let child = sweep(folder, out, &[]).args(more).stdout(ends()).stderr(ends()).spawn().unwrap();
                (child, Box::new((near, far)))
            });
        }
    });
}

/// What a reader did not take stands in the run's folder, with how much it is.
#[test]
fn what_nobody_read_is_in_the_folder() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run");
        let (_reader, writer) = full_pipe();
        let mut child = sweep(folder.path(), &out, &[]).stderr(writer).spawn().unwrap();
        ended(&mut child, "a full pipe");
        let unread = std::fs::read_to_string(out.join("unread.txt")).unwrap();
        assert!(unread.starts_with("standard error: ") && unread.contains("lines were not read"), "{unread}");
        assert!(unread.contains("wall-clock time, into"), "{unread}");
    });
}

/// A look at a run that reads so many bytes, so often; nothing at all for 0.
fn viewer(out: PathBuf, bytes: usize) -> std::thread::JoinHandle<()> {
    std::thread::spawn(move || {
        let began = Instant::now();
        let name = {
            use std::os::linux::net::SocketAddrExt;
            let whole = std::path::absolute(&out).unwrap();
            let name = calibration::certificate::sha256_hex(whole.as_os_str().as_encoded_bytes());
            std::os::unix::net::SocketAddr::from_abstract_name(format!("muprime-run-{}", &name[..32]))
                .unwrap()
        };
        let mut stream = loop {
            match std::os::unix::net::UnixStream::connect_addr(&name) {
                Ok(stream) => break stream,
                Err(_) if began.elapsed() < WAITS_FOR_EVER => std::thread::sleep(Duration::from_millis(20)),
                Err(_) => return,
            }
        };
        let mut buffer = vec![0; bytes.max(1)];
        while bytes == 0 || stream.read(&mut buffer).is_ok_and(|count| count > 0) {
            std::thread::sleep(Duration::from_millis(100));
            if began.elapsed() > WAITS_FOR_EVER {
                return;
            }
            if bytes == 0 && !out.exists() {
                return;
            }
        }
    })
}

/// An amplifier that stays on: said on standard error, as a document, and to whoever watches, before the end
/// of the run is, while a terminal that takes nothing hears of it too.
#[test]
fn a_drive_that_is_not_read_back_off_is_said_first_and_every_way() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let defects = folder.path().join("refuses.toml");
        std::fs::write(&defects, "[[defect]]\nname = \"amplifier_refuses_off\"\nseed = 1\n").unwrap();
        unless_the_machine_stalls(|n| {
            let rig = ServedRig::start(1, Some(&defects));
            let (plan, setup) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
            let out = folder.path().join(format!("run-{n}"));
            std::fs::write(&plan, served::timed_plan("off", 0, &[2e-6, 1e-6, 3e-6], [0.1, 4.0])).unwrap();
            std::fs::write(&setup, served::setup("off", rig.address)).unwrap();
            let mut command = muprime();
            command.args(["--json", "run"]).arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out);
            let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
            let documents = BufReader::new(child.stdout.take().unwrap());
            let documents =
                std::thread::spawn(move || documents.lines().map_while(Result::ok).collect::<Vec<_>>());
            let mut stderr = child.stderr.take().unwrap();
            let remarks = std::thread::spawn(move || {
                let mut all = String::new();
                let _ = stderr.read_to_string(&mut all);
                all
            });
            let mut amplifier = AmplifierWatch::connect(rig.address);
            wait_until(&mut amplifier, true);
            let mut watching = rig::live::Viewer::connect(&out).unwrap();
            let heard = std::thread::spawn(move || {
                let mut heard = Vec::new();
                loop {
                    match watching.hear(Duration::from_millis(100)) {
                        rig::live::Received::Message(message) => heard.push(*message),
                        rig::live::Received::Nothing => {}
                        rig::live::Received::Gone => return heard,
                    }
                }
            });
            // SAFETY: sends SIGINT to the child that this test has started and not yet waited for.
            unsafe { libc::kill(child.id() as libc::pid_t, libc::SIGINT) };
            ended(&mut child, "an amplifier that refuses off");
            let (documents, remarks, heard) =
                (documents.join().unwrap(), remarks.join().unwrap(), heard.join().unwrap());
            if cut_by_a_stall(&out).is_some() {
                return Some(out);
            }
            assert!(amplifier.read().on, "else this test shows nothing");
            assert!(remarks.contains("the output may still be on: switch the supply off"), "{remarks}");
            let place = |what: &str| documents.iter().position(|line| line.starts_with(what));
            let (off, summary) = (place("{\"off\":"), place("{\"summary\":"));
            assert!(off.is_some() && off < summary, "{documents:?}");
            use rig::live::Message;
            let off = heard
                .iter()
                .position(|m| matches!(m, Message::Off(words) if words.contains("may still be on")));
            let end = heard.iter().position(|m| matches!(m, Message::Ended(_)));
            assert!(off.is_some() && off < end, "{heard:?}");
            None
        });
    });
}
