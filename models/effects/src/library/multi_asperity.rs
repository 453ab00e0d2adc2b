//! Not one slider but many, of unequal height.

use super::prelude::*;
use crate::contact::asperities::Heights;

pub(super) static EFFECT: Effect = Effect {
    name: "multi_asperity",
    place: Location::Contact,
    summary: "Asperities of unequal height touch for unequal times: no kink at the onset, a tail at large amplitude.",
    source: "roughness scale of 0.5 to 3 um; independent sliders on shares of the springs",
    laws: &[
        Law::new("Gaussian heights", &[Parameter::positive("height_sd", "m", 0.5e-6, 6e-6)]),
        Law::new("exponential heights", &[Parameter::positive("height_scale", "m", 0.5e-6, 6e-6)]),
        Law::new("even heights", &[Parameter::positive("height_sd", "m", 0.5e-6, 6e-6)]),
        Law::new(
            "two heights",
            &[
                Parameter::positive("height_step", "m", 1e-6, 12e-6),
                Parameter::between("lower_share", "1", 0.1, 0.9).bending(),
            ],
        ),
    ],
    needs: &[Need::Vibration, Need::Amplitudes],
    change: |law, theta, _, _, c| {
        c.asperity_height = theta[0];
        c.asperity_heights = match law {
            0 => Heights::Gaussian,
            1 => Heights::Exponential,
            2 => Heights::Even,
            _ => Heights::Two(theta[1]),
        };
    },
    ..Effect::NONE
};
