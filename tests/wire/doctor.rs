//! A rig's instruments before a sweep: what `muprime doctor` finds, and what `muprime run` refuses.

use super::bench::{self, Bench};
use sim::wire::Quantity;
use std::path::Path;
use std::time::Instant;

/// A setup of real addresses: force, amplifier, stage.
fn setup(folder: &Path, force: &str, amplifier: &str, stage: &str) -> std::path::PathBuf {
    let path = folder.join("rig.toml");
    let text = format!(
        "name = \"bench\"\n[[force]]\n{force}\n[amplifier]\nprofile = \"muprime-amplifier\"\naddress = \"{amplifier}\"\n\
         [stage]\nprofile = \"muprime-stage\"\naddress = \"{stage}\"\n[finger]\ntip = \"artificial-silicone\"\n\
         [noise]\npass_relative_sd = 0.015\nforce_sd_n = 0.0008\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn doctor(setup: &Path) -> (Option<i32>, Vec<serde_json::Value>) {
    let output = tests::muprime()
        .args(["doctor", "--instruments-only", "--json", "--setup"])
        .arg(setup)
        .output()
        .unwrap();
    let said = tests::documents(&output);
    assert_eq!(said.len(), 1, "{said:?}");
    assert_eq!(said[0]["good"].as_bool(), Some(output.status.code() == Some(0)));
    (output.status.code(), said[0]["judgement"]["instruments"].as_array().unwrap().clone())
}

/// The first instrument that fails hides none behind it, and the exit status says whether all is well.
#[test]
fn the_doctor_goes_on_after_an_instrument_that_fails() {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::LateralForce, -0.125);
    bench.set(Quantity::NormalForce, 0.25);
    bench.set(Quantity::Position, 0.0125);
    let server = bench::serve_all(&bench, epoch);
    let address = server.address().to_string();
    // A port that was free a moment ago and at which nobody listens.
    let nobody = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let folder = tempfile::tempdir().unwrap();
    let force = |address: &str| format!("profile = \"muprime-force2\"\naddress = \"{address}\"");

    let (code, found) = doctor(&setup(folder.path(), &force(&address), &address, &address));
    assert_eq!(code, Some(0), "{found:?}");
    let text = |i: usize| found[i]["found"].as_str().unwrap().to_string();
    assert!(text(0).contains("lateral -0.1250 N") && text(0).contains("normal +0.2500 N"), "{}", text(0));
    assert!(text(1).contains("output off") && text(2).contains("at 12.500 mm"), "{found:?}");

    let (code, found) = doctor(&setup(folder.path(), &force(&nobody), &nobody, &address));
    assert_eq!(code, Some(1));
    let good: Vec<bool> = found.iter().map(|f| f["good"].as_bool().unwrap()).collect();
    assert_eq!(good, [false, false, true], "{found:?}");
    for (finding, role) in found.iter().zip(["force", "amplifier", "stage"]) {
        assert!(finding["subject"].as_str().unwrap().starts_with(role), "{found:?}");
    }
    assert!(found[0]["found"].as_str().unwrap().contains("refused"), "{found:?}");
}

/// A sensor whose count is 10 mN cannot show what a quarter of a newton's tenth is to show: refused by the plan and the
/// profile alone, before any instrument is spoken to (none is there).
#[test]
fn a_sweep_that_the_sensor_cannot_see_is_refused_before_anything_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let force = "profile = \"robotiq-ft300\"\naddress = \"/nowhere\"\nlateral = { signal = \"fx\" }\n\
                 normal = { signal = \"fz\" }";
    let setup = setup(folder.path(), force, "127.0.0.1:9", "127.0.0.1:9");
    let plan = std::fs::read_to_string(tests::file("tests/plans/buses.toml")).unwrap();
    let light = folder.path().join("light.toml");
    std::fs::write(&light, plan.replace("normal_force_n = 0.25", "normal_force_n = 0.03")).unwrap();
    let run = |plan: &Path| {
        let mut command = tests::muprime();
        command.arg("run").arg(plan).arg("--setup").arg(&setup).arg("--out").arg(folder.path().join("out"));
        let output = command.output().unwrap();
        // The report wraps its lines at the width of the terminal.
        let words: Vec<String> =
            tests::texts(&output).1.split_whitespace().filter(|w| *w != "│").map(String::from).collect();
        (output.status.code(), words.join(" "))
    };
    let (code, said) = run(&light);
    assert_eq!(code, Some(2), "{said}");
    for part in [
        "series 'a'",
        "w = 3e-6 m",
        "Fn = 0.03 N",
        "`robotiq-ft300` (fx)",
        "its count is 10.0 mN",
        "raise the normal",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!folder.path().join("out").exists(), "nothing was begun");
    // At the full load the same sensor will do; what is missing then is the instrument.
    let (_, said) = run(&tests::file("tests/plans/buses.toml"));
    assert!(said.contains("/nowhere"), "{said}");
}
