//! What happened during a run, in words: for the terminal and for the page.

use super::html::{columns, escape, table};
use crate::ambient::AIR;
use crate::format::number;
use crate::run_data::remarks::ZERO_SHARE;
use crate::sweep::Event;
use realtime::TripCause;

/// An event in words.
pub fn describe(event: &Event) -> String {
    match event {
        Event::Armed => "safety checks passed; drive enabled".into(),
        Event::NoSecondChannel => {
            "warning: there is only one way to switch off. If the amplifier ignores 'off', cut its mains by \
             hand; fit a supply relay ([supply_relay])"
                .into()
        }
        Event::NoWatchdog => {
            "warning: if this program dies the output stays on: neither the amplifier nor its \
             supply has a watchdog. Keep a hand at the mains switch, or fit a relay with a heartbeat \
             (wago-750-watchdog)"
                .into()
        }
        Event::ExposureLeft(left) => format!(
            "exposure left for the finger: {:.0} s of this hour, a dose of {:.1} m2/s, {:.0} s without a rest",
            left.hour_s, left.dose_m2_s, left.in_one_go_s
        ),
        Event::NobodyTouches => format!("warning: {}", crate::setup::NOBODY),
        Event::NotWired { contacts } => format!(
            "warning: not monitored, because the setup says that no device is connected: {}",
            contacts.join(", ")
        ),
        Event::ArmingDisturbed { cause, held_up } => {
            let what = match cause {
                TripCause::EmergencyStop => "the emergency stop did not report, so the supply was cut".into(),
                cause => format!("the test of the supply relay was interrupted ({})", cause.words()),
            };
            let why = match held_up.seconds() * 1e3 {
                ms if ms < 1.0 => String::new(),
                ms => format!("; the loop was held up for {ms:.0} ms"),
            };
            format!("before arming {what}{why}: nothing was driven; the supply relay is tested again")
        }
        Event::Zeros { lateral_n, normal_n, after, smallest_load_n } => {
            let mn = |v: &Option<f64>| v.map_or("none".into(), |v| format!("{:+.2} mN", v * 1e3));
            let when = if *after { "after" } else { "before" };
            let share = normal_n.zip(*smallest_load_n).map(|(zero, load)| zero.abs() / load);
            let off = match share.filter(|share| *share > ZERO_SHARE) {
                Some(share) => {
                    format!("; warning: {:.0} % of the smallest load: zero the sensor", 100.0 * share)
                }
                None => String::new(),
            };
            let (lateral, normal) = (mn(lateral_n), mn(normal_n));
            format!("force offset {when} the sweep, unloaded: lateral {lateral}, normal {normal}{off}")
        }
        Event::Tripped(trip) if trip.cause == TripCause::Stopped => {
            "stopped on request: drive off, stage at rest, finger lifted".into()
        }
        Event::Tripped(trip) => format!("STOPPED for safety: {trip}\n  {}", trip.cause.remedy()),
        Event::ModelDeparted { point, log_evidence } => {
            let odds = 10_f64.powf((log_evidence / std::f64::consts::LN_10).floor().min(9.0));
            format!("the measurement disagrees with the model since pass {point} (odds above {odds:.0} to 1)")
        }
        Event::StopRequested => "stopping: the rig is made safe first".into(),
        Event::Paused { point } => format!("paused before pass {point}: drive off, lifted off, not armed"),
        Event::PauseTooLong { bound } => {
            format!("the pause was longer than {bound:.0} s (pause_max_s): the run ends")
        }
        Event::PauseNotQuiet { cause } => format!(
            "the rig was not off and at rest although it was disarmed ({}): the run ends\n  {}",
            cause.words(),
            cause.remedy()
        ),
        Event::Resumed => "warning: resuming: the rig is armed again, then stage and plate move. Keep hands \
             off; with a finger, release the dead-man device and grip it again"
            .into(),
        Event::PassRepeated { point, cause } => {
            let why = cause.map_or("no contact", TripCause::words);
            format!("pass {point} does not count: {why}; it is made again")
        }
        Event::Remarked { point, remark } => format!("pass {point}: {}", remark.words()),
        Event::TemperatureBeyondCertificate { point, flag } => {
            format!("from pass {point}: {flag}; the passes are flagged and not corrected")
        }
        Event::TemperatureUnwatched { certificate } => format!(
            "{certificate} holds within a range of temperatures, and the amplifier reports none: only the setup's \
             temperature_c was checked"
        ),
        Event::Disarmed { supply_open: true } => {
            "disarmed: the drive is off and its supply open, both read back; the stage is at rest".into()
        }
        Event::Disarmed { supply_open: false } => {
            "disarmed: the drive was read back off; the stage is at rest".into()
        }
        Event::OperatorStep { step, types: None } => format!("AT THE RIG: {step}; then press Enter"),
        Event::OperatorStep { step, types: Some(name) } => {
            let what = match crate::input::unit_of(name) {
                "" => name.clone(),
                unit => format!("the value in {unit}"),
            };
            format!("AT THE RIG: {step}; then type {what} and press Enter")
        }
        Event::Answered { step, answer, answered_by, refused, .. } => {
            let refused = refused.iter().map(|why| format!(", NOT TAKEN: {why}")).collect::<String>();
            format!("{step}: {answer} ({answered_by}){refused}")
        }
        Event::Waited { step, waited_s } => format!("{step}: waited {waited_s:.0} s"),
        Event::LevelSet { quantity, wanted } => format!("set: {}", air(quantity, *wanted)),
        Event::LevelReached { quantity, wanted, found, source, after_s } => {
            let [wanted, found] = [wanted, found].map(|value| air(quantity, *value));
            format!("{wanted} reached after {after_s:.1} s: {found} ({source})")
        }
        Event::LevelNotReached { quantity, wanted, last } => format!(
            "{} was not reached: {}",
            air(quantity, *wanted),
            last.map_or_else(|| "nothing was read".into(), |last| format!("last {}", air(quantity, last)))
        ),
        Event::LevelLost { point, quantity, wanted, range: [low, high] } => {
            let [wanted, low, high] = [wanted, low, high].map(|value| air(quantity, *value));
            format!("point {point}: {wanted} was lost, {low} to {high}; the pass is marked")
        }
    }
}

/// A level of the air in words and in the unit in which people read it.
fn air(quantity: &str, value: f64) -> String {
    let known = AIR.iter().find(|(covariate, _)| covariate.name == quantity);
    known.map_or_else(
        || format!("{quantity} {}", number(value)),
        |(c, _)| format!("{} {} {}", c.words, number(value * c.shown.0), c.shown.1),
    )
}

/// The events of a run as a table: loop time in s, and what happened.
pub(super) fn section(events: &[(f64, serde_json::Value)]) -> String {
    if events.is_empty() {
        return "<h2>Events</h2><p>No event was recorded.</p>".into();
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
    format!("<h2>Events</h2>{}", table("Events", &columns("#time, s|event"), events.iter().map(row)))
}

/// A document as `key value` pairs, its numbers with three digits.
fn flat(value: &serde_json::Value) -> String {
    match value {
        serde_json::Value::Object(map) => {
            let pairs = map.iter().map(|(k, v)| format!("{} {}", k.replace('_', " "), flat(v)));
            pairs.collect::<Vec<_>>().join(", ")
        }
        serde_json::Value::Array(all) => all.iter().map(flat).collect::<Vec<_>>().join(", "),
        serde_json::Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), number),
        serde_json::Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
