//! `muprime man DIR`: manual pages.

use super::prelude::*;
use runs::files::{make_folder, write_whole};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder that gets muprime.1, muprime-run.1, ...
    folder: PathBuf,
}

/// Writes a page for the program and for each of its commands.
///
/// # Errors
/// A folder that cannot be written.
pub fn run(args: &Args, command: &clap::Command) -> miette::Result<ExitCode> {
    make_folder(&args.folder)?;
    let mut command = command.clone().disable_help_subcommand(true);
    command.build();
    let count = pages(&command, "muprime", &args.folder)?;
    say!("{count} pages in {}", args.folder.display());
    exit(DONE)
}

fn pages(command: &clap::Command, name: &str, folder: &Path) -> miette::Result<usize> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).title(name.to_uppercase()).render(&mut page).into_diagnostic()?;
    write_whole(&folder.join(format!("{name}.1")), &page)?;
    let mut count = 1;
    for sub in command.get_subcommands().filter(|s| !s.is_hide_set()) {
        count += pages(sub, &format!("{name}-{}", sub.get_name()), folder)?;
    }
    Ok(count)
}
