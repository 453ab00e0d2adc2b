//! The lock of a run's folder, and of whatever else only one process may hold.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::Path;

/// Name of the lock in a run's folder.
pub(super) const NAME: &str = ".lock";

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
    let Ok(file) = File::open(run.join(NAME)) else { return false };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}
