//! The lateral channel of the force sensor feels the normal force, or the other way round.

use super::prelude::*;

const CHECK: &str =
    "Press on the sensor with a dead weight and no motion, plate levelled; read the lateral axis.";

pub(super) static EFFECT: Effect = Effect {
    name: "force_crosstalk",
    place: Location::Instrument,
    summary: "A share of the normal force is read as lateral force, the same in both directions (or the reverse).",
    source: "cross-talk of 0.3 to 13 % of uncalibrated multi-axis cells",
    laws: &[
        Law::new(
            "normal into lateral",
            &[Parameter::signed("crosstalk", "1", 0.03, -0.3, 0.3), ALONG, LOADED, LATER],
        )
        .certified_by(CertifiedKey::Crosstalk)
        .same_as("plate_tilt", "rotation")
        .seen_by(CHECK, 0.001),
        Law::new("lateral into normal", &[Parameter::signed("crosstalk", "1", 0.08, -0.5, 0.5)])
            .certified_by(CertifiedKey::CrosstalkOntoNormal)
            .seen_by(
                "Pull along the plate with a known force and without load; read the normal axis.",
                0.001,
            ),
    ],
    departs_by: 0.05,
    acts: Some(Acts { on: Input::Crosstalk, over: &[&covariate::NORMAL_FORCE, &covariate::POSITION] }),
    needs: &[Need::Directions],
    change: |law, theta, pass, _, c| {
        if law == 1 {
            super::plate_tilt::unload(c, pass.direction.sign(), -theta[0]);
        }
    },
    read: |law, theta, pass, design, reading| {
        if law == 0 {
            reading.crosstalk += bent(theta, pass, design);
        }
    },
    ..Effect::NONE
};
