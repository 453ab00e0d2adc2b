//! What a page and a terminal say of a rendered target.

use super::html::{columns, escape, list, note, table};
use super::plots::fidelity::{key, over_position, transfer};
use crate::fidelity::dynamics::ChainStage;
use crate::fidelity::{Fidelity, Group, Late};
use crate::format::{number, quantity};
use std::fmt::Write;

/// Groups whose profile is drawn.
const DRAWN: usize = 3;

/// Where the rendering of a group ends, by name.
fn ends(group: &Group) -> String {
    let found = group.minus_3_db.map(|at| format!("-3 dB at {:.1} \u{b1} {:.1} Hz", at.hz, at.sd_hz));
    let mut text = match (found, group.known_minus_3_db_hz) {
        (Some(found), Some(known)) => format!("{found}; the known dynamics give {known:.1} Hz"),
        (Some(found), None) => found,
        (None, Some(known)) => format!("the known dynamics end at {known:.1} Hz"),
        (None, None) => "the dynamics are not known".into(),
    };
    let part = |p: &ChainStage| Some(format!("{} {:.0} Hz", p.name, p.corner_hz?));
    let parts: Vec<String> = group.parts.iter().filter_map(part).collect();
    if !parts.is_empty() {
        let _ = write!(text, " (each alone: {})", parts.join(", "));
    }
    if group.lead_s > 0.0 {
        let _ = write!(text, "; the target is read {} ahead", quantity(group.lead_s, "s"));
    }
    text
}

fn shift(group: &Group) -> String {
    let mm = |way: Option<f64>| way.map_or("none".into(), |way| number(way * 1e3));
    format!("{} / {}", mm(group.shift_m[0]), mm(group.shift_m[1]))
}

/// Why there is no shift, and the parts that come later than known, in sentences.
fn delays(group: &Group) -> Vec<String> {
    let missing = group.shift_missing.iter().map(|why| format!("passes without a shift: {why}"));
    let of = |late: &Late| {
        // Scatter below 10 us is stated as 10 us.
        let [delay, sd, known] =
            [late.delay_s, late.sd_s.max(1e-5), late.known_s].map(|s| format!("{:.2}", s * 1e3));
        let (what, remedy) = match late.part.as_str() {
            "sensor" => (
                "the measured friction comes",
                "the force sensor is slower than stated, or its times are shifted".to_string(),
            ),
            _ => {
                let lead_s = late.delay_s + group.lead_s;
                let lead = format!("lead_s = {lead_s:.4} in [render] reads the target ahead");
                ("the amplitude comes", format!("amplifier or plate is slower than stated; {lead}"))
            }
        };
        format!("{what} {delay} \u{b1} {sd} ms late, {known} ms are known: {remedy}")
    };
    missing.chain(group.late.iter().filter(|late| late.slower).map(of)).collect()
}

/// Lines for a terminal.
pub fn lines(fidelity: &Fidelity) -> Vec<String> {
    let of = |group: &Group| {
        let saturated = match group.saturated {
            0.0 => String::new(),
            share => format!("; {:.0} % of the way could not be had", 100.0 * share),
        };
        let shifted = match (group.shift_m, group.rms_shifted) {
            ([None, None], _) => String::new(),
            (_, rms) => format!(", {rms:.3} without the shift of {} mm (forward / backward)", shift(group)),
        };
        let first = [
            format!(
                "rendered at {}: mu' off by {:.3} rms ({:.0} % within {}){shifted}{saturated}",
                quantity(group.speed_m_s, "m/s"),
                group.rms,
                100.0 * group.within_tolerance,
                fidelity.tolerance,
            ),
            format!("  {}", ends(group)),
        ];
        first.into_iter().chain(delays(group).into_iter().map(|line| format!("  {line}"))).collect::<Vec<_>>()
    };
    fidelity.groups.iter().flat_map(of).chain(fidelity.remarks.iter().cloned()).collect()
}

/// The section of a run's page.
pub(super) fn section(fidelity: &Fidelity) -> miette::Result<String> {
    let head = columns(
        "U, mm/s|load, N|passes|&mu;' off, rms|mean|within tolerance|shift, mm|rms without it|\
         loop and plate, rms|law and sensor, rms|not to be had|where it ends",
    );
    let row = |g: &Group| {
        format!(
            "<tr><td>{:.1}</td><td>{}</td><td>{}</td><td>{:.3}</td><td>{:+.3}</td><td>{:.0} %</td><td>{}</td><td>{:.3}</td>\
             <td>{:.3}</td><td>{:.3}</td><td>{:.0} %</td><td>{}</td></tr>\n",
            g.speed_m_s * 1e3,
            number(g.normal_force_n),
            g.passes,
            g.rms,
            g.bias,
            100.0 * g.within_tolerance,
            shift(g),
            g.rms_shifted,
            g.rms_command,
            g.rms_law,
            100.0 * g.saturated,
            escape(&ends(g)),
        )
    };
    let mut figures = String::new();
    for group in fidelity.groups.iter().take(DRAWN) {
        for (places, way) in group.profiles.iter().zip(["forward", "backward"]).filter(|(p, _)| p.len() > 1) {
            let what = format!("{} {way}", quantity(group.speed_m_s, "m/s"));
            let _ = write!(
                figures,
                "<figure>{}<figcaption>{what}</figcaption></figure>",
                over_position(places, &what)?
            );
        }
    }
    let at = |group: &Group| {
        let speed = quantity(group.speed_m_s, "m/s");
        delays(group).into_iter().map(move |line| format!("at {speed} {line}")).collect::<Vec<_>>()
    };
    let remarks: Vec<String> =
        fidelity.remarks.iter().cloned().chain(fidelity.groups.iter().flat_map(at)).collect();
    let remarks = if remarks.is_empty() { String::new() } else { list(&remarks, "") };
    Ok(format!(
        "<h2>Rendered friction</h2>{}{remarks}<div class=\"panels\">{figures}</div>{}{}{}",
        table("Fidelity by speed", &head, fidelity.groups.iter().map(row)),
        note(
            "Grey: wanted &mu;'. Dashed: predicted by the law at the amplitude read back. Line and band: measured, with twice the \
             standard deviation over the repeats. The shift is the way by which the measurement comes after the target, forward and backward."
        ),
        transfer(&fidelity.groups)?,
        note(&format!(
            "Gain from wanted to measured &mu;' by Welch's method, with one standard deviation ({}). Line: plate, loop and sensor as they are \
             known. Spatial frequency is the temporal one over the speed.",
            escape(&key(&fidelity.groups))
        )),
    ))
}
