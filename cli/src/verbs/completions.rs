//! `muprime completions SHELL`.

use super::prelude::*;
use clap_complete::Shell;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell.
    shell: Shell,
}

/// Prints the script.
pub fn run(args: &Args, command: &mut clap::Command, json: bool) -> miette::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, command, "muprime", &mut script);
    let text = String::from_utf8_lossy(&script);
    answered(json, &json!({ "shell": args.shell.to_string(), "text": text }), text.trim_end())
}
