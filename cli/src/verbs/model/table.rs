//! `muprime model table`: the study of Fig. 9, or the surrogate's table.

mod phases;

use super::{refused, reproduce};
use crate::verbs::prelude::*;
use clap::Args;
use models::ridge::study::content_key;
use models::ridge::{RidgeCase, case};
use models::surrogate::{GridPoint, InterpolationError, Surrogate, SurrogateGrid, TableResult};
use std::collections::HashMap;
use std::time::Instant;
use studies::cases::file::Header;
use studies::cases::kinds::table::{self, HELD_OUT};
use studies::cases::run::all;
use studies::figures::Study;
use studies::figures::reading::{self, Reading};

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
    /// How the paper's w is read
    #[arg(long, value_parser = reading::parser(), default_value = "peak-to-peak")]
    reading: Reading,
    /// At rest, for the phase shift: frequencies, moduli and forces
    #[arg(long)]
    at_rest: bool,
    /// 20 amplitudes from 0.3 to 5 um instead of 12 from 0.1
    #[arg(long)]
    fine: bool,
    /// Mean pressure at 0.25 N in Pa
    #[arg(long, default_value_t = case::MEAN_PRESSURE_AT_QUARTER_NEWTON_PA)]
    mean_pressure_pa: f64,
    /// Mass damping in 1/s
    #[arg(long, default_value_t = case::MASS_DAMPING_PER_S)]
    mass_damping_per_s: f64,
    /// Threads (all cores if left out)
    #[arg(long)]
    threads: Option<usize>,
}

impl TableArgs {
    fn study(&self) -> Study {
        let paper = RidgeCase::paper();
        let base = RidgeCase {
            elements: self.elements,
            mean_pressure_pa: self.mean_pressure_pa,
            mass_damping_per_s: self.mass_damping_per_s,
            speed_m_s: if self.at_rest { 0.0 } else { paper.speed_m_s },
            ..paper
        };
        Study { base, reading: self.reading, w_m: reproduce::ladder(self.fine) }
    }
}

/// Runs what is missing of the study and writes its table.
pub fn run(args: &TableArgs, json: bool) -> miette::Result<ExitCode> {
    if args.threads == Some(0) {
        miette::bail!("--threads 0: at least one is needed");
    }
    args.study().base.check().map_err(refused)?;
    std::fs::create_dir_all(&args.out)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot make the folder {}", args.out.display()))?;
    let pool =
        rayon::ThreadPoolBuilder::new().num_threads(args.threads.unwrap_or(0)).build().into_diagnostic()?;
    let start = Instant::now();
    let (file, cases, failed) = pool.install(|| {
        if args.surrogate { surrogate(&args.out) } else { fig_9_study(&args.out, args.study()) }
    })?;
    let seconds = start.elapsed().as_secs_f64();
    let document = json!({"file": file, "cases": cases, "failed": failed, "wall_seconds": seconds});
    let words = format!("{}: {cases} cases, {failed} failed, {seconds:.1} s", file.display());
    answered(json, &document, words)?;
    Ok(ExitCode::from(u8::from(failed > 0)))
}

fn fig_9_study(out: &Path, study: Study) -> miette::Result<(PathBuf, usize, usize)> {
    let (results, failed) = study.results(out)?;
    let name = if study.base.speed_m_s == 0.0 { "fig9_at_rest" } else { "fig9" };
    let file = out.join(format!("{}.csv", reading::file(study.reading, name)));
    reproduce::write_fig_9_table(&file, study, &results)?;
    let points = study.points();
    if study.base.speed_m_s == 0.0 {
        phases::lines(study, &results).iter().for_each(|line| say!("{line}"));
    }
    Ok((file, points.len(), failed))
}

fn surrogate(out: &Path) -> miette::Result<(PathBuf, usize, usize)> {
    let grid = SurrogateGrid::SHIPPED;
    let (points, held_out) = (grid.points(), grid.held_out(HELD_OUT));
    let settings = SurrogateGrid::settings();
    let header = Header::of(&table::KIND, &serde_json::Value::Null, (points.len() + HELD_OUT) as u64)?;
    let entries = all(out, "surrogate-table", header, None)?;
    let key = |p: &GridPoint| content_key(&p.case, &settings);
    let found: HashMap<String, TableResult> = (points.iter().chain(&held_out).zip(&entries))
        .filter_map(|(point, entry)| Some((key(point), table::result(entry)?)))
        .collect();
    let failed = entries.iter().filter(|entry| entry.outcome.is_err()).count();
    let result = |p: &GridPoint| found.get(&key(p)).copied();
    // Twice: the error is that of the table as it is read.
    let bare = Surrogate::table_text(&grid, result, InterpolationError::default()).into_diagnostic()?;
    let judged = held_out.iter().filter_map(|p| result(p).map(|r| (p, r)));
    let error = Surrogate::from_text(&bare).into_diagnostic()?.measure_error(judged);
    let file = out.join("ridge_table.txt");
    let text = Surrogate::table_text(&grid, result, error).into_diagnostic()?;
    runs::files::write_whole(&file, text)?;
    let InterpolationError { cases, mu_rms, mu_max, phase_rms_deg, .. } = error;
    say!(
        "interpolation error on {cases} held-out cases: mu' rms {mu_rms:.4}, worst {mu_max:.4}; \
         phase rms {phase_rms_deg:.1} deg"
    );
    Ok((file, points.len() + held_out.len(), failed))
}
