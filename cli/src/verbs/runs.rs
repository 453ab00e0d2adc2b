//! `muprime runs`: the runs of a folder, and their tags and notes.

use super::prelude::*;
use runs::catalogue::{Annotations, RunEntry, SortBy, existing, runs_folder, sort};
use runs::print::folded;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of one run, to tag it or to write its note; without it all runs are listed
    run: Option<PathBuf>,
    /// Folder of the runs [default: $MUPRIME_RUNS or ./runs]
    #[arg(long, conflicts_with = "run")]
    folder: Option<PathBuf>,
    /// Only runs whose plan's name contains this
    #[arg(long, conflicts_with = "run")]
    plan: Option<String>,
    /// Only runs that did not end by themselves
    #[arg(long, conflicts_with = "run")]
    unfinished: bool,
    /// Only runs whose texts contain each of these words: operator, sample, tip, tags, note and the rest
    #[arg(long, value_name = "WORDS", conflicts_with = "run")]
    find: Option<String>,
    /// Column to sort by
    #[arg(long, value_name = "COLUMN", default_value = "started", conflicts_with = "run")]
    sort: SortBy,
    /// Tag to add to the run (may be repeated)
    #[arg(long, value_name = "TAG", requires = "run")]
    tag: Vec<String>,
    /// Tag to take off the run (may be repeated)
    #[arg(long, value_name = "TAG", requires = "run")]
    untag: Vec<String>,
    /// Note of the run, in place of the one before
    #[arg(long, value_name = "TEXT", requires = "run")]
    note: Option<String>,
}

/// Lists, or annotates one run; refused: a folder that holds no run, or cannot be read; tags or a note that
/// are too long.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if let Some(run) = &args.run {
        let annotations = annotate(run, &args)?;
        let tags = if annotations.tags.is_empty() { "none".into() } else { annotations.tags.join(", ") };
        let note = if annotations.note.is_empty() { "none" } else { &annotations.note };
        return answered(json, &annotations, format!("tags: {tags}\nnote: {note}"));
    }
    let folder = args.folder.unwrap_or_else(runs_folder);
    let mut runs = existing(&folder)?;
    runs.retain(|r| args.plan.as_ref().is_none_or(|p| r.plan.contains(p.as_str())));
    runs.retain(|r| !args.unfinished || r.outcome != "complete");
    runs.retain(|r| args.find.as_ref().is_none_or(|words| r.has(words)));
    sort(&mut runs, args.sort);
    if json {
        answer_json(&runs);
        return exit(DONE);
    }
    for r in runs {
        out!("{:40} {:>5}/{:<5} {}", r.folder, r.passes, r.planned, r.outcome_words());
        out!("{}", folded(&format!("  {}", details(&r)), 4));
    }
    exit(DONE)
}

/// The tags and the note after the changes; written only where there are any.
fn annotate(run: &Path, args: &Args) -> miette::Result<Annotations> {
    super::must_exist(run, "run")?;
    let before = Annotations::read(run)?;
    let mut after = before.clone();
    after.tags.extend(args.tag.iter().cloned());
    after.tags.retain(|tag| !args.untag.contains(tag));
    after.note = args.note.clone().unwrap_or(after.note);
    let after = after.checked()?;
    if after != before {
        after.clone().write(run)?;
    }
    Ok(after)
}

/// What is known of a run, in one line; what is not known is left out.
fn details(r: &RunEntry) -> String {
    let named = |name: &str, value: Option<String>| {
        value.filter(|value| !value.is_empty()).map(|value| format!("{name} {value}"))
    };
    let known = [
        r.operator.clone(),
        r.sample.clone(),
        named("tip", r.tip.clone()),
        named("setup", Some(r.setup.clone())),
        named("model", Some(r.model.clone())),
        named("seed", r.seed.map(|seed| seed.to_string())),
        named("mu_0", r.mu0.map(|mu0| format!("{mu0:.3}"))),
        named("tags:", Some(r.tags.join(", "))),
        named("note:", Some(r.note.lines().next().unwrap_or_default().into())),
        r.verdict.clone(),
    ];
    known.into_iter().flatten().collect::<Vec<_>>().join("; ")
}
