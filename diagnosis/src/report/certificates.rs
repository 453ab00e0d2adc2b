//! What a verdict says of the certificates that rig.toml names beside the table.

use crate::Verdict;
use crate::report::Diagnosis;
use crate::report::pulls::Pull;
use models::RigFile;
use serde::Serialize;

/// A certificate that speaks for an instrument which is blamed nevertheless.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct AtFault {
    /// The leading cause.
    effect: &'static str,
    /// What the certificate bounds, in words.
    quantity: &'static str,
    /// The certificate and its file, in words.
    certificate: String,
    /// Standard uncertainty that it leaves, in the unit of its key in rig.toml.
    stated_sd: f64,
}

impl AtFault {
    /// For a terminal.
    pub fn text(&self) -> String {
        format!(
            "The {} leaves a standard uncertainty of {:.2e} for the {}, and the data exceed it ({}): the certificate \
             is wrong, or something changed since. Calibrate again.",
            self.certificate, self.stated_sd, self.quantity, self.effect
        )
    }
}

/// The certificates at fault: a law that leads the verdict although a certificate bounds it.
pub fn at_fault(result: &Diagnosis, rig: &RigFile) -> Vec<AtFault> {
    if !matches!(result.decision.verdict, Verdict::Named | Verdict::Ambiguous) {
        return Vec::new();
    }
    let leader = &result.fitted.candidates[result.decision.class[0]].best;
    let blamed = leader.members.iter().filter_map(|member| {
        let key = member.form().certified_by?;
        let stated_sd = rig.calibration.sd(key)?;
        let certificate = rig.calibration.certificate_of(key);
        Some(AtFault { effect: member.name(), quantity: key.words(), certificate, stated_sd })
    });
    blamed.collect()
}

/// A certificate whose error a stiffness would have taken up, where a stiffness was pulled off its calibration.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub struct InDoubt {
    /// The certificate and its file, in words.
    certificate: String,
    /// The stiffness that was pulled: `normal_stiffness` or `lateral_stiffness`.
    quantity: &'static str,
    /// How far, in standard deviations.
    pull_sd: f64,
    /// The instrument's error that looks the same.
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

/// The certificates that rig.toml names and that a remarkable pull puts in doubt. They are not blamed: the
/// finger's own calibration may be the wrong one.
pub fn in_doubt(rig: &RigFile, pulls: &[Pull]) -> Vec<InDoubt> {
    let mut doubts = Vec::new();
    for pull in pulls.iter().filter(|p| p.remarkable()) {
        for &imitates in &pull.imitated_by {
            let laws = effects::by_name(imitates).map_or(&[][..], |e| e.laws);
            let Some(key) = laws.iter().find_map(|l| l.acts_as.and(l.certified_by)) else { continue };
            // Only a certificate that is there can be in doubt.
            let named = key.kind().is_some_and(|kind| rig.calibration.certificates.contains_key(&kind));
            if let (true, Some(pull_sd)) = (named, pull.pull_sd) {
                let certificate = rig.calibration.certificate_of(key);
                doubts.push(InDoubt { certificate, quantity: pull.quantity, pull_sd, imitates });
            }
        }
    }
    doubts
}
