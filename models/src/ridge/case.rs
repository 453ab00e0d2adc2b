//! One case: a ridge, its tissue, its plate and its loading, with the declared defaults for what the
//! paper leaves open.

use super::{FrictionRule, Material, Plate, RidgeError, RidgeGeometry, RidgeMesh, Strain};
use crate::condition::Condition;
use crate::quantity::PeakToPeak;
use crate::reading::Reading;
use serde::{Deserialize, Serialize};

/// Mean pressure over the fingertip's gross contact at 0.25 N, Pa: Hertz with a radius of 7.5 mm and a
/// reduced modulus of 40 kPa gives 7.4 kPa; 5 to 13 kPa are defensible. See `docs/ridge.md`.
pub const MEAN_PRESSURE_AT_QUARTER_NEWTON_PA: f64 = 7_000.0;

/// Mass damping in 1/s. Table 1's 'Rayleigh damping 1' names no mode and no unit. It is read as
/// mass-proportional, and its size is the one thing set by comparison: with the mean pressure above, 1e6/s puts
/// the rise of the phase shift where the paper has it for moist and for dry skin. `docs/ridge.md` has the study.
pub const MASS_DAMPING_PER_S: f64 = 1e6;

/// Penalty over Young's modulus of the stratum corneum: Table 2's 93 MPa at 28.3 MPa.
pub const PENALTY_RATIO: f64 = 93.0 / 28.3;

/// Elements of the default mesh, about: mu' is within 0.003 of 3000 elements (`docs/ridge.md`).
pub const ELEMENTS: usize = 800;

/// Everything that defines a run of the model.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RidgeCase {
    /// Peak-to-peak vibration amplitude of the plate.
    pub amplitude: PeakToPeak,
    /// Frequency of the vibration in Hz.
    pub frequency_hz: f64,
    /// Sliding speed in m/s.
    pub speed_m_s: f64,
    /// Normal force on the whole finger in N.
    pub normal_force_n: f64,
    /// Coefficient of friction without vibration.
    pub mu0: f64,
    /// Mean pressure of the gross contact in Pa: pressure times ridge width is the ridge's line load.
    pub mean_pressure_pa: f64,
    /// Young's modulus of the stratum corneum in Pa.
    pub young_modulus_pa: f64,
    /// Retardation time of all layers in s, zero for elastic.
    pub retardation_time_s: f64,
    /// Poisson's ratio of all layers.
    pub poisson_ratio: f64,
    /// Contact penalty over the stratum corneum's modulus: a node's spring in Pa (N/m per metre of depth).
    pub penalty_ratio: f64,
    /// Contact penalty along the plate over that across it: 1 in the paper as it reads, which states one k. Above 0, up to 1.
    #[serde(default = "one")]
    pub tangential_penalty_ratio: f64,
    /// A layer between skin and plate that yields along it, in series with the penalty: shear traction over slip in Pa/m. None in
    /// the paper. Unlike the penalty, which is a node's, it is the same contact on every mesh.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tangential_stiffness_pa_m: Option<f64>,
    /// Mass damping in 1/s.
    pub mass_damping_per_s: f64,
    /// Stiffness-proportional damping in s: stress is that of the strain and so much times its rate. 0 by default. It divides the
    /// stable step by its ratio at the mesh's highest frequency: hundreds, where it is critical at the plate's.
    #[serde(default, skip_serializing_if = "crate::quantity::is_zero")]
    pub stiffness_damping_s: f64,
    /// Elements, about.
    pub elements: usize,
    /// Sizes of the ridge.
    pub geometry: RidgeGeometry,
    /// Where Coulomb's limit holds.
    pub friction: FrictionRule,
    /// How strain is measured.
    pub strain: Strain,
}

const fn one() -> f64 {
    1.0
}

/// Mean pressure in Pa over the contact of a whole finger pressed with `normal_force_n`, growing with the
/// cube root of the force as Hertz has it.
pub fn hertz_mean_pressure_pa(normal_force_n: f64) -> f64 {
    MEAN_PRESSURE_AT_QUARTER_NEWTON_PA * (normal_force_n / 0.25).cbrt()
}

impl RidgeCase {
    /// The paper's nominal case (Fig. 9): 2 um peak-to-peak, 27.5 kHz, 20 mm/s, 0.25 N, mu_0 0.5, moist skin.
    pub fn paper() -> Self {
        RidgeCase {
            amplitude: PeakToPeak::from_metres(2e-6),
            frequency_hz: 27_500.0,
            speed_m_s: 0.02,
            normal_force_n: 0.25,
            mu0: 0.5,
            mean_pressure_pa: hertz_mean_pressure_pa(0.25),
            young_modulus_pa: 28.3e6,
            retardation_time_s: 0.0,
            poisson_ratio: 0.33,
            penalty_ratio: PENALTY_RATIO,
            tangential_penalty_ratio: one(),
            tangential_stiffness_pa_m: None,
            mass_damping_per_s: MASS_DAMPING_PER_S,
            stiffness_damping_s: 0.0,
            elements: ELEMENTS,
            geometry: RidgeGeometry::TABLE_1,
            friction: FrictionRule::Global,
            strain: Strain::Objective,
        }
    }

    /// The same with another normal force and the mean pressure that goes with it, as its cube root (Hertz).
    pub fn with_normal_force_n(self, normal_force_n: f64) -> Self {
        let mean_pressure_pa = self.mean_pressure_pa * (normal_force_n / self.normal_force_n).cbrt();
        RidgeCase { normal_force_n, mean_pressure_pa, ..self }
    }

    /// The same with another amplitude, peak-to-peak in m.
    pub fn with_amplitude_pp_m(self, metres: f64) -> Self {
        RidgeCase { amplitude: PeakToPeak::from_metres(metres), ..self }
    }

    /// The same at what the paper calls `w_m`, in m.
    pub fn at_w(self, reading: Reading, w_m: f64) -> Self {
        RidgeCase { amplitude: reading.motion(w_m), ..self }
    }

    /// Line load on the ridge in N per metre of depth.
    pub fn line_load_n_m(&self) -> f64 {
        self.mean_pressure_pa * self.geometry.ridge_width_m
    }

    /// The operating point of the whole finger, as the laws and the spring-slider take it.
    pub fn condition(&self) -> Condition {
        Condition {
            amplitude: self.amplitude,
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            normal_force_n: self.normal_force_n,
            mu0: self.mu0,
            ..Condition::paper()
        }
    }

    /// Newtons on the whole finger for each N/m on the ridge.
    pub fn finger_per_ridge_m(&self) -> f64 {
        self.normal_force_n / self.line_load_n_m()
    }

    /// The three materials, from the surface inwards.
    pub fn materials(&self) -> [Material; 3] {
        [self.young_modulus_pa, 1.5e6, 0.02e6].map(|young_modulus_pa| Material {
            young_modulus_pa,
            poisson_ratio: self.poisson_ratio,
            density_kg_m3: 750.0,
            retardation_time_s: self.retardation_time_s,
        })
    }

    /// The plate that the case's ridge meets. A node far from the tip, which stands for more than four
    /// spacings of it, has no stiffer spring than four.
    ///
    /// # Errors
    /// What [`Plate`] refuses.
    pub fn plate(&self, built: &RidgeMesh) -> Result<Plate, RidgeError> {
        let width = built.mesh.tributary_width_m(0);
        let spring = self.penalty_ratio * self.young_modulus_pa;
        let penalty =
            width[..built.mesh.nx].iter().map(|w| spring * (w / built.tip_spacing_m).min(4.0)).collect();
        let plate =
            Plate::new(penalty, self.friction, self.mu0)?.softer_along(self.tangential_penalty_ratio)?;
        match self.tangential_stiffness_pa_m {
            Some(pa_per_m) => plate.layered(pa_per_m, &width),
            None => Ok(plate),
        }
    }

    /// Refuses what makes no sense, naming the value.
    pub fn check(&self) -> Result<(), RidgeError> {
        let within = |what: &str, value: f64, low: f64, high: f64| {
            RidgeError::unless(value >= low && value <= high, what, value, format!("{low} to {high}"))
        };
        within("amplitude_pp_m", self.amplitude.metres(), 0.0, 50e-6)?;
        within("frequency_hz", self.frequency_hz, 1e3, 1e6)?;
        within("speed_m_s", self.speed_m_s, 0.0, 10.0)?;
        within("normal_force_n", self.normal_force_n, 1e-4, 100.0)?;
        within("mu0", self.mu0, 1e-3, 10.0)?;
        within("mean_pressure_pa", self.mean_pressure_pa, 10.0, 1e6)?;
        within("young_modulus_pa", self.young_modulus_pa, 1e6, 1e11)?;
        within("retardation_time_s", self.retardation_time_s, 0.0, 1e3)?;
        within("penalty_ratio", self.penalty_ratio, 0.1, 1e4)?;
        within("tangential_penalty_ratio", self.tangential_penalty_ratio, 1e-3, 1.0)?;
        within("tangential_stiffness_pa_m", self.tangential_stiffness_pa_m.unwrap_or(1e12), 1e8, 1e20)?;
        within("mass_damping_per_s", self.mass_damping_per_s, 0.0, 1e8)?;
        let damped = if self.retardation_time_s > 0.0 { 0.0 } else { 1e-3 };
        within("stiffness_damping_s (0 where the tissue relaxes)", self.stiffness_damping_s, 0.0, damped)?;
        self.materials().iter().try_for_each(|m| m.check("tissue"))
    }
}
