//! `muprime doc profile FILE`: what an instrument reads and writes, as a page.

use super::prelude::*;

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Print a page of Markdown: link, frames, registers or lines, units, resolution, set-points, faults, sources
    Profile {
        /// A profile: a file, or the id of one that is bundled or in a folder of profiles
        profile: String,
    },
}

/// Prints the page; refused: a profile that is not there or does not hold.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let What::Profile { profile: name } = &args.what;
    let found = runs::setup::library().find(name, Path::new("")).into_diagnostic()?;
    let profile =
        found.map_or_else(|| drivers::profile(name), |source| source.profile()).into_diagnostic()?;
    let page = instruments::document::markdown(&profile);
    answered(json, &json!({ "id": profile.id(), "markdown": page }), page.trim_end())
}
