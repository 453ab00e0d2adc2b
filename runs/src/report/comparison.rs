//! The page of two runs side by side.

use super::html::{escape, glossary, list, note, shell, table};
use super::plots;
use crate::compare::{Compared, Paired};
use std::fmt::Write;
use std::path::Path;

/// The page.
///
/// # Errors
/// Only if the drawing library fails.
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
    match &result.judged {
        None => w.push_str(
            "<div class=\"verdict\"><p>Cannot tell: the runs have no condition in common.</p></div>",
        ),
        Some(judged) => {
            let [shift, scatter] = judged.figures_words(conditions);
            let _ = write!(
                w,
                "<div class=\"verdict\"><p><strong>{}</strong></p><p>{}<br>{}</p></div>",
                escape(&judged.answer_words(conditions)),
                escape(&shift),
                escape(&scatter)
            );
        }
    }
    if !compared.warnings.is_empty() {
        let _ = write!(w, "<h2>Mind</h2>{}", list(&compared.warnings, ""));
    }
    let [left, right] = result.unpaired;
    if left + right > 0 {
        w.push_str(&note(&format!("Passes at conditions that the other run lacks: {left} of the first, {right} of the second. They take no part.")));
    }
    if conditions > 0 {
        let _ = write!(
            w,
            "<h2>Relative friction of both</h2>{}<h2>Differences</h2>{}",
            plots::comparison::overlay(result)?,
            plots::comparison::differences(result)?
        );
        w.push_str(&pairs(&result.pairs));
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
    let rows: String = names
        .into_iter()
        .map(|name| {
            let sides = [all(first, name), all(second, name)];
            format!(
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td></tr>\n",
                escape(name),
                sides[0],
                sides[1]
            )
        })
        .collect();
    let head =
        format!("<th scope=\"col\">of the run</th><th scope=\"col\">{a}</th><th scope=\"col\">{b}</th>");
    table("Both runs", &head, &rows)
}

fn pairs(pairs: &[Paired]) -> String {
    let column = |name: &str| format!("<th scope=\"col\" class=\"n\">{name}</th>");
    let head: String =
        ["w, um", "f, kHz", "U, mm/s", "load, N", "\u{3bc}' first", "\u{3bc}' second", "difference", "in sd"]
            .map(column)
            .concat();
    let row = |p: &Paired| {
        let speed = p.speed_m_s * f64::from(p.direction) * 1e3;
        format!(
            "<tr><td class=\"n\">{:.3}</td><td class=\"n\">{:.2}</td><td class=\"n\">{speed:+.1}</td><td class=\"n\">{:.2}</td>\
             <td class=\"n\">{:.3} ({})</td><td class=\"n\">{:.3} ({})</td><td class=\"n\">{:+.3} &plusmn; {:.3}</td>\
             <td class=\"n\">{:+.1}</td></tr>\n",
            p.amplitude_pp_m * 1e6,
            p.frequency_hz / 1e3,
            p.normal_force_n,
            p.a.mu_relative,
            p.a.passes,
            p.b.mu_relative,
            p.b.passes,
            p.difference,
            p.difference_sd,
            p.difference / p.difference_sd
        )
    };
    let rows: String = pairs.iter().map(row).collect();
    format!(
        "<h2>Condition by condition</h2>{}{}",
        note("In brackets: passes."),
        table("Conditions in common", &head, &rows)
    )
}

fn differences(compared: &Compared) -> String {
    if compared.differences.is_empty() {
        return "<h2>What differed</h2><p>Nothing that the records tell.</p>".into();
    }
    let value = |v: &Option<String>| escape(v.as_deref().unwrap_or("none"));
    let rows: String = compared
        .differences
        .iter()
        .map(|d| {
            format!(
                "<tr><th scope=\"row\">{}</th><td>{}</td><td>{}</td></tr>\n",
                escape(&d.what),
                value(&d.a),
                value(&d.b)
            )
        })
        .collect();
    let head = "<th scope=\"col\">what</th><th scope=\"col\">first run</th><th scope=\"col\">second run</th>";
    format!("<h2>What differed</h2>{}", table("What differed", head, &rows))
}
