//! `muprime report FOLDER`: the page of a run, or of a campaign.

use runs::{out, say};
use std::path::PathBuf;
use std::process::ExitCode;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the run, or of the campaign
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
    super::there(&args.run, "run")?;
    if args.run.join(runs::campaign::FILE).is_file() {
        let (claims, made, planned) = super::run::campaign::write(&args.run)?;
        if json {
            out!(
                "{}",
                serde_json::json!({ "report": args.run.join(super::run::campaign::PAGE), "claims": claims })
            );
        } else {
            super::run::campaign::tell(&claims, made, planned, &args.run);
        }
        return super::exit(super::DONE);
    }
    let (html, damage) = runs::report::html_and_damage(&args.run)?;
    let out = args.out.unwrap_or_else(|| args.run.join("report.html"));
    runs::files::write_whole(&out, html)?;
    if json {
        out!("{}", serde_json::json!({ "report": out, "damage": damage }));
    } else {
        say!("report: {}", out.display());
        damage.iter().for_each(|d| say!("{d}"));
    }
    super::exit(super::DONE)
}
