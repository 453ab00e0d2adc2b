//! Which reading of the paper's w holds: the bundled plan 'psi-reading' on rigs whose Psi* is known, decided
//! again and again for each.
//!
//! Two natures: the paper's finite element ridge, by its table, at a multiple of the stroke, on the virtual
//! rig in virtual time and at once with many mu_0; and Eq. 20 itself.

use models::psi::{PsiEq17, relative_friction};
use models::reading_evidence::{ReadingDecision, ReadingFinding, of_passes};
use models::{Condition, Finger, PassNoise, PeakToPeak, Reading, SpringSlider, Surrogate};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use runs::plan::{Plan, Resolution};
use runs::{Outcome, Setup};
use sim::world::WorldConfig;
use std::sync::Arc;
use tests::memory::sweep_in_memory;
use tests::{documents, muprime, rounds};

#[path = "reading/psi_star.rs"]
mod psi_star;

const FIRST_SEED: u64 = 23_000;

/// Sweeps of each nature.
fn sweeps() -> u64 {
    rounds(20, 200)
}

/// Psi* of each nature, and what should be said of it.
const NATURES: [(f64, ReadingDecision); 3] = [
    (2.38, ReadingDecision::PeakToPeak),
    (1.19, ReadingDecision::SineAmplitude),
    (1.683, ReadingDecision::Between),
];

/// Psi* of the finite element ridge at the amplitudes of Fig. 12's caption (docs/ridge.md).
const RIDGES_PSI_STAR: f64 = 1.36;
/// Multiples of the stroke by which the ridge's plate moves, and what should be said: twice is the first
/// reading, once the second; the third lies equally far from both.
const RIDGES: [(f64, ReadingDecision); 3] = [
    (2.0, ReadingDecision::PeakToPeak),
    (1.0, ReadingDecision::SineAmplitude),
    (1.683 / RIDGES_PSI_STAR, ReadingDecision::Between),
];

/// How often each decision fell, in the order right, undecided, wrong; and the mean of the nats.
#[derive(Default, Debug)]
struct Tally {
    right: usize,
    other: usize,
    wrong: usize,
    nats: f64,
    psi_star: f64,
}

fn tally(expected: ReadingDecision, findings: &[ReadingFinding]) -> Tally {
    let mut told = Tally::default();
    for f in findings {
        let opposite = match expected {
            ReadingDecision::PeakToPeak => f.decision == ReadingDecision::SineAmplitude,
            ReadingDecision::SineAmplitude => f.decision == ReadingDecision::PeakToPeak,
            _ => matches!(f.decision, ReadingDecision::PeakToPeak | ReadingDecision::SineAmplitude),
        };
        told.right += usize::from(f.decision == expected);
        told.wrong += usize::from(opposite);
        told.other += usize::from(f.decision != expected && !opposite);
        told.nats += f.nats / findings.len() as f64;
        told.psi_star += f.psi_star.ln() / findings.len() as f64;
    }
    told.psi_star = told.psi_star.exp();
    told
}

/// Per cent of the sweeps that must say what is so.
const ASKED: usize = 95;

fn show(nature: &str, psi_star: f64, told: &Tally) {
    println!(
        "{nature:<44} Psi* {psi_star:.2}: right {:>3}, undecided {:>3}, wrong {:>3} of {}; mean {:+.1} nats, Psi* found {:.2}",
        told.right,
        told.other,
        told.wrong,
        sweeps(),
        told.nats,
        told.psi_star
    );
}

#[test]
fn the_plan_decides_on_a_virtual_rig_built_under_either_reading() {
    for (strokes, expected) in RIDGES {
        let told = tally(expected, &on_the_virtual_rig(strokes));
        show("virtual rig, finite element ridge", RIDGES_PSI_STAR * strokes, &told);
        assert!(told.right * 100 >= ASKED * sweeps() as usize, "{told:?}");
    }
}

/// The virtual rig's own finger, a slider on springs, is no rig of either reading: at the plan's conditions
/// its best exponential lies between, nearer to the second, with stiffnesses that scatter by 5 %.
#[test]
fn the_spring_slider_lies_between() {
    let told = tally(ReadingDecision::Between, &on_the_virtual_rig(0.0));
    show("virtual rig, slider on springs", told.psi_star, &told);
    assert!(told.right * 100 >= 50 * sweeps() as usize && (1.3..1.6).contains(&told.psi_star), "{told:?}");
}

/// The plan's sweeps in virtual time; no strokes: the slider.
fn on_the_virtual_rig(strokes: f64) -> Vec<ReadingFinding> {
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = Plan::load("psi-reading").unwrap();
    let model = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut world = WorldConfig::ideal();
    world.finger.ridge_table_strokes = strokes;
    (0..sweeps())
        .into_par_iter()
        .map(|i| {
            let run =
                sweep_in_memory(&setup, &plan, FIRST_SEED + i, &world, Arc::clone(&model) as _, &mut |_| {})
                    .unwrap();
            assert_eq!(run.outcome, Outcome::Complete);
            let passes =
                run.passes.iter().filter_map(|p| Some((p.pass.condition(1.0), p.pass.friction_force_n()?)));
            of_passes(passes, setup.tip.finger.poisson_ratio, setup.file.noise, 0.0).unwrap()
        })
        .collect()
}

struct Draw(ChaCha8Rng);

impl Draw {
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| f64::from(self.0.next_u32()) / f64::from(u32::MAX)).sum::<f64>() - 6.0
    }
}

/// The plan's passes under a nature, with the stated noise: a rig's own mu_0 between 0.35 and 0.7.
fn swept(mu_relative: impl Fn(&Condition) -> f64 + Sync, conditions: usize) -> Vec<ReadingFinding> {
    let setup = Setup::load("virtual-ideal").unwrap();
    let mut plan = Plan::load("psi-reading").unwrap();
    plan.file.series.truncate(conditions);
    let noise: PassNoise = setup.file.noise;
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    (0..sweeps())
        .into_par_iter()
        .filter_map(|i| {
            let mut draw = Draw(ChaCha8Rng::seed_from_u64(FIRST_SEED + i));
            let mu0 = 0.5 * (0.2 * draw.normal()).clamp(-0.35, 0.35).exp();
            let points = plan.points(FIRST_SEED + i, &setup.config.limits, &resolution).unwrap();
            let passes = points.into_iter().map(|point| {
                let c = Condition { mu0, ..point.condition };
                let still = c.amplitude == PeakToPeak::ZERO;
                let mu = if still { 1.0 } else { mu_relative(&c) };
                let force = mu * mu0 * c.normal_force_n * (1.0 + noise.pass_relative_sd * draw.normal());
                (c, force + noise.force_sd_n * draw.normal())
            });
            // None where a sweep shows too little friction that is lowered: no answer, and not a right one.
            of_passes(passes, setup.tip.finger.poisson_ratio, noise, 0.0)
        })
        .collect()
}

/// The ridge's own Psi* is 1.25 of its stroke, 1.36 at the amplitudes of Fig. 12's caption (docs/ridge.md):
/// on a rig where it moves by twice what is measured it is twice that, which is the first reading; in the
/// middle the two readings lie equally far from it. Fewer conditions decide as often here, but rest on the
/// form of the law at one amplitude.
#[test]
fn the_plan_decides_where_the_finite_element_ridge_is_the_truth() {
    let ridge = Surrogate::shipped().unwrap();
    for conditions in 1..=3 {
        for (strokes, expected) in RIDGES {
            let mu = |c: &Condition| {
                let moves = PeakToPeak::from_metres(c.amplitude.metres() * strokes);
                ridge.at(moves, c.frequency_hz, c.speed_m_s / c.mu0, c.normal_force_n, 28.3e6).mu_relative
            };
            let told = tally(expected, &swept(mu, conditions));
            show(
                &format!("finite element ridge, {} passes", 2 * conditions),
                RIDGES_PSI_STAR * strokes,
                &told,
            );
            assert!(conditions < 3 || told.right * 100 >= ASKED * sweeps() as usize, "{told:?}");
        }
    }
}

/// Eq. 20 itself, and how many conditions it takes: two passes each, and a reference.
#[test]
fn the_plan_has_the_fewest_passes_that_decide() {
    let law = |psi_star: f64| {
        move |c: &Condition| relative_friction(PsiEq17::at(c, Finger::paper().poisson_ratio), psi_star)
    };
    for conditions in 1..=3 {
        for (psi_star, expected) in NATURES {
            let told = tally(expected, &swept(law(psi_star), conditions));
            show(&format!("Eq. 20, {conditions} conditions, {} passes", 2 * conditions), psi_star, &told);
            assert_eq!(told.wrong, 0, "{told:?}");
            assert!(conditions < 3 || told.right * 100 >= 95 * sweeps() as usize, "{told:?}");
        }
    }
}

/// What the commands tell: of a sweep, of its folder, of a rig that cannot be.
#[test]
fn run_diagnose_check_and_point_tell_it() {
    let folder = tempfile::tempdir().unwrap();
    let (setup, out) = (folder.path().join("ridge.toml"), folder.path().join("run"));
    let told = |words: &[&str]| {
        let ended = muprime().arg("--json").args(words).env("MUPRIME_RUNS", folder.path()).output().unwrap();
        (ended.status.code(), documents(&ended))
    };
    let with = |strokes: f64| {
        let text = Setup::load("virtual-ideal").unwrap().text;
        let text = text.replace("ideal = true", &format!("ideal = true\nridge_table_strokes = {strokes:.1}"));
        std::fs::write(&setup, text).unwrap();
    };
    let (setup, out) = (setup.to_str().unwrap(), out.to_str().unwrap());
    with(-1.0);
    assert_eq!(told(&["check", setup]).0, Some(2));
    assert_eq!(told(&["run", "psi-reading", "--setup", setup, "--fast", "--out", out]).0, Some(2));
    with(1.0);
    let (status, run) = told(&["run", "psi-reading", "--setup", setup, "--fast", "--out", out]);
    assert_eq!(status, Some(0), "{run:?}");
    let verdict = &told(&["diagnose", out]).1[0];
    let reading = &verdict["psi_reading"];
    assert_eq!(
        (&reading["decision"], &reading["judged"]),
        (&"sine_amplitude".into(), &6.into()),
        "{reading}"
    );
    let remarks = verdict["remarks"].as_array().unwrap();
    assert!(remarks.iter().any(|r| r.as_str().unwrap().starts_with("Eq. 20 of the paper")), "{remarks:?}");
    // It is a question about the paper: a run does not answer it.
    let page = std::fs::read_to_string(format!("{out}/report.html")).unwrap();
    for word in ["favour", "readings of", "sine's amplitude"] {
        assert!(!format!("{run:?}{page}").contains(word), "{word}: {run:?}");
    }
    let stated = &run.last().unwrap()["summary"]["psi_star"];
    let stated = ["low", "psi_star", "high"].map(|key| stated[key].as_f64().unwrap());
    assert!(stated.is_sorted() && page.contains("for the peak-to-peak amplitude"), "{stated:?}");

    let point = &told(&["model", "point", "--model", "psi"]).1[0];
    let number = |value: &serde_json::Value, key: &str| value[key].as_f64().unwrap();
    let [stroke, sine] = [0, 1].map(|k| number(&point["readings"][k], "mu_relative"));
    // Eq. 20 by hand: Psi = 0.02 / (2e-6 * 27500 * 0.5 * 1.33) = 0.5468.
    assert!((stroke - 0.2053).abs() < 5e-5 && (sine - 0.3684).abs() < 5e-5, "{point}");
    assert!((number(point, "mu_relative") - 0.5 * (stroke + sine)).abs() < 1e-12);
    assert!(number(point, "mu_relative_sd") > 0.5 * (sine - stroke), "{point}");
    assert_eq!(told(&["model", "point", "--reading", "sine-amplitude"]).0, Some(2));
}

/// A rig that follows neither: far above and below, that is what is said.
#[test]
fn what_neither_reading_explains_is_given_to_neither() {
    for psi_star in [0.5, 6.0] {
        let law = |c: &Condition| relative_friction(PsiEq17::at(c, Finger::paper().poisson_ratio), psi_star);
        let told = tally(ReadingDecision::Neither, &swept(law, 3));
        show("Eq. 20, far from both", psi_star, &told);
        assert!(told.right * 100 >= 95 * sweeps() as usize, "{told:?}");
    }
}

/// One pass that is off by a lot does not decide, and without a pass without vibration nothing is said.
#[test]
fn a_bad_pass_does_not_decide_and_mu_0_must_be_known() {
    let noise = PassNoise::default();
    let of = |passes: &[(Condition, f64)]| of_passes(passes.iter().copied(), 0.33, noise, 0.0);
    let at = |um: f64, speed_m_s: f64| Condition {
        amplitude: PeakToPeak::from_metres(um * 1e-6),
        speed_m_s,
        ..Condition::paper()
    };
    assert!(of(&[(at(2.0, 0.048), 0.05)]).is_none());
    let mut passes = vec![(at(0.0, 0.02), 0.125)];
    assert!(of(&passes).is_none());
    let force = |c: &Condition, star: f64| 0.125 * relative_friction(PsiEq17::at(c, 0.33), star);
    for (um, speed) in [(1.0, 0.024), (2.0, 0.048), (3.0, 0.072)] {
        passes.extend([(at(um, speed), force(&at(um, speed), 2.38)); 2]);
    }
    let before = of(&passes).unwrap();
    assert_eq!(before.decision, ReadingDecision::PeakToPeak);
    // As it would be under the other reading, and as no law has it.
    for bad in [force(&at(2.0, 0.048), 1.19), 1.0, -1.0] {
        let after = of(&[&passes[..], &[(at(2.0, 0.048), bad)]].concat()).unwrap();
        assert_ne!(after.decision, ReadingDecision::SineAmplitude, "{bad}: {before:?} {after:?}");
    }
    assert_eq!(Reading::ALL.map(|r| r.psi_star().0), [2.38, 1.19]);
}
