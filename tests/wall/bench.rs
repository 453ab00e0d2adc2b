//! A bench whose quantities a test sets by hand: what goes in must come out of the driver.

use drivers::link_error::LinkError;
use drivers::{InstrumentsSetup, OpenError, Rig};
use realtime::{Clock, Nanos};
use sim::wire::device::Device;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::{Command, Plant, Quantity, SharedPlant};
use std::collections::{BTreeMap, HashMap};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// What stands on the bench now, and what was commanded, in order.
#[derive(Default)]
pub struct State {
    /// Quantities; zero where never set.
    pub quantities: HashMap<Quantity, f64>,
    /// Commands as they arrived.
    pub commands: Vec<(Command, f64)>,
}

/// A handle on the bench for the test.
#[derive(Clone, Default)]
pub struct Bench(pub Arc<Mutex<State>>);

impl Bench {
    /// Sets a quantity.
    pub fn set(&self, quantity: Quantity, value: f64) {
        self.0.lock().unwrap().quantities.insert(quantity, value);
    }

    /// The last value commanded.
    pub fn commanded(&self, command: Command) -> Option<f64> {
        self.0
            .lock()
            .unwrap()
            .commands
            .iter()
            .rev()
            .find(|(which, _)| *which == command)
            .map(|(_, value)| *value)
    }
}

/// The world of the bench: a force sensor that samples a thousand times a second.
pub struct BenchPlant {
    bench: Bench,
    now: Nanos,
}

impl BenchPlant {
    /// The world of that bench.
    pub fn new(bench: &Bench) -> Self {
        Self { bench: bench.clone(), now: Nanos(0) }
    }
}

impl Plant for BenchPlant {
    fn advance(&mut self, now: Nanos) {
        self.now = self.now.max(now);
    }

    fn measure(&mut self, quantity: Quantity) -> f64 {
        let sample = self.now.0 / 1_000_000;
        match quantity {
            Quantity::ForceSample | Quantity::DriveCount | Quantity::StageCount => sample as f64,
            Quantity::ForceTime | Quantity::DriveTime | Quantity::StageTime => sample as f64 * 1e-3,
            _ => self.bench.0.lock().unwrap().quantities.get(&quantity).copied().unwrap_or(0.0),
        }
    }

    fn command(&mut self, commands: &[(Command, f64)]) {
        let mut state = self.bench.0.lock().unwrap();
        for &(command, value) in commands {
            let echo = match command {
                Command::Amplitude => Some(Quantity::AmplitudeSetPoint),
                Command::Frequency => Some(Quantity::FrequencySetPoint),
                Command::Enable => Some(Quantity::OutputOn),
                Command::DriveHeartbeat => Some(Quantity::Heartbeat),
                Command::Velocity => Some(Quantity::VelocitySetPoint),
                Command::NormalForce => Some(Quantity::LoadSetPoint),
                Command::StageHeartbeat | Command::SupplyHeartbeat => None,
                Command::AmbientPressure | Command::AirTemperature | Command::RelativeHumidity => None,
                Command::CloseSupply => Some(Quantity::SupplyClosed),
            };
            if let Some(echo) = echo {
                state.quantities.insert(echo, value);
            }
            state.commands.push((command, value));
        }
    }
}

/// Serves profiles by unit over the bench.
pub fn serve(bench: &Bench, units: &[(u8, &str)], epoch: Instant) -> ModbusTcpServer {
    serve_at("127.0.0.1", bench, units, epoch)
}

fn serve_at(host: &str, bench: &Bench, units: &[(u8, &str)], epoch: Instant) -> ModbusTcpServer {
    let plant = SharedPlant::new(BenchPlant::new(bench), epoch);
    let devices: BTreeMap<u8, Device> =
        units.iter().map(|(unit, id)| (*unit, Device::new(drivers::profile(id).unwrap()).unwrap())).collect();
    ModbusTcpServer::start(format!("{host}:0").parse().unwrap(), devices, plant).unwrap()
}

/// The whole virtual bench on a loopback address of its own. A link whose server has ended goes on looking
/// for it, and sends 'off' first: on a shared address the port may be this server's by then.
pub fn serve_apart(bench: &Bench, epoch: Instant) -> ModbusTcpServer {
    static COUNT: std::sync::atomic::AtomicU32 = std::sync::atomic::AtomicU32::new(0);
    let n = COUNT.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
    let host = format!("127.0.{}.{}", 2 + n / 200, 2 + n % 200);
    serve_at(&host, bench, &[(1, "muprime-force2"), (2, "muprime-amplifier"), (3, "muprime-stage")], epoch)
}

/// The whole virtual bench: units 1 to 3.
pub fn serve_all(bench: &Bench, epoch: Instant) -> ModbusTcpServer {
    serve(bench, &[(1, "muprime-force2"), (2, "muprime-amplifier"), (3, "muprime-stage")], epoch)
}

/// Tries again and again until it is so, or ten seconds have passed.
pub fn eventually<T>(what: &str, mut attempt: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = attempt() {
            return found;
        }
        assert!(began.elapsed() < Duration::from_secs(10), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Opens a rig whose instruments answer. A machine that stalls may keep an answer for longer than a profile
/// allows, and then the rig does not open, rightly: it is tried up to ten times, after a late answer alone.
///
/// # Panics
/// With what the last attempt met: at once with any other error.
pub fn opened(instruments: &InstrumentsSetup, clock: impl Into<Clock> + Clone) -> Rig {
    let open = || drivers::open(instruments, clock.clone());
    let late = |tried: &Result<Rig, OpenError>| {
        matches!(tried, Err(OpenError::Link { problem: LinkError::Timeout(_) | LinkError::Cut(_), .. }))
    };
    let tried = (1..10).map(|_| open()).find(|tried| !late(tried)).unwrap_or_else(open);
    tried.unwrap_or_else(|error| panic!("{error}"))
}

/// Nanoseconds since the epoch.
pub fn now(epoch: Instant) -> Nanos {
    Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap())
}
