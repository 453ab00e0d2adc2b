//! The tissue under the ridges creeps: the contact grows, and with it both stiffnesses, while mu0 stays.

use super::prelude::*;

/// How much of the change is the lateral stiffness's too, in e-folds: anything from none to more than all.
const LATERAL: Parameter = Parameter::between("lateral_over_normal_e_folds", "1", 0.0, 1.3).bending();

pub(super) static EFFECT: Effect = Effect {
    name: "subsurface_relaxation",
    place: Location::Contact,
    summary: "Creep of the soft tissue changes the stiffness of the contact with time, not its friction coefficient.",
    source: "longest relaxation time of a finger pad about 3 s (the paper's introduction); area grows as log t",
    laws: &[
        // Tissue has no single relaxation time: Kohlrausch's function, usual for a broad spectrum of times.
        Law::new(
            "stretched exponential creep",
            &[
                Parameter::signed("relative_change", "1", 0.4, -0.8, 4.0),
                Parameter::shape("time_constant", "s", 30.0, 1.5),
                Parameter::shape("exponent", "1", 0.75, 0.35).bending(),
                LATERAL,
                IN_RUN,
            ],
        ),
        Law::new(
            "logarithmic creep",
            &[
                Parameter::signed("relative_change_per_e_fold", "1", 0.12, -0.15, 1.5),
                Parameter::shape("onset_time", "s", 5.0, 1.2),
                LATERAL,
                IN_RUN,
            ],
        ),
    ],
    acts: Some(Acts { on: Input::Stiffness, over: &[&covariate::TIME] }),
    needs: &[Need::Vibration, Need::Time],
    change: |law, theta, pass, _, c| {
        let [.., lateral, rests] = *theta else { return };
        let time = pass.elapsed_s(rests) / theta[1];
        let growth = if law == 0 { -(-time.powf(theta[2])).exp_m1() } else { (1.0 + time).ln() };
        let factor = (1.0 + theta[0] * growth).max(0.05);
        c.normal_stiffness *= factor;
        c.lateral_stiffness *= factor.powf(lateral);
    },
    ..Effect::NONE
};
