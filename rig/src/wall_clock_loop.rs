//! The loop in wall-clock time: a thread of its own, instruments behind links.
//!
//! [`WallClockLoop`] owns the thread and the links; [`LoopHandle`] sends commands and reads rows.
//! States: running -> stopped (a few cycles carry the stop to the links) -> [`Ended`], with what the links
//! read back of their 'off'. Dropping a `WallClockLoop` stops the loop first and then switches the links off,
//! so a panic of the owner ends the drive. The same commands go to the loop in virtual time
//! (`runs::supervisor`); nothing above knows which of the two it has.
#![allow(clippy::disallowed_methods, reason = "the supervisor waits in wall-clock time, beside the loop")]

use drivers::Links;
use models::FrictionModel;
use realtime::clock::{Clock, Participant};
use realtime::cycle::{Command, Config};
use realtime::pacing::{self, Lifeline, LoopParts, LoopReport, Pacing};
use realtime::queue::CommandQueue;
use realtime::{Nanos, Ports, Row, threads};
use ringbuf::traits::{Consumer, Split};
use ringbuf::{HeapCons, HeapRb};
use runs::supervisor::{Loop, OffReport};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Duration;

/// Rows that a ring holds: eight seconds at 1 kHz.
const RING: usize = 8192;
/// Commands that wait for the loop.
const QUEUE: usize = 64;
/// The loop counts as lost when nothing is heard of it for this long.
const LOST_AFTER: Nanos = Nanos(2_000_000_000);
/// Cycles that carry a stop to the links.
const CYCLES_TO_STOP: u64 = 20;
/// How long those are waited for at most, and the loop's thread after them.
const STOP_WITHIN: Nanos = Nanos(500_000_000);
const JOIN_WITHIN: Nanos = Nanos(2_000_000_000);
/// How far a held clock may pass a row that the sweep has not answered yet.
const SWEEP_SLACK: Nanos = Nanos(5_000_000);
/// Pause of the sweep where no row has come.
const REST: Nanos = Nanos(500_000);

/// What a loop is made from.
pub struct Parts {
    /// Limits, timing, estimate.
    pub config: Config,
    /// The model to compare with.
    pub model: Arc<dyn FrictionModel>,
    /// The rig's ports.
    pub ports: Ports,
    /// The threads behind them.
    pub links: Links,
    /// What the loop's thread asks of the machine.
    pub pacing: Pacing,
    /// CLOCK_MONOTONIC in ns that counts as loop time zero.
    pub origin_ns: u64,
}

/// A running loop and its rig. Ending or dropping it stops the loop, switches the rig off and reads it back.
pub struct WallClockLoop {
    commands: Arc<CommandQueue>,
    life: Arc<Lifeline>,
    clock: Clock,
    looping: Option<JoinHandle<LoopReport>>,
    links: Option<Links>,
}

/// What became of a loop in wall-clock time.
pub struct Ended {
    /// The loop's own report; `None` where its thread hangs in a driver, or panicked.
    pub report: Option<LoopReport>,
    /// What each link counted.
    pub links: BTreeMap<String, serde_json::Value>,
    /// Whether the rig was read back off.
    pub off: OffReport,
}

impl WallClockLoop {
    /// Starts the loop. The handle goes to whoever leads it; the rows for a record come out of the ring.
    ///
    /// # Errors
    /// No thread can be had; the links are closed then.
    pub fn start(parts: Parts) -> std::io::Result<(Self, LoopHandle, HeapCons<Row>)> {
        let (rows, record) = HeapRb::<Row>::new(RING).split();
        let (watch, watched) = HeapRb::<Row>::new(RING).split();
        let Parts { config, model, ports, links, pacing, origin_ns } = parts;
        let commands = Arc::new(CommandQueue::new(QUEUE));
        let life = Arc::new(Lifeline::default());
        let clock = links.clock().clone();
        // Less than a period: what the machine held up is no missed deadline.
        let cycle = config.limits.timing.cycle.0;
        let held = Some(clock.join(Nanos(cycle - cycle / 4))).filter(Participant::is_held);
        let mut rig = WallClockLoop {
            commands: Arc::clone(&commands),
            life: Arc::clone(&life),
            clock,
            looping: None,
            links: Some(links),
        };
        let parts = LoopParts { config, model, ports, commands, rows, watch, life, origin_ns, held };
        let run = move || pacing::run(parts, pacing);
        rig.looping = Some(threads::spawn("loop", run)?);
        let handle = LoopHandle {
            commands: Arc::clone(&rig.commands),
            life: Arc::clone(&rig.life),
            watch: watched,
            heard: rig.clock.now(),
            clock: rig.clock.join(SWEEP_SLACK),
        };
        Ok((rig, handle, record))
    }

    /// The loop's signs of life, for whoever watches it from another thread.
    pub fn life(&self) -> Arc<Lifeline> {
        Arc::clone(&self.life)
    }

    /// Hands a command to the loop. False: the loop does not live any more.
    pub fn send(&self, command: Command) -> bool {
        let rest = || std::thread::sleep(Duration::from_nanos(REST.0));
        send(&self.commands, &self.life, &self.clock, &rest, command)
    }

    /// Stops the loop, switches off, reads back.
    pub fn end(mut self) -> Ended {
        let report = self.end_loop();
        let counted = |links: &Links| {
            let json = |health| serde_json::to_value(health).unwrap_or_default();
            links.health().map(|(name, health)| (name.to_string(), json(health))).collect()
        };
        let links = self.links.as_ref().map(counted).unwrap_or_default();
        let ends = self.links.take().map(Links::close).unwrap_or_default();
        Ended { report, links, off: OffReport::of(&ends) }
    }

    /// The stop goes out, a few more cycles carry it to the links, and the loop ends.
    fn end_loop(&mut self) -> Option<LoopReport> {
        let looping = self.looping.take()?;
        self.commands.stop();
        let beat = || self.life.heartbeat.load(Ordering::Relaxed);
        let enough = beat() + CYCLES_TO_STOP;
        let until = |limit: Nanos, done: &dyn Fn() -> bool| {
            let began = self.clock.now();
            while !done() && self.clock.now().since(began) < limit {
                std::thread::sleep(Duration::from_millis(1));
            }
        };
        until(STOP_WITHIN, &|| beat() >= enough || looping.is_finished());
        self.life.end.store(true, Ordering::Relaxed);
        // A loop that is stuck inside a driver cannot be joined. Its links switch off all the same: its commands expire.
        until(JOIN_WITHIN, &|| looping.is_finished());
        if looping.is_finished() { looping.join().ok() } else { None }
    }
}

impl Drop for WallClockLoop {
    fn drop(&mut self) {
        self.end_loop();
        drop(self.links.take());
    }
}

/// Puts a command into the queue. After a pause of the caller the rows come in a burst, and so do its
/// commands: a full queue means only that the loop has not taken them yet, as long as its heart beats.
fn send(commands: &CommandQueue, life: &Lifeline, clock: &Clock, rest: &dyn Fn(), command: Command) -> bool {
    let mut beat = life.heartbeat.load(Ordering::Relaxed);
    let mut since = clock.now();
    let mut waiting = command;
    while let Err(back) = commands.push(waiting) {
        waiting = back;
        let now = life.heartbeat.load(Ordering::Relaxed);
        if now != beat {
            (beat, since) = (now, clock.now());
        } else if clock.now().since(since) > LOST_AFTER {
            return false;
        }
        rest();
    }
    true
}

/// What leads a loop in wall-clock time: its commands, and its rows as they come.
pub struct LoopHandle {
    commands: Arc<CommandQueue>,
    life: Arc<Lifeline>,
    watch: HeapCons<Row>,
    heard: Nanos,
    clock: Participant,
}

impl LoopHandle {
    /// Something that stops the rig at once, from any thread.
    pub fn stopper(&self) -> impl Fn() + Send + Sync + 'static {
        let commands = Arc::clone(&self.commands);
        move || commands.stop()
    }

    /// Something that hands commands to the loop from another thread. A queue that is full does not take it.
    pub fn sender(&self) -> impl Fn(Command) + Send + 'static {
        let commands = Arc::clone(&self.commands);
        move |command| {
            let _ = commands.push(command);
        }
    }
}

impl Loop for LoopHandle {
    fn next_row(&mut self) -> Option<Row> {
        let row = self.watch.try_pop();
        match row {
            Some(_) => self.heard = self.clock.now(),
            // Only one that has answered every row lets a held clock go on.
            None => self.clock.sleep_until(self.clock.now().plus(REST)),
        }
        row
    }

    fn send(&mut self, command: Command) -> bool {
        let rest = || self.clock.sleep_until(self.clock.now().plus(REST));
        send(&self.commands, &self.life, self.clock.clock(), &rest, command)
    }

    fn stop(&mut self) {
        self.commands.stop();
    }

    fn is_lost(&self) -> bool {
        self.clock.now().since(self.heard) > LOST_AFTER
    }
}
