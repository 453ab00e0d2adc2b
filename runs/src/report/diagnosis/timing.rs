//! What the edges in the run's record say of time: a sentence, the mean edge, and the numbers.

use crate::format::number;
use crate::report::html::{columns, escape, note, numeric, row, table};
use crate::report::plots::verdict::edge;
use diagnosis::Diagnosis;
use diagnosis::report::format::probability;
use diagnosis::report::timing::{FormNote, ResponseForm, TimingComparison, title};

/// The section; empty for a table without a record.
pub fn section(result: &Diagnosis) -> miette::Result<String> {
    let Some(record) = &result.report.record else { return Ok(String::new()) };
    let mut text = String::from("<h2>Does the force come in time?</h2>");
    let states = match record.stated_passband_hz.map(number) {
        None => "no passband (passband_hz): its whole delay is found.".to_string(),
        Some(hz) => format!("a passband of {hz} Hz; its delay is taken off."),
    };
    text.extend(record.comparisons.iter().map(|c| format!("<p>{}.</p>", escape(&c.text))));
    let judged: Vec<&TimingComparison> = record.comparisons.iter().filter(|c| c.late_s.is_some()).collect();
    if judged.is_empty() {
        return Ok(text);
    }
    let figures: miette::Result<Vec<_>> = judged.iter().map(|c| edge(title(c.against), &c.mean)).collect();
    text += &format!("<div class=\"panels\">{}</div>", figures?.concat());
    text += &note(&format!(
        "Mean of the edges, as a share of the change of force. Points: measured. Dashes: expected of a channel in time. \
         Line: with what was found. The profile of the force sensor states {states}"
    ));
    let head = columns("form of lateness|#probability|#mean delay, ms|#sd, ms");
    for c in judged {
        let row = |f: &FormNote| {
            let [late, sd] = [f.late_s, f.sd_s].map(|s| format!("{:.2}", 1e3 * s));
            row(form(f.form), [probability(f.probability), late, sd].map(numeric))
        };
        let label = format!("Forms of lateness: {}", title(c.against));
        let forms = table(&label, &head, c.forms.iter().map(row));
        text += &format!("<details><summary>{}</summary>{forms}</details>", escape(&label));
    }
    Ok(text)
}

fn form(form: ResponseForm) -> &'static str {
    match form {
        ResponseForm::Delay => "delay (shift in time)",
        ResponseForm::FirstOrder => "lag of first order",
        ResponseForm::SecondOrder => "lag of second order",
    }
}
