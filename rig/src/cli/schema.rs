//! `muprime schema KIND`: the JSON Schema of a kind of file.

use crate::out;
use crate::words::schema::Kind;
use miette::IntoDiagnostic;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Kind of file
    kind: Kind,
}

/// Prints the schema.
///
/// # Errors
/// None.
pub fn run(args: &Args) -> miette::Result<ExitCode> {
    out!("{}", serde_json::to_string_pretty(&args.kind.schema()).into_diagnostic()?);
    super::exit(super::DONE)
}
