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
    ///
    /// # Errors
    /// Always.
    pub fn start(_: Options) -> miette::Result<Self> {
        miette::bail!(
            help = "build it with `cargo install --path rig` (the feature is on by default), or use `muprime watch`",
            "this muprime was built without its feature `dashboard`"
        )
    }

    /// Nowhere.
    pub fn link(&self) -> String {
        String::new()
    }
}
