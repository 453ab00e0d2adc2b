//! `muprime report RUN`.

use miette::{IntoDiagnostic, WrapErr};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the run
    run: PathBuf,
    /// Where to write it [default: report.html in the run's folder]
    #[arg(long)]
    out: Option<PathBuf>,
}

/// Writes the report.
///
/// # Errors
/// A folder that holds no run, or a place that cannot be written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let html = crate::report::html(&args.run)?;
    let out = args.out.unwrap_or_else(|| args.run.join("report.html"));
    std::fs::write(&out, html).into_diagnostic().wrap_err_with(|| out.display().to_string())?;
    if json {
        println!("{}", serde_json::json!({ "report": out }));
    } else {
        eprintln!("report: {}", out.display());
    }
    super::exit(super::DONE)
}
