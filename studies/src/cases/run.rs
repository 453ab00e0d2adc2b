//! Cases run on the threads of the pool that this is called in; results come in the order of the cases. It is
//! the one loop of cases: the worker writes what it gives, [`here`] reads it at once.

use super::file::Header;
use super::kinds::{Case, CaseKind, Cell, Outcome};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// What came of a case.
#[derive(Clone, Debug, PartialEq)]
pub struct Entry {
    /// Index of the case.
    pub index: u64,
    /// Its key.
    pub key: [u8; 32],
    /// What came of it.
    pub outcome: Outcome,
}

/// Cases of a portion at most: what a shard writes as one row group.
pub const PORTION: usize = 4096;

/// Runs one case. A fault of the program in one case is that case's reason: the others stand.
pub fn entry(kind: &CaseKind, index: u64, case: Case) -> Entry {
    let key = kind.key(&case.inputs);
    let ran = catch_unwind(AssertUnwindSafe(case.run));
    let outcome: Outcome = ran.unwrap_or_else(|panic| {
        let message =
            panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
        Err(format!("a fault of the program: {}", message.unwrap_or("no message")))
    });
    Entry { index, key, outcome }
}

/// Runs cases in portions and gives each result to `take`; false where `cancelled` ended it between two.
///
/// # Errors
/// A case that cannot be made, or whatever `take` says.
pub fn portions(
    kind: &CaseKind,
    mut cases: impl Iterator<Item = miette::Result<(u64, Case)>>,
    cancelled: &dyn Fn() -> bool,
    take: &mut dyn FnMut(Entry) -> miette::Result<()>,
) -> miette::Result<bool> {
    let portion = PORTION.min(8 * rayon::current_num_threads());
    loop {
        let now: Vec<(u64, Case)> = cases.by_ref().take(portion).collect::<miette::Result<_>>()?;
        if now.is_empty() {
            return Ok(true);
        }
        if cancelled() {
            return Ok(false);
        }
        let entries: Vec<Entry> = now.into_par_iter().map(|(index, case)| entry(kind, index, case)).collect();
        entries.into_iter().try_for_each(&mut *take)?;
    }
}

/// Runs cases that follow from settings and gives the cells of each to `take`; nothing is written.
///
/// # Errors
/// Settings that the kind refuses, a case without a result, or whatever `take` says.
pub fn here(
    kind: &'static CaseKind,
    settings: &impl Serialize,
    cases: u64,
    take: &mut dyn FnMut(Vec<Cell>) -> miette::Result<()>,
) -> miette::Result<()> {
    let make = (kind.prepare)(&Header::of(kind, settings, cases)?, Path::new(""))?;
    let all = (0..cases).map(|index| Ok((index, make(index, None)?)));
    let take = &mut |entry: Entry| {
        let index = entry.index;
        take(entry.outcome.map_err(|why| miette::miette!("{} {index}: {why}", kind.name))?)
    };
    portions(kind, all, &|| false, take).map(|_| ())
}

/// All cases of a header with their results, on the threads of this pool; those without one are named on standard error. In `out`
/// they are a study of that name, which a repeated call goes on with; a program without the feature `cases` stores nothing.
///
/// # Errors
/// As the worker; a case that cannot be made.
pub fn all(out: &Path, name: &str, header: Header, lines: Option<&[Value]>) -> miette::Result<Vec<Entry>> {
    #[cfg(feature = "cases")]
    let entries = {
        let options = super::submit::Options::local(rayon::current_num_threads());
        super::submit::whole(out, name, header, lines, &options)?
    };
    #[cfg(not(feature = "cases"))]
    let entries = {
        let _ = out;
        let (kind, cases) =
            (super::kinds::by_name(&header.kind)?, lines.map_or(header.cases, |l| l.len() as u64));
        let header = Header { cases, listed: lines.is_some(), ..header };
        let make = (kind.prepare)(&header, Path::new(""))?;
        let mut entries = Vec::new();
        let line = |index: u64| lines.and_then(|lines| lines.get(index as usize));
        let each = (0..cases).map(|index| Ok((index, make(index, line(index))?)));
        portions(kind, each, &|| false, &mut |entry| {
            entries.push(entry);
            Ok(())
        })?;
        entries
    };
    for Entry { index, outcome, .. } in &entries {
        if let Err(why) = outcome {
            runs::say!("{name}, case {index}: {why}");
        }
    }
    Ok(entries)
}
