//! Reading files that people wrote: every refusal shows the place in the file and what would do.

use miette::{Diagnostic, NamedSource, SourceSpan};
use models::rig_file::{RigFile, RigFileError};
use serde::de::DeserializeOwned;
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

/// Text of a configuration file.
///
/// # Errors
/// A file that is not there, not UTF-8, or larger than [`MAX_BYTES`].
pub fn text_of(path: &Path) -> miette::Result<String> {
    let shown = path.display();
    let size = std::fs::metadata(path).map_err(|e| miette::miette!("{shown}: {e}"))?.len();
    if size > MAX_BYTES {
        miette::bail!("{shown}: {size} bytes; a configuration file has at most {MAX_BYTES}");
    }
    std::fs::read_to_string(path).map_err(|e| miette::miette!("{shown}: {e}"))
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
