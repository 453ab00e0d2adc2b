//! The live view on real terminals: in tmux at two sizes, with keys, in another process, and on a terminal that nobody reads.

use std::fs::File;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tests::served::{AmplifierWatch, ServedRig, setup, timed_plan};
use tests::{muprime, texts};
use wall::{cut_by_a_stall, unless_the_machine_stalls, wait_until};

/// A terminal in tmux whose server is this test's own.
struct Tmux {
    socket: PathBuf,
}

impl Tmux {
    /// A terminal of that size in which a program runs; afterwards its status, and what the terminal's lines and echo are set to.
    fn start(
        folder: &Path,
        name: &str,
        size: (u32, u32),
        variables: &[(&str, &str)],
        words: &[&str],
    ) -> Self {
        let tmux = Tmux { socket: folder.join(format!("{name}.tmux")) };
        let mut line = String::from("env LC_ALL=C.UTF-8 TERM=screen-256color");
        for (name, value) in variables {
            line += &format!(" {name}={value}");
        }
        let program = muprime();
        line += &format!(" '{}'", program.get_program().to_str().unwrap());
        for word in words {
            line += &format!(" '{word}'");
        }
        line += "; echo STATUS $?; stty -a | tr ' ' '\\n' | grep -x -e '-*icanon;*' -e '-*echo;*'; sleep 600";
        let (width, height) = (size.0.to_string(), size.1.to_string());
        let runs = format!("MUPRIME_RUNS={}", folder.join("runs").display());
        let begun = tmux.say(&["new-session", "-d", "-e", &runs, "-x", &width, "-y", &height, &line]);
        assert!(begun.0, "tmux: {}", begun.1);
        tmux
    }

    fn say(&self, words: &[&str]) -> (bool, String) {
        let mut tmux = Command::new("tmux");
        tmux.env_remove("TMUX").arg("-S").arg(&self.socket).args(["-f", "/dev/null"]).args(words);
        let output = tmux.output().expect("tmux is missing: apt-get install tmux");
        let (out, err) = texts(&output);
        (output.status.success(), out + &err)
    }

    fn keys(&self, keys: &str) {
        assert!(self.say(&["send-keys", keys]).0);
    }

    fn screen(&self) -> String {
        self.say(&["capture-pane", "-p"]).1
    }

    /// The screen, once it shows all of that; `None` where the program ended before.
    fn shows(&self, all: &[&str]) -> Option<String> {
        let began = Instant::now();
        loop {
            let screen = self.screen();
            if all.iter().all(|part| screen.contains(part)) {
                return Some(screen);
            }
            if screen.contains("STATUS") && !all.iter().any(|part| part.contains("STATUS")) {
                return None;
            }
            assert!(began.elapsed().as_secs() < 60, "{all:?} is never shown:\n{screen}");
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// The terminal after the program: its status, and that it is as a shell leaves it.
    fn given_back(&self, status: u8) {
        let after = self.shows(&[&format!("STATUS {status}"), "icanon", "echo"]).unwrap();
        assert!(!after.contains("-icanon") && !after.contains("-echo"), "{after}");
    }
}

impl Drop for Tmux {
    fn drop(&mut self) {
        let _ = self.say(&["kill-server"]);
    }
}

/// A plan and a setup of a served rig, which limps along on a busy machine.
fn files(folder: &Path, rig: &ServedRig) -> (String, String) {
    let (plan, file) = (folder.join("plan.toml"), folder.join("rig.toml"));
    std::fs::write(&plan, timed_plan("view", 0, &[2e-6, 0.5e-6, 1e-6, 3e-6, 2.5e-6, 1.5e-6], [0.2, 0.8]))
        .unwrap();
    std::fs::write(&file, setup("served", rig.address)).unwrap();
    (plan.display().to_string(), file.display().to_string())
}

/// `run --tui` at 80x24 and `watch` of it at 200x50: both show the run; the one that watches pauses it, resumes it and stops nothing by
/// leaving; every pass is made; a paused rig does not drive; both terminals are given back.
#[test]
fn a_run_is_seen_paused_and_resumed_from_two_terminals() {
    unless_the_machine_stalls(|attempt| {
        let folder = tempfile::tempdir().unwrap();
        let rig = ServedRig::start(3, None);
        let (plan, file) = files(folder.path(), &rig);
        let out = folder.path().join("run");
        let cut = || {
            eprintln!("attempt {attempt} was cut");
            let began = Instant::now();
            while !out.join("summary.json").exists() && began.elapsed().as_secs() < 10 {
                std::thread::sleep(Duration::from_millis(50));
            }
            let kept = std::env::temp_dir().join(format!("terminal-view-{}-{attempt}", std::process::id()));
            let _ = std::fs::create_dir_all(&kept);
            std::fs::copy(out.join("summary.json"), kept.join("summary.json")).unwrap();
            Some(kept)
        };
        let own = Tmux::start(
            folder.path(),
            "own",
            (80, 24),
            &[("NO_COLOR", "1")],
            &["run", &plan, "--setup", &file, "--tui", "--operator", "Ada", "--out", out.to_str().unwrap()],
        );
        let Some(page) =
            own.shows(&["ARMED: ", "operator Ada", "of 12 passes", "mu' by w", "s stop", "1 of 12"])
        else {
            return cut();
        };
        for part in [
            "lateral force",
            "normal force",
            "mu' predicted",
            "residual",
            "lateness",
            "w, um peak-to-peak",
            "left, ends about",
        ] {
            assert!(page.contains(part), "{part}\n{page}");
        }
        let coloured = own.say(&["capture-pane", "-p", "-e"]).1;
        let colour =
            |sgr: &str| sgr.split(';').any(|n| matches!(n.parse(), Ok(30..=38 | 40..=48 | 90..=107)));
        for sgr in
            coloured.split("\u{1b}[").skip(1).filter_map(|rest| rest.split_once('m')).map(|(sgr, _)| sgr)
        {
            assert!(!colour(sgr), "{sgr}: a colour with NO_COLOR\n{coloured}");
        }
        let other = Tmux::start(folder.path(), "other", (200, 50), &[], &["watch", out.to_str().unwrap()]);
        if other.shows(&["ARMED: ", "q leave"]).is_none() {
            return cut();
        }
        other.keys("p");
        if own.shows(&["PAUSED"]).and(other.shows(&["PAUSED"])).is_none() {
            return cut();
        }
        let mut amplifier = AmplifierWatch::connect(rig.address);
        wait_until(&mut amplifier, false);
        // Resized while it is shown: what is needed first stays.
        assert!(other.say(&["resize-window", "-x", "50", "-y", "12"]).0);
        other.shows(&["PAUSED", "s stop"]);
        for _ in 0..20 {
            assert!(!amplifier.read().on, "a paused rig does not drive");
            std::thread::sleep(Duration::from_millis(25));
        }
        other.keys("q");
        other.given_back(0);
        own.keys("q");
        own.shows(&["s stops the run"]);
        own.keys("r");
        let ended = own.shows(&["STATUS"]).unwrap();
        if ended.contains("STATUS 1") {
            return cut();
        }
        own.given_back(0);
        assert!(ended.contains("12 of 12 passes"), "what was said meanwhile is told afterwards:\n{ended}");
        let told = std::fs::read_to_string(out.join("report.html")).unwrap();
        assert!(
            told.contains("paused before pass") && told.contains("resuming"),
            "the record shows the pause"
        );
        let replayed = muprime().arg("replay").arg(&out).output().unwrap();
        assert_eq!(replayed.status.code(), Some(0), "{}", texts(&replayed).0);
        // A finished run shows its end.
        let late = Tmux::start(folder.path(), "late", (80, 24), &[], &["watch", out.to_str().unwrap()]);
        let page =
            late.shows(&["ENDED: complete", "12 of 12 passes", "operator Ada", "the drive is off"]).unwrap();
        assert!(!page.contains("time left"), "{page}");
        None
    });
}

/// One key stops, from the run's own view and from another process's. SIGTERM, SIGHUP and SIGQUIT give the
/// terminal back. A terminal whose window is closed sends a SIGHUP and reads nothing any more: the run ends
/// as by a stop, with the drive off and the passes kept.
#[test]
fn one_key_stops_and_signals_give_the_terminal_back() {
    for how in ["own s", "own Ctrl-C", "other s", "SIGTERM", "SIGHUP", "SIGQUIT", "closed"] {
        let folder = tempfile::tempdir().unwrap();
        let rig = ServedRig::start(3, None);
        let (plan, file) = files(folder.path(), &rig);
        let out = folder.path().join("run");
        let own = Tmux::start(
            folder.path(),
            "own",
            (80, 24),
            &[],
            &["run", &plan, "--setup", &file, "--tui", "--out", out.to_str().unwrap()],
        );
        own.shows(&["ARMED: "]);
        match how {
            "own s" => own.keys("s"),
            "own Ctrl-C" => own.keys("C-c"),
            "other s" => {
                let other =
                    Tmux::start(folder.path(), "other", (80, 24), &[], &["watch", out.to_str().unwrap()]);
                other.shows(&["point"]);
                other.keys("s");
                other.shows(&["ENDED: "]);
            }
            "closed" => assert!(own.say(&["kill-server"]).0),
            signal => {
                let lock = std::fs::read_to_string(out.join(".lock")).unwrap();
                let signal = signal.replace("SIG", "-");
                assert!(Command::new("kill").args([&signal, &lock]).status().unwrap().success());
            }
        }
        if how == "closed" {
            let began = Instant::now();
            while !out.join("summary.json").exists() {
                assert!(began.elapsed().as_secs() < 60, "the run outlives its terminal");
                std::thread::sleep(Duration::from_millis(50));
            }
            wait_until(&mut AmplifierWatch::connect(rig.address), false);
        } else {
            own.given_back(1);
        }
        let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
        // A machine that stalls may have tripped it first: off it is either way.
        assert!(summary.contains("\"stopped\"") || cut_by_a_stall(&out).is_some(), "{how}: {summary}");
    }
}

/// A terminal that nobody reads holds up its picture, and nothing else: every pass is made and the rig is
/// off, while the program's last words wait.
#[test]
fn a_terminal_that_nobody_reads_holds_nothing_up() {
    unless_the_machine_stalls(|attempt| {
        let folder = std::env::temp_dir().join(format!("deaf-terminal-{}-{attempt}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let rig = ServedRig::start(3, None);
        let (plan, file) = files(&folder, &rig);
        let out = folder.join("run");
        let (mut master, mut slave) = (0, 0);
        let null = std::ptr::null_mut();
        // SAFETY: two valid places for descriptors; no name, no settings and no size are asked for.
        assert_eq!(unsafe { libc::openpty(&mut master, &mut slave, null, null.cast(), null.cast()) }, 0);
        // SAFETY: both were just opened, and nobody else owns them.
        let (master, slave) = unsafe { (OwnedFd::from_raw_fd(master), File::from_raw_fd(slave)) };
        // The program gets no hold of this end: when it goes, the terminal is gone.
        // SAFETY: the descriptor was just opened.
        assert_eq!(unsafe { libc::fcntl(master.as_raw_fd(), libc::F_SETFD, libc::FD_CLOEXEC) }, 0);
        // Filled to the brim before the program begins: not one byte of the view is taken.
        let full = slave.try_clone().unwrap();
        let filler = std::thread::spawn(move || {
            use std::io::Write;
            let _ = (&full).write_all(&[b'.'; 1 << 20]);
        });
        std::thread::sleep(Duration::from_millis(200));
        assert!(!filler.is_finished(), "the terminal took a megabyte");
        let mut run = muprime();
        run.args(["run", &plan, "--setup", &file, "--tui", "--out"]).arg(&out);
        run.stdin(Stdio::null()).stdout(slave.try_clone().unwrap()).stderr(slave);
        let mut child = run.env("MUPRIME_RUNS", folder.join("runs")).spawn().unwrap();
        let began = Instant::now();
        while !out.join("summary.json").exists() {
            assert!(began.elapsed().as_secs() < 60, "the sweep waits for a terminal");
            std::thread::sleep(Duration::from_millis(50));
        }
        wait_until(&mut AmplifierWatch::connect(rig.address), false);
        // The terminal goes, and with it whatever the program still had to say.
        drop(master);
        assert!(child.wait().unwrap().code().is_some());
        filler.join().unwrap();
        let summary: runs::job::Summary =
            serde_json::from_str(&std::fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
        if matches!(summary.outcome, runs::sweep::Outcome::Tripped(_)) {
            return Some(out);
        }
        assert_eq!((summary.passes, summary.record_lost), (12, 0));
        std::fs::remove_dir_all(&folder).unwrap();
        None
    });
}

/// Beside documents, and where no terminal is, there is no picture: refused before anything is touched.
#[test]
fn no_picture_without_a_terminal() {
    let folder = tempfile::tempdir().unwrap();
    for json in [false, true] {
        let mut run = muprime();
        run.args(["run", "--fast", "--tui", "--out"]).arg(folder.path().join("run"));
        if json {
            run.arg("--json");
        }
        let output = run.env("MUPRIME_RUNS", folder.path()).output().unwrap();
        assert_eq!(output.status.code(), Some(2), "{}", texts(&output).1);
        assert!(!folder.path().join("run").exists(), "nothing was touched");
    }
}

/// The bundled sweep on 80x24, as docs/live.md shows it; `MUPRIME_UPDATE=1` puts the page there.
#[test]
fn the_page_of_the_docs_is_that_of_a_run() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("monday");
    // The bundled rig at 250 Hz, where a stall of a busy machine is a few deadlines: what is looked at is the page, not the loop.
    let setup = folder.path().join("virtual.toml");
    let text = runs::setup::Setup::load("virtual").unwrap().text;
    let slower = text.replace("rate_hz = 1000", "rate_hz = 250");
    assert_ne!(slower, text);
    std::fs::write(&setup, slower).unwrap();
    let (setup, place) = (setup.to_str().unwrap(), out.to_str().unwrap());
    let who = ["--operator", "Ada", "--sample", "silicone tip 3"];
    let words = [&["run", "--tui", "--setup", setup], &who[..], &["--out", place]].concat();
    // A machine that stalls may trip it all the same: it is taken up again where it was cut, unless the moment is past.
    let page = (0..16).find_map(|tries: u64| {
        std::thread::sleep(std::time::Duration::from_secs(tries.min(8)));
        if runs::run_dir::passes_in(&out).is_ok_and(|made| made.len() > 58) {
            std::fs::remove_dir_all(&out).unwrap();
        }
        let own = Tmux::start(folder.path(), "docs", (80, 24), &[], &words);
        let page = own.shows(&["ARMED: measuring", "60 of 98 passes"]);
        own.keys("s");
        own.shows(&["STATUS"]);
        page
    });
    let page = page.expect("sixteen sweeps in a row were cut");
    let page: String = page
        .lines()
        .map(|line| line.trim_end().replace(out.to_str().unwrap(), "runs/monday") + "\n")
        .collect();
    let (file, fence) = (tests::file("docs/live.md"), "```");
    let text = std::fs::read_to_string(&file).unwrap();
    let (before, rest) = text.split_once("```text\n").unwrap();
    let (kept, after) = rest.split_once(fence).unwrap();
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&file, format!("{before}```text\n{page}{fence}{after}")).unwrap();
        return;
    }
    // Numbers are those of the day; the words before them are not.
    let words = |page: &str| {
        let head = |line: &str| {
            line.chars().take_while(|c| !c.is_ascii_digit() && *c != '+' && *c != '-').collect::<String>()
        };
        page.lines()
            .map(|line| head(line).trim().to_string())
            .filter(|head| head.is_ascii())
            .collect::<Vec<_>>()
    };
    let (kept, page) = (words(kept), words(&page));
    let top = 14;
    assert_eq!(kept[..top], page[..top], "MUPRIME_UPDATE=1 makes it anew");
}

/// A plan whose moisture a person measures and whose pressure a person sets, on a rig in another process: the
/// operator reads each request on the terminal and types the answer. A word in place of a number, and a
/// pressure outside the tolerance, are requested again; the table holds what was typed.
#[test]
fn the_operator_types_what_the_run_needs() {
    unless_the_machine_stalls(|_| {
        let folder = tempfile::tempdir().unwrap();
        let rig = ServedRig::start(5, None);
        let (plan, file) = files(folder.path(), &rig);
        let text = timed_plan("air", 0, &[2e-6, 1e-6], [0.1, 0.2]);
        let more = "ambient_pressure_pa = [101325, 50000]\n[[step]]\nwhen = \"before\"\n\
            action = \"measure_moisture\"\n";
        std::fs::write(&plan, format!("{text}{more}")).unwrap();
        let by_hand = "[ambient]\nby_operator = [\"ambient_pressure_pa\"]\n";
        std::fs::write(&file, format!("{}{by_hand}", setup("served", rig.address))).unwrap();
        let out = folder.path().join("run");
        let tmux = Tmux::start(
            folder.path(),
            "operator",
            (160, 50),
            &[],
            &["run", &plan, "--setup", &file, "--operator", "Ada", "--out", out.to_str().unwrap()],
        );
        let turns: [(&str, usize, &str); 5] = [
            ("moisture of the skin", 1, "wet"),
            ("moisture of the skin", 2, "31"),
            ("set pressure 101", 1, "101200"),
            ("set pressure 50", 1, "70000"),
            ("set pressure 50", 2, "50300"),
        ];
        for (request, times, answer) in turns {
            let began = Instant::now();
            let requested = |screen: &str| {
                let lines = screen.lines().filter(|l| l.contains("AT THE RIG") && l.contains(request));
                lines.count() >= times
            };
            loop {
                let screen = tmux.screen();
                if requested(&screen) {
                    break;
                }
                if screen.contains("STATUS") && cut_by_a_stall(&out).is_some() {
                    return Some(out);
                }
                assert!(began.elapsed().as_secs() < 60, "'{request}' is not on the screen:\n{screen}");
                std::thread::sleep(Duration::from_millis(50));
            }
            tmux.keys(answer);
            tmux.keys("Enter");
        }
        tmux.shows(&["STATUS"]);
        if cut_by_a_stall(&out).is_some() {
            return Some(out);
        }
        tmux.given_back(0);
        let passes = models::pass::read_passes(&std::fs::read(out.join("points.csv")).unwrap()[..]).unwrap();
        let mut found: Vec<f64> = passes.iter().map(|p| p.ambient_pressure_pa.unwrap()).collect();
        found.dedup();
        found.sort_by(f64::total_cmp);
        assert_eq!(found, [50_300.0, 101_200.0]);
        for pass in runs::run_dir::passes_in(&out).unwrap() {
            let moisture = pass.levels.iter().find(|level| level.quantity == "skin_moisture_au").unwrap();
            assert_eq!((moisture.value, moisture.source), (31.0, runs::ambient::Source::Operator));
        }
        None
    });
}
