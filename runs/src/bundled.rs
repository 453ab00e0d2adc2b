//! What comes with the program, by name: lists of names and texts.

use crate::input;
use std::borrow::Cow;
use std::path::Path;

/// Text of that name in a list.
pub fn text(list: &[(&str, &'static str)], name: &str) -> Option<&'static str> {
    list.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}

/// The names of a list, for people.
pub(crate) fn names(list: &[(&str, &str)]) -> String {
    list.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

/// The text of that name in the list of a kind of file, or of the file at that path, and the file's folder;
/// an error where there is none, or it cannot be read.
pub(crate) fn load<'a>(
    kind: &str,
    list: &[(&str, &'static str)],
    name_or_path: &'a str,
) -> miette::Result<(Cow<'static, str>, &'a Path)> {
    if let Some(text) = text(list, name_or_path) {
        return Ok((text.into(), Path::new(".")));
    }
    let path = Path::new(name_or_path);
    if !path.exists() {
        miette::bail!(
            help = format!("bundled {kind}s: {}", names(list)),
            "there is no {kind} '{name_or_path}', neither bundled nor as a file"
        );
    }
    Ok((input::text_of(path)?.into(), path.parent().unwrap_or(Path::new("."))))
}
