//! `muprime model tabulate`: a law that a program computes, as a table that the loop and the diagnosis read.

use crate::verbs::prelude::*;
use clap::Args;
use models::law_table::ANSWERS;
use models::law_table::grid::{LawGrid, Tabulated};
use std::io::Write;
use std::process::{Command, Stdio};

/// Arguments of `muprime model tabulate`.
#[derive(Args)]
pub struct TabulateArgs {
    /// Program that computes the law, run once by the shell. It reads CSV from standard input: a header with
    /// the names of --grid, then a row for each condition. It writes CSV to standard output: the header
    /// mu_relative or mu_relative,mu_relative_sd, then a row for each condition in the same order
    #[arg(long, value_name = "PROGRAM")]
    command: String,
    /// Values of a variable that the law depends on, with :log in equal ratios: amplitude_pp_m, frequency_hz,
    /// speed_m_s, normal_force_n, mu0 (may be repeated)
    #[arg(long, value_name = "NAME=LOW..HIGH:COUNT[:log]", required = true)]
    grid: Vec<String>,
    /// The law table (CSV)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Greatest interpolation error of mu' at which the table is written
    #[arg(long, default_value_t = 0.02)]
    tolerance: f64,
    /// Write the table whatever its interpolation error; mu_relative_sd holds it
    #[arg(long)]
    accept_error: bool,
    /// Fresh calls between the nodes, against which the table is checked
    #[arg(long, default_value_t = 512)]
    checks: usize,
}

/// Tabulates, checks, writes; refused: a grid that is none, a program that fails or answers what is no law, a
/// table that is too coarse; nothing is written then.
pub fn run(args: &TabulateArgs, json: bool) -> miette::Result<ExitCode> {
    let grid = LawGrid::parse(args.grid.iter().map(String::as_str)).map_err(|e| miette::miette!("{e}"))?;
    let answers = answers(&args.command, &conditions(&grid, args.checks))?;
    let made = grid.table(args.checks, &answers).map_err(|e| {
        let help = "correct the program, or choose a grid within its domain";
        miette::miette!(help = help, "{}: {e}", args.command)
    })?;
    let tolerance = if args.accept_error { f64::INFINITY } else { args.tolerance };
    let origin = format!("command {}", args.command);
    let (text, sha256) = tables::law::file_of(&made, &origin, tolerance)?;
    runs::files::write_output(&args.out, text)?;
    let Tabulated { checks, greatest, place, rms, .. } = &made;
    let rows = answers.len() - checks;
    let document = json!({
        "file": args.out, "rows": rows, "sha256": sha256, "checks": checks,
        "error_greatest": greatest, "error_greatest_at": place, "error_rms": rms,
    });
    let differs = format!("mu' differs by {greatest:.4} at most (at {place}), rms {rms:.4}");
    let words = format!("{}: {rows} rows; against {checks} fresh calls {differs}", args.out.display());
    answered(json, &document, words)
}

/// What the program reads.
fn conditions(grid: &LawGrid, checks: usize) -> String {
    let mut text = grid.columns().join(",") + "\n";
    for row in grid.conditions(checks) {
        text += &(row.iter().map(|v| format!("{v:e}")).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

fn answers(command: &str, conditions: &str) -> miette::Result<Vec<[f64; 2]>> {
    let failed = || format!("the program `{command}`");
    let mut program = Command::new("sh");
    program.args(["-c", command]).stdin(Stdio::piped()).stdout(Stdio::piped());
    let mut child = program.spawn().into_diagnostic().wrap_err_with(failed)?;
    let mut input = child.stdin.take();
    // Written beside the reading: neither pipe may fill up. A program that stops reading early answers too
    // few.
    let output = std::thread::scope(|scope| {
        scope.spawn(move || input.take().map(|mut input| input.write_all(conditions.as_bytes())));
        child.wait_with_output()
    });
    let output = output.into_diagnostic().wrap_err_with(failed)?;
    if !output.status.success() {
        let help = "try it by hand on a CSV of conditions";
        miette::bail!(help = help, "{} failed: {}", failed(), output.status);
    }
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&output.stdout[..]);
    let header = reader.headers().into_diagnostic().wrap_err_with(failed)?.clone();
    let [mu, sd] = ANSWERS.map(|(name, _)| header.iter().position(|h| h == name));
    let Some(mu) = mu else {
        let first = header.iter().collect::<Vec<_>>().join(",");
        let help = "its first line must be `mu_relative` or `mu_relative,mu_relative_sd`";
        miette::bail!(help = help, "{} wrote the header '{first}'", failed());
    };
    let number =
        |row: &csv::StringRecord, k: usize| row.get(k).and_then(|t| t.parse().ok()).unwrap_or(f64::NAN);
    let answer = |row: csv::Result<csv::StringRecord>| {
        let row = row.into_diagnostic().wrap_err_with(failed)?;
        Ok([number(&row, mu), sd.map_or(0.0, |k| number(&row, k))])
    };
    reader.records().map(answer).collect()
}
