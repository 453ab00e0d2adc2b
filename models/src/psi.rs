//! The dimensionless group and the empirical law of section 5.2 (Eqs. 16-20).
//!
//! The paper gives the group twice. With `k_l/k_n = G/E = 1/(2(1+nu))`, Eq. 16 equals
//! `U / (2 w f mu_0 (1+nu))`; Eq. 17 drops the 2. They are two quantities here, [`PsiEq16`] and [`PsiEq17`],
//! and only [`PsiEq17`], which the paper's Fig. 12 uses, may enter Eq. 20.

use crate::condition::Condition;
use crate::finger::Finger;

/// `Psi* ` of Eq. 20 as fitted in Fig. 12.
pub const PSI_STAR: f64 = 2.38;
/// The uncertainty that the paper states with it, `2.38 +- 0.21`.
pub const PSI_STAR_UNCERTAINTY: f64 = 0.21;

/// `Psi = k_l U / (k_n w f mu_0)` (Eq. 16), from the springs.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct PsiEq16(pub f64);

/// `Psi = U / (w f mu_0 (1 + nu))` (Eq. 17 and the axis of Fig. 12), from the skin's Poisson ratio.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub struct PsiEq17(pub f64);

impl PsiEq16 {
    /// Eq. 16 at a condition. Infinite without vibration.
    pub fn at(c: &Condition, finger: &Finger) -> Self {
        let normal = finger.normal_stiffness_n_per_m * c.amplitude.metres() * c.frequency_hz * c.mu0;
        PsiEq16(finger.lateral_stiffness_n_per_m * c.speed_m_s / normal)
    }
}

impl PsiEq17 {
    /// Eq. 17 at a condition. Infinite without vibration.
    pub fn at(c: &Condition, poisson_ratio: f64) -> Self {
        PsiEq17(c.speed_m_s / (c.amplitude.metres() * c.frequency_hz * c.mu0 * (1.0 + poisson_ratio)))
    }
}

/// `mu' = 1 - exp(-Psi/Psi*)` (Eq. 20).
pub fn relative_friction(psi: PsiEq17, psi_star: f64) -> f64 {
    -(-psi.0 / psi_star).exp_m1()
}

/// `d mu' / d Psi*` of Eq. 20, for its uncertainty.
pub fn sensitivity_to_psi_star(psi: PsiEq17, psi_star: f64) -> f64 {
    let ratio = psi.0 / psi_star;
    if ratio.is_finite() { -ratio / psi_star * (-ratio).exp() } else { 0.0 }
}

/// Root-mean-square distance of the exponential from the massless spring-slider over `w/h` 4 to 60 and Psi
/// 0.1 to 2 pi. The collapse onto one curve is itself approximate; `tests/paper.rs` recomputes this number.
pub const COLLAPSE_RMSE: f64 = 0.11;

/// Whether Fig. 12's data cover a condition: 0.3 to 5 um (modulus and force series above 1 um only),
/// 10 to 100 kHz, 5 to 100 mm/s, `mu_0` 0.1 to 2 and 0.1 to 1 N.
pub fn within_fitted_range(c: &Condition) -> bool {
    let inside = |v: f64, lo: f64, hi: f64| v >= lo * 0.999 && v <= hi * 1.001;
    inside(c.amplitude.metres(), 1e-6, 5e-6)
        && inside(c.frequency_hz, 10e3, 100e3)
        && inside(c.speed_m_s, 5e-3, 0.1)
        && inside(c.mu0, 0.1, 2.0)
        && inside(c.normal_force_n, 0.1, 1.0)
}
