//! `muprime init KIND`: a commented file to begin with.

use super::prelude::*;
use runs::files::write_whole;
use tables::schemas::init::{Kind, text};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// What to begin
    kind: Kind,
    /// Write it to this file, and its schema beside it, by which editors complete and check
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Prints the file, or writes it with its schema; refused: a file that is there already, or cannot be
/// written.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let text = text(args.kind);
    let Some(path) = &args.out else {
        return answered(json, &json!({ "kind": args.kind.name(), "text": text }), text.trim_end());
    };
    if path.exists() {
        miette::bail!(help = "give another name with --out", "{} is there already", path.display());
    }
    let schema = path.with_file_name(format!("{}.schema.json", args.kind.name()));
    write_whole(path, text)?;
    write_whole(&schema, serde_json::to_string_pretty(&args.kind.schema()).into_diagnostic()?)?;
    if json {
        answer_json(&json!({ "written": [path, schema] }));
    } else {
        say!("{} and {}; next: muprime check {}", path.display(), schema.display(), quoted(path.display()));
    }
    exit(DONE)
}
