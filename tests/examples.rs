//! `examples/`: every file is checked, every plan is swept, the own loop runs, and the page lists them all.

use std::path::PathBuf;
use tests::{file, muprime, texts};

#[path = "../examples/own_loop.rs"]
#[allow(dead_code, reason = "its main is the example's own")]
mod own_loop;

/// Files of a folder of examples, by their paths in the repository.
fn of(folder: &str) -> Vec<String> {
    let entries = std::fs::read_dir(file("examples").join(folder)).unwrap();
    let paths = entries.map(|entry| entry.unwrap().path()).filter(|path: &PathBuf| path.is_file());
    let names = paths.map(|path| path.file_name().unwrap().to_string_lossy().into_owned());
    let mut all: Vec<String> =
        names.map(|name| [folder, &name].join("/").trim_start_matches('/').into()).collect();
    all.sort();
    all
}

fn run(arguments: &[&str]) {
    let output = muprime().args(arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {:?}", texts(&output));
}

#[test]
fn every_file_is_good() {
    let page = std::fs::read_to_string(file("examples/README.md")).unwrap();
    for name in ["", "plans", "setups", "profiles", "studies"].into_iter().flat_map(of) {
        assert!(
            name == "README.md" || page.contains(&format!("]({name})")),
            "examples/README.md lacks {name}"
        );
        if name.ends_with(".toml") {
            run(&["check", file("examples").join(name).to_str().unwrap(), "--offline"]);
        }
    }
}

#[test]
fn every_plan_runs_on_the_setup_of_the_examples() {
    let folder = tempfile::tempdir().unwrap();
    let setup = file("examples/setups/light-touch.toml");
    for (i, plan) in of("plans").iter().filter(|name| name.ends_with(".toml")).enumerate() {
        let (plan, out) = (file("examples").join(plan), folder.path().join(i.to_string()));
        let [plan, setup, out] = [&plan, &setup, &out].map(|path| path.to_str().unwrap());
        run(&["run", plan, "--setup", setup, "--fast", "--out", out]);
    }
}

#[test]
fn the_own_loop_runs_a_whole_sweep() {
    assert_eq!(own_loop::sweep(), runs::sweep::Outcome::Complete);
}
