//! Ctrl-C at the terminal, in what takes long.

use std::process::Stdio;
use tests::{documents, muprime, texts};

/// Waits until a program catches SIGINT: one that has not begun to would just die of it.
fn catches_keys(id: libc::pid_t) {
    let began = std::time::Instant::now();
    loop {
        let status = std::fs::read_to_string(format!("/proc/{id}/status")).unwrap();
        assert!(!status.contains("State:\tZ"), "it ended before it could catch Ctrl-C");
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        if u64::from_str_radix(caught.trim(), 16).unwrap() & (1 << (libc::SIGINT - 1)) != 0 {
            return;
        }
        assert!(began.elapsed().as_secs() < 60, "it never catches Ctrl-C");
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
}

/// A folder with the passes of `run` repeated so often that their diagnosis takes long on any machine.
fn many_times(run: &std::path::Path, to: &std::path::Path, times: usize) {
    std::fs::create_dir(to).unwrap();
    std::fs::copy(run.join("rig.toml"), to.join("rig.toml")).unwrap();
    let mut from = csv::Reader::from_path(run.join("points.csv")).unwrap();
    let names = from.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = from.records().map(Result::unwrap).collect();
    let at = |name: &str| names.iter().position(|n| n == name).unwrap();
    let (point, time) = (at("point"), at("time_s"));
    let longest: f64 = rows.last().unwrap()[time].parse().unwrap();
    let mut out = csv::Writer::from_path(to.join("points.csv")).unwrap();
    out.write_record(&names).unwrap();
    for turn in 0..times {
        for (i, row) in rows.iter().enumerate() {
            let cell = |(k, cell): (usize, &str)| match k {
                k if k == point => (turn * rows.len() + i + 1).to_string(),
                k if k == time => (cell.parse::<f64>().unwrap() + turn as f64 * (longest + 1.0)).to_string(),
                _ => cell.to_string(),
            };
            out.write_record(row.iter().enumerate().map(cell)).unwrap();
        }
    }
    out.flush().unwrap();
}

/// Ctrl-C in what takes long: what there is so far is told as partial, and the status is 130.
#[test]
fn ctrl_c_tells_what_there_is_so_far() {
    let folder = tempfile::tempdir().unwrap();
    let run = muprime()
        .args(["run", "first-sweep", "--setup", "virtual", "--fast", "--out"])
        .arg(folder.path().join("run"))
        .env("MUPRIME_RUNS", folder.path())
        .output()
        .unwrap();
    assert_eq!(run.status.code(), Some(0), "{}", texts(&run).1);
    let data = folder.path().join("long");
    many_times(&folder.path().join("run"), &data, 40);
    let trials: [(&[&str], f64, &str); 7] = [
        (&["diagnose", data.to_str().unwrap()], 0.7, "partial: stopped at"),
        (&["blind", "--sets", "4000", "--no-pairs"], 3.0, "partial: "),
        (&["blind", "--sets", "4000", "--noise", "gross", "--no-pairs"], 3.0, "partial: "),
        (&["blind", "--sets", "400000", "--write", "sets"], 1.5, "partial: "),
        (&["faults", "--seeds", "4000000"], 1.5, "partial: "),
        (&["model", "ridge", "--elements", "20000"], 1.5, "partial: "),
        (&["model", "table"], 1.5, "partial: "),
    ];
    for (words, after_s, told) in trials {
        for json in [false, true] {
            let mut command = muprime();
            command.args(words).current_dir(folder.path()).stdout(Stdio::piped()).stderr(Stdio::piped());
            if json {
                command.arg("--json");
            }
            let program = command.spawn().unwrap();
            let id = libc::pid_t::try_from(program.id()).unwrap();
            catches_keys(id);
            std::thread::sleep(std::time::Duration::from_secs_f64(after_s));
            // SAFETY: a signal to a process that this test started and has not waited for.
            assert_eq!(unsafe { libc::kill(id, libc::SIGINT) }, 0);
            let ended = program.wait_with_output().unwrap();
            let (out, err) = texts(&ended);
            assert_eq!(ended.status.code(), Some(130), "{words:?}: {out}{err}");
            assert!(err.contains("what follows is partial"), "{words:?}: {err}");
            assert!(!err.contains('\u{1b}') && !err.contains('\r'), "{words:?}: no bar in a file: {err}");
            match (json, words[words.len().min(2) - 1]) {
                (_, "table") => assert!(err.contains("cases are in"), "{err}"),
                (true, _) => assert_eq!(documents(&ended)[0]["partial"], true, "{out}"),
                (false, _) => assert!(out.contains(told), "{words:?}: {out}{err}"),
            }
            // What one trial has written keeps the next from writing there.
            if words.contains(&"sets") {
                std::fs::remove_dir_all(folder.path().join("sets")).unwrap();
            }
        }
    }
}
