//! The virtual rig behind real protocols.
//!
//! An emulator stands on the same profile as the driver and on one [`Plant`], the virtual world.
//! It knows bytes and registers; the world knows forces and motion; a [`Quantity`] is all that they
//! share. Several emulators of several protocols may serve one world at once.
//!
//! | module | purpose |
//! |---|---|
//! | [`quantity`] | what of the world a profile may name |
//! | [`device`] | one emulated instrument: registers from the world, commands into it |
//! | [`can`] | instruments on a CAN bus |
//! | [`drive`] | a CANopen drive of CiA 402 |
//! | [`serial`] | serial lines, Modbus RTU, streams |
//! | [`lines`] | instruments of lines of text, over serial and TCP |
//! | [`streams`] | instruments that send by themselves over TCP and in datagrams |
//! | [`sysfs`] | a device of the kernel's by its attributes |
//! | [`modbus_tcp`] | a Modbus TCP server over devices |
//! | [`world`] | the virtual world as the emulators meet it |
#![allow(
    clippy::disallowed_methods,
    reason = "emulators answer in wall-clock time, each on a thread of its own"
)]

pub mod can;
pub mod device;
pub mod drive;
pub mod lines;
pub mod modbus_tcp;
pub mod quantity;
pub mod serial;
pub mod streams;
pub mod sysfs;
pub mod world;

pub use quantity::{Command, Quantity};

use realtime::{Clock, Nanos, threads};
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::thread::JoinHandle;

/// The thread of an emulator; dropping it ends it.
struct Service {
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Service {
    /// Does `turn` again and again until the flag is set, which it gets for threads of its own.
    fn start(name: &str, mut turn: impl FnMut(&Arc<AtomicBool>) + Send + 'static) -> io::Result<Self> {
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let work = move || {
            while !stopped.load(Ordering::Acquire) {
                turn(&stopped);
            }
        };
        let thread = threads::spawn(name, work)?;
        Ok(Service { stop, thread: Some(thread) })
    }

    fn end(&mut self) {
        self.stop.store(true, Ordering::Release);
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.end();
    }
}

/// The world as instruments meet it. All quantities are in SI units.
pub trait Plant: Send {
    /// Brings the world up to `now`; a time in the past changes nothing.
    fn advance(&mut self, now: Nanos);

    /// The value of a quantity at the time last advanced to; a truth is 0 or 1.
    fn measure(&mut self, quantity: Quantity) -> f64;

    /// Hands over absolute set-points that take effect together, at the time last advanced to.
    fn command(&mut self, commands: &[(Command, f64)]);
}

/// One world, shared by the emulators that serve it. Emulators are not the control loop: they may lock.
#[derive(Clone)]
pub struct SharedPlant {
    plant: Arc<Mutex<dyn Plant>>,
    clock: Clock,
}

impl SharedPlant {
    /// A world that lives in the time of `clock`.
    pub fn new(plant: impl Plant + 'static, clock: impl Into<Clock>) -> Self {
        Self { plant: Arc::new(Mutex::new(plant)), clock: clock.into() }
    }

    /// The world, brought up to now.
    pub fn now(&self) -> (MutexGuard<'_, dyn Plant + 'static>, Nanos) {
        let (mut plant, now) = self.as_left();
        plant.advance(now);
        (plant, now)
    }

    /// The world as it was left, and what time it is: for whoever advances it in steps of his own.
    pub fn as_left(&self) -> (MutexGuard<'_, dyn Plant + 'static>, Nanos) {
        // A panic in one emulator must not silence the others: the world itself is still whole.
        let plant = self.plant.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        (plant, self.clock.now())
    }
}
