//! Which cause: the ranking, and each cause that is left with its mechanism, its source, its size, and its
//! law over the passes.

use super::mechanism::drawing;
use super::overlay::Overlay;
use crate::report::html::{bar, cell, columns, escape, numeric, row, table};
use crate::verdict_text::{EXPLAINED, aliases, estimate, name};
use diagnosis::report::format::{plain, probability};
use diagnosis::report::intervals::Estimate;
use diagnosis::{Diagnosis, Hypothesis};

/// Probability from which a hypothesis is listed.
const LISTED: f64 = 0.002;

/// The section.
pub fn section(result: &Diagnosis, overlay: &Overlay<'_>) -> miette::Result<String> {
    let listed: Vec<&Hypothesis> =
        result.report.hypotheses.iter().filter(|h| h.probability > LISTED).take(12).collect();
    let row = |h: &&Hypothesis| {
        let alias = aliases(h).map_or_else(String::new, |others| {
            format!("<br><small>cannot be separated from {}</small>", escape(&others))
        });
        let [odds, bar] = [numeric(probability(h.probability)), cell(bar(160.0 * h.probability))];
        row(escape(&name(&h.effects)) + &alias, [odds, bar])
    };
    let head = columns("hypothesis|#probability|");
    let first = result.report.hypotheses.first().into_iter().flat_map(|h| &h.alias_class);
    let class: Vec<&str> = first.flat_map(|name| name.split('+')).collect();
    let mut shown: Vec<&str> = Vec::new();
    let mut cards = String::new();
    for h in &listed {
        let cause = h.probability > EXPLAINED || h.effects.iter().any(|e| class.contains(&e.as_str()));
        if !cause || h.effects.iter().all(|e| shown.contains(&e.as_str())) {
            continue;
        }
        cards += &card(h, &overlay.law(h)?);
        shown.extend(h.effects.iter().map(String::as_str));
    }
    Ok(format!("<h2>Which cause</h2>{}{cards}", table("Hypotheses", &head, listed.iter().map(row))))
}

/// What a hypothesis says, effect by effect, with its parameters and the figure of its law.
fn card(h: &Hypothesis, law: &str) -> String {
    if h.effects.is_empty() {
        return String::new();
    }
    let of = |effect: &String| match effects::by_name(effect) {
        Some(known) => {
            let [name, summary, source] = [&*plain(effect), known.summary, known.source].map(escape);
            let (drawing, place) = (drawing(known), known.place.name());
            format!(
                "<div class=\"cause\">{drawing}<div><p><strong>{name}</strong> (in the {place}): {summary}</p>\
                 <p class=\"note\">Source: {source}</p></div></div>"
            )
        }
        None => {
            "<p>A cause that the library does not have: a smooth map over the operating space stands for \
                 it.</p>"
                .into()
        }
    };
    let words: String = h.effects.iter().map(of).collect();
    let row = |p: &Estimate| row(escape(&p.name.replace('_', " ")), [cell(escape(&estimate(p)))]);
    let laws = if h.laws.is_empty() {
        String::new()
    } else {
        format!("<p>Law: {}.</p>", escape(&plain(&h.laws.join(" + "))))
    };
    let sizes = if h.parameters.is_empty() {
        String::new()
    } else {
        let (label, head) =
            (format!("Parameters of {}", name(&h.effects)), columns("parameter|value [95 % interval]"));
        table(&label, &head, h.parameters.iter().map(row))
    };
    format!(
        "<div class=\"card\"><h3>{}, probability {}</h3>{words}{laws}{law}{sizes}</div>",
        escape(&name(&h.effects)),
        probability(h.probability)
    )
}
