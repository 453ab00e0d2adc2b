//! Setups, plans, models, fingertips and certificates: read, or refused with a message.

use super::Chance;
use std::path::Path;

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] = &[("configuration", configuration)];

/// Every reader of a configuration file; a setup names its fingertip, or holds one.
pub fn configuration(input: &[u8], _: &mut Chance) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let refusals = [
        rig::setup::Setup::parse("fuzz", text, Path::new(".")).err(),
        rig::plan::Plan::parse("fuzz", text).err(),
        rig::model_file::load("fuzz", text).err(),
    ];
    for refusal in refusals.into_iter().flatten() {
        assert!(!format!("{refusal:?}").is_empty());
    }
    let _ = calibration::certificate::Certificate::from_toml(text);
}
