//! The ledger of a human finger's exposure: what was vibrated in earlier runs counts in the next one.
//!
//! It is stored where files survive a restart (`/var/tmp`), for each identity of the amplifier
//! ([`drivers::identity::every`]) and for the person, where one is named; the worst of them holds. Each user
//! has a file of each, which no other user can write: what several users drove is added up. It is written
//! while the run goes, once a second. It is always ahead of the truth: each entry includes [`AHEAD`] of
//! driving at the setup's strongest, and the entry of an orderly end takes that back. So a killed program
//! loses nothing; it is charged too much, by [`AHEAD`] at most. A file has two places that are written in
//! turn, each with its check sum: a power cut can tear only one. A run locks its files: of two runs that
//! vibrate one person at a time, each would know of half.
//!
//! Time is that of the machine since it was started, in its sleep as well: no wall clock that somebody sets makes an hour short.
//! After a restart of the machine only the time since then is known to be over, and only that counts as rest.
#![allow(clippy::disallowed_methods, reason = "a ledger is written beside the loop, while the run goes")]

use miette::WrapErr;
use realtime::pacing::Lifeline;
use realtime::safety::{Exposed, Limits, MINUTE_NS, MINUTES, PART_MINUTES, PARTS};
use realtime::{Nanos, threads};
use runs::Setup;
use runs::exposure_left::{Left, in_the_last_hour};
use runs::job::Notes;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

const FOLDER: &str = "/var/tmp";
/// How far an entry is ahead of what was driven: what a program that is killed is charged too much.
pub const AHEAD: Duration = Duration::from_secs(4);
/// How often an entry is written.
const WRITE_EVERY: Duration = Duration::from_secs(1);
/// An entry that is older than this does not cover what is driven until the next one any more.
const HOLDS_FOR: Duration = Duration::from_secs(3);
const PLACE: usize = 8192;

/// What a place holds.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Account {
    /// Counts entries: the newest that can be read is the ledger.
    number: u64,
    /// What or whom it is of: one identity of the amplifier, or the person.
    amplifier: String,
    /// Which start of the machine the times below belong to.
    boot: String,
    /// Time since that start in ns up to which the entry holds.
    until_ns: u64,
    /// Time driven since the last rest of full length, and time rested since, in ns.
    in_one_go_ns: u64,
    resting_ns: u64,
    /// Minutes since that start (before it: below zero), each with the time driven in ns and the dose in m2/s.
    minutes: BTreeMap<i64, (u64, f64)>,
}

impl Account {
    /// Adds what was driven since the last time, all of it in the newest minute, or what was rested.
    fn add(&mut self, driven_ns: u64, dose_m2_s: f64, rest: Nanos, now_ns: u64) {
        if driven_ns > 0 {
            self.resting_ns = 0;
            self.in_one_go_ns = self.in_one_go_ns.saturating_add(driven_ns);
            let minute = self.minutes.entry((now_ns / MINUTE_NS) as i64).or_default();
            *minute = (minute.0.saturating_add(driven_ns), minute.1 + dose_m2_s);
        } else {
            self.resting_ns = self.resting_ns.saturating_add(now_ns.saturating_sub(self.until_ns));
            if self.resting_ns >= rest.0 {
                self.in_one_go_ns = 0;
            }
        }
        self.until_ns = self.until_ns.max(now_ns);
        let oldest = (now_ns / MINUTE_NS) as i64 - MINUTES as i64;
        self.minutes.retain(|number, _| *number > oldest);
    }

    /// The same, in the times of this start of the machine. All earlier starts were before it.
    fn moved_to(mut self, boot: &str) -> Self {
        if self.boot != boot {
            let end = self.until_ns.div_ceil(MINUTE_NS) as i64;
            self.minutes = self.minutes.into_iter().map(|(number, held)| (number - end, held)).collect();
            (self.boot, self.until_ns) = (boot.to_string(), 0);
        }
        self
    }

    /// What the loop takes over.
    fn exposed(&self, now_ns: u64) -> Exposed {
        let now = (now_ns / MINUTE_NS) as i64;
        let mut parts = [(Nanos(0), 0.0); PARTS];
        for (number, (driven_ns, dose_m2_s)) in &self.minutes {
            let part = (now - number).max(0) as usize / PART_MINUTES;
            if let Some((driven, dose)) = parts.get_mut(part) {
                *driven = driven.plus(Nanos(*driven_ns));
                *dose += dose_m2_s;
            }
        }
        Exposed { in_one_go: Nanos(self.in_one_go_ns), resting: Nanos(self.resting_ns), parts }
    }
}

/// The machine's own time: which start of it this is, and ns since then.
fn machine_time() -> io::Result<(String, u64)> {
    let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id")?;
    let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: `t` is a valid timespec for the kernel to write.
    if unsafe { libc::clock_gettime(libc::CLOCK_BOOTTIME, &mut t) } != 0 {
        return Err(io::Error::last_os_error());
    }
    Ok((boot.trim().to_string(), t.tv_sec as u64 * 1_000_000_000 + t.tv_nsec as u64))
}

/// What one user's file holds of one identity, open for writing.
struct Book {
    file: File,
    path: PathBuf,
    entry: Account,
    /// What other users' files hold of the same, with their locks.
    others: Vec<(File, Account)>,
}

/// The ledger of a run: a book for each identity of its amplifier, and one for its person.
pub struct Ledger {
    books: Vec<Book>,
    rest: Nanos,
    /// Strongest squared rms velocity that the limits allow, in m2/s2.
    strongest_m2_s2: f64,
}

impl Ledger {
    /// Opens the ledger of a setup's amplifier and of the person (the subject, else the operator), where a
    /// human finger is in the rig: what cannot be read, or cannot be written, refuses the finger. `None`
    /// without a finger, and for an amplifier inside this program, which vibrates nobody.
    ///
    /// # Errors
    /// The reason.
    pub fn open(setup: &Setup, notes: &Notes) -> miette::Result<Option<Self>> {
        let limits = &setup.config.limits;
        if !limits.human_contact {
            return Ok(None);
        }
        let known =
            drivers::identity::every(&setup.instruments().amplifier).map_err(|e| miette::miette!("{e}"))?;
        let person =
            notes.subject.as_ref().or(notes.operator.as_ref()).map(|name| format!("person/{}", name.trim()));
        let amplifier = !known.is_empty();
        let known: Vec<String> = known.into_iter().chain(person).collect();
        amplifier.then(|| Self::open_in(Path::new(FOLDER), &known, limits)).transpose()
    }

    fn open_in(folder: &Path, known: &[String], limits: &Limits) -> miette::Result<Self> {
        let strongest = std::f64::consts::FRAC_1_SQRT_2
            * std::f64::consts::PI
            * limits.amplitude_max.metres()
            * limits.frequency_hz.1;
        let rest = Nanos::from_seconds(limits.exposure_rest_s);
        let open = |of: &String| {
            let why = "no human finger: what it was exposed to in the last hour is not known";
            Book::open(folder, of, rest).wrap_err_with(|| format!("{why} ({})", folder.display()))
        };
        let books = known.iter().map(open).collect::<miette::Result<Vec<_>>>()?;
        // Before anything is written: a refusal charges nobody.
        books.iter().try_for_each(|book| book.has_time_left(limits))?;
        let mut ledger = Ledger { books, rest, strongest_m2_s2: strongest * strongest };
        let (_, now_ns) = machine_time().map_err(|e| miette::miette!("this machine tells no time: {e}"))?;
        let help = "give this user the right to write it";
        let written = ledger.write_ahead(now_ns);
        written.map_err(|e| miette::miette!(help = help, "the ledger cannot be written: {e}"))?;
        Ok(ledger)
    }

    /// What the loop takes over from earlier runs: in each part the worst of all books.
    pub fn exposed(&self) -> Exposed {
        let worst = |a, b| joined(a, b, Nanos::max, f64::max);
        self.books.iter().map(Book::exposed).reduce(worst).unwrap_or_default()
    }

    /// Adds what was driven since the last time to every book.
    fn add(&mut self, driven_ns: u64, dose_m2_s: f64, now_ns: u64) {
        let rest = self.rest;
        self.books.iter_mut().for_each(|book| book.entry.add(driven_ns, dose_m2_s, rest, now_ns));
    }

    /// Writes entries that are ahead of what was driven.
    fn write_ahead(&mut self, now_ns: u64) -> io::Result<()> {
        let ahead = AHEAD.as_nanos() as u64;
        let dose = self.strongest_m2_s2 * AHEAD.as_secs_f64();
        for book in &mut self.books {
            let mut entry = book.entry.clone();
            entry.add(ahead, dose, self.rest, now_ns.saturating_add(ahead));
            book.write(entry)?;
        }
        Ok(())
    }

    /// Writes entries of what was driven, and no more.
    fn write(&mut self) -> io::Result<()> {
        self.books.iter_mut().try_for_each(|book| book.write(book.entry.clone()))
    }

    /// Keeps the ledger on a thread of its own while the loop behind `life` drives, until the answer ends.
    /// `stop` stops the rig when an entry could not be written.
    ///
    /// # Errors
    /// No thread can be had.
    pub fn keep(self, life: Arc<Lifeline>, stop: impl Fn() + Send + 'static) -> io::Result<Keeping> {
        let (end, ended) = channel::<bool>();
        let state = Arc::new(State::default());
        state.written_ns.store(machine_time()?.1, Ordering::Relaxed);
        let shown = Arc::clone(&state);
        let session = tracing::Span::current();
        let keep = move || {
            let _session = session.enter();
            let mut ledger = self;
            let mut before = (0, 0.0);
            loop {
                let last = match ended.recv_timeout(WRITE_EVERY) {
                    Err(RecvTimeoutError::Timeout) => None,
                    Ok(off) => Some(off),
                    Err(RecvTimeoutError::Disconnected) => Some(false),
                };
                let written = machine_time().and_then(|(_, now_ns)| {
                    let (Nanos(driven), dose) = life.driven();
                    ledger.add(driven.saturating_sub(before.0), (dose - before.1).max(0.0), now_ns);
                    before = (driven, dose);
                    match last {
                        // It was read back off: nothing more was driven.
                        Some(true) => ledger.write(),
                        _ => ledger.write_ahead(now_ns),
                    }
                    .map(|()| now_ns)
                });
                match written {
                    Ok(now_ns) => shown.written_ns.store(now_ns, Ordering::Relaxed),
                    Err(why) => {
                        tracing::error!(%why, "the exposure of the finger cannot be saved: the rig is stopped");
                        shown.failed.store(true, Ordering::Relaxed);
                        stop();
                    }
                }
                if last.is_some() || shown.failed.load(Ordering::Relaxed) {
                    return;
                }
            }
        };
        let thread = threads::spawn("exposure", keep)?;
        Ok(Keeping { state, end, thread: Some(thread) })
    }
}

/// Two exposures as one, part by part: their times and doses as these join them.
fn joined(a: Exposed, b: Exposed, times: fn(Nanos, Nanos) -> Nanos, doses: fn(f64, f64) -> f64) -> Exposed {
    let part = |at: usize| (times(a.parts[at].0, b.parts[at].0), doses(a.parts[at].1, b.parts[at].1));
    let (in_one_go, resting) = (times(a.in_one_go, b.in_one_go), rested(&a, &b));
    Exposed { in_one_go, resting, parts: std::array::from_fn(part) }
}

/// Time rested since the later of two goes; where one of them drove nothing, since the other.
fn rested(a: &Exposed, b: &Exposed) -> Nanos {
    match (a.in_one_go.0, b.in_one_go.0) {
        (0, _) => b.resting,
        (_, 0) => a.resting,
        _ => a.resting.min(b.resting),
    }
}

impl Book {
    /// Opens this user's file of one identity, and reads those of others.
    fn open(folder: &Path, of: &str, rest: Nanos) -> miette::Result<Self> {
        if !crate::rig_lock::is_shared(folder) {
            miette::bail!(
                help = "make it one that all may write to, with the sticky bit (mode 1777)",
                "the folder of the ledger cannot be trusted"
            );
        }
        let (boot, now_ns) =
            machine_time().map_err(|e| miette::miette!("this machine tells no time: {e}"))?;
        let stem = format!("muprime-{}-", &calibration::certificate::sha256_hex(of.as_bytes())[..16]);
        let user = rustix::process::geteuid().as_raw();
        let path = folder.join(format!("{stem}{user}.exposure"));
        let file = open_owned(&path, user, true).map_err(|e| {
            miette::miette!(help = "see what it is, and remove it", "{}: {e}", path.display())
        })?;
        let none =
            || Account { amplifier: of.into(), boot: boot.clone(), until_ns: now_ns, ..Account::default() };
        let found = |file: &File, path: &Path| {
            file.try_lock().map_err(|e| match e {
                TryLockError::WouldBlock => miette::miette!(
                    help = "wait until that run ends; a name stands for one person, and one person is at one rig",
                    "'{}' is in another run on this machine",
                    of.trim_start_matches("person/")
                ),
                TryLockError::Error(e) => miette::miette!("{}: {e}", path.display()),
            })?;
            let entry = newest(file, of).wrap_err_with(|| path.display().to_string())?;
            let mut entry = entry.map_or_else(none, |entry| entry.moved_to(&boot));
            entry.add(0, 0.0, rest, now_ns);
            Ok::<_, miette::Report>(entry)
        };
        let entry = found(&file, &path)?;
        let mut others = Vec::new();
        let all = std::fs::read_dir(folder).map_err(|e| miette::miette!("{}: {e}", folder.display()))?;
        for one in all.flatten() {
            let name = one.file_name().to_string_lossy().into_owned();
            let owner =
                name.strip_prefix(&stem).and_then(|rest| rest.strip_suffix(".exposure")?.parse().ok());
            if let Some(owner) = owner.filter(|owner: &u32| *owner != user) {
                let path = one.path();
                let file = open_owned(&path, owner, false)
                    .map_err(|e| miette::miette!("{}: {e}", path.display()))?;
                let entry = found(&file, &path)?;
                others.push((file, entry));
            }
        }
        Ok(Book { file, path, entry, others })
    }

    /// What all users drove.
    fn exposed(&self) -> Exposed {
        let now_ns = self.entry.until_ns;
        let others = self.others.iter().map(|(_, entry)| entry.exposed(now_ns));
        let sum = |sum, other| joined(sum, other, Nanos::plus, |sum, dose| sum + dose);
        others.fold(self.entry.exposed(now_ns), sum)
    }

    /// Refuses a finger whose hour is used up: the rig would never be armed (SR-39, SR-40).
    fn has_time_left(&self, limits: &Limits) -> miette::Result<()> {
        let exposed = self.exposed();
        let (left, (driven_s, dose)) = (Left::of(limits, &exposed), in_the_last_hour(&exposed));
        miette::ensure!(
            left.hour_s > 0.0 && left.dose_m2_s > 0.0,
            help = "wait until enough of it is more than an hour ago; the amplifier counts for all subjects",
            "no human finger: '{}' was driven for {driven_s:.0} s of the last hour with a dose of {dose:.1} m2/s; \
             {:.0} s and {:.1} m2/s are allowed",
            self.entry.amplifier.trim_start_matches("person/"),
            3600.0 * limits.exposure_duty_max,
            limits.exposure_dose_max_m2_s
        );
        Ok(())
    }

    fn write(&mut self, mut entry: Account) -> io::Result<()> {
        // Somebody who removed the file would make the next run start from nothing.
        if std::fs::symlink_metadata(&self.path).map(|m| inode(&m))? != inode(&self.file.metadata()?) {
            return Err(io::Error::other("the file was replaced"));
        }
        self.entry.number += 1;
        entry.number = self.entry.number;
        let text = serde_json::to_string(&entry)?;
        let mut place =
            format!("{} {text}", calibration::certificate::sha256_hex(text.as_bytes())).into_bytes();
        if place.len() > PLACE {
            return Err(io::Error::other("the entry is too long"));
        }
        place.resize(PLACE, b' ');
        self.file.write_all_at(&place, (entry.number % 2) * PLACE as u64)?;
        self.file.sync_data()
    }
}

/// The newest entry of a file that is of this identity; none where nothing was ever written.
fn newest(file: &File, of: &str) -> miette::Result<Option<Account>> {
    let length = file.metadata().map_err(|e| miette::miette!("{e}"))?.len();
    let places = [0, 1].map(|place| read_place(file, place).filter(|e| e.amplifier == of));
    let newest = places.into_iter().flatten().max_by_key(|entry| entry.number);
    if newest.is_none() && length > 0 {
        miette::bail!(help = "rest for an hour, then remove the file", "the ledger is damaged");
    }
    Ok(newest)
}

/// Opens a plain file that only its owner can write, and makes this user's own where there is none. Nothing is followed.
fn open_owned(path: &Path, owner: u32, own: bool) -> io::Result<File> {
    let mut options = OpenOptions::new();
    options.read(true).write(own).custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK);
    let file = match options.open(path) {
        Err(e) if own && e.kind() == io::ErrorKind::NotFound => {
            let file = options.create_new(true).mode(0o644).open(path)?;
            // Whatever the mask of this user: the next one must know of it.
            file.set_permissions(Permissions::from_mode(0o644))?;
            Ok(file)
        }
        opened => opened,
    }?;
    let found = file.metadata()?;
    let plain = found.is_file() && found.nlink() == 1 && found.uid() == owner && found.mode() & 0o022 == 0;
    let other = "it is not a plain file that its owner alone can write";
    if plain { Ok(file) } else { Err(io::Error::other(other)) }
}

/// What the thread that keeps a ledger shows of itself.
#[derive(Default)]
struct State {
    failed: AtomicBool,
    written_ns: AtomicU64,
}

/// A ledger in use.
pub struct Keeping {
    state: Arc<State>,
    end: Sender<bool>,
    thread: Option<JoinHandle<()>>,
}

impl Keeping {
    /// Whether the newest entry still covers what is driven now.
    pub fn holds(&self) -> bool {
        let age = |now: u64| now.saturating_sub(self.state.written_ns.load(Ordering::Relaxed));
        let fresh = machine_time().is_ok_and(|(_, now)| age(now) < HOLDS_FOR.as_nanos() as u64);
        fresh && !self.state.failed.load(Ordering::Relaxed)
    }

    /// The run is over. Where the drive was read back off, the last entry holds what was driven and no more.
    pub fn end(mut self, read_back_off: bool) {
        let _ = self.end.send(read_back_off);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn inode(metadata: &std::fs::Metadata) -> (u64, u64) {
    (metadata.dev(), metadata.ino())
}

/// The entry of a place, if all of it is there.
fn read_place(file: &File, place: u64) -> Option<Account> {
    let mut bytes = vec![0; PLACE];
    file.read_exact_at(&mut bytes, place * PLACE as u64).ok()?;
    let text = String::from_utf8(bytes).ok()?;
    let (sum, text) = text.trim_end().split_once(' ')?;
    (calibration::certificate::sha256_hex(text.as_bytes()) == sum).then(|| serde_json::from_str(text).ok())?
}

#[cfg(test)]
mod tests;
