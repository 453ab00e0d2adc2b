//! This program's version, its exact build, and the models that it holds, to trace results.

use calibration::certificate::{sha256_hex, sha256_of};
use models::ridge::study::MODEL_VERSION;
use models::surrogate::DEFAULT_TABLE;
use serde::Serialize;

/// The commit of a build (`MUPRIME_COMMIT` when it was compiled, as `packaging/build` has it). A program that
/// reads git itself would have to be compiled again at every commit, or show an old one.
const COMMIT: Option<&str> = option_env!("MUPRIME_COMMIT");

/// Version, build and models.
#[derive(Clone, Debug, Serialize)]
pub struct Version {
    /// Of the package.
    pub version: &'static str,
    /// The build.
    pub build: Build,
    /// The models.
    pub models: Models,
}

/// The very build.
#[derive(Clone, Debug, Serialize)]
pub struct Build {
    /// SHA-256 of the program's own file; `None` where it cannot be read.
    pub program_sha256: Option<String>,
    /// The commit, given at compilation; `None` if none was given.
    pub commit: Option<&'static str>,
    /// Architecture, system and C library.
    pub target: String,
    /// `release`, or `debug` with the assertions of a debug build.
    pub profile: &'static str,
    /// The features that are in.
    pub features: Vec<&'static str>,
}

/// What the answers of the models come from. A hash that differs is another model.
#[derive(Clone, Debug, Serialize)]
pub struct Models {
    /// Version of the finite element ridge, raised whenever its results change.
    pub ridge_version: u32,
    /// SHA-256 of the table that the surrogate interpolates.
    pub surrogate_table_sha256: String,
    /// Number of candidate effects.
    pub effects: usize,
    /// SHA-256 of `muprime model effects --json`: their forms, parameters and priors.
    pub effects_sha256: String,
}

/// Of the models that are compiled in.
pub fn models() -> Models {
    let effects = effects::library();
    let listed = serde_json::to_string(&effects).unwrap_or_default();
    Models {
        ridge_version: MODEL_VERSION,
        surrogate_table_sha256: sha256_hex(DEFAULT_TABLE.as_bytes()),
        effects: effects.len(),
        effects_sha256: sha256_hex(listed.as_bytes()),
    }
}

/// SHA-256 of the running program's file, if it can be read: two builds of one version are two programs.
pub fn program_sha256() -> std::io::Result<String> {
    std::fs::File::open(std::env::current_exe()?).and_then(sha256_of)
}

/// Of this program, built with these features; its file is read for its hash.
pub fn of_this_program(features: Vec<&'static str>) -> Version {
    let libc = match () {
        () if cfg!(target_env = "gnu") => "-gnu",
        () if cfg!(target_env = "musl") => "-musl",
        () if cfg!(target_env = "msvc") => "-msvc",
        () => "",
    };
    Version {
        version: env!("CARGO_PKG_VERSION"),
        build: Build {
            program_sha256: program_sha256().ok(),
            commit: COMMIT.filter(|commit| !commit.is_empty()),
            target: format!("{}-{}{libc}", std::env::consts::ARCH, std::env::consts::OS),
            profile: if cfg!(debug_assertions) { "debug" } else { "release" },
            features,
        },
        models: models(),
    }
}

impl Version {
    /// For a terminal: the first line is what `-V` says.
    pub fn words(&self) -> String {
        let (build, models) = (&self.build, &self.models);
        let features = if build.features.is_empty() { "none".to_string() } else { build.features.join(" ") };
        format!(
            "muprime {}\nbuild    {}\n  commit   {}\n  target   {}, {}\n  features {features}\nmodels\n  ridge    version {}\n  surrogate {}\n  effects  {} of them, {}",
            self.version,
            build.program_sha256.as_deref().unwrap_or("the program's file cannot be read"),
            build.commit.unwrap_or("unknown (set MUPRIME_COMMIT when compiling)"),
            build.target,
            build.profile,
            models.ridge_version,
            models.surrogate_table_sha256,
            models.effects,
            models.effects_sha256,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hashes_are_of_what_they_say() {
        let program = of_this_program(Vec::new());
        let own = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        assert_eq!(program.build.program_sha256.as_deref(), Some(sha256_hex(&own).as_str()));
        assert!(program.words().starts_with(concat!("muprime ", env!("CARGO_PKG_VERSION"), "\n")));
        // The surrogate is read from the very text that is hashed.
        let read = models::surrogate::Surrogate::from_text(DEFAULT_TABLE).unwrap();
        assert_eq!(read.inputs_hash, models::surrogate::Surrogate::shipped().unwrap().inputs_hash);
        assert_eq!(program.models.effects, effects::library().len());
    }
}
