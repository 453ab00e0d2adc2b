//! Air trapped under the vibrating finger carries part of the load.

use super::prelude::*;

/// Load on solid contact without air that fades by 1/e over one film thickness unit, N.
const SOLID_SCALE_N: f64 = 1.1;
/// Apparent area times one atmosphere, N (34 mm2).
const AIR_SCALE_N: f64 = 3.4;

/// Excursion of the plate over the mean gap beyond which the film's formula is not followed (its pole lies at one).
const MOST_EXCURSION: f64 = 0.95;
/// Film thickness units beyond which nothing of the load is left to solid contact.
const FARTHEST: f64 = 60.0;

/// Bluntness below which the film ends as an exponential does: the difference is of the order of it.
const STEEPEST: f64 = 1e-6;

const CHECK: &str = "Repeat the largest amplitudes at an ambient pressure of 20 kPa.";

/// Shapes of a film whose lift goes with powers of amplitude, frequency and load, and which ends between a
/// slow fade (`1/(1 + lift)`, and slower) and a steep one (`exp(-lift)`).
const POWERS: [Parameter; 6] = [
    Parameter::positive("lift_at_largest_amplitude", "1", 3.0, 200.0),
    Parameter::shape("amplitude_exponent", "1", 2.0, 0.3).bending(),
    Parameter::signed("frequency_exponent", "1", 0.7, -2.0, 3.0).bending(),
    Parameter::between("load_exponent", "1", -0.5, 2.5).bending(),
    Parameter::between("bluntness", "1", 0.0, 2.0).bending(),
    // Thin air leaves a gap more easily than its pressure says.
    Parameter::shape("pressure_exponent", "1", 1.0, 0.2).bending(),
];

pub(super) static EFFECT: Effect = Effect {
    name: "squeeze_film",
    place: Location::Contact,
    summary: "Compressed air carries a share of the load that grows with amplitude and ambient pressure.",
    source: "Wiertlewski, Friesen, Colgate 2016 (partial levitation); infinite squeeze number, in its small-amplitude form and for \
         any excursion (Langlois 1962, Salbu 1964)",
    laws: &[
        Law::new("load shared with a film", &[Parameter::positive("inverse_roughness", "1/m", 0.6e6, 4e6)])
            .seen_by(CHECK, 5e4),
        Law::new(
            "load shared with a film of finite excursion",
            &[
                Parameter::positive("inverse_roughness", "1/m", 0.6e6, 4e6),
                Parameter::shape("film_over_apparent_area", "1", 0.5, 1.0),
                Parameter::shape("solid_load", "N", SOLID_SCALE_N, 0.4),
                // How slowly the asperities let go: exponentially at zero, as the fourth power of the gap at
                // a quarter.
                Parameter::between("bluntness", "1", 0.0, 0.6).bending(),
            ],
        )
        .seen_by(CHECK, 5e4),
        Law::new("share by powers", &POWERS).seen_by(CHECK, 0.1),
        Law::new("friction by powers", &POWERS).seen_by(CHECK, 0.1),
    ],
    acts: Some(Acts { on: Input::Load, over: &[&covariate::AMPLITUDE, &covariate::FREQUENCY] }),
    needs: &[Need::Vibration, Need::Amplitudes],
    change: |law, theta, pass, design, c| {
        let air = atmospheres(pass);
        // Area and surface are a fingertip's at a fingertip's load; a larger contact at a larger one.
        let size = design.reference_load_n / STATED_AT_N;
        match law {
            0 => c.solid_share *= film_share(theta[0] * c.half_amplitude(), air, c.normal_force / size),
            1 => {
                let (a, film) = (theta[0] * c.half_amplitude(), theta[1] * AIR_SCALE_N * air * size);
                c.solid_share *= finite_film_share(a, film, [theta[2], theta[3]], c.normal_force);
            }
            2 => c.solid_share *= share_by_powers(theta, pass, design, c),
            _ => c.friction_factor *= share_by_powers(theta, pass, design, c),
        }
    },
    ..Effect::NONE
};

/// Share of solid contact under a lift that goes with powers: `(1 + b lift)^(-1/b)`, with `b` the bluntness.
fn share_by_powers(theta: &[f64], pass: &Condition, design: &Design, c: &Contact) -> f64 {
    let lift = theta[0]
        * atmospheres(pass).powf(theta[5])
        * (c.amplitude_pp / design.largest_amplitude_m).powf(theta[1])
        * (pass.frequency_hz / design.reference_frequency_hz).powf(theta[2])
        * (design.reference_load_n / c.normal_force).powf(theta[3]);
    let b = theta[4];
    if b < STEEPEST { (-lift).exp() } else { (-(b * lift).ln_1p() / b).exp() }
}

/// The same where the film is that of a strongly squeezed isothermal gas at any excursion `e = a/u`: `Fn =
/// solid (1 + b u)^(-1/b) + film (sqrt((1 + 3/2 e^2) / (1 - e^2)) - 1)` (Langlois 1962, Salbu 1964), whose
/// first term is 5/4 e^2; with `b` to zero the solid's force is `exp(-u)`.
fn finite_film_share(a: f64, film: f64, [solid, b]: [f64; 2], load: f64) -> f64 {
    if a <= 0.0 {
        return 1.0;
    }
    // The gap without air, and what the asperities carry at a gap of the load.
    let rest = (solid / load).ln().max(0.2);
    let rest = if b < STEEPEST { rest } else { (b * rest).exp_m1() / b };
    let carried = |u: f64| {
        if b < STEEPEST { (rest - u).exp() } else { (((1.0 + b * rest) / (1.0 + b * u)).ln() / b).exp() }
    };
    // carried(u) + lift(u) = 1; the share without air is one.
    let short = |u: f64| {
        let e2 = (a / u).min(MOST_EXCURSION).powi(2);
        1.0 - carried(u) - film / load * (((1.0 + 1.5 * e2) / (1.0 - e2)).sqrt() - 1.0)
    };
    let (mut low, mut high) = (rest, rest + 1.0);
    while short(high) < 0.0 {
        (low, high) = (high, rest + 2.0 * (high - rest));
        if high > rest + FARTHEST {
            return carried(high);
        }
    }
    crate::contact::sweep::root(low, high, 0.0, short).map_or(1.0, |u| carried(u).min(1.0))
}

/// Share left to solid contact when `Fn = solid exp(-u) + 1.25 p A (a/u)^2`, u in film thickness units.
fn film_share(a: f64, air: f64, load: f64) -> f64 {
    if a <= 0.0 {
        return 1.0;
    }
    let rest = (SOLID_SCALE_N / load).ln().max(0.2);
    let lift = 1.25 * AIR_SCALE_N * air * a * a / load;
    // exp(rest - u) + lift/u^2 = 1, falling in u.
    let look = |u: f64| {
        let solid = (rest - u).exp();
        let value = solid + lift / (u * u) - 1.0;
        let nearer = value > 0.0;
        (!nearer, u + value / (solid + 2.0 * lift / (u * u * u)))
    };
    let ends = [rest, rest + 40.0 + 2.0 * lift.sqrt()];
    let u = models::root::newton_or_half(ends, rest + lift.sqrt() * 0.5, |u| 1e-10 * u, look);
    (rest - u).exp().min(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For small excursions the film's overpressure is 5/4 of the square: both laws agree.
    #[test]
    fn a_film_of_small_excursion_is_the_small_amplitude_form() {
        for (a, load) in [(0.02, 0.3), (0.05, 0.8), (0.1, 0.15)] {
            let (small, finite) =
                (film_share(a, 1.0, load), finite_film_share(a, AIR_SCALE_N, [SOLID_SCALE_N, 0.0], load));
            assert!((small - finite).abs() < 0.05 * (1.0 - small), "{a} {load}: {small} {finite}");
        }
    }

    /// Load on solid and film add up to the normal force.
    #[test]
    fn solid_and_film_carry_the_load() {
        let (a, film, solid, load) = (1.4, 2.0, 1.1, 0.4);
        let share = finite_film_share(a, film, [solid, 0.0], load);
        let u = (solid / load).ln() - share.ln();
        let e2 = (a / u).powi(2);
        let carried = share * load + film * (((1.0 + 1.5 * e2) / (1.0 - e2)).sqrt() - 1.0);
        assert!((carried - load).abs() < 1e-9 && share < 0.9, "{carried} {share}");
    }
}
