//! How the paper's w is read. The captions of Figs. 7 and 12 say peak-to-peak; Eqs. 7 and 14, and 'w must be greater than h', use the
//! amplitude of the sine, which is half of that. Figures are recomputed under both: see docs/ridge.md.

use clap::ValueEnum;
use models::quantity::PeakToPeak;
use models::ridge::RidgeCase;

/// A reading of w.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Reading {
    /// The plate's whole stroke, as the captions say.
    PeakToPeak,
    /// The sine's amplitude, as the equations have it: the plate moves by twice as much.
    SineAmplitude,
}

impl Reading {
    /// Both.
    pub const ALL: [Reading; 2] = [Reading::PeakToPeak, Reading::SineAmplitude];

    const fn strokes(self) -> f64 {
        match self {
            Reading::PeakToPeak => 1.0,
            Reading::SineAmplitude => 2.0,
        }
    }

    /// The plate's motion where the paper says `w_m`, in m.
    pub fn motion(self, w_m: f64) -> PeakToPeak {
        PeakToPeak::from_metres(self.strokes() * w_m)
    }

    /// What the paper calls w where the plate moves so, in m.
    pub fn w_m(self, motion: PeakToPeak) -> f64 {
        motion.metres() / self.strokes()
    }

    /// The same case at what the paper calls `w_m`, in m.
    pub fn at(self, case: RidgeCase, w_m: f64) -> RidgeCase {
        case.with_amplitude_pp_m(self.motion(w_m).metres())
    }

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Reading::PeakToPeak => "peak-to-peak",
            Reading::SineAmplitude => "sine-amplitude",
        }
    }

    /// A file's name under this reading.
    pub fn file(self, name: &str) -> String {
        match self {
            Reading::PeakToPeak => name.into(),
            Reading::SineAmplitude => format!("{name}_sine_amplitude"),
        }
    }

    /// The column that holds w, in um.
    pub const fn column(self) -> &'static str {
        match self {
            Reading::PeakToPeak => "amplitude_pp_um",
            Reading::SineAmplitude => "sine_amplitude_um",
        }
    }
}
