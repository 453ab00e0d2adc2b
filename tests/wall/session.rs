//! Whole runs of the real program in wall-clock time: sweeps over real links, kills, signals, two controllers.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tests::peer::start;
use tests::{SHORT, documents, file, muprime, python, short_plan, texts};
use wall::{cut_by_a_stall, sweep_unless_the_machine_stalls};

/// Point numbers in a run's table.
fn points(run: &Path) -> Vec<u64> {
    let table = std::fs::File::open(run.join("points.csv")).unwrap();
    models::pass::read_passes(table).unwrap().iter().map(|p| p.point).collect()
}

fn assert_each_once(points: &[u64], planned: u64) {
    let mut seen = BTreeMap::<u64, u32>::new();
    for p in points {
        *seen.entry(*p).or_default() += 1;
    }
    assert_eq!(seen.len() as u64, planned, "{points:?}");
    assert!(seen.values().all(|n| *n == 1), "{points:?}");
}

/// The command for a sweep on the ideal virtual rig at 250 Hz, in wall-clock time.
fn unhurried(plan: &str, out: &Path) -> Command {
    let setup = tests::unhurried("virtual-ideal", Path::new(plan).parent().unwrap());
    let mut sweep = muprime();
    sweep.args(["--json", "run", plan, "--setup", &setup, "--out"]).arg(out);
    sweep
}

/// Such a sweep.
fn started(plan: &str, out: &Path) -> Child {
    let mut sweep = unhurried(plan, out);
    sweep.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()
}

#[test]
fn a_sweep_over_real_modbus_tcp_ends_with_table_record_and_report() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = short_plan(folder.path());
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| unhurried(&plan, out));
        let (_, stderr) = texts(&output);
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        let said = documents(&output);
        let summary = &said.last().unwrap()["summary"];
        assert_eq!(summary["outcome"], "complete");
        assert_eq!(summary["passes"], summary["planned"]);
        assert_eq!(
            said.iter().filter(|d| d.get("pass").is_some()).count() as u64,
            summary["planned"].as_u64().unwrap()
        );
        assert_each_once(&points(&out), summary["planned"].as_u64().unwrap());
        let report = std::fs::read_to_string(out.join("report.html")).unwrap();
        assert!(
            report.matches("<svg").count() >= 4
                && !report.contains("http-equiv")
                && !report.contains("<script src"),
            "the page needs nothing from elsewhere"
        );
        let load = report.split("at 27.5 kHz and ").nth(1).and_then(|rest| rest.split(' ').next());
        let load: f64 = load.expect("a load stands below the curve").parse().unwrap();
        assert!((load - 0.25).abs() < 0.005, "the mean load of the passes is that of the plan: {load}");
        assert!(report.contains("the spring-slider alone"), "it is said which model is drawn");
        let histogram = summary["loop_report"]["histogram"].as_array().unwrap();
        let counted: u64 = histogram.iter().map(|b| b[1].as_u64().unwrap()).sum();
        let of_loop = |name: &str| summary["loop_report"][name].as_u64().unwrap();
        assert_eq!(counted, of_loop("cycles") + of_loop("overruns"), "the histogram holds every deadline");
        // The record says the same, with setup, plan and the loop's report inside.
        let record = tests::contents::read(&std::fs::read(out.join("run-1.mcap")).unwrap());
        assert!(tests::contents::complete(&record.integrity), "{:?}", record.integrity);
        assert_eq!(
            record.rows().count() as u64 + summary["record_lost"].as_u64().unwrap(),
            of_loop("cycles")
        );
        assert!(
            record.files.iter().any(|f| f.0 == "plan.toml") && record.files.iter().any(|f| f.0 == "rig.toml")
        );
        assert!(record.facts("muprime.end").unwrap()["loop"].contains("lateness_ns"));
        let passes = record.passes().count();
        assert_eq!(passes as u64, summary["planned"].as_u64().unwrap());
        // And to an ordinary reader, which checks every checksum and finds its way by the index.
        let script = "import sys; from mcap.reader import make_reader\n\
                  with open(sys.argv[1], 'rb') as f:\n\
                  \tr = make_reader(f, validate_crcs=True); s = r.get_summary()\n\
                  \tprint(s.statistics.message_count, len(s.chunk_indexes) > 9, sum(1 for _ in r.iter_messages()))";
        let counted = python().args(["-c", script]).arg(out.join("run-1.mcap")).output().unwrap();
        let all = record.messages.len();
        assert_eq!(texts(&counted).0.trim(), format!("{all} True {all}"), "{}", texts(&counted).1);
    });
}

/// The virtual-time twin: `tests/render.rs`.
#[test]
fn a_grating_is_rendered_over_real_modbus_tcp() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = folder.path().join("grating.toml");
        let text = "name = \"grating\"\nreference_every = 2\n[pass]\nsettle_s = 0.2\nmeasure_m = \"16mm\"\n[base]\n\
            amplitude_pp_m = \"5.5um\"\nfrequency_hz = \"27.5kHz\"\nspeed_m_s = \"10mm/s\"\nnormal_force_n = \"250mN\"\n[render]\n\
            target = \"grating\"\nperiod_m = \"4mm\"\nmean = 0.6\ndepth = 0.15\n[[series]]\nspeed_m_s = [\"10mm/s\"]\n";
        std::fs::write(&plan, text).unwrap();
        let plan = plan.display().to_string();
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| unhurried(&plan, out));
        let (_, stderr) = texts(&output);
        assert_eq!(output.status.code(), Some(0), "{stderr}");
        let summary = &documents(&output).pop().unwrap()["summary"];
        assert_eq!((&summary["outcome"], &summary["passes"]), (&"complete".into(), &summary["planned"]));
        let fidelity = runs::fidelity::read(&out).unwrap();
        let [group] = &fidelity.groups[..] else { panic!("{fidelity:?}") };
        println!("rms {:.4}, shifted {:.4}, late {:?}", group.rms, group.rms_shifted, group.late);
        assert!(group.saturated == 0.0 && group.rms_shifted < 0.06, "{group:?}");
        assert_eq!(runs::fidelity::of_run(&out).unwrap(), Some(fidelity), "the record alone gives the same");
    });
}

#[test]
fn a_killed_record_is_recovered_and_an_ordinary_reader_opens_it() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = short_plan(folder.path());
        let killed = |attempt: u32| {
            let out = folder.path().join(format!("run-{attempt}"));
            let mut child = started(&plan, &out);
            let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
            let third = lines.by_ref().filter(|l| l.as_ref().unwrap().contains("\"pass\"")).nth(2);
            child.kill().unwrap();
            child.wait().unwrap();
            if third.is_none() {
                eprintln!("attempt {attempt}: {}", cut_by_a_stall(&out).expect("three passes or a stall"));
            }
            third.map(|_| out)
        };
        let out = (1..=5).find_map(killed).expect("a machine that is not too busy for wall-clock time");
        let record = out.join("run-1.mcap");
        let before = tests::contents::read(&std::fs::read(&record).unwrap());
        assert!(before.integrity.cut.is_some() && before.integrity.damaged_places == 0);
        let recovered = muprime().args(["--json", "recover"]).arg(&record).output().unwrap();
        assert_eq!(recovered.status.code(), Some(0), "{}", texts(&recovered).1);
        assert_eq!(documents(&recovered)[0]["messages"], before.messages.len());
        assert!(record.with_extension("mcap.original").exists());
        let script = "import sys; from mcap.reader import make_reader\n\
                  with open(sys.argv[1], 'rb') as f: print(sum(1 for _ in make_reader(f).iter_messages()))";
        let counted = python().args(["-c", script]).arg(&record).output().unwrap();
        assert_eq!(texts(&counted).0.trim(), before.messages.len().to_string(), "{}", texts(&counted).1);
        let again = muprime().args(["--json", "recover"]).arg(&record).output().unwrap();
        assert_eq!(documents(&again)[0]["whole"], true);
    });
}

#[test]
fn an_interrupt_stops_safely_and_keeps_what_was_measured() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run");
        let plan = short_plan(folder.path());
        let mut child = started(&plan, &out);
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        lines.by_ref().find(|l| l.as_ref().unwrap().contains("\"pass\"")).unwrap().unwrap();
        // SAFETY: sends SIGINT to the child that this test has started and not yet waited for.
        unsafe { libc::kill(child.id() as libc::pid_t, libc::SIGINT) };
        let rest: Vec<serde_json::Value> =
            lines.map(|l| serde_json::from_str(&l.unwrap()).unwrap()).collect();
        assert_eq!(
            child.wait().unwrap().code(),
            Some(1),
            "stopped is not done: 'run && diagnose' must not go on"
        );
        assert_eq!(rest.last().unwrap()["summary"]["outcome"], "stopped");
        assert!(!points(&out).is_empty());
        let record = tests::contents::read(&std::fs::read(out.join("run-1.mcap")).unwrap());
        assert!(
            tests::contents::complete(&record.integrity),
            "the record was ended properly: {:?}",
            record.integrity
        );
        let last = record.rows().last().unwrap();
        assert!(!last.armed && last.drive_pp_m == 0.0 && last.load_n == 0.0 && last.velocity_m_s == 0.0);
    });
}

#[test]
fn two_controllers_never_share_a_run() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("run");
        let plan = short_plan(folder.path());
        let mut first = muprime()
            .args(["run", &plan, "--setup", "virtual-ideal", "--out"])
            .arg(&out)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let waited = Instant::now();
        while !out.join(".lock").exists() {
            assert!(waited.elapsed() < Duration::from_secs(20));
            std::thread::sleep(Duration::from_millis(5));
        }
        let second =
            muprime().args(["run", &plan, "--setup", "virtual-ideal", "--out"]).arg(&out).output().unwrap();
        assert_eq!(second.status.code(), Some(2));
        assert!(texts(&second).1.contains("another muprime"), "{}", texts(&second).1);
        first.kill().unwrap();
        first.wait().unwrap();
    });
}

/// An instrument that nobody here wrote (pymodbus) replays a measured rock-friction trace; `muprime run` reads it, with
/// amplifier and stage of the virtual rig. What the record holds must be what was replayed, with its age.
#[test]
fn a_foreign_instrument_replaying_a_measured_trace_is_recorded_as_it_was() {
    wall::in_wall_clock_time(|| {
        const ROWS_PER_SECOND: f64 = 100.0;
        let folder = tempfile::tempdir().unwrap();
        let recording = file("tests/recordings/rock-velocity-steps/velstep4_excerpt.txt");
        let mut replay = python();
        replay.arg(file("tests/peers/replay_server.py")).arg(&recording).arg(ROWS_PER_SECOND.to_string());
        let (_replay, port) = start(&mut replay);
        let mut rest = muprime();
        rest.stderr(Stdio::null()).args([
            "--json",
            "virtual-rig",
            "--setup",
            "virtual-ideal",
            "--modbus-tcp",
            "127.0.0.1:0",
        ]);
        let (_rest, said) = start(&mut rest);
        let said: serde_json::Value = serde_json::from_str(&said).unwrap();
        let others = said["modbus_tcp"].as_str().unwrap();
        let setup = folder.path().join("setup.toml");
        let text = format!(
            "name = \"replayed\"\n[[force]]\nprofile = \"muprime-force2\"\naddress = \"127.0.0.1:{port}\"\nrate_hz = 200\n\
         [amplifier]\nprofile = \"muprime-amplifier\"\naddress = \"{others}\"\n\
         [stage]\nprofile = \"muprime-stage\"\naddress = \"{others}\"\n\
         [finger]\ntip = \"artificial-silicone\"\n[noise]\npass_relative_sd = 0.015\nforce_sd_n = 0.0008\n\
         [limits]\nlink_stall_s = 0.045\nlate_cycles_max = 100\nlate_in_a_row_max = 45\n[loop]\nrate_hz = 250\n"
        );
        std::fs::write(&setup, text).unwrap();
        let plan = folder.path().join("plan.toml");
        let text =
            SHORT.replace("seed = 7", "directions = [1]").replace("[0.5e-6, 1e-6, 2e-6, 3e-6]", "[0.0]");
        std::fs::write(&plan, text.replace("reference_every = 4", "reference_every = 0")).unwrap();
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| {
            let mut sweep = muprime();
            sweep.args(["--json", "run"]).arg(&plan).arg("--setup").arg(&setup).arg("--out").arg(out);
            sweep
        });
        assert_eq!(output.status.code(), Some(0), "{}{}", texts(&output).0, texts(&output).1);

        let rows: Vec<Vec<f64>> = std::fs::read_to_string(&recording)
            .unwrap()
            .lines()
            .skip(1)
            .map(|line| line.split_whitespace().map(|x| x.parse().unwrap()).collect())
            .collect();
        let count = |newton: f64| (newton / 1e-5).round_ties_even() as i64;
        let replayed = |row: usize| {
            let normal = 0.25 * rows[row][3] / rows[0][3];
            (count(rows[row][2] * normal), count(normal))
        };
        let record = tests::contents::read(&std::fs::read(out.join("run-1.mcap")).unwrap());
        let (mut distinct, mut oldest) = (std::collections::BTreeSet::new(), 0.0f64);
        for row in record.rows() {
            let (Ok(lateral), Ok(normal)) = (row.inputs.seen.forces.lateral, row.inputs.seen.forces.normal)
            else {
                continue;
            };
            let expected = replayed(lateral.sequence as usize);
            assert_eq!((lateral.raw, normal.raw), expected, "row {}", lateral.sequence);
            assert!((lateral.value - expected.0 as f64 * 1e-5).abs() < 1e-12);
            assert!((normal.value - expected.1 as f64 * 1e-5).abs() < 1e-12);
            distinct.insert(lateral.sequence);
            oldest = oldest.max(lateral.age(row.now).seconds());
        }
        println!(
            "{} samples of the trace recorded, none changed; greatest age {:.1} ms",
            distinct.len(),
            oldest * 1e3
        );
        assert!(distinct.len() > 50);
        assert!(
            oldest > 1.0 / ROWS_PER_SECOND * 0.5,
            "a sample is held until the next one comes: its age must show"
        );
    });
}
