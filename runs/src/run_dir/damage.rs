//! What of a run's folder is no longer what was written. An error is a file or folder that cannot be read.

use super::journal::changed;
use super::lines::{whole_passes, whole_table};
use super::{IDENTITY, JOURNAL, POINTS, SUMMARY, is_held, passes_in, records_in, sessions_in};
use crate::sweep::MeasuredPass;
use miette::{Context, IntoDiagnostic};
use realtime::recorder::Integrity;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

/// What is damaged in a run's folder: its records from their first byte to their last, and its table
/// compared with its journal. Empty where nothing is; a session that was killed or is still going has a
/// record that is cut.
pub fn damage_in(path: &Path) -> miette::Result<Vec<String>> {
    let mut findings = Vec::new();
    for record in records_in(path)? {
        let file = File::open(&record).into_diagnostic().wrap_err_with(|| record.display().to_string())?;
        findings.extend(of_record(&record, realtime::recorder::inspect(BufReader::new(file))));
    }
    findings.extend(missing_records(path)?);
    // A folder that `import` made has a table and no run.
    if path.join(JOURNAL).exists() || path.join(IDENTITY).exists() && path.join(POINTS).exists() {
        match passes_in(path) {
            Ok(passes) => findings.extend(differences(path, &passes)?),
            Err(why) => findings.push(format!("{why:#}")),
        }
    }
    Ok(findings)
}

/// What is damaged in a record, with the name of its file. The record of a living session has no end yet.
pub fn of_record(record: &Path, mut found: Integrity) -> Vec<String> {
    let run = record.parent().unwrap_or(Path::new(""));
    let last = || records_in(run).is_ok_and(|all| all.last().is_some_and(|last| last == record));
    if is_held(run) && !run.join(SUMMARY).exists() && last() {
        found.cut = None;
    }
    let name = record.file_name().unwrap_or_default().to_string_lossy();
    found.sentences().iter().map(|sentence| format!("{name}: {sentence}")).collect()
}

/// Sessions whose record is gone.
pub fn missing_records(path: &Path) -> miette::Result<Vec<String>> {
    let sessions = sessions_in(path)?.into_iter().map(|s| s.session);
    let gone = sessions.filter(|n| !path.join(format!("run-{n}.mcap")).exists());
    Ok(gone.map(|n| format!("run-{n}.mcap: the record of session {n} is missing")).collect())
}

/// Points whose line in the table is not what the journal holds, and how many the table lacks: each counts
/// once. The pass that a living session is storing is not missing.
pub fn differences(path: &Path, passes: &[MeasuredPass]) -> miette::Result<Vec<String>> {
    let (table, _) = whole_table(&fs::read(path.join(POINTS)).into_diagnostic()?)?;
    let (journal, _) = whole_passes(&fs::read(path.join(JOURNAL)).into_diagnostic()?)?;
    let mut findings: Vec<String> = changed(&table, passes).collect();
    let points = |all: &mut dyn Iterator<Item = u64>| all.collect::<BTreeSet<u64>>();
    let rows = points(&mut table.iter().map(|row| row.point));
    let lost = points(&mut journal.iter().map(|p| p.pass.point)).difference(&rows).count();
    if lost > usize::from(is_held(path)) {
        let (passes, are) = if lost == 1 { ("pass", "is") } else { ("passes", "are") };
        findings.push(format!("{lost} {passes} of {JOURNAL} {are} not in {POINTS}"));
    }
    Ok(findings)
}

#[cfg(test)]
mod tests {
    /// A table that `import` wrote was called damaged: it has no journal.
    #[test]
    fn a_table_without_a_run_lacks_no_journal() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(super::POINTS), "point,time_s\n").unwrap();
        assert!(super::damage_in(folder.path()).unwrap().is_empty());
        std::fs::write(folder.path().join(super::IDENTITY), "").unwrap();
        assert_eq!(super::damage_in(folder.path()).unwrap().len(), 1);
    }
}
