//! What becomes of the output when this program dies: `kill -9` and SIGSTOP at random instants of a real `muprime run`, over every
//! bundled amplifier and every switch in its supply, with the rig in a process of its own, by the emulator's own clock.
//!
//! Where amplifier or supply has a heartbeat the output is off within the time that the profile states; where neither has, it stays
//! on, and the record says so. Each pair is struck once by each signal; `tests/run long` strikes 200 times by each.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdout, Stdio};
use std::time::{Duration, Instant};
use tests::{muprime, rounds, served};

/// Keys of an amplifier's table and of [limits] that its profile needs.
const AMPLIFIERS: &[(&str, &str, &str)] = &[
    ("muprime-amplifier", "address = \"127.0.0.1:0\"", ""),
    ("piezodrive-pdus210", "address = \"pty\"\namplitude_m_per_unit = 2e-8\nmeasured_m_per_unit = 1e-5", ""),
    (
        "keysight-33500b",
        "address = \"127.0.0.1:0\"\namplitude_m_per_unit = 1e-6",
        "temperature_fitted = false",
    ),
    ("siglent-sdg", "address = \"127.0.0.1:0\"\namplitude_m_per_unit = 1e-6", "temperature_fitted = false"),
];
/// Switches in the supply; none where the amplifier guards itself.
const SUPPLIES: &[&str] = &["", "muprime-relay", "wago-750-watchdog"];

/// Beside the stated time: what was on its way when the program died, and a step of the world.
const BESIDE_S: f64 = 0.05;

/// A rig with this amplifier and this switch, behind its protocols.
fn setup(amplifier: &(&str, &str, &str), supply: &str) -> String {
    let (profile, keys, limits) = amplifier;
    let at = |head: &str, id: &str, more: &str| format!("{head}\nprofile = \"{id}\"\n{more}\n");
    let supply = match supply {
        "" => String::new(),
        supply => at("[supply_relay]", supply, "address = \"127.0.0.1:0\"\nunit = 9"),
    };
    format!(
        "name = \"dies\"\n[loop]\nrate_hz = 250\n{}{}{}{supply}[finger]\ntip = \"artificial-silicone\"\n\
         [noise]\npass_relative_sd = 0.015\nforce_sd_n = 0.0008\n\
         [limits]\nlate_cycles_max = 100\nlate_in_a_row_max = 45\nlink_stall_s = 0.045\n{limits}\n",
        at("[[force]]", "muprime-force2", "address = \"127.0.0.1:0\""),
        at("[amplifier]", profile, keys),
        at("[stage]", "muprime-stage", "address = \"127.0.0.1:0\""),
    )
}

/// A served rig that is looked at over a pipe.
struct Rig {
    process: Child,
    out: BufReader<ChildStdout>,
    places: Vec<String>,
}

impl Rig {
    fn start(setup: &str, folder: &Path) -> Self {
        let file = folder.join("served.toml");
        std::fs::write(&file, format!("{setup}[virtual]\nideal = true\n")).unwrap();
        let mut rig = muprime();
        rig.args(["--json", "virtual-rig", "--hands", "--modbus-tcp", "127.0.0.1:0", "--setup"]).arg(&file);
        rig.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::inherit());
        let mut process = rig.spawn().unwrap();
        let mut out = BufReader::new(process.stdout.take().unwrap());
        let mut line = String::new();
        out.read_line(&mut line).unwrap();
        let served: serde_json::Value = serde_json::from_str(&line).unwrap();
        let place =
            |text: &serde_json::Value| text.as_str().unwrap().split_once(" at ").unwrap().1.to_string();
        let places = served["instruments"].as_array().unwrap().iter().map(place).collect();
        Rig { process, out, places }
    }

    /// The same setup, as it is reached.
    fn reached(&self, setup: &str) -> String {
        let mut places = self.places.iter();
        let line = |line: &str| match line.starts_with("address = ") {
            true => format!("address = \"{}\"\n", places.next().expect("a place for each instrument")),
            false => format!("{line}\n"),
        };
        setup.lines().map(line).collect()
    }

    /// Time of the emulator in s, and whether its output is on.
    fn look(&mut self) -> (f64, bool) {
        self.process.stdin.as_mut().unwrap().write_all(b"look\n").unwrap();
        let mut line = String::new();
        self.out.read_line(&mut line).unwrap();
        let seen: serde_json::Value = serde_json::from_str(&line).unwrap();
        (seen["time_s"].as_f64().unwrap(), seen["output_on"].as_bool().unwrap())
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// A run that ends with this value, whatever became of it.
struct Sweep(Child);

impl Sweep {
    /// Strikes it, and waits until it is dead or stands still.
    fn strike(&self, signal: i32) {
        // SAFETY: a signal to the child that this test has started and not yet waited for.
        unsafe { libc::kill(self.0.id() as libc::pid_t, signal) };
        let stat = format!("/proc/{}/stat", self.0.id());
        let rests = || {
            let text = std::fs::read_to_string(&stat).unwrap_or_default();
            text.rsplit_once(") ").is_none_or(|(_, rest)| matches!(rest.as_bytes()[0], b'T' | b'Z' | b'X'))
        };
        let began = Instant::now();
        while !rests() {
            assert!(began.elapsed().as_secs() < 10, "the signal never takes hold");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

impl Drop for Sweep {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// For how long the output was on after a strike, by the emulator's clock in s; none where it stayed on for a
/// second and more. With the events of the record.
type Struck = (Option<f64>, Vec<String>);

/// One strike. A sweep that trips before it, on a machine that others use, is no strike.
fn struck(setup: &str, signal: i32, wait: Duration, folder: &Path) -> Result<Struck, String> {
    std::fs::create_dir_all(folder).unwrap();
    let (plan, file, out) = (folder.join("plan.toml"), folder.join("setup.toml"), folder.join("run"));
    let mut rig = Rig::start(setup, folder);
    std::fs::write(&plan, served::timed_plan("dies", 0, &served::some::<8>(), [0.1, 4.0])).unwrap();
    std::fs::write(&file, rig.reached(setup)).unwrap();
    let mut sweep = muprime();
    sweep.arg("run").arg(&plan).arg("--setup").arg(&file).arg("--out").arg(&out);
    let log = std::fs::File::create(folder.join("stderr.txt")).unwrap();
    let mut sweep = Sweep(sweep.stdin(Stdio::null()).stdout(Stdio::null()).stderr(log).spawn().unwrap());
    let began = Instant::now();
    while !rig.look().1 {
        let over = sweep.0.try_wait().unwrap().is_some();
        let words = || std::fs::read_to_string(folder.join("stderr.txt")).unwrap();
        if over || began.elapsed().as_secs() >= 30 {
            return Err(words());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    std::thread::sleep(wait);
    if !rig.look().1 {
        return Err(std::fs::read_to_string(folder.join("stderr.txt")).unwrap());
    }
    sweep.strike(signal);
    let (from, mut on) = rig.look();
    let mut last = from;
    while on && last - from < 1.5 {
        (last, on) = rig.look();
        std::thread::sleep(Duration::from_millis(1));
    }
    let record = tests::contents::read(&std::fs::read(out.join("run-1.mcap")).unwrap());
    let events = record.events().map(|event| event["event"].as_str().unwrap_or("?").to_string());
    Ok(((!on).then_some(last - from), events.collect()))
}

#[test]
fn the_output_falls_by_itself_or_the_record_says_that_it_stays_on() {
    wall::in_wall_clock_time(strike_all);
}

fn strike_all() {
    let pairs: Vec<_> = AMPLIFIERS.iter().flat_map(|a| SUPPLIES.iter().map(move |s| (a, *s))).collect();
    // Without a watchdog and without a switch nothing is armed at all.
    let pairs: Vec<_> =
        pairs.into_iter().filter(|(a, s)| !s.is_empty() || a.0 == "muprime-amplifier").collect();
    let all: usize = rounds(pairs.len(), 200);
    let mut random = ChaCha8Rng::seed_from_u64(20_261_125);
    let folder = tempfile::tempdir().unwrap();
    let (mut left_on, mut not_driven) = (0, 0);
    for (signal, name) in [(libc::SIGKILL, "kill -9"), (libc::SIGSTOP, "SIGSTOP")] {
        for n in 0..all {
            let (amplifier, supply) = pairs[n % pairs.len()];
            let text = setup(amplifier, supply);
            let parsed = runs::setup::Setup::parse("dies", &text, Path::new(".")).unwrap();
            let waits = |id: &str| drivers::profile(id).ok()?.heartbeat()?.timeout_ms;
            let bound = waits(amplifier.0).or(waits(supply)).map(|ms| f64::from(ms) * 1e-3 + BESIDE_S);
            let wait = Duration::from_millis(random.next_u64() % 1500);
            let mut tries = 0;
            let (off_after, events) = loop {
                let place = folder.path().join(format!("{signal}-{n}-{}", random.next_u32()));
                match struck(&text, signal, wait, &place) {
                    Ok(struck) => break struck,
                    Err(words) if tries == 4 => {
                        panic!("{name}, {amplifier:?}, {supply}: never driven: {words}")
                    }
                    Err(_) => (tries, not_driven) = (tries + 1, not_driven + 1),
                }
            };
            let said = events.iter().any(|event| event == "no_watchdog");
            println!("{name}, {} with '{supply}': off after {off_after:?} s (bound {bound:?})", amplifier.0);
            match bound {
                Some(bound) => {
                    assert!(
                        off_after.is_some_and(|s| s <= bound),
                        "{name}, {amplifier:?}, {supply}: {off_after:?}"
                    );
                    assert!(!said, "{events:?}");
                }
                None => {
                    left_on += 1;
                    assert_eq!(off_after, None, "{name}, {amplifier:?}, {supply}: it has no watchdog");
                    assert!(said, "{events:?}");
                    let words = parsed.guards().if_this_program_dies;
                    assert!(words.starts_with("the output stays on"), "{words}");
                }
            }
        }
    }
    println!(
        "{} strikes; {left_on} of rigs without a watchdog, which stay on as their record says; {not_driven} sweeps \
         ended before their strike",
        2 * all
    );
}
