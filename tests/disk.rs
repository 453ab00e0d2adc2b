//! The system fails: where not even the end of a run can be written, the run has failed; where threads run
//! out, a refusal has touched nothing.

use std::fs::Permissions;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::process::{Command, Output};
use tests::{documents, muprime, served, texts};

#[test]
fn where_even_the_summary_cannot_be_written_the_run_has_failed_and_was_not_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (folder.path().join("plan.toml"), folder.path().join("run"));
    std::fs::write(&plan, served::plan("disk", 2, &[2e-6])).unwrap();
    let mut sweep = muprime();
    sweep.args(["--json", "run", "--fast", "--setup", "virtual-ideal"]).arg(&plan).arg("--out").arg(&out);
    let whole = sweep.output().unwrap();
    assert_eq!(whole.status.code(), Some(0), "{}", texts(&whole).1);
    // Nothing can be put in the place of a folder that is not empty, not even by root.
    std::fs::remove_file(out.join("summary.json")).unwrap();
    std::fs::create_dir_all(out.join("summary.json/taken")).unwrap();
    let output = sweep.output().unwrap();
    let (stdout, stderr) = texts(&output);
    assert_eq!(output.status.code(), Some(1), "{stdout}{stderr}");
    let said = documents(&output);
    assert_eq!(said.last().unwrap()["summary"]["outcome"], "record_lost", "{stdout}");
    assert!(stderr.contains("could not be saved"), "{stderr}");
    // With the place free again the same command ends as it should.
    std::fs::remove_dir_all(out.join("summary.json")).unwrap();
    let again = sweep.output().unwrap();
    assert_eq!(again.status.code(), Some(0), "{}", texts(&again).1);
}

/// A user who owns nothing here: with his threads alone the limit is exact.
const NOBODY: &str = "54321";

/// Runs the program with so many processes and threads at most.
fn with_threads(most: usize, folder: &std::path::Path, args: &[&str]) -> Output {
    let program = folder.join("muprime");
    let limited = format!("ulimit -Su {most}; exec \"$@\"");
    let mut command = match folder.metadata().unwrap().uid() {
        // A limit does not hold root.
        0 => {
            let mut command = Command::new("setpriv");
            let (user, group) = (format!("--reuid={NOBODY}"), format!("--regid={NOBODY}"));
            command.args([&user, &group, "--clear-groups", "bash"]);
            command
        }
        _ => Command::new("bash"),
    };
    command.args(["-c", &limited, "bash"]).arg(program).args(args).env("HOME", folder).output().unwrap()
}

/// Threads of this user, who may not be root: those of other tests come and go.
fn threads_here(folder: &std::path::Path) -> usize {
    let user = folder.metadata().unwrap().uid();
    let own = |entry: &std::fs::DirEntry| user != 0 && entry.metadata().is_ok_and(|m| m.uid() == user);
    let processes = std::fs::read_dir("/proc").unwrap().filter_map(Result::ok).filter(own);
    processes
        .filter_map(|process| std::fs::read_dir(process.path().join("task")).ok())
        .map(Iterator::count)
        .sum()
}

/// The last refusals came after the loop had begun, and the thread that follows the sweep ended in a panic.
#[test]
fn where_threads_run_out_a_refusal_has_touched_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::set_permissions(folder, Permissions::from_mode(0o777)).unwrap();
    std::fs::copy(muprime().get_program(), folder.join("muprime")).unwrap();
    let plan = folder.join("plan.toml");
    std::fs::write(&plan, served::plan("threads", 1, &[2e-6])).unwrap();
    let (mut refused, mut unfinished) = (0, 0);
    for most in (2..60).map(|more| threads_here(folder) + more) {
        let out = folder.join(format!("run-{most}"));
        let args =
            ["run", "--setup", "virtual-ideal", "--out", out.to_str().unwrap(), plan.to_str().unwrap()];
        let output = with_threads(most, folder, &args);
        let (stdout, stderr) = texts(&output);
        match output.status.code() {
            Some(0) => break,
            Some(2) => {
                assert!(!out.exists(), "{most}: refused, and the run has begun: {stdout}{stderr}");
                refused += 1;
            }
            Some(3) => unfinished += usize::from(out.exists()),
            status => panic!("{most}: {status:?} {stdout}{stderr}"),
        }
        let words =
            stderr.split_whitespace().filter(|word| *word != "\u{2502}").collect::<Vec<_>>().join(" ");
        assert!(words.contains("the system gives no further thread"), "{most}: {stdout}{stderr}");
        assert!(!words.contains("panicked"), "{most}: {stderr}");
    }
    assert!(refused > 2 && unfinished > 2, "{refused} refused, {unfinished} ended after they had begun");
}
