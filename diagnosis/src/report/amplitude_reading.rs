//! What a table says of `Psi*` and of the two readings of the paper's `w`: [`models::reading_evidence`] on the passes as measured.
//!
//! The verdict does not use it: the baseline is the spring-slider, whatever the scale of the empirical law. A
//! cause that the verdict names moves `Psi*` too, so this finding holds for the passes as measured.

use crate::Verdict;
use crate::data::{RigFile, Table};
use crate::scatter::Scatter;
use models::PassNoise;
use models::reading_evidence::{self, ReadingDecision, ReadingFinding};

/// The finding of a table: suspects left out, with the scatter that the table has and what certificates leave
/// open of amplitude and speed. `None` without a pass with and one without vibration.
pub fn of_table(table: &Table, rig: &RigFile, scatter: &Scatter) -> Option<ReadingFinding> {
    let noise = PassNoise {
        pass_relative_sd: rig.noise.pass_relative_sd * scatter.scale,
        force_sd_n: rig.noise.force_sd_n * scatter.scale,
    };
    let suspect = |row: usize| scatter.suspects.iter().any(|s| s.row == row);
    let passes = table.passes.iter().zip(&table.lateral).enumerate().filter(|(row, _)| !suspect(*row));
    let passes = passes.map(|(_, (c, lateral))| (*c, c.direction.sign() * lateral));
    let scale_sd = models::psi_star::scale_sd(rig);
    reading_evidence::of_passes(passes, rig.finger.poisson_ratio, noise, scale_sd)
}

/// The remark of a finding; none where the passes tell too little.
pub fn remark(finding: Option<&ReadingFinding>, verdict: Verdict) -> Option<String> {
    let finding = finding.filter(|f| f.decision != ReadingDecision::TooLittle)?;
    let as_measured = match verdict {
        Verdict::NoGap => "",
        _ => " These are the passes as measured: the cause of the gap moves Psi* too.",
    };
    Some(format!("Eq. 20 of the paper, {finding}.{as_measured}"))
}
