//! The drive is off the plate's resonance: by warming up, with time, or at one of the frequencies.
//!
//! A resonance that falls with the amplitude alone is indistinguishable from saturation and belongs there.

use super::prelude::*;

const CHECK: &str = "Retune the drive (sweep its frequency) at the start and the end of a run.";

const PER_KELVIN: Parameter = Parameter::positive("detuning_per_kelvin", "1/K", 0.15, 5.0);
const DETUNING: Parameter = Parameter::positive("detuning", "1", 1.0, 12.0);
const TIME: Parameter = Parameter::shape("time_constant_over_duration", "1", 0.7, 1.0);
/// Resonators in a row that drift together, as a plate and the amplifier's matching: one has the Lorentzian,
/// many have Gauss's curve.
const STEEPNESS: Parameter = Parameter::shape("steepness", "1", 1.0, 0.7).bending();

pub(super) static EFFECT: Effect = Effect {
    name: "resonance_detuning",
    place: Location::Plate,
    summary: "Off resonance the plate moves less than commanded, by the Lorentzian of its quality factor.",
    source: "Q 100 at 27.5 kHz: 138 Hz halve the power; temperature coefficient of the plate's modulus",
    laws: &[
        Law::new("warming (temperature)", &[PER_KELVIN]).needs(&[Need::Temperatures]).seen_by(CHECK, 0.05),
        Law::new("drift with time", &[DETUNING, TIME]).seen_by(CHECK, 0.05),
        Law::new(
            "fixed resonance",
            &[
                Parameter::positive("quality_factor", "1", 60.0, 600.0),
                Parameter::between("resonance_over_reference", "1", 0.7, 1.4),
                Parameter::signed("softening_at_largest_amplitude", "1", 0.005, -0.1, 0.1).bending(),
            ],
        )
        .needs(&[Need::Frequencies])
        .seen_by(CHECK, 3.0),
        Law::new("loss with time", &[Parameter::positive("loss", "1", 0.5, 8.0), TIME]).seen_by(CHECK, 0.05),
        // The point of tuning need not be the first pass, and a softening resonator falls with its own swing.
        Law::new(
            "warming about a tuning point",
            &[
                PER_KELVIN,
                Parameter::signed("tuning_point_above_first", "K", 3.0, -20.0, 20.0),
                Parameter::signed("softening_at_largest_amplitude", "K", 2.0, -20.0, 20.0),
            ],
        )
        .needs(&[Need::Temperatures])
        .seen_by(CHECK, 0.05),
        Law::new(
            "drift about a tuning point",
            &[
                DETUNING,
                TIME,
                Parameter::signed("tuning_point", "1", 0.3, -2.0, 2.0),
                Parameter::signed("softening_at_largest_amplitude", "1", 0.3, -3.0, 3.0),
                STEEPNESS,
                // A plate that is left alone between runs cools.
                IN_RUN,
            ],
        )
        .seen_by(CHECK, 0.05),
    ],
    acts: Some(Acts { on: Input::Amplitude, over: &[&covariate::TIME] }),
    needs: &[Need::Vibration],
    change: |law, theta, pass, design, c| {
        let (steepness, rests) = match *theta {
            [.., steepness, rests] if law == 5 => (steepness, rests),
            _ => (1.0, 0.0),
        };
        let faded = || (-pass.elapsed_s(rests) / (theta[1] * design.duration_s.max(1e-9))).exp_m1();
        if law == 3 {
            c.amplitude_pp /= 1.0 - theta[0] * faded();
            return;
        }
        let warmer = || pass.temperature_c.map_or(0.0, |t| t - design.reference_temperature_c);
        let swing = (c.amplitude_pp / design.largest_amplitude_m.max(1e-12)).powi(2);
        let off = match law {
            0 => theta[0] * warmer(),
            1 => -theta[0] * faded(),
            2 => {
                let r =
                    pass.frequency_hz / (design.reference_frequency_hz * theta[1] * (1.0 - theta[2] * swing));
                theta[0] * (r - 1.0 / r)
            }
            4 => theta[0] * (warmer() - theta[1] + theta[2] * swing),
            _ => theta[0] * (-faded() - theta[2] + theta[3] * swing),
        };
        c.amplitude_pp /= (1.0 + off * off / steepness).powf(0.5 * steepness);
    },
    ..Effect::NONE
};
