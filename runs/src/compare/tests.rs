use super::*;
use models::{Condition, Direction};
use rand::SeedableRng;
use rand_chacha::ChaCha12Rng;

const NOISE: PassNoise = PassNoise { pass_relative_sd: 0.015, force_sd_n: 0.0008 };

/// A standard normal number.
fn normal(rng: &mut ChaCha12Rng) -> f64 {
    use rand::RngExt;
    Normal::standard().inverse_cdf(rng.random_range(1e-12..1.0))
}

/// Passes of a run whose `mu'` is that of a made law, moved by `shift`, with the stated noise.
fn sweep(rng: &mut ChaCha12Rng, shift: f64) -> Vec<Pass> {
    sweep_over(rng, shift, 0.6)
}

/// The same over this `mu_0`.
fn sweep_over(rng: &mut ChaCha12Rng, shift: f64, mu0: f64) -> Vec<Pass> {
    let mut passes = Vec::new();
    for k in 0..24u32 {
        let w_m = if k % 4 == 0 { 0.0 } else { 0.4e-6 * f64::from(k) };
        let mu = if w_m == 0.0 { 1.0 } else { 1.0 / (1.0 + 4e5 * w_m) + shift };
        let condition = Condition {
            amplitude: PeakToPeak::from_metres(w_m),
            frequency_hz: 27_500.0,
            speed_m_s: 0.02,
            direction: Direction::Forward,
            normal_force_n: 0.25,
            mu0,
            position_m: 0.0,
            time_s: f64::from(k),
            run_time_s: None,
            ambient_pressure_pa: None,
            temperature_c: None,
            relative_humidity_pct: None,
        };
        let friction =
            mu0 * 0.25 * mu * (1.0 + NOISE.pass_relative_sd * normal(rng)) + NOISE.force_sd_n * normal(rng);
        let mut pass = Pass::at(u64::from(k), &condition, Some(friction));
        pass.normal_force_n += NOISE.force_sd_n * normal(rng);
        passes.push(pass);
    }
    passes
}

fn judged(a: &[Pass], b: &[Pass]) -> Judged {
    let [a, b] = [a, b].map(|passes| Side { passes: passes.to_vec(), sets: [false; 3], noise: NOISE });
    let result = compare([&a, &b], [a.reference().unwrap(), b.reference().unwrap()]);
    assert_eq!((result.pairs.len(), result.unpaired), (18, [0, 0]));
    result.judged.unwrap()
}

/// Largest distance between the distribution of p-values and the uniform one.
fn distance(mut p: Vec<f64>) -> f64 {
    p.sort_by(f64::total_cmp);
    let n = p.len() as f64;
    p.iter()
        .enumerate()
        .map(|(i, p)| (p - i as f64 / n).abs().max((p - (i + 1) as f64 / n).abs()))
        .fold(0.0, f64::max)
}

#[test]
fn pairs_without_a_difference_have_uniform_p_values_and_intervals_cover() {
    let mut rng = ChaCha12Rng::seed_from_u64(11);
    let (mut shifts, mut scatters, mut ratios) = (Vec::new(), Vec::new(), Vec::new());
    let (mut covered, mut differ, mut furthest) = (0, 0, 0);
    for _ in 0..2000 {
        let j = judged(&sweep(&mut rng, 0.0), &sweep(&mut rng, 0.0));
        shifts.push(j.shift_p);
        scatters.push(j.scatter_p);
        ratios.push(j.mu0_p);
        furthest += usize::from(j.furthest_p < LEVEL / 4.0);
        covered += usize::from(j.shift_interval_95[0] <= 0.0 && 0.0 <= j.shift_interval_95[1]);
        differ += usize::from(j.answer == ComparisonAnswer::Differ);
    }
    // Kolmogorov: at n = 2000 the distance is beyond 0.0436 once in a thousand.
    let [shift, scatter, mu0] = [shifts, scatters, ratios].map(distance);
    assert!(shift < 0.0436 && scatter < 0.0436 && mu0 < 0.0436, "{shift} {scatter} {mu0}");
    // Binomial with 3.3 standard deviations: 0.95 +- 0.016; at most LEVEL + 0.016 are called different, and
    // of the furthest conditions LEVEL / 4 + 0.008.
    assert!((1868..=1932).contains(&covered), "{covered}");
    assert!(differ <= 132 && (9..=41).contains(&furthest), "{differ} {furthest}");
}

#[test]
fn a_shift_is_seen_as_often_as_is_said() {
    let mut rng = ChaCha12Rng::seed_from_u64(12);
    let Judged { visible_shift: shift, visible_mu0: change, .. } =
        judged(&sweep(&mut rng, 0.0), &sweep(&mut rng, 0.0));
    assert!(shift < 0.1 && change < 0.1, "{shift} {change}");
    let (mut shifts, mut changes) = (0, 0);
    for _ in 0..600 {
        let first = sweep(&mut rng, 0.0);
        shifts += usize::from(judged(&first, &sweep(&mut rng, shift)).shift_p < LEVEL / 4.0);
        let changed = sweep_over(&mut rng, 0.0, 0.6 * (1.0 + change));
        changes += usize::from(judged(&first, &changed).mu0_p < LEVEL / 4.0);
    }
    for seen in [shifts, changes] {
        assert!((505..=575).contains(&seen), "{seen} of 600 at 90 %");
    }
}

/// Friction that was 30 % higher everywhere was no difference: mu' alone was judged.
#[test]
fn friction_that_is_higher_everywhere_is_a_difference_of_mu_0() {
    let mut rng = ChaCha12Rng::seed_from_u64(13);
    let sides = [0.6, 0.78].map(|mu0| Side {
        passes: sweep_over(&mut rng, 0.0, mu0),
        sets: [false; 3],
        noise: NOISE,
    });
    let [a, b] = &sides;
    let found = compare([a, b], [a.reference().unwrap(), b.reference().unwrap()]);
    assert_eq!(found.answer_words(), "the runs differ in mu_0 by more than their uncertainty explains");
    assert_eq!(found.judged.as_ref().unwrap().differ_in, ["mu_0"]);
    let figures = found.figures_words();
    assert!(figures.last().unwrap().ends_with("% (p < 1e-6)"), "{figures:?}");
}

/// One condition of 80 at 4.5 standard deviations hid among the others: chi2 is near its degrees of freedom.
#[test]
fn a_change_at_one_condition_is_seen_among_many() {
    let reference = Reference { mu0: 0.5, relative_sd: 0.004 };
    let difference = |i: usize| match i {
        33 => 0.045,
        i if i % 2 == 0 => 0.009,
        _ => -0.009,
    };
    let of = |i: usize| {
        let mean = |mu_relative| Mean { mu_relative, sd: 0.01 * 0.5f64.sqrt(), passes: 3 };
        pair(mean(0.5), mean(0.5 + difference(i)))
    };
    let pairs: Vec<Paired> = (0..80).map(of).collect();
    let found = RunComparison {
        references: [reference; 2],
        unpaired: [0; 2],
        judged: judge(&pairs, &[reference; 2]),
        pairs,
    };
    let j = found.judged.as_ref().unwrap();
    assert!(j.shift_p > 0.1 && j.scatter_p > 0.1, "{j:?}");
    assert!(j.furthest_p < 1e-3 && j.visible_at_one < 0.06, "{j:?}");
    assert_eq!((j.answer, &j.differ_in[..]), (ComparisonAnswer::Differ, &["mu_relative"][..]));
    assert!(found.answer_words().starts_with("the runs differ in mu' by"), "{}", found.answer_words());
    assert!(found.figures_words()[2].starts_with("furthest: +0.045 +- 0.010 at"));
}

fn pair(a: Mean, b: Mean) -> Paired {
    Paired {
        amplitude_pp_m: 1e-6,
        frequency_hz: 3e4,
        speed_m_s: 0.01,
        direction: 1,
        normal_force_n: 0.3,
        air: Ambient::default(),
        a,
        b,
        difference: b.mu_relative - a.mu_relative,
        difference_sd: a.sd.hypot(b.sd),
    }
}

/// The formula with the inverse of a full matrix of covariance, worked by hand for two conditions.
#[test]
fn the_common_shift_is_that_of_the_full_matrix() {
    let mean = |mu_relative, sd| Mean { mu_relative, sd, passes: 1 };
    let pairs = [pair(mean(0.5, 0.01), mean(0.52, 0.02)), pair(mean(0.8, 0.03), mean(0.79, 0.01))];
    let shared = 4e-4;
    let references = [Reference { mu0: 0.5, relative_sd: 2e-4f64.sqrt() }; 2];
    let j = judge(&pairs, &references).unwrap();
    let m = [0.51, 0.795];
    let (p, q, r) = (5e-4 + shared * m[0] * m[0], 1e-3 + shared * m[1] * m[1], shared * m[0] * m[1]);
    let information = (p + q - 2.0 * r) / (p * q - r * r);
    let shift = ((q - r) * 0.02 - (p - r) * 0.01) / (p + q - 2.0 * r);
    assert!(
        (j.shift - shift).abs() < 1e-12 && (j.shift_sd - information.recip().sqrt()).abs() < 1e-12,
        "{j:?}"
    );
    // With one degree of freedom, the scatter is the difference of the two by its own uncertainty.
    let chi2 = 0.03f64.powi(2) / (p + q - 2.0 * r);
    assert!((j.scatter_chi2 - chi2).abs() < 1e-9, "{} {chi2}", j.scatter_chi2);
    // A single condition has no scatter, and few conditions never agree.
    let one = judge(&pairs[..1], &references).unwrap();
    assert_eq!((one.scatter_p, one.answer), (1.0, ComparisonAnswer::CannotTell));
    assert!(judge(&[], &references).is_none());
}

#[test]
fn one_value_in_two_units_is_no_difference() {
    let facts = |amplitude: &str, frequencies: &str| {
        crate::run_dir::RecordFacts::from([
            ("plan.toml: base.amplitude_pp_m".into(), amplitude.into()),
            ("plan.toml: frequency_hz".into(), frequencies.into()),
        ])
    };
    let (words, numbers) = (facts("\"2um\"", "[\"27.5kHz\", 30000]"), facts("2e-6", "[27500, 3e4]"));
    assert_eq!(differences::between(&words, &numbers), []);
    let differ = differences::between(&words, &facts("\"3um\"", "[27500, 3e4]"));
    assert_eq!((differ.len(), differ[0].a.as_deref()), (1, Some("\"2um\"")));
}

#[test]
fn the_same_seed_in_virtual_time_and_the_same_bytes_are_reported() {
    let facts = |seed: &str, clock: &str| {
        crate::run_dir::RecordFacts::from([("seed".into(), seed.into()), ("clock".into(), clock.into())])
    };
    let (two, three) = (facts("2", "virtual"), facts("3", "virtual"));
    assert!(differences::warnings(&two, &three, false).is_empty());
    assert!(differences::warnings(&facts("2", "monotonic"), &facts("2", "monotonic"), false).is_empty());
    assert_eq!(differences::warnings(&two, &two, true).len(), 2);
    let differ = differences::between(&two, &three);
    assert_eq!((differ.len(), differ[0].what.as_str(), differ[0].b.as_deref()), (1, "seed", Some("3")));
}
