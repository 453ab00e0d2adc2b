//! `muprime check FILE...`: says what is wrong with setups, plans, profiles and other files, with the place.

use crate::plan::Plan;
use crate::setup::Setup;
use crate::{out, say};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Files
    #[arg(required = true)]
    files: Vec<PathBuf>,
}

/// Checks every file; the status tells of the worst.
///
/// # Errors
/// None: what is wrong with the files is the answer.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let mut worst = super::DONE;
    for file in &args.files {
        let verdict = check(file);
        if json {
            let said = match &verdict {
                Ok(kind) => serde_json::json!({ "file": file, "ok": true, "kind": kind }),
                Err(e) => serde_json::json!({ "file": file, "ok": false, "problem": format!("{e}") }),
            };
            out!("{said}");
        } else {
            match &verdict {
                Ok(kind) => say!("{}: a good {kind}", file.display()),
                Err(e) => say!("{}:\n{e:?}", file.display()),
            }
        }
        if verdict.is_err() {
            worst = super::REFUSED;
        }
    }
    super::exit(worst)
}

/// What kind of file it is, judged by its own first words, and whether it holds.
fn check(path: &Path) -> miette::Result<&'static str> {
    let text = crate::input::text_of(path)?;
    let name = path.display().to_string();
    let table: toml::Table = crate::input::parse_toml(&name, &text)?;
    let has = |key: &str| table.contains_key(key);
    if has("profile") {
        crate::rehearsal::of(path).map_err(|problem| miette::miette!("{problem}"))?;
        Ok("profile")
    } else if has("amplifier") || has("force") || has("stage") {
        Setup::parse(&name, &text, path.parent().unwrap_or(Path::new(".")))?;
        Ok("setup")
    } else if has("series") || has("base") {
        Plan::parse(&name, &text)?;
        Ok("plan")
    } else if has("content_sha256") || has("covariance") {
        crate::cli::calibrate::check(&name, &text)?;
        Ok("certificate")
    } else if has("defect") || has("channel") {
        sim::defects::Defects::parse(&text).map_err(|e| miette::miette!("{e}"))?;
        Ok("defects file")
    } else {
        miette::bail!(
            help = "a profile has [profile], a setup [amplifier], a plan [base] and [[series]], defects [[defect]], a certificate content_sha256",
            "{name} is none of the files that muprime knows"
        )
    }
}
