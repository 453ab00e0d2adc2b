//! Studies on engines that count their tasks and know nothing of cases: the share of a task, and the plan
//! of what is missing.

use serde_json::Value;
use std::path::Path;
use std::process::Output;
use studies::cases::task_range::Share;
use tests::study::{gathered, here, noop, run, said, text, worker};
use tests::{documents, muprime, texts};

/// Variables in which engines number a task.
const NAMES: [&str; 8] = [
    "SLURM_ARRAY_TASK_ID",
    "SLURM_ARRAY_TASK_MIN",
    "SLURM_ARRAY_TASK_MAX",
    "SLURM_ARRAY_TASK_COUNT",
    "SLURM_ARRAY_TASK_STEP",
    "PBS_ARRAY_INDEX",
    "PBS_ARRAYID",
    "JOB_COMPLETION_INDEX",
];

#[test]
fn shares_are_all_cases_once_and_differ_by_one_at_most() {
    for (cases, of) in [(10, 3), (3, 10), (1_000_003, 1000), (u64::MAX, 7), (0, 2)] {
        let parts: Vec<_> = (0..of).map(|task| Share::new(task, of).unwrap().part(cases)).collect();
        assert!(parts.windows(2).all(|p| p[0].end == p[1].start));
        assert_eq!((parts[0].start, parts[parts.len() - 1].end), (0, cases));
        let sizes = parts.iter().map(|p| p.end - p.start);
        assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
    }
    assert!(Share::new(3, 3).is_err() && Share::new(0, 0).is_err());
}

#[test]
fn each_engine_names_a_task_and_what_is_unclear_is_refused() {
    let share = |of, variables: &[(&str, &str)]| {
        let get = |name: &str| variables.iter().find(|v| v.0 == name).map(|v| v.1.to_string());
        Share::from_environment(of, &get).map_err(|why| why.to_string())
    };
    let slurm = |id, min, max, step, count| {
        let all = ["ID", "MIN", "MAX", "STEP", "COUNT"].map(|n| format!("SLURM_ARRAY_TASK_{n}"));
        let all: Vec<_> = all.iter().map(String::as_str).zip([id, min, max, step, count]).collect();
        share(None, &all)
    };
    let is = |task, of| Ok(Share { task, of });
    assert_eq!(slurm("3", "0", "7", "1", "8"), is(3, 8));
    assert_eq!(slurm("8", "1", "8", "1", "8"), is(7, 8));
    assert_eq!(slurm("30", "10", "40", "10", "4"), is(2, 4));
    assert!(slurm("5", "1", "9", "1", "3").unwrap_err().contains("has gaps"));
    for name in [NAMES[0], NAMES[5], NAMES[6], NAMES[7]] {
        assert_eq!(share(Some(4), &[(name, "3")]), is(3, 4));
        assert!(share(Some(4), &[(name, "4")]).unwrap_err().contains("no such task"));
        assert!(share(Some(4), &[(name, "x")]).unwrap_err().contains("not a number"));
    }
    assert!(share(None, &[("PBS_ARRAY_INDEX", "3")]).unwrap_err().contains("of how many"));
    assert_eq!(share(Some(4), &[("PBS_ARRAYID", "3"), ("PBS_ARRAY_INDEX", "3")]), is(3, 4));
    let both = share(Some(4), &[("SLURM_ARRAY_TASK_ID", "3"), ("JOB_COMPLETION_INDEX", "2")]);
    assert!(both.unwrap_err().contains("contradict"));
    assert!(share(Some(4), &[]).unwrap_err().contains("no cases are named"));
}

#[test]
fn an_engine_that_counts_its_tasks_alone_runs_every_case_once() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 50, 0);
    let wanted = here(&cases, &folder.path().join("whole"));
    let task = |out: &Path, words: &[&str], variables: &[(&str, &str)]| {
        let mut command = muprime();
        for name in NAMES {
            command.env_remove(name);
        }
        run(command
            .args(["--json", "case", "--cases", text(&cases), "--out", text(out)])
            .args(words)
            .envs(variables.iter().copied()))
    };
    // By words, and as each engine numbers its tasks; one of them from 1.
    let by_engine: [(&str, &dyn Fn(&Path, u64) -> Output); 5] = [
        ("words", &|out, i| task(out, &["--task", &i.to_string(), "--of", "7"], &[])),
        ("slurm", &|out, i| {
            let id = (i + 1).to_string();
            let rest = [(NAMES[1], "1"), (NAMES[2], "7"), (NAMES[3], "7"), (NAMES[4], "1")];
            task(out, &[], &[&rest[..], &[(NAMES[0], id.as_str())]].concat())
        }),
        ("pbs", &|out, i| task(out, &["--of", "7"], &[("PBS_ARRAY_INDEX", &i.to_string())])),
        ("torque", &|out, i| task(out, &["--of", "7"], &[("PBS_ARRAYID", &i.to_string())])),
        ("kubernetes", &|out, i| task(out, &["--of", "7"], &[("JOB_COMPLETION_INDEX", &i.to_string())])),
    ];
    for (engine, run_task) in by_engine {
        let out = folder.path().join(engine);
        // What is there is not run again: a hole of two ranges is left for the shares that it is in.
        assert!(run(&mut worker(&cases, &out, "9..12")).status.success());
        for i in (0..7).rev() {
            let done = run_task(&out, i);
            assert!(done.status.success(), "{engine}: {:?}", texts(&done));
        }
        let whole = said(&["gather", text(&out)]);
        assert_eq!((&whole["sha256"], &whole["agreeing_duplicates"]), (&wanted.clone().into(), &0.into()));
        let again = documents(&run_task(&out, 3)).pop().unwrap();
        assert_eq!(
            (&again["range"], &again["shards"]),
            (&serde_json::json!([21, 28]), &serde_json::json!([]))
        );
    }
    // What is unclear is refused, and no folder is made.
    let out = folder.path().join("refused");
    for (words, variables, wanted) in [
        (&["--task", "7", "--of", "7"][..], &[][..], "no such task"),
        (&["--of", "7"], &[("PBS_ARRAY_INDEX", "7")], "no such task"),
        (&["--of", "7"], &[("PBS_ARRAY_INDEX", "2"), ("JOB_COMPLETION_INDEX", "3")], "contradict each other"),
        (&[], &[("JOB_COMPLETION_INDEX", "3")], "nothing states of how many"),
        (&[], &[], "no cases are named"),
    ] {
        let refused = task(&out, words, variables);
        assert_eq!(refused.status.code(), Some(2), "{words:?} {variables:?}");
        let error = documents(&refused).pop().unwrap()["error"].to_string();
        assert!(error.contains(wanted) && !out.exists(), "{error}");
    }
}

/// An option that an engine does not have is refused wherever it may be given, and no folder is made.
#[test]
fn options_that_an_engine_does_not_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (cases, out) = (noop(folder.path(), 50, 10), folder.path().join("study"));
    let submit = ["submit", text(&cases), "--out", text(&out)];
    let adapt = ["model", "adapt", "--out", text(&out), "--span", "amplitude_pp_m=0.3e-6..5e-6"];
    for words in [&submit[..], &adapt] {
        for (more, wanted) in [
            (["--cores-a-task", "2"], "--cores-a-task is for slurm"),
            (["--workers", "0"], "at least one is needed"),
            (["--task-s", "0"], "above 0"),
            (["--engine", "dask"], "needs --server"),
        ] {
            let refused = run(muprime().args(words).args(more));
            assert_eq!(refused.status.code(), Some(2), "{words:?} {more:?}");
            assert!(texts(&refused).1.contains(wanted) && !out.exists(), "{words:?} {more:?}");
        }
    }
}

#[test]
fn a_plan_names_what_is_missing_as_commands_with_time_and_memory() {
    let folder = tempfile::tempdir().unwrap();
    let cases = noop(folder.path(), 50, 100);
    let (out, wanted) = (folder.path().join("study"), here(&cases, &folder.path().join("whole")));
    assert!(run(&mut worker(&cases, &out, "10..20")).status.success());
    let plan = said(&["submit", text(&cases), "--out", text(&out), "--plan", "--workers", "2"]);
    assert_eq!((&plan["schema"], &plan["missing"]), (&"muprime.study_plan/1".into(), &40.into()));
    let peak = plan["pilot"]["peak_bytes"].as_u64().unwrap();
    let tasks = plan["tasks"].as_array().unwrap();
    let range = |task: &Value| task["range"][0].as_u64().unwrap()..task["range"][1].as_u64().unwrap();
    assert!(tasks.iter().flat_map(range).eq((0..10).chain(20..50)) && tasks.len() > 7);
    for task in tasks {
        assert!(task["expected_s"].as_f64() < task["limit_s"].as_f64());
        assert_eq!(task["memory_bytes"].as_u64(), Some((2 * peak).max(64 << 20)));
    }
    // Without --json it is a script.
    let script = run(muprime()
        .args(["submit", text(&cases), "--out", text(&out), "--plan", "--case-s", "300"])
        .env_remove("MUPRIME_RUNS"));
    let script = texts(&script).0;
    assert_eq!(script.lines().count(), 40, "{script}");
    assert!(run(std::process::Command::new("sh").args(["-ec", &script])).status.success());
    assert_eq!(gathered(&out), wanted);
    assert_eq!(
        said(&["submit", text(&cases), "--out", text(&out), "--plan"])["tasks"],
        serde_json::json!([])
    );
}
