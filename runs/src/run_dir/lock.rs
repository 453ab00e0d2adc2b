//! The lock of a run's folder, and of whatever else only one process may hold.

use crate::files::open_plain;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::Path;

/// Name of the lock in a run's folder.
pub const NAME: &str = ".lock";

/// Takes a lock: the file stays, named after its present holder, and is locked as long as the answer lives.
///
/// # Errors
/// A living process holds it, or the file system refuses.
pub fn claim(lock: &Path) -> miette::Result<File> {
    let shown = lock.display();
    let wrong = |e: std::io::Error| miette::miette!("{shown}: {e}");
    let mut options = OpenOptions::new();
    options.create(true).read(true).write(true).truncate(false);
    let mut file = open_plain(lock, &mut options).map_err(wrong)?;
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
    let Ok(file) = open_plain(&run.join(NAME), OpenOptions::new().read(true)) else { return false };
    matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock))
}

/// The process of this machine that has the lock of a run's folder open; `None` where it is of another machine, or of a user whose
/// processes cannot be seen. A number that is written in the lock alone could be that of any process by now.
pub fn holder(run: &Path) -> Option<u32> {
    let lock = run.join(NAME);
    let process: u32 = fs::read_to_string(&lock).ok()?.trim().parse().ok()?;
    let whole = lock.canonicalize().ok()?;
    let open = fs::read_dir(format!("/proc/{}/fd", process)).ok()?;
    let has = open.flatten().any(|entry| fs::read_link(entry.path()).is_ok_and(|file| file == whole));
    (has && is_held(run)).then_some(process)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_that_is_a_link_is_refused_and_what_it_leads_to_stays() {
        let folder = tempfile::tempdir().unwrap();
        let (victim, lock) = (folder.path().join("victim"), folder.path().join(NAME));
        fs::write(&victim, "precious").unwrap();
        std::os::unix::fs::symlink(&victim, &lock).unwrap();
        assert!(claim(&lock).is_err());
        fs::remove_file(&lock).unwrap();
        fs::hard_link(&victim, &lock).unwrap();
        assert!(claim(&lock).is_err());
        assert_eq!(fs::read_to_string(&victim).unwrap(), "precious");
    }

    #[test]
    fn the_holder_is_who_has_the_lock_open_and_nobody_else() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(holder(folder.path()), None);
        let lock = folder.path().join(NAME);
        let claimed = claim(&lock).unwrap();
        assert_eq!(holder(folder.path()), Some(std::process::id()));
        // As a lock on a shared folder: the number is that of a process here, which has nothing to do with it.
        fs::write(&lock, "1").unwrap();
        assert_eq!(holder(folder.path()), None);
        drop(claimed);
        fs::write(&lock, std::process::id().to_string()).unwrap();
        assert_eq!(holder(folder.path()), None, "it was released");
    }
}
