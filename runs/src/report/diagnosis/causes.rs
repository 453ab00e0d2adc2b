//! Which cause: the ranking, and each cause that is left with its mechanism, its source, its size, and its
//! law over the passes.

use super::mechanism::drawing;
use super::overlay::Overlay;
use crate::report::html::{bar, columns, escape, table};
use crate::verdict::{EXPLAINED, aliases, estimate, plain};
use diagnosis::describe::probability;
use diagnosis::verdict::{Diagnosis, Hypothesis};

/// Probability from which a hypothesis is listed.
const LISTED: f64 = 0.002;

fn name(h: &Hypothesis) -> String {
    if h.effects.is_empty() { "no gap".into() } else { plain(&h.effects.join(" + ")) }
}

/// The section.
pub fn section(result: &Diagnosis, overlay: &Overlay<'_>) -> miette::Result<String> {
    let listed: Vec<&Hypothesis> =
        result.report.hypotheses.iter().filter(|h| h.probability > LISTED).take(12).collect();
    let rows: String = listed
        .iter()
        .map(|h| {
            let alias = aliases(h).map_or_else(String::new, |others| {
                format!("<br><small>cannot be separated from {}</small>", escape(&others))
            });
            format!(
                "<tr><th scope=\"row\">{}{alias}</th><td class=\"n\">{}</td><td>{}</td></tr>",
                escape(&name(h)),
                probability(h.probability),
                bar(160.0 * h.probability)
            )
        })
        .collect();
    let head = columns("hypothesis|#probability|");
    let class: Vec<&str> = result
        .report
        .hypotheses
        .first()
        .map_or(Vec::new(), |h| h.alias_class.iter().flat_map(|name| name.split('+')).collect());
    let mut shown: Vec<&str> = Vec::new();
    let mut cards = String::new();
    for h in listed {
        let cause = h.probability > EXPLAINED || h.effects.iter().any(|e| class.contains(&e.as_str()));
        if !cause || h.effects.iter().all(|e| shown.contains(&e.as_str())) {
            continue;
        }
        cards += &card(h, &overlay.law(h)?);
        shown.extend(h.effects.iter().map(String::as_str));
    }
    Ok(format!("<h2>Which cause</h2>{}{cards}", table("Hypotheses", &head, &rows)))
}

/// What a hypothesis says, effect by effect, with its parameters and the figure of its law.
fn card(h: &Hypothesis, law: &str) -> String {
    if h.effects.is_empty() {
        return String::new();
    }
    let of = |effect: &String| {
        match effects::by_name(effect) {
        Some(known) => format!(
            "<div class=\"cause\">{}<div><p><strong>{}</strong> (in the {}): {}</p><p class=\"note\">Source: {}</p></div></div>",
            drawing(known),
            escape(&plain(effect)),
            known.place.name(),
            escape(known.summary),
            escape(known.source)
        ),
        None => "<p>A cause that the library does not have: a smooth map over the operating space stands for it.</p>".into(),
    }
    };
    let words: String = h.effects.iter().map(of).collect();
    let rows: String = h
        .parameters
        .iter()
        .map(|p| {
            format!(
                "<tr><th scope=\"row\">{}</th><td>{}</td></tr>",
                escape(&p.name.replace('_', " ")),
                escape(&estimate(p))
            )
        })
        .collect();
    let laws = if h.laws.is_empty() {
        String::new()
    } else {
        format!("<p>Law: {}.</p>", escape(&plain(&h.laws.join(" + "))))
    };
    let sizes = if rows.is_empty() {
        String::new()
    } else {
        table(&format!("Parameters of {}", name(h)), &columns("parameter|value [95 % interval]"), &rows)
    };
    format!(
        "<div class=\"card\"><h3>{}, probability {}</h3>{words}{laws}{law}{sizes}</div>",
        escape(&name(h)),
        probability(h.probability)
    )
}
