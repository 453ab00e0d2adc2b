//! Who touches the plate, what a person's finger needs, and what a setup says twice.
//!
//! Each fact is stated in one place: who touches the plate by the fingertip's kind, what an instrument has by
//! its profile. A key that says something else is refused: the harmless one of two statements never wins.

use super::SetupFile;
use crate::fingertip::{Fingertip, FingertipKind};
use crate::input::Problems;
use drivers::InstrumentSetup;
use instruments::Profile;
use std::net::SocketAddr;

/// Whether a person's finger is on the plate, so that its guards apply. A virtual rig vibrates nobody: there
/// `human_contact` asks for a rehearsal of the guards.
pub(super) fn person(file: &SetupFile, tip: Option<&Fingertip>) -> bool {
    let human = tip.is_some_and(|tip| tip.kind == FingertipKind::Human);
    let rehearsed = file.limits.human_contact == Some(true);
    human && !file.finger.nobody_touches_the_plate && (rehearsed || file.virtual_rig.is_none())
}

/// Whether the profile of an instrument has a signal.
fn has(instrument: &InstrumentSetup, signal: &str) -> bool {
    instrument.description().is_ok_and(|profile| profile.signal(signal).is_some())
}

/// Whether a setup has a safety contact with a device on it.
pub(super) fn is_wired(file: &SetupFile, contact: &str) -> bool {
    file.safety_inputs.as_ref().is_some_and(|board| board.is_wired(contact) && has(board, contact))
}

/// Contacts that the board has and the setup declares to have no device.
pub(super) fn not_wired(file: &SetupFile) -> Vec<String> {
    let Some(board) = &file.safety_inputs else { return Vec::new() };
    let named = ["emergency_stop", "interlock", "dead_man"].into_iter();
    named.filter(|name| has(board, name) && !board.is_wired(name)).map(String::from).collect()
}

/// The longest wait of a watchdog, in ms: so long a dead program would vibrate a finger.
const WATCHDOG_MAX_MS: u32 = 1000;

/// How long an instrument waits for a heartbeat, in ms, where that is stated and short.
fn waits(instrument: &InstrumentSetup) -> Option<u32> {
    let profile = instrument.description().ok()?;
    profile.heartbeat()?.timeout_ms.filter(|ms| *ms <= WATCHDOG_MAX_MS)
}

/// Whether the amplifier, and whether its supply's switch, falls by itself when this program dies.
pub(super) fn watchdogs(file: &SetupFile) -> (bool, bool) {
    (waits(&file.amplifier).is_some(), file.supply_relay.as_ref().and_then(waits).is_some())
}

/// What happens to output and stage when this program dies, in words; nothing of a virtual rig, which ends with it.
pub(super) fn if_this_program_dies(file: &SetupFile) -> String {
    if file.virtual_rig.is_some() {
        return String::new();
    }
    let output = match (waits(&file.amplifier), file.supply_relay.as_ref().and_then(waits)) {
        (Some(ms), _) => format!("the amplifier switches off by itself within {ms} ms"),
        (None, Some(ms)) => format!("the supply relay opens by itself within {ms} ms"),
        (None, None) => "the output stays on".into(),
    };
    match waits(&file.stage) {
        Some(ms) => format!("{output}; the stage stops by itself within {ms} ms"),
        None => format!("{output}; the stage continues at its last command"),
    }
}

/// Puts in what a person's finger lacks.
pub(super) fn guarded(file: &SetupFile, tip: Option<&Fingertip>, wrong: &mut Problems<'_>) {
    if !person(file, tip) {
        return;
    }
    let (amplifier, supply) = watchdogs(file);
    let hand = is_wired(file, "dead_man") || file.limits.dead_man_key == Some(true);
    let needs = [
        (file.supply_relay.is_some(), "a second switch-off channel ([supply_relay])"),
        (is_wired(file, "emergency_stop"), "an emergency stop ([safety_inputs])"),
        (hand, "a dead-man device ([safety_inputs])"),
        (has(&file.amplifier, "temperature"), "an amplifier whose temperature is read (temperature_fitted)"),
        (
            amplifier || supply || file.virtual_rig.is_some(),
            "a watchdog at the amplifier or at its supply relay (a profile with a `heartbeat` whose `timeout_ms` is at most 1000, such \
             as wago-750-watchdog): without one the output stays on if this program dies",
        ),
    ];
    let missing: Vec<&str> = needs.iter().filter(|(there, _)| !there).map(|(_, what)| *what).collect();
    if !missing.is_empty() {
        let tip = tip.map_or("", |tip| tip.name.as_str());
        wrong.add(
            &["finger", "tip"],
            format!(
                "the fingertip '{tip}' is a person's (kind = \"human\"): it needs {}",
                missing.join(", and ")
            ),
            "fit what is missing; where nobody touches the plate and only the numbers are wanted, write \
             nobody_touches_the_plate = true in [finger]"
                .to_string(),
        );
    }
}

/// Puts in every key that contradicts what the fingertip, a profile or an address says.
pub(super) fn contradictions(file: &SetupFile, tip: Option<&Fingertip>, wrong: &mut Problems<'_>) {
    if let Some(tip) = tip {
        who_touches(file, tip, wrong);
    }
    let limits = &file.limits;
    if limits.temperature_fitted == Some(false) && has(&file.amplifier, "temperature") {
        wrong.add(
            &["limits", "temperature_fitted"],
            format!(
                "temperature_fitted = false, and the amplifier's profile `{}` reads a temperature",
                file.amplifier.profile
            ),
            "leave temperature_fitted out; where the profile is wrong, copy it and take the temperature out"
                .to_string(),
        );
    }
    let loads = |profile: &Profile| profile.set("load").is_some();
    if file.stage.dead_weight_n.is_some() && file.stage.description().is_ok_and(|profile| loads(&profile)) {
        wrong.add(
            &["stage", "dead_weight_n"],
            format!("dead_weight_n, and the stage's profile `{}` loads the finger itself", file.stage.profile),
            "leave dead_weight_n out; where weights do load the finger, copy the profile and take `load` out of it".to_string(),
        );
    }
    let wired = is_wired(file, "dead_man");
    if limits.dead_man_key == Some(true) && (wired || !person(file, tip)) {
        let nobody = "by this setup no person touches the plate: it would do nothing";
        let why = if wired { "a dead-man device is wired ([safety_inputs])" } else { nobody };
        wrong.add(
            &["limits", "dead_man_key"],
            format!("dead_man_key = true, and {why}"),
            "leave dead_man_key out; where no device is on that contact, name the others in `wired`"
                .to_string(),
        );
    }
    if file.virtual_rig.is_some() {
        real_addresses(file, wrong);
    }
}

/// The keys that speak of a person, against the fingertip.
fn who_touches(file: &SetupFile, tip: &Fingertip, wrong: &mut Problems<'_>) {
    let (nobody, contact) = (file.finger.nobody_touches_the_plate, file.limits.human_contact);
    let human = tip.kind == FingertipKind::Human;
    let say_nobody = "leave human_contact out; where nobody touches the plate, write nobody_touches_the_plate = true in [finger]";
    let (path, problem, remedy): (&[&str], _, _) = match (human, nobody, contact) {
        (false, true, _) => (
            &["finger", "nobody_touches_the_plate"],
            format!("nobody_touches_the_plate, and the fingertip '{}' is not a person's", tip.name),
            "leave it out",
        ),
        (false, _, Some(true)) => (
            &["limits", "human_contact"],
            format!("human_contact = true, and the fingertip '{}' is not a person's", tip.name),
            "the fingertip decides who touches the plate: name one of kind = \"human\" as finger.tip",
        ),
        (true, true, Some(true)) => (
            &["limits", "human_contact"],
            "human_contact = true, and nobody_touches_the_plate = true in [finger]".to_string(),
            "leave one of them out",
        ),
        (true, false, Some(false)) if file.virtual_rig.is_none() => (
            &["limits", "human_contact"],
            format!("human_contact = false, and the fingertip '{}' is a person's", tip.name),
            say_nobody,
        ),
        _ => return,
    };
    wrong.add(path, problem, remedy.to_string());
}

/// A virtual rig serves its instruments itself: an address that something else may have is none of its.
fn real_addresses(file: &SetupFile, wrong: &mut Problems<'_>) {
    use instruments::LinkKind;
    for (table, instrument) in file.by_table() {
        let address = instrument.address.as_str();
        let Ok(profile) = instrument.description() else { continue };
        let served = match profile.description.link.kind {
            LinkKind::Can | LinkKind::Canopen => address.starts_with("slcan:") || address.starts_with("vcan"),
            LinkKind::Sysfs | LinkKind::Serial | LinkKind::ModbusRtu => true,
            LinkKind::ModbusTcp if address.starts_with("rtu:") => true,
            LinkKind::ModbusTcp | LinkKind::Scpi | LinkKind::Tcp | LinkKind::Udp => {
                address.parse::<SocketAddr>().is_ok_and(|socket| socket.ip().is_loopback())
            }
        };
        if !served {
            wrong.add(
                &super::profiles::place(table, "address"),
                format!(
                    "[virtual], and `{}` at {address}, which the virtual rig does not serve",
                    instrument.profile
                ),
                "take [virtual] out for a real rig; a virtual one has 127.0.0.1:0, pty or vcan0".to_string(),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::setup::Setup;
    use drivers::user_profiles::Source;
    use std::sync::Arc;

    /// A heartbeat whose time is long or not stated leaves the output on when this program dies.
    #[test]
    fn a_watchdog_has_a_short_and_stated_time() {
        let text = drivers::bundled::text("muprime-amplifier").unwrap();
        let mut file = Setup::load("virtual-ideal").unwrap().file;
        file.virtual_rig = None;
        let mut with = |time: &str| {
            let text = text.replacen("\ntimeout_ms = 50", &format!("\n{time}"), 1);
            let (id, origin) = ("muprime-amplifier".into(), "own".into());
            file.amplifier.source = Some(Arc::new(Source { id, origin, text, files: Vec::new() }));
            (watchdogs(&file).0, if_this_program_dies(&file))
        };
        let (fed, words) = with("timeout_ms = 1000");
        assert!(fed && words.contains("within 1000 ms"), "{words}");
        for time in ["timeout_ms = 999999999", "timeout_ms = 1001", ""] {
            let (fed, words) = with(time);
            assert!(!fed && words.contains("the output stays on"), "{time}: {words}");
        }
    }
}
