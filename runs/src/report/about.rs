//! What stands first on a page: when, who, on what, with which rig and which certificates.

use super::human::quantity;
use calibration::certificate::date;
use models::rig_file::RigFile;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// When a run's first session began, by the wall clock; none where its folder does not say.
fn began(folder: &Path) -> Option<String> {
    let file = File::open(folder.join("sessions.jsonl")).ok()?;
    let mut line = String::new();
    BufReader::new(file).read_line(&mut line).ok()?;
    let session: serde_json::Value = serde_json::from_str(&line).ok()?;
    Some(date::format((session["start_unix_ns"].as_u64()? / 1_000_000_000) as i64))
}

/// What is known of a run, in the order in which a reader asks.
pub fn of_run(
    folder: &Path,
    facts: &BTreeMap<String, String>,
    rig: Option<&RigFile>,
) -> Vec<(&'static str, String)> {
    let fact = |name: &str| facts.get(name).cloned();
    let not_stated = |why: &str| format!("not stated ({why})");
    let mut all = vec![
        ("date", began(folder).unwrap_or_else(|| not_stated("the folder has no sessions"))),
        ("operator", fact("operator").unwrap_or_else(|| not_stated("run --operator"))),
        ("sample", fact("sample").unwrap_or_else(|| not_stated("run --sample"))),
    ];
    let protocol = facts.iter().filter_map(|(name, value)| {
        Some(format!("{} {value}", name.strip_prefix("protocol.")?.replace('_', " ")))
    });
    let protocol: Vec<String> = protocol.collect();
    if !protocol.is_empty() {
        all.push(("protocol", protocol.join("; ")));
    }
    let known = [
        ("subject", fact("subject")),
        ("fingertip", fact("fingertip")),
        ("plate", fact("nobody_touches_the_plate")),
        ("contacts not watched", fact("contacts_not_wired")),
        ("if this program dies", fact("if_this_program_dies")),
        ("setup", fact("setup")),
        ("plan", fact("plan").map(|plan| format!("{plan}, seed {}", fact("seed").unwrap_or_default()))),
        ("compared with", fact("model")),
    ];
    all.extend(known.into_iter().filter_map(|(name, value)| Some((name, value?))));
    if fact("clock").as_deref() == Some("virtual") {
        all.push(("time", "virtual: a simulated rig, no instrument was read".into()));
    }
    if let Some(rig) = rig {
        all.extend(of_rig(rig));
    }
    all.extend(fact("muprime_version").map(|version| ("muprime", version)));
    all
}

/// What a rig file states: the finger, the repeatability, the certificates.
pub fn of_rig(rig: &RigFile) -> Vec<(&'static str, String)> {
    let finger = &rig.finger;
    let certificates: Vec<String> = rig.calibration.certificates.values().cloned().collect();
    vec![
        (
            "stiffness",
            format!(
                "normal {}, lateral {}, each within {:.0} % (standard uncertainty)",
                quantity(finger.normal_stiffness_n_per_m, "N/m"),
                quantity(finger.lateral_stiffness_n_per_m, "N/m"),
                100.0 * finger.stiffness_relative_sd
            ),
        ),
        (
            "repeatability",
            format!(
                "{:.1} % of the force and {:.2} mN, as stated",
                100.0 * rig.noise.pass_relative_sd,
                1e3 * rig.noise.force_sd_n
            ),
        ),
        (
            "certificates",
            if certificates.is_empty() {
                "none: scales as the instruments have them".into()
            } else {
                certificates.join(", ")
            },
        ),
    ]
}
