//! What a reader must know of a run: when, who, on what, with which rig and which certificates.

use crate::format::quantity;
use crate::run_dir::began;
use models::RigFile;
use std::collections::BTreeMap;
use std::path::Path;

/// What is known of a run, in the order in which a reader asks.
pub fn of_run(
    folder: &Path,
    facts: &BTreeMap<String, String>,
    rig: Option<&RigFile>,
) -> Vec<(&'static str, String)> {
    let fact = |name: &str| facts.get(name).cloned();
    let not_stated = |why: &str| format!("not stated ({why})");
    let mut all = vec![
        ("date", began(folder).ok().flatten().unwrap_or_else(|| not_stated("the folder has no sessions"))),
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
    let (finger, noise) = (&rig.finger, &rig.noise);
    let [normal, lateral] = [finger.normal_stiffness_n_per_m, finger.lateral_stiffness_n_per_m];
    let [normal, lateral] = [normal, lateral].map(|stiffness| quantity(stiffness, "N/m"));
    let within = 100.0 * finger.stiffness_relative_sd;
    let (share, force_mn) = (100.0 * noise.pass_relative_sd, 1e3 * noise.force_sd_n);
    let files: Vec<String> = rig.calibration.certificates.values().cloned().collect();
    let none = files.is_empty().then(|| "none: scales as the instruments have them".to_string());
    vec![
        (
            "stiffness",
            format!("normal {normal}, lateral {lateral}, each within {within:.0} % (standard uncertainty)"),
        ),
        ("repeatability", format!("{share:.1} % of the force and {force_mn:.2} mN, as stated")),
        ("certificates", none.unwrap_or_else(|| files.join(", "))),
    ]
}
