//! `muprime report FOLDER`: the page of a run, or of a campaign.

use super::prelude::*;
use runs::report::published;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the run, or of the campaign
    run: PathBuf,
    /// Where to write it [default: report.html in the run's folder]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Published values on the same axes: `paper` (what the text of Vezzoli et al., part 1, states), or a
    /// CSV file of your own with the columns `source`, `mu_relative` and `amplitude_pp_m`,
    /// `frequency_hz` or `speed_m_s`; may be repeated
    #[arg(long, value_name = "paper|FILE")]
    overlay: Vec<String>,
}

/// Writes the report; refused: a folder that holds no run, or a place that cannot be written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    super::must_exist(&args.run, "run")?;
    if args.run.join(runs::campaign::FILE).is_file() {
        if !args.overlay.is_empty() {
            let help = "give the folder of one of its runs";
            miette::bail!(help = help, "--overlay: {} is a campaign", args.run.display());
        }
        let (claims, made, planned) = super::run::campaign::write(&args.run)?;
        if json {
            answer_json(&json!({ "report": args.run.join(super::run::campaign::PAGE), "claims": claims }));
        } else {
            let command = format!("muprime run {}, with its options", quoted(args.run.display()));
            super::run::campaign::tell(&claims, made, planned, &args.run, &command);
        }
        return exit(DONE);
    }
    let overlay: miette::Result<Vec<_>> = args.overlay.iter().map(|name| published::of(name)).collect();
    // Made again from the record, so that the page and the file agree with this version.
    let fidelity = runs::fidelity::write(&args.run)?;
    let (html, damage) = runs::report::html(&args.run, &overlay?.concat(), None)?;
    let out = args.out.unwrap_or_else(|| args.run.join("report.html"));
    runs::files::write_output(&out, html)?;
    if json {
        answer_json(&json!({ "report": out, "damage": damage }));
    } else {
        fidelity.iter().flat_map(runs::report::fidelity::lines).for_each(|line| say!("{line}"));
        say!("report: {}", out.display());
        damage.iter().for_each(|d| say!("{d}"));
    }
    exit(DONE)
}
