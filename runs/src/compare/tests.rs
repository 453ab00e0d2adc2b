use super::*;
use models::condition::Condition;
use models::quantity::Direction;
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
            mu0: 0.6,
            position_m: 0.0,
            time_s: f64::from(k),
            run_time_s: None,
            ambient_pressure_pa: None,
            temperature_c: None,
            relative_humidity_pct: None,
        };
        let friction =
            0.6 * 0.25 * mu * (1.0 + NOISE.pass_relative_sd * normal(rng)) + NOISE.force_sd_n * normal(rng);
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
    let (mut shifts, mut scatters, mut covered, mut differ) = (Vec::new(), Vec::new(), 0, 0);
    for _ in 0..2000 {
        let j = judged(&sweep(&mut rng, 0.0), &sweep(&mut rng, 0.0));
        shifts.push(j.shift_p);
        scatters.push(j.scatter_p);
        covered += usize::from(j.shift_interval_95[0] <= 0.0 && 0.0 <= j.shift_interval_95[1]);
        differ += usize::from(j.answer == Answer::Differ);
    }
    // Kolmogorov: at n = 2000 the distance is beyond 0.0436 once in a thousand.
    let (shift, scatter) = (distance(shifts), distance(scatters));
    assert!(shift < 0.0436 && scatter < 0.0436, "{shift} {scatter}");
    // Binomial with 3.3 standard deviations: 0.95 +- 0.016; at most LEVEL + 0.016 are called different.
    assert!((1868..=1932).contains(&covered), "{covered}");
    assert!(differ <= 132, "{differ}");
}

#[test]
fn a_shift_is_seen_as_often_as_is_said() {
    let mut rng = ChaCha12Rng::seed_from_u64(12);
    let visible = judged(&sweep(&mut rng, 0.0), &sweep(&mut rng, 0.0)).visible_shift;
    assert!(visible < 0.1, "{visible}");
    let seen = (0..600)
        .filter(|_| judged(&sweep(&mut rng, 0.0), &sweep(&mut rng, visible)).shift_p < LEVEL / 2.0)
        .count();
    assert!((505..=575).contains(&seen), "{seen} of 600 at 90 %");
}

/// The formula with the inverse of a full matrix of covariance, worked by hand for two conditions.
#[test]
fn the_common_shift_is_that_of_the_full_matrix() {
    let mean = |mu_relative, sd| Mean { mu_relative, sd, passes: 1 };
    let pair = |a: Mean, b: Mean| Paired {
        amplitude_pp_m: 1e-6,
        frequency_hz: 3e4,
        speed_m_s: 0.01,
        direction: 1,
        normal_force_n: 0.3,
        air: Ambient::default(),
        a,
        b,
        difference: b.mu_relative - a.mu_relative,
        difference_sd: 0.0,
    };
    let pairs = [pair(mean(0.5, 0.01), mean(0.52, 0.02)), pair(mean(0.8, 0.03), mean(0.79, 0.01))];
    let shared = 4e-4;
    let j = judge(&pairs, shared).unwrap();
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
    let one = judge(&pairs[..1], shared).unwrap();
    assert_eq!((one.scatter_p, one.answer), (1.0, Answer::CannotTell));
    assert!(judge(&[], shared).is_none());
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
