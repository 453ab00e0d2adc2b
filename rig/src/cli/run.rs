//! `muprime run`: an automated friction sweep.

use crate::catalogue::runs_folder;
use crate::plan::Plan;
use crate::print::clean;
use crate::sequence::{Event, Outcome};
use crate::session::{Job, News, Signals, Summary, unix_ns};
use crate::setup::Setup;
use crate::supervisor::MAY_BE_ON;
use crate::{out, say};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::IntoDiagnostic;
use models::prediction::{FrictionModel, SpringSlider};
use realtime::ports::Nanos;
use std::io::IsTerminal;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Plan: a file, or a bundled name (first-sweep, fig9-artificial, part2-validation)
    #[arg(default_value = "first-sweep")]
    plan: String,
    /// Setup: a file, or a bundled name (virtual, virtual-ideal)
    #[arg(long, default_value = "virtual")]
    setup: String,
    /// Folder of the run; an unfinished run there is taken up again [default: a new one in ./runs]
    #[arg(long)]
    out: Option<PathBuf>,
    /// A corrected model, as 'muprime diagnose --save-model' writes it
    #[arg(long)]
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
}

/// Runs the sweep.
///
/// # Errors
/// A refusal: bad input, a busy rig, an instrument that does not answer.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let job = job(args)?;
    if job.setup.hand_at_key() {
        if job.fast {
            miette::bail!(
                help = "leave out --fast",
                "the dead-man key is held in wall-clock time: no hand is that fast"
            );
        }
        say!(
            "dead-man key: let go of it, then hold the space bar down to arm and to go on; let go, or press any other key, and the drive is off"
        );
    }
    let signals = Signals::default();
    watch_signals(&signals)?;
    let bar = progress_bar(json);
    let planned = job.points()?.len();
    bar.set_length(planned as u64);
    let say = |text: String| if bar.is_hidden() { say!("{text}") } else { bar.println(clean(&text)) };
    if !json {
        let clock = if job.fast { "virtual time" } else { "wall-clock time" };
        say(format!(
            "{} on {}: {planned} passes in {clock}, into {}",
            job.plan.file.name,
            job.setup.file.name,
            job.out.display()
        ));
    }
    let summary = job.run(&signals, &mut |news| match news {
        News::Pass(pass) => {
            if json {
                out!("{}", serde_json::json!({ "pass": pass }));
            }
        }
        News::Event(event) => {
            if json {
                out!("{}", serde_json::json!({ "event": event }));
            } else {
                say(describe(event));
            }
        }
        News::Progress(made, _, left_s) => {
            let resumed = planned as u64 - bar.length().unwrap_or(0).min(planned as u64);
            bar.set_position(made as u64 + resumed);
            bar.set_message(format!("{left_s:.0} s to go"));
        }
    })?;
    bar.finish_and_clear();
    tell(&summary, json);
    super::exit(match summary.outcome {
        Outcome::Complete if summary.off.read_back => super::DONE,
        _ => super::FAILED,
    })
}

fn job(args: Args) -> miette::Result<Job> {
    let setup = Setup::load(&args.setup)?;
    let plan = Plan::load(&args.plan)?;
    let defects = match &args.defects {
        None => None,
        Some(path) => {
            if setup.file.virtual_rig.is_none() {
                miette::bail!("--defects belongs to a virtual rig; '{}' is a real one", setup.file.name);
            }
            let text = crate::input::text_of(path)?;
            let defects = sim::defects::Defects::parse(&text);
            Some(defects.map_err(|e| miette::miette!("{}: {e}", path.display()))?)
        }
    };
    let model_file = match &args.model {
        None => None,
        Some(path) => Some(("model.toml".to_string(), crate::input::text_of(path)?)),
    };
    let model: Arc<dyn FrictionModel> = match &model_file {
        None => Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?),
        Some((_, text)) => {
            let path = args.model.as_ref().map_or_else(String::new, |p| p.display().to_string());
            crate::model_file::load_for(&setup, &path, text)?
        }
    };
    let seed = args.seed.unwrap_or(plan.file.seed);
    let out = args.out.unwrap_or_else(|| runs_folder().join(new_name(&plan.file.name)));
    Ok(Job { setup, plan, seed, model, model_file, defects, out, fast: args.fast })
}

/// Name of a new run: UTC date and time, and the plan.
fn new_name(plan: &str) -> String {
    let now = calibration::certificate::date::format((unix_ns() / 1_000_000_000) as i64);
    format!("{}-{plan}", now.replace(['-', ':', 'Z'], "").replace('T', "-"))
}

/// SIGINT, SIGTERM and SIGHUP ask for a stop; a second one leaves within two seconds whatever happens.
fn watch_signals(signals: &Signals) -> miette::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let stops = Arc::clone(&signals.stops);
    let mut caught = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP]).into_diagnostic()?;
    std::thread::Builder::new()
        .name("signals".into())
        .spawn(move || {
            for (i, _) in caught.forever().enumerate() {
                stops.fetch_add(1, Ordering::Relaxed);
                if i > 0 {
                    // The first one has sent the stop; nobody can wait here for what was read back.
                    std::thread::sleep(std::time::Duration::from_millis(1500));
                    say!("leaving at once: {MAY_BE_ON}");
                    super::leave_now(super::FAILED);
                }
            }
        })
        .into_diagnostic()?;
    Ok(())
}

fn progress_bar(json: bool) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if json || !std::io::stderr().is_terminal() {
        bar.set_draw_target(ProgressDrawTarget::hidden());
    }
    let style = ProgressStyle::with_template("{bar:40} {pos}/{len} passes, {msg}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar
}

fn describe(event: &Event) -> String {
    match event {
        Event::Armed => "armed".into(),
        Event::NoSecondChannel => {
            "no second switch-off channel: what the amplifier refuses, only a hand at its supply switches off"
                .into()
        }
        Event::NoWatchdog => "the amplifier has no watchdog: the second channel stands for it".into(),
        Event::Zeros { lateral_n, normal_n, after } => {
            let mn = |v: &Option<f64>| v.map_or("none".into(), |v| format!("{:+.2} mN", v * 1e3));
            let when = if *after { "after" } else { "before" };
            format!("force zeros {when} the sweep: lateral {}, normal {}", mn(lateral_n), mn(normal_n))
        }
        Event::Tripped(trip) => format!("TRIP {trip}\n  {}", trip.cause.remedy()),
        Event::ModelDeparted { point, log_evidence } => {
            let odds = (log_evidence / std::f64::consts::LN_10).floor();
            format!("the model has left the measurement at point {point} (evidence beyond 10^{odds:.0} to 1)")
        }
        Event::StopRequested => "stopping: the rig goes to its safe state first".into(),
        Event::PassRepeated { point } => format!("point {point}: no contact, once more"),
        Event::TemperatureBeyondCertificate { point, flag } => {
            format!("point {point} and on: {flag}; the passes are flagged, nothing is corrected")
        }
        Event::TemperatureUnwatched { certificate } => format!(
            "{certificate} holds within a range of temperatures, and the amplifier reports none: only the setup's \
             temperature_c was checked"
        ),
    }
}

fn tell(summary: &Summary, json: bool) {
    if json {
        out!("{}", serde_json::json!({ "summary": summary }));
        return;
    }
    if !summary.off.read_back {
        say!("{}", summary.off.words());
    }
    if summary.finished_before {
        say!("every pass of this run was made before: nothing was driven, nothing was recorded");
    }
    say!("{} of {} passes", summary.passes, summary.planned);
    if let Some(report) = &summary.loop_report {
        let [p50, _, p99, _, max] = report.lateness_ns.map(|ns| ns as f64 / 1e3);
        say!(
            "loop: {} cycles, lateness median {p50:.0} us, 99 % {p99:.0} us, worst {max:.0} us; {} overruns, {} rows lost",
            report.cycles,
            report.overruns,
            summary.record_lost
        );
    }
    if let (Outcome::Tripped(trip), Some(stalls)) = (&summary.outcome, &summary.stalls)
        && let Some(stall) = stalls.within(Nanos(trip.at.0.saturating_sub(100_000_000)), trip.at)
    {
        say!(
            "just before the trip this machine kept its programs from running for {:.0} ms: see 'muprime doctor'",
            stall.lasted.seconds() * 1e3
        );
    }
    if let (Outcome::WouldNotArm { blocking: Some(cause) }, Some(remedy)) =
        (&summary.outcome, &summary.remedy)
    {
        say!("the rig would not arm: {cause:?} stands in the way\n  {remedy}");
    }
    if summary.passes < summary.planned {
        say!("the same command with --out {} goes on", summary.folder.display());
    }
    say!("{}", summary.agreement);
    if summary.model_departed {
        say!("'muprime diagnose {}' says where and why", summary.folder.display());
    }
    say!("report: {}", summary.folder.join("report.html").display());
}
