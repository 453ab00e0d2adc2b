//! In the place of a publisher, where none was built in.

use super::Broker;
use serde_json::Value;

/// Nobody.
pub enum Publisher {}

impl Publisher {
    /// Refuses: built without MQTT.
    ///
    /// # Errors
    /// Always.
    pub fn start(_: &Broker) -> miette::Result<Self> {
        miette::bail!(
            help = "build it with `cargo install --path rig` (the feature is on by default), or leave out --publish",
            "this muprime was built without its feature `mqtt`"
        )
    }

    /// Nothing.
    pub fn publish(&mut self, _: &str, _: &Value) {
        match *self {}
    }

    /// Nothing.
    pub fn end(self) -> Option<String> {
        match self {}
    }
}
