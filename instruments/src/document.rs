//! A profile as a page for people, generated so that it cannot drift from what the drivers do.

use crate::Profile;
use std::fmt::Write;

/// The page, in Markdown.
#[must_use]
pub fn markdown(profile: &Profile) -> String {
    let d = &profile.description;
    let mut page = String::new();
    let mut line = |text: String| {
        let _ = writeln!(page, "{text}");
    };
    line(format!("# {}\n", d.profile.id));
    line(format!(
        "{}: {}. Roles: {:?}. Tried: {:?}.\n",
        d.profile.maker,
        d.profile.models.join(", "),
        d.profile.roles,
        d.profile.verified
    ));
    if !d.profile.notes.is_empty() {
        line(format!("{}\n", d.profile.notes));
    }
    line(format!("Source of the facts: {}.\n", d.profile.provenance));
    let link = &d.link;
    line(format!(
        "Link: {:?}; an answer must be complete within {} ms.\n",
        link.kind, link.response_timeout_ms
    ));
    line("| frame | bytes | per second |\n|---|---|---|".into());
    for frame in profile.frames() {
        let rate = d.poll.iter().find(|p| *p.name.as_ref() == frame.name).map(|p| p.rate_hz);
        let rate = rate.unwrap_or_else(|| {
            let message = d.message.iter().find(|m| *m.name.as_ref() == frame.name).map(|m| m.rate_hz);
            let query = d.query.iter().find(|q| *q.name.as_ref() == frame.name).map(|q| q.rate_hz);
            message.or(query).or(d.stream.as_ref().map(|stream| stream.rate_hz))
        });
        let rate = rate.map_or("once".to_string(), |rate| rate.to_string());
        line(format!("| {} | {} | {rate} |", frame.name, frame.bytes));
    }
    line("\n| signal | frame | one count | range | what |\n|---|---|---|---|---|".into());
    for (signal, id) in d.signal.iter().zip(profile.signals().map(|(_, id)| id)) {
        let frame = &profile.frames()[profile.frame_of(id).0].name;
        let count = if let Some(step) = signal.resolution_si {
            format!("{step} {}", signal.si.unit)
        } else if signal.scale_expr.is_some() {
            "varies".into()
        } else {
            format!("{} {}", signal.scale, signal.unit)
        };
        let range =
            signal.range.map_or(String::new(), |(low, high)| format!("{low} to {high} {}", signal.unit));
        line(format!(
            "| {} | {frame} | {} | {range} | {} |",
            signal.name.as_ref(),
            count.trim(),
            signal.text
        ));
    }
    if !d.set.is_empty() {
        line("\n| set-point | step | range | safe | echo | what |\n|---|---|---|---|---|---|".into());
        for set in &d.set {
            let range =
                set.range.map_or(String::new(), |(low, high)| format!("{low} to {high} {}", set.unit));
            let safe = set.safe.map_or(String::new(), |safe| safe.to_string());
            let step = format!("{} {}", set.scale, set.unit);
            let echo = set.echo.as_deref().unwrap_or("");
            line(format!(
                "| {} | {} | {range} | {safe} | {echo} | {} |",
                set.name.as_ref(),
                step.trim(),
                set.text
            ));
        }
    }
    if !d.signature.is_empty() || !d.fault.is_empty() {
        line("\n| when | then |\n|---|---|".into());
        for signature in &d.signature {
            line(format!("| not `{}` | refused: {} |", escaped(signature.when.as_ref()), signature.text));
        }
        for fault in &d.fault {
            line(format!("| `{}` | {:?}: {} |", escaped(fault.when.as_ref()), fault.severity, fault.text));
        }
    }
    page
}

/// A bar ends a table's cell.
fn escaped(text: &str) -> String {
    text.replace('|', "\\|")
}
