//! `muprime diagnose`: where the gap lies, which effect causes it, how far it shrinks.

mod certificates;

use crate::input::{MAX_TABLE_BYTES, bytes_of};
use crate::print::folded;
use crate::report::about;
use crate::{out, say};
use calibration::certificate::sha256_hex;
use clap::Args as ClapArgs;
use diagnosis::data::Table;
use diagnosis::hypotheses::Options;
use diagnosis::progress::{Progress, Stage};
use diagnosis::verdict::{Diagnosis, diagnose};
use indicatif::ProgressBar;
use miette::{Context, IntoDiagnostic};
use models::condition::Condition;
use models::covariate::{self, Covariate};
use models::record::{Pass, read_passes};
use models::rig_file::RigFile;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};

/// Parts of the operating space that are told in words, the largest first.
const TOLD: usize = 6;

/// Say where simulation and reality part on a table of passes, which effect causes it, and how far it shrinks.
#[derive(Debug, ClapArgs)]
pub struct Args {
    /// A point table (CSV or Parquet), or a run's folder with points.csv and rig.toml.
    pub data: PathBuf,
    /// What the rig's calibration states; without it, the rig.toml beside the table.
    #[arg(long)]
    pub rig: Option<PathBuf>,
    /// Conditions to predict (a point table without lateral_force_n).
    #[arg(long, requires = "predictions")]
    pub predict: Option<PathBuf>,
    /// Where the predictions go.
    #[arg(long, requires = "predict")]
    pub predictions: Option<PathBuf>,
    /// Where the corrected model goes, for `muprime run --model`.
    #[arg(long)]
    pub save_model: Option<PathBuf>,
    /// Where the report goes (one HTML page).
    #[arg(long)]
    pub report: Option<PathBuf>,
    /// Where a plan of the best next experiment goes, for `muprime run`.
    #[arg(long)]
    pub save_plan: Option<PathBuf>,
    /// Try single effects only.
    #[arg(long)]
    pub no_pairs: bool,
    /// Leave an effect out of the library (may be repeated).
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
}

/// Reads, diagnoses, writes what was asked for.
///
/// # Errors
/// Files that cannot be read or written, tables and rigs that are refused; nothing is written then.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let (table_path, beside) = if args.data.is_dir() {
        (args.data.join("points.csv"), args.data.join("rig.toml"))
    } else {
        let folder = args.data.parent().unwrap_or(Path::new("."));
        (args.data.clone(), folder.join("rig.toml"))
    };
    let rig_path = args.rig.as_deref().unwrap_or(&beside);
    let rig = crate::input::rig_file(rig_path)
        .wrap_err_with(|| format!("the rig's calibration {} (name it with --rig)", rig_path.display()))?;
    let damage = if args.data.is_dir() { crate::run_dir::damage_in(&args.data)? } else { Vec::new() };
    let bytes = bytes_of(&table_path, MAX_TABLE_BYTES)
        .wrap_err_with(|| format!("cannot read the table {}", table_path.display()))?;
    let passes = parse_passes(&table_path, &bytes)?;
    let table =
        Table::measured(&passes).into_diagnostic().wrap_err_with(|| table_path.display().to_string())?;
    for name in &args.without {
        if effects::by_name(name).is_none() {
            miette::bail!("--without {name}: no such effect; `muprime model effects` lists them");
        }
    }
    let conditions = match &args.predict {
        Some(path) => {
            let rows = read_table(path)?;
            let origin = table.origin(&passes);
            Some(
                Table::conditions(&rows, &origin)
                    .into_diagnostic()
                    .wrap_err_with(|| path.display().to_string())?,
            )
        }
        None => None,
    };
    let bar = crate::progress::bar(1000, "per mille");
    let progress = follow(&bar, json)?;
    let options =
        Options { pairs: !args.no_pairs, without: args.without.clone(), progress, ..Options::default() };
    let result = diagnose(&table, &rig, &options, sha256_hex(&bytes));
    bar.finish_and_clear();
    if let (Some(conditions), Some(out)) = (&conditions, &args.predictions) {
        write_text(out, &predictions(&result, conditions))?;
    }
    if let Some(out) = &args.save_model {
        match result.saved_model() {
            Some(model) => write_text(out, &toml::to_string(&model).into_diagnostic()?)?,
            None => {
                say!("no model written to {}: no effect of the library causes most of the gap", out.display())
            }
        }
    }
    if let Some(out) = &args.save_plan {
        match result.report.next_experiment.iter().find(|e| !e.conditions.is_empty()) {
            Some(experiment) => write_text(out, &plan(experiment))?,
            None => say!("no plan written to {}: no conditions would tell more", out.display()),
        }
    }
    if let Some(out) = &args.report {
        let about = if args.data.is_dir() {
            about::of_run(&args.data, &crate::run_dir::said(&args.data).unwrap_or_default(), Some(&rig))
        } else {
            let named =
                vec![("table", table_path.display().to_string()), ("rig", rig_path.display().to_string())];
            [named, about::of_rig(&rig)].concat()
        };
        write_text(out, &crate::report::diagnosis::page(&result, &table, &about)?)?;
    }
    if json {
        out!("{}", document(&result, &rig, &damage)?);
    } else {
        damage.iter().for_each(|d| say!("{}", folded(&format!("damaged: {d}"), 4)));
        out!("{}", folded(words(&result, &rig).trim_end(), 4));
    }
    Ok(ExitCode::SUCCESS)
}

/// The verdict as `--json` prints it: the report, what is damaged in the run's folder, and the certificates that it speaks against.
///
/// # Errors
/// Only if a number cannot be written as JSON.
pub fn document(result: &Diagnosis, rig: &RigFile, damage: &[String]) -> miette::Result<String> {
    let mut report = serde_json::to_value(&result.report).into_diagnostic()?;
    let faults = certificates::at_fault(result, rig);
    let doubts = certificates::in_doubt(rig, &result.report.stiffness_pulls);
    if !damage.is_empty() {
        report["damage"] = serde_json::to_value(damage).into_diagnostic()?;
    }
    if !faults.is_empty() {
        report["certificates_at_fault"] = serde_json::to_value(&faults).into_diagnostic()?;
    }
    if !doubts.is_empty() {
        report["certificates_in_doubt"] = serde_json::to_value(&doubts).into_diagnostic()?;
    }
    serde_json::to_string(&report).into_diagnostic()
}

/// The verdict for a person, certificates included.
pub fn words(result: &Diagnosis, rig: &RigFile) -> String {
    let mut text = terminal(result);
    let faults = certificates::at_fault(result, rig);
    let doubts = certificates::in_doubt(rig, &result.report.stiffness_pulls);
    for more in faults.iter().map(|f| f.text()).chain(doubts.iter().map(|d| d.text())) {
        text.push_str(&more);
        text.push('\n');
    }
    text
}

/// A bar that follows a diagnosis; on Ctrl-C the effects that lead so far are told.
fn follow(bar: &ProgressBar, json: bool) -> miette::Result<Progress> {
    let reached: Arc<Mutex<Option<Stage>>> = Arc::default();
    let kept = Arc::clone(&reached);
    crate::progress::on_interrupt(bar, move |_| {
        let stage = reached.lock().unwrap_or_else(PoisonError::into_inner).clone();
        tell_partial(stage.as_ref(), json);
    })?;
    let bar = bar.clone();
    Ok(Progress::to(move |stage| {
        // A second look at the table begins anew: the bar stays where it was.
        bar.set_position(bar.position().max((1e3 * stage.share) as u64));
        bar.set_message(stage.doing);
        let mut reached = kept.lock().unwrap_or_else(PoisonError::into_inner);
        let leading = reached.take().map(|before| before.leading).filter(|_| stage.leading.is_empty());
        *reached = Some(Stage { leading: leading.unwrap_or(stage.leading), ..stage });
    }))
}

/// What a diagnosis that was stopped knew.
fn tell_partial(stage: Option<&Stage>, json: bool) {
    let leading: &[_] = stage.map_or(&[], |stage| &stage.leading);
    let (doing, share) = stage.map_or(("reading", 0.0), |stage| (stage.doing, stage.share));
    if json {
        let leading: Vec<_> = leading
            .iter()
            .map(
                |(effects, nats)| serde_json::json!({ "effects": effects, "log_evidence_over_no_gap": nats }),
            )
            .collect();
        out!(
            "{}",
            serde_json::json!({ "partial": true, "doing": doing, "share": share, "leading": leading })
        );
        return;
    }
    out!("partial: stopped at {:.0} % ({doing}); no verdict", 100.0 * share);
    if leading.is_empty() {
        out!("  no effect was fitted yet");
    }
    for (effects, nats) in leading.iter().take(TOLD) {
        out!("  {:+9.1} nats over no gap  {}", nats, effects.join(" + "));
    }
}

fn read_table(path: &Path) -> miette::Result<Vec<Pass>> {
    let bytes =
        bytes_of(path, MAX_TABLE_BYTES).wrap_err_with(|| format!("cannot read {}", path.display()))?;
    parse_passes(path, &bytes)
}

/// The passes of a point table, CSV or Parquet.
///
/// # Errors
/// A table that cannot be read, with its row.
pub fn parse_passes(path: &Path, bytes: &[u8]) -> miette::Result<Vec<Pass>> {
    if bytes.starts_with(b"PAR1") {
        let csv = crate::import::parquet_as_csv(path).wrap_err_with(|| path.display().to_string())?;
        return read_passes(csv.as_bytes()).into_diagnostic().wrap_err_with(|| path.display().to_string());
    }
    read_passes(bytes).into_diagnostic().wrap_err_with(|| path.display().to_string())
}

/// What `--predictions` holds: CSV, a row a condition.
pub fn predictions(result: &Diagnosis, conditions: &Table) -> String {
    let mut text = String::from(
        "point,lateral_force_baseline_n,lateral_force_corrected_n,lateral_force_corrected_sd_n\n",
    );
    for (point, f) in conditions.points.iter().zip(result.predict(conditions)) {
        text.push_str(&format!("{point},{:e},{:e},{:e}\n", f.baseline, f.corrected, f.corrected_sd));
    }
    text
}

/// The plan of a designed experiment, one series a condition: those that tell most first, grouped by pressure, since
/// a chamber is changed once.
fn plan(experiment: &diagnosis::next::Experiment) -> String {
    let mut conditions = experiment.conditions.clone();
    let pressure = |c: &Condition| c.ambient_pressure_pa.unwrap_or(0.0);
    conditions.sort_by(|a, b| pressure(b).total_cmp(&pressure(a)));
    let Some(base) = conditions.first() else { return String::new() };
    let about = toml::Value::String(experiment.text.clone());
    // Every plan has the settings that every table has, but the direction; a series names what the base cannot.
    let based = |c: &&Covariate| covariate::REQUIRED.iter().any(|r| r.name == c.name);
    let of = |c: &Condition, k: &Covariate| k.of(c).map(|v| (k.name, v));
    let listed = |k: &&Covariate| k.name != covariate::DIRECTION.name;
    let mut text = format!(
        "name = \"next-experiment\"\nabout = {about}\nrandomise = false\n\n[base]\n{}",
        covariate::planned()
            .filter(|k| listed(k) && based(k))
            .filter_map(|k| of(base, k))
            .map(|(name, value)| format!("{name} = {value:e}\n"))
            .collect::<String>()
    );
    for c in &conditions {
        text.push_str(&format!("\n[[series]]\ndirections = [{}]\n", i8::from(c.direction)));
        for (name, value) in covariate::planned().filter(listed).filter_map(|k| of(c, k)) {
            text.push_str(&format!("{name} = [{value:e}]\n"));
        }
    }
    text
}

fn write_text(path: &Path, text: &str) -> miette::Result<()> {
    crate::files::write_whole(path, text)
}

/// What a terminal shows.
pub fn terminal(result: &Diagnosis) -> String {
    let r = &result.report;
    let mut text = format!("{}\n\nHypotheses\n", r.text);
    for h in r.hypotheses.iter().filter(|h| h.probability > 0.005).take(8) {
        let name = if h.effects.is_empty() { "no gap".to_string() } else { h.effects.join(" + ") };
        text.push_str(&format!("  {:5.3}  {name}", h.probability));
        if h.alias_class.len() > 1 {
            text.push_str(&format!("  (not told from {})", h.alias_class[1..].join(", ")));
        }
        text.push('\n');
        if h.probability > 0.05 {
            for p in &h.parameters {
                let value = crate::report::human::with_interval(p.value, p.ci95, p.unit);
                text.push_str(&format!("         {} = {value}\n", p.name));
            }
        }
    }
    let g = &r.gap;
    let told = |rmse: Option<f64>| {
        rmse.map_or_else(|| "- (too short to hold passes out)".to_string(), |v| format!("{v:.4}"))
    };
    text.push_str(&format!(
        "\nGap on held-out passes, in units of full friction\n  nominal baseline      {}\n  recalibrated baseline {}\n  verdict's model       {}\n  repeatability         {}\n",
        told(g.before_rmse), told(g.recalibrated_rmse), told(g.after_rmse), told(g.noise_floor_rmse)
    ));
    if let (Some(s), Some([low, high])) = (g.shrinkage, g.shrinkage_ci95) {
        text.push_str(&format!(
            "  the removable gap {} by {:.0} % [{:.0}, {:.0}]\n",
            if s < 0.0 { "grows" } else { "shrinks" },
            100.0 * s.abs(),
            100.0 * if s < 0.0 { -high } else { low },
            100.0 * if s < 0.0 { -low } else { high }
        ));
    }
    if !r.location.regions.is_empty() {
        text.push_str("\nWhere\n");
        let told = r.location.regions.iter().filter(|g| g.share_of_gap >= 0.01).count().min(TOLD);
        for region in r.location.regions.iter().take(told) {
            text.push_str(&format!("  {}\n", region.text));
        }
        let rest = r.location.regions.len() - told;
        if rest > 0 {
            text.push_str(&format!("  and {rest} further parts, in the JSON document\n"));
        }
    }
    if !r.next_experiment.is_empty() {
        text.push_str("\nNext\n");
        for e in r.next_experiment.iter().take(4) {
            text.push_str(&format!("  {}", e.text));
            if e.conditions.is_empty() {
                let [a, b] = &e.separates;
                text.push_str(&format!(" (parts {a} from {b}: {:.1} nats)", e.expected_nats));
            }
            text.push('\n');
        }
    }
    if !r.not_testable.is_empty() {
        text.push_str("\nNot testable on this table\n");
        for n in &r.not_testable {
            text.push_str(&format!("  {}: {}\n", n.effect, n.because));
        }
    }
    for remark in &r.remarks {
        text.push_str(&format!("\n{remark}\n"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::plan;
    use crate::plan::{Plan, Resolution};
    use diagnosis::next::Experiment;
    use models::condition::Condition;
    use models::quantity::{Direction, PeakToPeak};
    use realtime::ports::Nanos;
    use realtime::safety::Limits;

    #[test]
    fn a_saved_plan_asks_for_the_designed_passes() {
        let one = Condition {
            amplitude: PeakToPeak::from_metres(3e-6),
            direction: Direction::Backward,
            normal_force_n: 0.4,
            position_m: 0.001,
            ambient_pressure_pa: Some(101_325.0),
            ..Condition::paper()
        };
        let thin = Condition { ambient_pressure_pa: Some(20_000.0), direction: Direction::Forward, ..one };
        let conditions = vec![thin, one, Condition { speed_m_s: 0.01, ..thin }, one];
        let experiment = Experiment {
            conditions: conditions.clone(),
            separates: ["a".to_string(), "b".to_string()],
            expected_nats: 3.0,
            text: "4 passes that part \"a\" from b".to_string(),
        };
        let plan = Plan::parse("next.toml", &plan(&experiment)).expect("a plan that can be read");
        let resolution = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        let points =
            plan.points(1, &Limits::paper(Nanos(1_000_000)), &resolution).expect("a plan within limits");
        let mut asked: Vec<[f64; 4]> = points
            .iter()
            .filter(|p| !p.reference)
            .map(|p| {
                let c = &p.condition;
                [c.speed_m_s, c.direction.sign(), c.position_m, c.ambient_pressure_pa.unwrap_or(0.0)]
            })
            .collect();
        let mut wanted: Vec<[f64; 4]> = conditions
            .iter()
            .map(|c| [c.speed_m_s, c.direction.sign(), c.position_m, c.ambient_pressure_pa.unwrap_or(0.0)])
            .collect();
        let order = |a: &[f64; 4], b: &[f64; 4]| a.partial_cmp(b).expect("finite settings");
        asked.sort_by(order);
        wanted.sort_by(order);
        assert_eq!(asked, wanted);
        // Each pressure is set once.
        let mut pressures: Vec<_> = points.iter().map(|p| p.condition.ambient_pressure_pa).collect();
        pressures.dedup();
        assert_eq!(pressures.len(), 2);
    }
}
