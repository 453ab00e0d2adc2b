//! What a shape is made of: its form over a covariate, and what it is in proportion to.

use crate::discrepancy::scale;
use crate::fit::Problem;
use effects::Input;
use nalgebra::DVector;
use std::f64::consts::PI;

/// Where a shape is, in the covariate's scaled unit.
#[derive(Debug, Clone, Copy)]
pub(super) enum Form {
    /// From here on.
    From(f64),
    /// About here, with this deviation.
    About(f64, f64),
    /// Turns per unit from a start, with a phase in turns.
    Turns(f64, f64, f64),
}

impl Form {
    /// Its value at a place.
    pub(super) fn at(self, x: f64) -> f64 {
        match self {
            Form::From(start) => f64::from(u8::from(x >= start)),
            Form::About(middle, width) => (-0.5 * ((x - middle) / width).powi(2)).exp(),
            Form::Turns(per_unit, start, phase) => (2.0 * PI * (per_unit * (x - start) + phase)).sin(),
        }
    }
}

/// What a shape is in proportion to.
#[derive(Debug, Clone, Copy)]
pub(super) enum Way {
    /// What a change of this input does, times this.
    Input(Input, f64),
    /// The root of friction and full friction.
    Friction,
    /// The same in every reading, N.
    Reading(f64),
}

impl Way {
    /// Its size at a problem's passes where the baseline predicts this, N.
    pub(super) fn signal(self, part: &Problem, u: &[f64], prediction: &DVector<f64>) -> DVector<f64> {
        match self {
            Way::Input(input, scale) => part.sensitivity(&[], u, prediction, input) * scale,
            Way::Friction => DVector::from_fn(part.len(), |i, _| {
                let full = part.nominal.mu0 * part.passes[i].normal_force_n;
                part.passes[i].direction.sign() * scale(prediction[i], full)
            }),
            Way::Reading(size) => DVector::from_element(part.len(), size),
        }
    }
}

/// Where the best of a shape's places is, and under which scatter.
#[derive(Debug, Clone, Copy)]
pub(super) struct Placement {
    pub(super) form: Form,
    pub(super) way: Way,
    /// Deviation of its size, in units of the way.
    pub(super) sd: f64,
    /// Scale of independent scatter, and how many columns of what lasts it stands for; none as settled.
    pub(super) alone: Option<(f64, usize)>,
}
