//! The lateral force of a pass under the baseline and any effects.

use crate::contact::{Contact, mean_friction};
use crate::effect::{Effect, Input};
use crate::operating::{Baseline, Design, LEAST_SHARE, SensorError};
use models::Condition;

/// An effect with the law and parameters at which it acts.
#[derive(Clone, Copy)]
pub struct Active<'a> {
    /// Which effect.
    pub effect: &'static Effect,
    /// Index of its law.
    pub law: usize,
    /// Parameters in the law's order and units.
    pub theta: &'a [f64],
}

/// Signed mean lateral force that the sensor reads, N. Effects act in the library's order; allocates nothing.
/// The friction coefficient is the baseline's, not the condition's.
pub fn lateral_force(baseline: &Baseline, effects: &[Active<'_>], pass: &Condition, design: &Design) -> f64 {
    read(baseline.contact(pass, design), effects, None, pass, design)
}

/// The same from the contact that a baseline gives the pass, within a per cent or so where that is coarse;
/// with one input beside its value where one is given: by e-folds or in its own unit, as [`Input`] has it.
pub fn read(
    mut contact: Contact,
    effects: &[Active<'_>],
    beside: Option<(Input, f64)>,
    pass: &Condition,
    design: &Design,
) -> f64 {
    const EXACT: SensorError = SensorError { gain: 1.0, crosstalk: 0.0, offset_n: 0.0 };
    let mut reading = EXACT;
    for active in effects {
        (active.effect.change)(active.law, active.theta, pass, design, &mut contact);
        (active.effect.read)(active.law, active.theta, pass, design, &mut reading);
        if let Some(own) = active.effect.own {
            let at = Condition { mu0: contact.mu0, ..*pass };
            reading.gain *= own.factor(active.theta[0], &at).unwrap_or(f64::NAN);
        }
    }
    match beside {
        Some((Input::Amplitude, e_folds)) => contact.amplitude_pp *= e_folds.exp(),
        Some((Input::Speed, e_folds)) => contact.speed *= e_folds.exp(),
        Some((Input::Stiffness, e_folds)) => {
            contact.normal_stiffness *= e_folds.exp();
            contact.lateral_stiffness *= e_folds.exp();
        }
        Some((Input::Friction, e_folds)) => contact.mu0 *= e_folds.exp(),
        Some((Input::Load, newtons)) => {
            contact.normal_force = (contact.normal_force + newtons).max(LEAST_SHARE * contact.normal_force);
        }
        Some((Input::Offset, newtons)) => reading.offset_n += newtons,
        Some((Input::Crosstalk, share)) => reading.crosstalk += share,
        None => {}
    }
    let friction = pass.direction.sign() * mean_friction(&contact);
    if reading == EXACT {
        return friction;
    }
    reading.gain * friction + reading.crosstalk * contact.normal_force + reading.offset_n
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::PeakToPeak;

    /// With the plate still, Coulomb's law says what each input does: L = mu F, read with offset and
    /// cross-talk.
    #[test]
    fn an_input_beside_its_value_does_what_coulomb_says() {
        let pass =
            Condition { amplitude: PeakToPeak::from_metres(0.0), normal_force_n: 0.4, ..Condition::paper() };
        let baseline =
            Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 };
        let design = Design {
            duration_s: 60.0,
            reference_load_n: 0.4,
            reference_speed_m_s: 0.02,
            reference_frequency_hz: 30e3,
            reference_temperature_c: 20.0,
            stroke_m: 0.0,
            largest_amplitude_m: 2e-6,
        };
        let step = 1e-3;
        let slope = |input| {
            let [low, high] = [-step, step]
                .map(|s| read(baseline.contact(&pass, &design), &[], Some((input, s)), &pass, &design));
            (high - low) / (2.0 * step)
        };
        let friction = pass.direction.sign() * 0.5;
        for (input, expected) in [
            (Input::Friction, friction * 0.4),
            (Input::Load, friction),
            (Input::Offset, 1.0),
            (Input::Crosstalk, 0.4),
            (Input::Amplitude, 0.0),
            (Input::Stiffness, 0.0),
            (Input::Speed, 0.0),
        ] {
            assert!((slope(input) - expected).abs() < 1e-6, "{input:?}: {} and {expected}", slope(input));
        }
    }
}
