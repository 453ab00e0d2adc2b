//! The plate's amplitude is not the same everywhere.

use super::prelude::*;
use libm::j0;
use std::f64::consts::PI;

const CHECK: &str = "Scan the plate with a vibrometer along the stroke.";

/// Least square of the amplitude at a node over that at an antinode: a finger is wider than a node.
const LEAST_SQUARE: f64 = 4e-4;

pub(super) static EFFECT: Effect = Effect {
    name: "mode_shape",
    place: Location::Plate,
    summary: "Nodes and antinodes: the amplitude depends on where on the plate the finger is.",
    source: "flexural half-wave of 6 to 14 mm for 1 to 2 mm plates at 25 to 60 kHz; away from its edge a round plate moves as J0 of the radius",
    laws: &[
        Law::new(
            "standing wave",
            &[
                Parameter::positive("depth", "1", 0.5, 1.0),
                Parameter::between("node_spacing_at_reference", "m", 0.004, 0.03),
                Parameter::between("phase", "1", -0.25, 1.25),
                // Flexural waves shorten as the root of the frequency; a plate that is driven at one mode's
                // does not.
                Parameter::between("frequency_exponent", "1", 0.0, 1.0).bending(),
                // At one half the root of a sum of squares, of what stands and what travels.
                Parameter::shape("sharpness", "1", 0.5, 0.5).bending(),
                // The amplitude was calibrated at one place, which need not be an antinode.
                Parameter::signed("antinode_over_calibrated_e_folds", "1", 0.3, -1.0, 1.0).bending(),
                // Waves of all frequencies are in step at an edge of the plate, which need not be where
                // positions are counted from.
                Parameter::signed("edge_to_origin_over_node_spacing", "1", 1.0, -4.0, 4.0).bending(),
            ],
        )
        .seen_by(CHECK, 0.03),
        Law::new(
            "one antinode",
            &[
                Parameter::positive("fall_per_square", "1/m^2", 800.0, 4e4),
                Parameter::between("centre_over_stroke", "1", -1.0, 2.0),
            ],
        )
        .seen_by(CHECK, 130.0),
        Law::new(
            "rings of a disc",
            &[
                Parameter::positive("depth", "1", 0.5, 1.0),
                Parameter::between("ring_spacing_at_reference", "m", 0.004, 0.03),
                Parameter::between("centre_over_stroke", "1", -1.0, 2.0),
                Parameter::between("frequency_exponent", "1", 0.0, 1.0).bending(),
                Parameter::signed("centre_over_calibrated_e_folds", "1", 0.3, -1.0, 1.0).bending(),
            ],
        )
        .seen_by(CHECK, 0.03),
        Law::new(
            "gradient",
            &[
                Parameter::signed("gradient", "1/m", 10.0, -60.0, 60.0),
                // A near field dies away from an edge or a clamp.
                Parameter::signed("curvature_over_gradient", "1", 0.7, -3.0, 3.0).bending(),
            ],
        )
        .seen_by(CHECK, 1.0),
    ],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::POSITION, &covariate::FREQUENCY] }),
    needs: &[Need::Vibration, Need::Positions],
    change: |law, theta, pass, design, c| {
        let x = pass.position_m;
        c.amplitude_pp *= match law {
            0 => {
                let shorter = (pass.frequency_hz / design.reference_frequency_hz).powf(theta[3]);
                let s = (PI * (x * shorter / theta[1] + theta[2] + theta[6] * (shorter - 1.0))).sin();
                // Depth one is |cos|; the mean over a stroke through nodes is shallower.
                let depth = theta[0].min(1.0);
                (1.0 - depth * s * s).max(LEAST_SQUARE).powf(theta[4]) * (depth * theta[5]).exp()
            }
            1 => 1.0 / (1.0 + theta[0] * (x - theta[1] * design.stroke_m).powi(2)),
            2 => {
                let shorter = (pass.frequency_hz / design.reference_frequency_hz).powf(theta[3]);
                let ring = j0(PI * (x - theta[2] * design.stroke_m) * shorter / theta[1]);
                let depth = theta[0].min(1.0);
                (1.0 - depth * (1.0 - ring * ring)).max(LEAST_SQUARE).sqrt() * (depth * theta[4]).exp()
            }
            _ => {
                let half = (0.5 * design.stroke_m).max(1e-9);
                let x = x - half;
                (theta[0] * (x + theta[1] * (x * x / half - half / 3.0))).clamp(-2.0, 2.0).exp()
            }
        };
    },
    ..Effect::NONE
};
