//! What a run leaves for other programs, read by libraries that know nothing of this one: an MCAP reader, JSON Schema, polars,
//! pyarrow, h5py, an RO-Crate validator. The layouts and the script of `docs/viewers.md` are tried here too.

use serde_json::Value;
use std::path::Path;
use std::process::Command;
use tests::{documents, file, muprime, python, texts};

/// With the identifier that ORCID publishes as its example.
const OPERATOR: &str = "M. Ohm <https://orcid.org/0000-0002-1825-0097>";
const SAMPLE: &str = "silicone fingertip 3, wiped with ethanol";
const LICENCE: &str = "CC-BY-4.0";

/// A short run in virtual time with everything that a person may state.
fn a_run(folder: &Path) -> std::path::PathBuf {
    let out = folder.join("run");
    let plan = tests::short_plan(folder);
    let mut command = muprime();
    command.args(["run", &plan, "--fast", "--operator", OPERATOR, "--sample", SAMPLE, "--licence", LICENCE]);
    let ended = command.arg("--out").arg(&out).env("MUPRIME_RUNS", folder).output().unwrap();
    assert_eq!(ended.status.code(), Some(0), "{}", texts(&ended).1);
    out
}

fn export(run: &Path, words: &[&str]) -> Value {
    let ended = muprime().args(["--json", "export"]).arg(run).args(words).output().unwrap();
    assert_eq!(ended.status.code(), Some(0), "{words:?}: {}", texts(&ended).0);
    documents(&ended).remove(0)
}

fn refused(run: &Path, words: &[&str]) -> String {
    let ended = muprime().arg("export").arg(run).args(words).output().unwrap();
    let (out, err) = texts(&ended);
    assert_eq!(ended.status.code(), Some(2), "{words:?}: {out}{err}");
    err.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn reader(words: &[&str], run: &Path, more: &[&str]) -> Value {
    let mut command: Command = python();
    command.arg(file("tests/peers/exports.py")).args(words).arg(run).args(more);
    let read = command.output().unwrap();
    assert!(read.status.success(), "{words:?}: {}", texts(&read).1);
    serde_json::from_slice(&read.stdout).unwrap()
}

/// Every message of the record fits the schema that the record carries, which allows no key that it does not describe.
#[test]
fn the_record_describes_itself() {
    let folder = tempfile::tempdir().unwrap();
    let found = reader(&["own"], &a_run(folder.path()), &[]);
    assert_eq!(found["schemas"], serde_json::json!(["/cycle", "/event", "/pass"]));
    assert!(found["messages"]["/cycle"].as_u64().unwrap() > 5000, "{found}");
    assert_eq!(found["messages"]["/pass"], 22);
}

/// The flat topics hold what the record holds, with a unit each; the layouts show topics that there are; ten
/// lines of Python draw every one.
#[test]
fn viewers_plot_a_run_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let run = a_run(folder.path());
    export(&run, &["--to", "mcap"]);
    let found = reader(&["signals"], &run, &[file("docs/viewers").to_str().unwrap()]);
    assert_eq!(found["missing"], serde_json::json!([]), "topics of the layouts that no run has");
    assert!(found["in_layouts"].as_u64().unwrap() >= 20, "{found}");
    assert!(found["compared"].as_u64().unwrap() > 50_000, "{found}");
    for (topic, unit) in
        [("/force/lateral_force_n", "N"), ("/drive/amplitude_pp_m", "m"), ("/pass/speed_m_s", "m/s")]
    {
        assert_eq!(found["units"][topic], unit, "{topic}");
    }
    for (name, fact) in
        [("operator", OPERATOR), ("sample", SAMPLE), ("licence", LICENCE), ("outcome", "complete")]
    {
        assert_eq!(found["facts"][name], fact);
    }
    for name in ["muprime_version", "seed", "instruments", "certificates", "model_identity", "plan_sha256"] {
        assert!(found["facts"][name].as_str().is_some_and(|fact| !fact.is_empty()), "{name}: {found}");
    }
    for name in ["setup.toml", "plan.toml", "rig.toml"] {
        assert!(found["attached"].as_array().unwrap().iter().any(|there| there == name), "{name}");
    }
    let script = file("docs/viewers/plot_signals.py");
    assert!(std::fs::read_to_string(&script).unwrap().lines().count() <= 10);
    let picture = folder.path().join("signals.png");
    let drawn = python()
        .env("MPLBACKEND", "Agg")
        .arg(script)
        .arg(run.join("signals.mcap"))
        .arg(&picture)
        .output()
        .unwrap();
    assert!(drawn.status.success(), "{}", texts(&drawn).1);
    let measure = "import sys, matplotlib.image as i; print(*i.imread(sys.argv[1]).shape[:2])";
    let seen = texts(&python().args(["-c", measure]).arg(&picture).output().unwrap()).0;
    let height: usize = seen.split_whitespace().next().unwrap().parse().unwrap();
    // 110 dots a curve at the script's size.
    assert_eq!(height, 110 * found["topics"].as_array().unwrap().len(), "a curve for every topic");
    // An exported file is no record: the run is what it was.
    let report = muprime().arg("report").arg(&run).output().unwrap();
    assert_eq!(report.status.code(), Some(0), "{}", texts(&report).1);
    assert_eq!(reader(&["own"], &run, &[])["messages"]["/pass"], 22);
}

/// Tables carry the unit and the meaning of each column, and who measured what with which instruments.
#[test]
fn tables_carry_units_and_facts() {
    let folder = tempfile::tempdir().unwrap();
    let run = a_run(folder.path());
    for format in ["csv", "parquet", "arrow", "hdf5"] {
        export(&run, &["--to", format]);
    }
    let found = reader(&["tables"], &run, &[]);
    assert_eq!(found["rows"], 22);
    assert_eq!(found["classes"], serde_json::json!(["NXroot", "NXentry", "NXdata"]));
    assert_eq!(found["person"], OPERATOR);
    for (facts, prefix) in [("facts", "muprime."), ("arrow_facts", "muprime."), ("hdf5_facts", "")] {
        for (name, fact) in [("operator", OPERATOR), ("sample", SAMPLE), ("licence", LICENCE)] {
            assert_eq!(found[facts][format!("{prefix}{name}")], fact, "{facts}");
        }
    }
}

/// The folder as a repository takes it: an independent validator finds nothing that RO-Crate 1.3 requires
/// missing, and of what it recommends a contact alone.
#[test]
fn the_folder_is_a_crate() {
    let folder = tempfile::tempdir().unwrap();
    let run = a_run(folder.path());
    for format in ["mcap", "parquet"] {
        export(&run, &["--to", format]);
    }
    export(&run, &["--to", "ro-crate", "--organisation", "CERN <https://ror.org/01ggx4157>"]);
    let found = reader(&["crate"], &run, &[]);
    // Nobody to write to is known: a name, and with luck an address.
    let nobody = [
        "RECOMMENDED: An Organization's contactPoint SHOULD reference a ContactPoint contextual entity",
        "RECOMMENDED: At least one author or publisher Person/Organization SHOULD have a contactPoint property",
    ];
    assert_eq!(found["issues"], serde_json::json!(nobody));
    assert_eq!([&found["author"], &found["orcid"]], ["M. Ohm", "https://orcid.org/0000-0002-1825-0097"]);
    assert_eq!(found["licence"], "https://spdx.org/licenses/CC-BY-4.0");
    for name in ["run-1.mcap", "signals.mcap", "passes.parquet", "points.csv", "report.html"] {
        assert!(found["files"].as_array().unwrap().iter().any(|there| there == name), "{name}: {found}");
    }
    let elsewhere = folder.path().join("crate.json");
    assert!(
        refused(&run, &["--to", "ro-crate", "--out", elsewhere.to_str().unwrap()])
            .contains("in the folder itself")
    );
    assert!(!elsewhere.exists());

    let silent = folder.path().join("silent");
    let plan = tests::short_plan(folder.path());
    let ended = muprime()
        .args(["run", &plan, "--fast", "--out"])
        .arg(&silent)
        .env("MUPRIME_RUNS", folder.path())
        .output();
    assert_eq!(ended.unwrap().status.code(), Some(0));
    assert!(
        refused(&silent, &["--to", "ro-crate"]).contains("--licence"),
        "a licence is stated, never assumed"
    );
    assert!(!silent.join("ro-crate-metadata.json").exists());
}
