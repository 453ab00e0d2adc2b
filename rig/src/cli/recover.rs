//! `muprime recover FILE`: makes a cut record whole in place, and keeps the original beside it.

use miette::{IntoDiagnostic, WrapErr};
use realtime::recorder::{self, Recovery};
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A record (.mcap)
    file: PathBuf,
}

/// Recovers.
///
/// # Errors
/// A file that is not there, or that holds nothing of a record.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let file = &args.file;
    let shown = || file.display().to_string();
    let bytes = std::fs::read(file).into_diagnostic().wrap_err_with(shown)?;
    let beside = file.with_extension("mcap.part");
    let part = std::fs::File::create(&beside).into_diagnostic().wrap_err_with(shown)?;
    let mut writer = BufWriter::new(part);
    let found = recorder::recover(&bytes, &mut writer).into_diagnostic()?;
    writer.flush().into_diagnostic()?;
    writer.get_ref().sync_all().into_diagnostic()?;
    drop(writer);
    let answer = match &found {
        Recovery::Whole | Recovery::Nothing { .. } => {
            std::fs::remove_file(&beside).into_diagnostic()?;
            None
        }
        Recovery::Rewritten { .. } => {
            let mut original = file.with_extension("mcap.original");
            let mut n = 1;
            while original.exists() {
                n += 1;
                original = file.with_extension(format!("mcap.original-{n}"));
            }
            // The original keeps a name at every instant: link it beside, then move the whole one over it.
            std::fs::hard_link(file, &original)
                .or_else(|_| std::fs::copy(file, &original).map(|_| ()))
                .into_diagnostic()?;
            std::fs::rename(&beside, file).into_diagnostic()?;
            Some(original)
        }
    };
    match found {
        Recovery::Whole => {
            if json {
                println!("{}", serde_json::json!({ "recovered": false, "whole": true }));
            } else {
                eprintln!("{}: whole, nothing to do", file.display());
            }
            super::exit(super::DONE)
        }
        Recovery::Rewritten { messages, damaged, because } => {
            let original = answer.unwrap_or_default();
            if json {
                let said = serde_json::json!({ "recovered": true, "messages": messages, "damaged": damaged,
                    "because": because, "original": original });
                println!("{said}");
            } else {
                eprintln!(
                    "{}: {messages} messages saved ({damaged} damaged); the original is {}\nit was cut: {because}",
                    file.display(),
                    original.display()
                );
            }
            super::exit(super::DONE)
        }
        Recovery::Nothing { because } => {
            miette::bail!("{}: nothing of a record can be read: {because}", file.display())
        }
    }
}
