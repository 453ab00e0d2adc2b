//! The verbs for what a sensor is besides its matrix, on the example files of the documentation: what their
//! first lines say they were made of must come back within four standard uncertainties.

fn certificate(verb: &str, more: &[&str]) -> serde_json::Value {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("c.toml");
    let said = tests::muprime()
        .args(["calibrate", verb])
        .arg(tests::file(&format!("docs/calibration/{}.csv", verb)))
        .args(["--operator", "O", "--serial", "F-17", "--json", "--out"])
        .arg(&out)
        .args(more)
        .output()
        .unwrap();
    assert!(said.status.success(), "{verb}: {}", tests::texts(&said).1);
    let checked = tests::muprime().arg("check").arg(&out).output().unwrap();
    assert!(checked.status.success(), "{verb}: {}", tests::texts(&checked).1);
    tests::documents(&said).remove(0)
}

fn expect(found: &serde_json::Value, name: &str, truth: f64, most: f64) {
    let all = found["parameters"].as_array().unwrap();
    let p = all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name}: {found}"));
    let (value, u) = (p["value"].as_f64().unwrap(), p["standard_uncertainty"].as_f64().unwrap());
    assert!((value - truth).abs() < 4.0 * u && u < most, "{name} = {value} +- {u}, made of {truth}");
}

fn remark(found: &serde_json::Value, says: &str) {
    let all = found["remarks"].as_array().unwrap();
    assert!(all.iter().any(|r| r.as_str().unwrap().contains(says)), "`{says}`: {all:?}");
}

#[test]
fn creep_orientation_dynamics_and_noise_come_back_from_the_example_files() {
    let creep = certificate("creep", &[]);
    expect(&creep, "creep.relative", 1.5e-3, 5e-5);
    expect(&creep, "creep.time_constant", 80.0, 5.0);
    let gravity = certificate("gravity", &[]);
    expect(&gravity, "orientation.angle", 0.03, 2e-3);
    expect(&gravity, "orientation.weight", 0.8, 2e-3);
    let step = certificate("step", &[]);
    expect(&step, "step.delay", 1.2e-3, 1e-4);
    expect(&step, "step.natural_frequency", 180.0, 5.0);
    expect(&step, "step.damping_ratio", 0.7, 0.05);
    // -3 dB of a second order: w sqrt(1 - 2 z^2 + sqrt((1 - 2 z^2)^2 + 1)).
    let a = 1.0 - 2.0 * 0.7f64.powi(2);
    expect(&step, "step.bandwidth", 180.0 * (a + (a * a + 1.0).sqrt()).sqrt(), 5.0);
    let tap = certificate("tap", &[]);
    expect(&tap, "mount.resonance", 55.0 * (1.0 - 0.02f64.powi(2)).sqrt(), 0.2);
    expect(&tap, "mount.damping_ratio", 0.02, 2e-3);
    let noise = certificate("noise", &["--rate-hz", "1000"]);
    expect(&noise, "normal.zero", 3300.0, 1.0);
    expect(&noise, "normal.noise_sd", 15.0, 1.0);
    // One-sided density of white noise: 2 sd^2 / rate.
    expect(&noise, "lateral.white_density", 2.0 * 400.0 / 1000.0, 0.4);
    remark(&noise, "lateral: a line at 49.80 Hz");
    remark(&noise, "the converter's step is 1 counts");
    remark(&noise, "frozen_after = 20, the least that a setup takes");
}
