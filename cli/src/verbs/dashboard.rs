//! `muprime dashboard`: the rig, the catalogue and the reports in a browser.

use super::prelude::*;
use rig::dashboard::{Dashboard, LISTEN, Options};
use runs::catalogue::runs_folder;
use std::net::SocketAddr;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the runs [default: $MUPRIME_RUNS or ./runs]
    #[arg(long)]
    folder: Option<PathBuf>,
    #[command(flatten)]
    place: ListenOptions,
}

/// Where and for whom to serve.
#[derive(Clone, Debug, clap::Args)]
pub struct ListenOptions {
    /// Address to listen on; port 0 takes a free one
    #[arg(long, default_value = LISTEN, value_name = "ADDRESS")]
    pub listen: SocketAddr,
    /// A further name that browsers ask for it by, with its port, as rig-1.lab:8417 (may be repeated)
    #[arg(long = "host", value_name = "NAME:PORT")]
    pub hosts: Vec<String>,
    /// A further page that may read live streams, and nothing else, as `https://app.foxglove.dev` (may be
    /// repeated)
    #[arg(long = "origin", value_name = "ORIGIN")]
    pub origins: Vec<String>,
    /// Write the token to this file, readable by you alone: for a scraper of /metrics
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
    /// Runs may be paused and resumed from a browser; a stop is always allowed
    #[arg(long)]
    pub allow_control: bool,
}

impl ListenOptions {
    /// A dashboard of a folder of runs there; refused where the address cannot be had.
    pub fn serve(self, runs: PathBuf) -> miette::Result<Dashboard> {
        let ListenOptions { listen, hosts, origins, token_file, allow_control } = self;
        Dashboard::start(Options { runs, listen, hosts, origins, token_file, control: allow_control })
    }
}

/// Serves until it is interrupted; refused where there is no such folder or the address cannot be had.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let folder = args.folder.unwrap_or_else(runs_folder);
    if !folder.is_dir() {
        miette::bail!(help = "give --folder, or make a run first", "{} is not a folder", folder.display());
    }
    let dashboard = args.place.serve(folder)?;
    if json {
        answer_json(&json!({ "dashboard": dashboard.link(), "address": dashboard.address }));
    } else {
        out!("{}", dashboard.link());
        say!(
            "open it in a browser on this machine; the token in it is a key: keep it. Ctrl-C ends the dashboard, and no run"
        );
    }
    loop {
        std::thread::park();
    }
}
