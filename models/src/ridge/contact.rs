//! The rigid plate: penalty contact with Coulomb friction on the surface row.
//!
//! Where the surface is below the plate, a spring of the node pushes it back; along the plate a second spring
//! of the same stiffness, or a softer one, stretches with the sliding until Coulomb's limit. Out of contact
//! the stretch is forgotten at once. The springs are free of inertia.

use super::RidgeError;
use super::kernel::Surface;
use serde::{Deserialize, Serialize};

/// Where Coulomb's limit holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FrictionRule {
    /// For the whole ridge, as in the paper: a finely rough surface.
    Global,
    /// At each node by itself.
    Local,
}

/// Forces between plate and surface in one step, N per metre of depth.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactForce {
    /// Normal force, on the skin upwards, never negative.
    pub normal: f64,
    /// Lateral force on the skin along the plate's motion.
    pub lateral: f64,
    /// Power given to the skin in W per metre.
    pub power: f64,
    /// Nodes in contact.
    pub nodes: usize,
}

/// A rigid plate under the surface row.
#[derive(Clone, Debug)]
pub struct Plate {
    /// Springs of the surface nodes, N/m per metre of depth.
    pub penalty: Vec<f64>,
    /// The same along the plate.
    pub along: Vec<f64>,
    stretch: Vec<f64>,
    /// Normal force on each surface node in the last step, N per metre of depth.
    pub load: Vec<f64>,
    rule: FrictionRule,
    mu0: f64,
}

impl Plate {
    /// `penalty`: spring of each surface node, N/m per metre of depth (zero: the node never touches).
    pub fn new(penalty: Vec<f64>, rule: FrictionRule, mu0: f64) -> Result<Plate, RidgeError> {
        RidgeError::unless((0.0..=10.0).contains(&mu0), "coefficient of friction", mu0, "0 to 10")?;
        let sound = |k: f64| k >= 0.0 && k.is_finite();
        penalty
            .iter()
            .try_for_each(|k| RidgeError::unless(sound(*k), "contact penalty in Pa", *k, "0 or above"))?;
        let n = penalty.len();
        let along = penalty.clone();
        Ok(Plate { penalty, along, stretch: vec![0.0; n], load: vec![0.0; n], rule, mu0 })
    }

    /// The same with springs along the plate that are softer than those across it by `ratio`, above 0 and up
    /// to 1.
    pub fn softer_along(self, ratio: f64) -> Result<Plate, RidgeError> {
        let possible = ratio > 0.0 && ratio <= 1.0;
        RidgeError::unless(possible, "tangential penalty ratio", ratio, "above 0, up to 1")?;
        let along = self.penalty.iter().map(|k| k * ratio).collect();
        Ok(Plate { along, ..self })
    }

    /// The same with a layer on the plate, in series with the springs along it: of shear traction over slip
    /// `pa_per_m` (Pa/m, above 0), at nodes that stand for `width_m` each. Unlike a node's spring it is the
    /// same contact on every mesh.
    pub fn layered(self, pa_per_m: f64, width_m: &[f64]) -> Result<Plate, RidgeError> {
        let possible = pa_per_m > 0.0 && pa_per_m.is_finite() && width_m.len() >= self.along.len();
        let range = "above 0 and finite, with a width for each node";
        RidgeError::unless(possible, "tangential stiffness in Pa/m", pa_per_m, range)?;
        let series =
            |(k, w): (&f64, &f64)| if *k > 0.0 { 1.0 / (1.0 / k + 1.0 / (pa_per_m * w)) } else { 0.0 };
        let along = self.along.iter().zip(width_m).map(series).collect();
        Ok(Plate { along, ..self })
    }

    /// Presses and drags the surface: the plate stands at `height` (m) and moves along +x at `speed` (m/s).
    #[inline]
    pub fn touch(&mut self, surface: &mut Surface<'_>, height: f64, speed: f64) -> ContactForce {
        let half = 0.5 * surface.dt;
        let mut sum = ContactForce::default();
        for (i, k) in self.penalty.iter().enumerate() {
            let depth = height - (surface.y[i] + half * surface.vy[i]);
            if depth > 0.0 && *k > 0.0 {
                let load = k * depth;
                let limit = self.mu0 * load;
                let along = self.along[i];
                let mut stretch = self.stretch[i] + (speed - surface.vx[i]) * surface.dt;
                if self.rule == FrictionRule::Local {
                    stretch = stretch.clamp(-limit / along, limit / along);
                }
                self.stretch[i] = stretch;
                self.load[i] = load;
                sum.normal += load;
                sum.lateral += along * stretch;
                sum.nodes += 1;
            } else {
                self.stretch[i] = 0.0;
                self.load[i] = 0.0;
            }
        }
        if sum.nodes == 0 {
            return sum;
        }
        let limit = self.mu0 * sum.normal;
        if self.rule == FrictionRule::Global && sum.lateral.abs() > limit {
            // Slip: all springs give way alike.
            let share = limit / sum.lateral.abs();
            self.stretch.iter_mut().for_each(|s| *s *= share);
            sum.lateral *= share;
        }
        for (i, along) in self.along.iter().enumerate() {
            if self.load[i] > 0.0 {
                let pull = along * self.stretch[i];
                surface.fx[i] -= pull;
                surface.fy[i] -= self.load[i];
                sum.power += pull * surface.vx[i] + self.load[i] * surface.vy[i];
            }
        }
        sum
    }
}
