//! `muprime submit`: runs what is missing of a study, here or on an engine.

use super::prelude::*;
use studies::cases::plan::Pilot;
use studies::cases::study::Study;
use studies::cases::submit::{Options, Submitted, cancel, checked, failed, submit, tasks};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The file of cases
    #[arg(required_unless_present = "cancel")]
    cases: Option<PathBuf>,
    /// Folder of the results: shared with the engine's machines
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    options: Options,
    /// Print what is missing as a command a task, for any engine; nothing is handed over
    #[arg(long, conflicts_with_all = ["cancel", "detach"])]
    plan: bool,
    /// End what runs and what waits; results that are there stay
    #[arg(long)]
    cancel: bool,
}

/// Submits, follows, says what is missing; or prints the plan; refused: bad cases, an engine that takes
/// nothing.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if args.cancel {
        let ids = cancel(&args.out)?;
        let words = if ids.is_empty() { "nothing was at work".into() } else { ids.join(", ") };
        return answered(json, &json!({ "cancelled": ids }), format!("cancelled: {words}"));
    }
    let options = &args.options;
    checked(options)?;
    let study = Study::begin(args.cases.as_deref().unwrap_or(&args.out), &args.out)?;
    if args.plan {
        let planned = tasks(&study, options)?;
        if json {
            out!("{planned}");
        }
        for argv in planned["tasks"].as_array().into_iter().flatten().filter(|_| !json) {
            let words = argv["argv"].as_array().into_iter().flatten().filter_map(|word| word.as_str());
            out!("{}", words.map(quoted).collect::<Vec<_>>().join(" "));
        }
        return exit(DONE);
    }
    let mut submitted = submit(&study, options)?;
    submitted.failed = failed(&study)?;
    let whole = submitted.missing == 0 || options.detach;
    let all_failed = submitted.failed == submitted.cases;
    if json {
        answer_json(&submitted);
    } else {
        let Submitted { cases, there, failed, tasks, cases_a_task, limit_s, wall_seconds, .. } = submitted;
        if let Some(Pilot { cases, mean_s, longest_s, .. }) = submitted.pilot {
            say!(
                "pilot: {mean_s:.3} s a case, the longest of {cases} {longest_s:.3} s; \
                 {tasks} tasks of {cases_a_task} cases, {limit_s:.0} s each at most"
            );
        }
        let (out, done) = (submitted.out.display(), cases - submitted.missing);
        out!(
            "{out}: {done} of {cases} cases were run, {there} of them before; {failed} failed; {wall_seconds:.1} s"
        );
        if !whole {
            out!("output of the tasks: {}", submitted.out.join("jobs").display());
        }
    }
    exit(if whole && !all_failed { DONE } else { FAILED })
}
