//! The worker: one range of cases becomes one shard, once. Killed at any step it leaves either no shard or a whole one, and
//! called again it does what is left to do. It asks no clock, no scheduler and no other worker.

use super::crash_points;
use super::file::hex;
use super::run::{Entry, portions};
use super::shard::{Facts, Reader, Writer};
use super::study::Study;
use miette::{Context, IntoDiagnostic};
use runs::job::Unfinished;
use runs::say;
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fs;
use std::io::BufWriter;
use std::ops::Range;
use std::path::Path;

/// What a worker found or made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Done {
    /// The shard was there.
    There,
    /// It was made; so many of its cases failed, with their reasons.
    Made {
        /// Cases without a result.
        failed: u64,
    },
    /// The study was cancelled before it was made.
    Cancelled,
}

/// Runs a range on the threads of the pool that it is called in.
///
/// # Errors
/// Cases that cannot be made, a shard of other cases at its place, a disk that is full: then there is no shard.
pub fn work(study: &Study, range: Range<u64>, program: &str, job: Option<&Path>) -> miette::Result<Done> {
    crash_points::here("start");
    if range.is_empty() {
        miette::bail!("cases {}..{}: an empty range", range.start, range.end);
    }
    let cancelled = || job.is_some_and(|job| job.join("cancelled").exists());
    if cancelled() {
        return Ok(Done::Cancelled);
    }
    let place = study.shard(&range);
    if place.exists() && stands(study, &range, &place)? {
        return Ok(Done::There);
    }
    let name = place.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (part, file) = study.part(&name)?;
    crash_points::here("part-made");
    let written = write(study, &range, program, BufWriter::new(file), &cancelled);
    let moved = written.and_then(|failed| {
        let Some(failed) = failed else { return Ok(None) };
        runs::files::make_folder(place.parent().unwrap_or(&study.out)).wrap_err(Unfinished::NotSaved)?;
        fs::rename(&part, &place).into_diagnostic().wrap_err_with(|| place.display().to_string())?;
        Ok(Some(failed))
    });
    if !matches!(moved, Ok(Some(_))) {
        let _ = fs::remove_file(&part);
    }
    let Some(failed) = moved? else { return Ok(Done::Cancelled) };
    crash_points::here("moved");
    runs::files::sync_folder_of(&place).into_diagnostic().wrap_err(Unfinished::NotSaved)?;
    crash_points::here("folder-synced");
    Ok(Done::Made { failed })
}

/// Sets the shards within a range that cannot be read aside: their cases have no result.
///
/// # Errors
/// A shard of other cases than the file's: a file that a case names was changed since.
pub fn set_damaged_aside(study: &Study, within: &Range<u64>) -> miette::Result<()> {
    for range in study.ranges_there()?.iter().filter(|r| r.start < within.end && within.start < r.end) {
        stands(study, range, &study.shard(range))?;
    }
    Ok(())
}

/// Whether the shard at a range's place is that of its cases. One that cannot be read is set aside, with a word.
fn stands(study: &Study, range: &Range<u64>, place: &Path) -> miette::Result<bool> {
    let reader = Reader::open(study.kind, place).ok();
    let Some(reader) = reader.filter(|reader| reader.rows == range.end - range.start) else {
        let mut aside = place.as_os_str().to_owned();
        aside.push(".damaged");
        say!("{}: no whole shard; it is set aside as .damaged, and its cases are run", place.display());
        fs::rename(place, aside).into_diagnostic().wrap_err_with(|| place.display().to_string())?;
        return Ok(false);
    };
    let mut keys = Sha256::new();
    for key in study.keys(range.clone())? {
        keys.update(key?);
    }
    if reader.facts.get("keys").is_some_and(|there| *there == hex(&keys.finalize())) {
        return Ok(true);
    }
    let (place, cases) = (place.display(), study.file.path.display());
    let help =
        "the cases or what they name were changed after it was made: remove it, or give another folder";
    miette::bail!(help = help, "{place} is of other cases than those of {cases}")
}

/// Runs the cases in portions and writes them; `None` where the study was cancelled meanwhile.
fn write(
    study: &Study,
    range: &Range<u64>,
    program: &str,
    to: BufWriter<fs::File>,
    cancelled: &dyn Fn() -> bool,
) -> miette::Result<Option<u64>> {
    let mut writer = Writer::new(study.kind, to).wrap_err(Unfinished::NotSaved)?;
    let (mut keys, mut failed) = (Sha256::new(), 0);
    let line = |line: miette::Result<(u64, Option<Value>)>| {
        line.and_then(|(index, line)| Ok((index, study.case(index, line.as_ref())?)))
    };
    let whole =
        portions(study.kind, study.file.lines(range.clone())?.map(line), cancelled, &mut |entry: Entry| {
            keys.update(entry.key);
            failed += u64::from(entry.outcome.is_err());
            writer.push(entry).wrap_err(Unfinished::NotSaved)?;
            crash_points::here("half-written");
            Ok(())
        })?;
    if !whole {
        return Ok(None);
    }
    let facts = facts(study, range, program, hex(&keys.finalize()));
    let to = writer.end(&facts).wrap_err(Unfinished::NotSaved)?;
    let file = to.into_inner().map_err(std::io::IntoInnerError::into_error).into_diagnostic();
    let file = file.wrap_err(Unfinished::NotSaved)?;
    crash_points::here("written");
    file.sync_all().into_diagnostic().wrap_err(Unfinished::NotSaved)?;
    crash_points::here("synced");
    Ok(Some(failed))
}

/// What a shard says of itself: of which study it is, then who made it.
fn facts(study: &Study, range: &Range<u64>, program: &str, keys: String) -> Facts {
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let fact = |name: &str, value: &str| (name.to_string(), value.trim().to_string());
    Facts::from([
        fact("schema", "muprime.shard/1"),
        fact("version", &study.kind.version()),
        fact("header", &study.file.digest),
        fact("range", &format!("{}..{}", range.start, range.end)),
        fact("keys", &keys),
        fact("program", program),
        fact("made_on", &host),
        fact("platform", &format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS)),
    ])
}
