//! Deaths that no signal brings: the kernel takes the program's memory, and the whole machine stops. The
//! program runs in a guest kernel (User-mode Linux, at the machine's own speed), and reaches the rig outside
//! it over a network of the user's own (slirp).

use super::*;

/// How the guest's program dies.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Death {
    /// The kernel kills it for want of memory.
    OutOfMemory,
    /// The machine stops as a whole, and does not go on.
    Stopped,
}

/// What the guest runs: the sweep, as the first that the kernel gives up, and on a word from outside a
/// program that takes all memory.
const GUEST: &str = "(echo 1000 >/proc/self/oom_score_adj; exec \"$@\") & \
    while [ ! -e \"$STRIKE\" ]; do sleep 0.05; done; tail /dev/zero >/dev/null 2>&1; wait";

/// A sweep in a guest, which ends with this value.
struct Guest {
    starter: Child,
    folder: std::path::PathBuf,
}

impl Guest {
    fn start(setup: &Path, plan: &Path, folder: &Path) -> Self {
        let mut guest = std::process::Command::new(tests::file("tests/can_guest/can-guest"));
        guest.args(["sh", "-c", GUEST, "sh"]).arg(muprime().get_program());
        guest.arg("run").arg(plan).arg("--setup").arg(setup).arg("--out").arg(folder.join("run"));
        guest.env("CAN_GUEST", "uml").env("CAN_GUEST_NET", "slirp").env("CAN_GUEST_MEM", "256M");
        guest.env("CAN_GUEST_LOG", folder.join("kernel.txt")).env("CAN_GUEST_TIMEOUT", "120");
        guest.env("TMPDIR", folder).env("STRIKE", folder.join("strike"));
        let log = std::fs::File::create(folder.join("stderr.txt")).unwrap();
        let starter = guest.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log).spawn().unwrap();
        Guest { starter, folder: folder.into() }
    }

    /// The guest kernel's own process, once it runs.
    fn kernel(&self) -> Option<i32> {
        let named = |path: &Path, name: &str| path.file_name().unwrap().to_str().unwrap().starts_with(name);
        let inside = |folder: &Path| -> Vec<_> {
            let entries = std::fs::read_dir(folder).into_iter().flatten();
            entries.map(|e| e.unwrap().path()).filter(|p| named(p, "can-guest")).collect()
        };
        let machine = inside(&self.folder).iter().flat_map(|d| inside(d)).next()?;
        std::fs::read_to_string(machine.join("pid")).ok()?.trim().parse().ok()
    }

    fn words(&self) -> String {
        std::fs::read_to_string(self.folder.join("stderr.txt")).unwrap()
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        // A stopped kernel hears no other signal, and its helpers outlive it: all that was started with it
        // ends.
        if let Some(pid) = self.kernel() {
            // SAFETY: asks for a number.
            let group = unsafe { libc::getpgid(pid) };
            if group > 1 {
                // SAFETY: the group of the kernel's process, which `timeout` made for the guest that this
                // test has started.
                unsafe { libc::kill(-group, libc::SIGKILL) };
            }
        }
        let _ = self.starter.wait();
    }
}

/// For how long the output was on: after the last heartbeat that arrived, or after the machine stood still.
fn died(setup: &str, death: Death, wait: Duration, folder: &Path) -> Result<Option<f64>, String> {
    std::fs::create_dir_all(folder).unwrap();
    let (plan, file) = (folder.join("plan.toml"), folder.join("setup.toml"));
    let mut rig = Rig::start(setup, folder);
    std::fs::write(&plan, served::timed_plan("dies", 0, &[2e-6; 8], [0.1, 4.0])).unwrap();
    // What the guest calls 10.0.2.2 is this machine's loopback.
    std::fs::write(&file, rig.reached(setup).replace("127.0.0.1", "10.0.2.2")).unwrap();
    let mut guest = Guest::start(&file, &plan, folder);
    let began = Instant::now();
    while !rig.look().1 {
        if guest.starter.try_wait().unwrap().is_some() || began.elapsed().as_secs() >= 90 {
            return Err(guest.words());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(wait);
    let kernel = guest.kernel().ok_or_else(|| guest.words())?;
    match death {
        Death::OutOfMemory => std::fs::write(folder.join("strike"), "").unwrap(),
        // SAFETY: as in `drop`.
        Death::Stopped => assert_eq!(unsafe { libc::kill(kernel, libc::SIGSTOP) }, 0),
    }
    // The time from which the output may be on for the stated time: the last heartbeat of a program that is
    // killed later than it is struck.
    let mut from = rig.seen();
    if !from.on {
        return Err(guest.words());
    }
    let mut last = rig.seen();
    while last.on && last.time_s - from.time_s < 1.5 && began.elapsed().as_secs() < 120 {
        if death == Death::OutOfMemory && last.heartbeat != from.heartbeat {
            from = last;
        }
        std::thread::sleep(Duration::from_millis(1));
        last = rig.seen();
    }
    if death == Death::OutOfMemory {
        while guest.starter.try_wait().unwrap().is_none() && began.elapsed().as_secs() < 150 {
            std::thread::sleep(Duration::from_millis(20));
        }
        let kernel = std::fs::read_to_string(folder.join("kernel.txt")).unwrap_or_default();
        let killed = kernel.lines().any(|line| line.contains("Killed process") && line.contains("(muprime)"));
        assert!(killed, "the kernel did not kill the sweep:\n{kernel}\n{}", guest.words());
    }
    Ok((!last.on).then_some(last.time_s - from.time_s))
}

/// Five deaths of each kind; by default one.
#[test]
fn a_kernel_without_memory_and_a_machine_that_stops_leave_nothing_on() {
    wall::outcome_alone(|| {
        let folder = tempfile::tempdir().unwrap();
        let mut random = ChaCha8Rng::seed_from_u64(20_261_126);
        let bound_s = 0.05 + BESIDE_S;
        for death in [Death::OutOfMemory, Death::Stopped] {
            for n in 0..rounds(1, 5) {
                let supply = SUPPLIES[n % SUPPLIES.len()];
                let text = setup(&AMPLIFIERS[0], supply);
                let wait = Duration::from_millis(random.next_u64() % 1500);
                let (mut words, watch) = (Vec::new(), wall::Stopwatch::start());
                let off_after = (0..9).find_map(|again| {
                    let place = folder.path().join(format!("{death:?}-{n}-{again}"));
                    died(&text, death, wait, &place).map_err(|w| words.push(w)).ok()
                });
                let Some(off_after) = off_after else {
                    assert!(watch.saw_a_stall(), "{death:?}: never driven: {words:?}");
                    wall::undecided("the guest's sweep was never driven, beside stalls of the machine")
                };
                println!("{death:?} with '{supply}': off after {off_after:?} s (bound {bound_s})");
                let off_after = off_after.unwrap_or_else(|| panic!("{death:?}, {supply}: it stays on"));
                watch.judge(off_after <= bound_s, &format!("{death:?}, {supply}: off after {off_after} s"));
            }
        }
    });
}
