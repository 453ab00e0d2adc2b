//! The page of two runs side by side.

use super::html::{cell, column, columns, escape, glossary, list, note, numeric, row, shell, table};
use super::plots;
use crate::ambient::air_words;
use crate::compare::differences::Difference;
use crate::compare::{Compared, ComparisonAnswer, Mean, Paired, RunComparison};
use models::Ambient;
use std::fmt::Write;
use std::path::Path;

/// The page.
pub fn page(compared: &Compared) -> miette::Result<String> {
    let result = &compared.comparison;
    let name = |run: &Path| {
        escape(&run.file_name().map_or_else(|| run.display().to_string(), |n| n.to_string_lossy().into()))
    };
    let [a, b] = [name(&compared.runs[0]), name(&compared.runs[1])];
    let mut html = format!("<h1>{a} and {b}</h1>\n");
    let w = &mut html;
    w.push_str(&about(compared, &a, &b));
    let conditions = result.pairs.len();
    let class = match result.answer() {
        ComparisonAnswer::Differ => " departed",
        ComparisonAnswer::NoDifferenceSeen => "",
        ComparisonAnswer::CannotTell | ComparisonAnswer::NotIndependent => " undecided",
    };
    let _ = write!(
        w,
        "<div class=\"verdict{class}\"><p><strong>{}</strong></p><p>{}</p></div>",
        escape(&result.answer_words()),
        escape(&result.figures_words().join("\n")).replace('\n', "<br>")
    );
    if !compared.warnings.is_empty() {
        let _ = write!(w, "<h2>Caution</h2>{}", list(&compared.warnings, ""));
    }
    let [left, right] = result.unpaired;
    if left + right > 0 {
        w.push_str(&note(&format!("Passes at conditions that the other run lacks: {left} of the first, {right} of the second. They are left out.")));
    }
    if conditions > 0 {
        let _ = write!(
            w,
            "<h2>Relative friction of both</h2>{}<h2>Differences</h2>{}",
            plots::comparison::overlay(result)?,
            plots::comparison::differences(result)?
        );
        w.push_str(&pairs(result));
    }
    w.push_str(&differences(compared));
    w.push_str(&glossary());
    Ok(shell(&format!("{a} and {b}"), &html))
}

/// What is known of both, in one table: a fact a row.
fn about(compared: &Compared, a: &str, b: &str) -> String {
    let [first, second] = &compared.about;
    let mut names: Vec<&str> = first.iter().chain(second).map(|(name, _)| *name).collect();
    let mut seen = std::collections::BTreeSet::new();
    names.retain(|name| seen.insert(*name));
    let all = |side: &[(&str, String)], name: &str| -> String {
        let found: Vec<String> = side.iter().filter(|(n, _)| *n == name).map(|(_, v)| escape(v)).collect();
        if found.is_empty() { "none".into() } else { found.join("<br>") }
    };
    let row = |name: &str| {
        let cells = match (all(first, name), all(second, name)) {
            (a, b) if a == b => format!("<td colspan=\"2\">{a}</td>"),
            (a, b) => cell(a) + &cell(b),
        };
        row(escape(name), [cells]) + "\n"
    };
    let head = ["of the run", a, b].map(column).concat();
    table("Both runs", &head, names.into_iter().map(row))
}

/// The cell of the levels of the air, in a table that has the column.
pub(super) fn air_cell(column: bool, air: &Ambient) -> String {
    if column { cell(air_words(air).collect::<Vec<_>>().join(", ")) } else { String::new() }
}

/// Deviations from which a row stands out.
const STANDS_OUT: f64 = 3.0;

fn pairs(result: &RunComparison) -> String {
    let air = result.pairs.iter().any(|p| p.air != Ambient::default());
    let head =
        columns("#w, \u{b5}m|#f, kHz|#U, mm/s|#load, N|#\u{3bc}' first|#\u{3bc}' second|#difference|#in sd")
            + &if air { columns("air") } else { String::new() };
    let single = result.pairs.iter().all(|p| p.a.passes == 1 && p.b.passes == 1);
    let mean = |m: &Mean| match single {
        true => format!("{:.3}", m.mu_relative),
        false => format!("{:.3} ({})", m.mu_relative, m.passes),
    };
    let row = |p: &&Paired| {
        let out = if p.deviations().abs() > STANDS_OUT { " class=\"out\"" } else { "" };
        let speed = p.speed_m_s * f64::from(p.direction) * 1e3;
        let numbers = [
            format!("{:.3}", p.amplitude_pp_m * 1e6),
            format!("{:.2}", p.frequency_hz / 1e3),
            format!("{speed:+.1}"),
            format!("{:.2}", p.normal_force_n),
            mean(&p.a),
            mean(&p.b),
            format!("{:+.3} &plusmn; {:.3}", p.difference, p.difference_sd),
            format!("{:+.1}", p.deviations()),
        ];
        format!("<tr{out}>{}{}</tr>\n", numbers.map(numeric).concat(), air_cell(air, &p.air))
    };
    let passes = if single { "" } else { " In brackets: passes." };
    format!(
        "<h2>Condition by condition</h2>{}{}",
        note(&format!(
            "The largest differences come first; those above {STANDS_OUT} standard deviations are bold.{passes}"
        )),
        table("Conditions in common", &head, result.furthest_first().iter().map(row))
    )
}

fn differences(compared: &Compared) -> String {
    if compared.differences.is_empty() {
        return "<h2>What differed</h2><p>Nothing that the records hold.</p>".into();
    }
    let value = |v: &Option<String>| cell(escape(v.as_deref().unwrap_or("none")));
    let row = |d: &Difference| row(escape(&d.what), [&d.a, &d.b].map(value)) + "\n";
    let head = columns("what|first run|second run");
    let rows = compared.differences.iter().map(row);
    format!("<h2>What differed</h2>{}", table("What differed", &head, rows))
}
