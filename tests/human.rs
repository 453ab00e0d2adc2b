//! A human finger, from the setup to the end of a sweep: refused with what is missing, armed by a hand, ended by its exposure.
//! The finger is the virtual rig's, in virtual time: nobody is vibrated.

use rig::setup::Setup;
use std::path::Path;
use tests::{documents, muprime, texts};

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

fn run(tables: &str, limits: &str, hand: bool) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let (setup_path, plan) = (folder.path().join("setup.toml"), folder.path().join("plan.toml"));
    std::fs::write(&setup_path, setup(tables, limits, hand)).unwrap();
    std::fs::write(&plan, PLAN).unwrap();
    let mut sweep = muprime();
    sweep.args(["--json", "run"]).arg(&plan).arg("--setup").arg(&setup_path).arg("--fast");
    let output = sweep.arg("--out").arg(folder.path().join("run")).output().unwrap();
    let said = documents(&output);
    let summary = said.last().map(|d| d["summary"].clone()).unwrap_or_default();
    assert!(!summary.is_null(), "{:?}", texts(&output));
    summary
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
    // Exposure has hard ranges like every limit.
    for limit in ["exposure_rest_s = 1.0", "exposure_duty_max = 0.9", "exposure_dose_max_m2_s = nan"] {
        let why = refused(&format!("{RELAY}\n{INPUTS}"), limit);
        assert!(why.contains("permitted"), "{limit}: {why}");
    }
}

#[test]
fn a_hand_arms_the_rig_and_without_one_it_does_not_arm() {
    let tables = format!("{RELAY}\n{INPUTS}");
    let summary = run(&tables, "", true);
    assert_eq!(summary["outcome"], "complete", "{summary}");
    assert_eq!(summary["passes"], summary["planned"]);
    let summary = run(&tables, "", false);
    assert_eq!((&summary["outcome"], &summary["blocking"]), (&"would_not_arm".into(), &"dead_man".into()));
    assert_eq!(summary["passes"], 0);
}

#[test]
fn a_sweep_longer_than_its_exposure_is_ended_by_it() {
    let tables = format!("{RELAY}\n{INPUTS}");
    // Passes of 0.3 s vibrate, with pauses between that end no go.
    let summary = run(&tables, "exposure_max_s = 0.7", true);
    assert_eq!(summary["outcome"], "tripped", "{summary}");
    assert!(summary.to_string().contains("exposure"), "{summary}");
}
