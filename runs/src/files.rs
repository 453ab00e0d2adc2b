//! Files that outlive a power cut: written beside their place, synced, moved there, and their folder synced,
//! because a name too is only safe once its folder is (POSIX `fsync`; ext4, XFS and Btrfs give more, none
//! promises it). Errors are those of the file system, with the file's name, where no others are stated.

mod outputs;

use miette::{Context, IntoDiagnostic};
pub use outputs::{FLAT_MCAP, GATHERED, MODEL, NEXT_PLAN, PAGE, PREDICTIONS, replaceable, write_output};
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// What the name of a file ends with while it is being written.
pub const PART: &str = ".new";

/// Where a file is written before it is moved to its place.
pub fn beside(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(PART);
    PathBuf::from(name)
}

/// Opens a file in a folder that others may write to: no link is followed, nothing waits, and nothing is taken but a plain file that has
/// no other name. `options` must not truncate: what a link leads to would be empty before anybody looks.
///
/// # Errors
/// Something else stands there.
pub fn open_plain(path: &Path, options: &mut OpenOptions) -> io::Result<File> {
    let file = options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK).open(path)?;
    let found = file.metadata()?;
    if found.is_file() && found.nlink() == 1 {
        return Ok(file);
    }
    Err(io::Error::other("it is not a plain file of its own: a link, a pipe or a device stands there"))
}

/// Makes a new file, to be written beside its place. What an earlier program left under that name, or
/// somebody planted there, loses the name and is not touched.
pub fn fresh(path: &Path) -> io::Result<File> {
    let new = || open_plain(path, OpenOptions::new().create_new(true).read(true).write(true));
    match new() {
        Err(why) if why.kind() == io::ErrorKind::AlreadyExists => fs::remove_file(path).and_then(|()| new()),
        made => made,
    }
}

/// Makes the names in the folder of `path` safe.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    File::open(folder)?.sync_all()
}

/// Writes a file that a person named, whole or not at all: after a crash or a power cut either the old one is
/// there or the new one. What is there and is not an ordinary file, such as a terminal or a pipe, is written
/// to as it is. A link of this user stays a link.
///
/// # Errors
/// A link that another user has put there.
pub fn write_whole(path: &Path, bytes: impl AsRef<[u8]>) -> miette::Result<()> {
    let written = named(path).and_then(|(path, special)| match special {
        true => fs::write(path, bytes.as_ref()).into_diagnostic(),
        false => put(&path, |mut file| file.write_all(bytes.as_ref()).into_diagnostic()),
    });
    written.wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// The same of a file that `write` makes piece by piece, and flushes.
///
/// # Errors
/// Those of `write`; a link that another user has put there; a pipe or a device: nothing is beside it.
pub fn write_in_pieces<T>(path: &Path, write: impl FnOnce(File) -> miette::Result<T>) -> miette::Result<T> {
    let written = named(path).and_then(|(path, special)| match special {
        true => Err(miette::miette!(help = "give the name of a file", "a pipe or a device is there")),
        false => put(&path, write),
    });
    written.wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// Writes a file of a run's or a study's folder, to which others may write, in the same way; a link that
/// stands there is replaced, and what it leads to is not touched.
pub fn write_plain(path: &Path, bytes: impl AsRef<[u8]>) -> miette::Result<()> {
    let written = put(path, |mut file| file.write_all(bytes.as_ref()).into_diagnostic());
    written.wrap_err_with(|| format!("cannot write {}", path.display()))
}

/// What a path leads to, through links of this user and of root, and whether a pipe or a device is there.
fn named(path: &Path) -> miette::Result<(PathBuf, bool)> {
    let link = fs::symlink_metadata(path)
        .is_ok_and(|there| there.is_symlink() && there.uid() != 0 && !is_own(&there));
    if link {
        miette::bail!("another user has put a link there");
    }
    let special = fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir());
    Ok((fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf()), special))
}

/// Whether a file is this user's.
pub fn is_own(file: &fs::Metadata) -> bool {
    fs::metadata("/proc/self").is_ok_and(|own| own.uid() == file.uid())
}

fn put<T>(path: &Path, write: impl FnOnce(File) -> miette::Result<T>) -> miette::Result<T> {
    let part = beside(path);
    let moved = fresh(&part).into_diagnostic().and_then(|file| {
        let made = write(file.try_clone().into_diagnostic()?)?;
        file.sync_all().into_diagnostic()?;
        GuardedFile { file, path: part.clone() }.still_there()?;
        fs::rename(&part, path).into_diagnostic().map(|()| made)
    });
    if moved.is_err() {
        let _ = fs::remove_file(&part);
    }
    moved.and_then(|made| sync_folder_of(path).into_diagnostic().map(|()| made))
}

/// Makes a folder with all that lead to it, their names safe. Returns those that were not there, the outermost first.
pub fn make_folder(path: &Path) -> miette::Result<Vec<PathBuf>> {
    let wrong = || format!("cannot make {}", path.display());
    let missing = path.ancestors().filter(|p| !p.as_os_str().is_empty() && !p.exists());
    let mut made: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
    made.reverse();
    fs::create_dir_all(path).into_diagnostic().wrap_err_with(wrong)?;
    made.iter().try_for_each(|folder| sync_folder_of(folder)).into_diagnostic().wrap_err_with(wrong)?;
    Ok(made)
}

/// Files and folders that this process has made, the outermost first; where nothing comes of them they go.
#[derive(Default)]
pub struct Made(pub Vec<PathBuf>);

impl Drop for Made {
    fn drop(&mut self) {
        for path in self.0.iter().rev() {
            // Only an empty folder goes: another process may have put something there.
            let _ = if path.is_dir() { fs::remove_dir(path) } else { fs::remove_file(path) };
        }
    }
}

/// An open file that knows its place: another program may remove or replace it at any time, and what is then
/// written goes nowhere.
#[derive(Debug)]
pub struct GuardedFile {
    file: File,
    path: PathBuf,
}

impl GuardedFile {
    /// Opens a file as [`open_plain`] does; the name of a new one is safe when this returns.
    pub fn open(path: &Path, options: &mut OpenOptions) -> miette::Result<Self> {
        Self::of(path, || open_plain(path, options))
    }

    /// A new file, as [`fresh`] makes it.
    pub fn fresh(path: &Path) -> miette::Result<Self> {
        Self::of(path, || fresh(path))
    }

    fn of(path: &Path, open: impl FnOnce() -> io::Result<File>) -> miette::Result<Self> {
        let open = || {
            let new = !path.exists();
            let file = open()?;
            if new {
                sync_folder_of(path)?;
            }
            Ok::<_, io::Error>(file)
        };
        let file = open().into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        Ok(GuardedFile { file, path: path.to_path_buf() })
    }

    /// The open file.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Another handle of the same open file.
    pub fn handle(&self) -> miette::Result<GuardedFile> {
        Ok(GuardedFile { file: self.file.try_clone().into_diagnostic()?, path: self.path.clone() })
    }

    /// Makes the contents safe, and looks whether they are still where they belong.
    ///
    /// # Errors
    /// What was written is not safe: the disk failed, or the file was removed or replaced.
    pub fn sync(&self) -> miette::Result<()> {
        self.file.sync_data().into_diagnostic().wrap_err_with(|| self.path.display().to_string())?;
        self.still_there()
    }

    /// Looks whether the file is still at its place.
    ///
    /// # Errors
    /// It was removed, moved or replaced.
    pub fn still_there(&self) -> miette::Result<()> {
        let ours = self.file.metadata().into_diagnostic()?;
        if fs::metadata(&self.path).is_ok_and(|there| (there.dev(), there.ino()) == (ours.dev(), ours.ino()))
        {
            return Ok(());
        }
        miette::bail!("{} was removed or replaced while it was being written", self.path.display())
    }
}

impl Read for GuardedFile {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.file.read(into)
    }
}

impl Write for GuardedFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for GuardedFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("muprime-files-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&path);
        fs::create_dir(&path).unwrap();
        path
    }

    #[test]
    fn a_file_is_replaced_whole_and_nothing_is_left_beside_it() {
        let folder = folder("whole");
        let (path, link) = (folder.join("report.html"), folder.join("link"));
        write_whole(&path, b"muprime, first").unwrap();
        std::os::unix::fs::symlink(&path, &link).unwrap();
        write_whole(&link, b"muprime, second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"muprime, second");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        // A folder is in the way: the old file stays, and nothing else does.
        fs::create_dir_all(folder.join("taken/by/files")).unwrap();
        assert!(write_whole(&folder.join("taken"), b"third").unwrap_err().to_string().contains("taken"));
        let mut names: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["link", "report.html", "taken"]);
        write_in_pieces(&link, |mut file| file.write_all(b"third").into_diagnostic()).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"third");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        let pipe = folder.join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let why = write_in_pieces(&pipe, |_| Ok(())).unwrap_err();
        assert!(format!("{why:?}").contains("a pipe or a device is there"), "{why:?}");
        let reader = {
            let pipe = pipe.clone();
            std::thread::spawn(move || fs::read(pipe).unwrap())
        };
        write_whole(&pipe, b"a pipe stays one").unwrap();
        assert_eq!(reader.join().unwrap(), b"a pipe stays one");
        assert!(!fs::metadata(&pipe).unwrap().is_file());
        fs::remove_dir_all(folder).unwrap();
    }

    /// Links of both kinds, and a pipe: nothing is followed, waited for or emptied, and what is written lands in the folder.
    #[test]
    fn nothing_that_is_planted_is_followed() {
        let folder = folder("planted");
        let (victim, path) = (folder.join("victim"), folder.join("summary.json"));
        let plants: [fn(&Path, &Path); 2] = [
            |victim, place| std::os::unix::fs::symlink(victim, place).unwrap(),
            |victim, place| fs::hard_link(victim, place).unwrap(),
        ];
        for plant in plants {
            fs::write(&victim, "precious").unwrap();
            for place in [beside(&path), path.clone()] {
                plant(&victim, &place);
                assert!(open_plain(&place, OpenOptions::new().append(true)).is_err());
                write_plain(&path, "ours").unwrap();
                assert_eq!(fs::read_to_string(&victim).unwrap(), "precious");
                assert_eq!(fs::read_to_string(&path).unwrap(), "ours");
                fs::remove_file(&path).unwrap();
            }
        }
        let pipe = std::process::Command::new("mkfifo").arg(&path).status().unwrap();
        assert!(pipe.success() && open_plain(&path, OpenOptions::new().read(true)).is_err());
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn a_file_that_was_removed_or_replaced_is_noticed() {
        let folder = folder("placed");
        let path = folder.join("run-1.mcap");
        let open = || GuardedFile::open(&path, OpenOptions::new().create(true).append(true)).unwrap();
        let mut file = open();
        file.write_all(b"row").unwrap();
        file.sync().unwrap();
        fs::rename(&path, folder.join("away")).unwrap();
        assert!(file.sync().unwrap_err().to_string().contains("removed or replaced"));
        fs::write(&path, b"row").unwrap();
        assert!(file.sync().is_err(), "the same name is not the same file");
        open().sync().unwrap();
        fs::remove_dir_all(folder).unwrap();
    }
}
