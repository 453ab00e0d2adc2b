//! What comes from other programs and goes to them, certificates from series, and the check of any file.
//!
//! | module | purpose |
//! |---|---|
//! | [`mod@import`] | foreign tables made into point tables |
//! | [`export`] | a run's passes and record in the formats of other programs |
//! | [`joined`] | several runs or tables of one rig as one table |
//! | [`law`] | a friction law by name or from a file; a law that was tabulated |
//! | [`passes`] | a point table from its bytes, CSV or Parquet |
//! | [`calibrate`] | certificates from data; what only instruments give comes through a bench |
//! | [`schemas`] | schemas from the types, commented beginnings, what is bundled |
//! | [`diagnose`] | the verdict on a table or a run, from its files to those that it is written into |
//! | [`check`] | what is wrong with any file, and whether a plan can run on a setup |

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod calibrate;
pub mod check;
pub mod diagnose;
pub mod export;
pub mod import;
pub mod joined;
pub mod law;
pub mod passes;
pub mod schemas;

/// The answer of a build without a feature. `instead`: what serves in its place.
pub fn built_without(feature: &str, instead: &str) -> miette::Report {
    miette::miette!(
        help =
            format!("build it with `cargo install --path cli` (the feature is on by default), or {instead}"),
        "this muprime was built without its feature `{feature}`"
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    #[test]
    fn a_build_without_a_feature_names_the_folder_that_holds_the_command() {
        let help = super::built_without("mqtt", "leave out --publish").help().expect("a remedy").to_string();
        let folder = help.split("--path ").nth(1).and_then(|rest| rest.split('`').next()).expect("a folder");
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(folder).join("Cargo.toml");
        let manifest = std::fs::read_to_string(manifest).expect("the manifest of a package");
        assert!(manifest.contains("\nname = \"muprime\"\n"), "{folder} does not build the command");
    }
}
