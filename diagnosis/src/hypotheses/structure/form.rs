//! What a shape is made of: its form over a covariate, and what it is in proportion to.

use super::axis::ShapeAxis;
use super::scatter_model::Under;
use crate::constants::Constants;
use crate::regression::{COUNT, Kernel, Problem, scale};
use effects::Input;
use nalgebra::{DMatrix, DVector};
use std::f64::consts::PI;
use std::sync::Arc;

/// Where a shape is, in the covariate's scaled unit.
#[derive(Debug, Clone)]
pub(super) enum ShapeForm {
    /// From here on.
    From(f64),
    /// About here, with this deviation.
    About(f64, f64),
    /// Turns from a start, with a phase in turns; `log`: over the covariate whose logarithm the scale is.
    Turns { length: f64, start: f64, phase: f64, log: bool },
    /// Through a resonance here, of this half width, as it shows at a phase: 0 its peak, pi/2 the fall beside.
    Through(f64, f64, f64),
    /// Along from here, in this unit.
    Along(f64, f64),
    /// From 0 to 1 over a range from here on, by a power.
    Over(f64, f64, f64),
    /// Within this of nought.
    Within(f64),
    /// Any function with this correlation length.
    Any(Arc<Kernel>, f64),
}

impl ShapeForm {
    /// Its columns at some places; nothing where there is none.
    pub(super) fn columns(&self, x: &[Option<f64>]) -> DMatrix<f64> {
        let of = |value: &dyn Fn(f64) -> f64| DMatrix::from_fn(x.len(), 1, |i, _| x[i].map_or(0.0, value));
        match self {
            ShapeForm::From(start) => of(&|x| f64::from(u8::from(x >= *start))),
            ShapeForm::About(middle, width) => of(&|x| (-0.5 * ((x - middle) / width).powi(2)).exp()),
            ShapeForm::Turns { length, start, phase, log } => {
                let own = |x: f64| if *log { x.exp() } else { x };
                of(&|x| (2.0 * PI * ((own(x) - start) / length + phase)).sin())
            }
            ShapeForm::Through(middle, width, phase) => {
                let z = |x: f64| (x - middle) / width;
                of(&|x| (phase.cos() + 2.0 * phase.sin() * z(x)) / (1.0 + z(x).powi(2)))
            }
            ShapeForm::Along(from, unit) => of(&|x| (x - from) / unit),
            ShapeForm::Over(low, range, power) => of(&|x| ((x - low) / range).clamp(0.0, 1.0).powf(*power)),
            ShapeForm::Within(reach) => of(&|x| (-x / reach).exp()),
            ShapeForm::Any(kernel, length) => {
                let places: Vec<_> =
                    x.iter().map(|x| on_a_line(x.unwrap_or(f64::INFINITY), *length)).collect();
                kernel.matrix(&places)
            }
        }
    }

    /// A function of any form over some places, by a kernel of this length.
    pub(super) fn any(x: &[f64], length: f64, k: &Constants) -> ShapeForm {
        let places: Vec<_> = x.iter().map(|x| on_a_line(*x, length)).collect();
        ShapeForm::Any(Arc::new(Kernel::new(&places, k.discrepancy_rank, k.kernel_rest)), length)
    }
}

/// A place of a kernel that goes over one covariate.
fn on_a_line(x: f64, length: f64) -> [f64; COUNT] {
    let mut place = [0.0; COUNT];
    place[0] = x / length;
    place
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
#[derive(Debug, Clone)]
pub(super) struct Placement {
    pub(super) axis: ShapeAxis,
    pub(super) form: ShapeForm,
    pub(super) way: Way,
    /// Deviation of its size, in units of the way.
    pub(super) sd: f64,
    /// The scatter under which it fits best.
    pub(super) under: Under,
}

impl Placement {
    /// Its columns at a problem's passes where the baseline predicts this, N, for weights of unit deviation.
    pub(super) fn columns(&self, part: &Problem, u: &[f64], prediction: &DVector<f64>) -> DMatrix<f64> {
        let largest = part.design.largest_amplitude_m;
        let x: Vec<Option<f64>> = part.passes.iter().map(|p| self.axis.of(p, largest)).collect();
        let signal = self.way.signal(part, u, prediction) * self.sd;
        let mut columns = self.form.columns(&x);
        columns.column_iter_mut().for_each(|mut c| c.component_mul_assign(&signal));
        columns
    }
}
