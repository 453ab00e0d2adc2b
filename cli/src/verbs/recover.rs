//! `muprime recover FILE`: makes a cut or damaged record whole in place, and keeps the original beside it.

use super::prelude::*;
use realtime::recorder::{self, Integrity, Recovery};
use runs::files::{self, GuardedFile};
use std::fs::{self, File};
use std::io::BufReader;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// A record (.mcap)
    file: PathBuf,
}

/// Recovers; refused: a file that is not there, or that holds nothing of a record; the record of a live
/// run. Nothing is written then.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    // The record itself, not a link to it, is replaced, and its own folder has the lock.
    let leads_to = args.file.is_symlink().then(|| fs::canonicalize(&args.file)).and_then(Result::ok);
    let file = &leads_to.unwrap_or(args.file);
    let shown = || file.display().to_string();
    super::must_exist(file, "recording")?;
    if !fs::metadata(file).into_diagnostic().wrap_err_with(shown)?.is_file() {
        miette::bail!(help = "give a record, run-1.mcap and the like", "{} is not an ordinary file", shown());
    }
    let record = || File::open(file).into_diagnostic().wrap_err_with(shown).map(BufReader::new);
    // A whole record needs neither a lock nor a folder that can be written.
    let found = recorder::inspect(record()?);
    if found.intact() {
        return whole(&found, &shown(), json);
    }
    // Held to the end: a session would write on into the record that is replaced.
    let lock = file.with_file_name(runs::run_dir::LOCK);
    let held = lock.exists().then(|| runs::run_dir::claim(&lock)).transpose();
    let _held =
        held.wrap_err_with(|| format!("{}: its run is live, or its folder cannot be written", shown()))?;
    let part = files::beside(file);
    let mended = GuardedFile::fresh(&part)?;
    let disk = mended.handle()?;
    let found = recorder::recover(record()?, mended);
    let found = found.into_diagnostic().and_then(|found| disk.sync().map(|()| found));
    if !matches!(found, Ok(Recovery::Rewritten { .. })) {
        fs::remove_file(&part).into_diagnostic()?;
    }
    let findings = |found: &Integrity| found.sentences().join("; ");
    match found? {
        Recovery::Nothing { found } => {
            miette::bail!("{}: nothing of a record can be read: {}", shown(), findings(&found))
        }
        Recovery::Rewritten { messages, found } => {
            let original = put_in_place(file, &part)?;
            if json {
                answer_json(&json!({ "recovered": true, "messages": messages, "original": original,
                    "damaged": found.damaged_places, "because": findings(&found), "integrity": found }));
            } else {
                say!("{}: {messages} messages saved; the original is {}", shown(), original.display());
                found.sentences().iter().for_each(|sentence| say!("  {sentence}"));
            }
        }
        Recovery::Whole(found) => return whole(&found, &shown(), json),
    }
    exit(DONE)
}

/// The answer for a record that is whole.
fn whole(found: &Integrity, shown: &str, json: bool) -> miette::Result<ExitCode> {
    let document = json!({ "recovered": false, "whole": true, "integrity": found });
    let words = found.sentences().iter().map(|sentence| format!("\n  {sentence}")).collect::<String>();
    if json {
        answer_json(&document)
    } else {
        say!("{shown}: whole, nothing to do{words}")
    }
    exit(DONE)
}

/// Moves the whole record to its place. The original has a name at every instant: it is linked beside first.
fn put_in_place(file: &Path, part: &Path) -> miette::Result<PathBuf> {
    let mut original = file.with_extension("mcap.original");
    let mut n = 1;
    // A name that leads nowhere is taken too.
    while original.symlink_metadata().is_ok() {
        n += 1;
        original = file.with_extension(format!("mcap.original-{n}"));
    }
    fs::hard_link(file, &original)
        .or_else(|_| {
            let mut copy = files::fresh(&original)?;
            std::io::copy(&mut File::open(file)?, &mut copy).and_then(|_| copy.sync_all())
        })
        .and_then(|()| files::sync_folder_of(file))
        .and_then(|()| fs::rename(part, file))
        .and_then(|()| files::sync_folder_of(file))
        .into_diagnostic()
        .wrap_err_with(|| file.display().to_string())?;
    Ok(original)
}
