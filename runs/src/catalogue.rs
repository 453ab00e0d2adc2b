//! The catalogue of runs: SQLite in WAL mode beside the runs.

use crate::files::{self, Placed};
use miette::{IntoDiagnostic, WrapErr};
use rusqlite::{Connection, OpenFlags, OptionalExtension, params};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RunEntry {
    /// Folder of the run.
    pub folder: String,
    /// Name of the plan.
    pub plan: String,
    /// Name of the setup.
    pub setup: String,
    /// When it began, in s since 1970.
    pub started_unix_s: f64,
    /// How it ended; empty while it runs or was killed.
    pub outcome: String,
    /// Passes acknowledged.
    pub passes: i64,
    /// Passes planned.
    pub planned: i64,
    /// Whether the measurement disagrees with the model.
    pub departed: bool,
}

/// The catalogue.
pub struct Catalogue {
    db: Connection,
    /// The file that was opened: it must still be the one at its place.
    file: Placed,
}

/// Name of the catalogue in a folder of runs.
const FILE: &str = "catalogue.sqlite";

impl Catalogue {
    /// Opens the catalogue of a folder of runs, making it where there is none.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn open(runs: &Path) -> miette::Result<Self> {
        files::make_folder(runs)?;
        // A folder may be reached through links; the catalogue itself may not.
        let whole = runs.canonicalize().into_diagnostic().wrap_err_with(|| runs.display().to_string())?;
        let path = whole.join(FILE);
        // Looked at before SQLite opens it by its name, which follows a link and does not mind a second name.
        let mut options = std::fs::OpenOptions::new();
        let file = Placed::open(&path, options.read(true).write(true).create(true).truncate(false))?;
        // By their names alone: SQLite's locks on a file end when this process closes it anywhere.
        for suffix in ["-journal", "-wal", "-shm"] {
            files::refuse_planted(&whole.join(format!("{FILE}{suffix}")))?;
        }
        let flags = OpenFlags::default() | OpenFlags::SQLITE_OPEN_NOFOLLOW;
        let db = Connection::open_with_flags(&path, flags)
            .into_diagnostic()
            .wrap_err_with(|| path.display().to_string())?;
        db.pragma_update(None, "journal_mode", "WAL").into_diagnostic()?;
        // FULL keeps the last commit through a power cut, which NORMAL may roll back.
        db.pragma_update(None, "synchronous", "FULL").into_diagnostic()?;
        db.busy_timeout(std::time::Duration::from_secs(5)).into_diagnostic()?;
        db.execute_batch(
            "CREATE TABLE IF NOT EXISTS run (
                folder TEXT PRIMARY KEY, plan TEXT NOT NULL, setup TEXT NOT NULL,
                started_unix_s REAL NOT NULL, outcome TEXT NOT NULL DEFAULT '',
                passes INTEGER NOT NULL DEFAULT 0, planned INTEGER NOT NULL,
                departed INTEGER NOT NULL DEFAULT 0) STRICT;",
        )
        .into_diagnostic()
        .wrap_err_with(|| path.display().to_string())?;
        files::sync_folder_of(&path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        Ok(Catalogue { db, file })
    }

    /// Opens the catalogue of a folder of runs, to look at it.
    ///
    /// # Errors
    /// There is none: none is made then. Whatever SQLite says.
    pub fn existing(runs: &Path) -> miette::Result<Self> {
        if !runs.join(FILE).exists() {
            miette::bail!(
                help = "give --folder, or make a run first",
                "{} holds no catalogue",
                runs.display()
            );
        }
        Self::open(runs)
    }

    /// Enters a run, or re-enters one that is taken up again.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn begin(&self, entry: &RunEntry) -> miette::Result<()> {
        self.db
            .execute(
                "INSERT INTO run (folder, plan, setup, started_unix_s, planned, passes) VALUES (?1,?2,?3,?4,?5,?6)
                 ON CONFLICT (folder) DO UPDATE SET outcome = '', passes = excluded.passes",
                params![
                    entry.folder,
                    entry.plan,
                    entry.setup,
                    entry.started_unix_s,
                    entry.planned,
                    entry.passes
                ],
            )
            .into_diagnostic()?;
        Ok(())
    }

    /// Notes how far a run is.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn progress(&self, folder: &str, passes: i64, departed: bool) -> miette::Result<()> {
        self.update(
            "UPDATE run SET passes = ?2, departed = ?3 WHERE folder = ?1",
            params![folder, passes, departed],
        )
    }

    /// Changes the line of one run, and looks whether the catalogue is still where it belongs.
    fn update(&self, sql: &str, values: impl rusqlite::Params) -> miette::Result<()> {
        let lines = self.db.execute(sql, values).into_diagnostic().wrap_err("the catalogue")?;
        self.file.still_there()?;
        if lines != 1 {
            miette::bail!("the catalogue has lost the run");
        }
        Ok(())
    }

    /// Notes how a run ended.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn end(&self, folder: &str, outcome: &str) -> miette::Result<()> {
        self.update("UPDATE run SET outcome = ?2 WHERE folder = ?1", params![folder, outcome])
    }

    /// All runs, newest first.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn all(&self) -> miette::Result<Vec<RunEntry>> {
        let mut query = self
            .db
            .prepare(
                "SELECT folder, plan, setup, started_unix_s, outcome, passes, planned, departed FROM run
                 ORDER BY started_unix_s DESC, rowid DESC",
            )
            .into_diagnostic()?;
        let rows = query
            .query_map([], |row| {
                Ok(RunEntry {
                    folder: row.get(0)?,
                    plan: row.get(1)?,
                    setup: row.get(2)?,
                    started_unix_s: row.get(3)?,
                    outcome: row.get(4)?,
                    passes: row.get(5)?,
                    planned: row.get(6)?,
                    departed: row.get(7)?,
                })
            })
            .into_diagnostic()?;
        rows.collect::<Result<_, _>>().into_diagnostic()
    }

    /// Passes acknowledged for a run.
    ///
    /// # Errors
    /// Whatever SQLite says.
    pub fn passes(&self, folder: &str) -> miette::Result<Option<i64>> {
        self.db
            .query_row("SELECT passes FROM run WHERE folder = ?1", [folder], |row| row.get(0))
            .optional()
            .into_diagnostic()
    }
}

/// The folder of runs: `MUPRIME_RUNS`, or `runs` here.
pub fn runs_folder() -> PathBuf {
    std::env::var_os("MUPRIME_RUNS").map_or_else(|| PathBuf::from("runs"), PathBuf::from)
}
