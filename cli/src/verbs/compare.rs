//! `muprime compare RUN_A RUN_B [RUN]...`: two runs side by side, or more of them by groups.

use super::prelude::*;
use runs::ambient::air_words;
use runs::compare::differences::Difference;
use runs::compare::groups::{GroupBy, Grouped, MOST_COMPARED};
use runs::compare::{Compared, ComparisonAnswer};
use runs::format;
use runs::print::folded;
use std::fmt::Write;

/// Most conditions in the table, those furthest apart first.
const PRINTED: usize = 5;
/// Longest value in the table of differences, in characters.
const SHOWN: usize = 24;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the first run
    run_a: PathBuf,
    /// Folder of the second run
    run_b: PathBuf,
    /// Folders of more runs: then all are compared by groups
    #[arg(value_name = "RUN")]
    more: Vec<PathBuf>,
    /// What more than two runs are grouped by [default: run]
    #[arg(long)]
    by: Option<GroupBy>,
    /// Where a page with both of them goes (one HTML file)
    #[arg(long)]
    report: Option<PathBuf>,
    /// End with status 1 if two runs differ
    #[arg(long, conflicts_with_all = ["more", "by"])]
    fail_on_difference: bool,
}

/// Compares; refused: a folder that holds no run, a run without a pass without vibration, a page that cannot
/// be written.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    super::must_exist(&args.run_a, "run")?;
    super::must_exist(&args.run_b, "run")?;
    if !args.more.is_empty() || args.by.is_some() {
        return run_groups(args, json);
    }
    let compared = Compared::of([&args.run_a, &args.run_b])?;
    if let Some(page) = &args.report {
        runs::files::write_output(page, runs::report::comparison::page(&compared)?)?;
        say!("report: {} (the dashboard compares two runs by itself)", page.display());
    }
    answered(json, &json!(compared), folded(&terminal(&compared), 2))?;
    let differ = compared.comparison.answer() == ComparisonAnswer::Differ;
    exit(if args.fail_on_difference && differ { FAILED } else { DONE })
}

/// Compares more than two runs, or two groups of them.
fn run_groups(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let folders: Vec<PathBuf> = [&args.run_a, &args.run_b].into_iter().chain(&args.more).cloned().collect();
    if folders.len() > MOST_COMPARED {
        miette::bail!("{} runs are more than {MOST_COMPARED}", folders.len());
    }
    args.more.iter().try_for_each(|run| super::must_exist(run, "run"))?;
    let grouped = Grouped::of(&folders, args.by.unwrap_or_default())?;
    if let Some(page) = &args.report {
        runs::files::write_output(page, runs::report::groups::page(&grouped)?)?;
        say!("report: {}", page.display());
    }
    let mut text = grouped.warnings.iter().map(|w| format!("note: {w}\n")).collect::<String>();
    let _ = writeln!(text, "{}", grouped.words());
    for group in &grouped.groups {
        let mu0: Vec<String> = group.mu0.iter().map(|mu0| format!("{mu0:.3}")).collect();
        let _ = writeln!(text, "{}: runs {}, mu_0 {}", group.name, group.runs.len(), mu0.join(", "));
    }
    answered(json, &json!(grouped), folded(text.trim_end(), 2))
}

fn terminal(Compared { comparison: result, warnings: warned, differences: differ, .. }: &Compared) -> String {
    let mut text = String::new();
    let w = &mut text;
    for warning in warned {
        let _ = writeln!(w, "note: {warning}");
    }
    let _ = writeln!(w, "{}\n{}", result.answer_words(), result.figures_words().join("\n"));
    let [left, right] = result.unpaired;
    if left + right > 0 {
        let _ = writeln!(w, "passes at conditions that the other run lacks: {left} and {right}");
    }
    let worst = result.furthest_first();
    if !worst.is_empty() {
        w.push_str("largest differences (w peak-to-peak; difference: second minus first):\n");
        w.push_str("  w, \u{b5}m  f, kHz  U, mm/s  F, N  first  second  difference    sd\n");
    }
    for p in worst.iter().take(PRINTED) {
        let _ = writeln!(
            w,
            "  {:5.2} {:7.1} {:+8.1} {:5.2}  {:5.2} {:7.2} {:+11.3} {:+5.1}{}",
            p.amplitude_pp_m * 1e6,
            p.frequency_hz / 1e3,
            p.speed_m_s * f64::from(p.direction) * 1e3,
            p.normal_force_n,
            p.a.mu_relative,
            p.b.mu_relative,
            p.difference,
            p.deviations(),
            air_words(&p.air).map(|level| format!("  {level}")).collect::<String>()
        );
    }
    let none = if differ.is_empty() { "none that both runs state" } else { "" };
    let _ = writeln!(w, "settings that differ: {none}");
    let shown = |value: &Option<String>| match value.as_ref().map(|v| (v, v.parse::<f64>())) {
        None => "none".to_string(),
        Some((_, Ok(value))) if value.fract() != 0.0 => format::number(value),
        Some((text, _)) if text.chars().count() <= SHOWN => text.clone(),
        Some((text, _)) => text.chars().take(SHOWN).collect::<String>() + "...",
    };
    // Of a model that only one run has, its keys and its hash add nothing to its name.
    let alone = differ.iter().any(|d| d.what == "model.toml: schema");
    let detail = |d: &&Difference| d.what.starts_with("model.toml: ") || d.what == "model_identity";
    for d in differ.iter().filter(|d| !(alone && detail(d))) {
        let _ = writeln!(w, "  {}: {} and {}", d.what, shown(&d.a), shown(&d.b));
    }
    text
}
