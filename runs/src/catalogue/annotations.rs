//! What people add to a run afterwards: tags and a note, in a file of their own. The record and the
//! table stay as they are.

use crate::files::write_plain;
use crate::input::{parse_toml, text_of};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The file in a run's folder. People may edit it; [`Annotations::write`] replaces it whole.
pub const ANNOTATIONS: &str = "annotations.toml";
/// Tags of a run at most.
pub const MOST_TAGS: usize = 16;
/// Characters of a tag at most.
pub const LONGEST_TAG: usize = 40;
/// Characters of a note at most.
pub const LONGEST_NOTE: usize = 2000;

/// Tags and a note of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Annotations {
    /// Short words to search by, each once, in the order in which they were given.
    pub tags: Vec<String>,
    /// Free text.
    pub note: String,
}

impl Annotations {
    /// Those of a run's folder; none where there is no such file.
    ///
    /// # Errors
    /// A file that cannot be read, or says more than it may.
    pub fn read(run: &Path) -> miette::Result<Self> {
        let file = run.join(ANNOTATIONS);
        if !file.exists() {
            return Ok(Self::default());
        }
        parse_toml::<Self>(&file.display().to_string(), &text_of(&file)?)?.checked()
    }

    /// The same with empty and repeated tags left out.
    ///
    /// # Errors
    /// More tags, or longer ones, than a run may have; a note that is too long.
    pub fn checked(self) -> miette::Result<Self> {
        let mut tags: Vec<String> = Vec::new();
        for tag in self.tags.iter().map(|tag| tag.trim()).filter(|tag| !tag.is_empty()) {
            if tag.chars().count() > LONGEST_TAG || tag.contains([',', '\n']) {
                miette::bail!(
                    "the tag '{}' has a comma, or more than {LONGEST_TAG} characters",
                    tag.escape_debug()
                );
            }
            if !tags.iter().any(|before| before == tag) {
                tags.push(tag.into());
            }
        }
        if tags.len() > MOST_TAGS || self.note.chars().count() > LONGEST_NOTE {
            miette::bail!("a run has at most {MOST_TAGS} tags and a note of {LONGEST_NOTE} characters");
        }
        Ok(Annotations { tags, note: self.note.trim().into() })
    }

    /// Writes them into a run's folder, whole or not at all. A record or a contract file is never touched.
    ///
    /// # Errors
    /// As [`Annotations::checked`]; a folder that holds no run, or whatever the file system says.
    pub fn write(self, run: &Path) -> miette::Result<()> {
        if !crate::run_dir::has_begun(run) {
            miette::bail!("{} holds no run", run.display());
        }
        let text = toml::to_string(&self.checked()?).map_err(|e| miette::miette!("{e}"))?;
        write_plain(&run.join(ANNOTATIONS), text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(tags: &[&str], note: &str) -> Annotations {
        Annotations { tags: tags.iter().map(ToString::to_string).collect(), note: note.into() }
    }

    #[test]
    fn tags_and_note_come_back_and_bounds_hold() {
        let run = tempfile::tempdir().unwrap();
        let path = run.path();
        assert_eq!(Annotations::read(path).unwrap(), Annotations::default());
        assert!(of(&["dry"], "").write(path).is_err(), "it holds no run");
        std::fs::write(path.join("sessions.jsonl"), "").unwrap();
        of(&[" dry ", "", "tip 3", "dry"], " second\nline \"'<b> ").write(path).unwrap();
        assert_eq!(Annotations::read(path).unwrap(), of(&["dry", "tip 3"], "second\nline \"'<b>"));
        let long = "x".repeat(LONGEST_TAG + 1);
        let many: Vec<String> = (0..=MOST_TAGS).map(|i| i.to_string()).collect();
        let many: Vec<&str> = many.iter().map(String::as_str).collect();
        for bad in [of(&[&long], ""), of(&["a,b"], ""), of(&many, ""), of(&[], &"x".repeat(LONGEST_NOTE + 1))]
        {
            assert!(bad.write(path).is_err());
        }
        assert_eq!(Annotations::read(path).unwrap().tags.len(), 2, "what is refused changes nothing");
        std::fs::write(path.join(ANNOTATIONS), "tags = 3").unwrap();
        assert!(Annotations::read(path).is_err());
    }
}
