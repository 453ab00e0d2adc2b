//! What a disk holds after the power was cut: all that was synced, and of the rest anything.
//!
//! As strict as POSIX: data are safe once their file was synced, names once their folder was. Of what was
//! not, every sector of 512 bytes may be there or not, in any order, and a file may have its length before
//! its data. The changes of one folder come in their order, as in every journal of names.

use super::log::{Inode, Op};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const SECTOR: usize = 512;

#[derive(Clone)]
enum Change {
    Write(usize, Vec<u8>),
    Length(usize),
}

#[derive(Clone, Default)]
struct File {
    safe: Vec<u8>,
    pending: Vec<Change>,
}

#[derive(Clone)]
enum Name {
    File(PathBuf, Inode),
    Folder(PathBuf),
    Moved(PathBuf, PathBuf),
    Gone(PathBuf),
}

#[derive(Clone, Default)]
struct Names {
    files: BTreeMap<PathBuf, Inode>,
    folders: Vec<PathBuf>,
}

impl Names {
    fn apply(&mut self, change: &Name) {
        match change {
            Name::File(path, file) => {
                self.files.insert(path.clone(), *file);
            }
            Name::Folder(path) => self.folders.push(path.clone()),
            Name::Moved(from, to) => {
                if let Some(file) = self.files.remove(from) {
                    self.files.insert(to.clone(), file);
                }
            }
            Name::Gone(path) => {
                self.files.remove(path);
            }
        }
    }
}

fn write(to: &mut Vec<u8>, at: usize, bytes: &[u8]) {
    to.resize(to.len().max(at + bytes.len()), 0);
    to[at..at + bytes.len()].copy_from_slice(bytes);
}

/// Lays the disk as it is after `ops` and a power cut into the empty folder `into`, which stands for `root`.
/// Syncs that `deaf` picks do nothing.
pub fn after_a_cut(ops: &[Op], root: &Path, into: &Path, rng: &mut ChaCha8Rng, deaf: &dyn Fn(&Op) -> bool) {
    let mut files: BTreeMap<Inode, File> = BTreeMap::new();
    let mut safe = Names { folders: vec![root.to_path_buf()], ..Names::default() };
    let mut pending: Vec<(PathBuf, Name)> = Vec::new();
    let folder_of = |path: &Path| path.parent().unwrap().to_path_buf();
    for op in ops.iter().filter(|op| !deaf(op)) {
        match op {
            Op::Said(_) => {}
            Op::Folder(path) => pending.push((folder_of(path), Name::Folder(path.clone()))),
            Op::Create(path, file) => pending.push((folder_of(path), Name::File(path.clone(), *file))),
            Op::Rename(from, to) => pending.push((folder_of(to), Name::Moved(from.clone(), to.clone()))),
            Op::Remove(path) => pending.push((folder_of(path), Name::Gone(path.clone()))),
            Op::SyncFolder(folder) => {
                pending.iter().filter(|(of, _)| of == folder).for_each(|(_, change)| safe.apply(change));
                pending.retain(|(of, _)| of != folder);
            }
            Op::Write { file, at, bytes } => {
                files.entry(*file).or_default().pending.push(Change::Write(*at, bytes.clone()));
            }
            Op::Truncate { file, length } => {
                files.entry(*file).or_default().pending.push(Change::Length(*length))
            }
            Op::Sync { file, .. } => {
                let file = files.entry(*file).or_default();
                for change in std::mem::take(&mut file.pending) {
                    match change {
                        Change::Write(at, bytes) => write(&mut file.safe, at, &bytes),
                        Change::Length(length) => file.safe.resize(length, 0),
                    }
                }
            }
        }
    }
    let folders: std::collections::BTreeSet<PathBuf> = pending.iter().map(|(of, _)| of.clone()).collect();
    for folder in folders {
        let of: Vec<&Name> =
            pending.iter().filter(|(of, _)| *of == folder).map(|(_, change)| change).collect();
        let reached = rng.next_u64() as usize % (of.len() + 1);
        of[..reached].iter().for_each(|change| safe.apply(change));
    }
    let place = |path: &Path| into.join(path.strip_prefix(root).unwrap());
    for folder in safe.folders.iter().filter(|f| *f != root) {
        // A folder whose own folder is gone is gone with it.
        let _ = std::fs::create_dir(place(folder));
    }
    for (path, inode) in &safe.files {
        if place(path).parent().is_some_and(Path::exists) {
            std::fs::write(place(path), survived(files.get(inode).cloned().unwrap_or_default(), rng))
                .unwrap();
        }
    }
}

/// What a file may hold: its safe bytes, and any sectors of what was pending.
fn survived(file: File, rng: &mut ChaCha8Rng) -> Vec<u8> {
    let mut bytes = file.safe;
    // None of it, all of it, or some.
    let share = [0, 256, 230, 128, 26][rng.next_u64() as usize % 5];
    let mut lucky = || (rng.next_u64() >> 32) % 256 < share;
    for change in file.pending {
        match change {
            Change::Length(length) => {
                if lucky() {
                    bytes.resize(length, 0);
                }
            }
            Change::Write(at, data) => {
                if lucky() {
                    bytes.resize(bytes.len().max(at + data.len()), 0);
                }
                let (mut from, end) = (at, at + data.len());
                while from < end {
                    let to = end.min((from / SECTOR + 1) * SECTOR);
                    if lucky() {
                        write(&mut bytes, from, &data[from - at..to - at]);
                    }
                    from = to;
                }
            }
        }
    }
    bytes
}
