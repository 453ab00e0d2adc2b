//! In the place of a publisher, where none was built in.

use super::Broker;
use serde_json::Value;

/// Nobody.
pub enum Publisher {}

impl Publisher {
    /// Refuses: built without MQTT.
    pub fn start(_: &Broker) -> miette::Result<Self> {
        Err(tables::built_without("mqtt", "leave out --publish"))
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
