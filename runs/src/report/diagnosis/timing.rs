//! What the edges in the run's record say of time: a sentence, the mean edge, and the numbers.

use crate::report::html::{columns, escape, note, table};
use crate::report::human::number;
use crate::report::plots::verdict::edge;
use diagnosis::timing::{Comparison, Form, title};
use diagnosis::verdict::Diagnosis;

/// The section; empty for a table without a record.
pub fn section(result: &Diagnosis) -> miette::Result<String> {
    let Some(record) = &result.report.record else { return Ok(String::new()) };
    let mut text = String::from("<h2>Does the force come in time?</h2>");
    let stated = record.stated_passband_hz.map_or_else(
        || {
            "The profile of the force sensor states no passband (passband_hz): its whole delay is found."
                .to_string()
        },
        |hz| {
            format!(
                "The profile of the force sensor states a passband of {} Hz; its delay is taken off.",
                number(hz)
            )
        },
    );
    for c in &record.comparisons {
        text += &format!("<p>{}.</p>", escape(&c.text));
    }
    let judged: Vec<&Comparison> = record.comparisons.iter().filter(|c| c.late_s.is_some()).collect();
    if judged.is_empty() {
        return Ok(text);
    }
    let figures: miette::Result<Vec<String>> =
        judged.iter().map(|c| edge(title(c.against), &c.mean)).collect();
    text += &format!("<div class=\"panels\">{}</div>", figures?.concat());
    text += &note(&format!(
        "Mean of the edges, as a share of the change of force. Points: measured. Dashes: expected of a channel in time. \
         Line: with what was found. {stated}"
    ));
    let head = columns("form of lateness|#probability|#mean delay, ms|#sd, ms");
    for c in judged {
        let rows: String = c
            .forms
            .iter()
            .map(|f| {
                let [late, sd] = [f.late_s, f.sd_s].map(|s| format!("{:.2}", 1e3 * s));
                format!(
                    "<tr><th scope=\"row\">{}</th><td class=\"n\">{}</td><td class=\"n\">{late}</td><td class=\"n\">{sd}</td></tr>",
                    form(f.form),
                    diagnosis::describe::probability(f.probability)
                )
            })
            .collect();
        let label = format!("Forms of lateness: {}", title(c.against));
        text += &format!(
            "<details><summary>{}</summary>{}</details>",
            escape(&label),
            table(&label, &head, &rows)
        );
    }
    Ok(text)
}

fn form(form: Form) -> &'static str {
    match form {
        Form::Delay => "delay (shift in time)",
        Form::FirstOrder => "lag of first order",
        Form::SecondOrder => "lag of second order",
    }
}
