//! Pages that must say what the program does: `docs/safety.md`, the table from requirement to test,
//! generated; and `docs/contract.md`, whose commands and flags must be the program's.
//!
//! `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test requirements` writes it anew.

use realtime::safety::{RULES, Rule, TripCause, Unit};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use studies::validation::faults::scene::STEADY_AT;
use studies::validation::faults::scene::{RING, T};
use studies::validation::faults::search::judged;
use studies::validation::faults::{Expect, Moment, Pace, ROWS, Scene, Strike, Tally, run};
use tests::file;

#[path = "requirements/elsewhere.rs"]
mod elsewhere;

use elsewhere::ELSEWHERE;

/// Unit tests of the safety core that name a cause.
fn unit_tests() -> BTreeMap<String, BTreeSet<String>> {
    let mut files = vec![file("realtime/src/safety/tests.rs")];
    let rooms = std::fs::read_dir(file("realtime/src/safety/tests")).unwrap();
    files.extend(rooms.map(|f| f.unwrap().path()));
    let source: String = files.iter().map(|f| std::fs::read_to_string(f).unwrap()).collect();
    let (mut name, mut found) = (String::new(), BTreeMap::<String, BTreeSet<String>>::new());
    for line in source.lines() {
        if let Some(rest) = line.strip_prefix("fn ") {
            name = rest.split('(').next().unwrap_or_default().to_string();
        }
        for part in line.split("Cause::").skip(1) {
            let cause: String = part.chars().take_while(|c| c.is_alphanumeric()).collect();
            found.entry(cause).or_default().insert(name.clone());
        }
    }
    found
}

/// Every fault of the list in each of its phases, at one pace.
fn scenes(pace: Pace) -> impl Iterator<Item = (&'static str, Scene)> {
    ROWS.iter().enumerate().flat_map(move |(row, fault)| {
        let strikes = vec![Strike { row, at: STEADY_AT }];
        let scene = move |moment: &Moment| Scene { moment: *moment, seed: 1, strikes: strikes.clone(), pace };
        fault.moments.iter().map(move |moment| (fault.name, scene(moment)))
    })
}

fn tally(pace: Pace) -> Tally {
    let mut tally = Tally::default();
    scenes(pace).for_each(|(_, scene)| tally.count(&scene, judged(&scene, false), false));
    tally
}

/// Faults of the list by the cause that they trip.
fn faults_by_cause() -> BTreeMap<String, BTreeSet<&'static str>> {
    let mut by_cause = BTreeMap::<String, BTreeSet<_>>::new();
    for (name, scene) in scenes(Pace::Fast) {
        if let Some(trip) = run(&scene, false).trip {
            by_cause.entry(format!("{:?}", trip.cause)).or_default().insert(name);
        }
    }
    by_cause
}

fn words(names: impl IntoIterator<Item = impl AsRef<str>>) -> String {
    names.into_iter().map(|n| format!("`{}`", n.as_ref())).collect::<Vec<_>>().join(", ")
}

/// The units in which a rule's trip is told.
fn units_of(rule: &Rule) -> String {
    let symbol = |unit: &Unit| match unit {
        Unit::Flag => "is",
        Unit::Count => "count",
        Unit::Share => "share",
        unit => unit.symbol(),
    };
    rule.units.iter().map(symbol).collect::<Vec<_>>().join(", ")
}

fn page() -> String {
    let (units, faults) = (unit_tests(), faults_by_cause());
    let (tally, slow) = (tally(Pace::Fast), tally(Pace::Default));
    assert_eq!((tally.failed, slow.failed), (0, 0), "{:?} {:?}", tally.failures, slow.failures);
    let mut out = String::from(
        "# Safety: requirements, tests, reactions\n\n\
         Generated: `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test requirements`. A test fails where this page is not \
         what the code does.\n\n## From requirement to test\n\n\
         Unit tests are in `realtime/src/safety/tests.rs` and `tests/` beside it; faults are those of the list below, which `tests/faults.rs` runs.\n\n\
         | requirement | cause | unit | it demands | remedy | unit tests | faults that trip it |\n|---|---|---|---|---|---|---|\n",
    );
    for rule in RULES {
        let cause = format!("{:?}", rule.cause);
        let (unit, fault) = (units.get(&cause), faults.get(&cause));
        assert!(unit.is_some() || fault.is_some(), "{} {cause}: no test trips it", rule.id);
        let _ = writeln!(
            out,
            "| {} | {cause} | {} | {} | {} | {} | {} |",
            rule.id,
            units_of(rule),
            rule.text,
            rule.cause.remedy(),
            unit.map_or_else(String::new, words),
            fault.map_or_else(String::new, words),
        );
    }
    out.push_str(
        "\n## Faults and reactions\n\n\
         In virtual time at a 1 kHz loop, one seed a phase; `muprime faults --seeds 100000` runs as many as wanted. Cycles \
         count from the first whose inputs show the fault, that one included; each trip is for a cause of its row. Each cell is \
         bound / worst: at the limits of fast links (2 and 4 ms of latency, commands that live for two cycles), and at those that a \
         setup has by default (20 ms for links and commands; `muprime faults --default-limits`). A setup whose `link_stall_s` is larger \
         adds the difference to every bound that has a sample's or a state's age in it. 'Measured off' is the time from the \
         command until the plate's true amplitude is below 5 %.\n\n\
         | # | fault | phases | must follow | fast: off within / worst | default: off within / worst | measured off: bound / worst (ms) |\n\
         |---|---|---|---|---|---|---|\n",
    );
    for fault in ROWS {
        let phases: Vec<String> =
            fault.moments.iter().map(|m: &Moment| format!("{m:?}").to_lowercase()).collect();
        let timing = |pace: Pace| pace.timing(T, RING);
        let must = match fault.expect {
            Expect::Off(_) => "off".into(),
            Expect::Remark(n) => format!("a remark within {}, no trip", n.at(&timing(Pace::Fast))),
            Expect::RemarkOrOff(n) => format!("a remark or off within {n}"),
            Expect::NoTrip => "no trip".into(),
            Expect::NoMu => "no mu', no trip".into(),
        };
        let cell = |pace: Pace, tally: &Tally| {
            let Expect::Off(within) = fault.expect else { return String::new() };
            let mine = tally.reactions.iter().filter(|((_, name, _), _)| *name == fault.name);
            let worst = mine.filter_map(|(_, r)| r.command_off).max();
            format!("{} / {}", within.at(&timing(pace)), worst.map_or_else(|| "-".into(), |n| n.to_string()))
        };
        let reactions =
            || tally.reactions.iter().filter(|((_, name, _), _)| *name == fault.name).map(|(_, r)| r);
        let quiet = reactions().filter_map(|r| r.measured_off).max();
        let bound = reactions().map(|r| r.measured_bound).max().unwrap_or(0);
        let _ = writeln!(
            out,
            "| {} | `{}` | {} | {must} | {} | {} | {} |",
            fault.number,
            fault.name,
            phases.join(", "),
            cell(Pace::Fast, &tally),
            cell(Pace::Default, &slow),
            quiet.map_or_else(String::new, |n| format!("{bound} / {n}")),
        );
    }
    out.push_str(
        "\n## A stall before the rig is armed\n\n\
         Where a relay is fitted, a machine that is short of time leaves two things behind before arming, with nothing driven in either:\n\n\
         - A board that is silent for longer than its age limit (80 ms by default) is a silent emergency stop (SR-35): the supply is cut, and stays \
         cut until it is proved. An amplifier that reports its open supply then shows a fault (SR-20): only the proof clears it, so \
         the sweep does not wait for it, and asks for its reset once nothing else has stood in the way for 50 ms. The amplifier gets \
         no command: its fault is gone once its supply is closed, or the proof fails after 5 s for that cause.\n\
         - A proof in which the loop was late (SR-29, SR-31), or was held up while a sample or a contact grew too old, trips. It is made \
         again once no more deadlines were missed of the last thousand than an armed rig may miss, within the three resets and the ten seconds that an arming has; a relay that did not follow its command, and what an \
         instrument reports, end it at once. With a human finger no proof is made again.\n\n\
         Both are the event `arming_disturbed` with the rule and how long the loop was held up. No reset is asked for by a \
         program once the emergency stop was seen pressed or the amplifier refused 'off' (SR-24), though it be released or off since; \
         nor after a trip of an armed rig. Where the supply is open without a command, SR-37 keeps the rig from arming, not its amplifier's \
         fault.\n",
    );
    out.push_str(
        "\n## Faults that are struck elsewhere\n\n\
         Threads, files, buses and the network are no part of that bench; these rows of the list name the tests that strike them.\n\n\
         | # | fault | tests |\n|---|---|---|\n",
    );
    for (number, what, tests) in ELSEWHERE {
        let named: Vec<String> = tests.iter().map(|(path, name)| format!("`{name}` ({path})")).collect();
        let _ = writeln!(out, "| {number} | {what} | {} |", named.join(", "));
    }
    out
}

/// Numbers of the list, 1 to 50: each has a row of the bench or a line of tests, and a test that is named exists.
#[test]
fn every_fault_of_the_list_is_on_the_page() {
    for number in 1..=50 {
        let here = ROWS.iter().any(|r| r.number == number);
        assert!(here || ELSEWHERE.iter().any(|(n, ..)| *n == number), "fault {number} is nowhere");
    }
    for (number, what, tests) in ELSEWHERE {
        for (path, name) in *tests {
            let source = std::fs::read_to_string(file(path)).unwrap_or_default();
            assert!(source.contains(&format!("fn {name}(")), "{number} {what}: no test {name} in {path}");
        }
    }
}

#[test]
fn every_requirement_has_a_test_and_the_page_says_which() {
    let path = file("docs/safety.md");
    let now = page();
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == now,
        "docs/safety.md is old: MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test requirements"
    );
}

/// The safety case names its evidence as `file::test`: each is there.
#[test]
fn the_safety_cases_evidence_exists() {
    let page = std::fs::read_to_string(file("docs/safety-case.md")).unwrap();
    let named: Vec<(&str, &str)> = page
        .split('`')
        .filter_map(|word| word.split_once(".rs::"))
        .filter(|(path, name)| !path.contains(char::is_whitespace) && !name.is_empty())
        .collect();
    assert!(named.len() > 20, "{named:?}");
    for (path, name) in named {
        let source = std::fs::read_to_string(file(&format!("{path}.rs"))).unwrap_or_default();
        assert!(source.contains(&format!("fn {name}(")), "no test {name} in {path}.rs");
    }
}

#[test]
fn start_up_is_no_rule() {
    assert!(RULES.iter().all(|r| r.cause != TripCause::StartUp));
}

/// What `muprime WORDS --help` prints.
fn help(words: &[&str]) -> String {
    let output = tests::muprime().args(words).arg("--help").output().unwrap();
    assert!(output.status.success(), "muprime {words:?} --help: {}", tests::texts(&output).1);
    tests::texts(&output).0
}

/// The flags that stand in a text: `--` and a word.
fn flags(text: &str) -> BTreeSet<String> {
    let word =
        |rest: &str| rest.chars().take_while(|c| c.is_ascii_alphanumeric() || *c == '-').collect::<String>();
    text.split("--").skip(1).map(word).filter(|w| w.starts_with(|c: char| c.is_ascii_lowercase())).collect()
}

#[test]
fn the_contract_names_the_commands_and_flags_that_there_are() {
    let contract = std::fs::read_to_string(file("docs/contract.md")).unwrap();
    let rows = contract.lines().filter_map(|line| line.strip_prefix("| `muprime "));
    let named: BTreeSet<&str> = rows.filter_map(|row| row.split([' ', '`']).next()).collect();
    let all = help(&[]);
    let verbs = tests::listed_verbs(&all);
    assert_eq!(named, verbs.iter().map(String::as_str).collect());

    let sections: Vec<(&str, &str)> =
        contract.split("\n### `muprime ").skip(1).filter_map(|s| s.split_once("`\n")).collect();
    assert!(sections.len() >= 7, "{sections:?}");
    for (command, text) in sections {
        let words: Vec<&str> = command.split(' ').collect();
        let (text, help) = (text.split("\n## ").next().unwrap_or_default(), flags(&help(&words)));
        let unknown: Vec<String> = flags(text).into_iter().filter(|flag| !help.contains(flag)).collect();
        assert!(unknown.is_empty(), "docs/contract.md, muprime {command}: no such flags: {unknown:?}");
    }
}

/// The keys that a strict form takes, by its own word on a key that it does not know.
fn keys_of<T: serde::de::DeserializeOwned>() -> BTreeSet<String> {
    let refused = toml::from_str::<T>("no_such_key = 1").err().expect("a strict form").to_string();
    let known = refused.split_once("expected ").expect("names what it knows").1;
    known.split('`').skip(1).step_by(2).map(str::to_string).collect()
}

#[test]
fn every_key_of_a_setup_and_of_rig_toml_has_its_word() {
    use drivers::{AxisSetup, InstrumentSetup, vibrometer::VibrometerSetup};
    use models::{Calibration, PassNoise, RigFile};
    use runs::setup::{LimitsFile, Pace, SetupFile, VirtualRigConfig};
    let missing = |page: &str, keys: BTreeSet<String>| {
        let text = std::fs::read_to_string(file(page)).unwrap();
        let named = |key: &String| ["`", "[", "[["].iter().any(|open| text.contains(&format!("{open}{key}")));
        keys.into_iter().filter(|key| !named(key)).collect::<Vec<_>>()
    };
    let setup: BTreeSet<String> = [
        keys_of::<SetupFile>(),
        keys_of::<Pace>(),
        keys_of::<VirtualRigConfig>(),
        keys_of::<LimitsFile>(),
        keys_of::<InstrumentSetup>(),
        keys_of::<AxisSetup>(),
        keys_of::<VibrometerSetup>(),
        keys_of::<PassNoise>(),
        keys_of::<realtime::estimate::EstimateConfig>(),
        keys_of::<runs::fingertip::FingertipSetup>(),
    ]
    .into_iter()
    .flatten()
    .collect();
    assert!(setup.len() > 60, "{}", setup.len());
    assert_eq!(missing("docs/setup.md", setup), Vec::<String>::new());
    // The defaults that the page gives are the program's.
    let page = std::fs::read_to_string(file("docs/setup.md")).unwrap();
    let defaults = realtime::safety::Limits::paper(realtime::ports::Nanos(1_000_000));
    let defaults = serde_json::to_value(defaults).unwrap();
    let mut compared = 0;
    for (key, value) in defaults.as_object().unwrap() {
        let Some(row) = page.lines().find(|row| row.starts_with(&format!("| `{key}` |"))) else { continue };
        let Ok(said) = row.split('|').nth(3).unwrap().trim().parse::<f64>() else { continue };
        assert_eq!(Some(said), value.as_f64(), "docs/setup.md: {key}");
        compared += 1;
    }
    assert!(compared > 12, "{compared}");
    let rig: BTreeSet<String> = [keys_of::<RigFile>(), keys_of::<PassNoise>(), keys_of::<Calibration>()]
        .into_iter()
        .flatten()
        .collect();
    assert!(rig.len() > 10, "{}", rig.len());
    let text = std::fs::read_to_string(file("docs/contract.md")).unwrap();
    let unnamed: Vec<&String> = rig.iter().filter(|key| !text.contains(key.as_str())).collect();
    assert_eq!(unnamed, Vec::<&String>::new());
}

#[test]
fn a_log_filter_that_cannot_be_read_is_refused() {
    let started = |filter: &str| {
        let output =
            tests::muprime().args(["completions", "bash"]).env("MUPRIME_LOG", filter).output().unwrap();
        (output.status.code(), tests::texts(&output).1)
    };
    assert_eq!(started("warn,muprime_drivers=debug").0, Some(0));
    let (status, said) = started("warn,muprime_drivers=loud");
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("MUPRIME_LOG=warn,muprime_drivers=loud"), "{said}");
}
