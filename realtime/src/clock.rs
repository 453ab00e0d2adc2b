//! Time as the drivers, the loop and a virtual world read it.
//!
//! [`Clock`] runs with the machine. That of a virtual rig whose every instrument this process serves itself
//! may be *held*: it stands still while a thread of the run cannot run, so that a pause of the computer ages
//! no sample and delays no cycle.
//!
//! Each thread of the run is a [`Participant`]. Before it waits it promises when it looks at the clock again;
//! the clock passes no promise by more than the participant's slack. A thread that could not run (the loop, a
//! driver, an emulator that owes a driver its answer) so finds the time that it waited for, at most its slack
//! later, whatever the machine did meanwhile. A thread that idles beside them could not tell: the one that is
//! starved need not be the one that watches. A participant that is silent for [`PATIENCE`] while others run
//! is waited for no longer: a fault of the program still ages samples, and trips.
//!
//! What may be held is proved, not stated: [`Clock::serves`] takes the listening socket itself, and
//! [`Clock::hold_for`] compares addresses with the proofs. An address where another process listens, on this
//! machine too, has none:
//!
//! ```compile_fail
//! let clock = muprime_realtime::clock::Clock::holdable(std::time::Instant::now());
//! let instrument: std::net::SocketAddr = "127.0.0.1:502".parse().unwrap();
//! clock.serves(&instrument); // an address proves nothing
//! ```
#![allow(clippy::disallowed_methods, reason = "this is the clock, and it waits by itself")]

use crate::ports::Nanos;
use serde::{Deserialize, Serialize};
use std::net::{SocketAddr, TcpListener};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// Time for which a silent participant holds the clock, counted while others run.
pub const PATIENCE: Nanos = Nanos(10_000_000_000);
/// What one look at a clock that stands counts towards [`PATIENCE`] at most: in a longer gap nobody ran.
const LOOK: u64 = 10_000_000;
/// Participants at most; those beyond are not waited for.
const SLOTS: usize = 16;
/// A slot whose participant is not waited for.
const FREE: u64 = u64::MAX;
/// Sleep between two looks at a clock that stands.
const NAP: Duration = Duration::from_micros(250);

/// Time since an epoch, shared by all who clone it.
#[derive(Clone, Debug)]
pub struct Clock {
    epoch: Instant,
    held: Option<Arc<Held>>,
}

/// How much time a clock was held back.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldBack {
    /// Seconds of the machine's time that did not pass in the run.
    pub seconds: f64,
    /// Their share of the machine's time since the epoch, 0 to 1.
    pub share: f64,
}

impl std::fmt::Display for HeldBack {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let HeldBack { seconds, share } = self;
        let percent = 100.0 * share;
        write!(
            f,
            "The clock of the virtual rig was held back for {seconds:.2} s ({percent:.1} %) by the computer"
        )
    }
}

impl From<Instant> for Clock {
    /// A clock that runs with the machine, and is never held.
    fn from(epoch: Instant) -> Self {
        Clock { epoch, held: None }
    }
}

impl Clock {
    /// A clock for a virtual rig. It runs with the machine until [`Clock::hold_for`] finds that it may be
    /// held.
    pub fn holdable(epoch: Instant) -> Self {
        Clock { epoch, held: Some(Arc::default()) }
    }

    /// Time since the epoch. Never blocks: while another thread sets the clock on, it is what it was.
    pub fn now(&self) -> Nanos {
        match &self.held {
            None => nanos(self.epoch.elapsed()),
            Some(held) => held.look(|| nanos(self.epoch.elapsed())),
        }
    }

    /// This process serves an instrument of the virtual rig at this socket.
    pub fn serves(&self, listener: &TcpListener) {
        if let (Some(held), Ok(address)) = (&self.held, listener.local_addr()) {
            lock(&held.places).served.push(address);
        }
    }

    /// Lets the clock be held from now on, where this process serves every one of these instruments itself.
    /// One that it does not serve lets it run for ever.
    pub fn hold_for<'a>(&self, addresses: impl IntoIterator<Item = &'a str>) {
        let Some(held) = &self.held else { return };
        let mut places = lock(&held.places);
        let own = |address: &str| address.parse().is_ok_and(|address| places.served.contains(&address));
        let foreign = !addresses.into_iter().all(own);
        places.foreign |= foreign;
        held.holds.store(!places.foreign, Ordering::Release);
    }

    /// A thread of the run: where it may be held the clock waits for it, from now on, and passes what it
    /// promises by `slack` at most.
    pub fn join(&self, slack: Nanos) -> Participant {
        let slot = self.held.as_ref().and_then(|held| held.take_slot());
        let participant = Participant { clock: self.clone(), slot, slack };
        participant.promise(self.now());
        participant
    }

    /// How much time was held back; `None` for a clock that may not be held.
    pub fn held_back(&self) -> Option<HeldBack> {
        let held = self.held.as_ref().filter(|held| held.holds.load(Ordering::Acquire))?;
        let _ = self.now();
        let hand = lock(&held.hand);
        let (seconds, all) = (Nanos(hand.held).seconds(), Nanos(hand.seen.max(1)).seconds());
        Some(HeldBack { seconds, share: seconds / all })
    }
}

/// A thread that the clock waits for. Dropping it ends that.
#[derive(Debug)]
pub struct Participant {
    clock: Clock,
    slot: Option<usize>,
    slack: Nanos,
}

impl Participant {
    /// Time since the epoch.
    pub fn now(&self) -> Nanos {
        self.clock.now()
    }

    /// Its clock.
    pub const fn clock(&self) -> &Clock {
        &self.clock
    }

    /// Whether its clock may be held.
    pub fn is_held(&self) -> bool {
        self.clock.held.as_ref().is_some_and(|held| held.holds.load(Ordering::Acquire))
    }

    /// This thread looks at the clock again by `due`.
    pub fn promise(&self, due: Nanos) {
        if let (Some(held), Some(slot)) = (&self.clock.held, self.slot) {
            // What has passed until now has passed under the promise before.
            let _ = self.now();
            held.slots[slot].limit.store(due.plus(self.slack).0, Ordering::Release);
        }
    }

    /// Promises `due` and sleeps until then.
    pub fn sleep_until(&self, due: Nanos) {
        self.promise(due);
        let mut least = Duration::ZERO;
        loop {
            let left = due.since(self.now());
            if left == Nanos(0) {
                return;
            }
            std::thread::sleep(Duration::from_nanos(left.0).max(least));
            if !self.is_held() {
                return;
            }
            least = NAP;
        }
    }
}

impl Drop for Participant {
    fn drop(&mut self) {
        if let (Some(held), Some(slot)) = (&self.clock.held, self.slot) {
            held.slots[slot].limit.store(FREE, Ordering::Release);
            held.slots[slot].taken.store(false, Ordering::Release);
        }
    }
}

/// A clock that may be held.
#[derive(Debug, Default)]
struct Held {
    holds: AtomicBool,
    /// What the clock shows.
    shown: AtomicU64,
    hand: Mutex<Hand>,
    slots: [Slot; SLOTS],
    places: Mutex<Places>,
}

/// Sockets that this process serves, and whether an instrument was elsewhere.
#[derive(Debug, Default)]
struct Places {
    served: Vec<SocketAddr>,
    foreign: bool,
}

/// The latest time that a participant lets the clock show.
#[derive(Debug)]
struct Slot {
    taken: AtomicBool,
    limit: AtomicU64,
}

impl Default for Slot {
    fn default() -> Self {
        Slot { taken: AtomicBool::new(false), limit: AtomicU64::new(FREE) }
    }
}

impl Held {
    fn take_slot(&self) -> Option<usize> {
        self.slots.iter().position(|slot| !slot.taken.swap(true, Ordering::AcqRel))
    }

    /// The latest time that all participants let the clock show.
    fn limit(&self) -> u64 {
        self.slots.iter().map(|slot| slot.limit.load(Ordering::Acquire)).min().unwrap_or(FREE)
    }

    /// Sets the clock on, if no other thread is doing so, and gives what it shows.
    fn look(&self, machine: impl FnOnce() -> Nanos) -> Nanos {
        let mut hand = match self.hand.try_lock() {
            Ok(hand) => hand,
            Err(TryLockError::Poisoned(hand)) => hand.into_inner(),
            Err(TryLockError::WouldBlock) => return Nanos(self.shown.load(Ordering::Acquire)),
        };
        let limit = if self.holds.load(Ordering::Acquire) { self.limit() } else { FREE };
        let shown = hand.set_on(machine().0, limit);
        if hand.standing > PATIENCE.0 {
            hand.standing = 0;
            // They hold the clock again from their next promise on.
            for slot in self.slots.iter().filter(|slot| slot.limit.load(Ordering::Acquire) <= shown) {
                slot.limit.store(FREE, Ordering::Release);
            }
        }
        self.shown.store(shown, Ordering::Release);
        Nanos(shown)
    }
}

/// The hand of a clock that may be held, in ns.
#[derive(Clone, Copy, Debug, Default)]
struct Hand {
    /// The machine's time at the last look.
    seen: u64,
    shown: u64,
    /// All the time that was held back.
    held: u64,
    /// For how long the clock has stood, as far as somebody looked.
    standing: u64,
}

impl Hand {
    /// The machine's time is now `machine`; the clock may not pass `limit`.
    fn set_on(&mut self, machine: u64, limit: u64) -> u64 {
        let passed = machine.saturating_sub(self.seen);
        let step = passed.min(limit.saturating_sub(self.shown));
        self.seen += passed;
        self.shown += step;
        self.held += passed - step;
        self.standing = if step > 0 { 0 } else { self.standing + passed.min(LOOK) };
        self.shown
    }
}

fn nanos(duration: Duration) -> Nanos {
    Nanos(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX))
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
