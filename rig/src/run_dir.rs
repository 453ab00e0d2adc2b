//! A run's folder: the record, the point table, rig.toml, the report; and how a killed run is taken up again.
//!
//! A pass is acknowledged (on stdout, in the catalogue) only after its line is in `points.csv` and synced.

use crate::plan::Point;
use crate::sequence::MeasuredPass;
use miette::{Context, IntoDiagnostic};
use models::record::{self, Pass};
use serde::{Deserialize, Serialize};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// What a run is of: written when it begins, compared when it is taken up again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// SHA-256 of the setup's text.
    pub setup_sha256: String,
    /// SHA-256 of the plan's text.
    pub plan_sha256: String,
    /// Seed of the order.
    pub seed: u64,
    /// SHA-256 of the model file, or the model's name.
    pub model: String,
}

/// A run's folder, held by this process alone.
pub struct RunDir {
    path: PathBuf,
    points: File,
    journal: File,
    /// Held, and so locked, for as long as this lives: the system frees it with the process, whatever ends that.
    _lock: File,
    /// Passes that an earlier session has made.
    pub made: Vec<Pass>,
}

const IDENTITY: &str = "run.toml";
const LOCK: &str = ".lock";

impl RunDir {
    /// Makes a new folder, or takes up one that an earlier session of the same plan, setup, seed and model left.
    ///
    /// # Errors
    /// A folder of another run, or one that a living process holds. Nothing is written then.
    pub fn open(path: &Path, identity: &Identity) -> miette::Result<Self> {
        let shown = path.display();
        let file = path.join(IDENTITY);
        if file.exists() {
            let text = fs::read_to_string(&file).into_diagnostic()?;
            let before: Identity =
                toml::from_str(&text).map_err(|e| miette::miette!("{shown}/{IDENTITY}: {e}"))?;
            if before != *identity {
                let parts = [
                    ("setup", before.setup_sha256 == identity.setup_sha256),
                    ("plan", before.plan_sha256 == identity.plan_sha256),
                    ("seed", before.seed == identity.seed),
                    ("model", before.model == identity.model),
                ];
                let other: Vec<_> = parts.iter().filter(|(_, same)| !same).map(|(name, _)| *name).collect();
                miette::bail!(
                    help = "give another --out, or the same plan, setup, seed and model to go on with it",
                    "{shown} holds a run with another {}",
                    other.join(" and ")
                );
            }
        } else if path.exists() && holds_something(path)? {
            miette::bail!(
                help = "give an empty or new folder as --out",
                "{shown} is not empty and holds no run"
            );
        }
        fs::create_dir_all(path).into_diagnostic().wrap_err_with(|| format!("cannot make {shown}"))?;
        let lock = claim(&path.join(LOCK))?;
        Self::open_locked(path, identity, lock)
    }

    fn open_locked(path: &Path, identity: &Identity, lock: File) -> miette::Result<Self> {
        let identity_file = path.join(IDENTITY);
        if !identity_file.exists() {
            write_whole(&identity_file, toml::to_string(identity).into_diagnostic()?.as_bytes())?;
        }
        let points_file = path.join("points.csv");
        if !points_file.exists() {
            let mut header = Vec::new();
            record::write_passes(&[], &mut header).into_diagnostic()?;
            write_whole(&points_file, &header)?;
        }
        let mut points = OpenOptions::new()
            .read(true)
            .append(true)
            .open(&points_file)
            .into_diagnostic()
            .wrap_err("points.csv")?;
        drop_torn_line(&mut points)?;
        points.seek(SeekFrom::Start(0)).into_diagnostic()?;
        let made =
            record::read_passes(&points).into_diagnostic().wrap_err("points.csv of an earlier session")?;
        let mut journal = OpenOptions::new()
            .create(true)
            .read(true)
            .append(true)
            .open(path.join("passes.jsonl"))
            .into_diagnostic()?;
        drop_torn_line(&mut journal)?;
        Ok(RunDir { path: path.to_path_buf(), points, journal, _lock: lock, made })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The points that are still to be made.
    pub fn left_of(&self, points: Vec<Point>) -> Vec<Point> {
        let made = |p: &Point| self.made.iter().any(|m| m.point == u64::from(p.number));
        points.into_iter().filter(|p| !made(p)).collect()
    }

    /// A new record file: `run-1.mcap`, then one for every time the run is taken up again.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn new_record(&self) -> miette::Result<File> {
        let number = self.records()?.len() + 1;
        let path = self.path.join(format!("run-{number}.mcap"));
        OpenOptions::new()
            .create_new(true)
            .read(true)
            .write(true)
            .open(&path)
            .into_diagnostic()
            .wrap_err_with(|| path.display().to_string())
    }

    /// The record files, oldest first.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn records(&self) -> miette::Result<Vec<PathBuf>> {
        records_in(&self.path)
    }

    /// Puts a pass into the point table and the journal, synced: after this it is never lost.
    ///
    /// # Errors
    /// Whatever the file system says; the sweep must stop then.
    pub fn keep(&mut self, measured: &MeasuredPass) -> miette::Result<()> {
        let mut table = Vec::new();
        record::write_passes(std::slice::from_ref(&measured.pass), &mut table).into_diagnostic()?;
        let header = table.iter().position(|b| *b == b'\n').map_or(0, |i| i + 1);
        let mut line = serde_json::to_vec(measured).into_diagnostic()?;
        line.push(b'\n');
        // The journal first: a pass that is in the table is in the journal too.
        self.journal.write_all(&line).into_diagnostic().wrap_err("passes.jsonl")?;
        self.journal.sync_data().into_diagnostic().wrap_err("passes.jsonl")?;
        self.points.write_all(&table[header..]).into_diagnostic().wrap_err("points.csv")?;
        self.points.sync_data().into_diagnostic().wrap_err("points.csv")
    }

    /// Writes a file of the run whole or not at all.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn write(&self, name: &str, bytes: &[u8]) -> miette::Result<()> {
        write_whole(&self.path.join(name), bytes)
    }
}

/// The record files of a run's folder, oldest first.
///
/// # Errors
/// Whatever the file system says.
pub fn records_in(path: &Path) -> miette::Result<Vec<PathBuf>> {
    let mut found: Vec<PathBuf> = fs::read_dir(path)
        .into_diagnostic()
        .wrap_err_with(|| path.display().to_string())?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|p| p.extension().is_some_and(|e| e == "mcap"))
        .collect();
    found.sort_by_key(|p| (p.as_os_str().len(), p.clone()));
    Ok(found)
}

/// The passes of a run with their comparisons, each point once: a pass whose table line was lost with a power cut is
/// not counted, one that was journalled twice counts once.
///
/// # Errors
/// A folder that holds no run, or a journal that cannot be read.
pub fn passes_in(path: &Path) -> miette::Result<Vec<MeasuredPass>> {
    let table = path.join("points.csv");
    let file = File::open(&table).into_diagnostic().wrap_err_with(|| table.display().to_string())?;
    let kept = record::read_passes(file).into_diagnostic().wrap_err_with(|| table.display().to_string())?;
    let journal = path.join("passes.jsonl");
    let file = File::open(&journal).into_diagnostic().wrap_err_with(|| journal.display().to_string())?;
    let mut passes: Vec<MeasuredPass> = Vec::new();
    for (i, line) in BufReader::new(file).lines().enumerate() {
        let line = line.into_diagnostic()?;
        let pass: MeasuredPass = serde_json::from_str(&line)
            .map_err(|e| miette::miette!("{}: line {}: {e}", journal.display(), i + 1))?;
        let in_table = kept.iter().any(|k| k.point == pass.pass.point);
        passes.retain(|p| p.pass.point != pass.pass.point);
        if in_table {
            passes.push(pass);
        }
    }
    Ok(passes)
}

/// Writes a file beside its place, syncs it and moves it there.
fn write_whole(path: &Path, bytes: &[u8]) -> miette::Result<()> {
    let shown = || path.display().to_string();
    let beside = path.with_extension("part");
    let mut file = File::create(&beside).into_diagnostic().wrap_err_with(shown)?;
    file.write_all(bytes).into_diagnostic().wrap_err_with(shown)?;
    file.sync_all().into_diagnostic().wrap_err_with(shown)?;
    fs::rename(&beside, path).into_diagnostic().wrap_err_with(shown)
}

/// A power cut may leave half a line at the end: it was never acknowledged and is dropped.
fn drop_torn_line(file: &mut File) -> miette::Result<()> {
    file.seek(SeekFrom::Start(0)).into_diagnostic()?;
    let mut whole = 0u64;
    let mut reader = BufReader::new(&*file);
    let mut line = Vec::new();
    loop {
        line.clear();
        let n = reader.read_until(b'\n', &mut line).into_diagnostic()?;
        if n == 0 {
            return Ok(());
        }
        if line.last() != Some(&b'\n') {
            break;
        }
        whole += n as u64;
    }
    file.set_len(whole).into_diagnostic()
}

/// Takes a lock: the file stays, named after its present holder, and is locked as long as the answer lives.
///
/// # Errors
/// A living process holds it, or the file system refuses.
pub fn claim(lock: &Path) -> miette::Result<File> {
    let shown = lock.display();
    let wrong = |e: std::io::Error| miette::miette!("{shown}: {e}");
    let mut file =
        OpenOptions::new().create(true).read(true).write(true).truncate(false).open(lock).map_err(wrong)?;
    match file.try_lock() {
        Ok(()) => {
            file.set_len(0).map_err(wrong)?;
            write!(file, "{}", std::process::id()).map_err(wrong)?;
            Ok(file)
        }
        Err(TryLockError::WouldBlock) => {
            let holder = fs::read_to_string(lock).unwrap_or_default();
            Err(miette::miette!(
                help = "wait until it ends, or end it",
                "another muprime (process {}) holds {shown}",
                holder.trim()
            ))
        }
        Err(TryLockError::Error(e)) => Err(wrong(e)),
    }
}

/// Whether a process holds the lock of a run's folder.
pub fn is_held(run: &Path) -> bool {
    let Ok(file) = File::open(run.join(LOCK)) else { return false };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// Whether a folder holds more than what a session leaves that died before it wrote its identity.
fn holds_something(path: &Path) -> miette::Result<bool> {
    let part = Path::new(IDENTITY).with_extension("part");
    for entry in fs::read_dir(path).into_diagnostic()? {
        let name = entry.into_diagnostic()?.file_name();
        if name != LOCK && name != part.as_os_str() {
            return Ok(true);
        }
    }
    Ok(false)
}
