//! A table of ridge results, interpolated in well under a microsecond: the finite element model for the loop.
//!
//! What matters is w, f, F_n, E_sc and U/mu_0: speed and friction enter the model only through their ratio
//! (within 0.03 of mu', checked in `docs/ridge.md`). The amplitudes of a column start where contact begins to
//! be lost, so they move with f and F_n. `muprime model table --surrogate` computes the file; it carries
//! the hash of its inputs and the interpolation error found on cases that are not in it.

mod file;
mod grid;
mod spline;

pub use file::{TableError, TableResult};
pub use grid::{GridAxis, GridPoint, SurrogateGrid};

use crate::condition::{Condition, OutOfDomain};
use crate::finger::Finger;
use crate::prediction::{FrictionModel, Prediction, Regime, Validity};
use crate::quantity::PeakToPeak;

/// The text of the table that ships with the project, as [`Surrogate::shipped`] reads it: what its hash is
/// taken of.
pub const DEFAULT_TABLE: &str = include_str!("../data/ridge_table.txt");

/// Error of the interpolation against the finite element model on held-out cases.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InterpolationError {
    /// Root mean square in mu'.
    pub mu_rms: f64,
    /// Greatest in mu'.
    pub mu_max: f64,
    /// Root mean square in the phase shift where contact is lost, degrees.
    pub phase_rms_deg: f64,
    /// Held-out cases.
    pub cases: usize,
}

/// What the surrogate says of a condition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurrogatePoint {
    /// Relative friction, 0 to 1.
    pub mu_relative: f64,
    /// Phase shift of Eq. 1 at rest, degrees.
    pub phase_shift_deg: f64,
    /// Share of the cycle in contact.
    pub contact_fraction: f64,
    /// Whether the condition is within the table.
    pub inside: bool,
    /// Whether it is, whatever the speed: phase and contact are those at rest.
    pub inside_at_rest: bool,
}

/// The interpolated table.
#[derive(Clone, Debug)]
pub struct Surrogate {
    /// The axes of the table.
    pub grid: SurrogateGrid,
    /// Refined once with monotone cubics along every axis, then read linearly.
    mu: spline::Dense,
    phase: spline::Dense,
    contact: spline::Dense,
    /// Error on held-out cases.
    pub error: InterpolationError,
    /// Hash of what the table was computed from.
    pub inputs_hash: String,
    young_modulus_pa: f64,
}

impl Surrogate {
    /// The table that ships with the project, for the paper's moist skin.
    ///
    /// # Errors
    /// Never for the shipped table (a test reads it); the file's own defects otherwise.
    pub fn shipped() -> Result<Surrogate, TableError> {
        Surrogate::from_text(DEFAULT_TABLE)
    }

    /// The same for a finger whose stratum corneum has this modulus.
    pub fn with_young_modulus_pa(self, young_modulus_pa: f64) -> Self {
        Surrogate { young_modulus_pa, ..self }
    }

    /// The same for a finger, if its modulus is known.
    pub fn for_finger(self, finger: &Finger) -> Self {
        let young_modulus_pa = finger.young_modulus_pa.unwrap_or(self.young_modulus_pa);
        self.with_young_modulus_pa(young_modulus_pa)
    }

    /// Friction and phase at amplitude, frequency, speed over mu_0, force and modulus. Allocates nothing.
    #[inline]
    pub fn at(
        &self,
        amplitude: PeakToPeak,
        frequency_hz: f64,
        speed_over_mu0_m_s: f64,
        normal_force_n: f64,
        young_modulus_pa: f64,
    ) -> SurrogatePoint {
        let g = &self.grid;
        let w = amplitude.metres();
        let (first, last) = g.amplitude_range_m(frequency_hz, normal_force_n);
        let e = g.young_modulus_pa.place(young_modulus_pa);
        let force = g.normal_force_n.place(normal_force_n);
        let f = g.frequency_hz.place(frequency_hz);
        let s = g.speed_over_mu0_m_s.place(speed_over_mu0_m_s);
        let column = (w.max(first) / first).ln() / (last / first).ln();
        let within = |places: &[f64]| places.iter().all(|p| *p > -1e-9 && *p < 1.0 + 1e-9);
        let inside_at_rest = within(&[e, force, f, column]);
        let inside = inside_at_rest && within(&[s]);
        let mut mu = self.mu.at([e, force, f, s, column]);
        let phase = self.phase.at([e, force, f, 0.0, column]);
        let mut contact = self.contact.at([e, force, f, 0.0, column]);
        if w < first {
            // Below the first amplitude friction and contact fall from one linearly: the force's ripple grows
            // so.
            let share = w / first;
            mu = 1.0 - share * (1.0 - mu);
            contact = 1.0 - share * (1.0 - contact);
        }
        if s < 0.0 && w >= first {
            // Without slip the lateral force grows with the speed.
            mu *= speed_over_mu0_m_s / g.speed_over_mu0_m_s.low;
        }
        SurrogatePoint {
            mu_relative: mu.clamp(0.0, 1.0),
            phase_shift_deg: phase,
            contact_fraction: contact.clamp(0.0, 1.0),
            inside,
            inside_at_rest,
        }
    }
}

impl FrictionModel for Surrogate {
    fn name(&self) -> &str {
        "surrogate"
    }

    fn predict(&self, condition: &Condition) -> Result<Prediction, OutOfDomain> {
        condition.check()?;
        let c = condition;
        let speed = c.speed_m_s / c.mu0;
        let point = self.at(c.amplitude, c.frequency_hz, speed, c.normal_force_n, self.young_modulus_pa);
        let still = c.amplitude.metres() == 0.0;
        let mu_relative = if still { 1.0 } else { point.mu_relative };
        let sd = if still { 0.0 } else { self.error.mu_rms.hypot(MESH_ERROR) };
        Ok(Prediction {
            mu_relative,
            // Outside the table the error is not known; four times the inner one is a caution, not a measure.
            mu_relative_sd: if point.inside { sd } else { 4.0 * sd },
            lateral_force_n: mu_relative * c.mu0 * c.normal_force_n,
            regime: match point.contact_fraction {
                f if still || f > 0.999 => Regime::FullContact,
                _ if mu_relative > 0.998 => Regime::FullSlip,
                _ => Regime::Intermittent,
            },
            validity: if point.inside { Validity::Inside } else { Validity::Extrapolated },
        })
    }

    fn form_sd(&self, of: &Prediction) -> f64 {
        of.mu_relative_sd
    }
}

/// Error in mu' of the table's coarse mesh against a fine one (`docs/ridge.md`, convergence).
pub const MESH_ERROR: f64 = 0.01;
