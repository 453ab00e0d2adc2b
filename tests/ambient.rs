//! The air of a plan, from the list in the plan to the row of the table: set, waited for, found, or refused.
//! Steps of a person at the rig: disarmed, answered, recorded.

use models::SpringSlider;
use realtime::{Phase, Row};
use runs::ambient::{AmbientControl, Level, OperatorAnswers, SimulatedAir, Source};
use runs::job::{Job, Signals, Update};
use runs::plan::{Plan, Resolution};
use runs::supervisor::{self, Requests, VirtualLoop};
use runs::{Event, MeasuredPass, Outcome, Setup, Sweep};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tests::muprime;

const PLAN: &str = "name = \"air\"\nseed = 2\nreference_every = 4\n[pass]\nsettle_s = 0.1\nmeasure_s = 0.2\n[base]\n\
    amplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
    amplitude_pp_m = [1.35e-6, 2.5e-6]\nambient_pressure_pa = [101325, 50000]\n";
const CHAMBER: &str = "[chamber]\nprofile = \"muprime-chamber\"\naddress = \"127.0.0.1:0\"\n";
const RELAY: &str = "[supply_relay]\nprofile = \"muprime-relay\"\naddress = \"127.0.0.1:0\"\n";

struct Ran {
    passes: Vec<MeasuredPass>,
    events: Vec<Event>,
    outcome: Outcome,
    _folder: tempfile::TempDir,
    out: PathBuf,
}

fn job(setup: Setup, plan: &str, out: &Path) -> Job {
    Job {
        model: Arc::new(SpringSlider::new(setup.tip.finger).unwrap()),
        setup,
        plan: Plan::parse("air", plan).unwrap(),
        seed: 2,
        model_file: None,
        defects: None,
        out: out.to_path_buf(),
        fast: true,
        notes: Default::default(),
        answers: None,
    }
}

fn run(setup: &str, tables: &str, plan: &str, defects: Option<&str>, answers: Option<&str>) -> Ran {
    let folder = tempfile::tempdir().unwrap();
    let text = format!("{}\n{tables}", Setup::load(setup).unwrap().text);
    let setup = Setup::parse("changed", &text, Path::new(".")).unwrap();
    let answers = answers.map(|lines| {
        let path = folder.path().join("answers.txt");
        std::fs::write(&path, lines).unwrap();
        path
    });
    let out = folder.path().join("run");
    let defects = defects.map(|text| sim::defects::Defects::parse(text).unwrap());
    let job = Job { defects, answers, ..job(setup, plan, &out) };
    let (mut passes, mut events) = (Vec::new(), Vec::new());
    let summary = job.run_in_virtual_time(&Signals::default(), &mut |update| match update {
        Update::Pass(pass) => passes.push(pass.clone()),
        Update::Event(event) => events.push(event.clone()),
        _ => {}
    });
    Ran { passes, events, outcome: summary.unwrap().outcome, _folder: folder, out }
}

fn pressure(pass: &MeasuredPass) -> &Level {
    pass.levels.iter().find(|level| level.quantity == "ambient_pressure_pa").unwrap()
}

/// Mean `mu` of the passes at the larger amplitude and about this pressure.
fn mu(passes: &[MeasuredPass], pa: f64) -> f64 {
    let at = |p: &&MeasuredPass| {
        p.pass.amplitude.metres() > 2e-6 && (p.pass.ambient_pressure_pa.unwrap() - pa).abs() < 2000.0
    };
    let all: Vec<f64> = passes
        .iter()
        .filter(at)
        .map(|p| p.pass.lateral_force_n.unwrap().abs() / p.pass.normal_force_n)
        .collect();
    assert!(!all.is_empty(), "no pass at {pa} Pa");
    all.iter().sum::<f64>() / all.len() as f64
}

/// The finding: the pressure was written into the table, and nothing set it. The bundled rig has a squeeze
/// film, which half the air carries half as well: its friction must rise, and that of the ideal rig must not.
#[test]
fn a_pressure_of_the_plan_is_felt_and_the_table_holds_what_was_found() {
    let film = run("virtual", "", PLAN, None, None);
    assert_eq!(film.outcome, Outcome::Complete, "{:?}", film.events);
    let rise = mu(&film.passes, 50_000.0) / mu(&film.passes, 101_325.0);
    assert!(rise > 1.1, "{rise}");
    for pass in &film.passes {
        let level = pressure(pass);
        let planned = level.planned.unwrap();
        assert_eq!(pass.pass.ambient_pressure_pa, Some(level.value));
        assert!((level.value - planned).abs() < 1000.0 && !level.lost && level.source == Source::Simulated);
        assert!(level.age_s < 1.0);
    }
    let half = film.passes.iter().find(|p| pressure(p).planned == Some(50_000.0)).unwrap();
    assert_ne!(half.pass.ambient_pressure_pa, Some(50_000.0), "what was found is not what was planned");
    let reached = film.events.iter().filter(|e| matches!(e, Event::LevelReached { .. })).count();
    assert_eq!(reached, 2, "{:?}", film.events);
    let ideal = run("virtual-ideal", "", PLAN, None, None);
    let rise = mu(&ideal.passes, 50_000.0) / mu(&ideal.passes, 101_325.0);
    assert!((rise - 1.0).abs() < 0.05, "{rise}");
    let page = std::fs::read_to_string(film.out.join("report.html")).unwrap();
    assert!(page.contains("(simulated)"));
}

/// What a setup states of the air is so in its own virtual world.
#[test]
fn the_stated_air_of_a_virtual_rig_is_the_air_of_its_world() {
    let plan = PLAN.replace("ambient_pressure_pa = [101325, 50000]\n", "");
    let text = Setup::load("virtual").unwrap().text;
    let [full, thin] = [101_325.0, 10_000.0].map(|pa| {
        let stated = format!("ambient_pressure_pa = {pa:.1}\n{text}");
        let setup = Setup::parse("stated", &stated, Path::new(".")).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let job = job(setup, &plan, &folder.path().join("run"));
        let mut passes = Vec::new();
        let mut keep = |update: Update<'_>| {
            if let Update::Pass(pass) = update {
                passes.push(pass.clone());
            }
        };
        job.run_in_virtual_time(&Signals::default(), &mut keep).unwrap();
        mu(&passes, pa)
    });
    assert!(thin / full > 1.2, "{thin} {full}");
}

/// The negative control: a chamber that takes 50 kPa and stays at the room's pressure.
#[test]
fn a_chamber_that_lies_is_reported_and_no_pass_claims_its_level() {
    let plan = format!("{PLAN}[tolerances]\nreached_within_s = 20\n");
    let lies = run("virtual", "", &plan, Some("[[defect]]\nname = \"chamber_stuck\"\n"), None);
    let Outcome::LevelNotReached { quantity, wanted, found } = &lies.outcome else {
        panic!("{:?}", lies.outcome);
    };
    assert_eq!((quantity.as_str(), *wanted, *found), ("ambient_pressure_pa", 50_000.0, Some(101_325.0)));
    assert!(lies.events.iter().any(|e| matches!(e, Event::LevelNotReached { .. })));
    assert!(lies.passes.iter().all(|p| p.pass.ambient_pressure_pa == Some(101_325.0)));
    let page = std::fs::read_to_string(lies.out.join("report.html")).unwrap();
    assert!(page.contains("was not reached"), "the page says so");
}

#[test]
fn a_level_that_is_lost_in_a_pass_marks_the_pass() {
    let vents = "[[defect]]\nname = \"chamber_vents\"\nparameters = { at_s = 19 }\n";
    let plan = format!("{PLAN}[tolerances]\nreached_within_s = 10\n");
    let plan = plan.replace("measure_s = 0.2", "measure_s = 1.0").replace("[1.35e-6, 2.5e-6]", "[2.5e-6]");
    let lost = run("virtual", "", &plan, Some(vents), None);
    let marked: Vec<&Level> = lost.passes.iter().map(pressure).filter(|level| level.lost).collect();
    assert!(!marked.is_empty(), "{:?}", lost.events);
    assert!(marked.iter().all(|level| level.range[1] - 50_000.0 > 1000.0), "{marked:?}");
    assert!(lost.events.iter().any(|e| matches!(e, Event::LevelLost { .. })));
    assert!(matches!(lost.outcome, Outcome::LevelNotReached { .. }), "{:?}", lost.outcome);
}

/// A setup of real instruments, with nobody who sets a pressure.
#[test]
fn a_level_that_nobody_brings_about_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let text = Setup::load("virtual").unwrap().text.replace("[virtual]\nideal = false\n", "");
    let (plan, setup) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
    std::fs::write(&plan, PLAN).unwrap();
    std::fs::write(&setup, &text).unwrap();
    let out = folder.path().join("run");
    for command in [
        vec!["check", "--offline", "--setup", setup.to_str().unwrap(), plan.to_str().unwrap()],
        vec![
            "run",
            plan.to_str().unwrap(),
            "--setup",
            setup.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
        ],
    ] {
        let done = muprime().args(&command).output().unwrap();
        let said =
            String::from_utf8_lossy(&done.stderr).into_owned() + &String::from_utf8_lossy(&done.stdout);
        assert_ne!(done.status.code(), Some(0), "{said}");
        assert!(said.contains("ambient_pressure_pa") && said.contains("by_operator"), "{said}");
        assert!(!out.exists());
    }
    // An operator can; without a terminal and without answers the run is refused before anything is touched.
    std::fs::write(&setup, format!("{text}\n[ambient]\nby_operator = [\"ambient_pressure_pa\"]\n")).unwrap();
    let check = ["check", "--offline", "--setup", setup.to_str().unwrap(), plan.to_str().unwrap()];
    let done = muprime().args(check).output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let run =
        ["run", plan.to_str().unwrap(), "--setup", setup.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let done = muprime().args(run).stdin(std::process::Stdio::null()).output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.code() == Some(2) && said.contains("--answers") && !out.exists(), "{said}");
}

/// Passes at two pressures were one condition: half of a run differed from the whole by its pressure.
#[test]
fn runs_are_compared_at_the_levels_of_the_air_that_both_have() {
    let both = run("virtual", CHAMBER, PLAN, None, None);
    let upper = run("virtual", CHAMBER, &PLAN.replace("[101325, 50000]", "[101325]"), None, None);
    let compared = runs::compare::Compared::of([&both.out, &upper.out]).unwrap();
    let pairs = &compared.comparison.pairs;
    assert!(
        !pairs.is_empty() && pairs.iter().all(|p| p.air.ambient_pressure_pa == Some(101_325.0)),
        "{pairs:?}"
    );
    assert!(compared.comparison.unpaired[0] > 0 && compared.comparison.unpaired[1] == 0);
    assert!(pairs[0].setting().ends_with("pressure 101.325 kPa"), "{}", pairs[0].setting());
    assert!(runs::report::comparison::page(&compared).unwrap().contains("pressure 101.325 kPa"));
    let page = std::fs::read_to_string(both.out.join("report.html")).unwrap();
    assert!(page.contains("<td>pressure 50") || page.contains("<td>pressure 49"), "{page}");
    assert!(page.contains("levels of the air are in the table"));
    // Runs that set nothing are compared as before, whatever the weather.
    let none = PLAN.replace("ambient_pressure_pa = [101325, 50000]\n", "");
    let [a, b] = [run("virtual", "", &none, None, None), run("virtual", "", &none, None, None)];
    let compared = runs::compare::Compared::of([&a.out, &b.out]).unwrap();
    assert!(compared.comparison.pairs.iter().all(|p| p.air == Default::default()));
    assert_eq!(compared.comparison.unpaired, [0, 0]);
}

/// A refused answer gave no reason, and the next line was taken for it.
#[test]
fn an_answer_of_a_file_that_does_not_fit_ends_the_run_with_its_reason() {
    let tables = "[ambient]\nby_operator = [\"ambient_pressure_pa\"]\n";
    let plan = format!("{PLAN}[[step]]\nwhen = \"before\"\naction = \"measure_moisture\"\n");
    let run = |answers: &str| run("virtual", tables, &plan, None, Some(answers));
    // Units, a decimal comma and the mark that an editor of Windows puts first are no reason.
    let ran = run("\u{feff}35,5\n101.325kPa\r\n50 kPa\n");
    assert_eq!(ran.outcome, Outcome::Complete, "{:?}", ran.events);
    let typed =
        |p: &MeasuredPass| p.levels.iter().any(|l| l.quantity == "skin_moisture_au" && l.value == 35.5);
    assert!(ran.passes.iter().all(typed));
    for (answers, why) in [
        ("35%\n101325\n50000\n", "not a quantity in a.u."),
        ("-5\n101325\n50000\n", "0 to 200 a.u. is needed"),
        ("101325\n101325\n50000\n", "0 to 200 a.u. is needed"),
        ("35\nfifty\n50000\n", "not a quantity in Pa"),
        ("35\nnan\n50000\n", "is needed"),
    ] {
        let ran = run(answers);
        assert_eq!((&ran.outcome, ran.passes.len()), (&Outcome::Stopped, 0), "{answers}: {:?}", ran.events);
        let refused = ran.events.iter().find_map(|e| match e {
            Event::Answered { refused: Some(why), .. } => Some(why.clone()),
            _ => None,
        });
        assert!(refused.as_ref().is_some_and(|r| r.contains(why)), "{answers}: {refused:?}");
    }
}

/// A series that named no temperature was measured at what another one had left behind.
#[test]
fn a_series_names_every_quantity_of_the_air_that_another_sets() {
    let plan = format!("{PLAN}[[series]]\namplitude_pp_m = [2e-6]\ntemperature_c = [30]\n");
    let out = tempfile::tempdir().unwrap();
    let refused = job(Setup::load("virtual").unwrap(), &plan, out.path()).points().unwrap_err();
    let told = format!("{refused:?}");
    for words in
        ["leaves temperature_c at what", "leaves ambient_pressure_pa at what", "add temperature_c = [VALUE]"]
    {
        assert!(told.replace("\n", " ").contains(words) || told.contains(words), "{words}: {told}");
    }
    // One that leaves all as it is comes before anything is set.
    let plan = format!("{PLAN}[[series]]\namplitude_pp_m = [2e-6]\n");
    job(Setup::load("virtual").unwrap(), &plan, out.path()).points().unwrap();
}

/// The operator pumps and types what the gauge shows; a slip of the pen is asked again, and the record has all of it.
#[test]
fn the_operator_is_asked_and_what_he_types_is_what_the_table_holds() {
    let by_hand = "[ambient]\nby_operator = [\"ambient_pressure_pa\"]\n";
    let ran = run("virtual", by_hand, PLAN, None, Some("# morning\n101200\n5000\n50300\n"));
    assert_eq!(ran.outcome, Outcome::Complete, "{:?}", ran.events);
    let found: Vec<f64> = ran.passes.iter().map(|p| p.pass.ambient_pressure_pa.unwrap()).collect();
    assert!(found.iter().all(|pa| [101_200.0, 50_300.0].contains(pa)), "{found:?}");
    assert!(ran.passes.iter().all(|p| pressure(p).source == Source::AnswersFile));
    let mut zeros = ran.events.iter().filter_map(|e| match e {
        Event::Zeros { normal_n, .. } => *normal_n,
        _ => None,
    });
    assert!(zeros.all(|n| n.abs() < 0.01), "no zero is read before the finger is lifted: {:?}", ran.events);
    let last = pressure(ran.passes.last().unwrap());
    assert!(last.age_s > 2.0, "it grows old: {last:?}");
    let count = |which: fn(&Event) -> bool| ran.events.iter().filter(|e| which(e)).count();
    assert_eq!(count(|e| matches!(e, Event::OperatorStep { .. })), 3, "{:?}", ran.events);
    assert_eq!(count(|e| matches!(e, Event::Answered { .. })), 3);
    assert_eq!((count(|e| matches!(e, Event::Disarmed { .. })), count(|e| *e == Event::Armed)), (2, 3));
    // Nobody to answer any more: the run stops, and says so.
    let short = run("virtual", by_hand, PLAN, None, Some("101200\n"));
    assert_eq!(short.outcome, Outcome::Stopped);
}

/// While somebody is at the rig: output off and supply open by their readbacks, not armed, nothing moves;
/// afterwards the channel is proved again.
#[test]
fn every_step_of_a_person_finds_the_rig_disarmed() {
    let steps = "[[step]]\nwhen = \"before\"\naction = \"clean\"\n[[step]]\nwhen = \"before\"\naction = \"measure_moisture\"\n\
        [[step]]\nwhen = \"between\"\naction = \"contact\"\nwait_s = 20\n[[step]]\nwhen = \"after\"\naction = \"confirm\"\nwords = \"close the valve\"\n";
    let text = format!("{}\n{RELAY}", Setup::load("virtual-ideal").unwrap().text);
    let setup = Setup::parse("steps", &text, Path::new(".")).unwrap();
    let plan = Plan::parse("air", &format!("{PLAN}{steps}")).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn models::prediction::FrictionModel> =
        Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise)
        .guarded_by(&setup.config.limits)
        .at_rig(&plan, &setup);
    let world = sim::virtual_rig::VirtualRig::new(&sim::world::WorldConfig::ideal(), 1).unwrap().split();
    let air = SimulatedAir::Virtual(world[0].clone());
    let mut ambient_control =
        AmbientControl::open(&sweep, None, Some(air), OperatorAnswers::Simulated).unwrap();
    let [force, amplifier, stage] = world;
    let ports = realtime::cycle_io::Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage.clone()));
    let ports = realtime::cycle_io::Ports { supply: Box::new(stage), ..ports };
    let mut rig = VirtualLoop::new(setup.config, model, ports);
    let (mut asked, mut open_rows, mut events, mut passes) = (false, 0, Vec::new(), Vec::new());
    let outcome =
        supervisor::sweep(&mut rig, &mut sweep, &mut Requests::default, &mut |row, sweep, reaction| {
            let begins = reaction.events.iter().any(|e| matches!(e, Event::OperatorStep { .. }));
            let ends = reaction.events.iter().any(|e| matches!(e, Event::Answered { .. }));
            if asked || begins {
                open_rows += 1;
                at_rest(row);
            }
            asked = (asked || begins) && !ends;
            ambient_control.serve(row.now, sweep, &reaction);
            passes.extend(reaction.pass);
            events.extend(reaction.events);
        });
    assert_eq!(outcome, Outcome::Complete, "{events:?}");
    assert!(open_rows >= 4, "{open_rows}");
    let steps: Vec<&str> = events
        .iter()
        .filter_map(|e| match e {
            Event::OperatorStep { step, .. } => Some(step.as_str()),
            _ => None,
        })
        .collect();
    let expected = [
        "clean the plate",
        "measure the moisture of the skin",
        "hold the finger in contact with the plate",
        "close the valve",
    ];
    assert_eq!(steps, expected);
    let disarmed = events.iter().filter(|e| **e == Event::Disarmed { supply_open: true }).count();
    assert_eq!(disarmed, 3, "before, between, after: {events:?}");
    assert_eq!(events.iter().filter(|e| **e == Event::Armed).count(), 2);
    let moisture =
        |p: &MeasuredPass| p.levels.iter().any(|l| l.quantity == "skin_moisture_au" && l.value == 35.0);
    assert!(passes.iter().all(moisture));
}

/// 'again' has the step before done once more, and nothing is lost of what was said.
#[test]
fn a_step_can_be_repeated() {
    let steps =
        "[[step]]\nwhen = \"before\"\naction = \"clean\"\n[[step]]\nwhen = \"before\"\naction = \"wash\"\n";
    let plan = PLAN.replace("ambient_pressure_pa = [101325, 50000]\n", steps);
    let ran = run("virtual-ideal", "", &plan, None, Some("done\nagain\ndone\ndone\n"));
    assert_eq!(ran.outcome, Outcome::Complete, "{:?}", ran.events);
    let asked: Vec<&str> = ran
        .events
        .iter()
        .filter_map(|e| match e {
            Event::OperatorStep { step, .. } => step.split(' ').next(),
            _ => None,
        })
        .collect();
    assert_eq!(asked, ["clean", "wash", "clean", "wash"]);
}

fn at_rest(row: &Row) {
    let seen = &row.inputs.seen;
    assert!(!row.armed && !row.proving && row.supply_cut, "{row:?}");
    assert!(seen.supply.is_ok_and(|supply| supply.cut));
    assert_eq!((row.drive_pp_m, row.velocity_m_s, row.load_n), (0.0, 0.0, 0.0));
    assert!(seen.stage.is_ok_and(|stage| stage.velocity_m_s.abs() < 1e-3));
    assert!(row.marker.phase != Phase::Measure);
}

/// The same air behind Modbus: a chamber with its profile, in wall-clock time.
#[test]
fn a_chamber_behind_modbus_is_set_and_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = Setup::load("virtual").unwrap().text;
    let (plan, setup) = (folder.path().join("plan.toml"), folder.path().join("setup.toml"));
    std::fs::write(&plan, PLAN.replace("[1.35e-6, 2.5e-6]", "[2.5e-6]")).unwrap();
    std::fs::write(&setup, format!("{text}\n{CHAMBER}")).unwrap();
    let out = folder.path().join("run");
    let mut command = muprime();
    let done =
        command.arg("run").arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(&out).output().unwrap();
    let (_, stderr) = tests::texts(&done);
    assert_eq!(done.status.code(), Some(0), "{stderr}");
    let passes = runs::run_dir::passes_in(&out).unwrap();
    let rise = mu(&passes, 50_000.0) / mu(&passes, 101_325.0);
    assert!(rise > 1.1, "{rise}");
    assert!(stderr.contains("pressure 50 kPa reached"), "{stderr}");
}

/// Who ran it, on what and after which preparation goes wherever the numbers go, and a session that says
/// nothing of it keeps what the first one said.
#[test]
fn operator_sample_and_protocol_survive_a_resume_and_go_into_every_form() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let protocol =
        "[protocol]\nfinger_washing = \"commercial soap\"\nequilibration_min = 3\nmoisture_au = \"\"\n";
    let text = format!("{PLAN}{protocol}");
    let setup = Setup::load("virtual-ideal").unwrap();
    let session = |notes: runs::job::Notes, stop_after: Option<usize>| {
        let signals = Signals::default();
        let stops = Arc::clone(&signals.stops);
        let job = Job { notes, ..job(setup.clone(), &text, &out) };
        let mut made = 0;
        job.run_in_virtual_time(&signals, &mut |update| {
            made += usize::from(matches!(update, Update::Pass(_)));
            if stop_after == Some(made) {
                stops.store(1, std::sync::atomic::Ordering::Relaxed);
            }
        })
        .unwrap()
    };
    let (operator, sample) = (Some("Ada".to_string()), Some("silicone tip 3".to_string()));
    let first = session(
        runs::job::Notes { operator, sample, licence: Some("CC-BY-4.0".into()), ..Default::default() },
        Some(3),
    );
    assert_eq!(first.outcome, Outcome::Stopped);
    assert_eq!(session(Default::default(), None).outcome, Outcome::Complete);
    let mut crate_of = muprime();
    crate_of.args(["export", out.to_str().unwrap(), "--to", "ro-crate"]);
    let done = crate_of.output().unwrap();
    assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    let h5 = folder.path().join("run.h5");
    let done = muprime()
        .args(["export", out.to_str().unwrap(), "--to", "hdf5", "--out", h5.to_str().unwrap()])
        .output();
    assert_eq!(done.unwrap().status.code(), Some(0));
    for name in ["run.toml", "summary.json", "report.html", "ro-crate-metadata.json"] {
        let text = std::fs::read_to_string(out.join(name)).unwrap();
        for words in ["Ada", "silicone tip 3", "commercial soap"] {
            assert!(text.contains(words), "'{words}' in {name}");
        }
    }
    let bytes = std::fs::read(&h5).unwrap();
    let holds = |words: &str| bytes.windows(words.len()).any(|part| part == words.as_bytes());
    assert!(holds("Ada") && holds("commercial soap") && holds("silicone tip 3"), "HDF5");
}

/// The plan of the book's page, on the bundled rigs: the hidden squeeze film is named, with a region that the
/// pressure bounds first; the ideal rig has no gap.
#[test]
fn the_pressure_steps_name_the_squeeze_film_and_leave_the_ideal_rig_alone() {
    let page = std::fs::read_to_string(tests::file("docs/how-to/part-2.md")).unwrap();
    let plan = page.split("file=air.toml\n").nth(1).unwrap().split("```").next().unwrap();
    let verdict = |setup: &str| {
        let ran = run(setup, "", plan, None, None);
        assert_eq!(ran.outcome, Outcome::Complete);
        let done = muprime().args(["diagnose", "--json", ran.out.to_str().unwrap()]).output().unwrap();
        serde_json::from_slice::<serde_json::Value>(&done.stdout).unwrap()
    };
    let film = verdict("virtual");
    assert_eq!(
        (&film["verdict"], &film["hypotheses"][0]["effects"][0]),
        (&"named".into(), &"squeeze_film".into())
    );
    assert!(film["hypotheses"][0]["probability"].as_f64().unwrap() > 0.98, "{}", film["hypotheses"]);
    let first = &film["where"]["regions"][0];
    assert!(first["bounds"]["ambient_pressure_pa"][0].as_f64().unwrap() > 45_000.0, "{first}");
    assert!(first["share_of_gap"].as_f64().unwrap() > 0.3, "{first}");
    assert_eq!(verdict("virtual-ideal")["verdict"], "no_gap");
}
