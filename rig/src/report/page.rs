//! The page: words and tables around the figures.

use super::RunData;
use super::plots;
use crate::sequence::Outcome;
use std::fmt::Write;

/// Text made safe for HTML: names in records may hold markup.
pub fn escape(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '&' => safe.push_str("&amp;"),
            '"' => safe.push_str("&quot;"),
            '\'' => safe.push_str("&#39;"),
            c if c.is_control() && c != '\n' => safe.push('\u{fffd}'),
            c => safe.push(c),
        }
    }
    safe
}

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:62rem;margin:2rem auto;padding:0 1rem;color:#1a1a1a}\
h1{font-size:1.6rem}h2{font-size:1.15rem;margin-top:2rem}table{border-collapse:collapse;font-size:.9rem}\
td,th{border-bottom:1px solid #ddd;padding:.25rem .7rem;text-align:left}td.n{text-align:right;font-variant-numeric:tabular-nums}\
figure{margin:1rem 0}figcaption{color:#555;font-size:.9rem}svg{max-width:100%;height:auto}\
.verdict{padding:.7rem 1rem;border-left:5px solid #2a7;background:#f2faf5}.departed{border-color:#c50;background:#fdf4ee}\
details{margin-top:1.5rem}.bar{display:inline-block;height:.7em;background:#0072b2}.maps{display:flex;flex-wrap:wrap}";

/// A self-contained page around a body; the title is HTML already.
pub(super) fn shell(title: &str, body: &str) -> String {
    format!(
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>muprime: {title}</title>\
         <meta name=\"viewport\" content=\"width=device-width\"><style>{STYLE}</style></head><body>\n{body}</body></html>\n"
    )
}

pub(super) fn page(run: &RunData) -> miette::Result<String> {
    let fact = |name: &str| escape(run.facts.get(name).map_or("unknown", String::as_str));
    let mut html = String::new();
    let w = &mut html;
    let title = format!("{} on {}", fact("plan"), fact("setup"));
    let _ = writeln!(w, "<h1>{title}</h1>");
    verdict(w, run);
    let _ = write!(
        w,
        "<h2>Relative friction against amplitude</h2>{}{}\
         <h2>Relative friction against &Psi;</h2>{}{}\
         <h2>Residuals</h2>{}{}",
        plots::mu_against_amplitude(run)?,
        caption(
            "Points: measured passes with one standard uncertainty. Lines and bands: the spring-slider alone at the \
                 base condition of each speed, with twice its standard uncertainty; what a corrected model adds is not drawn, \
                 it stands in the residuals and in the table. w is peak-to-peak."
        ),
        plots::mu_against_psi(run)?,
        caption(
            "&Psi; = U / (w f &mu;<sub>0</sub> (1+&nu;)), Eq. 17. Line: Eq. 20 with &Psi;* = 2.38 &plusmn; 0.21."
        ),
        plots::residuals(run)?,
        caption(
            "Measured less predicted lateral force, in standard deviations, in the order of measurement; \
                 independent from pass to pass as long as the model holds. Dashed: &plusmn;1.96."
        ),
    );
    timing(w, run)?;
    events(w, run);
    passes(w, run);
    facts(w, run);
    Ok(shell(&title, &html))
}

fn caption(text: &str) -> String {
    format!("<p><small>{text}</small></p>\n")
}

fn verdict(w: &mut String, run: &RunData) {
    let departed = run.passes.iter().any(|p| p.comparison.is_some_and(|c| c.departed));
    let made = run.passes.len();
    let outcome = match &run.summary {
        None => "The run has no ending: it was killed, or is still going.".to_string(),
        Some(s) => {
            let word = serde_json::to_string(&s.outcome).unwrap_or_default();
            let planned = s.planned;
            match &s.outcome {
                Outcome::Complete => format!("Complete: {made} of {planned} passes."),
                Outcome::Tripped(trip) => format!(
                    "Ended early after {made} of {planned} passes: tripped, {}.<br>{}",
                    escape(&trip.to_string()),
                    escape(trip.cause.remedy())
                ),
                Outcome::WouldNotArm { blocking: Some(cause) } => format!(
                    "The rig would not arm: {cause:?} stood in the way.<br>{}",
                    escape(cause.remedy())
                ),
                _ => format!("Ended early after {made} of {planned} passes: {}", escape(&word)),
            }
        }
    };
    let finding = if departed {
        let first = run.passes.iter().find(|p| p.comparison.is_some_and(|c| c.departed));
        let at = first.map_or(0, |p| p.pass.point);
        format!(
            "<strong>The model has left the measurement</strong> (first at point {at}). \
                 Run <code>muprime diagnose</code> on this folder to learn where and why."
        )
    } else {
        let complete = run.summary.as_ref().is_some_and(|s| s.outcome == Outcome::Complete);
        let last = run.passes.iter().rev().find_map(|p| p.comparison.as_ref());
        escape(&format!("Finding: {}.", realtime::compare::Agreement::of(last, complete)))
    };
    let class = if departed { "verdict departed" } else { "verdict" };
    let _ = writeln!(w, "<p class=\"{class}\">{finding}<br>{outcome}</p>");
    if !run.damage.is_empty() {
        let items: String = run.damage.iter().map(|d| format!("<li>{}</li>", escape(d))).collect();
        let _ = writeln!(
            w,
            "<div class=\"verdict departed\"><strong>The records of this run are not whole</strong><ul>{items}</ul></div>"
        );
    }
    let flagged = run.passes.iter().filter(|p| !p.temperature_flags.is_empty()).count();
    if let Some(flag) = run.passes.iter().find_map(|p| p.temperature_flags.first()) {
        let _ = writeln!(
            w,
            "<p class=\"verdict departed\">{flagged} of {made} passes began at a temperature at which a certificate \
             does not hold (first: {}). They are marked * below; nothing was corrected.</p>",
            escape(&flag.to_string())
        );
    }
}

fn timing(w: &mut String, run: &RunData) -> miette::Result<()> {
    let Some(report) = run.summary.as_ref().and_then(|s| s.loop_report.as_ref()) else {
        let _ = writeln!(w, "<h2>Loop</h2><p>No loop timing: virtual time, or no ending.</p>");
        return Ok(());
    };
    let us = |ns: u64| format!("{:.0} us", ns as f64 / 1e3);
    let [p50, _, p99, p999, max] = report.lateness_ns;
    let granted = &report.grants;
    let class = match &granted.policy_refused {
        None => format!("{} priority {}", escape(&granted.policy), granted.priority),
        Some(why) => format!("{} (SCHED_FIFO refused: {})", escape(&granted.policy), escape(why)),
    };
    let locked = if granted.memory_locked { "memory locked" } else { "memory not locked" };
    let _ = write!(
        w,
        "<h2>Loop</h2>{}{}<p>{} cycles of {} us. Lateness: median {}, 99 % {}, 99.9 % {}, worst {}. \
         {} deadlines missed. Scheduling: {class}, {locked}. Page faults in the loop: {} minor, {} major. \
         Rows lost: {}.</p>",
        plots::lateness(report)?,
        caption("How late the loop was at each deadline, missed ones included. Both axes logarithmic."),
        report.cycles,
        report.period_ns / 1000,
        us(p50),
        us(p99),
        us(p999),
        us(max),
        report.overruns,
        report.minor_faults,
        report.major_faults,
        run.summary.as_ref().map_or(0, |s| s.record_lost),
    );
    Ok(())
}

fn events(w: &mut String, run: &RunData) {
    w.push_str("<h2>Events</h2><table><tr><th>time</th><th>event</th><th>details</th></tr>\n");
    for (at, event) in &run.events {
        let name = event.get("event").and_then(|e| e.as_str()).unwrap_or("?").replace('_', " ");
        let mut details = event.clone();
        if let Some(map) = details.as_object_mut() {
            map.remove("event");
        }
        let _ = writeln!(
            w,
            "<tr><td class=\"n\">{at:.3} s</td><td>{}</td><td><code>{}</code></td></tr>",
            escape(&name),
            escape(&details.to_string())
        );
    }
    w.push_str("</table>\n");
}

fn passes(w: &mut String, run: &RunData) {
    w.push_str(
        "<details><summary>All passes</summary><table><tr><th>point</th><th>w um</th><th>f kHz</th><th>U mm/s</th>\
         <th>dir</th><th>F<sub>n</sub> N</th><th>L N</th><th>&mu;'</th><th>&plusmn;</th><th>predicted</th>\
         <th>&plusmn;</th><th>z</th></tr>\n",
    );
    for p in &run.passes {
        let c = p.comparison;
        let number =
            |v: Option<f64>, digits: usize| v.map_or("&ndash;".to_string(), |v| format!("{v:.digits$}"));
        let _ = writeln!(
            w,
            "<tr><td class=\"n\">{}{}</td><td class=\"n\">{:.3}</td><td class=\"n\">{:.2}</td><td class=\"n\">{:.1}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{:.4}</td><td class=\"n\">{}</td><td class=\"n\">{}</td>\
             <td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td><td class=\"n\">{}</td></tr>",
            p.pass.point,
            if p.temperature_flags.is_empty() { "" } else { "*" },
            p.pass.amplitude.micrometres(),
            p.pass.frequency_hz / 1e3,
            p.pass.speed_m_s * 1e3,
            i8::from(p.pass.direction),
            p.pass.normal_force_n,
            number(p.pass.lateral_force_n, 4),
            number(c.and_then(|c| c.mu_relative), 3),
            number(c.and_then(|c| c.mu_relative_sd), 3),
            number(c.map(|c| c.predicted), 3),
            number(c.map(|c| c.predicted_sd), 3),
            number(c.map(|c| c.z), 2),
        );
    }
    w.push_str("</table></details>\n");
}

fn facts(w: &mut String, run: &RunData) {
    w.push_str("<details><summary>The record</summary><table>\n");
    for (name, value) in &run.facts {
        let _ = writeln!(w, "<tr><td>{}</td><td><code>{}</code></td></tr>", escape(name), escape(value));
    }
    w.push_str("</table></details>\n");
}

#[cfg(test)]
mod tests {
    #[test]
    fn markup_and_terminal_escapes_in_names_are_harmless() {
        let bad = "<script>alert('x')</script>\u{1b}[31m\"&";
        let safe = super::escape(bad);
        assert!(
            !safe.contains('<') && !safe.contains('\u{1b}') && !safe.contains('"') && !safe.contains('\'')
        );
    }
}
