//! Helpers that several system tests share: `contents`, `memory`, `near`, `peer`, `served`, `study`, `waiting`.
//! README.md lists the tests.

pub mod contents;
pub mod memory;
pub mod near;
pub mod peer;
pub mod served;
pub mod study;
pub mod waiting;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A file of the repository.
pub fn file(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// A setup by name; `scpi` and `siglent` are the ideal virtual rig with a generator in the place of its amplifier, which has no
/// thermometer, `zaber` the one with a stage of lines of text, which loads nothing, and `wago` the one with a watchdog output as its relay.
pub fn setup(name: &str) -> runs::setup::Setup {
    let ideal = || runs::setup::Setup::load("virtual-ideal").expect("a bundled setup").text;
    let generator = |profile: &str| {
        let generator = format!("profile = \"{profile}\"\namplitude_m_per_unit = 1e-6\n");
        let text = ideal().replace("profile = \"muprime-amplifier\"\n", &generator);
        text.replace("[limits]\n", "[limits]\ntemperature_fitted = false\n")
    };
    let text = match name {
        "scpi" => generator("keysight-33500b"),
        "siglent" => generator("siglent-sdg"),
        "wago" => runs::setup::Setup::load("virtual-relay")
            .expect("a bundled setup")
            .text
            .replace("muprime-relay", "wago-750-watchdog")
            .replace("profile = \"wago-750-watchdog\"\n", "profile = \"wago-750-watchdog\"\nunit = 9\n"),
        "zaber" => ideal().replace(
            "profile = \"muprime-stage\"\naddress = \"127.0.0.1:0\"",
            "profile = \"zaber-x-lsm\"\naddress = \"pty\"\ndead_weight_n = 0.25",
        ),
        _ => return runs::setup::Setup::load(name).expect("a bundled setup"),
    };
    runs::setup::Setup::parse(name, &text, Path::new(".")).expect("a setup")
}

/// A bundled setup at no more than 250 Hz, written into a folder; its path. For sweeps in wall-clock time whose subject is not the loop's
/// timing: a machine that takes a CPU away for some milliseconds at a time then costs few deadlines.
pub fn unhurried(setup: &str, folder: &Path) -> String {
    let path = folder.join(format!("{setup}-250.toml"));
    let slower = slower(&runs::setup::Setup::load(setup).expect("a bundled setup"));
    std::fs::write(&path, slower.text).expect("a folder that can be written");
    path.display().to_string()
}

/// A setup at no more than 250 Hz.
pub fn slower(setup: &runs::setup::Setup) -> runs::setup::Setup {
    let (head, rest) = setup.text.split_once("[loop]\nrate_hz = ").expect("its rate is the loop's first key");
    let (rate_hz, rest) = rest.split_once('\n').expect("more lines");
    let rate_hz: u32 = rate_hz.parse().expect("a rate");
    let text = format!("{head}[loop]\nrate_hz = {}\n{rest}", rate_hz.min(250));
    runs::setup::Setup::parse("slower", &text, Path::new(".")).expect("a setup")
}

/// How many rounds of a campaign whose rounds differ by their seeds alone: `few`, or `all` with `MUPRIME_LONG=1` (`tests/run long`).
pub fn rounds<T>(few: T, all: T) -> T {
    if std::env::var_os("MUPRIME_LONG").is_some() { all } else { few }
}

/// The `muprime` that was built beside this test. A missing one fails: build the workspace first.
pub fn muprime() -> Command {
    let test = std::env::current_exe().expect("a test knows where it is");
    let folder = test.parent().and_then(Path::parent).expect("a test stands in target/<profile>/deps");
    let binary = folder.join("muprime");
    assert!(binary.exists(), "{} is missing: cargo build --release --workspace", binary.display());
    Command::new(binary)
}

/// The Python of the independent peers. Missing peers fail: nothing is skipped.
pub fn python() -> Command {
    let python = file("target/venv/bin/python");
    assert!(python.exists(), "{} is missing: run tests/venv", python.display());
    Command::new(python)
}

/// Standard output and standard error as text.
pub fn texts(output: &Output) -> (String, String) {
    (
        String::from_utf8_lossy(&output.stdout).into_owned(),
        String::from_utf8_lossy(&output.stderr).into_owned(),
    )
}

/// The JSON documents on standard output, one a line; anything else there fails.
pub fn documents(output: &Output) -> Vec<serde_json::Value> {
    let (out, _) = texts(output);
    out.lines()
        .map(|line| serde_json::from_str(line).unwrap_or_else(|e| panic!("not JSON: {line}: {e}")))
        .collect()
}

/// A plan of a few seconds.
pub const SHORT: &str = r#"
name = "short"
seed = 7
reference_every = 4
[pass]
settle_s = 0.08
measure_s = 0.1
[base]
amplitude_pp_m = 2e-6
frequency_hz = 27500
speed_m_s = 0.02
normal_force_n = 0.25
[[series]]
amplitude_pp_m = [0.5e-6, 1e-6, 2e-6, 3e-6]
speed_m_s = [0.01, 0.04]
"#;

/// A plan of 22 passes of a quarter of a second, written into a folder; its path.
pub fn short_plan(folder: &Path) -> String {
    let path = folder.join("short.toml");
    std::fs::write(&path, SHORT).expect("a folder that can be written");
    path.display().to_string()
}

/// Headings under which `muprime --help` lists verbs.
const VERB_GROUPS: [&str; 6] = ["Measure", "Understand", "Calibrate", "Look", "Studies", "Develop"];

/// The verbs that a help page lists: in groups for the program, below 'Commands' for a verb with verbs of its own.
pub fn listed_verbs(help: &str) -> Vec<String> {
    let mut listing = false;
    let mut names = Vec::new();
    for line in help.lines() {
        if !line.starts_with(' ') {
            // The program lists its verbs in groups, a verb lists its own below 'Commands'.
            let group = line.strip_suffix(':').unwrap_or_default();
            listing = group == "Commands" || VERB_GROUPS.contains(&group);
        } else if let Some(name) = line.strip_prefix("  ").filter(|l| listing && !l.starts_with(' ')) {
            names.extend(name.split(' ').next().filter(|n| *n != "help").map(str::to_string));
        }
    }
    names
}
