//! In the place of a dashboard, where none was built in.

use super::Options;
use std::net::SocketAddr;

/// None.
pub struct Dashboard {
    /// Where it listens.
    pub address: SocketAddr,
}

impl Dashboard {
    /// Refuses: built without a dashboard.
    pub fn start(_: Options) -> miette::Result<Self> {
        Err(tables::built_without("dashboard", "use `muprime watch`"))
    }

    /// Nowhere.
    pub fn link(&self) -> String {
        String::new()
    }
}
