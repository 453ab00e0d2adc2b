//! The contact solver against figures that an independent time-domain simulation printed.
use models::{Condition, PeakToPeak};
use muprime_effects::contact::asperities::Heights;
use muprime_effects::contact::impact::{Bouncing, LANDINGS, STATED_ERROR};
use muprime_effects::contact::{Attraction, Bonds, Contact, Held, half_contact_angle, mean_friction};
use muprime_effects::{Baseline, Design};
use std::f64::consts::PI;

const DESIGN: Design = Design {
    duration_s: 1000.0,
    reference_load_n: 0.5,
    reference_speed_m_s: 0.02,
    reference_frequency_hz: 27_500.0,
    reference_temperature_c: 20.0,
    stroke_m: 0.03,
    largest_amplitude_m: 5e-6,
};

fn pass(amplitude_pp_m: f64, speed_m_s: f64, normal_force_n: f64) -> Condition {
    Condition {
        amplitude: PeakToPeak::from_metres(amplitude_pp_m),
        speed_m_s,
        normal_force_n,
        ..Condition::paper()
    }
}

fn contact(w: f64, u: f64, f: f64, kn: f64, kl: f64) -> Contact {
    Baseline { mu0: 0.5, normal_stiffness_n_per_m: kn, lateral_stiffness_n_per_m: kl }
        .contact(&pass(w, u, f), &DESIGN)
}

fn relative(c: &Contact) -> f64 {
    mean_friction(c) / (c.mu0 * c.normal_force)
}

/// mu' against Psi (Eq. 17) for three ratios of amplitude to preload: massless simulation of Eqs. 8 to 15.
#[test]
fn massless_slider_follows_the_published_simulation() {
    let groups = [0.1, 0.25, 0.5, 1.0, 2.0, 3.0, 4.5, 2.0 * PI];
    let table = [
        (4.0, [0.036, 0.088, 0.170, 0.317, 0.555, 0.735, 0.914, 1.0]),
        (8.0, [0.041, 0.099, 0.191, 0.354, 0.612, 0.793, 0.951, 1.0]),
        (20.0, [0.051, 0.125, 0.238, 0.435, 0.720, 0.892, 0.993, 1.0]),
    ];
    let (f, w) = (27_500.0, 2e-6);
    for (ratio, row) in table {
        for (psi, expected) in groups.iter().zip(row) {
            // Psi(17) = 2 kl U / (kn w f mu0).
            let kn = 0.25 / (w / ratio);
            let kl = kn / (2.0 * 1.33);
            let u = psi * kn * w * f * 0.5 / (2.0 * kl);
            let got = relative(&contact(w, u, 0.25, kn, kl));
            assert!((got - expected).abs() < 6e-3, "w/h {ratio}, Psi {psi}: {got} against {expected}");
        }
    }
}

/// Fig. 14's steady values with w peak to peak, as the independent simulation gave them.
#[test]
fn finite_recovery_follows_figure_14() {
    for (speed, expected) in [(1.5e-3, 0.979), (3e-3, 0.858), (5e-3, 0.494), (8e-3, 0.138)] {
        let mut c = contact(5e-6, 0.02, 0.5, 3.9e6, 1.5e6);
        c.inverse_recovery_speed = 1.0 / speed;
        let got = relative(&c);
        assert!((got - expected).abs() < 0.015, "v_r {speed}: {got} against {expected}");
    }
}

/// Mass: an explicit penalty simulation (contact stiffness 100 k_n, critically damped contact, 2000 steps a
/// cycle, 100 cycles) gave these mu' for a finger of 1 MN/m at the nominal point.
#[test]
fn inertia_agrees_with_a_penalty_simulation() {
    let base = contact(2e-6, 0.02, 0.25, 1e6, 1e6 / 2.66);
    assert!((relative(&base) - 0.204).abs() < 0.006, "base {}", relative(&base));
    for (mass, ridge_damping_ratio, expected) in
        [(2e-6, 0.3, 0.190), (2e-6, 1.0, 0.142), (8e-6, 1.0, 0.088), (8e-6, 0.3, 0.168)]
    {
        let got = relative(&Contact { mass, ridge_damping_ratio, ..base });
        assert!((got - expected).abs() < 0.06 * expected + 0.004, "{mass} {ridge_damping_ratio}: {got}");
    }
}

/// The table against the march that made it, at places between its nodes: the error is what the library states.
#[test]
fn inertia_table_errs_as_stated() {
    let mut state = 12_345_u64;
    let mut uniform = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    for (landing, surface) in LANDINGS.into_iter().enumerate() {
        let mut errors: Vec<f64> = (0..1500)
            .map(|_| {
                let (load, ratio) = (0.02 * 150f64.powf(uniform()), 0.05 + uniform());
                let (drag, damping) = (0.003 * 300f64.powf(uniform()), 0.2 * 7f64.powf(uniform()));
                let base = contact(2e-6, 0.02, 0.25, 1e6, 0.4e6);
                let c = Contact {
                    normal_force: load * base.normal_stiffness * base.half_amplitude(),
                    speed: base.speed * drag / base.drag(),
                    mass: base.normal_stiffness * (ratio / (2.0 * PI * base.frequency)).powi(2),
                    ridge_damping_ratio: damping,
                    landing,
                    ..base
                };
                let marched = Bouncing { load, ratio, damping, landing: surface }.friction(&[drag])[0] / load;
                (relative(&c) - marched).abs()
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        println!("landing {landing}: mu' within {:.1e} in half of the places, rms {rms:.1e}", errors[750]);
        assert!(rms < STATED_ERROR && errors[750] < STATED_ERROR / 30.0, "{rms} {}", errors[750]);
    }
}

/// In a contact that never ends the equations are linear: the force swings by the modulus of the dynamic
/// stiffness of ridge and surface in series, and the slider is the massless one of that swing.
#[test]
fn an_unbroken_contact_with_mass_is_linear() {
    for landing in LANDINGS {
        for (ratio, damping) in [(0.3, 0.2), (0.6, 0.5), (0.9, 1.0)] {
            let inner = landing.stiffness / (landing.stiffness - 1.0);
            let ridge = (inner - ratio * ratio, 2.0 * damping * ratio);
            let skin = (landing.stiffness, 2.0 * landing.damping * landing.stiffness.sqrt() * ratio);
            let in_series = (ridge.0 + skin.0).hypot(ridge.1 + skin.1);
            let swing = ridge.0.hypot(ridge.1) * skin.0.hypot(skin.1) / in_series;
            let load = 1.6 * swing;
            let marched = Bouncing { load, ratio, damping, landing }.friction(&[0.05 * swing])[0] / load;
            let base = contact(2e-6, 0.02, 0.25, 1e6, 0.4e6);
            let massless = Contact {
                normal_force: 1.6 * base.normal_stiffness * base.half_amplitude(),
                speed: base.speed * 0.05 / base.drag(),
                ..base
            };
            let expected = relative(&massless);
            assert!((marched / expected - 1.0).abs() < 0.01, "{ratio} {damping}: {marched} for {expected}");
        }
    }
}

/// The sweep gives the closed form where that one exists.
#[test]
fn sweep_agrees_with_the_closed_form() {
    let (mut worst, mut coarsest) = (0.0f64, 0.0f64);
    for w in [0.05e-6, 0.3e-6, 1e-6, 3e-6, 6e-6] {
        for u in [1e-3, 5e-3, 0.02, 0.1, 0.3] {
            for f in [0.1, 0.5, 1.5] {
                let c = contact(w, u, f, 2e6, 0.8e6);
                let swept = Contact { bonds: Bonds::Pressed { time: 1e-15, share: 1.0 }, ..c };
                let (a, b) = (relative(&c), relative(&swept));
                worst = worst.max((a - b).abs());
                coarsest = coarsest.max((a - relative(&Contact { coarse: true, ..swept })).abs());
                let retarded = Contact { normal_retardation_time: 1e-12, ..c };
                let d = relative(&retarded);
                assert!((a - d).abs() < 5e-3, "w {w} u {u} f {f}: {a} {d}");
            }
        }
    }
    println!("largest difference of mu': {worst:e}, of the coarse sweep {coarsest:e}");
    assert!(worst < 1e-3 && coarsest < 1e-2, "{worst} {coarsest}");
}

/// Continuity across full contact, and the still plate.
#[test]
fn friction_is_continuous_at_the_onset() {
    for u in [1e-3, 0.02, 0.2] {
        let at = |w: f64| relative(&contact(w, u, 0.5, 1e6, 0.4e6));
        let edge = 2.0 * 0.5 / 1e6;
        assert!((at(edge * 0.9999) - at(edge * 1.0001)).abs() < 1e-3);
        assert!((at(1e-11) - 1.0).abs() < 1e-3);
        assert_eq!(at(0.0), 1.0);
    }
}

/// A tall forest of asperities of nearly one height is one slider.
#[test]
fn asperities_of_one_height_are_one_slider() {
    for w in [0.5e-6, 2e-6] {
        let c = contact(w, 0.02, 0.25, 1e6, 0.4e6);
        for asperity_heights in [Heights::Gaussian, Heights::Exponential, Heights::Even, Heights::Two(0.3)] {
            let many = Contact { asperity_height: 1e-12, asperity_heights, ..c };
            assert!((relative(&many) - relative(&c)).abs() < 1e-4);
        }
    }
}

/// Where the lower ones are out of reach, two heights are one slider on the springs of the upper ones.
#[test]
fn of_two_heights_far_apart_the_upper_ones_carry() {
    for (share, w, f) in [(0.3, 2e-6, 0.25), (0.8, 6e-6, 0.1), (0.5, 0.4e-6, 0.3)] {
        let c = contact(w, 0.02, f, 1e6, 0.4e6);
        let two = Contact { asperity_height: 1e-4, asperity_heights: Heights::Two(share), ..c };
        let (normal_stiffness, lateral_stiffness) = (1e6 * (1.0 - share), 0.4e6 * (1.0 - share));
        let upper = Contact { normal_stiffness, lateral_stiffness, ..c };
        assert!(
            (relative(&two) - relative(&upper)).abs() < 1e-4,
            "{share}: {} {}",
            relative(&two),
            relative(&upper)
        );
    }
}

/// Adhesion of zero is none, and on a still plate it adds mu0 Fa.
#[test]
fn adhesion_adds_to_the_limit() {
    let c = Contact { adhesion: 0.1, ..contact(0.0, 0.02, 0.5, 1e6, 0.4e6) };
    assert!((mean_friction(&c) - 0.5 * 0.6).abs() < 1e-12);
    let moving = |adhesion| mean_friction(&Contact { adhesion, ..contact(2e-6, 0.02, 0.5, 1e6, 0.4e6) });
    assert!((moving(1e-9) - moving(0.0)).abs() < 1e-6 * moving(0.0));
    assert!(moving(0.1) > moving(0.0));
}

/// The tabulated angle is the root of the load balance, within the table's own error, which is printed.
#[test]
fn tabulated_angle_balances_the_load() {
    let mut worst: f64 = 0.0;
    for i in 1..20_000 {
        let load = (i as f64 / 20_000.0).powi(3);
        let phi = muprime_effects::contact::half_contact_angle(load, 0.0);
        let back = muprime_effects::contact::arc_load(phi);
        worst = worst.max(((back - load).abs() - 1e-12) / load);
    }
    println!("worst relative error of the load {worst:e}");
    assert!(worst < 2e-6, "{worst:e}");
}

/// A share of no recovery is nothing, also where another law asks for the sweep and the contact never ends.
#[test]
fn a_recovery_without_size_changes_no_sweep() {
    for (amplitude, load) in [(0.2e-6, 0.5), (3e-6, 0.25)] {
        let c = Contact { load_exponent: -0.1, ..contact(amplitude, 0.02, load, 1e6, 0.4e6) };
        for relaxation_growth in [0.3, 0.99] {
            let with = mean_friction(&Contact { relaxation_growth, ..c });
            assert!(with.to_bits() == mean_friction(&c).to_bits(), "{with}");
        }
    }
}

/// A knee far below the stretch is the plain rate limit.
#[test]
fn a_hard_knee_is_the_plain_rate_limit() {
    let c = contact(3e-6, 0.02, 0.25, 1e6, 0.4e6);
    let plain = mean_friction(&Contact { inverse_recovery_speed: 200.0, ..c });
    let hard = mean_friction(&Contact { inverse_recovery_speed: 200.0, recovery_knee: 1e-14, ..c });
    assert!((plain / hard - 1.0).abs() < 1e-4, "{plain} {hard}");
}

/// Johnson, Kendall and Roberts: at no load the contact holds as if pressed with four times its pull-off force.
#[test]
fn jkr_adds_four_pull_offs_at_no_load() {
    let jkr = Attraction::Jkr { pull_off: 0.02 };
    assert!((jkr.at(0.0) - 0.08).abs() < 1e-15);
    let c = Contact { attraction: jkr, ..contact(0.0, 0.02, 0.5, 1e6, 0.4e6) };
    let expected = 0.5 * (0.5 + 0.04 + 2.0 * (0.02f64 * 0.52).sqrt());
    assert!((mean_friction(&c) - expected).abs() < 1e-12);
}

/// Slip against viscosity by small explicit steps of `x' = U - e/time (1 - g + g e/0.1 um)` with
/// `e = x - limit`, which share nothing with the sweep's.
#[test]
fn slip_against_viscosity_is_that_of_small_steps() {
    for (amplitude, speed, load, time, growth) in [
        (3e-6, 0.02, 0.25, 2e-5, 0.0),
        (0.5e-6, 0.005, 0.3, 1.5e-5, 0.0),
        (1e-6, 0.08, 1.2, 5e-6, 0.0),
        (2e-6, 0.04, 0.5, 1e-7, 0.0),
        (3e-6, 0.02, 0.25, 2e-5, 0.4),
        (1e-6, 0.08, 0.5, 8e-6, 0.95),
    ] {
        let c = contact(amplitude, speed, load, 1e6, 0.4e6);
        let swept = mean_friction(&Contact {
            viscous_slip: true,
            lateral_relaxation_time: time,
            relaxation_growth: growth,
            ..c
        });
        let scale = c.normal_stiffness * c.half_amplitude();
        let phi = half_contact_angle(c.load_ratio(), 0.0);
        let offset = if phi >= PI { c.load_ratio() } else { -phi.cos() };
        let steps = 20_000;
        let dt = 1.0 / (c.frequency * f64::from(steps));
        let (mut x, mut sum) = (0.0f64, 0.0);
        for _cycle in 0..60 {
            sum = 0.0;
            for i in 0..steps {
                let phase = 2.0 * PI * (f64::from(i) + 0.5) / f64::from(steps) - PI;
                let pressed = scale * (phase.cos() + offset).max(0.0);
                let limit = c.mu0 * pressed / c.lateral_stiffness;
                let drag = if pressed > 0.0 { c.speed } else { 0.0 };
                let excess = (x - limit).max(0.0);
                let rate = (1.0 - growth + growth * excess / 1e-7) / time;
                x += drag * dt - excess * -(-dt * rate).exp_m1();
                sum += c.lateral_stiffness * x.min(limit) / f64::from(steps);
            }
        }
        println!("{swept} {sum}");
        assert!((swept / sum - 1.0).abs() < 2e-3, "{swept} {sum}");
    }
}

/// Where the slider never sticks the mean friction is that of the limit, in closed form. Hunt and Crossley's
/// damping turns with the speed of indentation, so over a contact its work on the load is nil. Bonds that
/// form by pressing grow with the impulse: the mean of `1 - s exp(-D/tau)` over the impulse of a cycle, T, is
/// `1 - s tau/T (1 - exp(-T/tau))`.
#[test]
fn a_limit_that_slips_all_the_time_has_the_mean_of_its_closed_form() {
    for (amplitude, load) in [(1e-6, 0.1), (3e-6, 0.4), (0.6e-6, 0.25)] {
        let c = contact(amplitude, 20.0, load, 2e6, 0.8e6);
        for indentation_damping in [0.5, 6.0, 40.0] {
            let mean = relative(&Contact { indentation_damping, ..c });
            assert!((mean - 1.0).abs() < 2e-3, "{amplitude} {indentation_damping}: {mean}");
        }
        for (time, share) in [(4e-6, 1.0), (30e-6, 0.5), (300e-6, 0.9)] {
            let times = 1.0 / (c.frequency * time);
            let expected = 1.0 + share * (-times).exp_m1() / times;
            let mean = relative(&Contact { bonds: Bonds::Pressed { time, share }, ..c });
            assert!((mean / expected - 1.0).abs() < 4e-3, "{amplitude} {time}: {mean} for {expected}");
        }
    }
}

/// A slow slider sticks but for the edges of a contact: its stretch grows from what the tissue holds, `x0`,
/// by the plate's way `Ut`. With the share `a` left of the largest stretch, `x0 = a Ut/(1 - a)`; of the mean
/// one, which is `(Ut/2 + x0)` for the share `d` of the cycle, `x0 = a d Ut/2/(1 - a d)`.
#[test]
fn what_the_tissue_holds_is_the_sum_of_a_geometric_series() {
    let c = contact(4e-6, 2e-6, 0.5, 2e6, 0.8e6);
    let duty = half_contact_angle(c.load_ratio(), 0.0) / PI;
    let way = c.speed * duty / c.frequency;
    let flight = (1.0 - duty) / c.frequency;
    for (share, time, spread) in [(0.5, 20e-6, 0.0), (0.9, 50e-6, 1.0), (1.2, 15e-6, 2.0f64)] {
        let times = flight / time;
        let left = if spread == 0.0 { (-times).exp() } else { (1.0 + spread * times).powf(-1.0 / spread) };
        let a = share * left;
        for (of_mean, x0) in [(0.0, a * way / (1.0 - a)), (1.0, 0.5 * a * duty * way / (1.0 - a * duty))] {
            let held = Contact { held: Held { share, time, spread, of_mean, elastic: 0.0 }, ..c };
            let expected = c.lateral_stiffness * duty * (0.5 * way + x0);
            let mean = mean_friction(&held);
            assert!((mean / expected - 1.0).abs() < 0.02, "{share} {of_mean}: {mean} for {expected}");
        }
        // Of a stretch x, x/(x + y) of the share: `x0 (x0 + Ut + y) = a (x0 + Ut)^2`.
        let elastic = 0.5 * way;
        let (half, square) = (0.5 * (way + elastic - 2.0 * a * way) / (1.0 - a), a * way * way / (1.0 - a));
        let x0 = (half * half + square).sqrt() - half;
        let held = Contact { held: Held { share, time, spread, of_mean: 0.0, elastic }, ..c };
        let expected = c.lateral_stiffness * duty * (0.5 * way + x0);
        let mean = mean_friction(&held);
        assert!((mean / expected - 1.0).abs() < 0.02, "{share} elastic: {mean} for {expected}");
    }
}
