//! Hands what is missing to an engine and follows what comes into the folder. The same call again goes on: a
//! job that is still at work is followed, and only what is missing then is handed over.
#![allow(clippy::disallowed_methods, reason = "somebody waits in wall-clock time")]

use super::engines::{self, Accepted, ClusterJob, Engine};
use super::file::{self, Header};
use super::gather::{gather, holes};
use super::plan::{self, Pilot, TaskPlan, length};
use super::run::Entry;
use super::shard::Reader;
use super::study::Study;
use super::worker::{Done, set_damaged_aside, work};
use crate::progress;
use indicatif::ProgressBar;
use miette::{Context, IntoDiagnostic};
use rayon::prelude::*;
use runs::job::Unfinished;
use runs::print::{answer_json, quoted};
use runs::say;
use serde::Serialize;
use serde_json::{Value, json};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Periods between two looks into the folder: a hundredth of the time that has passed, within these bounds.
const LOOK_S: [f64; 2] = [0.5, 10.0];
/// Period of the queries whether the engine is still at work: schedulers limit them.
const ASK: Duration = Duration::from_secs(5);
/// How often what an engine left undone is handed over again, where something came of the last time, or of the one before.
const ROUNDS: u32 = 4;

/// How to submit: the options of `muprime submit`.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct Options {
    /// local, slurm, hq or dask
    #[arg(long, default_value = "local")]
    pub engine: String,
    /// Cases at one time (local: all cores; else as many as the engine gives)
    #[arg(long, value_name = "N")]
    pub workers: Option<u64>,
    /// Time limit of one task, as in 30:00 or 2:00:00 (from a pilot if left out)
    #[arg(long = "time", id = "time", value_name = "TIME", value_parser = seconds_of)]
    pub limit_s: Option<f64>,
    /// Seconds that a task is meant to take
    #[arg(long, default_value_t = 300.0, value_name = "S")]
    pub task_s: f64,
    /// Cases of the pilot, which is run here for 20 s at most
    #[arg(long, default_value_t = 8, value_name = "N")]
    pub pilot: usize,
    /// Seconds of a case, where they are known: no pilot is run
    #[arg(long, value_name = "S")]
    pub case_s: Option<f64>,
    /// Do not wait for the end
    #[arg(long)]
    pub detach: bool,
    /// hq: folder of its server; dask: address of its scheduler
    #[arg(long)]
    pub server: Option<String>,
    /// Python that has the package hyperqueue or distributed
    #[arg(long, default_value = "python3")]
    pub python: String,
    /// slurm: cores of a task, each with a range of its own
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=4096))]
    pub cores_a_task: u64,
    /// slurm: tasks that wait or run at one time at most
    #[arg(long, value_name = "N", default_value_t = 1000, value_parser = clap::value_parser!(u64).range(1..))]
    pub window: u64,
    /// Passed on to sbatch (may be repeated), as in --option=--partition=short
    #[arg(long = "option", value_name = "OPTION", allow_hyphen_values = true)]
    pub options: Vec<String>,
}

impl Options {
    /// On so many cores of this machine, without a pilot; a shard takes some seconds.
    pub fn local(workers: usize) -> Options {
        Options {
            engine: "local".into(),
            workers: Some(workers as u64),
            task_s: 4.0,
            case_s: Some(0.5),
            cores_a_task: 1,
            window: 1,
            ..Options::default()
        }
    }
}

/// Seconds of MM, MM:SS, H:MM:SS or D-HH:MM:SS, as Slurm writes them.
fn seconds_of(text: &str) -> Result<f64, String> {
    let wrong = || "MM:SS, H:MM:SS or D-HH:MM:SS".to_string();
    let (days, rest) = text.split_once('-').unwrap_or(("0", text));
    let parts: Result<Vec<u64>, _> = std::iter::once(days).chain(rest.split(':')).map(str::parse).collect();
    let seconds = match parts.map_err(|_| wrong())?[..] {
        [0, m] => 60 * m,
        [0, m, s] => 60 * m + s,
        [d, h, m, s] => 86400 * d + 3600 * h + 60 * m + s,
        _ => return Err(wrong()),
    };
    if seconds == 0 { Err(wrong()) } else { Ok(seconds as f64) }
}

/// What a submission came to.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Submitted {
    /// Folder of the study.
    pub out: PathBuf,
    /// Engine.
    pub engine: String,
    /// Cases of the study.
    pub cases: u64,
    /// Cases that had a result before.
    pub there: u64,
    /// Cases without a result now.
    pub missing: u64,
    /// Those of the others that failed, as [`failed`] counts them.
    pub failed: u64,
    /// What the pilot measured.
    pub pilot: Option<Pilot>,
    /// Tasks handed over, in all rounds.
    pub tasks: usize,
    /// Cases of a task.
    pub cases_a_task: u64,
    /// Time limit of a task, s.
    pub limit_s: f64,
    /// The engine's names of the jobs.
    pub ids: Vec<String>,
    /// Time from beginning to end, s.
    pub wall_seconds: f64,
}

/// Submits what is missing of a study.
///
/// # Errors
/// An engine that takes nothing; on this machine whatever the worker says.
pub fn submit(study: &Study, options: &Options) -> miette::Result<Submitted> {
    let begun = Instant::now();
    let engine = checked(options)?;
    let cases = study.file.header.cases;
    set_damaged_aside(study, &(0..cases))?;
    let missing = || Ok::<_, miette::Report>(holes(&study.ranges_there()?, cases));
    let first = length(&missing()?);
    let bar = progress::bar(cases, "cases");
    bar.set_position(cases - first);
    let (out, by) = (study.out.display().to_string(), options.engine.clone());
    progress::on_interrupt(&bar, move |done| {
        let ended = by == "local" || by == "dask";
        let goes_on = if ended { "is over" } else { "goes on without this command" };
        say!("{done} of {cases} cases are in {out}; what was at work {goes_on}");
        let end = format!("; `muprime submit --cancel --out {}` ends what runs", quoted(&out));
        say!("the same command goes on from there{}", if ended { "" } else { &end });
        if progress::JSON.load(Ordering::Relaxed) {
            answer_json(&json!({ "partial": true, "out": out, "cases": cases, "done": done }));
        }
    })?;
    let mut submitted = Submitted {
        out: study.out.clone(),
        engine: options.engine.clone(),
        cases,
        there: cases - first,
        missing: first,
        ..Submitted::default()
    };
    for (folder, job) in at_work(&study.out)? {
        match engine.filter(|engine| engine.name == job.engine) {
            Some(engine) => {
                // The folder says which job it is; programs and their options come from the command line.
                let (server, python) = (options.server.clone(), options.python.clone());
                let job = ClusterJob { server, python, command: Vec::new(), options: Vec::new(), ..job };
                let Ok(handed) = (engine.again)(&folder, &job) else { continue };
                follow(study, engine, &folder, &job, handed, &bar)?;
            }
            None => say!("{}: handed to another engine; --engine says which one to follow", folder.display()),
        }
    }
    let (mut before, mut in_vain) = (u64::MAX, 0);
    for round in 0..ROUNDS {
        let holes = missing()?;
        submitted.missing = length(&holes);
        in_vain += u32::from(submitted.missing >= before);
        if holes.is_empty() || in_vain > 1 {
            break;
        }
        before = submitted.missing;
        if submitted.pilot.is_none() {
            submitted.pilot = Some(pilot(study, &holes, options)?);
        }
        let Some(pilot) = submitted.pilot else { break };
        let plan = cut(&holes, &pilot, options);
        let tasks = plan.ranges.len().div_ceil(options.cores_a_task as usize);
        submitted.tasks += tasks;
        (submitted.cases_a_task, submitted.limit_s) = (plan.cases_a_task, plan.limit_s);
        match engine {
            None => here(study, &plan, options.workers.unwrap_or_else(cores), &bar)?,
            Some(engine) => {
                let memory_bytes = pilot.memory_bytes(options.cores_a_task, round);
                let (folder, job, handed) = hand_over(study, engine, &plan, memory_bytes, options)?;
                if options.detach {
                    submitted.ids.extend(handed.ids);
                    let accepted = handed.tasks as usize;
                    if accepted < tasks {
                        say!("{accepted} of {tasks} tasks are accepted: repeat the command for the others");
                    }
                    break;
                }
                submitted.ids.extend(follow(study, engine, &folder, &job, handed, &bar)?);
            }
        }
        submitted.missing = length(&missing()?);
    }
    bar.finish_and_clear();
    submitted.wall_seconds = begun.elapsed().as_secs_f64();
    Ok(submitted)
}

/// Cases of a study that failed. Errors: a folder that cannot be read; a shard that cannot is for [`gather`].
pub fn failed(study: &Study) -> miette::Result<u64> {
    let (mut failed, mut next) = (0, 0);
    for range in study.ranges_there()? {
        let entries = Reader::open(study.kind, &study.shard(&range)).into_iter().flatten().flatten();
        failed += entries.filter(|entry| entry.index >= next && entry.outcome.is_err()).count() as u64;
        next = range.end.max(next);
    }
    Ok(failed)
}

/// Cases of one name in a folder, run where they have no result, and read: `NAME.jsonl` are the cases,
/// `NAME/` is the study, `NAME.parquet` its table.
///
/// # Errors
/// A folder that holds other cases of that name, cases that are left without a result, whatever [`submit`] says.
pub fn whole(
    out: &Path,
    name: &str,
    header: Header,
    lines: Option<&[Value]>,
    options: &Options,
) -> miette::Result<Vec<Entry>> {
    let cases = out.join(format!("{name}.jsonl"));
    file::write(&cases, header, lines)?;
    let study = Study::begin(&cases, &out.join(name))?;
    let submitted = submit(&study, options)?;
    if submitted.missing > 0 {
        miette::bail!("{name}: {} cases have no result; the same command goes on", submitted.missing);
    }
    let table = out.join(format!("{name}.parquet"));
    gather(&study, &table, false)?;
    Reader::open(study.kind, &table)?.collect()
}

/// Refuses options that no engine or not this one has, before a folder is made; gives the engine, none for
/// this machine.
///
/// # Errors
/// Whatever is wrong with the options.
pub fn checked(options: &Options) -> miette::Result<Option<&'static engines::Engine>> {
    for (name, value) in [("task-s", Some(options.task_s)), ("case-s", options.case_s)] {
        if let Some(value) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
            miette::bail!("--{name} {value}: above 0");
        }
    }
    if options.workers == Some(0) {
        miette::bail!("--workers 0: at least one is needed");
    }
    if options.cores_a_task > 1 && options.engine != "slurm" {
        miette::bail!("--cores-a-task is for slurm: the other engines share a node among tasks of one core");
    }
    if options.engine == "dask" && (options.server.is_none() || options.detach) {
        miette::bail!(
            "--engine dask needs --server, the address of its scheduler, and cannot be detached from: it drops what waits when its client leaves"
        );
    }
    engines::by_name(&options.engine)
}

/// Cores of this machine.
fn cores() -> u64 {
    std::thread::available_parallelism().map_or(1, |n| n.get() as u64)
}

/// How long a case takes: as the user states, or measured.
fn pilot(study: &Study, holes: &[Range<u64>], options: &Options) -> miette::Result<Pilot> {
    match options.case_s {
        Some(mean_s) => Ok(Pilot { cases: 0, mean_s, longest_s: mean_s, peak_bytes: None }),
        None => plan::measure(study, holes, options.pilot, Duration::from_secs(20)),
    }
}

/// The ranges of what is missing.
fn cut(holes: &[Range<u64>], pilot: &Pilot, options: &Options) -> TaskPlan {
    plan::cut(holes, pilot, options.workers.unwrap_or_else(cores), options.task_s, options.limit_s)
}

/// What is missing of a study as tasks for any engine, `muprime.study_plan/1`; nothing is handed over.
///
/// # Errors
/// A case that cannot be made, a folder that cannot be read.
pub fn tasks(study: &Study, options: &Options) -> miette::Result<Value> {
    let cases = study.file.header.cases;
    set_damaged_aside(study, &(0..cases))?;
    let (holes, command) = (holes(&study.ranges_there()?, cases), command(study)?);
    let pilot = if holes.is_empty() { None } else { Some(pilot(study, &holes, options)?) };
    let task = |pilot: &Pilot, range: &Range<u64>, limit_s: f64| {
        let argv = [&command[..], &["--range".into(), format!("{}..{}", range.start, range.end)]].concat();
        let expected_s = (range.end - range.start) as f64 * pilot.mean_s;
        let (range, memory_bytes) = ([range.start, range.end], pilot.memory_bytes(1, 0));
        json!({ "range": range, "argv": argv, "expected_s": expected_s, "limit_s": limit_s, "memory_bytes": memory_bytes })
    };
    let tasks: Vec<Value> = pilot.map_or_else(Vec::new, |pilot| {
        let plan = cut(&holes, &pilot, options);
        plan.ranges.iter().map(|range| task(&pilot, range, plan.limit_s)).collect()
    });
    let missing = length(&holes);
    let schema = "muprime.study_plan/1";
    let mut plan =
        json!({ "schema": schema, "out": study.out, "cases": cases, "missing": missing, "pilot": pilot });
    plan["tasks"] = tasks.into();
    Ok(plan)
}

/// The worker's command but for its cases.
fn command(study: &Study) -> miette::Result<Vec<String>> {
    let exe = std::env::current_exe().into_diagnostic()?;
    let (cases, out) = (study.file.path.display().to_string(), study.out.display().to_string());
    let words = ["case", "--cases", &cases, "--out", &out, "--threads", "1"].map(String::from);
    Ok(std::iter::once(exe.display().to_string()).chain(words).collect())
}

/// Runs a plan on this machine: the same worker, on the threads of a pool. A case that cannot be made leaves
/// its range undone and the others not; a disk that is full ends it.
fn here(study: &Study, plan: &TaskPlan, threads: u64, bar: &ProgressBar) -> miette::Result<()> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads as usize).build().into_diagnostic()?;
    let program = runs::version::program_sha256().into_diagnostic()?;
    let first = Mutex::new(None);
    pool.install(|| {
        plan.ranges.par_iter().try_for_each(|range| match work(study, range.clone(), &program, None) {
            Ok(Done::There | Done::Made { .. } | Done::Cancelled) => {
                bar.inc(range.end - range.start);
                Ok(())
            }
            Err(why) if why.downcast_ref::<Unfinished>().is_some() => Err(why),
            Err(why) => {
                bar.suspend(|| say!("cases {}..{}: {why:?}", range.start, range.end));
                first.lock().unwrap_or_else(std::sync::PoisonError::into_inner).get_or_insert(why);
                Ok(())
            }
        })
    })?;
    first.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Makes a job's folder and hands its tasks over.
fn hand_over(
    study: &Study,
    engine: &Engine,
    plan: &TaskPlan,
    memory_bytes: Option<u64>,
    options: &Options,
) -> miette::Result<(PathBuf, ClusterJob, Accepted)> {
    let folder = new_folder(&study.out.join("jobs"))?;
    let mut command = command(study)?;
    command.extend(["--job".into(), folder.display().to_string()]);
    let mut job = ClusterJob {
        engine: engine.name.into(),
        ids: Vec::new(),
        kind: study.kind.name.into(),
        command,
        ranges: plan.ranges.clone(),
        cores_a_task: options.cores_a_task,
        // Nobody is there later to hand over the rest.
        window: if options.detach { u64::MAX } else { options.window },
        memory_bytes,
        limit_s: plan.limit_s,
        workers: options.workers,
        server: options.server.clone(),
        python: options.python.clone(),
        options: options.options.clone(),
    };
    job.write(&folder)?;
    let handed = match (engine.submit)(&folder, &job) {
        Ok(handed) => handed,
        Err(why) => {
            // Arrays that were accepted before the refusal go on: the next call follows them.
            if ClusterJob::read(&folder).is_ok_and(|job| job.ids.is_empty()) {
                runs::files::write_plain(&folder.join("ended"), "")?;
            }
            return Err(why);
        }
    };
    job.ids.clone_from(&handed.ids);
    job.write(&folder)?;
    Ok((folder, job, handed))
}

/// A folder of a new job, which nobody else has made.
fn new_folder(jobs: &Path) -> miette::Result<PathBuf> {
    runs::files::make_folder(jobs)?;
    let wrong = || format!("cannot make a folder in {}", jobs.display());
    if jobs.symlink_metadata().into_diagnostic()?.is_symlink() {
        miette::bail!("{} is a link", jobs.display());
    }
    let mut number = 1;
    loop {
        let folder = jobs.join(format!("{number:04}"));
        match std::fs::create_dir(&folder) {
            Ok(()) => {
                runs::files::sync_folder_of(&folder).into_diagnostic().wrap_err_with(wrong)?;
                return Ok(folder);
            }
            Err(why) if why.kind() == std::io::ErrorKind::AlreadyExists => number += 1,
            Err(why) => return Err(why).into_diagnostic().wrap_err_with(wrong),
        }
    }
}

/// Looks at the folder until nothing is missing or the engine has nothing left to run; returns its names.
fn follow(
    study: &Study,
    engine: &Engine,
    folder: &Path,
    job: &ClusterJob,
    mut handed: Accepted,
    bar: &ProgressBar,
) -> miette::Result<Vec<String>> {
    let (cases, begun, mut last_query) = (study.file.header.cases, Instant::now(), Instant::now());
    let mut over = false;
    loop {
        let missing = length(&holes(&study.ranges_there()?, cases));
        bar.set_position(cases - missing);
        if missing == 0 || over {
            break;
        }
        let pause_s = (0.01 * begun.elapsed().as_secs_f64()).clamp(LOOK_S[0], LOOK_S[1]);
        std::thread::sleep(Duration::from_secs_f64(pause_s));
        if last_query.elapsed() >= ASK || handed.child.is_some() {
            // What ended a moment ago may not be seen in the folder yet: it is looked at once more.
            over = !(engine.alive)(folder, job, &mut handed)?;
            last_query = Instant::now();
        }
    }
    if let Some(child) = &mut handed.child {
        let _ = child.wait();
    }
    runs::files::write_plain(&folder.join("ended"), "")?;
    Ok(handed.ids)
}

/// Jobs that nobody has seen the end of.
fn at_work(out: &Path) -> miette::Result<Vec<(PathBuf, ClusterJob)>> {
    let open = |f: &PathBuf| !f.join("ended").exists() && !f.join("cancelled").exists();
    engines::folders(out)?
        .into_iter()
        .filter(open)
        .map(|f| ClusterJob::read(&f).map(|job| (f, job)))
        .collect()
}

/// Cancels the jobs of a folder that have not ended. Returns the engine's names of them.
///
/// # Errors
/// An engine that does not answer.
pub fn cancel(out: &Path) -> miette::Result<Vec<String>> {
    let mut ids = Vec::new();
    for (folder, job) in at_work(out)? {
        // First the word for the workers, then the engine: a task that starts between sees it.
        runs::files::write_plain(&folder.join("cancelled"), "")?;
        if let Some(engine) = engines::by_name(&job.engine)? {
            (engine.cancel)(&job).wrap_err_with(|| folder.display().to_string())?;
        }
        ids.extend(job.ids);
    }
    Ok(ids)
}

#[cfg(test)]
mod tests {
    use super::seconds_of;

    #[test]
    fn times_are_read_as_slurm_writes_them() {
        assert_eq!(seconds_of("5"), Ok(300.0));
        assert_eq!(seconds_of("1:30"), Ok(90.0));
        assert_eq!(seconds_of("2:00:01"), Ok(7201.0));
        assert_eq!(seconds_of("1-00:00:00"), Ok(86400.0));
        for bad in ["", "0", "x", "1-5", "1:2:3:4", "-5"] {
            assert!(seconds_of(bad).is_err(), "{bad}");
        }
    }
}
