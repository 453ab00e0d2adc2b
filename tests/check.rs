//! `check` against `run`: what one refuses, the other refuses; with place, cause and remedy, and all at once.

use models::Pass;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tests::{documents, muprime, rounds, texts};

fn checked(words: &[&str], file: &Path) -> (Option<i32>, Value) {
    let output = muprime().args(["check", "--json"]).args(words).arg(file).output().unwrap();
    let said = documents(&output);
    assert_eq!(said.len(), 1, "{:?}", texts(&output));
    (output.status.code(), said[0].clone())
}

/// Good files of every kind, made by the program itself: a run's folder, a verdict with its model, a certificate.
struct Made {
    folder: tempfile::TempDir,
}

const PLAN: &str = "name = \"small\"\nseed = 3\nreference_every = 4\nreplicates = 1\n\n[pass]\nsettle_s = 0.1\nmeasure_s = 0.15\n\
    approach_speed_m_s = 0.2\n\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n\
    position_m = 0.0\n\n[[series]]\nname = \"a\"\namplitude_pp_m = [0.6e-6, 1.2e-6, 2.5e-6]\nspeed_m_s = [0.02, 0.05]\n";
const RIG: &str = "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n[noise]\npass_relative_sd = 0.015\n\
    force_sd_n = 0.0008\n[calibration]\namplitude_gain_sd = 0.02\n";
const DEFECTS: &str = "[[defect]]\nname = \"squeeze_film\"\nseed = 1\n";

impl Made {
    fn new() -> Self {
        let made = Made { folder: tempfile::tempdir().unwrap() };
        std::fs::write(made.at("plan.toml"), PLAN).unwrap();
        let run = muprime()
            .args(["run", "--setup", "virtual", "--fast", "--out"])
            .arg(made.at("run"))
            .arg(made.at("plan.toml"))
            .env("MUPRIME_RUNS", made.folder.path())
            .output()
            .unwrap();
        assert_eq!(run.status.code(), Some(0), "{}", texts(&run).1);
        let verdict = muprime()
            .args(["diagnose", "--json", "--no-pairs"])
            .arg(made.at("run"))
            .arg("--save-model")
            .arg(made.at("model.toml"))
            .output()
            .unwrap();
        assert_eq!(verdict.status.code(), Some(0), "{}", texts(&verdict).1);
        std::fs::write(made.at("verdict.json"), &verdict.stdout).unwrap();
        std::fs::write(made.at("rig.toml"), RIG).unwrap();
        std::fs::write(
            made.at("setup.toml"),
            runs::bundled::text(runs::setup::BUNDLED, "virtual-ideal").unwrap(),
        )
        .unwrap();
        std::fs::write(made.at("tip.toml"), runs::fingertip::BUNDLED[0].1).unwrap();
        std::fs::write(made.at("profile.toml"), drivers::bundled::text("muprime-force2").unwrap()).unwrap();
        made
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.at(name)).unwrap()
    }
}

/// A certificate of today, as `calibrate` would write it.
fn certificate() -> String {
    use calibration::certificate::{
        CalibrationResult, CertificateKind, Instrument, Occasion, Parameter, RawData, Residuals,
    };
    let now = tests::waiting::now_unix_s() as u64;
    let parameter = Parameter {
        name: "delay".into(),
        value: 1e-3,
        unit: "s".into(),
        standard_uncertainty: 1e-5,
        degrees_of_freedom: 20.0,
        ci95: [0.98e-3, 1.02e-3],
    };
    let outcome = CalibrationResult {
        kind: CertificateKind::Latency,
        model: "a delay".into(),
        settings: Default::default(),
        remarks: Vec::new(),
        parameters: vec![parameter],
        covariance: nalgebra::DMatrix::from_element(1, 1, 1e-10),
        residuals: Residuals { count: 20, sd: 1e-5, largest: 2e-5, unit: "s".into(), lack_of_fit_p: None },
        temperature_c: None,
        range: Default::default(),
        budget: Vec::new(),
    };
    let occasion = Occasion {
        unix_s: now as i64 - 3600,
        operator: "A. Smith".into(),
        instrument: Instrument { name: "cell".into(), serial: "SN1".into() },
        raw_data: RawData::of("edges.csv", b"edges", 20),
        valid_days: 30.0,
    };
    outcome.certify(&occasion).to_toml()
}

/// File, what is changed in it to what, and a word that its refusal must hold.
type Wrong = (&'static str, &'static str, &'static str, &'static str);

/// Files as people get them wrong. An empty `from` stands for the whole file.
const WRONG: &[Wrong] = &[
    ("plan.toml", "normal_force_n = 0.25", "normal_force_n = -0.25", "normal_force_n"),
    ("plan.toml", "frequency_hz = 27500", "frequency_hz = 27.5", "kHz meant?"),
    ("plan.toml", "frequency_hz = 27500", "frequency_hz = 27.5e9", "frequency_hz"),
    ("plan.toml", "0.6e-6", "2.0", "\u{b5}m meant?"),
    ("plan.toml", "0.6e-6", "nan", "amplitude_pp_m"),
    ("plan.toml", "0.6e-6", "inf", "amplitude_pp_m"),
    ("plan.toml", "normal_force_n = 0.25", "normal_force_n = 250", "mN meant?"),
    ("plan.toml", "speed_m_s = [0.02, 0.05]", "speed_m_s = [20, 50]", "mm/s meant?"),
    ("plan.toml", "position_m = 0.0", "position_m = 5", "position_m"),
    ("plan.toml", "measure_s = 0.15", "measure_s = 100", "stroke"),
    ("plan.toml", "measure_s = 0.15", "measure_s = inf", "measure_s"),
    ("plan.toml", "settle_s = 0.1", "settle_s = -1", "settle_s"),
    ("plan.toml", "seed = 3", "sead = 3", "did you mean `seed`?"),
    ("plan.toml", "seed = 3", "seed = \"three\"", "seed"),
    ("plan.toml", "seed = 3", "directions = [2]", "directions"),
    ("plan.toml", "replicates = 1", "replicates = 0", "replicates"),
    ("plan.toml", "replicates = 1", "replicates = 1000\ndirections = []", "directions"),
    ("plan.toml", "[[series]]", "[series]", "series"),
    ("plan.toml", "frequency_hz = 27500\n", "", "frequency_hz"),
    ("plan.toml", "[base]", "[base", "plan.toml"),
    ("setup.toml", "muprime-force2", "no-such", "no profile is called `no-such`"),
    ("setup.toml", "[[force]]", "[[force]]\nlateral = { signal = \"nope\" }", "nope"),
    ("setup.toml", "[[force]]", "[[force]]\nlateral = { signal = \"lateral\", gain = 0 }", "gain"),
    ("setup.toml", "profile = \"muprime-amplifier\"", "profile = \"muprime-stage\"", "muprime-stage"),
    ("setup.toml", "profile = \"muprime-stage\"", "profile = \"muprime-force2\"", "muprime-force2"),
    ("setup.toml", "rate_hz = 1000", "rate_hz = 1", "kHz meant?"),
    ("setup.toml", "priority = 80", "priority = 120", "priority"),
    ("setup.toml", "priority = 80", "priority = 80\ncpu = 99999999", "counted from 0 to 1023"),
    ("setup.toml", "window = 50", "window = 0", "window"),
    ("setup.toml", "normal_force_min_n = 0.02", "normal_force_min_n = -0.02", "normal_force_min_n"),
    ("setup.toml", "sample_sd_n = 0.002", "sample_sd_n = 0", "sample_sd_n"),
    ("setup.toml", "sample_sd_n = 0.002", "sample_sd_n = 21.1", "multiply them by the gain"),
    ("setup.toml", "artificial-silicone", "no-tip", "no-tip"),
    ("setup.toml", "[limits]", "[limits]\nspeed_max_m_s = 250", "mm/s meant?"),
    ("setup.toml", "[limits]", "[limits]\nfrozen_after = 1", "frozen_after"),
    ("setup.toml", "[limits]", "[limits]\ntravel_min_m = 0.2", "travel"),
    ("setup.toml", "[limits]", "[limits]\nspeed_max = 0.1", "did you mean `speed_max_m_s`?"),
    ("setup.toml", "[limits]", "[limits]\nhuman_contact = true", "human_contact"),
    ("setup.toml", "pass_relative_sd = 0.015", "pass_relative_sd = 0", "pass_relative_sd"),
    ("setup.toml", "force_sd_n = 0.0008", "force_sd_n = nan", "force_sd_n"),
    ("setup.toml", "name = \"virtual-ideal\"", "name = \"x\"\ntemperature_c = -300", "temperature_c"),
    ("setup.toml", "name = \"virtual-ideal\"", "name = \"x\"\ncertificates = [\"none.toml\"]", "none.toml"),
    ("setup.toml", "address = \"127.0.0.1:0\"           #", "#", "address"),
    ("setup.toml", "name = \"virtual-ideal\"\n", "name = \"x\"\nname = \"y\"\n", "setup.toml"),
    (
        "setup.toml",
        "\"muprime-amplifier\"",
        "\"keysight-33500b\"\namplitude_m_per_unit = 1e-6",
        "no thermometer",
    ),
    ("setup.toml", "[virtual]\nideal = true", "temperature_fitted = true", "temperature_fitted"),
    (
        "setup.toml",
        "profile = \"muprime-stage\"",
        "profile = \"muprime-stage\"\nunit = 2",
        "are both at 127.0.0.1:0, unit 2",
    ),
    ("tip.toml", "mu0 = 0.5", "mu0 = -0.5", "mu0"),
    ("tip.toml", "radius_m = 8e-3", "radius_m = 8", "mm meant?"),
    ("tip.toml", "radius_m", "radius", "radius_m"),
    ("tip.toml", "kind = \"artificial\"", "kind = \"robot\"", "robot"),
    ("tip.toml", "poisson_ratio = 0.33", "poisson_ratio = 0.7", "poisson_ratio"),
    ("tip.toml", "stiffness_relative_sd = 0.05", "stiffness_relative_sd = -1", "stiffness_relative_sd"),
    ("rig.toml", "3.9e6", "-3.9e6", "normal_stiffness_n_per_m"),
    ("rig.toml", "pass_relative_sd", "pass_sd", "pass_sd"),
    ("rig.toml", "0.0008", "\"0.8 mX\"", "force_sd_n"),
    ("rig.toml", "amplitude_gain_sd = 0.02", "amplitude_gain_sd = 20", "amplitude_gain_sd"),
    ("run/points.csv", "speed_m_s", "speed_mm_s", "speed_m_s"),
    ("run/points.csv", "point,", "point,point,", "twice"),
    ("run/points.csv", ",27500", ",27500,x,y", "line"),
    (
        "run/points.csv",
        "",
        "point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n\n1,0,0,0.01,1,0.25,0.1\n",
        "at least 12",
    ),
    (
        "run/points.csv",
        "",
        "point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n\n1,0,0,0.01,3,0.25,0.1\n",
        "direction",
    ),
    (
        "run/points.csv",
        "",
        "point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n\n1,0,0,0.01,1,250000,0.1\n",
        "normal_force_n",
    ),
    ("model.toml", "muprime.model/1", "muprime.model/9", "muprime.model/9"),
    ("model.toml", "name = \"", "name = \"no_", "no_"),
    ("model.toml", "[baseline]", "[base_line]", "base_line"),
    ("model.toml", "schema = \"", "mood = 1\nschema = \"", "mood"),
    ("profile.toml", "[link]", "[lynk]", "lynk"),
    ("profile.toml", "kind = \"modbus_tcp\"", "kind = \"modbus\"", "modbus"),
    ("profile.toml", "name = \"lateral\"", "name = \"normal\"", "normal"),
    ("profile.toml", "rate_hz = 1000", "rate_hz = -1", "rate_hz"),
    ("certificate.toml", "operator = \"", "operator = \"not ", "was changed after it was written"),
    ("certificate.toml", "kind = \"latency\"", "kind = \"lateness\"", "lateness"),
    ("verdict.json", "muprime.verdict/1", "muprime.verdict/9", "muprime.verdict/9"),
    ("verdict.json", "\"hypotheses\"", "\"hypothesis\"", "hypotheses"),
    ("verdict.json", "\"verdict\":", "\"verdict\":}", "verdict.json"),
    ("run/summary.json", "\"passes\"", "\"passed\"", "passes"),
    ("run/run.toml", "seed = ", "seeds = ", "seed"),
    ("run/passes.jsonl", "\"pass\"", "\"past\"", "line 1"),
    ("defects.toml", "squeeze_film", "squeeze_movie", "squeeze_movie"),
    ("other.toml", "", "colour = \"red\"\n", "none of the files"),
];

/// Wrong files of every kind: each is refused with a place, the cause and a remedy; unchanged, each is approved.
#[test]
fn wrong_files_are_refused_with_place_cause_and_remedy() {
    let made = Made::new();
    std::fs::write(made.at("certificate.toml"), certificate()).unwrap();
    std::fs::write(made.at("defects.toml"), DEFECTS).unwrap();
    std::fs::write(made.at("other.toml"), "").unwrap();
    let mut good = std::collections::BTreeSet::new();
    let mut failed = Vec::new();
    for (name, from, to, word) in WRONG {
        let (path, text) = (made.at(name), made.text(name));
        if *name != "other.toml" && good.insert(*name) {
            let (code, said) = checked(&[], &path);
            assert_eq!(code, Some(0), "{name} as it is: {said}");
        }
        assert!(text.contains(from), "{name}: {from}\n{text}");
        let changed = if from.is_empty() { (*to).to_string() } else { text.replacen(from, to, 1) };
        std::fs::write(&path, changed).unwrap();
        let (code, said) = checked(&[], &path);
        std::fs::write(&path, &text).unwrap();
        let problems = said["problems"].as_array().cloned().unwrap_or_default();
        let whole = said.to_string();
        let placed = |p: &Value| {
            p["line"].as_u64().is_some()
                || ["line ", "point ", "column ", "hypotheses", "none of the files", "passes"]
                    .iter()
                    .any(|w| p["problem"].as_str().unwrap_or_default().contains(w))
        };
        let helped = |p: &Value| p["help"].as_str().is_some_and(|h| h.len() > 10);
        let right = code == Some(2)
            && whole.contains(word)
            && !problems.is_empty()
            && problems.iter().all(placed)
            && problems.iter().all(helped);
        if !right {
            failed.push(format!("{name}: {from} -> {to}: status {code:?}: {whole}"));
        }
    }
    println!("{} wrong files of {} kinds", WRONG.len(), good.len());
    assert!(failed.is_empty(), "{} of {}:\n{}", failed.len(), WRONG.len(), failed.join("\n"));
    assert!(WRONG.len() >= 60);
}

/// A record that was cut, and one with a flipped byte; and the folder that holds it.
#[test]
fn damaged_records_are_refused_and_whole_ones_are_known() {
    let made = Made::new();
    let record = made.at("run/run-1.mcap");
    let whole = std::fs::read(&record).unwrap();
    let (code, said) = checked(&[], &record);
    assert_eq!((code, said["kind"].as_str()), (Some(0), Some("record")), "{said}");
    let (code, said) = checked(&[], &made.at("run"));
    assert_eq!((code, said["kind"].as_str()), (Some(0), Some("run")), "{said}");
    let mut flipped = whole.clone();
    let middle = flipped.len() / 2;
    flipped[middle] ^= 1;
    for bytes in [&whole[..whole.len() / 2], &flipped[..]] {
        std::fs::write(&record, bytes).unwrap();
        for file in [&record, &made.at("run")] {
            let (code, said) = checked(&[], file);
            assert_eq!(code, Some(2), "{said}");
            assert!(said["help"].as_str().unwrap().contains("recover"), "{said}");
        }
    }
}

/// The folder of a run whose rig.toml is gone was OK, three verbs refused it without a remedy, and
/// the command of the run left it as it was.
#[test]
fn a_rig_file_that_is_gone_is_told_and_the_command_of_the_run_writes_it_again() {
    let made = Made::new();
    let (run, rig) = (made.at("run"), made.at("run/rig.toml"));
    let whole = std::fs::read(&rig).unwrap();
    std::fs::remove_file(&rig).unwrap();
    let (code, said) = checked(&[], &run);
    assert!(code == Some(2) && said["problem"].as_str().unwrap().contains("rig.toml"), "{said}");
    for verb in [&["diagnose"][..], &["report"], &["export", "--to", "csv"]] {
        let output = muprime().args(verb).arg(&run).output().unwrap();
        let refused = texts(&output).1.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(
            output.status.code() == Some(2) && refused.contains("repeat the command of the run"),
            "{refused}"
        );
    }
    let mut again = muprime();
    again.args(["run", "--setup", "virtual", "--fast", "--out"]).arg(&run).arg(made.at("plan.toml"));
    assert!(again.output().unwrap().status.success());
    assert_eq!(std::fs::read(&rig).unwrap(), whole);
}

/// What the program writes itself is known by what it is, and a part of a run that is damaged by its name.
#[test]
fn files_of_the_program_are_known() {
    let made = Made::new();
    let run = made.at("run");
    for format in ["mcap", "arrow", "hdf5"] {
        assert!(muprime().args(["export", "--to", format]).arg(&run).output().unwrap().status.success());
    }
    std::fs::write(run.join("annotations.toml"), "tags = [\"dry\"]\nnote = \"\"\n").unwrap();
    std::fs::write(made.at("tips.json"), "[\"artificial\",\"human\"]").unwrap();
    std::fs::write(made.at("claims.json"), "[{\"statement\":\"friction falls\"}]").unwrap();
    std::fs::write(made.at("study.json"), "{\"schema\":\"muprime.study/1\"}").unwrap();
    let fidelity = "{\"schema\":\"muprime.fidelity/1\",\"tolerance\":0.05,\"remarks\":[],\"groups\":[]}";
    std::fs::write(made.at("fidelity.json"), fidelity).unwrap();
    let cases = made.at("cases.jsonl");
    let noop = muprime().args(["cases", "noop", "--cases", "3", "-o"]).arg(&cases).output().unwrap();
    assert!(noop.status.success());
    std::fs::create_dir(made.at("camp")).unwrap();
    std::fs::write(made.at("camp/campaign.toml"), "").unwrap();
    for (file, kind) in [
        ("run/signals.mcap", "signals of an export"),
        ("run/passes.arrow", "Arrow export"),
        ("run/passes.h5", "HDF5 export"),
        ("run/annotations.toml", "annotations"),
        ("tips.json", "tips of a campaign"),
        ("claims.json", "claims of a campaign"),
        ("study.json", "study"),
        ("fidelity.json", "fidelity"),
        ("cases.jsonl", "file of cases"),
        ("camp", "campaign folder"),
    ] {
        let (code, said) = checked(&[], &made.at(file));
        assert_eq!((code, said["kind"].as_str()), (Some(0), Some(kind)), "{said}");
    }
    let signals = std::fs::read(run.join("signals.mcap")).unwrap();
    std::fs::write(run.join("signals.mcap"), &signals[..signals.len() - 1]).unwrap();
    let (code, said) = checked(&[], &run.join("signals.mcap"));
    assert!(code == Some(2) && said.to_string().contains("cut"), "{said}");
    // A file of another kind than is needed is named with its article.
    let output = muprime().args(["run", "--fast", "--setup", "virtual"]).arg(run.join("run.toml")).output();
    let said = texts(&output.unwrap()).1;
    assert!(said.contains("is the run.toml of a run"), "{said}");
    std::fs::write(run.join("summary.json"), "{\"planned\": 3}").unwrap();
    std::fs::rename(&run, made.at("camp/sessions")).unwrap();
    std::fs::create_dir(made.at("camp/s")).unwrap();
    std::fs::rename(made.at("camp/sessions"), made.at("camp/s/01-a")).unwrap();
    std::fs::rename(made.at("camp/s"), made.at("camp/sessions")).unwrap();
    let (code, said) = checked(&[], &made.at("camp/sessions/01-a"));
    assert!(code == Some(2) && said["problem"].as_str().unwrap().contains("summary.json: "), "{said}");
    assert!(said["help"].as_str().unwrap().contains("writes summary.json again"), "{said}");
    let (code, said) = checked(&[], &made.at("camp"));
    assert!(code == Some(2) && said.to_string().contains("its runs are in sessions/"), "{said}");
}

/// Every problem of a file at once, each with its own line.
#[test]
fn all_problems_are_told_at_once() {
    let made = Made::new();
    let plan = PLAN
        .replace("frequency_hz = 27500", "frequency_hz = 27.5")
        .replace("normal_force_n = 0.25", "normal_force_n = 250")
        .replace("speed_m_s = [0.02, 0.05]", "speed_m_s = [0.02, nan]");
    std::fs::write(made.at("plan.toml"), plan).unwrap();
    let lines = |said: &Value| -> Vec<u64> {
        said["problems"].as_array().unwrap().iter().filter_map(|p| p["line"].as_u64()).collect()
    };
    let (_, said) = checked(&["--setup", "virtual-ideal"], &made.at("plan.toml"));
    let found = lines(&said);
    assert_eq!(found.len(), 3, "{said}");
    let mut apart = found.clone();
    apart.sort_unstable();
    apart.dedup();
    assert_eq!(apart.len(), 3, "{said}");
    let good = made.text("setup.toml");
    let setup = good
        .replace("rate_hz = 1000", "rate_hz = 1000\nspin_us = -4")
        .replace("priority = 80", "priority = 120")
        .replace("window = 50", "window = 0")
        .replace("pass_relative_sd = 0.015", "pass_relative_sd = 0")
        .replace("artificial-silicone", "no-tip")
        .replace("[limits]", "[limits]\nspeed_max_m_s = 3\nfrozen_after = 1\nplate_ring_time_s = 9");
    std::fs::write(made.at("setup.toml"), setup).unwrap();
    let (_, said) = checked(&[], &made.at("setup.toml"));
    assert_eq!(said["problems"].as_array().unwrap().len(), 8, "{said}");
    assert_eq!(lines(&said).len(), 8, "{said}");
    // The keys of [estimate] have defaults, each by itself.
    let (head, estimate) = good.split_once("[estimate]\n").unwrap();
    let rest = estimate.split_once("\n[").map(|(_, rest)| format!("[{rest}")).unwrap_or_default();
    for key in ["window = 40", "normal_force_min_n = 0.05", "sample_sd_n = 0.001"] {
        std::fs::write(made.at("estimate.toml"), format!("{head}[estimate]\n{key}\n{rest}")).unwrap();
        let (code, said) = checked(&[], &made.at("estimate.toml"));
        assert_eq!(code, Some(0), "{key}: {said}");
    }
    // A key that is misspelt or of another type keeps nothing back: the values are judged with it, all in one answer.
    let both = good
        .replace("rate_hz = 1000", "rate_hz = 1000\nspin_us = -4")
        .replace("priority = 80", "prioritty = 120")
        .replace("window = 50", "window = \"0\"")
        .replace("[limits]", "[limits]\nnonsense_of_mine = 1\nspeed_max_m_s = 3\nplate_ring_time_s = [1]");
    std::fs::write(made.at("both.toml"), both).unwrap();
    let (_, said) = checked(&[], &made.at("both.toml"));
    let whole = said.to_string();
    for part in [
        "spin_us",
        "did you mean `priority`",
        "priority",
        "window is text",
        "nonsense_of_mine is not known",
        "speed_max_m_s",
        "plate_ring_time_s is a list",
    ] {
        assert!(whole.contains(part), "{part}: {said}");
    }
    assert_eq!(said["problems"].as_array().unwrap().len(), 8, "shapes 4, values 4: {said}");
    let plan =
        PLAN.replace("seed = 3", "sead = 3").replace("frequency_hz = 27500", "frequency_hz = \"27.5\"");
    let plan = plan.replace("normal_force_n = 0.25", "normal_force = 250");
    std::fs::write(made.at("plan.toml"), plan).unwrap();
    let (_, said) = checked(&["--setup", "virtual-ideal"], &made.at("plan.toml"));
    let whole = said.to_string();
    for part in
        ["did you mean `seed`", "frequency_hz is text", "kHz meant", "did you mean `normal_force_n`", "250"]
    {
        assert!(whole.contains(part), "{part}: {said}");
    }
    let misspelt = made.text("setup.toml").replace("priority", "prioritty").replace("window", "widow");
    std::fs::write(made.at("setup.toml"), misspelt).unwrap();
    let (_, said) = checked(&[], &made.at("setup.toml"));
    let whole = said.to_string();
    assert!(whole.contains("did you mean `priority`") && whole.contains("did you mean `window`"), "{said}");
    std::fs::write(
        made.at("rig.toml"),
        RIG.replace("3.9e6", "-1").replace("0.0008", "800").replace("0.02", "7"),
    )
    .unwrap();
    let (_, said) = checked(&[], &made.at("rig.toml"));
    assert_eq!(lines(&said).len(), 3, "{said}");
}

/// All faults of a table, each at its cell; `diagnose` refuses the table with the same help.
#[test]
fn every_faulty_cell_of_a_table_is_reported() {
    let made = Made::new();
    let text = made.text("run/points.csv");
    let columns: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let mut rows: Vec<Vec<String>> =
        text.lines().map(|line| line.split(',').map(str::to_string).collect()).collect();
    for (row, column, value) in
        [(2, "speed_m_s", "fast"), (4, "normal_force_n", "-0.25"), (5, "direction", "3"), (6, "time_s", "")]
    {
        rows[row][columns.iter().position(|c| *c == column).unwrap()] = value.to_string();
    }
    let text: String = rows.iter().map(|row| row.join(",") + "\n").collect();
    std::fs::write(made.at("faulty.csv"), &text).unwrap();
    let (code, said) = checked(&[], &made.at("faulty.csv"));
    let problems = said["problems"].as_array().unwrap();
    let at = |p: &Value| (p["line"].as_u64().unwrap() as usize, p["column"].as_u64().unwrap() as usize);
    let lines: Vec<usize> = problems.iter().map(|p| at(p).0).collect();
    assert_eq!((code, lines), (Some(2), vec![3, 5, 6, 7]), "{said}");
    for p in problems {
        let (line, column) = at(p);
        let cell = &text.lines().nth(line - 1).unwrap()[column - 1..];
        assert!(["fast", "-0.25", "3,", ","].iter().any(|with| cell.starts_with(with)), "{cell}: {p}");
    }
    let output = muprime().args(["--json", "diagnose"]).arg(made.at("faulty.csv")).output().unwrap();
    let said = &documents(&output)[0];
    assert!(said["help"].as_str().is_some_and(|help| help.contains("muprime import")), "{said}");
    std::fs::remove_file(made.at("rig.toml")).unwrap();
    let output = muprime().args(["--json", "diagnose"]).arg(made.at("faulty.csv")).output().unwrap();
    let said = &documents(&output)[0];
    assert!(said["help"].as_str().is_some_and(|help| help.contains("normal_stiffness_n_per_m")), "{said}");
}

/// A unit that slipped where the value is admitted is remarked on.
#[test]
fn units_that_slipped_are_remarked_on() {
    let made = Made::new();
    for (name, from, to, word) in [
        ("rig.toml", "3.9e6", "3.9", "N/\u{b5}m meant?"),
        ("tip.toml", "lateral_stiffness_n_per_m = 1.5e6", "lateral_stiffness_n_per_m = 1500", "N/mm meant?"),
    ] {
        std::fs::write(made.at(name), made.text(name).replacen(from, to, 1)).unwrap();
        let (code, said) = checked(&[], &made.at(name));
        let said = format!("{said}");
        assert!(said.contains(word), "{name} {code:?}: {said}");
    }
    // The air's pressure in kPa would be a vacuum in Pa.
    let plan = PLAN.replace("speed_m_s = [0.02, 0.05]", "ambient_pressure_pa = [101.325, 50]");
    std::fs::write(made.at("plan.toml"), plan).unwrap();
    let (code, said) = checked(&["--setup", "virtual-ideal"], &made.at("plan.toml"));
    assert!(
        code == Some(2) && said.to_string().contains("kPa meant? Then write 1.01325e5"),
        "{code:?}: {said}"
    );
}

/// Ports that a run could not open: each is told of with its line, before anything is touched; `--offline` leaves them out.
#[test]
fn ports_that_cannot_be_opened_are_refused() {
    let made = Made::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let nobody = {
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        free.local_addr().unwrap().to_string()
    };
    let text = made.text("setup.toml");
    let judged = |setup: &str, words: &[&str]| {
        std::fs::write(made.at("setup.toml"), setup).unwrap();
        let path = made.at("setup.toml");
        let mut all = vec!["--setup", path.to_str().unwrap()];
        all.extend(words);
        checked(&all, &made.at("plan.toml"))
    };
    // The virtual rig is to listen where another program does.
    let served = text.replace("127.0.0.1:0", &taken.local_addr().unwrap().to_string());
    let (code, said) = judged(&served, &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.to_string().contains("cannot be served there"), "{said}");
    // A real rig: nobody listens, a line that is not there, and one line for two instruments that cannot share.
    let real: String = text.split("[virtual]\nideal = true\n").collect();
    let real = real
        .replacen("address = \"127.0.0.1:0\"", &format!("address = \"{nobody}\""), 1)
        .replacen(
            "address = \"127.0.0.1:0\"",
            "address = \"rtu:/dev/ttyNone0\"\nrate_hz = 20\nbaud = 115200",
            1,
        )
        .replacen("127.0.0.1:0", &nobody, 1);
    let (code, said) = judged(&real, &[]);
    let whole = said.to_string();
    assert_eq!(code, Some(2), "{said}");
    assert!(whole.contains("nobody accepts") && whole.contains("ttyNone0"), "{said}");
    assert!(
        said["problems"].as_array().unwrap().iter().all(|p| p["line"].is_u64() && p["help"].is_string()),
        "{said}"
    );
    let (code, said) = judged(&real, &["--offline"]);
    assert_eq!(code, Some(0), "{said}");
    let shared = real.replace(
        &format!("address = \"{nobody}\"\n\n[finger]"),
        "address = \"rtu:/dev/ttyNone0\"\nrate_hz = 20\nbaud = 115200\n\n[finger]",
    );
    assert_ne!(shared, real);
    let (code, said) = judged(&shared, &["--offline"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.to_string().contains("of its own"), "{said}");
}

/// What an instrument does not take or see is refused beforehand, by `run` as well.
#[test]
fn what_an_instrument_cannot_do_is_refused_beforehand() {
    let made = Made::new();
    for (from, to, word) in [
        ("frequency_hz = 27500", "frequency_hz = 40000", "`small-amplifier` takes"),
        ("normal_force_n = 0.25", "normal_force_n = 1.2", "`narrow-cell` sees"),
    ] {
        let own = drivers::bundled::text("muprime-force2").unwrap().replacen(
            "\"muprime-force2\"",
            "\"narrow-cell\"",
            1,
        );
        std::fs::write(made.at("cell.toml"), own.replace("range = [-20.0, 20.0]", "range = [-1.0, 1.0]"))
            .unwrap();
        let own = drivers::bundled::text("muprime-amplifier").unwrap().replacen(
            "\"muprime-amplifier\"",
            "\"small-amplifier\"",
            1,
        );
        std::fs::write(
            made.at("amplifier.toml"),
            own.replace("range = [0.0, 200000.0]", "range = [0.0, 30000.0]"),
        )
        .unwrap();
        let setup = made.text("setup.toml").replacen("muprime-force2", "cell.toml", 1);
        let setup = setup.replacen("profile = \"muprime-amplifier\"", "profile = \"amplifier.toml\"", 1);
        std::fs::write(made.at("own.toml"), setup).unwrap();
        std::fs::write(made.at("plan.toml"), PLAN.replacen(from, to, 1)).unwrap();
        let setup = made.at("own.toml");
        let (code, said) = checked(&["--setup", setup.to_str().unwrap()], &made.at("plan.toml"));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.to_string().contains(word), "{said}");
        let run = muprime()
            .args(["run", "--fast", "--out"])
            .arg(made.at("beyond"))
            .arg("--setup")
            .arg(&setup)
            .arg(made.at("plan.toml"))
            .output()
            .unwrap();
        assert_eq!(run.status.code(), Some(2), "{}", texts(&run).1);
        assert!(!made.at("beyond").exists());
    }
}

/// Five passes of a run that ended early: the remedy is more passes, not another table.
#[test]
fn too_few_passes_are_told_what_gives_more() {
    let made = Made::new();
    let table: Vec<String> = made.text("run/points.csv").lines().take(6).map(String::from).collect();
    std::fs::write(made.at("run/points.csv"), table.join("\n") + "\n").unwrap();
    for verb in ["diagnose", "check"] {
        let output = muprime().args(["--json", verb]).arg(made.at("run/points.csv")).output().unwrap();
        let said = documents(&output)[0].to_string();
        assert!(said.contains("at least 12") && said.contains("replicates"), "{verb}: {said}");
        assert!(!said.contains("import"), "{verb}: {said}");
    }
}

/// Every number of a plan and of a setup, at values that people write by mistake and at good ones: nothing
/// that `check` approves is refused by `run`.
#[test]
fn nothing_that_check_approves_is_refused_by_run() {
    let made = Made::new();
    let (plan, setup) = (PLAN.to_string(), made.text("setup.toml"));
    let values = ["0", "-1", "nan", "1e-3", "0.5", "15", "1e3", "1e9", "\"x\""];
    let (mut approved, mut refused) = (0, 0);
    let mut trial = |plan: &str, setup: &str, what: &str| {
        std::fs::write(made.at("plan.toml"), plan).unwrap();
        std::fs::write(made.at("setup.toml"), setup).unwrap();
        let named = made.at("setup.toml");
        let (code, said) = checked(&["--setup", named.to_str().unwrap()], &made.at("plan.toml"));
        if code != Some(0) {
            refused += 1;
            return;
        }
        approved += 1;
        let out = tempfile::tempdir_in(made.folder.path()).unwrap();
        let run = muprime()
            .args(["run", "--fast", "--out"])
            .arg(out.path().join("run"))
            .arg("--setup")
            .arg(&named)
            .arg(made.at("plan.toml"))
            .env("MUPRIME_RUNS", made.folder.path())
            .output()
            .unwrap();
        assert!(
            matches!(run.status.code(), Some(0 | 1)),
            "{what}: check said {said}, and run {}",
            texts(&run).1
        );
    };
    let numbers = |text: &str| -> Vec<usize> {
        let number = |line: &str| {
            line.split_once(" = ").is_some_and(|(_, value)| {
                value.split_whitespace().next().unwrap_or_default().parse::<f64>().is_ok()
            })
        };
        text.lines().enumerate().filter(|(_, line)| number(line)).map(|(i, _)| i).collect()
    };
    let with = |text: &str, at: usize, value: &str| -> String {
        let line = |(i, line): (usize, &str)| match line.split_once(" = ") {
            Some((key, _)) if i == at => format!("{key} = {value}\n"),
            _ => format!("{line}\n"),
        };
        text.lines().enumerate().map(line).collect()
    };
    // By default every other value, from line to line in turn.
    let taken = |at: usize| values.into_iter().skip(at % rounds(2, 1)).step_by(rounds(2, 1));
    for at in numbers(&plan) {
        for value in taken(at) {
            trial(&with(&plan, at, value), &setup, &format!("plan line {at} = {value}"));
        }
    }
    for at in numbers(&setup) {
        for value in taken(at) {
            trial(&plan, &with(&setup, at, value), &format!("setup line {at} = {value}"));
        }
    }
    println!("{approved} approved and run, {refused} refused by check");
    assert!(approved > 20 && refused > 60, "{approved} approved, {refused} refused");
}

/// The table that the test's run leaves is long enough to be diagnosed: the trial above stands on it.
#[test]
fn the_tables_of_the_trials_can_be_read() {
    let made = Made::new();
    let passes: Vec<Pass> = models::pass::read_passes(made.text("run/points.csv").as_bytes()).unwrap();
    assert!(passes.len() >= 12, "{}", passes.len());
}

/// A sheet with a byte-order mark was refused; a target to render was a law table.
#[test]
fn a_mark_before_a_sheet_changes_nothing_and_a_target_is_no_law_table() {
    let folder = tempfile::tempdir().unwrap();
    let of = |name: &str| std::fs::read_to_string(tests::file(&format!("drivers/profiles/{name}"))).unwrap();
    let (profile, sheet) = ("cia402-profile-velocity.toml", "cia402-profile-velocity.eds");
    std::fs::write(folder.path().join(sheet), format!("\u{feff}{}", of(sheet))).unwrap();
    std::fs::write(folder.path().join(profile), of(profile)).unwrap();
    let (code, said) = checked(&[], &folder.path().join(profile));
    assert_eq!(code, Some(0), "{said}");
    let (code, said) = checked(&[], &tests::file("examples/plans/render-bumps.csv"));
    assert_ne!(code, Some(0));
    let said = said.to_string();
    assert!(said.contains("a target to render") && said.contains("muprime check PLAN"), "{said}");
}
