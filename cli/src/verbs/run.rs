//! `muprime run`: an automated friction sweep, or the missing ones of a campaign.

pub mod campaign;

use super::dashboard::ListenOptions;
use super::prelude::*;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use models::{BuiltIn, Condition};
use realtime::Nanos;
use rig::dashboard::LISTEN;
use rig::live::{self, Feed};
use rig::publish::{Broker, Publisher};
use rig::watch::TerminalView;
use runs::catalogue::runs_folder;
use runs::files::{Made, make_folder};
use runs::job::{Job, Notes, Signals, Summary, Update, unix_ns};
use runs::print::{self, clean, folded};
use runs::supervisor::MAY_BE_ON;
use runs::{Event, Outcome, Plan, Setup};
use serde_json::Value;
use std::io::IsTerminal;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Lines on standard error.
macro_rules! report {
    ($($text:tt)*) => { say!("{}", fitted(format!($($text)*))) };
}

/// Within the columns of a page for a person; as it is for a log, which is searched by lines.
fn fitted(text: String) -> String {
    if std::io::stderr().is_terminal() { folded(&text, 2) } else { text }
}

#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Plan or campaign: a file, a bundled name ('muprime show' lists all), or the folder of a campaign
    #[arg(default_value = "first-sweep")]
    plan: String,
    /// Setup: a file, or a bundled name ('muprime show' lists all)
    #[arg(long, default_value = "virtual")]
    setup: String,
    /// Folder of the run; an unfinished run there is resumed [default: a new one in ./runs]
    #[arg(long)]
    out: Option<PathBuf>,
    #[arg(long, value_name = "LAW", help = format!(
        "The law to compare with: {}, or a file: a corrected model of 'muprime diagnose --save-model', a law \
         table, a ridge table, a surrogate.json [default: spring-slider]",
        BuiltIn::names()
    ))]
    model: Option<PathBuf>,
    /// Seed of the order (and of the virtual rig) [default: the plan's]
    #[arg(long)]
    seed: Option<u64>,
    /// Defects of the virtual rig, in place of its own
    #[arg(long)]
    defects: Option<PathBuf>,
    /// In virtual time: a minute's sweep in a second or so
    #[arg(long)]
    fast: bool,
    /// Operator: NAME, or NAME with an ORCID's address in angle brackets; for record and report
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    /// Code of the person whose finger is measured; exposure is counted for this code on every rig [default: the operator]
    #[arg(long, value_name = "CODE")]
    subject: Option<String>,
    /// What is measured, for its record and report: the fingertip, its preparation, the plate
    #[arg(long, value_name = "WORDS")]
    sample: Option<String>,
    /// Licence of the data, for its record and exports: an SPDX identifier (CC-BY-4.0) or an address
    #[arg(long, visible_alias = "license", value_name = "ID")]
    licence: Option<String>,
    /// Answers of the person at the rig, one a line, for a machine without a person
    #[arg(long, value_name = "FILE")]
    answers: Option<PathBuf>,
    /// Show the run live on the whole terminal, as 'muprime watch' does
    #[arg(long)]
    tui: bool,
    /// Publish states, passes, trips and progress by MQTT, read only: mqtt://[user@]host[:port]/prefix
    #[arg(long, value_name = "BROKER")]
    publish: Option<Broker>,
    /// Show this run and its folder of runs in a browser, at this address [without one: 127.0.0.1:8417]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = LISTEN, conflicts_with = "tui")]
    dashboard: Option<SocketAddr>,
    /// A further page that may read the live stream of the dashboard, as `https://app.foxglove.dev` (may be
    /// repeated)
    #[arg(long = "origin", value_name = "ORIGIN", requires = "dashboard")]
    origins: Vec<String>,
    /// Write the dashboard's token to this file, readable by you alone: for a scraper of /metrics
    #[arg(long, value_name = "FILE", requires = "dashboard")]
    token_file: Option<PathBuf>,
    /// Allow pause and resume from the browser; stop is always allowed
    #[arg(long, requires = "dashboard")]
    allow_control: bool,
}

/// Runs the sweep; refused: bad input, a busy rig, an instrument that does not answer.
pub fn run(mut args: Args, json: bool) -> miette::Result<ExitCode> {
    if args.tui && json {
        let help = "leave out one of them";
        miette::bail!(help = help, "--tui shows a picture, --json prints documents: not both");
    }
    if let Some((text, folder)) = runs::campaign::text_of(&args.plan)? {
        return campaign::run(args, &text, &folder, json);
    }
    let (setup, plan) = (super::setup(&args.setup)?, super::plan(&args.plan)?);
    let seed = args.seed.unwrap_or(plan.file.seed);
    let (out, _made) = folder(args.out.clone(), &plan.file.name)?;
    let job = job_of(&args, setup, plan, seed, out)?;
    // An address that is taken is a refusal: nothing was touched yet.
    let (points, _, remarks) = job.points_seen(None)?;
    let mu0 = job.setup.tip.mu0;
    remarks.iter().for_each(|remark| report!("{remark}"));
    let untold = |c: &Condition| job.model.predict(&Condition { mu0, ..*c }).is_err();
    match points.iter().filter(|p| untold(&p.condition)).count() {
        0 => {}
        n => report!(
            "the law '{}' cannot tell at {n} of {} planned passes: they are measured, and not compared",
            job.model.name(),
            points.len()
        ),
    }
    let runs = job.out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    serve(&mut args, runs)?;
    exit(if measure(job, points.len(), &args, &watched()?, json)? { DONE } else { FAILED })
}

/// A dashboard, where the arguments want one, is served from here on, over a folder of runs.
fn serve(args: &mut Args, runs: &Path) -> miette::Result<()> {
    if let Some(listen) = args.dashboard.take() {
        let place = ListenOptions {
            listen,
            hosts: Vec::new(),
            origins: std::mem::take(&mut args.origins),
            token_file: args.token_file.take(),
            allow_control: args.allow_control,
        };
        report!("dashboard: {}", place.serve(runs.to_path_buf())?.link());
    }
    Ok(())
}

/// Measures one run of so many passes. Returns whether it is complete, and the drive was read back off.
fn measure(job: Job, planned: usize, args: &Args, signals: &Signals, json: bool) -> miette::Result<bool> {
    if !job.fast {
        // In virtual time nothing is driven, and a slow reader gets every line.
        super::tell_beside(&job.out)?;
    }
    keys_are_free(&job, args.tui)?;
    // Up before anything moves, and down before the summary. Output in between is held and printed then.
    let watch = match args.tui {
        true => Some(TerminalView::begin(&job.out, Some(signals.clone()), job.setup.hand_at_key())?),
        false => None,
    };
    let mut followers = Followers::begin(&job, planned, args, json)?;
    let before = runs::run_dir::passes_in(&job.out).unwrap_or_default();
    let mut feed = Feed::new(live::Run::of(&job, planned, before.len()), before, signals);
    let continued = job.plan.file.continues.clone();
    let summary = rig::wall_clock_run::run(job, signals, &mut |update| {
        feed.update(&update);
        followers.update(&update);
    });
    let bar = followers.bar.clone();
    print::draw("", move || bar.finish_and_clear());
    drop(watch);
    if let Ok(summary) = &summary {
        tell(summary, &continued, args.model.as_deref(), json);
    }
    feed.end(live::Ended::of(&summary));
    followers.end(&summary, args.publish.as_ref());
    let summary = summary?;
    Ok(summary.outcome == Outcome::Complete && summary.off.read_back)
}

/// Refuses a run whose dead-man key or whose questions need a terminal that something else uses.
fn keys_are_free(job: &Job, tui: bool) -> miette::Result<()> {
    if job.setup.hand_at_key() {
        if job.fast {
            let help = "leave out --fast";
            miette::bail!(help = help, "the dead-man key is held in wall-clock time: no hand is that fast");
        }
        say!(
            "dead-man key: release it, then hold the space bar down to arm and to continue. Release it, or press any other \
             key, and the drive is off"
        );
    }
    if job.asks_at_the_terminal() && (tui || job.setup.hand_at_key()) {
        let taken = if tui { "--tui" } else { "the dead-man key" };
        miette::bail!(
            help = "give the answers beforehand with --answers FILE (one a line)",
            "the plan asks a person for answers at the terminal, and {taken} takes its keys"
        );
    }
    Ok(())
}

/// Where the updates of one run go: the terminal or a program, and a broker.
struct Followers {
    json: bool,
    planned: usize,
    bar: ProgressBar,
    hidden: bool,
    publisher: Option<Publisher>,
    /// What the run is of, for the broker.
    of: Value,
}

impl Followers {
    /// Says what begins.
    fn begin(job: &Job, planned: usize, args: &Args, json: bool) -> miette::Result<Self> {
        let bar = progress_bar(json || args.tui, planned as u64);
        // Looked at once: while it is drawn, whoever asks it anything waits for the terminal.
        let hidden = bar.is_hidden();
        let (plan, setup) = (&job.plan.file.name, &job.setup.file.name);
        let (state, guards) = ("running", job.setup.guards());
        let of =
            json!({ "plan": plan, "setup": setup, "planned": planned, "guards": guards, "state": state });
        let mut followers = Followers { json, planned, bar, hidden, publisher: None, of };
        if !json {
            let clock = if job.fast { "virtual time" } else { "wall-clock time" };
            let out = job.out.display();
            followers.say(format!("{plan} on {setup}: {planned} passes in {clock}, into {out}"));
        }
        followers.publisher = args.publish.as_ref().map(Publisher::start).transpose()?;
        followers.publish("run", Value::clone);
        Ok(followers)
    }

    /// A line on the terminal, above the bar.
    fn say(&self, text: String) {
        let (text, bar) = (clean(&fitted(text)).into_owned(), self.bar.clone());
        if self.hidden { say!("{text}") } else { print::draw(&text.clone(), move || bar.println(text)) }
    }

    /// A message to the broker, made of what the run is of.
    fn publish(&mut self, name: &str, message: impl FnOnce(&Value) -> Value) {
        if let Some(publisher) = &mut self.publisher {
            publisher.publish(name, &message(&self.of));
        }
    }

    fn update(&mut self, update: &Update<'_>) {
        match update {
            Update::Pass(pass) => {
                self.publish("pass", |_| json!(pass));
                if self.json {
                    answer_json(&json!({ "pass": pass }));
                }
            }
            Update::Event(event) => {
                self.publish("event", |_| json!(event));
                if let Event::Tripped(trip) = event {
                    self.publish("trip", |_| tripped(trip));
                }
                if self.json {
                    answer_json(&json!({ "event": event }));
                } else {
                    self.say(runs::report::events::describe(event));
                }
            }
            Update::State(snapshot) => self.publish("state", |_| json!(live::State::of(snapshot))),
            Update::Progress(made, all, left_s) => {
                let (planned, made, all, left_s) = (self.planned, *made, *all, *left_s);
                self.publish("progress", |_| json!({ "made": made, "planned": all, "remaining_s": left_s }));
                let bar = self.bar.clone();
                print::draw("", move || {
                    bar.set_position((planned.saturating_sub(all) + made) as u64);
                    bar.set_message(format!("{:.0} s to go", left_s.max(0.0)));
                });
            }
            Update::Off(off) if !off.read_back => {
                print::urgent(&fitted(off.words()));
                self.publish("off", |_| json!(off));
                if self.json {
                    answer_json(&json!({ "off": off }));
                }
            }
            Update::Off(_) => {}
        }
    }

    /// Publishes how the run ended, and says what the broker did not get.
    fn end(mut self, summary: &miette::Result<Summary>, broker: Option<&Broker>) {
        self.of["state"] = "ended".into();
        self.of["summary"] = summary.as_ref().map_or_else(
            |why| json!({ "error": why.to_string() }),
            |summary| json!({ "passes": summary.passes, "outcome": summary.outcome, "off": summary.off }),
        );
        self.publish("run", Value::clone);
        if let (Some(publisher), Some(broker)) = (self.publisher, broker)
            && let Some(missing) = publisher.end()
        {
            report!("{}:{}: {missing}", broker.host, broker.port);
        }
    }
}

/// A trip for whoever follows from afar.
fn tripped(trip: &realtime::safety::Trip) -> Value {
    json!({
        "cause": trip.cause, "value": Some(trip.value).filter(|v| v.is_finite()), "bound": trip.bound, "unit": trip.unit.symbol(),
        "at_s": trip.at.seconds(), "requirement": trip.cause.requirement(), "remedy": trip.cause.remedy(),
    })
}

/// A run of this plan on this setup, with what the arguments say beside.
fn job_of(args: &Args, setup: Setup, plan: Plan, seed: u64, out: PathBuf) -> miette::Result<Job> {
    if args.defects.is_some() && setup.file.virtual_rig.is_none() {
        miette::bail!("--defects belongs to a virtual rig; '{}' is a real one", setup.file.name);
    }
    let defects = args.defects.as_deref().map(super::defects).transpose()?;
    let slider = PathBuf::from(BuiltIn::SpringSlider.name());
    let tables::law::Loaded { model, file: model_file } =
        tables::law::for_run(args.model.as_ref().unwrap_or(&slider), &setup)?;
    if out.exists() && !out.is_dir() {
        miette::bail!(help = "give a folder, or a name that is free", "--out {} is a file", out.display());
    }
    let args = args.clone();
    let notes =
        Notes { operator: args.operator, subject: args.subject, sample: args.sample, licence: args.licence };
    let (fast, answers) = (args.fast, args.answers);
    Ok(Job { setup, plan, seed, model, model_file, defects, out, fast, notes, answers })
}

/// The folder of a run or campaign that the arguments name; else a new one, by UTC date and time and the
/// plan's name. Runs of one second have one each: the second would go on with the first.
fn folder(named: Option<PathBuf>, plan: &str) -> miette::Result<(PathBuf, Made)> {
    if let Some(path) = named {
        return Ok((path, Made::default()));
    }
    let now = calibration::certificate::date::format((unix_ns() / 1_000_000_000) as i64);
    let plain = plan.replace(|c: char| matches!(c, '/' | '\\') || c.is_control(), "-");
    let name = format!("{}-{plain}", now.replace(['-', ':', 'Z'], "").replace('T', "-"));
    let mut made = Made(make_folder(&runs_folder())?);
    let (mut path, mut n) = (runs_folder().join(&name), 1);
    while let Err(why) = std::fs::create_dir(&path) {
        let taken = why.kind() == std::io::ErrorKind::AlreadyExists;
        taken.then_some(()).ok_or(why).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        n += 1;
        path = runs_folder().join(format!("{name}-{n}"));
    }
    made.0.push(path.clone());
    Ok((path, made))
}

/// The requests to a run or to all sessions of a campaign: each of [`rig::terminal::STOPS`] asks for a
/// stop; a second one leaves within two seconds whatever happens.
fn watched() -> miette::Result<Signals> {
    let signals = Signals::default();
    let (stops, mut is_first) = (Arc::clone(&signals.stops), true);
    studies::progress::on_signals(&rig::terminal::STOPS, move || {
        stops.fetch_add(1, Ordering::Relaxed);
        if std::mem::take(&mut is_first) {
            return;
        }
        // A terminal that takes nothing keeps nobody from leaving.
        std::thread::spawn(|| say!("leaving at once: {MAY_BE_ON}"));
        // The first one has sent the stop; nobody can wait here for what was read back.
        std::thread::sleep(std::time::Duration::from_millis(1500));
        runs::exit::exit_now(FAILED);
    })?;
    Ok(signals)
}

/// A bar that was not drawn yet: the first line of it too may find a terminal that takes nothing.
fn progress_bar(json: bool, planned: u64) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(planned), ProgressDrawTarget::stderr());
    if json || !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} passes, {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

/// Says what came of a run, which may continue others, and what to do next.
fn tell(summary: &Summary, continued: &[PathBuf], law: Option<&Path>, json: bool) {
    let remarked = runs::run_data::remarks::Remarked::of(summary);
    if json {
        answer_json(&json!({ "summary": remarked }));
        return;
    }
    if !summary.off.read_back {
        report!("{}", summary.off.words());
    }
    if summary.finished_before {
        report!("this run is already complete; nothing was measured");
    }
    report!("{} of {} passes", summary.passes, summary.planned);
    let rendered = runs::fidelity::read(&summary.folder);
    rendered.iter().flat_map(runs::report::fidelity::lines).for_each(|line| report!("{line}"));
    if let Some(report) = &summary.loop_report {
        let [p50, _, p99, _, max] = report.lateness_ns.map(|ns| ns as f64 / 1e3);
        report!(
            "loop: {} cycles, lateness median {p50:.0} \u{b5}s, 99 % {p99:.0} \u{b5}s, worst {max:.0} \u{b5}s; {} overruns, {} rows lost; CPUs {}",
            report.cycles,
            report.overruns,
            summary.record_lost,
            if report.grants.cpus_awake { "without deep sleep" } else { "with deep sleep" }
        );
    }
    if let Some(held) = summary.held.filter(|held| held.share >= 0.01) {
        report!("{held}");
    }
    if let (Outcome::Tripped(trip), Some(stalls)) = (&summary.outcome, &summary.stalls)
        && let Some(stall) = stalls.within(Nanos(trip.at.0.saturating_sub(100_000_000)), trip.at)
    {
        report!(
            "the computer itself stalled for {:.0} ms just before; see 'muprime doctor'",
            stall.lasted.seconds() * 1e3
        );
    }
    // A trip has been printed when it came.
    if !matches!(summary.outcome, Outcome::Complete | Outcome::Stopped | Outcome::Tripped(_)) {
        report!("{}", summary.outcome.words());
        summary.remedy.iter().for_each(|remedy| report!("  {remedy}"));
    }
    let tripped = matches!(summary.outcome, Outcome::Tripped(_));
    for (name, link) in &summary.links {
        let of_a_trip = |key: &str| link[key].as_str().filter(|text| tripped && !text.is_empty());
        let fault = of_a_trip("fault").unwrap_or_default();
        if !fault.is_empty() {
            report!("`{name}` reports: {fault}");
        }
        // A trip for want of data does not say why there was none.
        of_a_trip("last_problem").iter().for_each(|last| report!("last problem of `{name}`: {last}"));
        let reported = link["reported"].as_object().into_iter().flatten();
        for (text, times) in reported.filter(|(text, _)| !fault.starts_with(*text)) {
            report!("`{name}` reported {times} x: {text}");
        }
    }
    if summary.passes < summary.planned && summary.off.read_back {
        report!("to resume, repeat the command with --out {}", quoted(summary.folder.display()));
    }
    // Passes that render are not compared with the model.
    if rendered.is_none() {
        report!("{}", summary.agreement);
    }
    if let Some(psi_star) = summary.psi_star {
        report!("{psi_star}");
    }
    remarked.remarks.iter().for_each(|remark| report!("{remark}"));
    let page = summary.folder.join("report.html");
    if !page.is_file() {
        return;
    }
    // A path that no longer leads to passes is not proposed.
    let has_passes = |run: &&PathBuf| run.is_file() || run.join("points.csv").is_file();
    let before: Vec<_> = continued.iter().filter(has_passes).filter(|run| **run != summary.folder).collect();
    if summary.model_departed || !before.is_empty() {
        let all = before.into_iter().chain([&summary.folder]).map(|run| quoted(run.display()).to_string());
        let law = law.map_or_else(String::new, |law| format!(" --model {}", quoted(law.display())));
        report!("next: muprime diagnose {}{law}", all.collect::<Vec<_>>().join(" "));
    }
    report!("report: {}", page.display());
}
