//! A human finger, from the setup to the end of a sweep: refused with what is missing, armed by a hand, ended
//! by its exposure. The finger is the virtual rig's, in virtual time: nobody is vibrated.

use models::SpringSlider;
use realtime::TripCause;
use runs::job::{Job, Signals, Update};
use runs::{Event, Outcome, Plan, Setup};
use std::path::Path;
use std::sync::Arc;

const RELAY: &str = "[supply_relay]\nprofile = \"muprime-relay\"\naddress = \"127.0.0.1:0\"\n";
const INPUTS: &str = "[safety_inputs]\nprofile = \"muprime-relay\"\naddress = \"127.0.0.1:0\"\n";
const PLAN: &str = r#"
name = "short"
seed = 7
reference_every = 4
[pass]
settle_s = 0.1
measure_s = 0.2
[base]
amplitude_pp_m = 2e-6
frequency_hz = 27500
speed_m_s = 0.02
normal_force_n = 0.25
[[series]]
amplitude_pp_m = [1e-6, 2e-6]
"#;

/// The ideal virtual rig with a human finger declared, these tables, these limits, and a hand at its device or none.
fn setup(tables: &str, limits: &str, hand: bool) -> String {
    let ideal = Setup::load("virtual-ideal").unwrap().text;
    let text = ideal.replace("artificial-silicone", "human-index-moist");
    let text = text.replace("[limits]\n", &format!("[limits]\nhuman_contact = true\n{limits}\n"));
    let text = text.replace("ideal = true\n", &format!("ideal = true\nhand_holds = {hand}\n"));
    format!("{text}\n{tables}")
}

/// A sweep in virtual time: how it ended, passes made and planned, and the events on the way.
fn run(tables: &str, limits: &str, hand: bool) -> (Outcome, usize, usize, Vec<Event>) {
    let folder = tempfile::tempdir().unwrap();
    let plan = folder.path().join("plan.toml");
    std::fs::write(&plan, PLAN).unwrap();
    let setup = Setup::parse("human", &setup(tables, limits, hand), Path::new(".")).unwrap();
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let job = Job {
        setup,
        plan: Plan::load(plan.to_str().unwrap()).unwrap(),
        seed: 7,
        model,
        model_file: None,
        defects: None,
        out: folder.path().join("run"),
        fast: true,
        notes: Default::default(),
        answers: None,
    };
    let (_, _, remarks) = job.points_seen(None).unwrap();
    let too_long = remarks.iter().any(|remark| remark.contains("vibrate the finger for"));
    assert_eq!(too_long, limits.contains("exposure_max_s"), "{remarks:?}");
    let mut events = Vec::new();
    let mut update = |update: Update<'_>| {
        if let Update::Event(event) = update {
            events.push(event.clone());
        }
    };
    let summary = rig::wall_clock_run::run(job, &Signals::default(), &mut update).unwrap();
    (summary.outcome, summary.passes, summary.planned, events)
}

#[test]
fn a_human_finger_is_refused_with_what_is_missing() {
    let refused = |tables: &str, limits: &str| {
        let text = setup(tables, limits, true);
        let error = Setup::parse("human", &text, Path::new(".")).err().map(|e| format!("{e:#}"));
        error.unwrap_or_default()
    };
    assert!(refused("", "").contains("supply_relay"));
    assert!(refused(INPUTS, "").contains("supply_relay"));
    assert!(refused(RELAY, "").contains("dead-man"));
    // A key stands for the dead-man device, and for nothing else.
    let with_key = refused(RELAY, "dead_man_key = true");
    assert!(with_key.contains("emergency stop") && !with_key.contains("dead-man"), "{with_key}");
    assert_eq!(refused(&format!("{RELAY}\n{INPUTS}"), ""), "");
    // A setup that says that no temperature is read would lose the rule on hot plates.
    let cold = refused(&format!("{RELAY}\n{INPUTS}"), "temperature_fitted = false");
    assert!(cold.contains("temperature_fitted"), "{cold}");
    // Exposure has hard ranges like every limit.
    for limit in ["exposure_rest_s = 1.0", "exposure_duty_max = 0.9", "exposure_dose_max_m2_s = nan"] {
        let why = refused(&format!("{RELAY}\n{INPUTS}"), limit);
        assert!(why.contains("permitted"), "{limit}: {why}");
    }
}

#[test]
fn a_hand_arms_the_rig_and_without_one_it_does_not_arm() {
    let tables = format!("{RELAY}\n{INPUTS}");
    let (outcome, passes, planned, events) = run(&tables, "", true);
    assert_eq!((outcome, passes), (Outcome::Complete, planned));
    assert!(events.contains(&Event::Armed) && !events.contains(&Event::NoSecondChannel), "{events:?}");
    let (outcome, passes, ..) = run(&tables, "", false);
    assert_eq!((outcome, passes), (Outcome::WouldNotArm { blocking: Some(TripCause::DeadMan) }, 0));
}

#[test]
fn a_sweep_longer_than_its_exposure_is_ended_by_it() {
    let tables = format!("{RELAY}\n{INPUTS}");
    // Passes of 0.3 s vibrate, with pauses between that end no go.
    let (outcome, passes, planned, _) = run(&tables, "exposure_max_s = 0.7", true);
    let Outcome::Tripped(trip) = outcome else { panic!("{outcome:?}") };
    assert_eq!((trip.cause, trip.bound), (TripCause::Exposure, 0.7));
    assert!(trip.value < 0.705 && passes < planned, "{trip:?}");
}

/// A real rig's setup: three instruments at an address, these tables beside, `limits` under `[limits]` and `finger` under `[finger]`.
fn real(tip: &str, finger: &str, limits: &str, tables: &str) -> Result<Setup, String> {
    let text = tests::served::setup("real", "10.0.0.7:1502".parse().unwrap());
    let text = text.replace("tip = \"artificial-silicone\"\n", &format!("tip = \"{tip}\"\n{finger}\n"));
    let text = text.replace("[limits]\n", &format!("[limits]\n{limits}\n"));
    Setup::parse("real", &format!("{text}\n{tables}"), Path::new(".")).map_err(|e| format!("{e:?}"))
}

fn at(board: &str, table: &str, more: &str) -> String {
    format!("[{table}]\nprofile = \"{board}\"\naddress = \"10.0.0.8:502\"\n{more}\n")
}

/// A tip of a person brings its guards, whatever else a setup says or leaves out.
#[test]
fn a_human_tip_brings_every_guard_unless_the_setup_says_that_nobody_touches_the_plate() {
    const HUMAN: &str = "human-index-moist";
    let relay = at("muprime-relay", "supply_relay", "");
    let inputs = at("muprime-relay", "safety_inputs", "");
    let bare = real(HUMAN, "", "", "").unwrap_err();
    for part in ["supply_relay", "emergency stop", "dead-man", "nobody_touches_the_plate = true"] {
        assert!(bare.contains(part), "{part}: {bare}");
    }
    let guarded = real(HUMAN, "", "", &format!("{relay}{inputs}")).unwrap();
    assert!(guarded.config.limits.human_contact);
    assert!(!guarded.guards().nobody_touches_the_plate);
    let alone = real(HUMAN, "nobody_touches_the_plate = true", "", "").unwrap();
    assert!(!alone.config.limits.human_contact && alone.guards().nobody_touches_the_plate);
    assert!(alone.guards().facts().iter().any(|(_, words)| words.contains("nobody touches the plate")));
    // A virtual rig vibrates nobody: it needs no such word.
    let text = Setup::load("virtual-ideal").unwrap().text.replace("artificial-silicone", HUMAN);
    assert!(!Setup::parse("virtual", &text, Path::new(".")).unwrap().config.limits.human_contact);
}

/// Two statements of one fact: the pair is refused, and never does the harmless one win.
#[test]
fn what_a_setup_states_against_itself_is_refused() {
    let nobody = "nobody_touches_the_plate = true";
    let inputs = |more: &str| at("muprime-relay", "safety_inputs", more);
    let all = format!("{}{}", at("muprime-relay", "supply_relay", ""), inputs(""));
    let virtual_at = |tables: &str| format!("{tables}[virtual]\nideal = true\n");
    // Tip, [finger], [limits], tables; what is named. An empty word: the pair agrees, and is taken.
    let pairs: &[(&str, &str, &str, &str, &str)] = &[
        ("human-index-moist", "", "human_contact = true", &all, ""),
        ("human-index-moist", "", "human_contact = false", &all, "human_contact = false"),
        ("human-index-moist", "", "human_contact = false", "", "human_contact = false"),
        ("human-index-dry", nobody, "human_contact = true", &all, "human_contact = true"),
        ("human-index-dry", nobody, "human_contact = false", "", ""),
        ("human-index-dry", nobody, "", "", ""),
        ("artificial-silicone", "", "human_contact = true", &all, "human_contact = true"),
        ("artificial-silicone", "", "human_contact = false", "", ""),
        ("artificial-silicone", nobody, "", "", "nobody_touches_the_plate"),
        ("probe-pmma-sphere", nobody, "", "", "nobody_touches_the_plate"),
        ("artificial-silicone", "", "temperature_fitted = false", "", "temperature_fitted = false"),
        ("human-index-moist", "", "temperature_fitted = false", &all, "temperature_fitted = false"),
        ("artificial-silicone", "", "temperature_fitted = true", "", ""),
        ("human-index-moist", "", "dead_man_key = true", &all, "dead_man_key = true"),
        (
            "artificial-silicone",
            "",
            "dead_man_key = true",
            &inputs("wired = [\"emergency_stop\"]"),
            "dead_man_key = true",
        ),
        ("human-index-moist", nobody, "dead_man_key = true", "", "dead_man_key = true"),
        ("artificial-silicone", "", "", &inputs("wired = [\"no_such\"]"), "no_such"),
        ("artificial-silicone", "", "", &virtual_at(""), "[virtual]"),
        ("human-index-moist", "", "", &virtual_at(""), "[virtual]"),
    ];
    for (tip, finger, limits, tables, named) in pairs {
        let said = real(tip, finger, limits, tables).err().unwrap_or_default();
        let as_it_should = if named.is_empty() { said.is_empty() } else { said.contains(named) };
        assert!(as_it_should, "{tip}, {finger}, {limits}, {tables}: {said}");
    }
    // Weights beside a stage that loads the finger itself would take the rule on its load away.
    let text = tests::served::setup("real", "10.0.0.7:1502".parse().unwrap());
    let stage = "profile = \"muprime-stage\"\n";
    let weighed = text.replace(stage, &format!("{stage}dead_weight_n = 0.25\n"));
    let said = Setup::parse("real", &weighed, Path::new(".")).map_err(|e| format!("{e:?}")).unwrap_err();
    assert!(said.contains("dead_weight_n"), "{said}");
    // A contact that is left out is not refused, since only the bench knows it: it is told at arming, in record and report.
    let without = real("artificial-silicone", "", "", &inputs("wired = [\"emergency_stop\"]")).unwrap();
    assert_eq!(without.guards().not_wired, ["interlock", "dead_man"]);
}

/// An amplifier without a watchdog, and none at its supply: what would switch it off dies with this program.
#[test]
fn a_finger_needs_a_watchdog_at_the_amplifier_or_at_its_supply() {
    let setup = |tip: &str, amplifier: &str, relay: &str| {
        let text = tests::served::setup("real", "10.0.0.7:1502".parse().unwrap());
        let line = format!("[amplifier]\nprofile = \"{amplifier}\"\naddress = \"/dev/ttyS7\"");
        let text =
            text.replace("[amplifier]\nprofile = \"muprime-amplifier\"\naddress = \"10.0.0.7:1502\"", &line);
        let text = text.replace("artificial-silicone", tip);
        let tables = format!(
            "{}{}",
            at(relay, "supply_relay", ""),
            at("muprime-relay", "safety_inputs", "").replace("0.8", "0.9")
        );
        Setup::parse("real", &format!("{text}\n{tables}"), Path::new(".")).map_err(|e| format!("{e:?}"))
    };
    let refused = setup("human-index-moist", "piezodrive-pdus210", "muprime-relay").unwrap_err();
    assert!(
        refused.contains("watchdog at the amplifier or at its supply relay") && refused.contains("wago"),
        "{refused}"
    );
    let guarded = setup("human-index-moist", "piezodrive-pdus210", "wago-750-watchdog").unwrap();
    assert!(guarded.config.limits.supply_watchdog && !guarded.config.limits.amplifier_watchdog);
    assert!(guarded.guards().if_this_program_dies.contains("opens by itself within 200 ms"));
    let artificial = setup("artificial-silicone", "piezodrive-pdus210", "muprime-relay").unwrap();
    assert!(artificial.guards().if_this_program_dies.starts_with("the output stays on"));
}
