//! `muprime init KIND`: a commented file to begin with.

use runs::out;
use std::process::ExitCode;
use tables::schemas::init::{Kind, text};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// What to begin
    kind: Kind,
}

/// Prints the file.
///
/// # Errors
/// None.
pub fn run(args: &Args) -> miette::Result<ExitCode> {
    out!("{}", text(args.kind).trim_end());
    super::exit(super::DONE)
}
