//! What one ridge in plane strain leaves out: several ridges under one finger, and a ridge of finite length.
//!
//! **Several ridges** ([`Patch`]). Ridges far apart in load share the plate's motion and nothing else: each slips by itself (Coulomb's
//! limit is the ridge's, as in the paper), and the tissue that carries them does not move within a cycle. Their pressures differ, because the
//! gross contact is Hertz's or because the ridges are of different heights. The finger's mu' is the mean of theirs by load. That is a mean
//! field: waves from ridge to ridge are left out.
//!
//! **Finite length** ([`plane_stress`]). A ridge as long as it is wide lies between plane strain and plane
//! stress. In the plane both are one problem with other constants, `nu' = nu / (1 + nu)` and `E' = E (1 + 2
//! nu) / (1 + nu)^2` (Timoshenko and Goodier), so the same run gives the other end.

use super::{RidgeCase, RidgeError, RunSettings, run};

/// How the ridges of a finger share its load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Patch {
    /// All alike: the model.
    Alike,
    /// The gross contact's pressure is Hertz's over a circle: from 1.5 times the mean down to nothing.
    Hertz,
    /// Half of the ridges are higher and carry `1 + uneven` times the mean pressure, the others `1 - uneven`; 0 to 1.
    TwoHeights {
        /// How uneven, 0 to 1.
        uneven: f64,
    },
}

impl Patch {
    /// Pressures over the mean one, each with its share of the load.
    pub fn shares(self) -> Vec<(f64, f64)> {
        match self {
            Patch::Alike => vec![(1.0, 1.0)],
            // Share of the load below a pressure u times the greatest: u^3. Gauss' five points in it.
            Patch::Hertz => {
                const GAUSS: [(f64, f64); 5] = [
                    (0.046_910_077_030_668, 0.118_463_442_528_095),
                    (0.230_765_344_947_158, 0.239_314_335_249_683),
                    (0.5, 0.284_444_444_444_444),
                    (0.769_234_655_052_842, 0.239_314_335_249_683),
                    (0.953_089_922_969_332, 0.118_463_442_528_095),
                ];
                GAUSS.iter().map(|(v, weight)| (1.5 * v.cbrt(), *weight)).collect()
            }
            Patch::TwoHeights { uneven } => {
                let ends = [1.0 + uneven, 1.0 - uneven];
                ends.into_iter().filter(|p| *p > 0.0).map(|p| (p, 0.5 * p)).collect()
            }
        }
    }

    /// mu' of a finger of such ridges.
    ///
    /// # Errors
    /// A case that cannot be run.
    pub fn mu_relative(self, case: &RidgeCase, settings: &RunSettings) -> Result<f64, RidgeError> {
        let each = |(pressure, share): (f64, f64)| {
            let ridge = RidgeCase { mean_pressure_pa: pressure * case.mean_pressure_pa, ..*case };
            run(&ridge, settings).map(|found| share * found.mu_relative)
        };
        self.shares().into_iter().map(each).sum()
    }
}

/// The case whose plane strain is this one's plane stress, as to the stratum corneum and Poisson's ratio of all layers.
pub fn plane_stress(case: RidgeCase) -> RidgeCase {
    let nu = case.poisson_ratio;
    RidgeCase {
        poisson_ratio: nu / (1.0 + nu),
        young_modulus_pa: case.young_modulus_pa * (1.0 + 2.0 * nu) / (1.0 + nu).powi(2),
        // The penalty stays what it is in Pa.
        penalty_ratio: case.penalty_ratio * (1.0 + nu).powi(2) / (1.0 + 2.0 * nu),
        ..case
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ridge::Material;

    /// Shares are of one load; Hertz's mean pressure by load is 1.125 of the mean, his greatest 1.5.
    #[test]
    fn shares_are_of_one_load() {
        for patch in [Patch::Alike, Patch::Hertz, Patch::TwoHeights { uneven: 0.5 }] {
            assert!((patch.shares().iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-12, "{patch:?}");
        }
        let mean: f64 = Patch::Hertz.shares().iter().map(|(p, share)| p * share).sum();
        assert!((mean - 1.125).abs() < 2e-3 && Patch::Hertz.shares().iter().all(|s| s.0 < 1.5), "{mean}");
    }

    /// Plane stress: the modulus of an unconfined strip in the plane is E, and that of a confined one E / (1 - nu^2); G is what it was.
    #[test]
    fn plane_stress_has_its_moduli() {
        let strain = RidgeCase::paper();
        let stress = plane_stress(strain);
        let of = |case: &RidgeCase| Material::elastic(case.young_modulus_pa, case.poisson_ratio, 750.0);
        let (a, b) = (of(&strain), of(&stress));
        let confined = b.lambda_pa() + 2.0 * b.shear_modulus_pa();
        assert!((confined / (28.3e6 / (1.0 - 0.33 * 0.33)) - 1.0).abs() < 1e-12);
        assert!((b.shear_modulus_pa() / a.shear_modulus_pa() - 1.0).abs() < 1e-12);
        assert!((stress.penalty_ratio * stress.young_modulus_pa / 93e6 - 1.0).abs() < 1e-12);
    }
}
