//! `/metrics`: the live runs as OpenMetrics text, for Prometheus. The first scrape of a run begins to follow
//! it, as any viewer does. See <https://prometheus.io/docs/specs/om/open_metrics_spec/>.

use super::server::Shared;
use super::{api, pages};
use crate::live::{Received, State, View, Viewer};
use axum::extract;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use realtime::threads;
use runs::Event;
use runs::job::LATENESS_BOUNDS_S;
use std::fmt::Write as _;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tables::export::topics::SIGNALS;
use tables::export::unit;

const TYPE: &str = "application/openmetrics-text; version=1.0.0; charset=utf-8";
/// A first scrape waits so often and so long for the run so far.
const PAUSES: u32 = 20;
const PAUSE: Duration = Duration::from_millis(30);
/// How long a viewer waits for a message.
const POLL_EVERY: Duration = Duration::from_millis(500);
/// The states of a run; it is in one of them.
const STATES: [&str; 5] = ["preparing", "measuring", "paused", "tripped", "ended"];

/// A run that is followed.
pub type Followed = Arc<Mutex<View>>;

/// Answers a scrape.
pub async fn metrics(extract::State(shared): extract::State<Arc<Shared>>) -> Result<Response, Response> {
    api::beside(move || answer(&shared)).await
}

fn answer(shared: &Arc<Shared>) -> Response {
    let live = pages::live(&shared.options.runs);
    let followed: Vec<(String, Followed)> =
        live.into_iter().filter_map(|name| Some((name.clone(), follow(shared, &name)?))).collect();
    let runs = followed.iter().map(|(name, view)| (quoted(name), locked(view))).collect();
    let mut text = Text { out: String::new(), runs };
    server(&mut text, shared);
    sweep(&mut text);
    lateness(&mut text);
    for (k, signal) in SIGNALS.iter().enumerate() {
        let (name, unit) = unit::open_metrics(signal.topic);
        text.gauge(&name, unit, signal.words, &|view| last(view)?.signals.get(k).copied()?);
    }
    text.out.push_str("# EOF\n");
    ([(header::CONTENT_TYPE, TYPE)], text.out).into_response()
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A live run so far, followed from now on until its end; none where nobody tells of it.
#[allow(clippy::disallowed_methods, reason = "a thread beside everything else")]
fn follow(shared: &Arc<Shared>, name: &str) -> Option<Followed> {
    let mut followed = locked(&shared.followed);
    if let Some(view) = followed.get(name) {
        return Some(Arc::clone(view));
    }
    let mut viewer = Viewer::connect(&shared.options.runs.join(name)).ok()?;
    let view = Followed::default();
    let (taken, key, shared) = (Arc::clone(&view), name.to_string(), Arc::clone(shared));
    let take = move || {
        loop {
            match viewer.hear(POLL_EVERY) {
                Received::Message(message) => locked(&taken).take(*message),
                Received::Nothing => {}
                Received::Gone => break,
            }
        }
        locked(&shared.followed).remove(&key);
    };
    threads::spawn("metrics", take).ok()?;
    followed.insert(name.to_string(), Arc::clone(&view));
    drop(followed);
    // The run so far comes at once, its states last.
    for _ in 0..PAUSES {
        std::thread::sleep(PAUSE);
        if !locked(&view).states.is_empty() {
            break;
        }
    }
    Some(view)
}

fn last(view: &View) -> Option<&State> {
    view.states.back()
}

/// The text of an answer, and the runs that it is of.
struct Text<'a> {
    out: String,
    runs: Vec<(String, MutexGuard<'a, View>)>,
}

impl Text<'_> {
    /// The head of a family. What follows it belongs to it.
    fn family(&mut self, name: &str, kind: &str, unit: Option<&str>, help: &str) {
        let _ = writeln!(self.out, "# TYPE muprime_{name} {kind}");
        if let Some(unit) = unit {
            let _ = writeln!(self.out, "# UNIT muprime_{name} {unit}");
        }
        let _ = writeln!(self.out, "# HELP muprime_{name} {}", quoted(help));
    }

    /// A sample of each run, where there is a value.
    fn each(&mut self, name: &str, labels: &str, value: &dyn Fn(&View) -> Option<f64>) {
        for (run, view) in &self.runs {
            if let Some(value) = value(view) {
                let _ = writeln!(self.out, "muprime_{name}{{run=\"{run}\"{labels}}} {value}");
            }
        }
    }

    fn gauge(&mut self, name: &str, unit: Option<&str>, help: &str, value: &dyn Fn(&View) -> Option<f64>) {
        self.family(name, "gauge", unit, help);
        self.each(name, "", value);
    }

    fn counter(&mut self, name: &str, unit: Option<&str>, help: &str, value: &dyn Fn(&View) -> Option<f64>) {
        self.family(name, "counter", unit, help);
        self.each(&format!("{name}_total"), "", value);
    }
}

fn server(text: &mut Text<'_>, shared: &Shared) {
    text.family("build", "info", None, "the program");
    let _ = writeln!(text.out, "muprime_build_info{{version=\"{}\"}} 1", env!("CARGO_PKG_VERSION"));
    let live = text.runs.len();
    let streams = shared.streams.load(Ordering::Relaxed);
    for (name, help, value) in [
        ("live_runs", "runs of the folder that are live", live),
        ("streams", "live streams to browsers and Foxglove clients", streams),
    ] {
        text.family(name, "gauge", None, help);
        let _ = writeln!(text.out, "muprime_{name} {value}");
    }
    text.family("stream_dropped_frames", "counter", None, "states that were left out for slow clients");
    let dropped = shared.dropped.load(Ordering::Relaxed);
    let _ = writeln!(text.out, "muprime_stream_dropped_frames_total {dropped}");
}

/// What a run is of, how far it is, and what its finger was exposed to.
fn sweep(text: &mut Text<'_>) {
    text.family("run", "info", None, "what the run is of");
    for (run, view) in &text.runs {
        let Some(of) = &view.run else { continue };
        let facts = [("plan", Some(&of.plan)), ("setup", Some(&of.setup)), ("model", Some(&of.model))];
        let facts =
            facts.into_iter().chain([("operator", of.operator.as_ref()), ("sample", of.sample.as_ref())]);
        let facts: String = facts.filter_map(|(k, v)| v.map(|v| format!(",{k}=\"{}\"", quoted(v)))).collect();
        let _ = writeln!(text.out, "muprime_run_info{{run=\"{run}\"{facts}}} 1");
    }
    text.family("run_state", "stateset", None, "what the run does");
    for state in STATES {
        let is = |view: &View| Some(f64::from(u8::from(state_of(view) == state)));
        text.each("run_state", &format!(",muprime_run_state=\"{state}\""), &is);
    }
    let counted = |count: usize| Some(count as f64);
    text.counter("passes", None, "passes made, in all sessions", &|v| counted(v.progress.made));
    text.gauge("planned_passes", None, "passes planned", &|v| counted(v.progress.planned));
    let remaining = |v: &View| Some(v.progress.remaining_s);
    text.gauge("remaining_seconds", Some("seconds"), "time that the rest takes by the plan", &remaining);
    let trips = |v: &View| counted(v.events.iter().filter(|e| matches!(e.event, Event::Tripped(_))).count());
    text.counter("trips", None, "safety trips of this session", &trips);
    let driven = |v: &View| last(v)?.driven_s;
    let help = "time that the plate was driven in this session";
    text.counter("driven_seconds", Some("seconds"), help, &driven);
    let (dose, unit) = ("dose_square_meters_per_second", Some("square_meters_per_second"));
    let help = "squared rms velocity of the plate summed over that time";
    text.counter(dose, unit, help, &|v| last(v)?.dose_m2_s);
    let left = |v: &View| {
        v.events.iter().rev().find_map(|timed| match &timed.event {
            Event::ExposureLeft(left) => Some(left.hour_s),
            _ => None,
        })
    };
    let help = "what was left of the finger's exposure in an hour at the last arming";
    text.gauge("exposure_left_seconds", Some("seconds"), help, &left);
}

fn state_of(view: &View) -> &'static str {
    let [preparing, measuring, paused, tripped, ended] = STATES;
    match last(view) {
        _ if view.ended.is_some() => ended,
        _ if view.trip.is_some() => tripped,
        _ if view.paused => paused,
        Some(state) if state.armed => measuring,
        _ => preparing,
    }
}

/// The deadlines of the loop.
fn lateness(text: &mut Text<'_>) {
    let deadlines = |view: &View| last(view).map(|state| state.deadlines);
    let cycles = |view: &View| Some(deadlines(view)?.cycles as f64);
    text.counter("loop_cycles", None, "cycles of the loop in this session", &cycles);
    let missed = |view: &View| Some(deadlines(view)?.missed as f64);
    text.counter("loop_missed_cycles", None, "deadlines that were missed", &missed);
    let (name, help) =
        ("deadline_lateness_seconds", "lateness of every deadline of the loop, missed ones too");
    text.family(name, "histogram", Some("seconds"), help);
    // The samples of one histogram come one after the other.
    for (run, view) in &text.runs {
        let Some(deadlines) = deadlines(view) else { continue };
        let bounds = LATENESS_BOUNDS_S.iter().map(ToString::to_string).chain(["+Inf".into()]);
        let mut count = 0;
        for (bound, of_class) in bounds.zip(deadlines.lateness_classes) {
            count += of_class;
            let _ = writeln!(text.out, "muprime_{name}_bucket{{run=\"{run}\",le=\"{bound}\"}} {count}");
        }
        let _ = writeln!(text.out, "muprime_{name}_count{{run=\"{run}\"}} {count}");
        let _ = writeln!(text.out, "muprime_{name}_sum{{run=\"{run}\"}} {}", deadlines.lateness_sum_s);
    }
}

/// A text as it stands between quotes.
fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}
