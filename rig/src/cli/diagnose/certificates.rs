//! What a verdict says of the certificates that stand beside the table in rig.toml.

use diagnosis::data::Rig;
use diagnosis::pulls::Pull;
use serde::Serialize;
use std::path::Path;

/// A certificate that speaks for an instrument which is blamed nevertheless.
#[derive(Debug, Serialize)]
pub struct AtFault {
    effect: String,
    certificate: String,
    stated_sd: f64,
}

impl AtFault {
    /// For a terminal.
    pub fn text(&self) -> String {
        format!(
            "The {} leaves a standard uncertainty of {:.2e} for {}, and the data want it beyond: it is at fault, or \
             something changed since. Calibrate again.",
            self.certificate, self.stated_sd, self.effect
        )
    }
}

/// The certificates at fault: an effect that leads the verdict although one bounds it.
pub fn at_fault(rig: &Rig, path: &Path, report: &serde_json::Value) -> Vec<AtFault> {
    if !matches!(report["verdict"].as_str(), Some("named" | "ambiguous")) {
        return Vec::new();
    }
    let effects = report["hypotheses"][0]["effects"].as_array().cloned().unwrap_or_default();
    effects
        .iter()
        .filter_map(|e| e.as_str())
        .filter_map(|effect| {
            let stated_sd = rig.certified_sd(effect, 0)?;
            let kind = if effect == "amplitude_miscalibration" { "amplitude" } else { "force" };
            let certificate = match file(path, kind) {
                Some(name) => format!("{kind} certificate ({name})"),
                None => format!("{kind} certificate"),
            };
            Some(AtFault { effect: effect.into(), certificate, stated_sd })
        })
        .collect()
}

/// A certificate whose error a stiffness would have taken up, where a stiffness was pulled off its calibration.
#[derive(Debug, Serialize)]
pub struct InDoubt {
    certificate: String,
    quantity: &'static str,
    pull_sd: f64,
    imitates: &'static str,
}

impl InDoubt {
    /// For a terminal.
    pub fn text(&self) -> String {
        format!(
            "The {} is in doubt: an error of its scale ({}) would pull the {} off its calibration as this table does \
             ({:+.1} standard deviations).",
            self.certificate,
            self.imitates,
            self.quantity.replace('_', " "),
            self.pull_sd
        )
    }
}

/// The certificates that rig.toml names and that a remarkable pull puts in doubt. They are not blamed: the finger's own
/// calibration may be the wrong one.
pub fn in_doubt(path: &Path, pulls: &[Pull]) -> Vec<InDoubt> {
    let mut doubts = Vec::new();
    for pull in pulls.iter().filter(|p| p.remarkable()) {
        for &imitates in pull.imitated_by {
            let kind = match imitates {
                "amplitude_miscalibration" => "amplitude",
                "normal_gain" | "lateral_gain" => "force",
                _ => continue,
            };
            let (Some(name), Some(pull_sd)) = (file(path, kind), pull.pull_sd) else { continue };
            let certificate = format!("{kind} certificate ({name})");
            doubts.push(InDoubt { certificate, quantity: pull.quantity, pull_sd, imitates });
        }
    }
    doubts
}

/// File name of the certificate of a kind, as rig.toml states it.
fn file(path: &Path, kind: &str) -> Option<String> {
    let text = crate::input::text_of(path).ok()?;
    let stated: toml::Table = toml::from_str(&text).ok()?;
    let name = stated.get("calibration")?.get("certificates")?.get(kind)?.as_str()?;
    Some(name.to_string())
}
