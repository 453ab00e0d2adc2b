//! The share of one task where an engine counts its tasks and knows nothing of cases: Slurm, PBS, Kubernetes,
//! Snakemake, Nextflow. It is contiguous and follows from the number of cases, the task and the number of
//! tasks alone. So a task that an engine starts again, on whatever machine, has the same cases.

use super::gather::holes;
use super::plan::{MOST, pieces};
use super::study::Study;
use miette::{bail, miette};
use std::ops::Range;

/// One task of several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Share {
    /// Which, from 0.
    pub task: u64,
    /// How many there are.
    pub of: u64,
}

/// Variables in which engines number a task: Slurm, PBS Professional, Torque, Kubernetes.
const NUMBERS: [&str; 4] = ["SLURM_ARRAY_TASK_ID", "PBS_ARRAY_INDEX", "PBS_ARRAYID", "JOB_COMPLETION_INDEX"];

impl Share {
    /// A task of several.
    ///
    /// # Errors
    /// A task beyond the last one.
    pub fn new(task: u64, of: u64) -> miette::Result<Share> {
        if task >= of {
            let help = "tasks count from 0: an array of 8 is 0-7, with --of 8";
            bail!(help = help, "task {task} of {of}: there is no such task");
        }
        Ok(Share { task, of })
    }

    /// The task that an engine's environment names. With `of` its number is the task. Without it only Slurm
    /// states how many there are (`SLURM_ARRAY_TASK_COUNT`), counted from `SLURM_ARRAY_TASK_MIN`.
    ///
    /// # Errors
    /// No number, two that differ, one that is no number; an array with gaps; an engine that states no count.
    pub fn from_environment(of: Option<u64>, get: &dyn Fn(&str) -> Option<String>) -> miette::Result<Share> {
        let number = |name: &str| {
            let parsed = |text: String| {
                text.trim().parse::<u64>().map_err(|_| miette!("{name} is '{text}', which is not a number"))
            };
            get(name).map(parsed).transpose()
        };
        let mut found: Option<(&str, u64)> = None;
        for name in NUMBERS {
            match (found, number(name)?) {
                (Some((other, first)), Some(task)) if first != task => bail!(
                    help = "say which task this is: --task I --of N",
                    "{other} is {first} and {name} is {task}: they contradict each other"
                ),
                (None, Some(task)) => found = Some((name, task)),
                _ => {}
            }
        }
        let (name, task) = found.ok_or_else(|| {
            let help = "give --range FIRST..END, --index N or --task I --of N";
            miette!(help = help, "no cases are named, and none of {} is set", NUMBERS.join(", "))
        })?;
        if let Some(of) = of {
            return Share::new(task, of);
        }
        let (least, most) = (number("SLURM_ARRAY_TASK_MIN")?, number("SLURM_ARRAY_TASK_MAX")?);
        let (Some(least), Some(most), Some(count)) = (least, most, number("SLURM_ARRAY_TASK_COUNT")?) else {
            let help = "give the number of tasks: --of N";
            bail!(help = help, "{name} is {task}, and nothing states of how many tasks");
        };
        let step = number("SLURM_ARRAY_TASK_STEP")?.unwrap_or(1).max(1);
        let past = task.wrapping_sub(least);
        if task < least
            || past % step != 0
            || most.checked_sub(least).map(|last| last / step + 1) != Some(count)
        {
            bail!(
                help = "to repeat single tasks of an array 0-7, give --of 8: SLURM_ARRAY_TASK_ID is then the task",
                "task {task} of {count} from {least} to {most} in steps of {step}: the array has gaps"
            );
        }
        Share::new(past / step, count)
    }

    /// Its part of `cases`: sizes differ by at most one, and all shares together are all cases.
    pub fn part(&self, cases: u64) -> Range<u64> {
        let upto = |task: u64| (u128::from(cases) * u128::from(task) / u128::from(self.of)) as u64;
        upto(self.task)..upto(self.task + 1)
    }

    /// What of its part has no result yet, in ranges of which each becomes a shard.
    ///
    /// # Errors
    /// A folder that cannot be read; a shard of other cases.
    pub fn missing(&self, study: &Study) -> miette::Result<Vec<Range<u64>>> {
        let part = self.part(study.file.header.cases);
        super::worker::set_damaged_aside(study, &part)?;
        let within = |hole: Range<u64>| hole.start.max(part.start)..hole.end.min(part.end);
        let holes = holes(&study.ranges_there()?, study.file.header.cases).into_iter().map(within);
        Ok(holes.filter(|hole| !hole.is_empty()).flat_map(|hole| pieces(&hole, MOST)).collect())
    }
}
