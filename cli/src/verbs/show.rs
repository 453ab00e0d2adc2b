//! `muprime show [NAME]`: what comes with the program.

use runs::out;
use std::process::ExitCode;
use tables::schemas::bundled::all;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Name of a plan, setup, fingertip or profile; without it all are listed
    name: Option<String>,
}

/// Lists, or prints one file.
///
/// # Errors
/// A name that nothing has.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let all = all();
    match &args.name {
        None if json => all.iter().for_each(|b| out!("{}", serde_json::json!(b))),
        None => all.iter().for_each(|b| out!("{:<10} {:<26} {}", b.kind, b.name, b.about())),
        Some(name) => {
            let Some(found) = all.iter().find(|b| b.name == name) else {
                miette::bail!(
                    help = "`muprime show` lists what there is",
                    "nothing that is bundled is called '{name}'"
                );
            };
            if json {
                out!("{}", serde_json::json!({ "kind": found.kind, "name": found.name, "text": found.text }));
            } else {
                out!("{}", found.text.trim_end());
            }
        }
    }
    super::exit(super::DONE)
}
