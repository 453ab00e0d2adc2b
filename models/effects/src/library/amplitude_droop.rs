//! The finger loads the plate and its amplitude falls.

use super::prelude::*;
use crate::contact::{STILL_PLATE_M, half_contact_angle};

const CHECK: &str = "Measure the plate with a vibrometer while the finger is pressed on it.";

pub(super) static EFFECT: Effect = Effect {
    name: "amplitude_droop",
    place: Location::Plate,
    summary: "An amplifier without amplitude control lets w fall as the finger's impedance is pressed on the plate.",
    source: "plate impedance M omega/Q of 9 N s/m against 50 to 150 N s/m of a fingertip (upper bound)",
    laws: &[
        // The contact area of a sphere grows as the 2/3 power of the load, that of a flat pad hardly.
        Law::new(
            "impedance by a power of the load",
            &[
                Parameter::positive("droop_at_reference_load", "1", 0.2, 3.0),
                Parameter::shape("load_exponent", "1", 0.8, 0.3).bending(),
                // A supply that sags droops more the larger the amplitude; a reactance, with the frequency.
                Parameter::signed("amplitude_exponent", "1", 0.3, -1.0, 1.5).bending(),
                Parameter::signed("frequency_exponent", "1", 0.5, -2.0, 2.0).bending(),
            ],
        )
        .seen_by(CHECK, 0.015),
        // A stiff plate is loaded while it is touched.
        Law::new(
            "impedance by the share of the cycle in touch",
            &[
                Parameter::positive("droop_in_full_touch", "1", 0.5, 5.0),
                Parameter::shape("exponent", "1", 1.0, 0.5),
            ],
        )
        .seen_by(CHECK, 0.015),
    ],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::NORMAL_FORCE] }),
    needs: &[Need::Vibration, Need::Loads],
    change: |law, theta, _, design, c| {
        c.amplitude_pp *= match law {
            0 => {
                let load = (c.normal_force / design.reference_load_n).max(0.0).powf(theta[1]);
                let amplitude =
                    (c.amplitude_pp / design.largest_amplitude_m.max(1e-12)).max(1e-3).powf(theta[2]);
                let frequency = (c.frequency / design.reference_frequency_hz).powf(theta[3]);
                1.0 / (1.0 + theta[0] * load * amplitude * frequency)
            }
            _ if c.amplitude_pp > STILL_PLATE_M => {
                let touched = half_contact_angle(c.load_ratio(), 0.0) / std::f64::consts::PI;
                1.0 / (1.0 + theta[0] * touched.powf(theta[1]))
            }
            _ => 1.0,
        };
    },
    ..Effect::NONE
};
