//! The disk fails: a file size limit in the middle of a sweep stops it in order, the loop never notices, and
//! what was acknowledged is kept.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;
use tests::{documents, muprime, served, texts};
use wall::sweep_unless_the_machine_stalls;

fn points(run: &Path) -> Vec<u64> {
    runs::run_dir::passes_in(run).unwrap().iter().map(|p| p.pass.point).collect()
}

#[test]
fn a_disk_that_fails_stops_the_sweep_in_order_and_keeps_what_was_measured() {
    wall::in_wall_clock_time(|| {
        let folder = tempfile::tempdir().unwrap();
        let plan = folder.path().join("plan.toml");
        std::fs::write(&plan, served::plan("disk", 2, &[1e-6, 2e-6, 3e-6, 4e-6, 1.5e-6, 2.5e-6])).unwrap();
        // No file may grow beyond 300 kB: the record does after a second or two, in the middle of the sweep.
        let (out, output) = sweep_unless_the_machine_stalls(folder.path(), |out| {
            let mut limited = Command::new("bash");
            limited.args(["-c", "trap '' XFSZ; ulimit -f 300; exec \"$@\"", "bash"]);
            limited.arg(muprime().get_program()).args(["--json", "run", "--setup", "virtual-ideal"]);
            limited.arg(&plan).arg("--out").arg(out);
            limited
        });
        let (stdout, stderr) = texts(&output);
        assert_eq!(output.status.code(), Some(1), "{stdout}{stderr}");
        let said = documents(&output);
        let summary = &said.last().unwrap()["summary"];
        assert_eq!(summary["outcome"], "record_lost", "{summary}");
        assert!(stderr.contains("the sweep was stopped"), "{stderr}");
        let passes = said.iter().filter_map(|d| d.get("pass"));
        let promised: BTreeSet<u64> = passes.map(|p| p["pass"]["point"].as_u64().unwrap()).collect();
        let kept: BTreeSet<u64> = points(&out).into_iter().collect();
        assert!(promised.is_subset(&kept) && kept.len() <= 20, "{promised:?} {kept:?}");
        assert_eq!(summary["loop_report"]["ring_drops"], 0, "the loop never noticed");
        // With room again the sweep goes on and is made whole.
        let mut resumed = muprime();
        resumed.args(["run", "--setup", "virtual-ideal"]).arg(&plan).arg("--out").arg(&out);
        let resumed = resumed.output().unwrap();
        assert!(matches!(resumed.status.code(), Some(0 | 1)), "{}", texts(&resumed).1);
        assert!(points(&out).len() >= kept.len(), "what was kept stays kept");
    });
}
