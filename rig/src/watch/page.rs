//! The page: what stands where. Eighty columns and twenty-four rows hold everything; more room goes to the
//! curve, the traces and the events, less room keeps what is needed first.

use super::numbers::{duration, of_state, phase, plain};
use super::plot::{curve, trace};
use super::style::Look;
use super::{Keys, Source};
use crate::live::View;
use calibration::certificate::date;
use ratatui_core::buffer::Buffer;
use ratatui_core::layout::Rect;
use ratatui_core::style::{Color, Style};
use realtime::TripCause;
use runs::Outcome;
use runs::report::events::describe;

/// Columns and rows from which on the whole page is shown.
const WHOLE: [u16; 2] = [80, 24];
const NUMBERS: u16 = 39;
/// A feed sends ten states a second; after so many seconds without any the page warns.
const SILENT_S: f64 = 2.0;

/// What a page is drawn from.
pub struct Page<'a> {
    /// What is known of the run.
    pub view: &'a View,
    /// Where from.
    pub source: &'a Source,
    /// Who takes the keys.
    pub keys: &'a Keys,
    /// Whether this process leads the run.
    pub own: bool,
    /// What the terminal can show.
    pub look: Look,
    /// Whether the keys are explained.
    pub help: bool,
    /// An answer to a key.
    pub note: Option<&'a str>,
    /// Time since anything was heard, in s.
    pub silent_s: f64,
    /// The wall clock, in s since 1970.
    pub unix_s: i64,
}

/// Draws a page over a whole buffer of any size.
pub fn draw(page: &Page<'_>, buffer: &mut Buffer) {
    let area = buffer.area;
    if area.width < WHOLE[0] || area.height < WHOLE[1] {
        return small(page, buffer);
    }
    let mut line = |y: u16, text: &str, style: Style| {
        buffer.set_stringn(0, y, text, area.width.into(), style);
    };
    line(0, &title(page.view), page.look.heading());
    line(1, &who(page.view), Style::new());
    let (state, style) = state(page);
    line(2, &state, style);
    line(3, &progress(page), Style::new());
    let more = area.height - WHOLE[1];
    let (curve_rows, trace_rows) = (11 + more / 2, (4 + more / 6).min(10));
    let top = 4;
    let numbers = Rect::new(0, top, NUMBERS, curve_rows);
    put(buffer, numbers, of_state(page.view).iter().map(|(name, text)| (row(name, text), Style::new())));
    curve(buffer, Rect::new(NUMBERS + 1, top, area.width - NUMBERS - 1, curve_rows), page.look, page.view);
    let (traces, half) = (top + curve_rows, area.width / 2);
    let left = Rect::new(0, traces, half - 1, trace_rows);
    trace(buffer, left, page.look, ("lateral force", page.view), |s| s.extremes.lateral_force_n);
    let right = Rect::new(half, traces, area.width - half, trace_rows);
    trace(buffer, right, page.look, ("normal force", page.view), |s| s.extremes.normal_force_n);
    let below = traces + trace_rows;
    let last = area.height - 1;
    let rest = Rect::new(0, below, area.width, last - below);
    if page.help {
        put(buffer, rest, help(page).map(|text| (text.to_string(), Style::new())));
    } else {
        tellings(page, buffer, rest);
    }
    buffer.set_stringn(0, last, keys(page), area.width.into(), page.look.heading());
}

/// What is needed first, a line each, on a terminal with little room.
fn small(page: &Page<'_>, buffer: &mut Buffer) {
    let area = buffer.area;
    if area.is_empty() {
        return;
    }
    let (state, style) = state(page);
    let mut lines: Vec<(String, Style)> = vec![(state, style)];
    if page.view.run.as_ref().is_some_and(|run| run.guards.nobody_touches_the_plate) {
        lines.push(("NOBODY TOUCHES THE PLATE".into(), page.look.heading()));
    }
    lines.extend(page.note.map(|note| (plain(note), page.look.heading())));
    let width = usize::from(area.width);
    let urgent = urgent(page.view);
    lines.extend(urgent.iter().flat_map(|text| folded(text, width)).map(|text| (text, page.look.heading())));
    lines.push((keys(&Page { note: None, ..*page }), Style::new()));
    lines.push((progress(page), Style::new()));
    // mu' and its prediction, then the forces, then the rest.
    let numbers = of_state(page.view);
    let first = |name: &str| {
        u8::from(!name.contains("mu'")) + u8::from(!name.contains("mu'") && !name.contains("force"))
    };
    let mut sorted: Vec<&(&str, String)> = numbers.iter().collect();
    sorted.sort_by_key(|(name, _)| first(name));
    lines.extend(sorted.into_iter().map(|(name, text)| (row(name, text), Style::new())));
    lines.push((title(page.view), Style::new()));
    lines.push((who(page.view), Style::new()));
    lines.extend(events(page.view).map(|text| (text, Style::new())));
    put(buffer, area, lines);
}

fn put(buffer: &mut Buffer, area: Rect, lines: impl IntoIterator<Item = (String, Style)>) {
    for (y, (text, style)) in (area.y..area.bottom()).zip(lines) {
        buffer.set_stringn(area.x, y, text, area.width.into(), style);
    }
}

fn row(name: &str, text: &str) -> String {
    format!("{name:<14}{text}")
}

fn or_none(text: Option<&str>) -> String {
    text.filter(|text| !text.is_empty()).map_or_else(|| "none".into(), plain)
}

fn title(view: &View) -> String {
    let run = view.run.as_ref();
    let folder = run.map(|run| run.folder.display().to_string());
    format!(
        "muprime  {} on {}  {}",
        or_none(run.map(|run| run.plan.as_str())),
        or_none(run.map(|run| run.setup.as_str())),
        folder.as_deref().map(plain).unwrap_or_default(),
    )
}

fn who(view: &View) -> String {
    let run = view.run.as_ref();
    let nobody = run.is_some_and(|run| run.guards.nobody_touches_the_plate);
    format!(
        "{}operator {}  sample {}  model {}",
        if nobody { "NOBODY TOUCHES THE PLATE  " } else { "" },
        or_none(run.and_then(|run| run.operator.as_deref())),
        or_none(run.and_then(|run| run.sample.as_deref())),
        or_none(run.map(|run| run.model.as_str())),
    )
}

/// The state in one line, and how it stands out.
fn state(page: &Page<'_>) -> (String, Style) {
    let (view, look) = (page.view, page.look);
    if let Some(ended) = &view.ended {
        let how = match (&ended.outcome, &ended.error) {
            (Some(how), _) => how.words(),
            (None, Some(error)) => plain(error),
            (None, None) => "nothing is known of its end".into(),
        };
        let style = match ended.outcome {
            Some(Outcome::Complete) => look.strong(Color::Green),
            // On request.
            Some(Outcome::Stopped) => look.heading(),
            _ => look.alarm(),
        };
        return (format!("ENDED: {how}"), style);
    }
    if let Some(trip) = view.trip {
        if trip.cause == TripCause::Stopped {
            return ("STOPPED: off, at rest, lifted".into(), look.heading());
        }
        return ("TRIPPED: off, at rest, lifted; latched".into(), look.alarm());
    }
    let Some(s) = view.states.back() else {
        let words = match page.source {
            Source::Folder(Some(why)) => {
                format!("RUNS: passes from its folder only, there is no feed ({})", plain(why))
            }
            _ => "WAITING for the first cycle".into(),
        };
        return (words, look.heading());
    };
    if page.silent_s > SILENT_S {
        let words = format!("NOTHING HEARD for {}: what stands below is old", duration(page.silent_s));
        return (words, look.alarm());
    }
    if view.paused {
        let armed = if s.armed { "still armed" } else { "not armed" };
        return (format!("PAUSED: no drive, lifted off, {armed}; r goes on"), look.strong(Color::Yellow));
    }
    let point = if s.point == u32::MAX { "none".into() } else { s.point.to_string() };
    let at = format!("{}, point {point}", phase(s.phase));
    match (s.armed, s.blocking) {
        (true, _) => (format!("ARMED: {at}"), look.strong(Color::Green)),
        (false, Some(cause)) => (format!("NOT ARMED: {}", cause.words()), look.strong(Color::Yellow)),
        (false, None) => ("NOT ARMED".into(), look.strong(Color::Yellow)),
    }
}

/// n of N, the time that is left, and the clock time of the end.
fn progress(page: &Page<'_>) -> String {
    let view = page.view;
    let p = view.progress;
    let planned = if p.planned > 0 { p.planned.to_string() } else { "an unknown number".into() };
    let made = format!("{} of {planned} passes", p.made);
    if view.ended.is_some() {
        return made;
    }
    // The plan's times come with the first pass.
    if p.remaining_s <= 0.0 {
        return format!("{made}, time left: not known yet");
    }
    let left = duration(p.remaining_s);
    if view.paused {
        return format!("{made}, {left} left from when it goes on");
    }
    if view.run.as_ref().is_some_and(|run| run.fast) {
        return format!("{made}, {left} left in virtual time");
    }
    let end = date::format(page.unix_s.saturating_add(p.remaining_s as i64));
    let clock = end.get(11..19).unwrap_or_default();
    format!("{made}, {left} left, ends about {clock} UTC")
}

/// What must not be overlooked: the trip with its remedy, how it ended, the state of the output.
fn urgent(view: &View) -> Vec<String> {
    let mut lines = Vec::new();
    // Whether the output is off comes first: from the end's words, or until they come from the last reading.
    let off = view.ended.as_ref().map_or(view.not_off.as_deref(), |ended| ended.off.as_deref());
    lines.extend(off.iter().flat_map(|off| off.lines()).map(plain));
    // A stop on request is nothing to be mended.
    let trip = view.trip.as_ref().filter(|trip| trip.cause != TripCause::Stopped);
    if let Some(trip) = trip {
        lines.push(format!("STOPPED for safety: {}", plain(&trip.to_string())));
        lines.push(format!("remedy: {}", plain(trip.cause.remedy())));
    }
    if let Some(ended) = &view.ended {
        let remedy = ended.remedy.as_ref().filter(|_| trip.is_none());
        lines.extend(remedy.map(|remedy| format!("remedy: {}", plain(remedy))));
        lines.extend(ended.agreement.as_deref().map(plain));
    }
    lines
}

/// Events, the newest first: loop time in s, and what happened.
fn events(view: &View) -> impl Iterator<Item = String> + '_ {
    view.events.iter().rev().map(|event| {
        let words = describe(&event.event);
        format!("{:8.1} s  {}", event.at_s, plain(words.lines().next().unwrap_or_default()))
    })
}

fn tellings(page: &Page<'_>, buffer: &mut Buffer, area: Rect) {
    let width = usize::from(area.width);
    let urgent = urgent(page.view);
    let urgent = urgent.iter().flat_map(|text| folded(text, width)).map(|text| (text, page.look.heading()));
    let events = events(page.view).flat_map(|text| folded(&text, width)).map(|text| (text, Style::new()));
    let mut lines = urgent.chain(events).peekable();
    if lines.peek().is_none() {
        buffer.set_stringn(area.x, area.y, "events: none so far", width, Style::new());
    }
    put(buffer, area, lines);
}

/// A text in lines of so many columns; what is longer than a line is cut there.
fn folded(text: &str, width: usize) -> Vec<String> {
    // What goes on stands below the words, where a line begins with its time.
    let hang = if text.starts_with(' ') { 12 } else { 2 };
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= width => {
                line.push(' ');
                line.push_str(word);
            }
            Some(_) => lines.push(format!("{:hang$}{word}", "")),
            None => lines.push(word.to_string()),
        }
    }
    lines
}

/// The last line: an answer to a key, else what the keys do.
fn keys(page: &Page<'_>) -> String {
    if let Some(note) = page.note {
        return plain(note);
    }
    match page.keys {
        Keys::DeadMan => "keys are the dead-man key's: space holds; Ctrl-C stops".into(),
        Keys::None(why) => format!("no keys: {}; SIGINT stops", plain(why)),
        Keys::Here if page.own => "s stop  p pause  r resume  ? help".into(),
        Keys::Here => "s stop  p pause  r resume  q leave  ? help".into(),
    }
}

fn help(page: &Page<'_>) -> [&'static str; 4] {
    let leave = if page.own { "q: nothing; the view ends with the run" } else { "q: leave; the run goes on" };
    [
        "s, Ctrl-C: stop, safe state at once  p: pause before the next pass  r: resume",
        leave,
        "lateral force: in the sensor's frame; normal: + in compression; mu' = mu/mu_0",
        "residual: measured - predicted, z in sd; surprise: after the passes before it",
    ]
}
