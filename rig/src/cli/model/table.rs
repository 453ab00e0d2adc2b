//! `muprime model table`: the study of Fig. 9, or the surrogate's table.

use super::{refused, reproduce};
use crate::figures::fig_9_results;
use crate::figures::reading::Reading;
use crate::figures::store::{self, Kept};
use crate::{out, say};
use clap::Args;
use miette::{IntoDiagnostic, WrapErr};
use models::ridge::study::{content_key, fig_9};
use models::ridge::{RidgeCase, case};
use models::surrogate::{Grid, GridPoint, InterpolationError, Surrogate, TableResult};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Cases that are not in the table, on which its interpolation is judged.
const HELD_OUT: usize = 200;

/// Arguments of `muprime model table`.
#[derive(Args)]
pub struct TableArgs {
    /// Folder for results; a study that stands there goes on
    #[arg(long, default_value = "studies")]
    out: PathBuf,
    /// Compute the surrogate's table instead of the study of Fig. 9
    #[arg(long)]
    surrogate: bool,
    /// Elements of each mesh in the study of Fig. 9, about
    #[arg(long, default_value_t = case::ELEMENTS)]
    elements: usize,
    /// Threads (all cores if left out)
    #[arg(long)]
    threads: Option<usize>,
}

/// Runs what is missing of the study and writes its table.
pub fn run(args: &TableArgs, json: bool) -> miette::Result<ExitCode> {
    if args.threads == Some(0) {
        return refused("--threads 0: at least one is needed");
    }
    if let Err(why) = (RidgeCase { elements: args.elements, ..RidgeCase::paper() }).check() {
        return refused(why);
    }
    std::fs::create_dir_all(&args.out)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", args.out.display()))?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0)).build().into_diagnostic()?;
    let start = Instant::now();
    let (file, cases, failed) = pool.install(|| {
        if args.surrogate { surrogate(&args.out) } else { fig_9_study(&args.out, args.elements) }
    })?;
    let seconds = start.elapsed().as_secs_f64();
    if json {
        out!(
            "{}",
            serde_json::json!({"file": file, "cases": cases, "failed": failed, "wall_seconds": seconds})
        );
    } else {
        out!("{}: {cases} cases, {failed} failed, {seconds:.1} s", file.display());
    }
    Ok(ExitCode::from(u8::from(failed > 0)))
}

fn fig_9_study(out: &Path, elements: usize) -> miette::Result<(PathBuf, usize, usize)> {
    let base = RidgeCase { elements, ..RidgeCase::paper() };
    let (results, failed) = fig_9_results(out, base, Reading::PeakToPeak)?;
    let file = out.join("fig9.csv");
    reproduce::write_fig_9_table(&file, base, &results)?;
    Ok((file, fig_9(base).len(), failed))
}

fn surrogate(out: &Path) -> miette::Result<(PathBuf, usize, usize)> {
    let grid = Grid::SHIPPED;
    let (points, held_out) = (grid.points(), grid.held_out(HELD_OUT));
    let cases = points.iter().chain(&held_out).map(|p| p.case);
    let settings = Grid::settings();
    let (results, failed) = store::complete(&out.join("surrogate.jsonl"), cases, &settings)?;
    let result = |p: &GridPoint| results.get(&content_key(&p.case, &settings)).map(table_result);
    // Twice: the error is that of the table as it is read.
    let bare = Surrogate::table_text(&grid, result, InterpolationError::default()).into_diagnostic()?;
    let judged = held_out.iter().filter_map(|p| result(p).map(|r| (p, r)));
    let error = Surrogate::from_text(&bare).into_diagnostic()?.measure_error(judged);
    let file = out.join("ridge_table.txt");
    let text = Surrogate::table_text(&grid, result, error).into_diagnostic()?;
    crate::files::write_whole(&file, text)?;
    say!(
        "interpolation error on {} held-out cases: mu' rms {:.4}, worst {:.4}; phase rms {:.1} deg",
        error.cases,
        error.mu_rms,
        error.mu_max,
        error.phase_rms_deg
    );
    Ok((file, points.len() + held_out.len(), failed))
}

fn table_result(kept: &Kept) -> TableResult {
    TableResult {
        mu_relative: kept.mu_relative,
        phase_shift_deg: kept.phase_shift_deg.unwrap_or(0.0),
        contact_fraction: kept.contact_fraction,
    }
}
