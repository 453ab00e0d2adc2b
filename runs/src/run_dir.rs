//! A run's folder: the record, the point table, rig.toml, the report; and how a killed run is resumed.
//!
//! A pass is acknowledged (on stdout) only after its line is in `points.csv` and synced. Errors are
//! those of the file system, where no others are stated.

mod damage;
mod journal;
mod lines;
mod lock;
mod record_facts;

use crate::files::{self, GuardedFile, Made, write_plain};
use crate::job::Notes;
use crate::plan::Point;
use crate::sweep::MeasuredPass;
use calibration::certificate::sha256_hex;
pub use damage::{damage_in, differences, missing_records, of_record};
pub use journal::passes_in;
use lines::{whole_passes, whole_table};
pub use lock::{NAME as LOCK, claim, holder, is_held};
use miette::{Context, IntoDiagnostic};
use models::pass::{self, Pass};
use realtime::recorder::Reader;
pub use record_facts::{RecordFacts, header_facts, record_facts};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};

/// What a run is of: written when it begins, compared when it is resumed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Name of the plan.
    #[serde(default)]
    pub plan: String,
    /// Name of the setup.
    #[serde(default)]
    pub setup: String,
    /// Passes planned; 0 where no folder has been opened for them.
    #[serde(default)]
    pub planned: usize,
    /// SHA-256 of the setup's text and of its own tip, certificates and profiles.
    pub setup_sha256: String,
    /// SHA-256 of the plan's text and of its target's file.
    pub plan_sha256: String,
    /// Seed of the order.
    pub seed: u64,
    /// SHA-256 of the model file, or the model's name.
    pub model: String,
    /// SHA-256 of the defects that a virtual rig has in place of its own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub defects_sha256: Option<String>,
    /// The setup names a human fingertip, and says that nobody touches the plate.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub nobody_touches_the_plate: bool,
    /// Who runs it, and on what: another session may say something else.
    #[serde(default)]
    pub notes: Notes,
    /// The plan's `[protocol]`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub protocol: BTreeMap<String, toml::Value>,
}

/// SHA-256 of a text and of the files that it names.
pub(crate) fn sha256_of<'a>(text: &str, files: impl Iterator<Item = &'a [u8]>) -> String {
    sha256_hex(files.fold(text.to_string(), |all, file| all + &sha256_hex(file)).as_bytes())
}

/// One session of a run: from its start until its end, a stop or a crash. A resumed run has several.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Session {
    /// Number, from 1. The session's record is `run-NUMBER.mcap`.
    pub session: u64,
    /// Wall clock at its start, in ns since 1970.
    pub start_unix_ns: u64,
    /// Time of the run at its start in s: 0 for the first. `time_s` of its passes goes on from there.
    pub start_s: f64,
}

/// A run's folder, held by this process alone.
pub struct RunDir {
    path: PathBuf,
    points: GuardedFile,
    journal: GuardedFile,
    /// Held, and so locked, for as long as this lives: the system frees it with the process, whatever ends
    /// that.
    _lock: File,
    /// Passes that an earlier session has made.
    pub made: Vec<Pass>,
    sessions: Vec<Session>,
    planned: Option<Session>,
    identity: Identity,
    /// A pass could not be stored: half a line may stand at the end, and nothing may follow it.
    failed: bool,
    new: Made,
}

impl Identity {
    /// What of it another run has otherwise.
    pub(crate) fn other_than(&self, before: &Identity) -> Vec<&'static str> {
        let parts = [
            ("setup", before.setup_sha256 == self.setup_sha256),
            ("plan", before.plan_sha256 == self.plan_sha256),
            ("seed", before.seed == self.seed),
            ("model", before.model == self.model),
            ("set of defects", before.defects_sha256 == self.defects_sha256),
        ];
        parts.into_iter().filter(|(_, same)| !same).map(|(name, _)| name).collect()
    }
}

/// What brings files of a run's folder back that were lost.
pub const RUN_AGAIN: &str = "repeat the command of the run with the same --out: it writes summary.json again, \
                             rig.toml where it is missing, and the passes of passes.jsonl that points.csv lacks";

/// Setup and plan of a run: the file that makes a folder a run's.
pub const IDENTITY: &str = "run.toml";
const POINTS: &str = "points.csv";
/// The journal in a run's folder: a line a pass, safe on the disk before the next one begins.
pub const JOURNAL: &str = "passes.jsonl";
const SESSIONS: &str = "sessions.jsonl";
/// The file that says how a run ended; there is none from a session's beginning to its end.
pub const SUMMARY: &str = "summary.json";

impl RunDir {
    /// Makes a new folder, or takes up one that an earlier session of the same plan, setup, seed and model
    /// left.
    ///
    /// # Errors
    /// A folder of another run, or one that a living process holds. Nothing is left behind then, nor where
    /// this is dropped before [`RunDir::begin`].
    pub fn open(path: &Path, identity: &Identity) -> miette::Result<Self> {
        let shown = path.display();
        let mut before_notes = Notes::default();
        if path.join(IDENTITY).exists() {
            let before = identity_in(path)?;
            let other = identity.other_than(&before);
            miette::ensure!(
                other.is_empty(),
                help = "give another --out, or the same plan, setup, seed, model and defects to go on with it; the files \
                        that plan and setup name (tip, certificates, profiles, target) belong to them",
                "{shown} holds a run with another {}",
                other.join(" and ")
            );
            if fs::metadata(path.join(JOURNAL)).is_ok_and(|journal| journal.len() > 0) {
                identity.notes.agree_with(&before.notes, path)?;
            }
            before_notes = before.notes;
        } else if path.exists() && holds_something(path)? {
            miette::bail!(
                help = "give an empty or new folder as --out",
                "{shown} is not empty and holds no run"
            );
        }
        let mut new = Made(files::make_folder(path)?);
        let lock_file = path.join(lock::NAME);
        if !lock_file.exists() {
            new.0.push(lock_file.clone());
        }
        let lock = claim(&lock_file)?;
        let notes = identity.notes.clone().or(&before_notes);
        Self::open_locked(path, Identity { notes, ..identity.clone() }, lock, new)
    }

    fn open_locked(path: &Path, identity: Identity, lock: File, mut new: Made) -> miette::Result<Self> {
        let mut header = Vec::new();
        pass::write_passes(&[], &mut header).into_diagnostic()?;
        let text = toml::to_string(&identity).into_diagnostic()?;
        // The journal before the table: where there is a table, there is a journal.
        for (name, bytes) in [(IDENTITY, text.as_bytes()), (JOURNAL, b""), (POINTS, &header)] {
            let file = path.join(name);
            if !file.exists() {
                new.0.push(file.clone());
                write_plain(&file, bytes)?;
            }
        }
        let sessions = sessions_in(path)?;
        let open = |name: &str| {
            let file = GuardedFile::open(&path.join(name), OpenOptions::new().read(true).append(true))?;
            let bytes = fs::read(path.join(name)).into_diagnostic().wrap_err_with(|| name.to_string())?;
            Ok::<_, miette::Report>((file, bytes))
        };
        let (mut points, mut table) = open(POINTS)?;
        if table.len() < header.len() && header.starts_with(&table) {
            points.file().write_all(&header[table.len()..]).into_diagnostic().wrap_err(POINTS)?;
            table.clone_from(&header);
        }
        if !table.starts_with(&header) {
            miette::bail!(
                help = "give another --out: this table can be read, but not gone on with",
                "{}: the columns of {POINTS} are those of another version",
                path.display()
            );
        }
        let (mut made, whole) = whole_table(&table).wrap_err("points.csv of an earlier session")?;
        cut_torn(&mut points, whole, table.len(), POINTS)?;
        let (mut journal, lines) = open(JOURNAL)?;
        let (passes, whole) = whole_passes(&lines).wrap_err(JOURNAL)?;
        cut_torn(&mut journal, whole, lines.len(), JOURNAL)?;
        journal::restore(path, &mut points, &mut made, passes)?;
        let path = path.to_path_buf();
        let (planned, failed) = (None, false);
        Ok(RunDir { path, points, journal, _lock: lock, made, sessions, planned, identity, failed, new })
    }

    /// Keeps the folder, whatever comes.
    pub fn stay(&mut self) {
        self.new.0.clear();
    }

    /// Plans the session that comes now. In wall-clock time the run's time continues from the start of its
    /// first session. In virtual time (`fast`) it continues `pass_s` after the last pass's `time_s`.
    pub fn plan_session(&mut self, now_unix_ns: u64, pass_s: f64, fast: bool) -> Session {
        let session = 1 + self.sessions.iter().map(|s| s.session).max().unwrap_or(0);
        // A clock that was set back meanwhile does not put a pass before one that was made.
        let measured = self.made.iter().map(|p| p.time_s + pass_s).fold(0.0, f64::max);
        let passed = self.sessions.first().map_or(0, |first| now_unix_ns.saturating_sub(first.start_unix_ns));
        let start_s = if fast { measured } else { measured.max(passed as f64 * 1e-9) };
        let session = Session { session, start_unix_ns: now_unix_ns, start_s };
        self.planned = Some(session);
        session
    }

    /// Begins the session that was planned: from here on the folder stays, whatever comes.
    pub fn begin(&mut self) -> miette::Result<()> {
        self.sessions.extend(self.planned.take());
        let mut text = Vec::new();
        for session in &self.sessions {
            serde_json::to_writer(&mut text, session).into_diagnostic()?;
            text.push(b'\n');
        }
        self.stay();
        // How an earlier session ended is no longer how the run ended. The next file makes the removal safe.
        let summary = self.path.join(SUMMARY);
        if summary.symlink_metadata().is_ok() {
            fs::remove_file(&summary).into_diagnostic().wrap_err(SUMMARY)?;
        }
        // What this session says of itself goes beside what the run is of.
        let identity = toml::to_string(&self.identity).into_diagnostic()?;
        write_plain(&self.path.join(IDENTITY), identity.as_bytes())?;
        write_plain(&self.path.join(SESSIONS), &text)
    }

    /// Who runs it, and on what: as this session says, else as an earlier one did.
    pub fn notes(&self) -> &Notes {
        &self.identity.notes
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

    /// The record file of the session that has begun.
    pub fn new_record(&self) -> miette::Result<GuardedFile> {
        let number = self.sessions.last().map_or(1, |s| s.session);
        let path = self.path.join(format!("run-{number}.mcap"));
        GuardedFile::open(&path, OpenOptions::new().create_new(true).read(true).write(true))
    }

    /// Puts a pass into the point table and the journal, synced: after this it is never lost.
    ///
    /// # Errors
    /// Whatever the file system says, or a file that was removed meanwhile; the sweep must stop then.
    pub fn keep(&mut self, measured: &MeasuredPass) -> miette::Result<()> {
        if self.failed {
            miette::bail!("point {} is not stored: an earlier pass could not be", measured.pass.point);
        }
        let appended = self.append(measured);
        self.failed = appended.is_err();
        appended
    }

    fn append(&mut self, measured: &MeasuredPass) -> miette::Result<()> {
        let row = journal::rows_of(std::slice::from_ref(&measured.pass))?;
        let mut line = serde_json::to_vec(measured).into_diagnostic()?;
        line.push(b'\n');
        // The journal first: a pass that is in the table is in the journal too.
        self.journal.write_all(&line).into_diagnostic().wrap_err(JOURNAL)?;
        self.journal.sync()?;
        self.points.write_all(&row).into_diagnostic().wrap_err(POINTS)?;
        self.points.sync()
    }

    /// Writes a file of the run whole or not at all.
    pub fn write(&self, name: &str, bytes: &[u8]) -> miette::Result<()> {
        write_plain(&self.path.join(name), bytes)
    }
}

/// A reader of one topic of a record file.
pub(crate) fn open_record(path: &Path, topic: &'static str) -> miette::Result<Reader<BufReader<File>>> {
    let file = File::open(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    Ok(Reader::new(BufReader::new(file)).only(topic))
}

/// The record files of a run's folder, oldest first.
pub fn records_in(path: &Path) -> miette::Result<Vec<PathBuf>> {
    let entries = fs::read_dir(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let mut found: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(|p| is_record(p)).collect();
    found.sort_by_key(|p| (p.as_os_str().len(), p.clone()));
    Ok(found)
}

/// Whether it is named as a session's record: `run-NUMBER.mcap`. What else ends so was exported into the
/// folder.
pub(crate) fn is_record(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    let number = name.strip_prefix("run-").and_then(|rest| rest.strip_suffix(".mcap"));
    number.is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

/// What the run in a folder is of.
pub fn identity_in(path: &Path) -> miette::Result<Identity> {
    let file = path.join(IDENTITY);
    toml::from_str(&crate::input::text_of(&file)?).map_err(|e| miette::miette!("{}: {e}", file.display()))
}

/// Whether a session of a run has begun in a folder.
pub fn has_begun(path: &Path) -> bool {
    path.join(SESSIONS).exists()
}

/// The sessions of a run's folder, oldest first; none where the first has not begun.
pub fn sessions_in(path: &Path) -> miette::Result<Vec<Session>> {
    let file = path.join(SESSIONS);
    if !file.exists() {
        return Ok(Vec::new());
    }
    let read = |(i, line): (usize, &str)| {
        serde_json::from_str(line).map_err(|e| miette::miette!("{}: line {}: {e}", file.display(), i + 1))
    };
    crate::input::text_of(&file)?.lines().enumerate().map(read).collect()
}

/// When a run's first session began, by the wall clock, UTC.
pub fn began(path: &Path) -> miette::Result<Option<String>> {
    let first = sessions_in(path)?.first().map(|first| (first.start_unix_ns / 1_000_000_000) as i64);
    Ok(first.map(calibration::certificate::date::format))
}

/// A power cut may leave part of a line at the end: it was never acknowledged and is cut off.
fn cut_torn(file: &mut GuardedFile, whole: usize, length: usize, name: &str) -> miette::Result<()> {
    if whole == length {
        return Ok(());
    }
    tracing::warn!("{name}: the last line is torn and is left out; its pass was not acknowledged");
    let file = file.file();
    file.set_len(whole as u64)
        .and_then(|()| file.sync_all())
        .into_diagnostic()
        .wrap_err_with(|| name.to_string())
}

/// Whether a folder holds more than what a session leaves that died before it wrote its identity.
fn holds_something(path: &Path) -> miette::Result<bool> {
    let part = files::beside(Path::new(IDENTITY));
    for entry in fs::read_dir(path).into_diagnostic()? {
        let name = entry.into_diagnostic()?.file_name();
        if name != lock::NAME && name != part.as_os_str() {
            return Ok(true);
        }
    }
    Ok(false)
}
