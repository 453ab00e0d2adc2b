//! Force: counts of a two-axis sensor to newtons.
//!
//! A dead-weight series ([`series`]) gives the matrix with cross-talk, non-linearity, hysteresis, drift and
//! temperature ([`matrix`]); a certificate of it, verified, gives the [`apply::ForceCalibration`] that the
//! loop uses, together with an explicit [`zero::Zero`]: nothing here tares by itself.

pub mod apply;
pub mod characteristics;
pub mod creep;
pub mod dynamics;
pub mod gravity;
pub mod matrix;
pub mod noise;
pub mod series;
pub mod zero;

/// The two axes in the order of every array here: lateral first.
pub const AXES: [Axis; 2] = [Axis::Lateral, Axis::Normal];

/// An axis of the sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Axis {
    /// Along the stroke, signed in the sensor's frame.
    Lateral = 0,
    /// Normal to the plate, positive in compression.
    Normal = 1,
}

impl std::fmt::Display for Axis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Axis::Lateral => "lateral",
            Axis::Normal => "normal",
        })
    }
}
