//! The server: what its parts share, and its beginning.

use super::guard::Guard;
use super::metrics::Followed;
use super::{Options, api, serve};
use miette::{IntoDiagnostic, WrapErr};
use realtime::threads;
use runs::files::open_plain;
use std::collections::BTreeMap;
use std::fs::OpenOptions;
use std::io::Read;
use std::net::{SocketAddr, TcpListener};
use std::os::unix::fs::{FileExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, AtomicUsize};
use std::sync::{Arc, Mutex};
use tokio::sync::Semaphore;

/// What all requests share.
pub(super) struct Shared {
    pub options: Options,
    pub guard: Guard,
    /// Live streams at present.
    pub streams: AtomicUsize,
    /// States that were left out for slow clients.
    pub dropped: AtomicU64,
    /// Runs that are followed since they were scraped, by name.
    pub followed: Mutex<BTreeMap<String, Followed>>,
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
        let guard = Guard::new(address, &options.hosts, &options.origins);
        let token = guard.token().to_string();
        if let Some(file) = &options.token_file {
            write_token(file, &token).wrap_err_with(|| format!("--token-file {}", file.display()))?;
        }
        let shared = Arc::new(Shared {
            options,
            guard,
            streams: AtomicUsize::new(0),
            dropped: AtomicU64::new(0),
            followed: Mutex::default(),
            windows: Semaphore::new(1),
            diagnoses: Mutex::default(),
        });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().into_diagnostic()?;
        let serves = move || runtime.block_on(serve::serve(listener, api::routes(shared)));
        threads::spawn("dashboard", serves).into_diagnostic()?;
        Ok(Dashboard { address, token })
    }

    /// The address to open in a browser, with the token.
    pub fn link(&self) -> String {
        format!("http://{}/#token={}", self.address, self.token)
    }
}

/// Writes the token to a file that its user alone can read. Only an earlier token is replaced.
fn write_token(path: &Path, token: &str) -> miette::Result<()> {
    let mut options = OpenOptions::new();
    let mut file = open_plain(path, options.read(true).write(true).create(true).truncate(false).mode(0o600))
        .into_diagnostic()?;
    let mut before = String::new();
    file.by_ref().take(1024).read_to_string(&mut before).into_diagnostic()?;
    let a_token = before.len() == token.len() && before.bytes().all(|byte| byte.is_ascii_hexdigit());
    if !(before.is_empty() || a_token) {
        miette::bail!(help = "name another file", "the file holds something else than a token");
    }
    if file.metadata().into_diagnostic()?.permissions().mode() & 0o077 != 0 {
        miette::bail!(help = "chmod 600 it, or remove it", "other users may read the file");
    }
    file.write_all_at(token.as_bytes(), 0).into_diagnostic()
}
