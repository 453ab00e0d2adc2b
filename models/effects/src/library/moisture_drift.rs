//! Sweat and occlusion change the friction coefficient with time of contact.

use super::prelude::*;

/// Relative humidity at which the change is as stated, percent.
const ROOM_HUMIDITY_PCT: f64 = 45.0;
/// The characteristic time of an approach.
const TIME: Parameter = Parameter::shape("time_constant", "s", 60.0, 1.4);
/// The parameters of an exponential approach.
const APPROACH: &[Parameter] = &[Parameter::signed("relative_change", "1", 0.4, -0.8, 9.0), TIME];
/// Skin need not dry between runs.
const LASTS: Parameter = Parameter::positive("share_of_time_that_lasts", "1", 0.3, 1.0).bending();
/// The same in each run.
const IN_EACH_RUN: &[Parameter] = &[APPROACH[0], TIME, LASTS];
/// And by what the air holds.
const BY_HUMIDITY: &[Parameter] =
    &[APPROACH[0], TIME, LASTS, Parameter::signed("humidity_exponent", "1", 0.5, -1.0, 3.0).bending()];

pub(super) static EFFECT: Effect = Effect {
    name: "moisture_drift",
    place: Location::Contact,
    summary: "Friction drifts as the skin takes up water, by occlusion or from the air, with the plate still \
              as well as vibrating.",
    source: "occlusion with a characteristic time of 20 s, up to tenfold (Dzidek 2014); 5 to 2000 s allowed",
    laws: &[
        Law::new("exponential approach", APPROACH),
        Law::new(
            "approach with softening",
            &[Parameter::signed("relative_change", "1", 0.4, -0.6, 5.0), TIME],
        ),
        Law::new(
            "logarithm of time",
            &[
                Parameter::signed("relative_change_per_e_fold", "1", 0.12, -0.2, 2.0),
                Parameter::shape("onset_time", "s", 20.0, 1.2),
            ],
        ),
        Law::new("exponential approach in each run", IN_EACH_RUN).needs(&[Need::Runs]),
        Law::new("with the humidity of the air", &[Parameter::signed("exponent", "1", 0.3, -2.0, 3.0)])
            .needs(&[Need::Humidities]),
        Law::new("exponential approach in each run, by the humidity", BY_HUMIDITY)
            .needs(&[Need::Runs, Need::Humidities]),
    ],
    acts: Some(Acts { on: Input::Friction, over: &[&covariate::TIME] }),
    needs: &[Need::Time],
    change: |law, theta, pass, _, c| {
        let (in_run, humid) = match *theta {
            [.., lasts] if law == 3 => (1.0 - lasts, 1.0),
            [.., lasts, exponent] if law == 5 => (1.0 - lasts, humidity(pass).powf(exponent)),
            _ => (0.0, 1.0),
        };
        let time = pass.elapsed_s(in_run);
        let factor = match law {
            2 => 1.0 + theta[0] * (1.0 + time / theta[1]).ln(),
            4 => humidity(pass).powf(theta[0]),
            _ => 1.0 - theta[0] * humid * (-time / theta[1]).exp_m1(),
        }
        .max(0.05);
        c.mu0 *= factor;
        if law == 1 {
            // Wetter skin is softer: stiffness falls as friction grows.
            let softer = factor.powf(-0.5);
            c.normal_stiffness *= softer;
            c.lateral_stiffness *= softer;
        }
    },
    ..Effect::NONE
};

/// Relative humidity over that of a room, for laws that need one at every pass.
fn humidity(pass: &Condition) -> f64 {
    pass.relative_humidity_pct.map_or(1.0, |h| h.max(1.0) / ROOM_HUMIDITY_PCT)
}
