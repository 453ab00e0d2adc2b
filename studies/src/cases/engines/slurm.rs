//! Slurm: array jobs by `sbatch`. A task that a node's failure ends is queued again by Slurm (`--requeue`).

use super::{Engine, Handed, Job, numbers, quoted};
use miette::{Context, IntoDiagnostic, miette};
use std::path::Path;
use std::process::{Command, Output};

/// The engine.
pub const ENGINE: Engine = Engine { name: "slurm", submit, again, alive, cancel };

/// Tasks of an array: Slurm's own limit (`MaxArraySize`) is 1001 where nobody raised it.
const ARRAY: usize = 1000;

/// The batch script: its task's range stands in a line of `ranges.txt`.
fn script(folder: &Path, job: &Job) -> String {
    let command: Vec<String> = job.command.iter().map(|word| quoted(word)).collect();
    format!(
        "#!/bin/sh\n\
         # Runs one range of cases; handed to sbatch with --array and, for each array, --export=MUPRIME_FIRST=N.\n\
         line=$((SLURM_ARRAY_TASK_ID + MUPRIME_FIRST + 1))\n\
         range=$(sed -n \"${{line}}p\" {})\n\
         exec {} --range \"$range\"\n",
        quoted(&folder.join("ranges.txt").display().to_string()),
        command.join(" ")
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

fn submit(folder: &Path, job: &Job) -> miette::Result<Handed> {
    let lines: String = job.ranges.iter().map(|r| format!("{}..{}\n", r.start, r.end)).collect();
    runs::files::write_plain(&folder.join("ranges.txt"), lines)?;
    let path = folder.join("task.sh");
    runs::files::write_plain(&path, script(folder, job))?;
    let mut ids = Vec::new();
    for first in (0..job.ranges.len()).step_by(ARRAY) {
        let last = ARRAY.min(job.ranges.len() - first) - 1;
        let at_once = job.workers.map(|n| format!("%{n}")).unwrap_or_default();
        let output = ran(Command::new("sbatch")
            .args(["--parsable", "--requeue", "--open-mode=append", "--ntasks=1", "--cpus-per-task=1"])
            .arg(format!("--job-name=muprime-{}", job.kind))
            .arg(format!("--array=0-{last}{at_once}"))
            .arg(format!("--time={}", time(job.limit_s)))
            .arg(format!("--chdir={}", folder.display()))
            .arg(format!("--output={}", folder.join("log.txt").display()))
            .arg(format!("--export=ALL,MUPRIME_FIRST={first}"))
            .args(&job.options)
            .arg(&path))?;
        if !output.status.success() {
            let _ = cancel(&Job { ids, ..job.clone() });
            return Err(miette!("sbatch refuses: {}", String::from_utf8_lossy(&output.stderr).trim()));
        }
        let stdout = String::from_utf8_lossy(&output.stdout);
        ids.push(stdout.trim().split(';').next().unwrap_or_default().to_string());
        numbers(&ids)?;
    }
    Ok(Handed { ids, child: None })
}

fn again(_: &Path, job: &Job) -> miette::Result<Handed> {
    numbers(&job.ids)?;
    Ok(Handed { ids: job.ids.clone(), child: None })
}

/// A controller that does not answer says nothing about its jobs: they may go on. Tasks that Slurm holds (it
/// does so where it could not start them, as after a controller that died) never start by themselves: where
/// nothing else is left they are taken back, and what is missing is handed over again.
fn alive(handed: &mut Handed) -> bool {
    let answer = Command::new("squeue")
        .args(["--noheader", "--format=%t %r", "--jobs"])
        .arg(handed.ids.join(","))
        .output();
    match answer {
        Ok(output) if output.status.success() => {
            let listed = String::from_utf8_lossy(&output.stdout).into_owned();
            let all_held = listed
                .lines()
                .all(|line| line.starts_with("PD") && (line.contains("JobHeld") || line.contains("held")));
            if all_held && !listed.trim().is_empty() {
                let _ = Command::new("scancel").args(&handed.ids).output();
            }
            !all_held
        }
        Ok(output) => !String::from_utf8_lossy(&output.stderr).contains("Invalid job id"),
        Err(_) => true,
    }
}

fn cancel(job: &Job) -> miette::Result<()> {
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
