//! One controller a rig.

use crate::setup::Setup;

/// Whether an embedded rig is at a place that only this process knows: a free port, a terminal of its own.
fn belongs_to_this_process(address: &str) -> bool {
    address.ends_with(":0") || address.ends_with("pty")
}

/// One controller a rig: a lock named after the amplifier's address, taken before anything is opened.
pub struct RigClaim {
    _lock: Option<std::fs::File>,
}

impl RigClaim {
    /// Takes the rig of a setup.
    ///
    /// # Errors
    /// Another process has it.
    pub fn take(setup: &Setup) -> miette::Result<Self> {
        // An embedded rig on a free port belongs to this process by construction.
        if setup.file.virtual_rig.is_some() && belongs_to_this_process(&setup.file.amplifier.address) {
            return Ok(RigClaim { _lock: None });
        }
        let name: String = setup
            .file
            .amplifier
            .address
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
            .collect();
        let lock = std::env::temp_dir().join(format!("muprime-rig-{name}.lock"));
        Ok(RigClaim { _lock: Some(crate::run_dir::claim(&lock)?) })
    }
}
