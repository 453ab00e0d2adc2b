//! `muprime man DIR`: manual pages.

use super::prelude::*;
use clap::Command;
use runs::files::{make_folder, write_whole};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder that gets muprime.1, muprime-run.1, ...
    folder: PathBuf,
}

/// Writes a page for the program and for each of its commands; refused: a folder that cannot be written.
pub fn run(args: &Args, command: &Command, json: bool) -> miette::Result<ExitCode> {
    make_folder(&args.folder)?;
    let mut command = command.clone().disable_help_subcommand(true);
    command.build();
    let mut written = Vec::new();
    pages(&command, "muprime", &args.folder, &mut written)?;
    if json {
        answer_json(&json!({ "written": written }));
    } else {
        say!("{} pages in {}", written.len(), args.folder.display());
    }
    exit(DONE)
}

fn pages(command: &Command, name: &str, folder: &Path, written: &mut Vec<PathBuf>) -> miette::Result<()> {
    let (path, mut page) = (folder.join(format!("{name}.1")), Vec::new());
    clap_mangen::Man::new(command.clone()).title(name.to_uppercase()).render(&mut page).into_diagnostic()?;
    write_whole(&path, &page)?;
    written.push(path);
    let mut shown = command.get_subcommands().filter(|s| !s.is_hide_set());
    shown.try_for_each(|sub| pages(sub, &format!("{name}-{}", sub.get_name()), folder, written))
}
