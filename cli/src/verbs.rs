//! One file a subcommand. CONTRIBUTING.md lists what a new one needs.
#![allow(clippy::disallowed_methods, reason = "people wait in wall-clock time")]

pub mod blind;
pub mod calibrate;
#[cfg(feature = "parquet")]
pub mod case;
#[cfg(feature = "parquet")]
pub mod cases;
pub mod check;
pub mod compare;
pub mod completions;
pub mod dashboard;
pub mod diagnose;
pub mod doc;
pub mod doctor;
pub mod examples;
pub mod export;
pub mod faults;
#[cfg(feature = "parquet")]
pub mod gather;
pub mod groups;
pub mod import;
pub mod init;
pub mod man;
pub mod model;
pub mod quantities;
pub mod recover;
pub mod replay;
pub mod report;
pub mod run;
pub mod runs;
pub mod schema;
pub mod show;
#[cfg(feature = "parquet")]
pub mod submit;
pub mod virtual_rig;
pub mod watch;

/// What nearly every verb needs.
mod prelude {
    pub use super::{DONE, FAILED, REFUSED, answered, exit};
    pub use ::runs::print::{answer_json, quoted};
    pub use ::runs::{out, say};
    pub use miette::{IntoDiagnostic, WrapErr};
    pub use serde_json::json;
    pub use std::path::{Path, PathBuf};
    pub use std::process::ExitCode;
}

use miette::IntoDiagnostic;
use serde::Serialize;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::OnceLock;

/// Done, also when the measurement disagrees with the model or the verdict is unknown.
pub const DONE: u8 = 0;
/// Done, but the answer is a failure: a safety trip ended the run, a check fell short.
pub const FAILED: u8 = 1;
/// Refused: nothing was touched.
pub const REFUSED: u8 = 2;
/// A fault of this program.
pub const INTERNAL: u8 = 3;

/// The status of an error: refused, unless a run had begun.
pub fn status_of(error: &miette::Report) -> u8 {
    use ::runs::job::Unfinished;
    match error.downcast_ref::<Unfinished>() {
        Some(Unfinished::NotSaved | Unfinished::Interrupted | Unfinished::NotOff) => FAILED,
        Some(Unfinished::Internal) => INTERNAL,
        None => REFUSED,
    }
}

/// Name of the file in a run's folder with what its readers did not take.
const UNREAD: &str = "unread.txt";
/// The folder of the run that this process leads.
static RUN: OnceLock<PathBuf> = OnceLock::new();

/// A rig is driven from now on: nobody waits for a reader of standard output or standard error, and what they
/// do not take is written into the run's folder afterwards. Fails where the system gives no thread.
pub fn tell_beside(run: &Path) -> miette::Result<()> {
    let _ = RUN.set(run.into());
    ::runs::print::beside().into_diagnostic()
}

/// Waits a moment for those who read, and keeps what they did not take. A folder that was refused stays as it is.
pub fn keep_unread() {
    let unread = ::runs::print::end();
    if let Some(run) = RUN.get().filter(|run| !unread.is_empty() && ::runs::run_dir::has_begun(run)) {
        let _ = ::runs::files::write_plain(&run.join(UNREAD), unread);
    }
}

/// The setup of that name or path; a refusal says all that is wrong with it, with places and remedies.
pub fn setup(name: &str) -> miette::Result<::runs::setup::Setup> {
    ::runs::setup::Setup::load(name).map_err(|why| tables::check::refusal(why, name, "setup"))
}

/// The plan of that name or path; refused as [`setup`].
pub fn plan(name: &str) -> miette::Result<::runs::plan::Plan> {
    ::runs::plan::Plan::load(name).map_err(|why| tables::check::refusal(why, name, "plan"))
}

/// The defects of a file; refused as [`setup`].
pub fn defects(path: &Path) -> miette::Result<sim::defects::Defects> {
    let text = ::runs::input::text_of(path)?;
    sim::defects::Defects::parse(&text).map_err(|why| {
        tables::check::refusal(miette::Report::msg(why), &path.display().to_string(), "defects file")
    })
}

/// Refuses what a person named and that is not there, and says what is beside it.
pub fn must_exist(path: &Path, what: &str) -> miette::Result<()> {
    const RUN: [&str; 5] = ["points.csv", ::runs::run_dir::JOURNAL, "run.toml", "run-1.mcap", "sessions"];
    if path.is_dir() && what.starts_with("run") && !RUN.iter().any(|name| path.join(name).exists())
        || what == "run" && path.is_file()
        || !path.exists()
    {
        return Err(not_there(path, what));
    }
    Ok(())
}

/// What is there instead of it.
fn not_there(path: &Path, what: &str) -> miette::Report {
    let folder = ::runs::catalogue::runs_folder();
    let beside = std::fs::read_dir(&folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let runs = beside.filter(|path| path.join(::runs::run_dir::JOURNAL).exists());
    let mut runs: Vec<String> = runs.map(|run| run.display().to_string()).collect();
    runs.sort();
    let help = match runs.as_slice() {
        _ if path.is_file() => "a run is a folder: give the one that the file is in".to_string(),
        [] => format!("there are no runs in {}; muprime run makes one", folder.display()),
        all => format!("runs here: {}", all.iter().rev().take(8).cloned().collect::<Vec<_>>().join(", ")),
    };
    miette::miette!(help = help, "there is no {what} at '{}'", path.display())
}

/// An error in words: without the numbers that a system counts its errors by, and without the language's own sentences.
pub fn plain(error: &str) -> String {
    /// A line may have been folded between the words, with the margin of an answer.
    fn gap(text: &str) -> &str {
        text.trim_start_matches(|c: char| c.is_whitespace() || c == '│')
    }
    const SENTENCES: [(&str, &str); 4] = [
        ("invalid digit found in string", "a whole number, 0 or more, is expected"),
        ("cannot parse integer from empty string", "a whole number, 0 or more, is expected"),
        ("number too large to fit in target type", "the number is too large"),
        ("invalid float literal", "a number is expected"),
    ];
    let error = SENTENCES.iter().fold(error.to_string(), |text, (from, to)| text.replace(from, to));
    let mut rest = error.as_str();
    let mut text = String::new();
    while let Some((before, after)) = rest.split_once("(os") {
        let number = gap(after).strip_prefix("error").map(gap);
        let behind =
            number.and_then(|n| n.trim_start_matches(|c: char| c.is_ascii_digit()).strip_prefix(')'));
        text.push_str(if behind.is_some() { before.trim_end_matches([' ', '\n', '│']) } else { before });
        rest = behind.unwrap_or_else(|| {
            text.push_str("(os");
            after
        });
    }
    text + rest
}

/// The answer of a verb that is done: the document with `--json`, else words for a person.
pub fn answered(json: bool, document: &impl Serialize, words: impl Display) -> miette::Result<ExitCode> {
    match json {
        true => ::runs::print::answer_json(document),
        false => ::runs::out!("{words}"),
    }
    exit(DONE)
}

/// A status as the process's exit code.
pub fn exit(status: u8) -> miette::Result<ExitCode> {
    Ok(ExitCode::from(status))
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::runs::job::Unfinished;

    #[test]
    fn numbers_of_the_system_are_left_out() {
        for (error, better) in [
            ("a: No such file (os error 2)", "a: No such file"),
            ("× a: Connection\n  │ refused (os\n  │ error 111); b", "× a: Connection\n  │ refused; b"),
            ("× no such file\n  │ (os error 2)\n", "× no such file\n"),
            ("(os/2)", "(os/2)"),
        ] {
            assert_eq!(plain(error), better);
        }
    }

    #[test]
    fn a_file_is_no_run() {
        let why = must_exist(Path::new("Cargo.toml"), "run").unwrap_err();
        assert_eq!(why.to_string(), "there is no run at 'Cargo.toml'");
        assert!(why.help().unwrap().to_string().contains("a run is a folder"));
        assert!(must_exist(Path::new("Cargo.toml"), "run or table").is_ok());
    }

    #[test]
    fn a_plan_that_cannot_be_read_is_refused_with_all_that_is_wrong() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plan.toml");
        let good = ::runs::bundled::text(::runs::plan::BUNDLED, "first-sweep").unwrap();
        let refused = |text: &str| {
            std::fs::write(&path, text).unwrap();
            tables::check::problems_of(&plan(path.to_str().unwrap()).unwrap_err())
        };
        let problems = refused(&good.replacen("settle_s", "setle_s", 1).replacen(
            "reference_every",
            "reference_evry",
            1,
        ));
        let mut helps: Vec<_> = problems.iter().filter_map(|p| p.help.as_deref()).collect();
        helps.sort_unstable();
        assert_eq!(helps, ["did you mean `reference_every`?", "did you mean `settle_s`?"], "{problems:?}");
        let problems = refused("");
        assert!(problems.iter().any(|p| p.problem == "the key name is missing"), "{problems:?}");
        assert!(problems.iter().all(|p| p.help.is_some()), "{problems:?}");
        let setup = ::runs::bundled::text(::runs::setup::BUNDLED, "virtual-ideal").unwrap();
        assert!(refused(setup)[0].problem.contains("is a setup; a plan is needed"));
    }

    #[test]
    fn refused_means_that_nothing_was_touched() {
        let full = || miette::miette!("No space left on device");
        assert_eq!(status_of(&full()), REFUSED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotSaved)), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::Internal)), INTERNAL);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotOff)), FAILED);
        assert_eq!(status_of(&Unfinished::Interrupted.into()), FAILED);
        assert_eq!(status_of(&full().wrap_err(Unfinished::NotSaved).wrap_err("and more")), FAILED);
    }
}
