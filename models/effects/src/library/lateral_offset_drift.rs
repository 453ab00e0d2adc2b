//! The lateral channel's zero is off, or wanders.

use super::prelude::*;

const CHECK: &str = "Lift the finger every few passes and read the lateral force.";

const OFFSET: Parameter = Parameter::signed("offset", "N", 0.01, -0.3, 0.3);
const DRIFT: Parameter = Parameter::signed("drift_over_table", "N", 0.015, -0.4, 0.4);

pub(super) static EFFECT: Effect = Effect {
    name: "lateral_offset_drift",
    place: Location::Instrument,
    summary: "An offset of the lateral force, constant or drifting, whatever the load and the direction.",
    source: "thermal drift of 1 to 80 mN per stroke of strain-gauge and piezo cells",
    laws: &[
        Law::new("constant", &[OFFSET]).certified_by(CertifiedKey::LateralOffset).seen_by(CHECK, 0.0005),
        Law::new("linear drift", &[DRIFT]).seen_by(CHECK, 0.0005),
        Law::new(
            "settling",
            &[
                Parameter::signed("change", "N", 0.015, -0.4, 0.4),
                Parameter::shape("time_constant_over_duration", "1", 0.3, 0.8),
                IN_RUN,
            ],
        )
        .seen_by(CHECK, 0.0005),
        Law::new(
            "offset with curved drift",
            &[OFFSET, DRIFT, Parameter::signed("curvature_over_table", "N", 0.015, -0.4, 0.4)],
        )
        .seen_by(CHECK, 0.0005),
        Law::new(
            "offset with temperature",
            &[OFFSET, Parameter::signed("per_kelvin", "N/K", 0.003, -0.1, 0.1)],
        )
        .needs(&[Need::Temperatures])
        .seen_by(CHECK, 0.0005),
        // What the amplifier of the drive leaves in the bridge's wires.
        Law::new(
            "by the drive",
            &[
                Parameter::signed("offset_at_full_vibration", "N", 0.01, -0.3, 0.3),
                Parameter::shape("exponent", "1", 1.3, 0.3).bending(),
                Parameter::signed("frequency_exponent", "1", 1.5, -2.0, 5.0).bending(),
            ],
        )
        .needs(&[Need::Vibration, Need::Amplitudes])
        .seen_by("Lift the finger, switch the drive on and off; read the lateral force.", 0.0005),
    ],
    acts: Some(Acts { on: Input::Offset, over: &[&covariate::TIME] }),
    needs: &[Need::Directions],
    read: |law, theta, pass, design, reading| {
        let s = pass.time_s / design.duration_s.max(1e-9);
        reading.offset_n += match law {
            0 => theta[0],
            1 => theta[0] * s,
            3 => theta[0] + theta[1] * (s - 0.5) + theta[2] * ((2.0 * s - 1.0).powi(2) - 1.0 / 3.0),
            4 => {
                let warmer = pass.temperature_c.map_or(0.0, |t| t - design.reference_temperature_c);
                theta[0] + theta[1] * warmer
            }
            5 => theta[0] * vibrating(&theta[1..], pass, design),
            _ => -theta[0] * (-pass.elapsed_s(theta[2]) / (theta[1] * design.duration_s.max(1e-9))).exp_m1(),
        };
    },
    ..Effect::NONE
};
