//! `muprime completions SHELL`.

use clap_complete::Shell;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell.
    shell: Shell,
}

/// Prints the script.
///
/// # Errors
/// None.
pub fn run(args: &Args, command: &mut clap::Command) -> miette::Result<ExitCode> {
    clap_complete::generate(args.shell, command, "muprime", &mut std::io::stdout());
    super::exit(super::DONE)
}
