//! A rig's instruments before a sweep: what `muprime doctor` finds, and what `muprime run` refuses.

use sim::wire::Quantity;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tests::peer::start;
use tests::{file, python};
use wall::bench::{self, Bench};

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

/// A bench whose forces have noise of a millinewton, and a stage that stands, as long as this lives.
struct Noise(Arc<AtomicBool>);

impl Noise {
    fn on(bench: &Bench, lateral_n: f64, normal_n: f64) -> Self {
        let (bench, ended) = (bench.clone(), Arc::new(AtomicBool::new(false)));
        let end = Arc::clone(&ended);
        std::thread::spawn(move || {
            let mut state = 1_u64;
            let mut chance = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 33) as f64 / f64::from(1_u32 << 31) - 0.5
            };
            while !end.load(Ordering::Relaxed) {
                bench.set(Quantity::LateralForce, lateral_n + 1e-3 * chance());
                bench.set(Quantity::NormalForce, normal_n + 1e-3 * chance());
                std::thread::sleep(Duration::from_micros(700));
            }
        });
        Noise(ended)
    }
}

impl Drop for Noise {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A force sensor of the laboratory's own in Python, with an ailment; amplifier and stage are healthy.
fn doctor_of(ailment: &str) -> (Option<i32>, Vec<serde_json::Value>) {
    let (bench, epoch) = (Bench::default(), Instant::now());
    bench.set(Quantity::Temperature, 24.0);
    let server = bench::serve_all(&bench, epoch);
    let address = server.address().to_string();
    let (_sensor, port) = start(python().arg(file("tests/peers/sick_sensor.py")).arg(ailment));
    let folder = tempfile::tempdir().unwrap();
    let profile = file("docs/profiles/strain-amp.toml");
    let force = format!("profile = \"{}\"\naddress = \"127.0.0.1:{port}\"", profile.display());
    doctor(&setup(folder.path(), &force, &address, &address))
}

/// What a useless sensor is called 'good' for no more: each ailment has its own words, and status 1.
#[test]
fn the_doctor_names_what_ails_a_sensor() {
    wall::in_wall_clock_time(|| {
        for (ailment, words) in [
            ("nan", "no valid sample"),
            ("swapped", "at the end of its range"),
            ("far", "N at rest, and the limit is"),
            ("frozen", "frozen, one value"),
            ("slow", "new samples a second, "),
            ("bad", "% of its answers are none"),
            ("saturated", "at the end of its range"),
            ("pressed", "compression is positive"),
            ("noisy", "its noise is"),
            ("millinewtons", "are stated"),
        ] {
            let (code, found) = doctor_of(ailment);
            let said = found[0]["found"].as_str().unwrap();
            assert_eq!((code, found[0]["good"].as_bool()), (Some(1), Some(false)), "{ailment}: {said}");
            assert!(said.contains(words), "{ailment}: {said}");
            assert!(found[0]["advice"].as_str().unwrap().len() > 20, "{ailment}: {found:?}");
            // The amplifier and the stage beside it are well: what they sample between two questions is not lost.
            assert_eq!(found[1]["good"].as_bool(), Some(true), "{ailment}: {}", found[1]);
            assert_eq!(found[2]["good"].as_bool(), Some(true), "{ailment}: {}", found[2]);
        }
    });
}

/// A healthy sensor is good, with its figures by channel.
#[test]
fn the_doctor_tells_a_healthy_sensor_by_its_figures() {
    wall::in_wall_clock_time(|| {
        let (code, found) = doctor_of("healthy");
        assert_eq!(code, Some(0), "{found:?}");
        for channel in found[0]["channels"].as_array().unwrap() {
            let number = |key: &str| channel[key].as_f64().unwrap();
            assert!((0.6e-3..2e-3).contains(&number("noise_sd")), "{channel}");
            assert!(number("rate_hz") > 0.5 * number("due_hz") && number("due_hz") == 400.0, "{channel}");
            assert!(number("saturated_share") == 0.0 && number("invalid_share") < 0.01, "{channel}");
            let ages: Vec<f64> =
                channel["age_ms"].as_array().unwrap().iter().map(|a| a.as_f64().unwrap()).collect();
            assert!(
                ages[0] <= ages[1] && ages[1] <= ages[2] && ages[1] < number("age_limit_ms"),
                "{channel}"
            );
        }
        assert!(found.last().unwrap()["subject"] == "a sweep", "{found:?}");
    });
}

/// The virtual rigs are served and looked at like any other, against the plan that is to run on them. A stall
/// of the computer is a finding of its own, and the guest is too slow for a relay's rig: it misses samples.
#[test]
fn the_doctor_approves_the_bundled_rigs() {
    wall::again_beside_a_stall(|| {
        for name in ["virtual", "virtual-rtu", "virtual-relay"] {
            let output = tests::muprime()
                .args(["doctor", "--instruments-only", "--json", "--setup", name, "--plan", "first-sweep"])
                .output()
                .unwrap();
            let said = tests::documents(&output);
            assert_eq!(output.status.code(), Some(0), "{name}: {said:?}");
            let found = said[0]["judgement"]["instruments"].as_array().unwrap().clone();
            let last = found.last().unwrap();
            assert!(last["found"].as_str().unwrap().contains("passes can be made and seen"), "{last}");
        }
    });
}

/// An amplifier without a thermometer: a run would wait for one in vain, and the key that tells it so is named.
#[test]
fn the_doctor_says_what_to_do_about_a_thermometer_that_is_not_there() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scpi.toml");
        for fitted in [true, false] {
            let text = tests::setup("scpi").text;
            std::fs::write(
                &path,
                if fitted { text.replace("temperature_fitted = false\n", "") } else { text },
            )
            .unwrap();
            let (code, found) = doctor(&path);
            let said = serde_json::to_string(&found).unwrap();
            assert_eq!(code, Some(i32::from(fitted)), "{said}");
            assert_eq!(fitted, said.contains("temperature_fitted = false"), "{said}");
        }
    });
}

/// A load that stands on the sensor at rest is judged by the plan.
#[test]
fn the_doctor_holds_the_zero_against_the_plan() {
    wall::in_wall_clock_time(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        bench.set(Quantity::Temperature, 24.0);
        let server = bench::serve_all(&bench, epoch);
        let address = server.address().to_string();
        let _noise = Noise::on(&bench, -0.01, 0.2);
        let folder = tempfile::tempdir().unwrap();
        let path = setup(
            folder.path(),
            &format!("profile = \"muprime-force2\"\naddress = \"{address}\""),
            &address,
            &address,
        );
        let judged = |more: &[&str]| {
            let mut command = tests::muprime();
            command.args(["doctor", "--instruments-only", "--json", "--setup"]).arg(&path).args(more);
            let output = command.output().unwrap();
            (output.status.code(), tests::documents(&output)[0]["judgement"]["instruments"].to_string())
        };
        let (code, said) = judged(&[]);
        assert_eq!(code, Some(0), "{said}");
        let (code, said) = judged(&["--plan", "first-sweep"]);
        assert_eq!(code, Some(1), "{said}");
        assert!(said.contains("stand on the normal axis at rest"), "{said}");
    });
}

/// The first instrument that fails hides none behind it, and the exit status says whether all is well.
#[test]
fn the_doctor_goes_on_after_an_instrument_that_fails() {
    wall::in_wall_clock_time(|| {
        let (bench, epoch) = (Bench::default(), Instant::now());
        let _noise = Noise::on(&bench, -0.125, 0.25);
        bench.set(Quantity::Temperature, 24.0);
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
        assert!(text(0).contains("lateral -0.125") && text(0).contains("normal 0.2"), "{}", text(0));
        assert!(text(1).contains("output off") && text(2).contains("at 12.5 mm"), "{found:?}");

        let (code, found) = doctor(&setup(folder.path(), &force(&nobody), &nobody, &address));
        assert_eq!(code, Some(1));
        let good: Vec<bool> = found.iter().take(3).map(|f| f["good"].as_bool().unwrap()).collect();
        assert_eq!(good, [false, false, true], "{found:?}");
        assert!(found.iter().all(|f| f["subject"] != "a sweep"), "nothing is said of one: {found:?}");
        for (finding, role) in found.iter().zip(["force", "amplifier", "stage"]) {
            assert!(finding["subject"].as_str().unwrap().starts_with(role), "{found:?}");
        }
        assert!(found[0]["found"].as_str().unwrap().contains("refused"), "{found:?}");
    });
}

/// A sensor whose count is 10 mN cannot show what a quarter of a newton's tenth is to show: refused by the
/// plan and the profile alone, before any instrument is spoken to (none is there).
#[test]
fn a_sweep_that_the_sensor_cannot_see_is_refused_before_anything_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let force = "profile = \"robotiq-ft300\"\naddress = \"/nowhere\"\nlateral = { signal = \"fx\" }\n\
                 normal = { signal = \"fz\" }";
    let setup = setup(folder.path(), force, "127.0.0.1:9", "127.0.0.1:9");
    let plan = std::fs::read_to_string(tests::file("tests/wall/plans/buses.toml")).unwrap();
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
        "w = 3 µm",
        "Fn = 30 mN",
        "`robotiq-ft300` (fx)",
        "its count is 10.0 mN",
        "raise the normal",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!folder.path().join("out").exists(), "nothing was begun");
    // At the full load the same sensor will do; what is missing then is the instrument.
    let (_, said) = run(&tests::file("tests/wall/plans/buses.toml"));
    assert!(said.contains("/nowhere"), "{said}");
}
