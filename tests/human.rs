//! A human finger, from the setup to the end of a sweep: refused with what is missing, armed by a hand, ended by its exposure.
//! The finger is the virtual rig's, in virtual time: nobody is vibrated.

use models::prediction::SpringSlider;
use realtime::safety::Cause;
use runs::plan::Plan;
use runs::sequence::{Event, Outcome};
use runs::session::{Job, Signals, Update};
use runs::setup::Setup;
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
    let text = ideal.replace("[limits]\n", &format!("[limits]\nhuman_contact = true\n{limits}\n"));
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
    };
    let mut events = Vec::new();
    let mut news = |news: Update<'_>| {
        if let Update::Event(event) = news {
            events.push(event.clone());
        }
    };
    let summary = rig::session::run(job, &Signals::default(), &mut news).unwrap();
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
    assert_eq!((outcome, passes), (Outcome::WouldNotArm { blocking: Some(Cause::DeadMan) }, 0));
}

#[test]
fn a_sweep_longer_than_its_exposure_is_ended_by_it() {
    let tables = format!("{RELAY}\n{INPUTS}");
    // Passes of 0.3 s vibrate, with pauses between that end no go.
    let (outcome, passes, planned, _) = run(&tables, "exposure_max_s = 0.7", true);
    let Outcome::Tripped(trip) = outcome else { panic!("{outcome:?}") };
    assert_eq!((trip.cause, trip.bound), (Cause::Exposure, 0.7));
    assert!(trip.value < 0.705 && passes < planned, "{trip:?}");
}
