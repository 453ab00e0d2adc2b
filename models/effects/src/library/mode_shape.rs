//! The plate's amplitude is not the same everywhere.

use super::prelude::*;
use std::f64::consts::PI;

/// See the module.
pub struct ModeShape;

/// What sees it without friction.
const CHECK: &str = "Scan the plate with a vibrometer along the stroke.";

static LAWS: [Law; 4] = [
    Law::new(
        "standing wave",
        &[
            Parameter::positive("depth", "1", 0.5, 1.0),
            Parameter::between("node_spacing", "m", 0.004, 0.03),
            Parameter::between("phase", "1", -0.25, 1.25),
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
    Law::new("gradient", &[Parameter::signed("gradient", "1/m", 10.0, -60.0, 60.0)]).seen_by(CHECK, 1.0),
    // Flexural waves shorten as the root of the frequency.
    Law::new(
        "standing wave, shorter at higher frequency",
        &[
            Parameter::positive("depth", "1", 0.5, 1.0),
            Parameter::between("node_spacing_at_reference", "m", 0.004, 0.03),
            Parameter::between("phase", "1", -0.25, 1.25),
        ],
    )
    .needs(&[Need::Frequencies])
    .seen_by(CHECK, 0.03),
];

impl Effect for ModeShape {
    fn name(&self) -> &'static str {
        "mode_shape"
    }
    fn place(&self) -> Place {
        Place::Plate
    }
    fn summary(&self) -> &'static str {
        "Nodes and antinodes: the amplitude depends on where on the plate the finger is."
    }
    fn source(&self) -> &'static str {
        "flexural half-wave of 6 to 14 mm for 1 to 2 mm plates at 25 to 60 kHz"
    }
    fn laws(&self) -> &'static [Law] {
        &LAWS
    }
    fn needs(&self) -> &'static [Need] {
        &[Need::Vibration, Need::Positions]
    }
    fn change(&self, law: usize, theta: &[f64], pass: &Condition, design: &Design, c: &mut Contact) {
        let x = pass.position_m;
        c.amplitude_pp *= match law {
            0 | 3 => {
                let shorter =
                    if law == 3 { (pass.frequency_hz / design.reference_frequency_hz).sqrt() } else { 1.0 };
                let s = (PI * (x * shorter / theta[1] + theta[2])).sin();
                // Depth one is |cos|; the mean over a stroke through nodes is shallower.
                (1.0 - theta[0].min(1.0) * s * s).max(4e-4).sqrt()
            }
            1 => 1.0 / (1.0 + theta[0] * (x - theta[1] * design.stroke_m).powi(2)),
            _ => (theta[0] * (x - 0.5 * design.stroke_m)).clamp(-2.0, 2.0).exp(),
        };
    }
}
