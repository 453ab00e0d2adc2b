//! A force against the sliding that no contact makes. A cause that the library does not name.

use super::prelude::*;

const DRAG: Parameter = Parameter::positive("drag", "N", 0.015, 0.5);

pub(super) static EFFECT: Effect = Effect {
    name: "drag",
    place: Location::Instrument,
    summary: "A force against the sliding beside the contact, whatever the load and the vibration.",
    source: "cables, bellows and seals in parallel with the force sensor: some mN to tens of mN; the viscous part of a guide's grease",
    laws: &[
        Law::new("constant", &[DRAG]),
        Law::new("by the speed", &[Parameter::positive("coefficient", "N s/m", 0.15, 10.0)])
            .needs(&[Need::Speeds]),
    ],
    words: Some("a drag beside the contact"),
    read: |law, theta, pass, _, reading| {
        let against = if law == 0 { theta[0] } else { theta[0] * pass.speed_m_s };
        reading.offset_n += pass.direction.sign() * against;
    },
    ..Effect::NONE
};
