//! All shards as one table in the order of the cases. Its bytes depend on the cases and their results alone: not on the engine, the
//! order, the ranges, the machine or the number of threads. It is streamed: what is in memory does not grow with the number of cases.

use super::file::hex;
use super::plan::length;
use super::run::Entry;
use super::shard::{Facts, Reader, Writer};
use super::study::Study;
use miette::IntoDiagnostic;
use runs::files::{GATHERED, replaceable, write_in_pieces};
use serde::Serialize;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::io::{BufWriter, Write};
use std::iter::Peekable;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Holes that a refusal names.
const NAMED: usize = 8;

/// What was gathered.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Gathered {
    /// The table.
    pub file: PathBuf,
    /// SHA-256 of its bytes.
    pub sha256: String,
    /// Cases in it.
    pub cases: u64,
    /// Those without a result, each with its reason.
    pub failed: u64,
    /// Shards read.
    pub shards: usize,
    /// Cases that were run more than once, each time with the same result.
    pub agreeing_duplicates: u64,
    /// SHA-256 of the programs that ran the cases.
    pub programs: BTreeSet<String>,
    /// Files in `parts/`: of workers that are at work, or that were killed.
    pub parts: usize,
}

/// What is written, hashed as it goes.
struct Hashed<W: Write>(W, Sha256);

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let n = self.0.write(bytes)?;
        self.1.update(&bytes[..n]);
        Ok(n)
    }
    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// The ranges that no shard covers.
pub fn holes(there: &[Range<u64>], cases: u64) -> Vec<Range<u64>> {
    let (mut holes, mut next) = (Vec::new(), 0);
    for range in there {
        if range.start > next {
            holes.push(next..range.start.min(cases));
        }
        next = next.max(range.end);
    }
    if next < cases {
        holes.push(next..cases);
    }
    holes
}

/// Gathers a study into a file, whole or not at all.
///
/// # Errors
/// Holes, duplicates that differ, shards of other cases, of another version or of another build (unless
/// `any_build`), a shard that is damaged, a disk that is full, another file at that place: no file is
/// written then.
pub fn gather(study: &Study, to: &Path, any_build: bool) -> miette::Result<Gathered> {
    replaceable(to, GATHERED)?;
    let there = study.ranges_there()?;
    let cases = study.file.header.cases;
    let holes = holes(&there, cases);
    if !holes.is_empty() {
        let missing = length(&holes);
        let mut named: Vec<_> = holes.iter().take(NAMED).map(|h| format!("{}..{}", h.start, h.end)).collect();
        named.extend((holes.len() > NAMED).then(|| format!("and {} more", holes.len() - NAMED)));
        let help = "`muprime submit` with the same folder runs what is missing";
        miette::bail!(help = help, "{missing} of {cases} cases have no result: {}", named.join(", "));
    }
    if let Some(beyond) = there.iter().find(|r| r.end > cases) {
        miette::bail!("{}: the study has {cases} cases only", study.shard(beyond).display());
    }
    // What the shards say of themselves is read before anything is written.
    for range in &there {
        opened(study, range, &study.shard(range))?;
    }
    let gathered = write_in_pieces(to, |file| merged(study, &there, BufWriter::new(file), any_build))?;
    Ok(Gathered { file: to.to_path_buf(), ..gathered })
}

fn merged(
    study: &Study,
    there: &[Range<u64>],
    to: BufWriter<std::fs::File>,
    any_build: bool,
) -> miette::Result<Gathered> {
    let mut writer = Writer::new(study.kind, Hashed(to, Sha256::new()))?;
    let (mut programs, mut failed, mut doubles) = (BTreeSet::new(), 0, 0);
    let mut waiting = there.iter().peekable();
    let mut open: Vec<(PathBuf, Peekable<Reader>)> = Vec::new();
    let cases = study.file.header.cases;
    for (index, key) in (0..cases).zip(study.keys(0..cases)?) {
        let key = key?;
        while let Some(range) = waiting.next_if(|range| range.start == index) {
            let path = study.shard(range);
            let reader = opened(study, range, &path)?;
            programs.extend(reader.facts.get("program").cloned());
            if programs.len() > 1 && !any_build {
                miette::bail!(
                    help = "remove its shards and submit again, or say --any-build where the builds are known to agree",
                    "{}: made by another build of the program than the shards before it",
                    path.display()
                );
            }
            open.push((path, reader.peekable()));
        }
        let mut found: Option<(Entry, usize)> = None;
        for (n, (path, reader)) in open.iter_mut().enumerate() {
            let Some(entry) = reader.next() else { continue };
            let entry = entry?;
            if entry.index != index || entry.key != key {
                miette::bail!(
                    help = "the cases or what they name were changed after it was made: remove it and submit again",
                    "{}: its row for case {index} is of another case (key {})",
                    path.display(),
                    hex(&entry.key)
                );
            }
            match &found {
                None => found = Some((entry, n)),
                Some((first, _)) if *first == entry => doubles += 1,
                Some((_, other)) => {
                    let (path, other) = (path.display().to_string(), *other);
                    miette::bail!(
                        "case {index} has two results that differ: {} and {path}",
                        open[other].0.display()
                    );
                }
            }
        }
        // A shard that ended sooner than its name says leaves a hole behind.
        let (entry, _) = found
            .ok_or_else(|| miette::miette!("case {index} has no result: a shard is shorter than its name"))?;
        failed += u64::from(entry.outcome.is_err());
        writer.push(entry)?;
        let mut ended = Ok(());
        open.retain_mut(|(_, reader)| {
            if let Some(Err(why)) = reader.next_if(Result::is_err) {
                ended = Err(why);
                return false;
            }
            reader.peek().is_some()
        });
        ended?;
    }
    let Hashed(mut to, hash) = writer.end(&facts(study)?)?;
    to.flush().into_diagnostic()?;
    Ok(Gathered {
        file: PathBuf::new(),
        sha256: hex(&hash.finalize()),
        cases,
        failed,
        shards: there.len(),
        agreeing_duplicates: doubles,
        programs,
        parts: std::fs::read_dir(study.out.join("parts")).map_or(0, Iterator::count),
    })
}

/// A shard whose metadata fit the study.
fn opened(study: &Study, range: &Range<u64>, path: &Path) -> miette::Result<Reader> {
    let reader = Reader::open(study.kind, path).map_err(|damaged| {
        miette::miette!(
            help = "`muprime submit` with the same folder sets it aside and runs its cases again",
            "{}: no whole shard: {damaged:#}",
            path.display()
        )
    })?;
    let fits = |name: &str, wanted: &str| {
        let found = reader.facts.get(name).map_or("nothing", String::as_str);
        if found == wanted {
            return Ok(());
        }
        Err(miette::miette!("{}: its {name} is '{found}', and the study's '{wanted}'", path.display()))
    };
    fits("version", &study.kind.version())?;
    fits("header", &study.file.digest)?;
    fits("range", &format!("{}..{}", range.start, range.end))?;
    let (rows, due) = (reader.rows, range.end - range.start);
    if rows != due {
        miette::bail!("{}: {rows} rows, where its name says {due}", path.display());
    }
    Ok(reader)
}

/// What the gathered table says of itself: nothing of who ran it.
fn facts(study: &Study) -> miette::Result<Facts> {
    Ok(Facts::from([
        ("schema".into(), "muprime.gathered/1".into()),
        ("version".into(), study.kind.version()),
        ("cases".into(), serde_json::to_string(&study.file.header).into_diagnostic()?),
    ]))
}

#[cfg(test)]
mod tests {
    use super::holes;

    #[test]
    fn holes_are_what_no_range_covers() {
        let flat = |there: &[std::ops::Range<u64>], cases| {
            holes(there, cases).into_iter().flatten().collect::<Vec<u64>>()
        };
        assert_eq!(flat(&[], 3), [0, 1, 2]);
        assert!(flat(std::slice::from_ref(&(0..5)), 5).is_empty());
        assert_eq!(flat(&[0..3, 1..2, 4..5], 7), [3, 5, 6]);
        assert_eq!(flat(&[2..4, 3..9], 6), [0, 1]);
    }
}
