//! Words for everything: schemas, the reference of all keys, commented beginnings, what is bundled, manual pages; and `check` against `run`.
//!
//! `MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test words` writes docs/reference.md anew.

#[path = "words/reference.rs"]
mod reference;

use rayon::prelude::*;
use reference::{objects, page};
use serde_json::Value;
use std::collections::BTreeSet;
use tables::schemas::bundled;
use tables::schemas::schema::Kind;
use tests::{documents, file, muprime, texts};

/// The page is what the code says.
#[test]
fn the_reference_is_that_of_the_code() {
    let (path, now) = (file("docs/reference.md"), page());
    if std::env::var_os("MUPRIME_UPDATE").is_some() {
        std::fs::write(&path, &now).unwrap();
    }
    let written = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        written == now,
        "docs/reference.md is old: MUPRIME_UPDATE=1 cargo test --release -p muprime-tests --test words"
    );
}

/// With `--json` what prints a text or writes files answers with one document.
#[test]
fn texts_and_files_are_documents_with_json() {
    let folder = tempfile::tempdir().unwrap();
    let said = |words: &[&str]| {
        let output = muprime().arg("--json").args(words).current_dir(folder.path()).output().unwrap();
        let said = documents(&output);
        assert_eq!((said.len(), output.status.code()), (1, Some(0)), "{words:?}: {:?}", texts(&output));
        said[0].clone()
    };
    for words in [&["init", "plan"][..], &["completions", "bash"]] {
        assert!(said(words)["text"].as_str().unwrap().lines().count() > 10, "{words:?}");
    }
    for words in [&["init", "plan", "--out", "plan.toml"][..], &["man", "pages"]] {
        let written = said(words)["written"].as_array().unwrap().clone();
        assert!(written.len() > 1, "{written:?}");
        assert!(
            written.iter().all(|path| folder.path().join(path.as_str().unwrap()).is_file()),
            "{written:?}"
        );
    }
}

/// Every key anywhere in a schema, found without the page's own walk.
fn keys(schema: &Value, into: &mut BTreeSet<String>) {
    match schema {
        Value::Object(object) => {
            if let Some(Value::Object(properties)) = object.get("properties") {
                into.extend(properties.keys().cloned());
            }
            object.values().for_each(|v| keys(v, into));
        }
        Value::Array(list) => list.iter().for_each(|v| keys(v, into)),
        _ => {}
    }
}

/// Every key of every kind has its row, with words, in its kind's part of the page.
#[test]
fn the_reference_covers_every_key() {
    let page = std::fs::read_to_string(file("docs/reference.md")).unwrap();
    let mut count = 0;
    for kind in Kind::all() {
        let part =
            page.split("\n## ").find(|p| p.starts_with(&format!("{}\n", kind.name()))).unwrap_or_default();
        let mut all = BTreeSet::new();
        keys(&kind.schema(), &mut all);
        assert!(all.len() > 3, "{}: {all:?}", kind.name());
        for key in &all {
            let rows: Vec<&str> = part.lines().filter(|l| l.starts_with(&format!("| `{key}` |"))).collect();
            assert!(!rows.is_empty(), "{}: `{key}` has no row", kind.name());
            let told = |row: &&str| !row.trim_end_matches('|').trim().ends_with('|');
            assert!(rows.iter().any(told), "{}: `{key}` has no words: {rows:?}", kind.name());
        }
        count += all.len();
        let listed: usize =
            objects(&kind.schema()).iter().map(|(_, o)| o["properties"].as_object().unwrap().len()).sum();
        assert!(listed >= all.len(), "{}", kind.name());
    }
    println!("{count} keys");
    assert!(count > 250, "{count}");
}

/// The schema of a kind takes what the reader takes: the keys of bundled files are all in it.
#[test]
fn schemas_know_the_keys_of_what_is_bundled() {
    for bundled in bundled::all() {
        let output = muprime().args(["schema", bundled.kind]).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", texts(&output).1);
        let schema: Value = serde_json::from_str(&texts(&output).0).unwrap();
        let properties = schema["properties"].as_object().unwrap();
        let table: toml::Table = toml::from_str(bundled.text).unwrap();
        let unknown: Vec<_> = table.keys().filter(|k| !properties.contains_key(*k)).collect();
        assert!(unknown.is_empty(), "{}: {unknown:?}", bundled.name);
        for needed in schema["required"].as_array().unwrap() {
            assert!(table.contains_key(needed.as_str().unwrap()), "{}: {needed}", bundled.name);
        }
    }
}

/// `init --out` writes the file and the schema that its first line names, and overwrites nothing.
#[test]
fn init_writes_a_file_with_its_schema() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["plan", "setup", "fingertip", "profile"] {
        let file = folder.path().join(format!("my-{kind}.toml"));
        let begin = || muprime().args(["init", kind, "--out"]).arg(&file).output().unwrap();
        assert_eq!(begin().status.code(), Some(0));
        assert_eq!(begin().status.code(), Some(2), "a file that is there stays");
        let text = std::fs::read_to_string(&file).unwrap();
        let schema = text.lines().next().unwrap().strip_prefix("#:schema ./").unwrap();
        let schema = std::fs::read_to_string(folder.path().join(schema)).unwrap();
        assert!(
            serde_json::from_str::<serde_json::Value>(&schema).unwrap()["properties"].is_object(),
            "{kind}"
        );
        assert_eq!(muprime().arg("check").arg(&file).output().unwrap().status.code(), Some(0), "{kind}");
    }
}

/// What `init` prints is approved by `check`, and the plan and the setup run together.
#[test]
fn what_is_begun_is_approved_and_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(format!("{name}.toml"));
    for kind in ["plan", "setup", "fingertip", "profile"] {
        let output = muprime().args(["init", kind]).output().unwrap();
        assert_eq!(output.status.code(), Some(0));
        // Editors take the first line (taplo, Even Better TOML): a directive, and a file that one command writes.
        let first = texts(&output).0.lines().next().unwrap_or_default().to_string();
        assert_eq!(first, format!("#:schema ./{kind}.schema.json"));
        assert!(texts(&output).0.contains(&format!("`muprime schema {kind} > {kind}.schema.json`")));
        assert!(texts(&output).0.lines().filter(|l| l.contains("# ")).count() > 5, "{kind}: comments");
        std::fs::write(path(kind), output.stdout).unwrap();
        let checked = muprime().args(["check", "--json"]).arg(path(kind)).output().unwrap();
        assert_eq!(documents(&checked)[0]["kind"], kind, "{:?}", texts(&checked));
    }
    let together = muprime().args(["check", "--json"]).args([path("plan"), path("setup")]).output().unwrap();
    assert!(documents(&together)[0]["passes"].as_u64() > Some(10), "{:?}", texts(&together));
    let run = muprime()
        .arg("run")
        .arg(path("plan"))
        .arg("--setup")
        .arg(path("setup"))
        .args(["--fast", "--out"])
        .arg(folder.path().join("run"))
        .env("MUPRIME_RUNS", folder.path())
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(0), "{}", texts(&run).1);
    // What the run leaves is known to `check`.
    let left = |name: &str| folder.path().join("run").join(name);
    let checked =
        muprime().args(["check", "--json"]).args([left("points.csv"), left("rig.toml")]).output().unwrap();
    let kinds: Vec<String> =
        documents(&checked).iter().map(|d| d["kind"].as_str().unwrap_or_default().to_string()).collect();
    assert_eq!((checked.status.code(), kinds[1].as_str()), (Some(0), "rig.toml"), "{:?}", texts(&checked));
    assert_eq!(kinds[0], "table");
}

#[test]
fn what_is_bundled_is_shown_as_it_is() {
    let listed = muprime().args(["show", "--json"]).output().unwrap();
    assert_eq!(documents(&listed).len(), bundled::all().len());
    for bundled in bundled::all() {
        let shown = muprime().args(["show", bundled.name]).output().unwrap();
        assert_eq!(texts(&shown).0.trim_end(), bundled.text.trim_end(), "{}", bundled.name);
    }
    let none = muprime().args(["show", "no-such"]).output().unwrap();
    assert_eq!(none.status.code(), Some(2));
}

/// A sample is measured, its table is one that `diagnose` takes, and the foreign one is one that `import` takes.
#[test]
fn samples_can_be_diagnosed() {
    let folder = tempfile::tempdir().unwrap();
    let given = |words: &[&str]| {
        let output =
            muprime().args(words).current_dir(folder.path()).env_remove("MUPRIME_RUNS").output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{words:?}: {}", texts(&output).1);
        texts(&output).0
    };
    for name in ["dry", "moist", "silicone"] {
        given(&["show", "--sample", name]);
        let checked = given(&["check", "--json", &format!("{name}/points.csv")]);
        assert!(
            checked.contains("\"passes\":98") && folder.path().join(name).join("rig.toml").exists(),
            "{checked}"
        );
    }
    assert!(given(&["diagnose", "silicone"]).to_lowercase().contains("squeeze"));
    given(&["show", "--sample", "foreign", "--out", "theirs"]);
    let foreign = std::fs::read_to_string(folder.path().join("theirs/foreign.csv")).unwrap();
    assert!(
        foreign.starts_with("Time (s);Amplitude (um p-p);") && foreign.lines().count() == 99,
        "{foreign}"
    );
    given(&["import", "theirs/foreign.csv", "-o", "imported", "--yes"]);
    assert!(folder.path().join("imported/points.csv").exists());
}

#[test]
fn every_command_has_a_manual_page() {
    let folder = tempfile::tempdir().unwrap();
    let written = muprime().arg("man").arg(folder.path()).output().unwrap();
    assert_eq!(written.status.code(), Some(0), "{}", texts(&written).1);
    let pages: Vec<_> =
        std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
    assert!(pages.len() > 40, "{}", pages.len());
    for path in pages {
        let page = std::fs::read_to_string(&path).unwrap();
        assert!(page.contains(".TH") && page.contains("muprime"), "{}: {page}", path.display());
    }
}

/// Every bundled plan on every bundled setup: `check` approves it and it runs, or `check` says why not and `run` refuses it.
#[test]
fn check_and_run_say_the_same_of_every_plan_on_every_setup() {
    let folder = tempfile::tempdir().unwrap();
    let pairs = runs::plan::BUNDLED
        .iter()
        .flat_map(|(plan, _)| runs::setup::BUNDLED.iter().map(move |(setup, _)| (plan, setup)));
    // By default every plan, each on another setup; all 35 pairs in `long`.
    let pairs: Vec<_> = pairs.step_by(tests::rounds(runs::setup::BUNDLED.len() + 1, 1)).collect();
    let approved = pairs.par_iter().map(|(plan, setup)| {
        let checked =
            muprime().args(["check", plan, "--setup", setup, "--offline", "--json"]).output().unwrap();
        let said = &documents(&checked)[0];
        let run = muprime()
            .args(["run", plan, "--setup", setup, "--fast", "--out"])
            .arg(folder.path().join(format!("{plan}-{setup}")))
            .env("MUPRIME_RUNS", folder.path())
            .output()
            .unwrap();
        println!("{plan} on {setup}: {said}");
        match said["ok"].as_bool() {
            Some(true) => assert_eq!(run.status.code(), Some(0), "{plan} on {setup}: {}", texts(&run).1),
            _ => assert_eq!(run.status.code(), Some(2), "{plan} on {setup}: {}", texts(&run).1),
        }
        said["ok"] == true
    });
    let good = approved.filter(|good| *good).count();
    println!("{good} run, {} are refused", pairs.len() - good);
    assert!(good > 0);
}
