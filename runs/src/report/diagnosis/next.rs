//! What to measure next, in physical words, with the plan beside it.

use crate::format::{number, titled};
use crate::report::html::{column, escape, numeric, table};
use diagnosis::Diagnosis;
use diagnosis::report::next::Experiment;
use models::Condition;
use models::covariate::{self, Covariate};

/// The section.
pub fn section(result: &Diagnosis) -> String {
    let experiments = &result.report.next_experiment;
    if experiments.is_empty() {
        return "<h2>What to do next</h2><p>Nothing on this list would tell more.</p>".into();
    }
    let all: String = experiments.iter().map(one).collect();
    format!("<h2>What to do next</h2>{all}")
}

fn one(e: &Experiment) -> String {
    let worth = escape(&e.worth());
    if e.conditions.is_empty() {
        let text = escape(&e.text);
        return format!("<div class=\"card\"><p><strong>{text}</strong></p><p>{worth}</p></div>");
    }
    let planned: Vec<&Covariate> =
        covariate::planned().filter(|c| e.conditions.iter().any(|k| c.of(k).is_some())).collect();
    let heads: String = planned.iter().map(|c| column(&format!("#{}", escape(&titled(c))))).collect();
    let row = |k: &Condition| {
        let cell = |c: &&Covariate| c.of(k).map_or("&ndash;".into(), |v| number(c.shown.0 * v));
        format!("<tr>{}</tr>", planned.iter().map(cell).map(numeric).collect::<String>())
    };
    format!(
        "<div class=\"card\"><p><strong>Measure these {} passes</strong>, those that tell most first. {worth}</p>{}\
         <p class=\"note\"><a download=\"next-plan.toml\" href=\"{}\">Download these passes as a plan</a>; \
         <code>muprime run next-plan.toml</code> measures them.</p></div>",
        e.conditions.len(),
        table("Passes of the next experiment", &heads, e.conditions.iter().map(row)),
        as_address(&crate::verdict_text::plan(e, &[]))
    )
}

/// A file within an address, so that a page that stands alone can hand it out.
fn as_address(text: &str) -> String {
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-_.~".contains(&b);
    let byte = |b: u8| if plain(b) { char::from(b).to_string() } else { format!("%{b:02X}") };
    format!("data:application/toml;charset=utf-8,{}", text.bytes().map(byte).collect::<String>())
}
