//! A human finger with a key of the terminal for its dead-man device, with the real program on a pseudo-terminal and its rig in
//! another process: held, it drives; let go, it does not; the terminal is given back; what was vibrated counts in the next run.

use std::fs::File;
use std::io::{Read, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tests::served::{self, AmplifierWatch, ServedRig};
use tests::{muprime, texts};
use wall::{Stopwatch, outcome_alone, unless_the_machine_stalls, wait_until};

/// A setup of a served rig with a human finger whose hand is at the key.
fn setup(rig: &ServedRig, limits: &str) -> String {
    let board =
        |table: &str| format!("[{table}]\nprofile = \"muprime-relay\"\naddress = \"{}\"\n", rig.address);
    format!(
        "{}dead_man_key = true\n{limits}\n{}{}wired = [\"emergency_stop\", \"interlock\"]\n",
        served::setup("hand", rig.address).replace("artificial-silicone", "human-index-moist"),
        board("supply_relay"),
        board("safety_inputs"),
    )
}

/// A pseudo-terminal: this test's end, and the program's.
fn terminal() -> (File, OwnedFd) {
    let (mut master, mut slave) = (0, 0);
    let null = std::ptr::null_mut();
    // SAFETY: two valid places for descriptors; no name, no settings and no size are asked for.
    assert_eq!(unsafe { libc::openpty(&mut master, &mut slave, null, null.cast(), null.cast()) }, 0);
    // SAFETY: both were just opened, and nobody else owns them.
    unsafe { (File::from_raw_fd(master), OwnedFd::from_raw_fd(slave)) }
}

/// Whether the terminal hands over whole lines and echoes them, as a shell leaves it.
fn is_as_a_shell_leaves_it(slave: &OwnedFd) -> bool {
    // SAFETY: termios is plain data, valid when zeroed, and the kernel fills it for a descriptor that is open.
    let flags = unsafe {
        let mut settings: libc::termios = std::mem::zeroed();
        assert_eq!(libc::tcgetattr(slave.as_raw_fd(), &mut settings), 0);
        settings.c_lflag
    };
    let all = libc::ICANON | libc::ECHO | libc::ISIG;
    flags & all == all
}

/// Seconds that a rig mostly takes to open, from when the program listens to the key on.
const OPENS_S: f64 = 1.5;
/// Seconds after which a hand tries again where a slow machine took longer.
const AGAIN_S: f64 = 6.0;

/// What the hand does at the beginning.
#[derive(Clone, Copy, PartialEq)]
enum Hand {
    /// It keeps off for [`OPENS_S`], grips, and where nothing was driven by [`AGAIN_S`] lets go and grips again, as a person does.
    Grips,
    /// The key is held before the program begins.
    Stuck,
}

/// A sweep on a terminal, and a hand.
struct Run {
    child: Child,
    stderr: PathBuf,
    out: PathBuf,
    slave: OwnedFd,
    held: Arc<AtomicBool>,
    hand: Option<std::thread::JoinHandle<()>>,
    over: Arc<AtomicBool>,
    driven: Arc<AtomicBool>,
    amplifier: AmplifierWatch,
}

impl Run {
    fn start(rig: &ServedRig, folder: &Path, name: &str, limits: &str) -> Self {
        Self::with(rig, folder, name, limits, Hand::Grips)
    }

    fn with(rig: &ServedRig, folder: &Path, name: &str, limits: &str, hand: Hand) -> Self {
        let (plan, file) = (folder.join("plan.toml"), folder.join(format!("{name}.toml")));
        let (out, stderr) = (folder.join(name), folder.join(format!("{name}.txt")));
        std::fs::write(&plan, served::timed_plan("hand", 0, &served::some::<8>(), [0.1, 4.0])).unwrap();
        std::fs::write(&file, setup(rig, limits)).unwrap();
        let (mut master, slave) = terminal();
        let mut sweep = muprime();
        sweep.arg("run").arg(&plan).arg("--setup").arg(&file).arg("--out").arg(&out);
        sweep.stdin(Stdio::from(slave.try_clone().unwrap())).stdout(Stdio::null());
        sweep.stderr(File::create(&stderr).unwrap());
        // SAFETY: only system calls that are safe between fork and exec; the standard input is the terminal then.
        unsafe {
            sweep.pre_exec(|| {
                if libc::setsid() < 0 || libc::ioctl(0, libc::TIOCSCTTY, 0) < 0 {
                    return Err(std::io::Error::last_os_error());
                }
                Ok(())
            });
        }
        let child = sweep.spawn().unwrap();
        let (held, over) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
        let (pressed, ended) = (Arc::clone(&held), Arc::clone(&over));
        // A terminal repeats a held key some thirty times a second.
        let terminal = slave.try_clone().unwrap();
        let driven = Arc::new(AtomicBool::new(false));
        let drives = Arc::clone(&driven);
        let mut listens: Option<Instant> = None;
        let hand = std::thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                if listens.is_none() && !is_as_a_shell_leaves_it(&terminal) {
                    listens = Some(Instant::now());
                }
                let grips = drives.load(Ordering::Relaxed)
                    || listens.is_some_and(|from| from.elapsed().as_secs_f64() % AGAIN_S > OPENS_S);
                if pressed.load(Ordering::Relaxed) && (grips || hand == Hand::Stuck) {
                    let _ = master.write_all(b" ");
                }
                std::thread::sleep(Duration::from_millis(33));
            }
        });
        let amplifier = AmplifierWatch::connect(rig.address);
        Run { child, stderr, out, slave, held, hand: Some(hand), over, driven, amplifier }
    }

    /// Holds until the plate has been driven for that long.
    ///
    /// # Errors
    /// The run's folder, where it ended before that.
    fn drive(&mut self, seconds: f64) -> Result<(), PathBuf> {
        let began = Instant::now();
        let mut driven_from = None;
        while driven_from.is_none_or(|from: Instant| from.elapsed().as_secs_f64() < seconds) {
            if self.child.try_wait().unwrap().is_some() {
                let (status, said) = self.end();
                assert!(status == Some(1) || said.contains("no answer within"), "{said}");
                return Err(self.out.clone());
            }
            if self.amplifier.read().on && driven_from.is_none() {
                driven_from = Some(Instant::now());
                self.driven.store(true, Ordering::Relaxed);
                assert!(!is_as_a_shell_leaves_it(&self.slave), "no key is heard before a line is over");
            }
            assert!(began.elapsed().as_secs() < 120, "it is never driven");
            std::thread::sleep(Duration::from_millis(2));
        }
        Ok(())
    }

    fn signal(&self, signal: i32) {
        // SAFETY: a signal to the child that this test has started and not yet waited for.
        unsafe { libc::kill(self.child.id() as libc::pid_t, signal) };
    }

    /// Waits for its end: status and what it said.
    fn end(&mut self) -> (Option<i32>, String) {
        let status = self.child.wait().unwrap().code();
        let mut said = String::new();
        File::open(&self.stderr).unwrap().read_to_string(&mut said).unwrap();
        (status, said)
    }

    fn summary(&self) -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(self.out.join("summary.json")).unwrap()).unwrap()
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = self.hand.take().map(std::thread::JoinHandle::join);
    }
}

/// The ledgers of a served rig's amplifier, removed with the test: the port is another rig's tomorrow.
struct Ledger(Vec<PathBuf>);

impl Ledger {
    fn of(rig: &ServedRig) -> Self {
        let amplifier = drivers::InstrumentSetup::new("muprime-amplifier", &rig.address.to_string());
        let known = drivers::identity::every(&amplifier).unwrap();
        let path = |identity: &String| {
            let name = &calibration::certificate::sha256_hex(identity.as_bytes())[..16];
            // SAFETY: it reads a number of this process and cannot fail.
            let user = unsafe { libc::geteuid() };
            Path::new("/var/tmp").join(format!("muprime-{name}-{user}.exposure"))
        };
        let ledger = Ledger(known.iter().map(path).collect());
        ledger.remove();
        ledger
    }

    fn remove(&self) {
        for path in &self.0 {
            let _ = std::fs::remove_file(path);
        }
    }
}

impl Drop for Ledger {
    fn drop(&mut self) {
        self.remove();
    }
}

/// Time that earlier runs are said to have driven, in s, by the record of a run: in one go, and in the last hour.
fn carried_over(run: &Path) -> [f64; 2] {
    let record = tests::contents::read(&std::fs::read(run.join("run-1.mcap")).unwrap());
    let (_, built) = record.files.iter().find(|(name, _)| name == "loop.json").expect("every record has it");
    let built: serde_json::Value = serde_json::from_slice(built).unwrap();
    let exposed = &built["config"]["exposed"];
    let ns = |value: &serde_json::Value| value.as_f64().unwrap_or(0.0) * 1e-9;
    let parts = exposed["parts"].as_array().map_or(0.0, |parts| parts.iter().map(|part| ns(&part[0])).sum());
    [ns(&exposed["in_one_go"]), parts]
}

#[test]
fn a_held_key_drives_and_a_hand_that_lets_go_switches_off() {
    outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            // A new rig each time: nothing is left of an attempt that a stall cut.
            let rig = ServedRig::of("virtual-relay", 1, None);
            let _ledger = Ledger::of(&rig);
            let_go(&rig, folder.path(), n).err()
        });
    });
}

fn let_go(rig: &ServedRig, folder: &Path, attempt: u32) -> Result<(), PathBuf> {
    let mut run = Run::start(rig, folder, &format!("run-{attempt}"), "");
    // Longer than the key's own age: the repeats count.
    run.drive(1.5)?;
    run.held.store(false, Ordering::Relaxed);
    let let_go = Stopwatch::start();
    wait_until(&mut run.amplifier, false);
    let took = let_go.elapsed();
    // 0.7 s after it was last heard, and what a busy machine adds.
    let_go.judge((0.5..1.5).contains(&took.as_secs_f64()), &format!("off {took:?} after the key"));
    let (status, said) = run.end();
    if run.summary()["cause"] != "dead_man" {
        return Err(run.out.clone());
    }
    assert_eq!(status, Some(1), "{said}");
    assert!(said.contains("hold the space bar down") && said.contains("[SR-02]"), "{said}");
    assert!(is_as_a_shell_leaves_it(&run.slave));
    Ok(())
}

/// A key that something lies on: nobody has confirmed anything, and nothing is armed.
#[test]
fn a_key_that_is_held_from_the_beginning_arms_nothing() {
    outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| {
            let rig = ServedRig::of("virtual-relay", 1, None);
            let _ledger = Ledger::of(&rig);
            let mut run = Run::with(&rig, folder.path(), &format!("stuck-{n}"), "", Hand::Stuck);
            let (status, said) = run.end();
            assert!(!run.driven.load(Ordering::Relaxed) && !run.amplifier.read().on, "{said}");
            // Another end is that of a computer that stalled; what is said of this one is not.
            if run.summary()["blocking"] != "dead_man" {
                return Some(run.out.clone());
            }
            assert_eq!(run.summary()["outcome"], "would_not_arm");
            assert_eq!(status, Some(1), "{said}");
            assert!(said.contains("would not arm: the dead-man device was released"), "{said}");
            assert!(said.contains("grip it again"), "{said}");
            None
        });
    });
}

#[test]
fn the_terminal_is_given_back_whatever_ends_the_run() {
    outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        for (name, signals) in [
            ("interrupted", &[libc::SIGINT][..]),
            ("terminated", &[libc::SIGTERM][..]),
            ("hurried", &[libc::SIGINT, libc::SIGINT][..]),
            ("hung-up", &[libc::SIGHUP][..]),
            ("quit", &[libc::SIGQUIT][..]),
        ] {
            unless_the_machine_stalls(|n| {
                let rig = ServedRig::of("virtual-relay", 1, None);
                let _ledger = Ledger::of(&rig);
                let mut run = Run::start(&rig, folder.path(), &format!("{name}-{n}"), "");
                run.drive(0.1).err().or_else(|| {
                    for signal in signals {
                        run.signal(*signal);
                        std::thread::sleep(Duration::from_millis(5));
                    }
                    let (status, said) = run.end();
                    assert_eq!(status, Some(1), "{name}: {said}");
                    assert!(is_as_a_shell_leaves_it(&run.slave), "{name}: {said}");
                    assert!(!run.amplifier.read().on, "{name}");
                    None
                })
            });
        }
    });
}

#[test]
fn without_a_terminal_there_is_no_key() {
    let folder = tempfile::tempdir().unwrap();
    let rig = ServedRig::of("virtual-relay", 1, None);
    let file = folder.path().join("setup.toml");
    std::fs::write(&file, setup(&rig, "")).unwrap();
    for (more, why) in [(&[][..], "is not a terminal"), (&["--fast"][..], "--fast")] {
        let mut sweep = muprime();
        sweep.args(["run", "first-sweep", "--setup"]).arg(&file).args(more).stdin(Stdio::null());
        let output = sweep.arg("--out").arg(folder.path().join("never")).output().unwrap();
        let (_, said) = texts(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("dead") && said.contains(why), "{said}");
        assert!(!folder.path().join("never").exists(), "nothing was touched");
    }
    // Without key and without device there is no finger at all.
    std::fs::write(&file, setup(&rig, "").replace("dead_man_key = true\n", "")).unwrap();
    let output = muprime().arg("check").arg(&file).output().unwrap();
    assert!(output.status.code() != Some(0) && format!("{:?}", texts(&output)).contains("dead-man device"));
}

/// What a run has vibrated is known to the next one; a run that was killed is charged what it drove, and a few seconds.
#[test]
fn exposure_is_carried_from_run_to_run_and_no_kill_loses_it() {
    outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        unless_the_machine_stalls(|n| three_runs(&folder.path().join(n.to_string())).err());
    });
}

fn three_runs(folder: &Path) -> Result<(), PathBuf> {
    std::fs::create_dir(folder).unwrap();
    let rig = ServedRig::of("virtual-relay", 1, None);
    let ledger = Ledger::of(&rig);
    let ahead = rig::exposure::AHEAD.as_secs_f64();

    let mut first = Run::start(&rig, folder, "first", "");
    first.drive(2.0)?;
    first.signal(libc::SIGINT);
    assert_eq!(first.end().0, Some(1));
    assert_eq!(carried_over(&first.out), [0.0, 0.0]);

    let mut second = Run::start(&rig, folder, "second", "");
    second.drive(2.5)?;
    second.signal(libc::SIGKILL);
    second.end();
    let [go, hour] = carried_over(&second.out);
    assert!(go == hour && (1.9..6.0).contains(&go), "{go} s were driven before");
    wait_until(&mut second.amplifier, false);

    // The third knows both, and has only what is left of one go.
    let most = go + 2.5 + ahead + 3.0;
    let mut third = Run::start(&rig, folder, "third", &format!("exposure_max_s = {most}"));
    third.drive(0.0)?;
    let (status, said) = third.end();
    let [before, _] = carried_over(&third.out);
    // Between two passes the plate rests: 2.5 s are not all driven, and a pass is 4 s of vibration in 4.3 s.
    let driven = 0.8 * 2.5;
    assert!(before >= go + driven && before <= go + 2.5 + ahead + 1.5, "{before} after {go} and 2.5");
    let summary = third.summary();
    if summary["cause"] != "exposure" {
        return Err(third.out.clone());
    }
    assert_eq!((status, summary["bound"].as_f64()), (Some(1), Some(most)), "{said}");
    assert!(said.contains("[SR-03]"), "{said}");
    let alone = summary["at"].as_f64().unwrap() * 1e-9;
    assert!(alone < most, "tripped after {alone} s of its own: {before} s of {most} s were driven before");

    // A ledger that nobody can read refuses the finger, before anything moves.
    std::fs::write(&ledger.0[0], "no ledger").unwrap();
    let mut refused = Run::start(&rig, folder, "refused", "");
    let (status, said) = refused.end();
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("no human finger") && said.contains("damaged"), "{said}");
    Ok(())
}
