//! Attraction between skin and plate adds to the load that friction feels; it is there only as far as the surfaces have
//! been pressed into each other, Fa (1 - exp(-F/F0)), and it grows with a power of the speed, as peeling does.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("attraction_n", 5e-4, 0.2),
        Parameter::log("development_n", 0.01, 0.1),
        Parameter::linear("speed_exponent", 0.1, 0.4),
    ],
    act: Act::Contact(|v, _, contact| {
        contact.limit.adhesion_n = v[0] * (contact.speed_m_s / REFERENCE_M_S).powf(v[2]);
        contact.limit.adhesion_scale_n = v[1];
    }),
    ..DefectKind::cause(DefectSite::Contact, "attraction adds to the load that friction feels")
};

const REFERENCE_M_S: f64 = 0.02;
