//! Setups, plans, models, fingertips and certificates: read, or refused with a message.

use super::Chance;
use calibration::certificate::{Certificate, Circumstances};
use std::path::Path;

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] =
    &[("configuration", configuration), ("certificates", certificates)];

/// Every reader of a configuration file; a setup names its fingertip, or holds one.
pub fn configuration(input: &[u8], _: &mut Chance) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let refusals = [
        runs::setup::Setup::parse("fuzz", text, Path::new(".")).err(),
        runs::plan::Plan::parse("fuzz", text).err(),
        runs::model_file::load("fuzz", text).err(),
    ];
    for refusal in refusals.into_iter().flatten() {
        assert!(!format!("{refusal:?}").is_empty());
    }
    let _ = Certificate::from_toml(text);
}

/// Certificates that are valid on 2026-02-01.
pub const SOUND: [&str; 2] =
    [include_str!("certificates/finger.toml"), include_str!("certificates/latency.toml")];

/// Whether a certificate is taken for one of the sound ones; then it has to say what that one said.
pub fn taken(text: &str) -> bool {
    let Ok(certificate) = Certificate::from_toml(text) else { return false };
    SOUND.iter().any(|sound| {
        let one = Certificate::from_toml(sound).unwrap();
        let (kind, serial) = (one.kind, one.instrument.serial.as_str());
        let at = Circumstances { kind, serial, now_unix_s: 1_769_904_000, temperature_c: None };
        let valid = certificate.verify(&at).is_ok();
        if valid {
            assert_eq!(certificate.to_toml(), one.to_toml());
        }
        valid
    })
}

/// A damaged certificate is refused, or says what the sound one said.
pub fn certificates(input: &[u8], _: &mut Chance) {
    if let Ok(text) = std::str::from_utf8(input) {
        taken(text);
    }
}
