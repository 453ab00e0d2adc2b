//! A chamber around the rig, or a gauge that only reads: the air's pressure, temperature and humidity.
//!
//! It takes no part in the loop: air changes within seconds or minutes, and nothing that it shows switches
//! anything off. A thread reads it a few times a second over Modbus TCP, passes set-points on, and connects
//! again after an outage.

use super::endpoint::BadFrame;
use super::modbus::{Blocks, Registers, Trouble};
use super::modbus_tcp::{Tcp, resolve};
use super::{InstrumentSetup, LinkError, OpenError};
use instruments::Profile;
use instruments::schema::{LinkKind, Role};
use realtime::{Clock, threads};
use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::runtime::Runtime;

/// Names of signals and set-points: pressure (Pa), temperature (deg C), relative humidity (%).
pub const QUANTITIES: [&str; 3] = ["pressure", "temperature", "humidity"];
/// Time from one look to the next where the profile states no rate.
const EVERY: Duration = Duration::from_millis(200);
/// Time before a lost line is tried again.
const AGAIN: Duration = Duration::from_millis(500);

/// What was read of the air.
#[derive(Clone, Debug, Default)]
pub struct Air {
    /// In the order of [`QUANTITIES`]: value, and when it came. `None`: never read, or refused by the profile.
    pub readings: [Option<(f64, Instant)>; 3],
    /// Why nothing is read now, or a set-point was not taken.
    pub problem: Option<String>,
}

#[derive(Default)]
struct Shared {
    air: Air,
    set: [Option<f64>; 3],
}

/// A chamber that is connected. Dropping it ends the thread; the chamber holds its last set-point.
pub struct Chamber {
    shared: Arc<Mutex<Shared>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Whether a profile is that of a chamber or a gauge which this driver can talk to.
///
/// # Errors
/// Why not.
pub fn serves(profile: &Profile) -> Result<(), OpenError> {
    let id = profile.id().to_string();
    if !profile.description.profile.roles.contains(&Role::AmbientChamber) {
        return Err(OpenError::Unfit(id, " is not a chamber's: its roles lack `ambient.chamber`"));
    }
    if profile.description.link.kind != LinkKind::ModbusTcp {
        return Err(OpenError::Unfit(id, ": a chamber is read over Modbus TCP (`kind = \"modbus_tcp\"`)"));
    }
    if QUANTITIES.iter().all(|name| profile.signal(name).is_none()) {
        return Err(OpenError::Unfit(id, " has no signal `pressure`, `temperature` or `humidity`"));
    }
    Ok(())
}

impl Chamber {
    /// Connects and reads once.
    ///
    /// # Errors
    /// A profile that is not a chamber's, an address that makes no sense, no answer.
    pub fn open(setup: &InstrumentSetup) -> Result<Self, OpenError> {
        let profile = setup.description()?;
        serves(&profile)?;
        let (id, address) = (&setup.profile, &setup.address);
        let at = |problem| OpenError::Beside { id: id.clone(), address: address.clone(), problem };
        let link = &profile.description.link;
        let mut talk = Talk {
            address: resolve(address, link.port).map_err(|error| at(error.into()))?,
            unit: setup.unit.or(link.unit).unwrap_or(255),
            blocks: Blocks::of(&profile),
            profile,
            taken: [None; 3],
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| at(error.into()))?;
        let shared = Arc::new(Mutex::new(Shared::default()));
        // An outage of the air's line only ages its readings: the time that its answers may take is never held.
        let clock = Clock::from(Instant::now());
        let air = talk
            .connect((&runtime, &clock))
            .and_then(|mut wire| talk.look(&mut wire, &[None; 3]))
            .map_err(at)?;
        lock(&shared).air = air;
        let stop = Arc::new(AtomicBool::new(false));
        let (theirs, ends) = (Arc::clone(&shared), Arc::clone(&stop));
        let work = move || talk.go_on((&runtime, &clock), &theirs, &ends);
        let thread = threads::spawn("chamber", work);
        Ok(Self { shared, stop, thread: Some(thread.map_err(|error| at(error.into()))?) })
    }

    /// What was read last.
    pub fn air(&self) -> Air {
        lock(&self.shared).air.clone()
    }

    /// Hands a set-point on, by its place in [`QUANTITIES`], in SI units (deg C for the temperature).
    pub fn set(&self, quantity: usize, value: f64) {
        lock(&self.shared).set[quantity] = Some(value);
    }
}

impl Drop for Chamber {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

struct Talk {
    address: SocketAddr,
    unit: u8,
    profile: Profile,
    blocks: Blocks,
    /// Set-points that the chamber has taken.
    taken: [Option<f64>; 3],
}

impl Talk {
    fn connect<'a>(&self, runtime: (&'a Runtime, &'a Clock)) -> Result<Tcp<'a>, LinkError> {
        let link = &self.profile.description.link;
        Tcp::connect(runtime, self.address, self.unit, link.connect_timeout_ms, link.response_timeout_ms)
    }

    fn go_on(&mut self, runtime: (&Runtime, &Clock), shared: &Mutex<Shared>, ends: &AtomicBool) {
        let mut wire = None;
        while !ends.load(Ordering::Acquire) {
            let set = lock(shared).set;
            let looked = match &mut wire {
                Some(wire) => self.look(wire, &set),
                None => self.connect(runtime).and_then(|new| self.look(wire.insert(new), &set)),
            };
            let wait = if looked.is_ok() { EVERY } else { AGAIN };
            match looked {
                Ok(air) => lock(shared).air = air,
                Err(ended) => {
                    // A reading that nobody renews grows old where it is; the run sees its age.
                    lock(shared).air.problem = Some(ended.to_string());
                    (wire, self.taken) = (None, [None; 3]);
                }
            }
            std::thread::sleep(wait);
        }
    }

    /// Writes the set-points that are new, and reads everything.
    fn look(&mut self, wire: &mut Tcp<'_>, set: &[Option<f64>; 3]) -> Result<Air, LinkError> {
        let mut problem = None;
        for (index, value) in set.iter().enumerate() {
            let (Some(value), Some(id)) = (value, self.profile.set(QUANTITIES[index])) else { continue };
            if self.taken[index] == Some(*value) {
                continue;
            }
            let wanted = value / self.profile.description.set[id.0].si.factor;
            let Some((table, at, own)) = self.blocks.put_one(&self.profile, id, wanted) else { continue };
            match wire.write(table, at, &own) {
                Ok(()) => self.taken[index] = Some(*value),
                Err(Trouble::Refused(why) | Trouble::Corrupt(why)) => {
                    problem = Some(format!("{} {value} was refused: {why}", QUANTITIES[index]));
                }
                Err(Trouble::LinkError(ended)) => return Err(ended),
            }
        }
        let readings = self.read(wire)?;
        Ok(Air { readings, problem })
    }

    fn read(&self, wire: &mut Tcp<'_>) -> Result<[Option<(f64, Instant)>; 3], LinkError> {
        let mut values = self.profile.values();
        for (frame, poll) in self.profile.polls() {
            let mut bytes = Vec::new();
            for span in &self.profile.frames()[frame.0].spans {
                let part = wire.read(poll.table, span.address, span.count);
                bytes.extend(part.map_err(|trouble| LinkError::Io(format!("{trouble:?}")))?);
            }
            let decoded = self.profile.decode(frame, &bytes, &mut values);
            decoded.map_err(|error| BadFrame::Corrupt(error.to_string()))?;
        }
        if let Some(broken) = self.profile.broken_signature(&values) {
            let text = self.profile.description.signature[broken].text.clone();
            return Err(BadFrame::WrongInstrument(text).into());
        }
        let now = Instant::now();
        Ok(QUANTITIES.map(|name| {
            let signal = self.profile.signal(name)?;
            let good = self.profile.refusal(signal, &values).is_none();
            good.then(|| (self.profile.si(signal, &values), now))
        }))
    }
}
