//! The rig in a browser: live pages, the catalogue, reports and comparisons, served on this machine.
//!
//! The server is one more viewer of [`crate::live`]: it runs on threads of its own and reads what every other viewer reads, so
//! nothing that a browser does reaches the loop. All it serves is embedded; its pages ask nothing of anybody else.
//!
//! Who may do what:
//!
//! | what | needs |
//! |---|---|
//! | the empty page and its script | a `Host` that is on the list |
//! | data, live messages | that, an `Origin` on the list where there is one, and the token |
//! | `/foxglove`, `/metrics` | the same; the token may be in the address, and `/foxglove` takes `--origin` |
//! | stop a run | the same |
//! | write tags and notes, diagnose a run that is over | the same |
//! | pause, go on | the same, and a server that was started with `--allow-control` |
//!
//! | module | holds |
//! |---|---|
//! | `server`, `serve`, `guard` | threads and connections; answers to requests; who may do what |
//! | `api`, `pages` | the JSON of the pages in `assets/app.js`; what is read from the disk for it |
//! | `stream`, `foxglove`, `metrics`, `download` | live messages; the same for Foxglove; Prometheus; files of a run |
//!
//! The token is new at every start, is part of the address's fragment (which no browser sends), and is
//! compared in constant time. No request can arm a rig, begin a run or change a limit.

#[cfg(feature = "dashboard")]
mod api;
#[cfg(feature = "dashboard")]
mod download;
#[cfg(feature = "dashboard")]
mod foxglove;
#[cfg(feature = "dashboard")]
mod guard;
#[cfg(feature = "dashboard")]
mod metrics;
#[cfg(feature = "dashboard")]
mod pages;
#[cfg(feature = "dashboard")]
mod serve;
#[cfg(feature = "dashboard")]
mod server;
#[cfg(feature = "dashboard")]
mod stream;
#[cfg(not(feature = "dashboard"))]
mod without;

#[cfg(feature = "dashboard")]
pub use server::Dashboard;
#[cfg(not(feature = "dashboard"))]
pub use without::Dashboard;

use std::net::SocketAddr;
use std::path::PathBuf;

/// The default address of a dashboard.
pub const LISTEN: &str = "127.0.0.1:8417";

/// What a dashboard is to serve.
#[derive(Clone, Debug)]
pub struct Options {
    /// Folder of the runs.
    pub runs: PathBuf,
    /// Where to listen; port 0 takes a free one.
    pub listen: SocketAddr,
    /// Further names by which browsers may ask for it, as `rig-1.lab:8417`.
    pub hosts: Vec<String>,
    /// Further origins whose pages may read live streams, and nothing else, as `https://app.foxglove.dev`.
    pub origins: Vec<String>,
    /// A file of its user alone that takes the token, for a scraper.
    pub token_file: Option<PathBuf>,
    /// Whether runs may be paused and resumed. A stop is always allowed.
    pub control: bool,
}
