//! The server: what its parts share, and its beginning.

use super::guard::Guard;
use super::{Options, api, serve};
use crate::live::Ask;
use miette::{IntoDiagnostic, WrapErr};
use std::collections::BTreeMap;
use std::net::{SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::atomic::AtomicUsize;
use std::sync::{Arc, Mutex};
use tokio::sync::Semaphore;

/// What all requests share.
pub(super) struct Shared {
    pub options: Options,
    pub guard: Guard,
    /// Live streams at present.
    pub streams: AtomicUsize,
    /// Turns to read a window of a record.
    pub windows: Semaphore,
    /// The diagnosis that is under way, and why others have no verdict.
    pub diagnoses: Mutex<Diagnoses>,
}

/// Diagnoses at the request of browsers.
#[derive(Default)]
pub(super) struct Diagnoses {
    /// The run of the one that is under way: there is one at a time.
    pub under_way: Option<String>,
    /// Why a run has no verdict, by its name.
    pub failed: BTreeMap<String, String>,
}

impl Shared {
    /// Whether this server passes that on.
    pub fn passes_on(&self, ask: Ask) -> bool {
        ask == Ask::Stop || self.options.control
    }

    /// Folder of a run by its name; `None` for anything that is not the name of a folder there.
    pub fn folder(&self, name: &str) -> Option<PathBuf> {
        let plain = !name.is_empty() && name != "." && name != ".." && !name.contains(['/', '\\', '\0']);
        let folder = self.options.runs.join(name);
        (plain && folder.join("points.csv").is_file()).then_some(folder)
    }
}

/// A dashboard that is served until the process ends.
pub struct Dashboard {
    /// Where it listens.
    pub address: SocketAddr,
    token: String,
}

impl Dashboard {
    /// Begins to serve, on a thread of its own.
    ///
    /// # Errors
    /// The address cannot be had, or the system gives no thread.
    pub fn start(options: Options) -> miette::Result<Self> {
        let listener = TcpListener::bind(options.listen).into_diagnostic().wrap_err_with(|| {
            format!("{}: another dashboard may be there; give another --listen", options.listen)
        })?;
        listener.set_nonblocking(true).into_diagnostic()?;
        let address = listener.local_addr().into_diagnostic()?;
        let guard = Guard::new(address, &options.hosts);
        let token = guard.token().to_string();
        let (streams, windows) = (AtomicUsize::new(0), Semaphore::new(1));
        let shared = Arc::new(Shared { options, guard, streams, windows, diagnoses: Mutex::default() });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().into_diagnostic()?;
        std::thread::Builder::new()
            .name("dashboard".into())
            .spawn(move || runtime.block_on(serve::serve(listener, api::routes(shared))))
            .into_diagnostic()?;
        Ok(Dashboard { address, token })
    }

    /// The address to open in a browser, with the token.
    pub fn link(&self) -> String {
        format!("http://{}/#token={}", self.address, self.token)
    }
}
