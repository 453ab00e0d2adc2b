//! The diagnosis on sealed sets: few, fixed seeds; the full figures come from `muprime blind`.
use diagnosis::data::{RigFile, Table};
use diagnosis::{Options, Report, Verdict, diagnose};
use models::Pass;
use rayon::prelude::*;
use sim::sealed::{Ask, Stratum, generate};
use std::collections::BTreeSet;
use studies::validation::blind::distance::distance;
use studies::validation::blind::{median, score, statistic};

fn rig_of(text: &str) -> RigFile {
    toml::from_str(text).expect("rig.toml of a sealed set")
}

fn quick() -> Options {
    Options { pairs: false, ..Options::default() }
}

/// The bootstrap of one value was an interval of no width: certainty.
#[test]
fn one_value_has_no_interval() {
    let of = |values: &[f64]| statistic("x", "", values, median);
    assert_eq!((of(&[0.7]).value, of(&[0.7]).ci95), (Some(0.7), None));
    assert!(of(&[0.7, 0.8]).ci95.is_some_and(|[low, high]| low < high));
}

/// No gap: nothing is named.
#[test]
fn sets_without_a_cause_name_nothing() {
    for seed in 9001..9001 + tests::rounds(3, 6) {
        let scored = score(&generate(seed, Stratum::None, Ask::Gain), &quick()).unwrap();
        assert_ne!(scored.verdict, Verdict::Named, "seed {seed} named {:?}", scored.named);
    }
}

/// A sealed set for each cause that tables show. Its chi2 is above 100 and its gap above the floor, but for
/// gains of speed, amplitude and stiffness: the stiffnesses' own scatter takes those up.
const ONE_OF_EACH: [(&str, u64); 23] = [
    ("adhesion", 1_610_004_830_056),
    ("amplitude_droop", 1_610_004_830_003),
    ("amplitude_miscalibration", 1_680_005_040_022),
    ("amplitude_saturation", 1_610_004_830_005),
    ("contact_ageing", 1_610_004_830_035),
    ("force_crosstalk", 1_680_005_040_045),
    ("lateral_offset_drift", 1_610_004_830_006),
    ("lateral_recovery", 1_610_004_830_058),
    ("load_dependent_friction", 1_610_004_830_041),
    ("mode_shape", 1_610_004_830_022),
    ("moisture_drift", 1_610_004_830_054),
    ("multi_asperity", 1_610_004_830_046),
    ("normal_damping", 1_610_004_830_067),
    ("normal_offset", 1_610_004_830_068),
    ("plate_tilt", 1_680_005_040_012),
    ("rate_dependent_friction", 1_610_004_830_028),
    ("resonance_detuning", 1_610_004_830_020),
    ("ridge_inertia", 1_610_004_830_053),
    ("speed_error", 1_680_005_040_015),
    ("speed_ripple", 1_610_004_830_025),
    ("squeeze_film", 1_610_004_830_004),
    ("stiffness_error", 1_680_005_040_032),
    ("subsurface_relaxation", 1_610_009_660_114_490_317),
];

/// Each cause in turn taken out of the library: `unknown`, or an effect that is declared near it, but no confident other name.
#[test]
fn a_withheld_cause_is_no_other_cause() {
    let wanted: BTreeSet<&str> =
        sim::defects::ALL.iter().filter(|k| k.in_library && k.in_tables).map(|k| k.name).collect();
    let listed: BTreeSet<&str> = ONE_OF_EACH.iter().map(|(name, _)| *name).collect();
    assert_eq!(listed, wanted, "a set for each cause that tables show");
    // Every seventh one, unless all are wanted.
    let confident: Vec<String> = ONE_OF_EACH
        .par_iter()
        .step_by(tests::rounds(7, 1))
        .filter_map(|&(name, seed)| {
            let imitated = sim::defects::DefectKind::named(name).is_some_and(|kind| kind.imitated);
            let stratum = if imitated { Stratum::Alias } else { Stratum::Single };
            let set = generate(seed, stratum, Ask::Gain);
            assert_eq!(set.label.causes[0].name, name, "the set of seed {seed} has another cause by now");
            assert!(set.label.chi2_gain > 100.0, "{name}: the set of seed {seed} hardly shows it");
            let without = vec![name.to_string()];
            let scored = score(&set, &Options { without, ..Options::default() }).unwrap();
            println!("{name}: {:?} {:?} {:.2}", scored.verdict, scored.named, scored.top_probability);
            let alias = |n: &String| tests::near::near(n, name);
            let confident = scored.verdict == Verdict::Named && !scored.named.iter().all(alias);
            confident.then(|| format!("{name} as {:?}", scored.named))
        })
        .collect();
    assert!(confident.is_empty(), "{confident:?}");
}

/// Least distance of a sealed form from the library's law of its name; see `studies::validation::blind::distance`.
const LEAST_DISTANCE: f64 = 0.01;

/// The simulation's forms are not the library's: sizes, shapes, stiffnesses and `mu0` free, no law of a cause's own name leaves
/// less than a stated share of its noise-free gap. Gains of speed, amplitude and stiffness are exact aliases of a
/// recalibration, whose gap is of other sources: what they leave is printed, and counts with the others.
#[test]
fn no_sealed_form_is_the_librarys_own() {
    let distances: Vec<(&str, f64)> = ONE_OF_EACH
        .par_iter()
        .step_by(tests::rounds(2, 1))
        .map(|&(name, seed)| {
            let imitated = sim::defects::DefectKind::named(name).is_some_and(|kind| kind.imitated);
            let stratum = if imitated { Stratum::Alias } else { Stratum::Single };
            let set = generate(seed, stratum, Ask::Gain);
            (name, distance(&set).expect("a set of one cause of the library"))
        })
        .collect();
    for (name, distance) in &distances {
        println!("{name}: {distance:.3}");
    }
    // Two stiffnesses that are off by factors are that, in any generator.
    let own = distances.iter().filter(|(name, _)| *name != "stiffness_error");
    let near: Vec<_> = own.filter(|(_, d)| *d < LEAST_DISTANCE).collect();
    assert!(near.is_empty(), "nearer than {LEAST_DISTANCE} to the library's own law: {near:?}");
}

/// Priors alone make no name: a stage that slides at another speed than it says is, pass for pass, a softer
/// or harder ridge (the group `k_l U / (pi f mu0 k_n w)` of Eqs. 6-15).
#[test]
fn an_exact_alias_is_never_named_for_being_less_of_a_surprise() {
    for &seed in &[1_680_005_040_007, 1_680_005_040_015, 1_680_005_040_023][..tests::rounds(1, 3)] {
        let set = generate(seed, Stratum::Alias, Ask::Gain);
        assert_eq!(set.label.causes[0].name, "speed_error");
        let scored = score(&set, &Options::default()).unwrap();
        assert!(scored.verdict != Verdict::Named || scored.top_right, "seed {seed}: {:?}", scored.named);
        assert!(scored.class.contains(&"speed_error".to_string()), "seed {seed}: {:?}", scored.class);
    }
}

/// Ridges with a grain are stiffer in one direction; to the forces that is a stage that is faster in it. Neither is
/// named beside the other.
#[test]
fn a_grain_of_the_ridges_is_not_named_as_a_speed() {
    for &seed in &[29_116_087_348_036, 29_116_087_348_084, 29_116_087_348_073][..tests::rounds(1, 3)] {
        let set = generate(seed, Stratum::Outside, Ask::Gain);
        assert_eq!(set.label.causes[0].name, "ridge_anisotropy");
        let scored = score(&set, &Options::default()).unwrap();
        assert_eq!(scored.verdict, Verdict::Ambiguous, "seed {seed}: {:?}", scored.named);
        let both =
            ["speed_error", "stiffness_error"].iter().all(|c| scored.class.iter().any(|name| name == c));
        assert!(both, "seed {seed}: {:?}", scored.class);
    }
}

/// A gain that hides in a stiffness, beside another cause: the amplitude is half of what was asked, and the
/// plate is tilted. The tilt alone explains every pass, with a stiffness twenty deviations from its
/// calibration. The answer is two causes, with the aliases of both in the class.
#[test]
fn a_cause_does_not_hide_in_a_certified_stiffness() {
    let set = generate(1_710_005_130_388, Stratum::Pair, Ask::Gain);
    let causes: Vec<&str> = set.label.causes.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(causes, ["amplitude_miscalibration", "plate_tilt"]);
    let scored = score(&set, &Options::default()).unwrap();
    assert_eq!(scored.named.len(), 2, "{:?}", scored.named);
    let stated = |name: &&String| set.label.causes.iter().all(|c| name.contains(c.name.as_str()));
    assert!(scored.class.iter().any(|name| stated(&name)), "{:?}", scored.class);
}

/// Friction that heats up goes with load times speed: two effects of the library together nearly do. The open
/// set has that form, under which one cause does what they need two for.
#[test]
fn friction_that_heats_up_is_not_named_as_rate_and_load() {
    for &seed in &[1_710_005_130_201, 1_710_005_130_512, 1_710_005_130_543][..tests::rounds(1, 3)] {
        let set = generate(seed, Stratum::Outside, Ask::Gain);
        assert_eq!(set.label.causes[0].name, "frictional_heating");
        let scored = score(&set, &Options::default()).unwrap();
        assert_eq!(scored.verdict, Verdict::Unknown, "seed {seed}: {:?}", scored.named);
    }
}

/// An attraction by charge was named as an adhesion that is peeled faster, ridges that resonate sideways as a
/// plate off its resonance, a distorted drive as a squeeze film, while the open set had no form of them.
#[test]
fn charge_resonance_and_distortion_are_not_named_as_what_comes_near() {
    let sets = [
        (29_112_087_336_050, "triboelectric_attraction"),
        (29_112_087_336_046, "lateral_resonance"),
        (29_113_087_339_045, "second_harmonic"),
        (29_113_087_339_072, "second_harmonic"),
        (29_112_087_336_057, "triboelectric_attraction"),
        (29_112_087_336_034, "lateral_resonance"),
    ];
    for (seed, cause) in &sets[..tests::rounds(3, 6)] {
        let set = generate(*seed, Stratum::Outside, Ask::Gain);
        assert_eq!(set.label.causes[0].name, *cause);
        let scored = score(&set, &Options::default()).unwrap();
        assert_eq!(scored.verdict, Verdict::Unknown, "seed {seed}: {:?}", scored.named);
    }
}

/// A stage that slips by more the faster it slides, beside a saturation: with one gain for all speeds the
/// pair left more than its forms could be uncertain by, and was lost.
#[test]
fn a_speed_that_is_wrong_by_half_is_found_beside_another_cause() {
    let set = generate(1_910_005_730_508, Stratum::Pair, Ask::Gain);
    assert!(set.label.causes.iter().any(|c| c.name == "speed_error"));
    let scored = score(&set, &Options::default()).unwrap();
    assert!(scored.top_right, "{:?}", scored.named);
}

/// A vibration in the plane of the plate adds a force that goes with the load, more or less: a cross-talk,
/// were it not off by a third. A linear map of the readings has no such freedom.
#[test]
fn a_vibration_in_the_plane_of_the_plate_is_no_cross_talk() {
    for &seed in &[1_810_005_430_157, 2_110_006_330_095][..tests::rounds(1, 2)] {
        let set = generate(seed, Stratum::Outside, Ask::Gain);
        assert_eq!(set.label.causes[0].name, "in_plane_motion");
        let scored = score(&set, &Options::default()).unwrap();
        // A tilt that is a function of the load (0.51 here) is not told from it, and so no name.
        assert_ne!(scored.verdict, Verdict::Named, "seed {seed}: {:?}", scored.named);
        assert!(scored.probability_of_truth > 0.4, "seed {seed}: {:.3}", scored.probability_of_truth);
    }
}

/// An overdamped ridge is loss in the skin, not inertia: what it does is done by the dashpot, whatever the mass.
#[test]
fn loss_in_the_skin_is_not_called_inertia() {
    let mut right = 0;
    for &seed in &[1_710_005_130_367, 1_710_005_130_836, 1_710_005_130_155][..tests::rounds(1, 3)] {
        let set = generate(seed, Stratum::Single, Ask::Gain);
        assert_eq!(set.label.causes[0].name, "normal_damping");
        let scored = score(&set, &Options::default()).unwrap();
        println!("seed {seed}: {:?}", scored.named);
        assert!(!scored.named.iter().any(|name| name.contains("inertia")), "seed {seed}: {:?}", scored.named);
        right += usize::from(scored.top_right);
    }
    // The last is 'unknown': without its passes at 55 kHz the refit of its two shapes ends elsewhere.
    assert!(right >= tests::rounds(1, 2), "{right} are right");
}

/// The order of rows, the number of threads and the start of the clock carry no meaning.
#[test]
fn rows_threads_and_the_clocks_start_change_nothing() {
    let set = generate(9203, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let says = |passes: &[Pass], threads: usize| {
        let table = Table::measured(passes).unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| diagnose(&table, &rig, &quick(), String::new()).report)
    };
    let text = |report: &Report| serde_json::to_string(report).unwrap();
    let report = says(&set.passes, 1);
    let mut turned: Vec<Pass> = set.passes.clone();
    turned.reverse();
    assert_eq!(text(&says(&turned, 1)), text(&report));
    assert_eq!(text(&says(&set.passes, 3)), text(&report));
    let mut later = set.passes.clone();
    later.iter_mut().for_each(|pass| pass.time_s += 4096.0);
    let later = says(&later, 1);
    assert_eq!(
        (later.verdict, &later.hypotheses[0].effects),
        (report.verdict, &report.hypotheses[0].effects)
    );
}

/// Labels dealt to the wrong sets score as chance: the scorer does not leak.
#[test]
fn permuted_labels_score_as_chance() {
    let count = tests::rounds(5, 8);
    let sets: Vec<_> = (9301..9301 + count).map(|s| generate(s, Stratum::Single, Ask::Gain)).collect();
    let mut right = 0;
    for (i, set) in sets.iter().enumerate() {
        let mut wrong = set.clone();
        let other = &sets[(i + 3) % sets.len()].label;
        if other.causes[0].name == set.label.causes[0].name {
            continue;
        }
        wrong.label = other.clone();
        let scored = score(&wrong, &quick()).unwrap();
        right += usize::from(scored.top_right);
    }
    assert!(right <= 1, "{right} of {count} permuted labels were 'right'");
}

/// The saved model goes through TOML and predicts what the verdict's form predicts.
#[test]
fn a_saved_model_comes_back() {
    let set = generate(9401, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let table = Table::measured(&set.passes).unwrap();
    let result = diagnose(&table, &rig, &quick(), String::new());
    let saved = result.saved_model().expect("a verdict with a model");
    let text = toml::to_string(&saved).unwrap();
    let back: effects::corrected::SavedModel = toml::from_str(&text).unwrap();
    assert_eq!(saved, back);
    let compiled = effects::corrected::Corrected::compile_on(&back, None).unwrap();
    for (pass, f) in table.passes.iter().zip(result.predict(&table).unwrap()) {
        let got = compiled.lateral_force(pass);
        assert!((got - f.form).abs() < 1e-9 + 1e-6 * f.form.abs(), "{got} {}", f.form);
    }
}

/// One cause, whose form departs from the library's so that a second cause mends it: a zero that sinks,
/// which is a function of time, and attraction that grows with the speed, which the library has. Each is
/// named alone.
#[test]
fn a_companion_that_may_be_a_form_of_its_own_is_not_named() {
    let cases = [(7_700_023_100_086, "normal_offset"), (7_701_023_103_049, "adhesion")];
    for (seed, cause) in cases.into_iter().take(tests::rounds(1, 2)) {
        let set = generate(seed, Stratum::Single, Ask::Gain);
        assert_eq!(set.label.causes[0].name, cause, "the set of seed {seed} has another cause by now");
        let scored = score(&set, &Options::default()).unwrap();
        assert_eq!(scored.verdict, Verdict::Named, "{cause}: {:?}", scored.named);
        assert_eq!(scored.named, [cause]);
    }
}
