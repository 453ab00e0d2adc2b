//! Finger: friction without vibration of the virtual fingertip, its coefficient withheld; and the command of
//! the inverse analysis on a file of phases made by another mesh and step.

use crate::bench::{Coverage, seed, trials};
use crate::bound::{independent, jacobian};
use calibration::finger::friction::{FrictionPoint, friction};
use calibration::uncertainty::student::coverage_factor;
use models::PeakToPeak;
use models::ridge::{RidgeCase, RunSettings, run};
use sim::defects::{Defects, Surroundings};
use sim::finger::{FingerConfig, VirtualFinger};
use sim::noise::Noise;
use sim::world::{Point, steady_forces};
use tests::{documents, muprime, rounds, texts};

/// Passes over loads and speeds with pass-to-pass scatter and force noise, as the rig would measure them.
fn passes(finger: &VirtualFinger, defects: &Defects, draw: &mut Noise) -> Vec<FrictionPoint> {
    let mut points = Vec::new();
    for normal_force_n in [0.1, 0.2, 0.4, 0.8] {
        for speed_m_s in [0.01, 0.03, 0.1] {
            for _ in 0..3 {
                let at = Surroundings {
                    time_s: 0.0,
                    contact_time_s: 5.0,
                    position_m: 0.0,
                    direction: 1.0,
                    frequency_hz: 27_500.0,
                    normal_force_n,
                    ambient_pressure_pa: 101_325.0,
                    temperature_c: 22.0,
                };
                let forces = steady_forces(finger, defects, &Point { at, known_pp_m: 0.0, speed_m_s });
                let lateral = forces.lateral_n * (1.0 + 0.015 * draw.normal()) + 2e-4 * draw.normal();
                points.push(FrictionPoint {
                    normal_force_n: forces.normal_n + 2e-4 * draw.normal(),
                    speed_m_s,
                    lateral_force_n: lateral,
                    contact_time_s: None,
                });
            }
        }
    }
    points
}

#[test]
fn friction_and_its_exponents_are_covered_as_stated() {
    let mut covered: [Coverage; 3] = Default::default();
    for trial in 0..trials() {
        let mut draw = Noise::new(seed(trial), "friction bench");
        let config = FingerConfig { mu0: draw.between(0.2, 1.2), ..FingerConfig::default() };
        let finger = VirtualFinger::new(&config, seed(trial));
        let points = passes(&finger, &Defects::none(), &mut draw);
        let found = friction(&points).unwrap();
        let line = |b: &[f64]| {
            let ln = |x: f64, x0: f64| (x / x0).ln();
            points
                .iter()
                .map(|p| {
                    b[0] + b[1] * ln(p.normal_force_n, found.reference_force_n)
                        + b[2] * ln(p.speed_m_s, found.reference_speed_m_s)
                })
                .collect()
        };
        // Scatter of ln(L / F): from pass to pass, and 0.2 mN on either force.
        let sd: Vec<f64> = points
            .iter()
            .map(|p| 0.015f64.hypot(2e-4 / p.lateral_force_n).hypot(2e-4 / p.normal_force_n))
            .collect();
        let bound = independent(&jacobian(line, &[config.mu0.ln(), 0.0, 0.0], &[1e-4; 3]), &sd);
        let k = coverage_factor(0.95, found.fit.degrees_of_freedom);
        // A Coulombic world: no dependence on load or speed.
        for (i, truth) in [config.mu0.ln(), 0.0, 0.0].into_iter().enumerate() {
            let (value, half) = (found.fit.estimates[i], k * found.fit.standard_uncertainty(i));
            covered[i].add_with_bound([value - half, value + half], truth, half, bound[(i, i)].sqrt());
        }
    }
    for (c, name) in covered.iter().zip(["mu0", "load exponent", "speed exponent"]) {
        c.judge(name);
    }
}

#[test]
fn a_contact_that_is_not_coulombic_is_seen() {
    let text = "[[defect]]\nname = \"load_dependent_friction\"\nparameters = { area_share = 0.9 }\n";
    let mut draw = Noise::new(seed(0), "friction bench");
    let finger = VirtualFinger::new(&FingerConfig::default(), 1);
    let found = friction(&passes(&finger, &Defects::parse(text).unwrap(), &mut draw)).unwrap();
    let (exponent, u) = (found.fit.estimates[1], found.fit.standard_uncertainty(1));
    // Between Coulomb (0) and a Hertz contact's area (-1/3).
    assert!(exponent + 3.0 * u < 0.0 && exponent > -0.34, "{exponent} +- {u}");
}

/// Phases of elastic skin of 28.3 MPa on twice the elements of the command with a step of its own, a
/// deterministic scatter of about a degree and a half on each mean, as PHASES.csv has them.
fn phases_csv() -> String {
    let mut text = String::from("amplitude_pp_m,phase_shift_deg,phase_shift_sd_deg,repeats,condition\n");
    // The model is run once an amplitude: by default two of them are measured twice.
    let amplitudes_um = rounds([1.1, 1.4, 1.8, 2.4, 1.4, 1.8], [1.1, 1.3, 1.5, 1.8, 2.2, 2.6]);
    for (n, um) in amplitudes_um.into_iter().enumerate() {
        let amplitude = PeakToPeak::from_metres(um * 1e-6);
        let case = RidgeCase { amplitude, speed_m_s: 0.0, elements: rounds(512, 800), ..RidgeCase::paper() };
        let settings = RunSettings { step_s: Some(4.5e-9), energy: false, ..RunSettings::default() };
        let phase = run(&case, &settings).unwrap().phase_shift_deg.unwrap();
        let scatter = 2.2 * (7.3 * n as f64).sin();
        let phase = (phase + scatter).rem_euclid(360.0);
        text += &format!("{um}e-6,{phase:.2},5,10,moist\n");
    }
    text
}

#[test]
fn the_command_finds_the_skin_in_a_file_of_phases() {
    let folder = tempfile::tempdir().unwrap();
    let phases = folder.path().join("PHASES.csv");
    let table = phases_csv();
    std::fs::write(&phases, &table).unwrap();
    let calibrate = |out: &str| {
        let mut command = muprime();
        command.args(["--json", "calibrate", "finger", "--operator", "a", "--serial", "index"]);
        command.args(["--elements", rounds("256", "400"), "--modulus-range-pa", "23e6", "35e6", "--out"]);
        command.arg(folder.path().join(out)).arg(&phases).output().unwrap()
    };
    let output = calibrate("finger.toml");
    assert!(output.status.success(), "{}", texts(&output).1);
    let said = &documents(&output)[0];
    let number = |at: &str| said.pointer(at).and_then(serde_json::Value::as_f64).unwrap();
    println!("{said:#}");
    // The modulus within 5 %, and no more said of penalty and time than the phases hold.
    assert_eq!(said["parameters"][0]["name"], "stratum_corneum.young_modulus");
    assert!((number("/skin/elastic/young_modulus_pa") / 28.3e6 - 1.0).abs() < 0.05);
    let interval = |name: &str| [0, 1].map(|end| number(&format!("/skin/all_free/{name}/ci95/{end}")));
    let holds = |[low, high]: [f64; 2], truth: f64| low <= truth && truth <= high;
    assert!(holds(interval("young_modulus_pa"), 28.3e6), "{:?}", interval("young_modulus_pa"));
    assert!(holds(interval("penalty_ratio"), 93.0 / 28.3 - 1e-9), "{:?}", interval("penalty_ratio"));
    assert_eq!(said["skin"]["all_free"]["penalty_ratio"]["closed"][1], false);
    let remarks = said["remarks"].to_string();
    assert!(remarks.contains("elastic skin will do") && remarks.contains("cannot tell"), "{remarks}");
    let text = std::fs::read_to_string(folder.path().join("finger.toml")).unwrap();
    calibration::certificate::Certificate::from_toml(&text).unwrap();
    // Moist and dry in one table are two fingers.
    std::fs::write(&phases, table.replacen("moist", "dry", 2)).unwrap();
    let refused = calibrate("mixed.toml");
    assert!(!refused.status.success() && !folder.path().join("mixed.toml").exists());
    assert!(texts(&refused).1.contains("one at a time"), "{}", texts(&refused).1);
}
