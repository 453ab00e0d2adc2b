//! `muprime diagnose`: where the gap lies, which effect causes it, how far it shrinks.

use super::prelude::*;
use diagnosis::progress::{Progress, ProgressReport};
use diagnosis::report::document::{document, outside, predictions};
use diagnosis::{Diagnosis, Options, Table};
use indicatif::ProgressBar;
use runs::files::{MODEL, NEXT_PLAN, PAGE, PREDICTIONS, replaceable, write_output};
use runs::input::{MAX_TABLE_BYTES, bytes_of};
use runs::print::folded;
use runs::verdict_text::files;
use std::sync::{Arc, Mutex, PoisonError};
use tables::check::refusal;
use tables::diagnose::{Subject, inputs, unfit};
use tables::joined::{JoinedTable, joined, start_of};
use tables::passes::parse_passes;

/// Parts of the operating space that are printed, the largest first.
const PRINTED: usize = 6;

/// Say where simulation and reality differ on a table of passes, which effect causes it, and how far it shrinks.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A point table (CSV or Parquet), or a run's folder with points.csv and rig.toml. Several of one rig are
    /// diagnosed together, each as a run of its own.
    #[arg(required = true)]
    pub data: Vec<PathBuf>,
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
    /// Write page, verdict, corrected model and next plan into the run's folder, where the
    /// dashboard finds them.
    #[arg(long)]
    pub in_folder: bool,
    /// Try single effects only.
    #[arg(long)]
    pub no_pairs: bool,
    /// The base law in place of the spring-slider, as for `muprime run --model`: psi, surrogate, or a file.
    /// Effects add the change that they make on the spring-slider.
    #[arg(long, value_name = "LAW")]
    pub model: Option<PathBuf>,
    /// One candidate effect more, of your own: a table of the change of friction over the conditions (may be repeated).
    #[arg(long, value_name = "FILE")]
    pub effect: Vec<PathBuf>,
    /// Leave an effect out of the library (may be repeated).
    #[arg(long, value_name = "EFFECT")]
    pub without: Vec<String>,
}

/// The files that a diagnosis is of.
struct Inputs<'a> {
    tables: Vec<PathBuf>,
    rig: PathBuf,
    /// The folder, where one run is diagnosed.
    run: Option<&'a Path>,
}

impl<'a> Inputs<'a> {
    fn of(args: &'a Args) -> miette::Result<Self> {
        args.data.iter().try_for_each(|data| super::must_exist(data, "run or table"))?;
        let both = |data: &PathBuf| inputs(data, args.rig.clone());
        let (tables, rigs): (Vec<_>, Vec<_>) = args.data.iter().map(both).unzip();
        let bytes = |rig: &PathBuf| bytes_of(rig, MAX_TABLE_BYTES).ok();
        let rig = rigs[0].clone();
        let differs = |other: &&PathBuf| bytes(other).zip(bytes(&rig)).is_some_and(|(a, b)| a != b);
        if let Some(other) = rigs[1..].iter().find(differs) {
            let help = "tables that are diagnosed together are of one rig in one state: --rig names the file that \
                        holds for all";
            miette::bail!(help = help, "{} and {} differ", rig.display(), other.display());
        }
        let run = args.data.first().filter(|data| args.data.len() == 1 && data.is_dir()).map(|data| &**data);
        if args.in_folder && run.is_none() {
            let what = if args.data.len() > 1 { "several are given" } else { "this is a table" };
            let help = "give the folder of one run";
            miette::bail!(help = help, "--in-folder: {}: {what}", args.data[0].display());
        }
        Ok(Inputs { tables, rig, run })
    }

    /// The tables as a text names them.
    fn shown(&self) -> String {
        self.tables.iter().map(|table| table.display().to_string()).collect::<Vec<_>>().join(", ")
    }
}

/// Reads, diagnoses, writes the requested files: none of them where a table or a rig is refused, or a file
/// cannot be read or written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let inputs = Inputs::of(&args)?;
    let (subject, damage) = read(&inputs, &args)?;
    let options = options(&args)?;
    let conditions = args.predict.as_ref().map(|path| conditions(path, &subject)).transpose()?;
    places(&args)?;
    let bar = studies::progress::bar(1000, "per mille");
    let progress = follow(&bar, json)?;
    let mut result = subject.diagnose(Options { progress, ..options }, inputs.run)?;
    result.report.remarks.extend(conditions.as_ref().and_then(|c| outside(&subject.table, c)));
    bar.finish_and_clear();
    if let (Some(conditions), Some(out)) = (&conditions, &args.predictions) {
        let shown = || args.predict.as_ref().map_or_else(String::new, |path| path.display().to_string());
        let text = predictions(&result, conditions).into_diagnostic().wrap_err_with(shown)?;
        write_output(out, text)?;
    }
    save_next(&args, &result)?;
    if args.report.is_some() || args.in_folder {
        write_page(&args, &inputs, &subject, &result, &damage)?;
    }
    if json {
        out!("{}", document(&result, &subject.rig, &damage).into_diagnostic()?);
    } else {
        damage.iter().for_each(|d| say!("{}", folded(&format!("damaged: {d}"), 4)));
        out!("{}", folded(runs::verdict_text::words(&result, &subject.rig).trim_end(), 4));
    }
    Ok(ExitCode::SUCCESS)
}

/// Whether each output has a place of its own that it may take: judged before the work, not after it.
fn places(args: &Args) -> miette::Result<()> {
    let outputs = [
        ("--predictions", &args.predictions, PREDICTIONS),
        ("--save-model", &args.save_model, MODEL),
        ("--report", &args.report, PAGE),
        ("--save-plan", &args.save_plan, NEXT_PLAN),
    ];
    let mut taken: Vec<(&str, PathBuf)> = Vec::new();
    for (option, path, begins) in outputs.iter().filter_map(|(o, path, b)| Some((*o, path.as_ref()?, *b))) {
        let place = std::path::absolute(path).into_diagnostic()?;
        let place = place.canonicalize().unwrap_or(place);
        if let Some((other, _)) = taken.iter().find(|(_, before)| *before == place) {
            let help = "give each output a name of its own";
            miette::bail!(help = help, "{option}: {} is the place of {other} too", path.display());
        }
        replaceable(path, begins)?;
        taken.push((option, place));
    }
    Ok(())
}

/// The table on its base law, with the rig's calibration; and what is damaged in the folders of runs.
fn read(inputs: &Inputs<'_>, args: &Args) -> miette::Result<(Subject, Vec<String>)> {
    let named = inputs.rig.display().to_string();
    let rig = runs::input::rig_file(&inputs.rig)
        .map_err(|why| refusal(why, &named, "rig.toml"))
        .wrap_err_with(|| format!("{named}: noise and stiffnesses of the rig (--rig names the file)"))?;
    let (mut parts, mut damage, mut all, mut rendered) = (Vec::new(), Vec::new(), Vec::new(), false);
    for (data, table) in args.data.iter().zip(&inputs.tables) {
        let bytes = bytes_of(table, MAX_TABLE_BYTES)
            .wrap_err_with(|| format!("cannot read the table {}", table.display()))?;
        let passes = parse_passes(table, &bytes).map_err(|why| refused(why, table))?;
        let name = data.display().to_string();
        if data.is_dir() {
            damage.extend(runs::run_dir::damage_in(data)?);
            rendered |= data.join(runs::fidelity::FILE).is_file();
        }
        parts.push(JoinedTable { name, passes, start_unix_s: start_of(data) });
        all.extend(bytes);
    }
    let whole = Subject::of(joined(parts)?, &all, rig).map_err(|why| {
        let help = "passes that render have no steady friction: diagnose a sweep of the same rig, and give its \
                    corrected model to the rendering";
        match (rendered, &inputs.tables[..]) {
            (true, _) => miette::miette!(help = help, "{why}").wrap_err(inputs.shown()),
            (false, [table]) => refused(unfit(why), table),
            (false, _) => unfit(why).wrap_err(inputs.shown()),
        }
    })?;
    let Some(what) = &args.model else { return Ok((whole, damage)) };
    let base = tables::law::for_finger(what, &whole.rig.finger)?;
    Ok((whole.on(base).into_diagnostic().wrap_err_with(|| inputs.shown())?, damage))
}

/// A table that cannot be diagnosed, with all that is wrong with it.
fn refused(why: miette::Report, table: &Path) -> miette::Report {
    let shown = table.display().to_string();
    refusal(why, &shown, "table").wrap_err(shown)
}

/// What is tried, as the arguments say.
fn options(args: &Args) -> miette::Result<Options> {
    for name in &args.without {
        if effects::by_name(name).is_none() {
            miette::bail!("--without {name}: no such effect; `muprime model effects` lists them");
        }
    }
    let own = tables::law::own_effects(&args.effect)?;
    Ok(Options { pairs: !args.no_pairs, without: args.without.clone(), own, ..Options::default() })
}

/// The conditions to predict.
fn conditions(path: &Path, subject: &Subject) -> miette::Result<Table> {
    let bytes =
        bytes_of(path, MAX_TABLE_BYTES).wrap_err_with(|| format!("cannot read {}", path.display()))?;
    let rows = parse_passes(path, &bytes).map_err(|why| refused(why, path))?;
    let origin = subject.table.origin(&subject.passes);
    Table::conditions(&rows, &origin).map_err(|why| refused(miette::Report::msg(why), path))
}

/// Writes the corrected model and the next plan where they are requested and the verdict has them.
fn save_next(args: &Args, result: &Diagnosis) -> miette::Result<()> {
    if let Some(out) = &args.save_model {
        match runs::verdict_text::corrected_model(result)? {
            Some(model) => write_output(out, model)?,
            None => say!(
                "no model written to {}: no effect of the library explains most of the gap",
                out.display()
            ),
        }
    }
    if let Some(out) = &args.save_plan {
        match runs::verdict_text::next_plan(result, &args.data) {
            Some(plan) => {
                write_output(out, plan)?;
                let all: Vec<_> = args.data.iter().map(|data| quoted(data.display())).collect();
                let (all, plan) = (all.join(" "), quoted(out.display()));
                say!("next: muprime run {plan} --out NEXT; then muprime diagnose {all} NEXT, both together");
            }
            None => say!("no plan written to {}: no conditions would tell more", out.display()),
        }
    }
    Ok(())
}

/// Writes the page, into the run's folder with all that belongs to it or where it is requested.
fn write_page(
    args: &Args,
    inputs: &Inputs<'_>,
    subject: &Subject,
    result: &Diagnosis,
    damage: &[String],
) -> miette::Result<()> {
    let page = match inputs.run {
        Some(run) => subject.page_of_run(result, run)?,
        None => {
            let rig = inputs.rig.display().to_string();
            subject.page_of_table(result, &inputs.shown(), &rig)?
        }
    };
    if args.in_folder {
        files::write(&args.data[0], result, &subject.rig, &page, damage)?;
        say!("verdict: {}", args.data[0].join(files::PAGE).display());
    }
    if let Some(out) = &args.report {
        write_output(out, &page)?;
        say!("report: {}", out.display());
        // The run that this is the table of.
        let [table] = &inputs.tables[..] else { return Ok(()) };
        let run = table.parent().filter(|run| run.join("passes.jsonl").exists());
        if let Some(run) = run.filter(|_| !args.in_folder) {
            keep_in_run(run, out, &page);
        }
    }
    Ok(())
}

/// A run's page that was written elsewhere, once more in the run's folder: the dashboard lists the pages there and no others.
fn keep_in_run(run: &Path, page: &Path, text: &str) {
    let inside = || Some(page.canonicalize().ok()?.parent()? == run.canonicalize().ok()?);
    if inside() == Some(false) {
        let copy = run.join(files::PAGE);
        match write_output(&copy, text) {
            Ok(()) => say!("the dashboard lists its copy: {}", copy.display()),
            Err(why) => say!("the dashboard will not list this page: {why}"),
        }
    }
}

/// A bar that follows a diagnosis; Ctrl-C prints the effects that lead so far.
fn follow(bar: &ProgressBar, json: bool) -> miette::Result<Progress> {
    let reached: Arc<Mutex<Option<ProgressReport>>> = Arc::default();
    let latest = Arc::clone(&reached);
    studies::progress::on_interrupt(bar, move |_| {
        let stage = reached.lock().unwrap_or_else(PoisonError::into_inner).clone();
        tell_partial(stage.as_ref(), json);
    })?;
    let bar = bar.clone();
    Ok(Progress::to(move |stage| {
        // A second look at the table begins anew: the bar stays where it was.
        bar.set_position(bar.position().max((1e3 * stage.share) as u64));
        bar.set_message(stage.doing);
        let mut reached = latest.lock().unwrap_or_else(PoisonError::into_inner);
        let leading = reached.take().map(|before| before.leading).filter(|_| stage.leading.is_empty());
        *reached = Some(ProgressReport { leading: leading.unwrap_or(stage.leading), ..stage });
    }))
}

/// What a diagnosis that was stopped knew.
fn tell_partial(stage: Option<&ProgressReport>, json: bool) {
    let leading: &[_] = stage.map_or(&[], |stage| &stage.leading);
    let (doing, share) = stage.map_or(("reading", 0.0), |stage| (stage.doing, stage.share));
    if json {
        let leading: Vec<_> = leading
            .iter()
            .map(|(effects, nats)| json!({ "effects": effects, "log_evidence_over_no_gap": nats }))
            .collect();
        answer_json(&json!({ "partial": true, "doing": doing, "share": share, "leading": leading }));
        return;
    }
    out!("partial: stopped at {:.0} % ({doing}); no verdict", 100.0 * share);
    if leading.is_empty() {
        out!("  no effect was fitted yet");
    }
    for (effects, nats) in leading.iter().take(PRINTED) {
        out!("  {:+9.1} nats over no gap  {}", nats, effects.join(" + "));
    }
}
