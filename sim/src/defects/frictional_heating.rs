//! Rubbing warms the interface and lowers its shear strength: friction falls with the power rubbed, mu F U,
//! found where heat made and friction left agree.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("inverse_power_per_w", 1.0, 400.0)],
    in_library: false,
    act: Act::Contact(|v, _, contact| {
        // mu = mu0 / (1 + mu F U / P): the positive root.
        let q = v[0] * contact.normal_force_n * contact.speed_m_s;
        let mu0 = contact.friction;
        contact.friction = if q * mu0 < 1e-9 { mu0 } else { ((1.0 + 4.0 * q * mu0).sqrt() - 1.0) / (2.0 * q) };
    }),
    ..DefectKind::cause(DefectSite::Contact, "friction falls with the power that it dissipates")
};
