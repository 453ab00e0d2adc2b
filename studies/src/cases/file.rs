//! The file of cases: JSON lines. The first says what they are; where they do not follow from it, one line a case comes after it.
//!
//! Lines that `muprime cases` writes are padded to one length, which the header states: the millionth case is
//! then found without reading those before it. A file from elsewhere need not be.

use super::kinds::CaseKind;
use miette::{Context, IntoDiagnostic};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Schema of the header.
pub const SCHEMA: &str = "muprime.cases/1";

/// Bytes that a line has at most.
const LONGEST_LINE: u64 = 1 << 20;

/// The first line of a file of cases.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// [`SCHEMA`].
    pub schema: String,
    /// What a case is: a name of [`super::kinds`].
    pub kind: String,
    /// Version of the program and of the model behind the kind.
    pub version: String,
    /// How many cases there are; their indices go from 0.
    pub cases: u64,
    /// Whether a line a case follows; otherwise each case follows from the settings and its index.
    #[serde(default)]
    pub listed: bool,
    /// Bytes of each line with its end, where they are all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub line_bytes: Option<u64>,
    /// What all cases share.
    #[serde(default)]
    pub settings: Value,
}

impl Header {
    /// Cases of a kind that follow from settings.
    ///
    /// # Errors
    /// Settings that JSON cannot hold.
    pub fn of(kind: &CaseKind, settings: &impl Serialize, cases: u64) -> miette::Result<Header> {
        Ok(Header {
            schema: SCHEMA.into(),
            kind: kind.name.into(),
            version: kind.version(),
            cases,
            listed: false,
            line_bytes: None,
            settings: serde_json::to_value(settings).into_diagnostic()?,
        })
    }
}

/// An open file of cases.
#[derive(Clone, Debug)]
pub struct CaseFile {
    /// Where it is, absolute.
    pub path: PathBuf,
    /// Its first line.
    pub header: Header,
    /// SHA-256 of the first line, hexadecimal.
    pub digest: String,
    header_bytes: u64,
}

impl CaseFile {
    /// Reads the header.
    ///
    /// # Errors
    /// A file that cannot be read or is not a file of cases, or one whose lines were cut.
    pub fn open(path: &Path) -> miette::Result<CaseFile> {
        let wrong = || format!("{}: no file of cases", path.display());
        let path = path.canonicalize().into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        let file = File::open(&path).into_diagnostic().wrap_err_with(wrong)?;
        let length = file.metadata().into_diagnostic()?.len();
        let mut first = Vec::new();
        BufReader::new(file).take(LONGEST_LINE).read_until(b'\n', &mut first).into_diagnostic()?;
        let header: Header = serde_json::from_slice(&first)
            .map_err(|why| miette::miette!(help = "`muprime cases` writes them", "line 1: {why}"))
            .wrap_err_with(wrong)?;
        if header.schema != SCHEMA {
            miette::bail!("{}: schema '{}'; '{SCHEMA}' is needed", path.display(), header.schema);
        }
        let header_bytes = first.len() as u64;
        if let Some(line) = header.line_bytes.filter(|_| header.listed) {
            let due = header.cases.checked_mul(line).and_then(|all| all.checked_add(header_bytes));
            if line < 3 || due != Some(length) {
                miette::bail!(
                    help = "write it again with `muprime cases`",
                    "{}: {length} bytes, where {} lines of {line} bytes after the first are stated: cut or changed",
                    path.display(),
                    header.cases
                );
            }
        }
        Ok(CaseFile { path, header, digest: hex(&Sha256::digest(&first)), header_bytes })
    }

    /// The range with an index each, and the case's line where there are lines.
    ///
    /// # Errors
    /// A range beyond the end, or a file that cannot be read.
    pub fn lines(&self, range: Range<u64>) -> miette::Result<Lines> {
        let (Range { start, end }, cases) = (range, self.header.cases);
        if end > cases || start > end {
            miette::bail!("cases {start}..{end} of {}, which has {cases}", self.path.display());
        }
        let mut lines = None;
        if self.header.listed {
            let mut file = File::open(&self.path).into_diagnostic()?;
            let skipped = self.header.line_bytes.map_or(0, |bytes| bytes * start);
            file.seek(SeekFrom::Start(self.header_bytes + skipped)).into_diagnostic()?;
            let mut reader = BufReader::new(file);
            if self.header.line_bytes.is_none() {
                let mut dropped = Vec::new();
                for _ in 0..start {
                    dropped.clear();
                    reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut dropped).into_diagnostic()?;
                }
            }
            lines = Some(reader);
        }
        Ok(Lines { path: self.path.clone(), next: start, end, lines })
    }
}

/// Cases one after another.
pub struct Lines {
    path: PathBuf,
    next: u64,
    end: u64,
    lines: Option<BufReader<File>>,
}

impl Iterator for Lines {
    type Item = miette::Result<(u64, Option<Value>)>;

    fn next(&mut self) -> Option<Self::Item> {
        let index = self.next;
        if index >= self.end {
            return None;
        }
        self.next += 1;
        let Some(reader) = &mut self.lines else { return Some(Ok((index, None))) };
        let mut line = Vec::new();
        let read = reader.by_ref().take(LONGEST_LINE).read_until(b'\n', &mut line).into_diagnostic();
        let parsed = read.and_then(|_| serde_json::from_slice(&line).into_diagnostic());
        let found = parsed.map(|value| (index, Some(value)));
        Some(found.wrap_err_with(|| format!("{} line {}", self.path.display(), index + 2)))
    }
}

/// Writes a file of cases whole or not at all: `lines` where each case has one, padded to the length of the longest.
///
/// # Errors
/// Whatever the file system says; another file than one of cases is there.
pub fn write(path: &Path, header: Header, lines: Option<&[Value]>) -> miette::Result<()> {
    let Some(lines) = lines else {
        let text = serde_json::to_string(&header).into_diagnostic()? + "\n";
        return runs::files::write_output(path, text);
    };
    let texts: Vec<String> = lines.iter().map(Value::to_string).collect();
    let longest = texts.iter().map(String::len).max().unwrap_or(0).max(2);
    let line_bytes = Some(longest as u64 + 1);
    let header = Header { cases: texts.len() as u64, listed: true, line_bytes, ..header };
    let mut all = serde_json::to_vec(&header).into_diagnostic()?;
    all.push(b'\n');
    for text in texts {
        writeln!(all, "{text:longest$}").into_diagnostic()?;
    }
    runs::files::write_output(path, all)
}

/// Bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(kind: &str) -> Header {
        Header {
            schema: SCHEMA.into(),
            kind: kind.into(),
            version: "1".into(),
            cases: 3,
            listed: false,
            line_bytes: None,
            settings: Value::Null,
        }
    }

    #[test]
    fn the_same_cases_come_from_padded_and_from_plain_lines() {
        let folder = tempfile::tempdir().unwrap();
        let (padded, plain) = (folder.path().join("padded"), folder.path().join("plain"));
        let lines =
            [serde_json::json!({"mu0": 0.5}), serde_json::json!({}), serde_json::json!({"mu0": 1.25e-3})];
        write(&padded, header("ridge"), Some(&lines)).unwrap();
        let mut text = serde_json::to_string(&Header { listed: true, ..header("ridge") }).unwrap() + "\n";
        text.extend(lines.iter().map(|l| format!("{l}\n")));
        std::fs::write(&plain, text).unwrap();
        for range in [0..3, 1..2, 2..3, 3..3] {
            let read = |p: &Path| -> Vec<_> {
                CaseFile::open(p).unwrap().lines(range.clone()).unwrap().map(Result::unwrap).collect()
            };
            assert_eq!(read(&padded), read(&plain));
            assert_eq!(read(&padded).len() as u64, range.end - range.start);
        }
        assert!(CaseFile::open(&padded).unwrap().lines(2..4).is_err());
    }

    #[test]
    fn a_file_that_was_cut_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cases");
        write(&path, header("ridge"), Some(&[serde_json::json!({}), serde_json::json!({})])).unwrap();
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() - 1]).unwrap();
        assert!(CaseFile::open(&path).unwrap_err().to_string().contains("cut or changed"));
        std::fs::write(&path, b"point,amplitude\n").unwrap();
        assert!(CaseFile::open(&path).is_err());
    }
}
