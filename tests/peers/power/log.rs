//! What a program did to the disk, as strace saw it: every call that makes, changes, syncs, moves or removes a file, in order.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Number of a file, whatever it is called.
pub type Inode = usize;

/// One change, or one promise to the outside.
#[derive(Clone, Debug)]
pub enum Op {
    Folder(PathBuf),
    Create(PathBuf, Inode),
    Write {
        file: Inode,
        at: usize,
        bytes: Vec<u8>,
    },
    Truncate {
        file: Inode,
        length: usize,
    },
    Sync {
        file: Inode,
        name: PathBuf,
    },
    SyncFolder(PathBuf),
    Rename(PathBuf, PathBuf),
    Remove(PathBuf),
    /// Written to standard output: from here on somebody relies on it.
    Said(Vec<u8>),
}

/// The calls that are needed.
pub const CALLS: &str = "openat,write,pwrite64,fsync,fdatasync,rename,mkdir,unlink,ftruncate,close,dup,fcntl,lseek,\
                         writev,pwritev,renameat,renameat2,mkdirat,unlinkat,rmdir,fallocate,creat,link,linkat,dup2,dup3";

enum Target {
    File { file: Inode, name: PathBuf },
    Folder(PathBuf),
    Output,
}

/// An open file as all its descriptors share it.
struct Open {
    target: Target,
    at: usize,
    append: bool,
}

#[derive(Default)]
struct Reading {
    root: PathBuf,
    ops: Vec<Op>,
    names: BTreeMap<PathBuf, Inode>,
    lengths: Vec<usize>,
    opened: Vec<Open>,
    descriptors: BTreeMap<i64, usize>,
}

/// Reads a log of `strace -f -xx`; changes outside of `root` are left out.
pub fn read(log: &str, root: &Path) -> Vec<Op> {
    let mut reading = Reading { root: root.to_path_buf(), ..Reading::default() };
    reading.open(1, Target::Output, false);
    for line in log.lines() {
        let Some((_, call)) = line.split_once(' ') else { continue };
        let (Some((name, rest)), false) = (call.trim().split_once('('), call.contains("+++")) else {
            continue;
        };
        assert!(!call.contains("unfinished"), "two threads change the disk at once: {call}");
        let (arguments, result) = rest.rsplit_once(" = ").unwrap_or_else(|| panic!("no result: {line}"));
        let arguments = arguments.trim_end().strip_suffix(')').unwrap_or_else(|| panic!("no end: {line}"));
        let Ok(result) = result.split_whitespace().next().unwrap_or_default().parse::<i64>() else {
            continue;
        };
        if result >= 0 {
            reading.call(name, &arguments.split(", ").collect::<Vec<_>>(), result);
        }
    }
    reading.ops
}

/// Bytes of a quoted argument, every one of them in hexadecimal digits.
fn bytes(argument: &str) -> Vec<u8> {
    assert!(argument.starts_with('"') && argument.ends_with('"'), "cut by strace: {argument}");
    let digits = argument.trim_matches('"').split("\\x").skip(1);
    digits.map(|d| u8::from_str_radix(d, 16).unwrap()).collect()
}

fn path(argument: &str) -> PathBuf {
    PathBuf::from(String::from_utf8(bytes(argument)).unwrap())
}

impl Reading {
    fn open(&mut self, descriptor: i64, target: Target, append: bool) {
        self.opened.push(Open { target, at: 0, append });
        self.descriptors.insert(descriptor, self.opened.len() - 1);
    }

    fn call(&mut self, name: &str, a: &[&str], result: i64) {
        let number = |i: usize| a[i].parse::<usize>().unwrap();
        let descriptor = || a[0].parse::<i64>().unwrap();
        match name {
            "openat" => self.opens(path(a[1]), a[2], result),
            "close" => {
                self.descriptors.remove(&descriptor());
            }
            "dup" | "fcntl" if name == "dup" || a[1].starts_with("F_DUPFD") => {
                if let Some(&open) = self.descriptors.get(&descriptor()) {
                    self.descriptors.insert(result, open);
                }
            }
            "fcntl" => {}
            "lseek" => {
                if let Some(&open) = self.descriptors.get(&descriptor()) {
                    self.opened[open].at = result as usize;
                }
            }
            "write" => self.writes(descriptor(), bytes(a[1]), None, result),
            "pwrite64" => self.writes(descriptor(), bytes(a[1]), Some(number(3)), result),
            "fsync" | "fdatasync" => match self.target(descriptor()) {
                Some(Target::File { file, name }) => {
                    let (file, name) = (*file, name.clone());
                    self.ops.push(Op::Sync { file, name });
                }
                Some(Target::Folder(folder)) => {
                    let folder = folder.clone();
                    self.ops.push(Op::SyncFolder(folder));
                }
                _ => {}
            },
            "ftruncate" => {
                if let Some(Target::File { file, .. }) = self.target(descriptor()) {
                    let file = *file;
                    self.lengths[file] = number(1);
                    self.ops.push(Op::Truncate { file, length: number(1) });
                }
            }
            "mkdir" if path(a[0]).starts_with(&self.root) => self.ops.push(Op::Folder(path(a[0]))),
            "rename" if path(a[0]).starts_with(&self.root) => {
                let (from, to) = (path(a[0]), path(a[1]));
                let file = self.names.remove(&from).expect("a file that was made here");
                self.names.insert(to.clone(), file);
                self.ops.push(Op::Rename(from, to));
            }
            "unlink" if self.names.remove(&path(a[0])).is_some() => self.ops.push(Op::Remove(path(a[0]))),
            "mkdir" | "rename" | "unlink" => {}
            other => panic!("{other} is not understood"),
        }
    }

    fn target(&self, descriptor: i64) -> Option<&Target> {
        self.descriptors.get(&descriptor).map(|open| &self.opened[*open].target)
    }

    fn opens(&mut self, path: PathBuf, flags: &str, descriptor: i64) {
        self.descriptors.remove(&descriptor);
        if !path.starts_with(&self.root) {
            return;
        }
        if !flags.contains("O_CREAT") && !self.names.contains_key(&path) {
            return self.open(descriptor, Target::Folder(path), false);
        }
        let file = match self.names.get(&path) {
            Some(&file) => file,
            None => {
                self.lengths.push(0);
                let file = self.lengths.len() - 1;
                self.names.insert(path.clone(), file);
                self.ops.push(Op::Create(path.clone(), file));
                file
            }
        };
        if flags.contains("O_TRUNC") && self.lengths[file] > 0 {
            self.lengths[file] = 0;
            self.ops.push(Op::Truncate { file, length: 0 });
        }
        self.open(descriptor, Target::File { file, name: path }, flags.contains("O_APPEND"));
    }

    fn writes(&mut self, descriptor: i64, mut bytes: Vec<u8>, at: Option<usize>, written: i64) {
        let Some(&number) = self.descriptors.get(&descriptor) else { return };
        bytes.truncate(written as usize);
        let open = &mut self.opened[number];
        match &open.target {
            Target::Output => self.ops.push(Op::Said(bytes)),
            Target::Folder(_) => unreachable!("nobody writes to a folder"),
            Target::File { file, .. } => {
                let start = at.unwrap_or(if open.append { self.lengths[*file] } else { open.at });
                if at.is_none() {
                    open.at = start + bytes.len();
                }
                let length = &mut self.lengths[*file];
                *length = (*length).max(start + bytes.len());
                self.ops.push(Op::Write { file: *file, at: start, bytes });
            }
        }
    }
}
