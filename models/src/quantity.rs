//! Quantities that are too easily confused to be bare numbers.
//!
//! Everything else carries its unit in its name. The vibration amplitude does not get away with that:
//! the paper calls `w` peak-to-peak in its text and uses it as a sine's amplitude in Eq. 14, and the two
//! differ by a factor of two. So it is a type, and it is converted in one place.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Peak-to-peak vibration amplitude `w` of the plate, in metres. The plate moves as `(w/2) sin(2 pi f t)`.
///
/// ```
/// use muprime_models::quantity::PeakToPeak;
/// let w = PeakToPeak::from_metres(2e-6);
/// assert_eq!(w.sine_amplitude_m(), 1e-6);
/// assert_eq!(w.to_string(), "2 \u{b5}m peak-to-peak");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PeakToPeak(f64);

impl PeakToPeak {
    /// No vibration.
    pub const ZERO: PeakToPeak = PeakToPeak(0.0);

    /// From a peak-to-peak value in metres.
    pub const fn from_metres(peak_to_peak_m: f64) -> Self {
        PeakToPeak(peak_to_peak_m)
    }

    /// The peak-to-peak value in metres.
    pub const fn metres(self) -> f64 {
        self.0
    }

    /// The sine's amplitude `a = w/2` in metres: the only place where the factor of two stands.
    pub const fn sine_amplitude_m(self) -> f64 {
        0.5 * self.0
    }

    /// The peak-to-peak value in micrometres, for people.
    pub const fn micrometres(self) -> f64 {
        self.0 * 1e6
    }
}

impl fmt::Display for PeakToPeak {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = format!("{:.3}", self.micrometres());
        write!(f, "{} \u{b5}m peak-to-peak", text.trim_end_matches('0').trim_end_matches('.'))
    }
}

/// The direction of a pass along the stage's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(try_from = "i8", into = "i8")]
pub enum Direction {
    /// Towards increasing position.
    #[default]
    Forward,
    /// Towards decreasing position.
    Backward,
}

impl Direction {
    /// `1.0` or `-1.0`.
    pub const fn sign(self) -> f64 {
        match self {
            Direction::Forward => 1.0,
            Direction::Backward => -1.0,
        }
    }
}

impl From<Direction> for i8 {
    fn from(d: Direction) -> i8 {
        d.sign() as i8
    }
}

impl TryFrom<i8> for Direction {
    type Error = String;
    fn try_from(sign: i8) -> Result<Self, String> {
        match sign {
            1 => Ok(Direction::Forward),
            -1 => Ok(Direction::Backward),
            other => Err(format!("a direction is 1 or -1, not {other}")),
        }
    }
}

/// Whether a number is zero: such a key is left out of a file.
pub(crate) fn is_zero(value: &f64) -> bool {
    *value == 0.0
}
