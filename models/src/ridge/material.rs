//! Linear isotropic tissue in plane strain, elastic or with one retardation time.

use super::RidgeError;
use serde::{Deserialize, Serialize};

/// One layer's material: Table 1 of the paper gives the values for skin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Material {
    /// Young's modulus in Pa, above zero. With a retardation time this is the relaxed (slow) modulus.
    pub young_modulus_pa: f64,
    /// Poisson's ratio, within 0 to 0.49 (one-point quads would lock no further, but the step would vanish).
    pub poisson_ratio: f64,
    /// Density in kg/m3, above zero.
    pub density_kg_m3: f64,
    /// Retardation time in s; zero is elastic. See [`Material::arm`].
    pub retardation_time_s: f64,
}

/// The Maxwell arm beside the elastic spring of a standard linear solid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm {
    /// Modulus of the arm over the relaxed modulus.
    pub ratio: f64,
    /// Relaxation time of the arm in s.
    pub relaxation_time_s: f64,
}

impl Material {
    /// Ratio of the arm's modulus to the relaxed one: at once the tissue is (1 + ratio) times as stiff as
    /// after a long time. Table 1 names one retardation time and no second modulus, so equal springs are
    /// assumed. (A pure Kelvin-Voigt solid is the limit of an infinite ratio; its explicit step vanishes.)
    pub const ARM_RATIO: f64 = 1.0;

    /// An elastic material.
    pub const fn elastic(young_modulus_pa: f64, poisson_ratio: f64, density_kg_m3: f64) -> Self {
        Material { young_modulus_pa, poisson_ratio, density_kg_m3, retardation_time_s: 0.0 }
    }

    /// Refuses what no material can be, naming the value.
    pub fn check(&self, what: &str) -> Result<(), RidgeError> {
        let unless = |ok: bool, name: &str, value: f64, range: &str| {
            RidgeError::unless(ok, format!("{name} of the {what}"), value, range)
        };
        let (modulus, nu) = (self.young_modulus_pa, self.poisson_ratio);
        unless(modulus > 0.0 && modulus < 1e12, "Young's modulus in Pa", modulus, "above 0 and below 1e12")?;
        unless((0.0..=0.49).contains(&nu), "Poisson's ratio", nu, "0 to 0.49")?;
        let (density, time) = (self.density_kg_m3, self.retardation_time_s);
        unless(density > 0.0 && density < 1e5, "density in kg/m3", density, "above 0 and below 1e5")?;
        unless(time >= 0.0 && time.is_finite(), "retardation time in s", time, "0 (elastic) or above")
    }

    /// Lamé's first parameter in Pa (relaxed).
    pub fn lambda_pa(&self) -> f64 {
        let nu = self.poisson_ratio;
        self.young_modulus_pa * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    }

    /// Shear modulus in Pa (relaxed): E / 2(1 + nu), as in Table 1.
    pub fn shear_modulus_pa(&self) -> f64 {
        self.young_modulus_pa / (2.0 * (1.0 + self.poisson_ratio))
    }

    /// The viscous arm, none if elastic. The retardation time of a standard linear solid is its relaxation
    /// time times (1 + ratio).
    pub fn arm(&self) -> Option<Arm> {
        (self.retardation_time_s > 0.0).then(|| Arm {
            ratio: Self::ARM_RATIO,
            relaxation_time_s: self.retardation_time_s / (1.0 + Self::ARM_RATIO),
        })
    }

    /// Modulus of a laterally confined compression, lambda + 2 G, in Pa, as a fast wave feels it.
    pub fn fast_p_modulus_pa(&self) -> f64 {
        let arm = self.arm().map_or(0.0, |a| a.ratio);
        (1.0 + arm) * (self.lambda_pa() + 2.0 * self.shear_modulus_pa())
    }

    /// Speed of a pressure wave in m/s.
    pub fn wave_speed_m_s(&self) -> f64 {
        (self.fast_p_modulus_pa() / self.density_kg_m3).sqrt()
    }
}
