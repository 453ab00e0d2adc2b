//! How the paper's `w` is read, and so at which stroke its law of friction holds.
//!
//! The captions of Figs. 7 and 12 call `w` peak-to-peak. Eqs. 7 and 14, and the remark that `w` must be greater than `h`
//! for contact to be lost, use the amplitude of the sine, which is half of the stroke. So for whoever measures the true stroke the
//! paper's `Psi* = 2.38 +- 0.21` is one of two hypotheses: [`Reading::psi_star`]. docs/ridge.md tells what speaks for which;
//! [`crate::reading_evidence`] weighs them against a rig's own passes.

use crate::psi::{PSI_STAR, PSI_STAR_UNCERTAINTY};
use crate::quantity::PeakToPeak;
use serde::{Deserialize, Serialize};

/// A reading of the paper's `w`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reading {
    /// The plate's whole stroke, as the captions say.
    PeakToPeak,
    /// The sine's amplitude, as the equations have it: the plate moves by twice as much.
    SineAmplitude,
}

impl Reading {
    /// Both.
    pub const ALL: [Reading; 2] = [Reading::PeakToPeak, Reading::SineAmplitude];

    /// Strokes of the plate in the paper's `w` (-).
    pub const fn strokes(self) -> f64 {
        match self {
            Reading::PeakToPeak => 1.0,
            Reading::SineAmplitude => 2.0,
        }
    }

    /// The paper's `Psi*` (-) for a `Psi` of the true stroke, and its standard uncertainty. `Psi` is inverse
    /// in `w`, so the stroke's `Psi` is the paper's divided by [`Reading::strokes`].
    pub const fn psi_star(self) -> (f64, f64) {
        (PSI_STAR / self.strokes(), PSI_STAR_UNCERTAINTY / self.strokes())
    }

    /// The plate's motion where the paper says `w_m`, in m.
    pub fn motion(self, w_m: f64) -> PeakToPeak {
        PeakToPeak::from_metres(self.strokes() * w_m)
    }

    /// What the paper calls `w` where the plate moves so, in m.
    pub fn w_m(self, motion: PeakToPeak) -> f64 {
        motion.metres() / self.strokes()
    }

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Reading::PeakToPeak => "peak-to-peak",
            Reading::SineAmplitude => "sine-amplitude",
        }
    }

    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Reading::PeakToPeak => "w is the whole stroke (Psi* 2.38)",
            Reading::SineAmplitude => "w is the sine's amplitude, half of the stroke (Psi* 1.19)",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::psi::{PsiEq17, relative_friction};

    /// The law at the paper's w and the law at the stroke that this w is are one.
    #[test]
    fn the_law_of_the_stroke_is_the_papers_at_its_w() {
        for reading in Reading::ALL {
            for w_um in [0.5, 1.0, 3.0] {
                let psi = |metres: f64| PsiEq17(0.02 / (metres * 27.5e3 * 0.5 * 1.33));
                let papers = relative_friction(psi(w_um * 1e-6), PSI_STAR);
                let stroke = reading.motion(w_um * 1e-6).metres();
                let ours = relative_friction(psi(stroke), reading.psi_star().0);
                assert!((papers - ours).abs() < 1e-12, "{reading:?} {w_um}");
                assert!((reading.w_m(reading.motion(w_um * 1e-6)) - w_um * 1e-6).abs() < 1e-18);
            }
        }
    }
}
