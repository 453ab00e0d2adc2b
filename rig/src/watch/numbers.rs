//! What is seen of a run in words and numbers. Missing data is 'none', never 0.

use crate::live::{State, View};
use realtime::Phase;
use runs::format::number;
use runs::print::clean;

/// States of the last second.
const SECOND: usize = 10;

/// A number in so many decimals and its unit, or `none`.
pub fn value(value: Option<f64>, scale: f64, decimals: usize, unit: &str) -> String {
    let value = value.filter(|v| v.is_finite()).map(|v| v * scale);
    value.map_or_else(|| "none".into(), |v| format!("{v:.decimals$}{unit}"))
}

/// The same with its sign.
fn signed(value: Option<f64>, decimals: usize, unit: &str) -> String {
    value.filter(|v| v.is_finite()).map_or_else(|| "none".into(), |v| format!("{v:+.decimals$}{unit}"))
}

fn band(mu: Option<f64>, sd: Option<f64>) -> String {
    match (value(mu, 1.0, 3, ""), sd.filter(|sd| sd.is_finite())) {
        (mu, Some(sd)) if mu != "none" => format!("{mu} +- {sd:.3}"),
        (mu, _) => mu,
    }
}

/// A span of seconds as people say it.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m} min {s:02} s"),
        (h, m, _) => format!("{h} h {m:02} min"),
    }
}

/// What the loop does, in a word.
pub fn phase(phase: Phase) -> &'static str {
    match phase {
        Phase::Idle => "at rest",
        Phase::Approach => "approaching",
        Phase::Settle => "settling",
        Phase::Measure => "measuring",
        Phase::Edges => "making edges",
        Phase::Zero => "reading zeros",
    }
}

/// The numbers of the last cycle, most needed first.
pub fn of_state(view: &View) -> Vec<(&'static str, String)> {
    // What the last cycle showed is no state of a rig that nobody leads any more.
    let over = view.ended.is_some();
    let Some(s) = view.states.back().filter(|_| !over) else {
        let why = if over { "none: the run is over" } else { "none: no cycle was received" };
        return [vec![("rig", why.into())], last_pass(view)].concat();
    };
    // A running mu' is there while a pass slides only.
    let slides = matches!(s.phase, Phase::Settle | Phase::Measure | Phase::Edges);
    let sliding = |text: String| if text == "none" && !slides { "none: nothing slides".into() } else { text };
    let now = vec![
        ("lateral force", signed(s.lateral_force_n, 4, " N (sensor frame)")),
        ("normal force", signed(s.normal_force_n, 4, " N (compression +)")),
        ("mu' measured", sliding(band(s.mu_relative, s.mu_relative_sd))),
        ("mu' predicted", sliding(band(s.predicted, s.predicted_sd))),
        ("residual", sliding(residual(s))),
        ("amplitude w", value(s.amplitude_pp_m, 1e6, 3, " um")),
        ("frequency", value(s.frequency_hz, 1e-3, 3, " kHz")),
        ("output", output(s)),
        ("lateness", lateness(view)),
    ];
    [now, last_pass(view)].concat()
}

fn residual(s: &State) -> String {
    match signed(s.residual, 3, "") {
        none if none == "none" => none,
        residual => format!("{residual}, z {}", signed(s.z, 1, "")),
    }
}

fn output(s: &State) -> String {
    let on = match s.output_on {
        Some(true) => "ON",
        Some(false) => "off",
        None => "none",
    };
    format!("{on}, {}", value(s.temperature_c, 1.0, 1, " degC"))
}

/// The latest beginning of a cycle in the last second.
fn lateness(view: &View) -> String {
    let last = view.states.iter().rev().take(SECOND);
    let worst = last.map(|s| s.extremes.lateness_s).fold(0.0, f64::max);
    format!("{} ms, worst of 1 s", number(worst * 1e3))
}

/// A pass's surprise is after the passes before it: no residual of its own `mu'`.
fn last_pass(view: &View) -> Vec<(&'static str, String)> {
    let Some(pass) = view.passes.last() else { return vec![("last pass", "none".into())] };
    let c = pass.comparison;
    let mu = value(c.and_then(|c| c.mu_relative), 1.0, 3, "");
    vec![
        ("last pass", format!("{}: mu' {mu}", pass.pass.point)),
        ("its surprise", signed(c.map(|c| c.z), 1, " sd")),
    ]
}

/// Text from a file or an instrument, on one line and without control characters.
pub fn plain(text: &str) -> String {
    // Colours too: what is shown has the view's own.
    clean(text).chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
