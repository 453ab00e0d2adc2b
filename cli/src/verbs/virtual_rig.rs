//! `muprime virtual-rig`: the simulated rig behind real protocols.

use super::prelude::*;
use drivers::InstrumentsSetup;
use instruments::LinkKind;
use sim::wire::serial::SerialEmulator;
use sim::wire::world::{Hands, WorldPlant};
use sim::wire::{Quantity, SharedPlant};
use sim::world::World;
use std::io::BufRead;
use std::net::SocketAddr;
use std::time::Instant;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Setup whose instruments are served
    #[arg(long, default_value = "virtual")]
    setup: String,
    /// Address of the Modbus TCP server
    #[arg(long, value_name = "ADDR", default_value = "127.0.0.1:1502")]
    modbus_tcp: SocketAddr,
    /// Serial line on which the Modbus instruments are served by RTU as well
    #[arg(long, value_name = "PATH")]
    modbus_rtu: Option<String>,
    /// Bus of the setup's CAN instruments: an interface, or slcan:PATH
    #[arg(long, value_name = "IFACE")]
    can: Option<String>,
    /// Serial line of the setup's instrument of text
    #[arg(long, value_name = "PATH")]
    serial: Option<String>,
    /// Take an operator's hands from the standard input, to calibrate the virtual rig: `hang LATERAL_N
    /// NORMAL_N` puts dead weights on the force sensor, `look` reads the plate's motion off a vibrometer, and
    /// the instruments' own lamps; one JSON line each
    #[arg(long)]
    hands: bool,
    /// Defects in place of the bundled ones
    #[arg(long)]
    defects: Option<PathBuf>,
    /// Seed of the world
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// Serves until interrupted; refused: a setup, defects file or address that cannot be used.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let setup = super::setup(&args.setup)?;
    let mut config = setup.file.virtual_rig.clone().unwrap_or_default().world();
    if let Some(path) = &args.defects {
        config.defects = super::defects(path)?;
    }
    let world = World::new(&config, args.seed).map_err(|e| miette::miette!("{e}"))?;
    let (world, hands) = WorldPlant::at_hand(world);
    let plant = SharedPlant::new(world, Instant::now());
    let mut instruments = setup.instruments();
    let line = args.modbus_rtu.as_deref().map(|path| rtu(path, &instruments, &plant)).transpose()?;
    for instrument in instruments.all_mut() {
        let kind = instrument.description().into_diagnostic()?.description.link.kind;
        let place = match kind {
            LinkKind::ModbusTcp if !instrument.address.starts_with("rtu:") => {
                Some(args.modbus_tcp.to_string())
            }
            LinkKind::Can | LinkKind::Canopen => args.can.clone(),
            LinkKind::Serial => args.serial.clone(),
            _ => None,
        };
        instrument.address = place.unwrap_or_else(|| instrument.address.clone());
    }
    if !args.modbus_tcp.ip().is_loopback() {
        say!(
            "warning: {} is reachable from other machines, and Modbus knows no password: anyone there can drive \
             this rig. Use it on a trusted network only.",
            args.modbus_tcp
        );
    }
    let mut emulators = rig::emulators::serve(&mut instruments, &plant, true)?;
    let mut vibrometer = setup.file.vibrometer.clone();
    let served = vibrometer.as_mut().map(|v| rig::emulators::vibrometer(v, &plant)).transpose()?;
    emulators.places.extend(vibrometer.map(|v| format!("{} at {}", v.profile, v.address)));
    let modbus_tcp = emulators.modbus_tcp.map(|address| address.to_string());
    if json {
        answer_json(&json!({ "modbus_tcp": modbus_tcp, "instruments": emulators.places }));
    } else {
        emulators.places.iter().for_each(|place| say!("{place}"));
        let listens =
            modbus_tcp.map(|address| format!("listens on {address} (Modbus TCP)")).unwrap_or("runs".into());
        say!("the virtual rig {listens}; Ctrl-C ends it");
    }
    if args.hands {
        let plant = plant.clone();
        std::thread::Builder::new()
            .name("hands".into())
            .spawn(move || at_the_bench(&hands, &plant))
            .into_diagnostic()?;
    }
    let mut signals = signal_hook::iterator::Signals::new(rig::terminal::STOPS).into_diagnostic()?;
    let _ = signals.forever().next();
    drop((line, emulators, served));
    exit(DONE)
}

/// Does what the lines of the standard input say, until they end; the rig goes on.
fn at_the_bench(hands: &Hands, plant: &SharedPlant) {
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let words: Vec<&str> = line.split_whitespace().collect();
        let number = |word: &str| word.parse().ok().filter(|x: &f64| x.is_finite() && x.abs() <= 1e3);
        let answer = match words.as_slice() {
            [] => continue,
            ["hang", lateral, normal] => match (number(lateral), number(normal)) {
                (Some(lateral), Some(normal)) => {
                    // First up to now with the old weights: the new ones begin now.
                    let (guard, now) = plant.now();
                    hands.hang(lateral, normal);
                    drop(guard);
                    json!({ "time_s": now.seconds(), "hung_n": [lateral, normal] })
                }
                _ => json!({ "error": "hang LATERAL_N NORMAL_N: two forces of at most 1000 N" }),
            },
            ["look"] => {
                let (mut guard, _) = plant.now();
                let (on, velocity_m_s) =
                    (guard.measure(Quantity::OutputOn) != 0.0, guard.measure(Quantity::Velocity));
                drop(guard);
                let seen = hands.look();
                json!({
                    "time_s": seen.time_s, "frequency_hz": seen.frequency_hz,
                    "amplitude_pp_m": seen.amplitude_pp_m, "output_on": on, "velocity_m_s": velocity_m_s,
                })
            }
            _ => json!({ "error": format!("`{line}`: hang LATERAL_N NORMAL_N, or look") }),
        };
        out!("{answer}");
    }
}

/// Serves the Modbus instruments on one serial line as well.
fn rtu(path: &str, instruments: &InstrumentsSetup, plant: &SharedPlant) -> miette::Result<SerialEmulator> {
    let devices = rig::emulators::emulators(instruments)?;
    let port = serialport::new(path, 115_200).open().into_diagnostic().wrap_err_with(|| path.to_string())?;
    SerialEmulator::modbus_rtu(port, devices, plant.clone()).into_diagnostic()
}
