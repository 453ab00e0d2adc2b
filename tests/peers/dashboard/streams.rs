//! The live streams, read by Foxglove's own client library and by the parser of Prometheus.

use super::served::{CLOCK, Paced, SAMPLE, Served};
use serde_json::{Value, json};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use tests::{file, muprime, python, texts};

/// An origin that the dashboard admits.
const ORIGIN: &str = "https://app.foxglove.dev";

/// Foxglove's client, begun.
fn client(what: &str, served: &Served, last: &str) -> Child {
    let modules = file("target/venv/foxglove/node_modules");
    assert!(modules.exists(), "{} is missing: run tests/venv", modules.display());
    let mut node = Command::new("node");
    node.env("NODE_PATH", modules).arg(file("tests/peers/dashboard/foxglove.cjs"));
    node.args([what, &served.place, served.token(), last]);
    node.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap()
}

/// What a program printed: one JSON document.
fn printed(output: std::process::Output) -> Value {
    let (said, err) = texts(&output);
    assert!(output.status.success(), "{err}");
    serde_json::from_str(&said).unwrap_or_else(|_| panic!("{said}{err}"))
}

fn scraped(served: &Served) -> Value {
    let mut scrape = python();
    scrape.arg(file("tests/peers/dashboard/streams.py")).arg("metrics");
    scrape.args([&served.place, served.token()]).arg(file("docs/viewers/grafana.json"));
    printed(scrape.output().unwrap())
}

/// The value of a sample, where there is one with such a label.
fn sample(scraped: &Value, name: &str, label: Option<(&str, &str)>) -> Option<f64> {
    let all = scraped["samples"].as_array().unwrap();
    let found = all.iter().find(|s| s[0] == name && label.is_none_or(|(key, value)| s[1][key] == value));
    found.and_then(|s| s[2].as_f64())
}

/// Two clients of one run, one from its beginning and one that subscribes in the middle: both get the topics
/// of the export with units, the values that the record holds at these times, and every pass.
#[test]
fn foxglove_reads_a_live_run() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let served_runs = runs.join("live");
    std::fs::create_dir_all(&runs).unwrap();
    let served = Served::start(&runs, &[]);
    let early = client("read", &served, "14");
    let live = Paced::start(&served_runs, CLOCK / 4);
    let late = client("late", &served, "12");
    let seen = [early, late].map(|client| printed(client.wait_with_output().unwrap()));
    let passes = live.passes();
    let exported = muprime().args(["export"]).arg(&served_runs).args(["--to", "mcap"]).output().unwrap();
    assert!(exported.status.success(), "{}", texts(&exported).1);
    for (k, seen) in seen.iter().enumerate() {
        assert_eq!(seen["errors"], json!([]));
        assert!(seen["info"]["name"].as_str().unwrap().starts_with("muprime "), "{}", seen["info"]);
        let said = seen["statuses"].as_array().unwrap();
        let of_run = |s: &&Value| s.as_str().unwrap().contains("streaming run live; live runs: live");
        assert_eq!(said.iter().filter(of_run).count(), 1, "client {k}: {said:?}");
        let document = folder.path().join("seen.json");
        std::fs::write(&document, seen.to_string()).unwrap();
        let mut compare = python();
        compare.arg(file("tests/peers/dashboard/streams.py")).arg("equal").arg(&served_runs).arg(&document);
        let found = printed(compare.output().unwrap());
        println!("client {k}: {found}");
        assert_eq!(found["advertised_as_exported"], true);
        assert_eq!(found["differ"], json!([]), "of {} values", found["compared"]);
        assert!(found["compared"].as_u64().unwrap() > 1000, "{found}");
        assert!(found["events"].as_u64().unwrap() >= 2, "{found}");
        let read = found["passes"].as_u64().unwrap() as usize;
        assert!((2..=passes).contains(&read), "{read} of {passes}");
        for (topic, unit) in
            [("/force/normal_force_n", "N"), ("/stage/velocity_m_s", "m/s"), ("/pass/temperature_c", "degC")]
        {
            assert_eq!(found["units"][topic], unit, "{topic}");
        }
    }
}

/// The right client, token, origin and subprotocol get in, and nobody else.
#[test]
fn the_doors_of_the_streams() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let live = Paced::start(&runs.join("live"), CLOCK);
    let served = Served::start(&runs, &["--origin", ORIGIN]);
    let seen = printed(client("doors", &served, ORIGIN).wait_with_output().unwrap());
    let expected = json!({
        "newer": [101, "foxglove.sdk.v1"],
        "older": [101, "foxglove.websocket.v1"],
        "no subprotocol": [400, null],
        "another subprotocol": [400, null],
        "no token": [401, null],
        "wrong token": [401, null],
        "no such run": [404, null],
        "wrong origin": [403, null],
        "admitted origin": [101, "foxglove.sdk.v1"],
        "admitted origin without token": [401, null],
        "admitted origin elsewhere": [403, null],
        "wrong host": [421, null],
        "token in the address elsewhere": [401, null],
    });
    assert_eq!(seen, expected);
    // The doors may be tried before the first pass is made.
    live.passes();
}

/// Prometheus' parser takes `/metrics`, with units, and every metric of the Grafana dashboard exists.
#[test]
fn prometheus_scrapes_a_live_run() {
    let folder = tempfile::tempdir().unwrap();
    let runs = folder.path().join("runs");
    let live = Paced::start(&runs.join("live"), CLOCK / 10);
    let key = folder.path().join("token");
    let served = Served::start(&runs, &["--token-file", key.to_str().unwrap()]);
    assert_eq!(std::fs::read_to_string(&key).unwrap(), served.token());
    assert_private(&key);
    let first = scraped(&served);
    std::thread::sleep(CLOCK * 40);
    let seen = scraped(&served);
    for (key, value) in [("status", 200), ("query", 200), ("no_token", 401), ("wrong_token", 401)] {
        assert_eq!(seen[key], value, "{key}");
    }
    assert_eq!((&seen["wrong_origin"], &seen["wrong_host"]), (&json!(403), &json!(421)));
    assert!(seen["type"].as_str().unwrap().starts_with("application/openmetrics-text; version=1.0.0"));
    for (name, kind, unit) in [
        ("muprime_force_normal_force_newtons", "gauge", "newtons"),
        ("muprime_stage_velocity_meters_per_second", "gauge", "meters_per_second"),
        ("muprime_friction_mu_relative_predicted", "gauge", ""),
        ("muprime_deadline_lateness_seconds", "histogram", "seconds"),
        ("muprime_passes", "counter", ""),
        ("muprime_trips", "counter", ""),
        ("muprime_loop_missed_cycles", "counter", ""),
        ("muprime_stream_dropped_frames", "counter", ""),
        ("muprime_driven_seconds", "counter", "seconds"),
        ("muprime_run_state", "stateset", ""),
    ] {
        let family = &seen["families"][name];
        assert_eq!((&family["type"], &family["unit"]), (&json!(kind), &json!(unit)), "{name}");
    }
    let run = Some(("run", "live"));
    let value = |of: &Value, name| sample(of, name, run).unwrap_or_else(|| panic!("{name}"));
    assert!(value(&seen, "muprime_loop_cycles_total") > value(&first, "muprime_loop_cycles_total"));
    let count = value(&seen, "muprime_deadline_lateness_seconds_count");
    assert_eq!(count, value(&seen, "muprime_loop_cycles_total"), "in virtual time no deadline is missed");
    assert!(value(&seen, "muprime_passes_total") > value(&first, "muprime_passes_total"));
    assert!(value(&seen, "muprime_planned_passes") > value(&seen, "muprime_passes_total"));
    assert_eq!(sample(&seen, "muprime_run_state", Some(("muprime_run_state", "measuring"))), Some(1.0));
    assert_eq!(sample(&seen, "muprime_run_info", Some(("sample", SAMPLE))), Some(1.0), "quoted");
    let mu = value(&seen, "muprime_friction_mu_relative_predicted");
    assert!((0.0..1.5).contains(&mu), "{mu}");
    assert_eq!(seen["missing"], json!([]), "metrics of the Grafana dashboard that are not there");
    assert!(seen["used"].as_array().unwrap().len() >= 15, "{}", seen["used"]);
    assert!(live.passes() > 3, "it went on");
}

fn assert_private(file: &Path) {
    use std::os::unix::fs::PermissionsExt;
    assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o600);
}
