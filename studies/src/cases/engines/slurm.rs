//! Slurm: array jobs by `sbatch`. A task that a node's failure ends is queued again by Slurm (`--requeue`).
//!
//! Arrays are handed over one after another, so that no more than a window of tasks waits. Where a limit of
//! the site refuses one, what runs goes on and the rest is tried again later, in smaller arrays.
#![allow(clippy::disallowed_methods, reason = "a refused submission is repeated in wall-clock time")]

use super::{Accepted, ClusterJob, Engine, numbers};
use miette::{Context, IntoDiagnostic, miette};
use runs::print::quoted;
use runs::say;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// The engine.
pub const ENGINE: Engine = Engine { name: "slurm", submit, again, alive, cancel };

/// Tasks of an array: Slurm's own limit (`MaxArraySize`) is 1001 where nobody raised it.
const ARRAY: u64 = 1000;
/// First pause after a refusal; each further one doubles it.
const PAUSE: Duration = Duration::from_secs(2);
/// The longest pause.
const LONGEST_PAUSE: Duration = Duration::from_secs(300);
/// Refusals in a row, while no task waits or runs, after which it is given up: a quarter of an hour.
const REFUSALS: u32 = 10;
/// Words of refusals that pass by themselves, in the messages of Slurm 17 to 25: limits of submission, a
/// controller that is busy or away, an array above `MaxArraySize`.
const PASSING: [&str; 7] = [
    "submit limit",
    "SubmitJob",
    "temporarily",
    "timed out",
    "Unable to contact",
    "Zero Bytes",
    "Invalid job array specification",
];

/// The batch script: `ranges.txt` has the ranges of a task in as many lines as the task has cores. They run
/// side by side. A task that succeeds removes its log.
fn script(folder: &Path, job: &ClusterJob) -> String {
    let command: Vec<String> = job.command.iter().map(quoted).collect();
    format!(
        "#!/bin/sh\n\
         # Runs a task's ranges of cases; handed to sbatch with --array and, for each array, --export=MUPRIME_FIRST=N.\n\
         last=$(((SLURM_ARRAY_TASK_ID + MUPRIME_FIRST + 1) * {cores}))\n\
         workers= status=0\n\
         for range in $(sed -n \"$((last - {cores} + 1)),${{last}}p\" {ranges}); do\n\
         \x20   {command} --range \"$range\" &\n\
         \x20   workers=\"$workers $!\"\n\
         done\n\
         for worker in $workers; do wait \"$worker\" || status=1; done\n\
         [ $status != 0 ] || rm -f {logs}/\"${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID.txt\"\n\
         exit $status\n",
        cores = job.cores_a_task,
        ranges = quoted(folder.join("ranges.txt").display()),
        command = command.join(" "),
        logs = quoted(folder.join("logs").display()),
    )
}

fn time(seconds: f64) -> String {
    let s = seconds.ceil() as u64;
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

fn ran(command: &mut Command) -> miette::Result<Output> {
    let name = command.get_program().to_string_lossy().into_owned();
    command.output().into_diagnostic().wrap_err_with(|| format!("{name} cannot be run: is Slurm here?"))
}

fn submit(folder: &Path, job: &ClusterJob) -> miette::Result<Accepted> {
    let lines: String = job.ranges.iter().map(|r| format!("{}..{}\n", r.start, r.end)).collect();
    runs::files::write_plain(&folder.join("ranges.txt"), lines)?;
    runs::files::write_plain(&folder.join("task.sh"), script(folder, job))?;
    runs::files::make_folder(&folder.join("logs"))?;
    let mut handed = Accepted { array: array_of(job), ..Accepted::of(job) };
    more(folder, job, &mut handed, 0)?;
    Ok(handed)
}

/// Tasks of an array: half a window, so that one array waits while another runs.
fn array_of(job: &ClusterJob) -> u64 {
    (job.window / 2).clamp(1, ARRAY)
}

/// Hands arrays over while the window has room beside what is `queued` and the site takes them; fails at a
/// refusal that does not pass by itself, or one that lasts.
fn more(folder: &Path, job: &ClusterJob, handed: &mut Accepted, mut queued: u64) -> miette::Result<()> {
    let tasks = (job.ranges.len() as u64).div_ceil(job.cores_a_task);
    while handed.tasks < tasks && handed.pause_until.is_none_or(|until| Instant::now() >= until) {
        let count = handed.array.min(tasks - handed.tasks);
        // Slurm bounds how many run of one array only: with a bound, one array at a time.
        let bounded = job.workers.is_some() && job.window < u64::MAX;
        if queued > 0 && (bounded || queued.saturating_add(count) > job.window) {
            break;
        }
        let output = ran(&mut array(folder, job, handed.tasks, count))?;
        if output.status.success() {
            let stdout = String::from_utf8_lossy(&output.stdout);
            handed.ids.push(stdout.trim().split(';').next().unwrap_or_default().to_string());
            numbers(&handed.ids)?;
            (handed.tasks, handed.refusals, handed.pause_until) = (handed.tasks + count, 0, None);
            handed.array = array_of(job).min(2 * handed.array);
            queued += count;
            ClusterJob { ids: handed.ids.clone(), ..job.clone() }.write(folder)?;
            continue;
        }
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        let why = stderr.split_whitespace().collect::<Vec<_>>().join(" ");
        handed.refusals += 1;
        let refuses =
            format!("sbatch refuses {count} tasks, with {} of {tasks} accepted: {why}", handed.tasks);
        if !PASSING.iter().any(|words| why.contains(words)) || (queued == 0 && handed.refusals > REFUSALS) {
            let help = "tasks that were accepted go on; repeat the command for the others";
            return Err(miette!(help = help, "{refuses}"));
        }
        handed.array = (count / 2).max(1);
        let pause = LONGEST_PAUSE.min(PAUSE * 2_u32.pow(handed.refusals.min(20) - 1));
        handed.pause_until = Some(Instant::now() + pause);
        say!("{refuses}; pause of {} s", pause.as_secs());
    }
    Ok(())
}

/// The command that hands over `count` tasks from `first` on. The user's options come last, so that they
/// count.
fn array(folder: &Path, job: &ClusterJob, first: u64, count: u64) -> Command {
    let at_once = job.workers.map(|n| format!("%{}", (n / job.cores_a_task).max(1))).unwrap_or_default();
    let mut command = Command::new("sbatch");
    command
        .args(["--parsable", "--requeue", "--open-mode=append", "--ntasks=1"])
        .arg(format!("--cpus-per-task={}", job.cores_a_task))
        .arg(format!("--job-name=muprime-{}", job.kind))
        .arg(format!("--array=0-{}{at_once}", count - 1))
        .arg(format!("--time={}", time(job.limit_s)))
        .arg(format!("--chdir={}", folder.display()))
        .arg(format!("--output={}", folder.join("logs/%A_%a.txt").display()))
        .arg(format!("--export=ALL,MUPRIME_FIRST={first}"));
    if let Some(bytes) = job.memory_bytes.filter(|_| !job.options.iter().any(|o| o.starts_with("--mem"))) {
        command.arg(format!("--mem={}M", bytes.div_ceil(1 << 20)));
    }
    command.args(&job.options).arg(folder.join("task.sh"));
    command
}

fn again(_: &Path, job: &ClusterJob) -> miette::Result<Accepted> {
    numbers(&job.ids)?;
    // Programs come from the command line alone: what was not handed over then follows after this job.
    Ok(Accepted { tasks: job.ranges.len() as u64, ..Accepted::of(job) })
}

/// A controller that does not answer says nothing about its jobs: they may go on. Tasks that Slurm holds (it
/// does so where it could not start them, as after a controller that died) never start by themselves: where
/// nothing else is left they are taken back, and what is missing is handed over again.
fn alive(folder: &Path, job: &ClusterJob, handed: &mut Accepted) -> miette::Result<bool> {
    let mut queued = 0;
    if !handed.ids.is_empty() {
        let mut query = Command::new("squeue");
        query.args(["--noheader", "--array", "--format=%t %r", "--jobs"]).arg(handed.ids.join(","));
        match query.output() {
            Ok(output) if output.status.success() => {
                let listed = String::from_utf8_lossy(&output.stdout).into_owned();
                let held = |line: &str| {
                    line.starts_with("PD") && (line.contains("JobHeld") || line.contains("held"))
                };
                queued = listed.lines().count() as u64;
                if queued > 0 && listed.lines().all(held) {
                    let _ = Command::new("scancel").args(&handed.ids).output();
                    return Ok(false);
                }
            }
            Ok(output) if String::from_utf8_lossy(&output.stderr).contains("Invalid job id") => {}
            Ok(_) | Err(_) => return Ok(true),
        }
    }
    let before = handed.tasks;
    more(folder, job, handed, queued)?;
    Ok(queued > 0 || handed.tasks > before || handed.tasks * job.cores_a_task < job.ranges.len() as u64)
}

fn cancel(job: &ClusterJob) -> miette::Result<()> {
    if job.ids.is_empty() {
        return Ok(());
    }
    let output = ran(Command::new("scancel").args(numbers(&job.ids)?))?;
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    if output.status.success() || stderr.contains("Invalid job id") {
        return Ok(());
    }
    Err(miette!("scancel: {}", stderr.trim()))
}

#[cfg(test)]
mod tests {
    use super::time;

    #[test]
    fn a_limit_is_rounded_up_as_slurm_reads_it() {
        assert_eq!(time(59.2), "0:01:00");
        assert_eq!(time(3.0 * 86400.0 + 61.0), "72:01:01");
    }
}
