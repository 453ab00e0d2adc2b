//! Reading files that people wrote: every refusal shows the place in the file and what would do.

use miette::{Diagnostic, NamedSource, SourceSpan};
use models::rig_file::{RigFile, RigFileError};
use serde::de::DeserializeOwned;
use std::io::Read;
use std::path::Path;

/// A file that cannot be used, with the place.
#[derive(Debug, thiserror::Error, Diagnostic)]
#[error("{problem}")]
pub struct BadInput {
    problem: String,
    #[help]
    remedy: Option<String>,
    #[source_code]
    text: NamedSource<String>,
    #[label("here")]
    place: Option<SourceSpan>,
}

impl BadInput {
    /// A problem with `text` of the file called `name`, at `place`.
    pub fn new(
        name: &str,
        text: &str,
        place: Option<std::ops::Range<usize>>,
        problem: impl Into<String>,
        remedy: impl Into<Option<String>>,
    ) -> Self {
        BadInput {
            problem: problem.into(),
            remedy: remedy.into(),
            text: NamedSource::new(name, text.to_string()),
            place: place.map(SourceSpan::from),
        }
    }
}

/// The largest file that is read as configuration.
pub const MAX_BYTES: u64 = 1 << 20;

/// The largest table of measurements that is read into memory.
pub const MAX_TABLE_BYTES: u64 = 1 << 30;

/// Text of a configuration file.
///
/// # Errors
/// A file that is not there, no ordinary file, not UTF-8, or larger than [`MAX_BYTES`].
pub fn text_of(path: &Path) -> miette::Result<String> {
    let bytes = bytes_of(path, MAX_BYTES)?;
    String::from_utf8(bytes).map_err(|e| miette::miette!("{}: not UTF-8: {e}", path.display()))
}

/// Contents of a file that somebody named. Devices, pipes and folders are refused unread: a pipe might never say anything, a
/// device never end.
///
/// # Errors
/// A file that is not there, no ordinary file, or larger than `most` bytes.
pub fn bytes_of(path: &Path, most: u64) -> miette::Result<Vec<u8>> {
    let shown = path.display();
    let wrong = |e: std::io::Error| miette::miette!("{shown}: {e}");
    let there = std::fs::metadata(path).map_err(wrong)?;
    if !there.is_file() {
        miette::bail!(help = "give an ordinary file", "{shown} is no ordinary file");
    }
    let mut bytes = Vec::new();
    // It may grow while it is being read.
    std::fs::File::open(path).and_then(|file| file.take(most + 1).read_to_end(&mut bytes)).map_err(wrong)?;
    if bytes.len() as u64 > most {
        miette::bail!("{shown}: {} bytes; such a file has at most {most}", there.len().max(most + 1));
    }
    Ok(bytes)
}

/// Parses TOML.
///
/// # Errors
/// What TOML or the schema says, with the place. Unknown keys are errors wherever the schema says so.
pub fn parse_toml<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, BadInput> {
    toml::from_str(text).map_err(|e| BadInput::new(name, text, e.span(), e.message().to_string(), None))
}

/// Reads a rig.toml.
///
/// # Errors
/// A file that cannot be read, and what [`RigFile::parse`] refuses, with the place.
pub fn rig_file(path: &Path) -> miette::Result<RigFile> {
    let text = text_of(path)?;
    let name = path.display().to_string();
    let file: RigFile = parse_toml(&name, &text)?;
    file.check().map_err(|error| {
        let place = match &error {
            RigFileError::Value { section, key, .. } => place_of(&text, &[section, key]),
            RigFileError::Form(error) => error.span(),
        };
        BadInput::new(&name, &text, place, error.to_string(), None)
    })?;
    Ok(file)
}

/// Where the value of a key stands: `path` names tables and the key, for instance `["limits", "speed_max_m_s"]`.
/// `None` where the key is not in the file (a default was used).
pub fn place_of(text: &str, path: &[&str]) -> Option<std::ops::Range<usize>> {
    let table = toml::de::DeTable::parse(text).ok()?;
    let mut here: &toml::de::DeTable<'_> = table.get_ref();
    let (last, tables) = path.split_last()?;
    for name in tables {
        here = here.get(*name)?.get_ref().as_table()?;
    }
    here.get(*last).map(toml::Spanned::span)
}
