//! Profiles that do not come with the program: files beside a setup, and folders of a laboratory's own.
//!
//! A profile is read once, with the files that it names (DBC, EDS), when its setup is read. Driver, emulator,
//! check and record then work with that one text.

use super::{OpenError, bundled};
use instruments::Profile;
use instruments::codec::encoding::{NotText, decoded};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The largest file that a profile may be, or name.
const MAX_BYTES: u64 = 1 << 20;

/// Why a file of a profile is refused.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum FileError {
    #[error(transparent)]
    Io(#[from] std::io::Error),
    #[error("it is not an ordinary file")]
    NotOrdinary,
    #[error("it has more than {MAX_BYTES} bytes")]
    TooLong,
    #[error("it is not UTF-8: {0}")]
    NotUtf8(#[from] std::string::FromUtf8Error),
    #[error(transparent)]
    NotText(#[from] NotText),
    #[error("its profile is called `{0}`: file and `id` must bear one name")]
    OtherName(String),
}

/// A profile as it was read: its text and the files that it names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Source {
    /// Its own id.
    pub id: String,
    /// The file that it was read from.
    pub origin: PathBuf,
    /// Its text.
    pub text: String,
    /// Names and texts of the files that it names.
    pub files: Vec<(String, String)>,
}

impl Source {
    /// Reads a profile, and the files that it names from beside it (or from those that come with the program).
    ///
    /// # Errors
    /// A file that cannot be read, or a profile that does not hold, with the place.
    pub fn read(origin: &Path) -> Result<Self, OpenError> {
        let unreadable = |file: &Path, problem| OpenError::Unreadable { file: file.into(), problem };
        let text = bytes_of(origin).and_then(|bytes| Ok(String::from_utf8(bytes)?));
        let text = text.map_err(|problem| unreadable(origin, problem))?;
        let named = |error| OpenError::Profile { id: origin.display().to_string(), error };
        let files = Profile::names_files(&text).map_err(named)?;
        let folder = origin.parent().unwrap_or(Path::new("."));
        let mut read = Vec::new();
        for name in files {
            let path = folder.join(&name);
            let found = match bundled::file(&name) {
                Some(text) if !path.exists() => text.to_string(),
                // Another program wrote it, in whatever encoding.
                _ => (bytes_of(&path).and_then(|bytes| Ok(decoded(&bytes)?)))
                    .map_err(|problem| unreadable(&path, problem))?,
            };
            read.push((name, found));
        }
        let mut source = Self { id: String::new(), origin: origin.into(), text, files: read };
        source.id = source.profile()?.id().to_string();
        let bundled = bundled::text(&source.id);
        if bundled.is_some_and(|bundled| bundled != source.text) {
            return Err(OpenError::Ambiguous {
                id: source.id,
                places: format!("{} and among the bundled profiles", origin.display()),
                remedy: "give the file's profile an `id` of its own".into(),
            });
        }
        Ok(source)
    }

    /// The profile, its golden vectors run.
    ///
    /// # Errors
    /// What is wrong with it, with the place.
    pub fn profile(&self) -> Result<Profile, OpenError> {
        let file =
            |name: &str| self.files.iter().find(|(known, _)| known == name).map(|(_, text)| text.clone());
        Profile::checked(&self.text, &file)
            .map_err(|error| OpenError::Profile { id: self.origin.display().to_string(), error })
    }
}

/// The folders in which profiles are looked for by their ids, besides the bundled ones.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Library {
    folders: Vec<PathBuf>,
}

impl Library {
    /// These folders; one that does not exist holds nothing.
    pub fn of(folders: Vec<PathBuf>) -> Self {
        Self { folders }
    }

    /// The profile that a setup in the folder `beside` means by `name`: a file's path where it ends with `.toml` or has a `/`,
    /// else the id of a bundled profile, which is `None`, or of `ID.toml` in one of the folders.
    ///
    /// # Errors
    /// A name that means nothing or several things, or a file that does not hold.
    pub fn find(&self, name: &str, beside: &Path) -> Result<Option<Arc<Source>>, OpenError> {
        if name.contains('/') || Path::new(name).extension().is_some_and(|end| end == "toml") {
            return Source::read(&beside.join(name)).map(|source| Some(Arc::new(source)));
        }
        let files = self.folders.iter().map(|folder| folder.join(format!("{name}.toml")));
        let mut sources = Vec::new();
        for file in files.filter(|file| file.exists()) {
            let source = Source::read(&file)?;
            if source.id != name {
                return Err(OpenError::Unreadable { file, problem: FileError::OtherName(source.id) });
            }
            sources.push(source);
        }
        let other = |source: &&Source| source.text != sources[0].text || source.files != sources[0].files;
        if let Some(second) = sources.iter().find(other) {
            return Err(OpenError::Ambiguous {
                id: name.into(),
                places: format!("{} and {}", sources[0].origin.display(), second.origin.display()),
                remedy: "name one by its path".into(),
            });
        }
        match (bundled::text(name), sources.into_iter().next()) {
            (Some(_), _) => Ok(None),
            (None, Some(source)) => Ok(Some(Arc::new(source))),
            (None, None) => Err(self.unknown(name)),
        }
    }

    /// Ids of the files in the folders.
    pub fn ids(&self) -> Vec<String> {
        let entries = self.folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
        let id = |entry: std::fs::DirEntry| {
            let path = entry.path();
            path.extension().filter(|end| *end == "toml")?;
            path.file_stem().map(|stem| stem.to_string_lossy().into_owned())
        };
        let mut ids: Vec<String> = entries.filter_map(Result::ok).filter_map(id).collect();
        ids.sort();
        ids.dedup();
        ids
    }

    fn unknown(&self, name: &str) -> OpenError {
        let known: Vec<String> = bundled::ids().map(String::from).chain(self.ids()).collect();
        let folders: Vec<String> = self.folders.iter().map(|folder| folder.display().to_string()).collect();
        let looked = if folders.is_empty() { "no folder".into() } else { folders.join(", ") };
        OpenError::UnknownProfile { id: name.into(), known: known.join(", "), looked }
    }
}

/// What an ordinary file of a sensible size holds.
fn bytes_of(path: &Path) -> Result<Vec<u8>, FileError> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(FileError::NotOrdinary);
    }
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > MAX_BYTES { Err(FileError::TooLong) } else { Ok(bytes) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder that goes with the test.
    struct Folder(PathBuf);

    impl Folder {
        fn new(name: &str) -> Self {
            let path = std::env::temp_dir().join(format!("muprime-library-{name}-{}", std::process::id()));
            std::fs::create_dir_all(&path).unwrap();
            Self(path)
        }

        fn put(&self, name: &str, text: &str) {
            std::fs::write(self.0.join(name), text).unwrap();
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    fn force(id: &str) -> String {
        let text = bundled::text("muprime-force2").unwrap();
        text.replacen("id = \"muprime-force2\"", &format!("id = \"{id}\""), 1)
    }

    #[test]
    fn a_profile_is_found_by_path_and_by_id() {
        let (beside, shelf) = (Folder::new("beside"), Folder::new("shelf"));
        beside.put("cell.toml", &force("own-cell"));
        shelf.put("lab-cell.toml", &force("lab-cell"));
        let library = Library::of(vec![shelf.0.clone(), shelf.0.join("not-there")]);
        let by_path = library.find("cell.toml", &beside.0).unwrap().unwrap();
        assert_eq!(by_path.profile().unwrap().id(), "own-cell");
        let by_id = library.find("lab-cell", &beside.0).unwrap().unwrap();
        assert_eq!((by_id.id.as_str(), by_id.origin.clone()), ("lab-cell", shelf.0.join("lab-cell.toml")));
        assert_eq!(library.find("muprime-force2", &beside.0).unwrap(), None, "a bundled one");
    }

    #[test]
    fn what_means_nothing_or_two_things_is_refused_with_the_remedy() {
        let (a, b) = (Folder::new("a"), Folder::new("b"));
        let library = Library::of(vec![a.0.clone(), b.0.clone()]);
        let refusal = |name: &str| library.find(name, &a.0).unwrap_err().to_string();
        let unknown = refusal("no-such-thing");
        assert!(
            unknown.contains("muprime-force2") && unknown.contains(&b.0.display().to_string()),
            "{unknown}"
        );
        assert!(refusal("not-there.toml").contains("not-there.toml"));
        a.put("cell.toml", &force("cell"));
        b.put("cell.toml", &force("cell"));
        assert!(library.find("cell", &a.0).is_ok(), "twice the same is one");
        b.put("cell.toml", &force("cell").replacen("maker = \"", "maker = \"not ", 1));
        assert!(refusal("cell").contains("by its path"), "{}", refusal("cell"));
        a.put("wrong-name.toml", &force("cell"));
        assert!(refusal("wrong-name").contains("one name"));
        a.put("shadow.toml", &force("muprime-stage"));
        assert!(refusal("shadow.toml").contains("of its own"), "an id that is taken");
        a.put("bad.toml", &force("bad").replacen("schema = 1", "schema = 9", 1));
        assert!(refusal("bad.toml").contains("line "), "{}", refusal("bad.toml"));
    }

    #[test]
    fn files_that_a_profile_names_are_found_beside_it() {
        let folder = Folder::new("files");
        let text = bundled::text("me-gsv4-can").unwrap().replace("\"me-gsv4-can\"", "\"own-can\"");
        let own = text.replace("muprime-can.dbc", "own.dbc");
        folder.put("own-can.toml", &own);
        let library = Library::of(vec![folder.0.clone()]);
        let missing = library.find("own-can", Path::new(".")).unwrap_err().to_string();
        assert!(missing.contains("own.dbc"), "{missing}");
        folder.put("own.dbc", bundled::file("muprime-can.dbc").unwrap());
        let found = library.find("own-can", Path::new(".")).unwrap().unwrap();
        assert_eq!(found.files[0].0, "own.dbc");
        assert!(found.profile().is_ok());
    }
}
