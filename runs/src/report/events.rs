//! What happened during a run, in words: for the terminal and for the page.

use super::html::{escape, table};
use super::human::number;
use crate::sequence::Event;
use realtime::safety::Cause;

/// An event in words.
pub fn describe(event: &Event) -> String {
    match event {
        Event::Armed => "armed".into(),
        Event::NoSecondChannel => {
            "no second switch-off channel: what the amplifier refuses, only a hand at its supply switches off"
                .into()
        }
        Event::NoWatchdog => "the amplifier has no watchdog: the second channel stands for it".into(),
        Event::ArmingDisturbed { cause, held_up } => {
            let what = match cause {
                Cause::EmergencyStop => {
                    "nothing was heard of the emergency stop, and the supply was cut for it".into()
                }
                cause => format!("the proof of the second channel was broken off ({cause:?})"),
            };
            let why = match held_up.seconds() * 1e3 {
                ms if ms < 1.0 => String::new(),
                ms => format!("; the loop was held up for {ms:.0} ms"),
            };
            format!(
                "before arming {what}{why}: nothing was driven; the second channel is proved from the beginning"
            )
        }
        Event::Zeros { lateral_n, normal_n, after } => {
            let mn = |v: &Option<f64>| v.map_or("none".into(), |v| format!("{:+.2} mN", v * 1e3));
            let when = if *after { "after" } else { "before" };
            format!("force zeros {when} the sweep: lateral {}, normal {}", mn(lateral_n), mn(normal_n))
        }
        Event::Tripped(trip) => format!("TRIP {trip}\n  {}", trip.cause.remedy()),
        Event::ModelDeparted { point, log_evidence } => {
            let odds = (log_evidence / std::f64::consts::LN_10).floor();
            format!("the model has left the measurement at point {point} (evidence beyond 10^{odds:.0} to 1)")
        }
        Event::StopRequested => "stopping: the rig goes to its safe state first".into(),
        Event::Paused { point } => format!("paused before point {point}: no drive, lifted off, armed"),
        Event::Resumed => "it goes on".into(),
        Event::PassRepeated { point } => format!("point {point}: no contact, once more"),
        Event::TemperatureBeyondCertificate { point, flag } => {
            format!("point {point} and on: {flag}; the passes are flagged, nothing is corrected")
        }
        Event::TemperatureUnwatched { certificate } => format!(
            "{certificate} holds within a range of temperatures, and the amplifier reports none: only the setup's \
             temperature_c was checked"
        ),
    }
}

/// The events of a run as a table: loop time in s, and what happened.
pub(super) fn section(events: &[(f64, serde_json::Value)]) -> String {
    if events.is_empty() {
        return "<h2>Events</h2><p>None was recorded.</p>".into();
    }
    let row = |(at, event): &(f64, serde_json::Value)| {
        let words = match serde_json::from_value::<Event>(event.clone()) {
            Ok(event) => describe(&event),
            // Of a later version, or damaged.
            Err(_) => flat(event),
        };
        let words = escape(&words).replace('\n', "<br>");
        format!("<tr><td class=\"n\">{at:.3}</td><td>{words}</td></tr>\n")
    };
    let rows: String = events.iter().map(row).collect();
    format!(
        "<h2>Events</h2>{}",
        table("Events", "<th scope=\"col\" class=\"n\">time, s</th><th scope=\"col\">event</th>", &rows)
    )
}

/// A document as `key value` pairs, its numbers with three digits.
fn flat(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Object(map) => {
            let pairs: Vec<String> =
                map.iter().map(|(k, v)| format!("{} {}", k.replace('_', " "), flat(v))).collect();
            pairs.join(", ")
        }
        serde_json::Value::Array(all) => all.iter().map(flat).collect::<Vec<_>>().join(", "),
        serde_json::Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), number),
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
