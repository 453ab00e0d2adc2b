//! The diagnosis on sealed sets: few, fixed seeds; the full figures come from `muprime blind`.
use diagnosis::attribute::Verdict;
use diagnosis::data::{Rig, Table};
use diagnosis::hypotheses::Options;
use diagnosis::verdict::diagnose;
use models::record::Pass;
use rig::blind::score;
use sim::sealed::{Ask, Stratum, generate};

fn rig_of(text: &str) -> Rig {
    toml::from_str(text).expect("rig.toml of a sealed set")
}

fn quick() -> Options {
    Options { pairs: false, ..Options::default() }
}

/// No gap: nothing is named.
#[test]
fn sets_without_a_cause_name_nothing() {
    for seed in 9001..9007 {
        let scored = score(&generate(seed, Stratum::None, Ask::Gain), &quick()).unwrap();
        assert_ne!(scored.verdict, Verdict::Named, "seed {seed} named {:?}", scored.named);
    }
}

/// The cause taken out of the library: `unknown`, or a declared alias, but not a confident other name.
#[test]
fn a_withheld_cause_is_no_other_cause() {
    let (mut confident, mut tried) = (Vec::new(), 0);
    for seed in 9100..9112 {
        let set = generate(seed, Stratum::Single, Ask::Imitators);
        // An effect that another imitates on this very table may rightly bear the other's name.
        let imitated = set.label.imitators.iter().any(|i| i.share_left < 0.1);
        if set.label.chi2_gain < 60.0 || imitated {
            continue;
        }
        tried += 1;
        let truth = set.label.causes[0].name.clone();
        let options = Options { without: vec![truth.clone()], ..quick() };
        let scored = score(&set, &options).unwrap();
        if scored.verdict == Verdict::Named {
            confident.push((seed, truth, scored.named));
        }
    }
    assert!(tried >= 4, "only {tried} sets were testable");
    assert!(confident.len() * 4 <= tried, "{confident:?} of {tried}");
}

/// The order of rows and the numbers of points carry no meaning.
#[test]
fn the_order_of_rows_carries_no_meaning() {
    let set = generate(9201, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let mut turned: Vec<Pass> = set.passes.clone();
    turned.reverse();
    let says = |passes: &[Pass]| {
        let table = Table::measured(passes).unwrap();
        serde_json::to_string(&diagnose(&table, &rig, &quick(), String::new()).report).unwrap()
    };
    assert_eq!(says(&set.passes), says(&turned));
}

/// The same answer whatever the number of threads.
#[test]
fn threads_do_not_change_the_answer() {
    let set = generate(9202, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let table = Table::measured(&set.passes).unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            serde_json::to_string(&diagnose(&table, &rig, &quick(), String::new()).report).unwrap()
        })
    };
    assert_eq!(with(1), with(3));
}

/// Forces in another unit of time or place: starting the clock elsewhere changes nothing.
#[test]
fn the_clock_may_start_anywhere() {
    let set = generate(9203, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let mut later = set.passes.clone();
    for p in &mut later {
        p.time_s += 4096.0;
    }
    let verdict = |passes: &[Pass]| {
        let report = diagnose(&Table::measured(passes).unwrap(), &rig, &quick(), String::new()).report;
        (report.verdict, report.hypotheses[0].effects.clone())
    };
    assert_eq!(verdict(&set.passes), verdict(&later));
}

/// Labels dealt to the wrong sets score as chance: the scorer does not leak.
#[test]
fn permuted_labels_score_as_chance() {
    let sets: Vec<_> = (9301..9309).map(|s| generate(s, Stratum::Single, Ask::Gain)).collect();
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
    assert!(right <= 1, "{right} of 8 permuted labels were 'right'");
}

/// The saved model goes through TOML and predicts what the verdict's form predicts.
#[test]
fn a_saved_model_comes_back() {
    let set = generate(9401, Stratum::Single, Ask::Gain);
    let rig = rig_of(&set.rig_toml);
    let table = Table::measured(&set.passes).unwrap();
    let result = diagnose(&table, &rig, &quick(), String::new());
    let Some(saved) = result.saved_model() else { return };
    let text = toml::to_string(&saved).unwrap();
    let back: effects::corrected::SavedModel = toml::from_str(&text).unwrap();
    assert_eq!(saved, back);
    let compiled = effects::corrected::Corrected::compile(&back).unwrap();
    for (pass, f) in table.passes.iter().zip(result.predict(&table)) {
        let got = compiled.lateral_force(pass);
        assert!((got - f.form).abs() < 1e-9 + 1e-6 * f.form.abs(), "{got} {}", f.form);
    }
}
