//! The passes of a run by its table and its journal: a pass goes into the journal first, then into the table.

use super::lines::{whole_passes, whole_table};
use super::{JOURNAL, POINTS};
use crate::files::GuardedFile;
use crate::sweep::MeasuredPass;
use miette::{Context, IntoDiagnostic};
use models::pass::{self, Pass};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::Write;
use std::path::Path;

/// The passes of a run with their comparisons, each point once: a pass whose table line was lost with a power
/// cut is not counted, one that was journalled twice counts once.
///
/// # Errors
/// A folder that holds no run, or lacks its table or its journal; a table or journal that is damaged.
pub fn passes_in(path: &Path) -> miette::Result<Vec<MeasuredPass>> {
    must_exist(path)?;
    let read = |name: &str| {
        let file = path.join(name);
        fs::read(&file).into_diagnostic().wrap_err_with(|| file.display().to_string())
    };
    let (table, _) = whole_table(&read(POINTS)?).wrap_err_with(|| path.join(POINTS).display().to_string())?;
    let (journal, _) =
        whole_passes(&read(JOURNAL)?).wrap_err_with(|| path.join(JOURNAL).display().to_string())?;
    let passes = once(journal);
    agree(path, &table, &passes)?;
    let in_table: BTreeSet<u64> = table.iter().map(|k| k.point).collect();
    Ok(passes.into_iter().filter(|p| in_table.contains(&p.pass.point)).collect())
}

/// Refuses a folder without table or journal.
fn must_exist(path: &Path) -> miette::Result<()> {
    let shown = path.display();
    match (path.join(POINTS).exists(), path.join(JOURNAL).exists()) {
        (true, true) => Ok(()),
        (false, true) => miette::bail!(help = super::RUN_AGAIN, "{shown}/{POINTS} is missing"),
        (true, false) => miette::bail!(
            help = format!("take {JOURNAL} from a copy of the folder; the table alone can be diagnosed"),
            "{shown}/{JOURNAL} is missing"
        ),
        (false, false) => miette::bail!(
            help = "name a folder that `muprime run --out` made",
            "{shown} holds no run: {POINTS} and {JOURNAL} are missing"
        ),
    }
}

/// Each point once, as it was journalled last.
pub(super) fn once(journal: Vec<MeasuredPass>) -> Vec<MeasuredPass> {
    let last: BTreeMap<u64, usize> = journal.iter().enumerate().map(|(i, p)| (p.pass.point, i)).collect();
    journal.into_iter().enumerate().filter(|(i, p)| last[&p.pass.point] == *i).map(|(_, p)| p).collect()
}

/// Refuses a table with a point that the journal has not.
fn agree(path: &Path, table: &[Pass], journal: &[MeasuredPass]) -> miette::Result<()> {
    let known: BTreeSet<u64> = journal.iter().map(|p| p.pass.point).collect();
    match table.iter().find(|k| !known.contains(&k.point)) {
        None => Ok(()),
        Some(k) => miette::bail!(
            help = format!("take {JOURNAL} and {POINTS} from a copy of the folder, or give another --out"),
            "{}: point {} is in {POINTS} and not in {JOURNAL}: one of them is damaged",
            path.display(),
            k.point
        ),
    }
}

/// The points whose line in the table is not what the journal holds, in a sentence each.
pub(super) fn changed(table: &[Pass], journal: &[MeasuredPass]) -> impl Iterator<Item = String> {
    let held: BTreeMap<u64, &Pass> = journal.iter().map(|p| (p.pass.point, &p.pass)).collect();
    let differ = move |row: &&Pass| held.get(&row.point).is_some_and(|pass| *pass != *row);
    table
        .iter()
        .filter(differ)
        .map(|row| format!("point {}: {POINTS} and {JOURNAL} differ: one of them was changed", row.point))
}

/// Puts the passes into the table that the journal alone holds: after a crash between the two the last one,
/// of a table that was cut or lost all that it lacks. None of them is driven again. A point that the table
/// alone holds, or holds otherwise, is an error.
pub(super) fn restore(
    path: &Path,
    table: &mut GuardedFile,
    made: &mut Vec<Pass>,
    journal: Vec<MeasuredPass>,
) -> miette::Result<()> {
    let passes = once(journal);
    agree(path, made, &passes)?;
    if let Some(what) = changed(made, &passes).next() {
        miette::bail!(
            help = format!(
                "take {POINTS} and {JOURNAL} from a copy of the folder; or, if {JOURNAL} is right, remove {POINTS}: \
                 the same command writes it again"
            ),
            "{}: {what}",
            path.display()
        );
    }
    let known: BTreeSet<u64> = made.iter().map(|k| k.point).collect();
    let lost: Vec<Pass> =
        passes.into_iter().map(|p| p.pass).filter(|pass| !known.contains(&pass.point)).collect();
    if lost.is_empty() {
        return Ok(());
    }
    tracing::warn!("{} passes of {JOURNAL} were not in {POINTS} and are put back", lost.len());
    table.write_all(&rows_of(&lost)?).into_diagnostic().wrap_err(POINTS)?;
    made.extend(lost);
    table.sync()
}

/// The lines of passes in the table, without its header.
pub(super) fn rows_of(passes: &[Pass]) -> miette::Result<Vec<u8>> {
    let mut table = Vec::new();
    pass::write_passes(passes, &mut table).into_diagnostic()?;
    let header = table.iter().position(|b| *b == b'\n').map_or(0, |i| i + 1);
    Ok(table.split_off(header))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names of the files were missing in the help.
    #[test]
    fn what_is_missing_is_named_with_its_remedy() {
        let folder = tempfile::tempdir().unwrap();
        for (has, help) in
            [(POINTS, "take passes.jsonl from a copy"), (JOURNAL, "the passes of passes.jsonl")]
        {
            fs::write(folder.path().join(has), "").unwrap();
            let why = passes_in(folder.path()).unwrap_err();
            let remedy = why.help().unwrap().to_string();
            assert!(remedy.contains(help) && !remedy.contains('{'), "{remedy}");
            fs::remove_file(folder.path().join(has)).unwrap();
        }
    }
}
