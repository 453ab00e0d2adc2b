//! What happened during a run, in words: for the terminal and for the page.

use super::html::{escape, table};
use super::human::number;
use crate::ambient::AIR;
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
        Event::NoWatchdog => "warning: if this program dies the output stays on: neither the amplifier nor its supply has a watchdog. \
             Keep a hand at the mains switch, or fit a relay with a heartbeat (wago-750-watchdog)"
            .into(),
        Event::ExposureLeft(left) => format!(
            "exposure left to the finger: {:.0} s of this hour, {:.1} m2/s of its dose, {:.0} s in one go",
            left.hour_s, left.dose_m2_s, left.in_one_go_s
        ),
        Event::NobodyTouches => format!("warning: {}", crate::setup::NOBODY),
        Event::NotWired { contacts } => {
            format!("warning: not watched, as the setup says that no device is on it: {}", contacts.join(", "))
        }
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
        Event::Tripped(trip) if trip.cause == Cause::Stopped => {
            "stopped on request: drive off, stage at rest, finger lifted".into()
        }
        Event::Tripped(trip) => format!("TRIP {trip}\n  {}", trip.cause.remedy()),
        Event::ModelDeparted { point, log_evidence } => {
            let odds = (log_evidence / std::f64::consts::LN_10).floor();
            format!("the model has left the measurement at point {point} (evidence beyond 10^{odds:.0} to 1)")
        }
        Event::StopRequested => "stopping: the rig goes to its safe state first".into(),
        Event::Paused { point } => format!("paused before point {point}: drive off, lifted off, not armed"),
        Event::PauseTooLong { bound } => format!("the pause was longer than {bound:.0} s (pause_max_s): the run ends"),
        Event::PauseNotQuiet { cause } => {
            format!("in the pause the rig was not seen off, at rest and lifted off ({cause:?}): the run ends\n  {}", cause.remedy())
        }
        Event::Resumed => "warning: resuming: the rig is armed again, then stage and plate move. Keep hands off; with a finger, \
             let go of the dead-man device and grip it again"
            .into(),
        Event::PassRepeated { point } => format!("point {point}: no contact, once more"),
        Event::TemperatureBeyondCertificate { point, flag } => {
            format!("point {point} and on: {flag}; the passes are flagged, nothing is corrected")
        }
        Event::TemperatureUnwatched { certificate } => format!(
            "{certificate} holds within a range of temperatures, and the amplifier reports none: only the setup's \
             temperature_c was checked"
        ),
        _ => at_rig(event),
    }
}

/// What happened at the rig between passes.
fn at_rig(event: &Event) -> String {
    let of = |quantity: &str, value: f64| {
        let known = AIR.iter().find(|(covariate, _)| covariate.name == quantity);
        known.map_or_else(
            || format!("{quantity} {}", number(value)),
            |(c, _)| format!("{} {} {}", c.words, number(value * c.shown.0), c.shown.1),
        )
    };
    match event {
        Event::Disarmed { supply_open: true } => {
            "disarmed: the drive is off and its supply open, both read back; the stage is at rest".into()
        }
        Event::Disarmed { supply_open: false } => {
            "disarmed: the drive was read back off; the stage is at rest".into()
        }
        Event::Asked { step, types: None } => format!("AT THE RIG: {step}; then press Enter"),
        Event::Asked { step, types: Some(name) } => {
            format!("AT THE RIG: {step}; then type {name} and press Enter")
        }
        Event::Answered { step, answer, answered_by, .. } => format!("{step}: {answer} ({answered_by})"),
        Event::Waited { step, waited_s } => format!("{step}: waited {waited_s:.0} s"),
        Event::LevelSet { quantity, wanted } => format!("set: {}", of(quantity, *wanted)),
        Event::LevelReached { quantity, wanted, found, source, after_s } => format!(
            "{} reached after {after_s:.1} s: {} ({source})",
            of(quantity, *wanted),
            of(quantity, *found)
        ),
        Event::LevelNotReached { quantity, wanted, last } => format!(
            "{} was not reached: {}",
            of(quantity, *wanted),
            last.map_or_else(|| "nothing was read".into(), |last| format!("last {}", of(quantity, last)))
        ),
        Event::LevelLost { point, quantity, wanted, range: [low, high] } => format!(
            "point {point}: {} was lost, {} to {}; the pass is marked",
            of(quantity, *wanted),
            of(quantity, *low),
            of(quantity, *high)
        ),
        _ => String::new(),
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
