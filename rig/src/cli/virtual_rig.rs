//! `muprime virtual-rig`: the simulated rig behind real protocols.

use crate::setup::Setup;
use miette::{IntoDiagnostic, WrapErr};
use sim::wire::SharedPlant;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::world::WorldPlant;
use sim::world::{World, WorldConfig};
use std::net::SocketAddr;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Setup whose instruments are served
    #[arg(long, default_value = "virtual")]
    setup: String,
    /// Address of the Modbus TCP server
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:1502")]
    modbus_tcp: SocketAddr,
    /// Defects in place of the bundled ones
    #[arg(long)]
    defects: Option<PathBuf>,
    /// Seed of the world
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Serves until interrupted.
///
/// # Errors
/// A setup, defects file or address that cannot be used.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let setup = Setup::load(&args.setup)?;
    let ideal = setup.file.virtual_rig.as_ref().is_some_and(|v| v.ideal);
    let mut config = if ideal { WorldConfig::ideal() } else { WorldConfig::bundled() };
    if let Some(path) = &args.defects {
        let text = crate::input::text_of(path)?;
        config.defects =
            sim::defects::Defects::parse(&text).map_err(|e| miette::miette!("{}: {e}", path.display()))?;
    }
    let world = World::new(&config, args.seed).map_err(|e| miette::miette!("{e}"))?;
    let plant = SharedPlant::new(WorldPlant::new(world), Instant::now());
    let devices = crate::drivers::emulators(&setup.instruments())?;
    if !args.modbus_tcp.ip().is_loopback() {
        eprintln!(
            "warning: {} is reachable from other machines, and Modbus knows no password: anyone there can drive \
             this rig. Use it on a trusted network only.",
            args.modbus_tcp
        );
    }
    let server = ModbusTcpServer::start(args.modbus_tcp, devices, plant)
        .into_diagnostic()
        .wrap_err_with(|| format!("cannot listen on {}", args.modbus_tcp))?;
    if json {
        println!("{}", serde_json::json!({ "modbus_tcp": server.address().to_string() }));
    } else {
        eprintln!("the virtual rig listens on {} (Modbus TCP); Ctrl-C ends it", server.address());
    }
    let mut signals =
        signal_hook::iterator::Signals::new([signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM])
            .into_diagnostic()?;
    let _ = signals.forever().next();
    super::exit(super::DONE)
}
