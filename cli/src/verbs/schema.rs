//! `muprime schema KIND`: the JSON Schema of a kind of file.

use super::prelude::*;
use tables::schemas::schema::Kind;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Kind of file
    kind: Kind,
}

/// Prints the schema.
pub fn run(args: &Args) -> miette::Result<ExitCode> {
    out!("{}", serde_json::to_string_pretty(&args.kind.for_editors()).into_diagnostic()?);
    exit(DONE)
}
