//! One controller a rig: a lock for each of its instruments, taken before anything is opened.
//!
//! The claim is of the instruments, not of a spelling of their addresses ([`drivers::identity`]), and it
//! holds on this machine: for all its users, whatever their environment says. A controller on another machine
//! is noticed otherwise: the amplifier then shows set-points that nobody here commanded, and the loop trips.

use miette::WrapErr;
use runs::Setup;
use runs::files::open_plain;
use std::fs::{File, OpenOptions, Permissions, TryLockError};
use std::io::{self, Read, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Folders that every user of a machine may write to, and in which nobody can replace another's file. The
/// first that is so is taken, by every user.
const FOLDERS: [&str; 3] = ["/run/lock", "/dev/shm", "/tmp"];
/// World-writable and sticky.
const SHARED: u32 = 0o1777;

/// The locks of a rig's instruments, held as long as this lives: the system frees them with the process, whatever ends it.
pub struct RigLock {
    _locks: Vec<File>,
}

impl RigLock {
    /// Takes all instruments of a setup.
    ///
    /// # Errors
    /// Another process has one of them, or an address stands for nothing.
    pub fn take(setup: &Setup) -> miette::Result<Self> {
        let instruments = setup.instruments();
        let identities = drivers::identity::identities(&instruments).map_err(|e| miette::miette!("{e}"))?;
        let folder = folder()?;
        let take = |identity: &String| {
            take(&folder, identity)
                .wrap_err_with(|| format!("the instrument at {identity} cannot be claimed"))
        };
        Ok(RigLock { _locks: identities.iter().map(take).collect::<miette::Result<_>>()? })
    }
}

/// Whether every user may write to a folder, and none replace another's file in it.
pub(crate) fn is_shared(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|m| m.is_dir() && m.permissions().mode() & 0o7777 == SHARED)
}

/// The folder of the locks on this machine.
fn folder() -> miette::Result<PathBuf> {
    let mut folders = FOLDERS.iter().map(PathBuf::from);
    folders.find(|path| is_shared(path)).ok_or_else(|| {
        miette::miette!(
            help = "one of them must be a folder that all may write to, with the sticky bit (mode 1777)",
            "there is no place for the rig's lock: none of {} serves",
            FOLDERS.join(", ")
        )
    })
}

/// Takes the lock of one instrument.
fn take(folder: &Path, identity: &str) -> miette::Result<File> {
    let name = &calibration::certificate::sha256_hex(identity.as_bytes())[..16];
    let path = folder.join(format!("muprime-{name}.lock"));
    let wrong = |e: io::Error| {
        miette::miette!(help = "see what it is, and remove it", "the lock {}: {e}", path.display())
    };
    let mut file = open_shared(&path).map_err(wrong)?;
    match file.try_lock() {
        Ok(()) => {
            // Who holds it, for whoever is refused. Another user's file may not be writable: the lock holds all the same.
            let _ = file.set_len(0).and_then(|()| write!(file, "{}", std::process::id()));
            Ok(file)
        }
        Err(TryLockError::WouldBlock) => {
            let mut holder = String::new();
            let _ = file.take(20).read_to_string(&mut holder);
            let holder: String = holder.chars().filter(char::is_ascii_digit).collect();
            Err(miette::miette!(
                help = "wait until it ends, or end it",
                "another muprime (process {holder}) holds this rig"
            ))
        }
        Err(TryLockError::Error(e)) => Err(wrong(e)),
    }
}

/// Opens a file that every user can open, and makes it where there is none. Nothing is followed, and nothing
/// but a plain file is taken. Another user's may be open for reading only.
pub(crate) fn open_shared(path: &Path) -> io::Result<File> {
    // Never with O_CREAT where the file exists: in a sticky folder kernels refuse that for another user's file.
    let open = |write, new| open_plain(path, OpenOptions::new().read(true).write(write).create_new(new));
    match open(true, false) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => match open(true, true) {
            Ok(file) => {
                // Whatever the mask of this user: the next one must see who holds it.
                file.set_permissions(Permissions::from_mode(0o666))?;
                Ok(file)
            }
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => open(true, false),
            Err(e) => Err(e),
        },
        Err(e) if e.kind() == io::ErrorKind::PermissionDenied => open(false, false),
        opened => opened,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_by_one_and_freed_with_it() {
        let folder = tempfile();
        let first = take(&folder, "tcp/x").unwrap();
        let refused = take(&folder, "tcp/x").unwrap_err().to_string();
        assert!(refused.contains(&std::process::id().to_string()), "{refused}");
        take(&folder, "tcp/y").unwrap();
        drop(first);
        take(&folder, "tcp/x").unwrap();
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn every_user_can_lock_what_another_made() {
        let folder = tempfile();
        drop(take(&folder, "tcp/x").unwrap());
        let file = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap();
        assert_eq!(file.metadata().unwrap().permissions().mode() & 0o777, 0o666);
        // One that an earlier program left for its own user only is locked without being written.
        std::fs::set_permissions(file.path(), Permissions::from_mode(0o444)).unwrap();
        drop(take(&folder, "tcp/x").unwrap());
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_planted_link_is_not_followed() {
        let folder = tempfile();
        drop(take(&folder, "tcp/x").unwrap());
        let lock = std::fs::read_dir(&folder).unwrap().next().unwrap().unwrap().path();
        let victim = folder.join("victim");
        std::fs::write(&victim, "precious").unwrap();
        for plant in [std::os::unix::fs::symlink::<&Path, &Path>, |from: &Path, to: &Path| {
            std::fs::hard_link(from, to)
        }] {
            std::fs::remove_file(&lock).unwrap();
            plant(&victim, &lock).unwrap();
            assert!(take(&folder, "tcp/x").is_err());
            assert_eq!(std::fs::read_to_string(&victim).unwrap(), "precious");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    fn tempfile() -> PathBuf {
        static NUMBER: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("muprime-claim-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        path
    }
}
