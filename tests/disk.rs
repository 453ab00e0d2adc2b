//! The disk fails: where not even the end of a run can be written, the run has failed.

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
