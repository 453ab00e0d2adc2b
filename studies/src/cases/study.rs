//! A file of cases and the folder of its results. `study.json` in the folder says of which cases they are;
//! `shards/` holds them in subfolders, `parts/` what is being written, `jobs/` what was handed to engines.

use super::crash_points;
use super::file::CaseFile;
use super::kinds::{self, Case, CaseKind, Make};
use miette::{Context, IntoDiagnostic};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs;
use std::io::{ErrorKind, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Schema of `study.json`.
const SCHEMA: &str = "muprime.study/1";

/// Folders that the shards of a study are in, at most.
const FOLDERS: u64 = 1000;
/// Shards in one of them at most, unless a shard has fewer cases than a millionth of the study.
const SHARDS: u64 = 1000;

/// `study.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    schema: String,
    /// The file of cases, absolute.
    pub cases: PathBuf,
    /// SHA-256 of its header.
    pub header: String,
    kind: String,
    version: String,
}

impl Manifest {
    fn of(bytes: &[u8], place: &Path) -> miette::Result<Manifest> {
        serde_json::from_slice(bytes).into_diagnostic().wrap_err_with(|| place.display().to_string())
    }
}

/// An open study.
pub struct Study {
    /// The cases.
    pub file: CaseFile,
    /// What they are.
    pub kind: &'static CaseKind,
    /// Folder of the results, absolute.
    pub out: PathBuf,
    make: Make,
}

impl Study {
    /// Opens a file of cases alone; refuses one that this program does not take, or that another version wrote.
    fn of(cases: &Path, out: PathBuf) -> miette::Result<Study> {
        let file = CaseFile::open(cases)?;
        let kind = kinds::by_name(&file.header.kind)?;
        if file.header.version != kind.version() {
            let (of, this) = (&file.header.version, kind.version());
            let help = "write the cases again with this version, and let it run them all";
            miette::bail!(help = help, "{}: cases of '{of}', and this is '{this}'", cases.display());
        }
        let folder = file.path.parent().unwrap_or(Path::new("/")).to_path_buf();
        let make = (kind.prepare)(&file.header, &folder).wrap_err_with(|| cases.display().to_string())?;
        Ok(Study { file, kind, out, make })
    }

    /// Opens a study to work on it: a folder that is not there is made.
    ///
    /// # Errors
    /// As the file of cases; a folder that holds another study, or that cannot be written.
    pub fn begin(cases: &Path, out: &Path) -> miette::Result<Study> {
        let study = Study::of(cases, out.to_path_buf())?;
        runs::files::make_folder(out)?;
        let out = out.canonicalize().into_diagnostic()?;
        let study = Study { out, ..study };
        let manifest = Manifest {
            schema: SCHEMA.into(),
            cases: study.file.path.clone(),
            header: study.file.digest.clone(),
            kind: study.kind.name.into(),
            version: study.kind.version(),
        };
        let place = study.out.join("study.json");
        match fs::read(&place) {
            Ok(bytes) => study.same(&Manifest::of(&bytes, &place)?)?,
            Err(why) if why.kind() == ErrorKind::NotFound => {
                let (part, mut file) = study.part("study.json")?;
                let text = serde_json::to_vec(&manifest).into_diagnostic()?;
                let written = file.write_all(&text).and_then(|()| file.sync_all());
                written.into_diagnostic().wrap_err("study.json")?;
                crash_points::here("study-written");
                // Whoever was first with another study is found by the keys of its shards.
                fs::rename(&part, &place).into_diagnostic().wrap_err_with(|| place.display().to_string())?;
                crash_points::here("study-moved");
                runs::files::sync_folder_of(&place).into_diagnostic()?;
            }
            Err(why) => return Err(why).into_diagnostic().wrap_err_with(|| place.display().to_string()),
        }
        runs::files::make_folder(&study.shards())?;
        Ok(study)
    }

    /// Opens the study that stands in a folder, to read it.
    ///
    /// # Errors
    /// No study, or its file of cases is gone or changed.
    pub fn in_folder(out: &Path, cases: Option<&Path>) -> miette::Result<Study> {
        let place = out.join("study.json");
        let bytes = fs::read(&place)
            .into_diagnostic()
            .wrap_err_with(|| format!("{}: no study: {} cannot be read", out.display(), place.display()))?;
        let manifest = Manifest::of(&bytes, &place)?;
        if cases.is_none() && !manifest.cases.exists() {
            let help = "--cases FILE says where it is now";
            miette::bail!(
                help = help,
                "{}: its file of cases, {}, is gone",
                out.display(),
                manifest.cases.display()
            );
        }
        let study = Study::of(cases.unwrap_or(&manifest.cases), out.canonicalize().into_diagnostic()?)?;
        study.same(&manifest)?;
        Ok(study)
    }

    /// Refuses a folder whose `study.json` is of other cases.
    fn same(&self, there: &Manifest) -> miette::Result<()> {
        if (there.schema.as_str(), &there.header) == (SCHEMA, &self.file.digest) {
            return Ok(());
        }
        let other = format!("{} ({})", there.cases.display(), there.version);
        let own = format!("{} ({})", self.file.path.display(), self.kind.version());
        miette::bail!(
            help = "give another folder: results of two studies do not mix",
            "{} holds the study of {other}, whose first line is another than that of {own}",
            self.out.display()
        )
    }

    /// Folder of the shards.
    pub fn shards(&self) -> PathBuf {
        self.out.join("shards")
    }

    /// Where the shard of a range is: in one of at most `FOLDERS` folders.
    pub fn shard(&self, range: &Range<u64>) -> PathBuf {
        let name = format!("{:012}-{:012}.parquet", range.start, range.end);
        let cases_a_folder = self.file.header.cases.div_ceil(FOLDERS).max(SHARDS);
        self.shards().join(format!("{:04}", range.start / cases_a_folder)).join(name)
    }

    /// The ranges of which there is a shard, by their beginning, the longer first. Names alone are read.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn ranges_there(&self) -> miette::Result<Vec<Range<u64>>> {
        let mut there = Vec::new();
        for folder in names(&self.shards())? {
            there.extend(names(&self.shards().join(folder))?.iter().filter_map(|name| range_of(name)));
        }
        there.sort_by_key(|r: &Range<u64>| (r.start, std::cmp::Reverse(r.end)));
        Ok(there)
    }

    /// A new file in `parts/` that no other worker has, on whatever machine: its name is drawn by the kernel, not made of a clock.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn part(&self, name: &str) -> miette::Result<(PathBuf, fs::File)> {
        let folder = self.out.join("parts");
        runs::files::make_folder(&folder)?;
        let unique = fs::read_to_string("/proc/sys/kernel/random/uuid").into_diagnostic()?;
        let path = folder.join(format!("{name}.{}", unique.trim()));
        let file = fs::OpenOptions::new().write(true).create_new(true).open(&path);
        Ok((path.clone(), file.into_diagnostic().wrap_err_with(|| path.display().to_string())?))
    }

    /// The case of a line.
    ///
    /// # Errors
    /// A line that is not what the kind takes, or a file that it names and that cannot be read.
    pub fn case(&self, index: u64, line: Option<&Value>) -> miette::Result<Case> {
        (self.make)(index, line)
    }

    /// The keys of a range.
    ///
    /// # Errors
    /// As [`Study::case`].
    pub fn keys(&self, range: Range<u64>) -> miette::Result<impl Iterator<Item = miette::Result<[u8; 32]>>> {
        let lines = self.file.lines(range)?;
        Ok(lines.map(|line| {
            let (index, line) = line?;
            Ok(self.kind.key(&self.case(index, line.as_ref())?.inputs))
        }))
    }
}

/// Names in a folder; none where it is no folder.
fn names(folder: &Path) -> miette::Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(why) if matches!(why.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
            return Ok(Vec::new());
        }
        Err(why) => return Err(why).into_diagnostic().wrap_err_with(|| folder.display().to_string()),
    };
    entries.map(|entry| Ok(entry.into_diagnostic()?.file_name().to_string_lossy().into_owned())).collect()
}

/// The range that a shard's name states.
fn range_of(name: &str) -> Option<Range<u64>> {
    let (start, end) = name.strip_suffix(".parquet")?.split_once('-')?;
    Some(start.parse().ok()?..end.parse().ok()?)
}
