//! The clock against recorded stalls: the machine's time is a number here, so that no machine can break a
//! test.

use super::*;
use crate::ports::Sample;
use crate::safety::ChannelTiming;

const MS: u64 = 1_000_000;

/// A held clock whose machine's time the test sets.
struct Bench {
    held: Arc<Held>,
    machine: u64,
}

impl Bench {
    fn new(holds: bool) -> Self {
        let held = Arc::new(Held::default());
        held.holds.store(holds, Ordering::Release);
        Bench { held, machine: 0 }
    }

    fn now(&self) -> u64 {
        self.held.look(|| Nanos(self.machine)).0
    }

    fn slot(&self) -> usize {
        self.held.take_slot().unwrap()
    }

    fn promise(&self, slot: usize, limit: u64) {
        let _ = self.now();
        self.held.slots[slot].limit.store(limit, Ordering::Release);
    }
}

/// Milliseconds for which each turn of a driver was held up: a busy afternoon on a shared machine, with one
/// pause of seconds.
const STALLS_MS: [u64; 16] = [0, 0, 4, 0, 48, 0, 0, 130, 1, 0, 700, 0, 3, 9_000, 0, 20];

/// A loop of 1 kHz and a driver that polls as often, each stalled in turn: age of the last sample at every
/// cycle, and how late the cycle was, both in ms of the clock.
fn ages_and_lateness(bench: &mut Bench) -> Vec<(u64, u64)> {
    let (cycle, driver) = (bench.slot(), bench.slot());
    let mut seen = Vec::new();
    let (mut due, mut taken_at) = (MS, 0);
    for (turn, stall) in STALLS_MS.iter().cycle().take(200).enumerate() {
        bench.promise(cycle, due + MS / 2);
        bench.promise(driver, due + 2 * MS);
        // One of them is let run in time, and looks at the clock until the other is.
        bench.machine += due.saturating_sub(bench.now());
        let driver_first = turn % 2 == 0;
        if driver_first {
            taken_at = bench.now();
            bench.promise(driver, taken_at + 3 * MS);
        } else {
            let late = bench.now() - due;
            seen.push((bench.now() - taken_at, late));
        }
        for _ in 0..*stall {
            bench.machine += MS;
            let _ = bench.now();
        }
        if driver_first {
            seen.push((bench.now() - taken_at, bench.now().saturating_sub(due)));
        } else {
            taken_at = bench.now();
        }
        due = (due + MS).max(bench.now());
    }
    seen
}

#[test]
fn a_recorded_series_of_stalls_ages_nothing_and_makes_no_cycle_late() {
    let mut bench = Bench::new(true);
    let seen = ages_and_lateness(&mut bench);
    let limit = ChannelTiming { period: Nanos(MS), latency: Nanos(0), periods: 3 };
    for (age, late) in &seen {
        assert!(*late <= MS / 2, "a cycle {late} ns late");
        let taken = Nanos(10_000 * MS - age);
        assert!(limit.is_fresh(taken, Nanos(10_000 * MS)), "a sample of {age} ns");
    }
    let hand = *lock(&bench.held.hand);
    assert_eq!(hand.shown + hand.held, bench.machine, "every ns of the machine is shown or held back");
    assert!(hand.held > 100_000 * MS, "the stalls were held back: {hand:?}");
}

/// The same stalls where the clock may not be held, as beside an instrument: ages and lateness are those of
/// the machine.
#[test]
fn the_same_stalls_trip_where_the_clock_is_not_held() {
    let seen = ages_and_lateness(&mut Bench::new(false));
    assert!(seen.iter().any(|(age, _)| *age >= 700 * MS) && seen.iter().any(|(_, late)| *late >= 700 * MS));
}

#[test]
fn a_quiet_machine_holds_nothing_back() {
    let mut bench = Bench::new(true);
    let slots = [bench.slot(), bench.slot()];
    for turn in 0..10_000_u64 {
        slots.iter().for_each(|slot| bench.promise(*slot, (turn + 1) * MS + MS / 2));
        // Some 0.1 ms late, as ordinary threads are.
        bench.machine = (turn + 1) * MS + 40_000 * (turn % 5);
        assert_eq!(bench.now(), bench.machine);
    }
    assert_eq!(lock(&bench.held.hand).held, 0);
}

#[test]
fn a_stopped_process_finds_the_time_that_it_left() {
    let mut bench = Bench::new(true);
    let slot = bench.slot();
    bench.promise(slot, 5 * MS);
    bench.machine = 3_600_000 * MS;
    assert_eq!(bench.now(), 5 * MS);
    bench.promise(slot, 6 * MS);
    assert_eq!(bench.now(), 5 * MS);
    bench.machine += MS / 2;
    assert_eq!(bench.now(), 5 * MS + MS / 2);
}

/// A thread that hangs holds the clock for ten seconds in which others ran, and no longer: its samples age
/// then, and trip.
#[test]
fn whoever_never_comes_back_is_given_up() {
    let mut bench = Bench::new(true);
    let (hangs, lives) = (bench.slot(), bench.slot());
    bench.promise(hangs, MS);
    let sample =
        Sample { value: 0.1, raw: 1, taken_at: Nanos(0), sequence: 1, quality: crate::ports::Quality::Good };
    let limit = ChannelTiming { period: Nanos(MS), latency: Nanos(45 * MS), periods: 1 };
    for n in 0..11_000 {
        bench.promise(lives, bench.now() + MS);
        bench.machine += MS;
        let now = Nanos(bench.now());
        assert_eq!(limit.is_fresh(sample.taken_at, now), n < 10_047, "after {n} ms: {now:?}");
    }
    // It lives after all, and is waited for again.
    let now = bench.now();
    bench.promise(hangs, now + MS);
    bench.promise(lives, now + 50 * MS);
    bench.machine += 100 * MS;
    assert_eq!(bench.now(), now + MS);
}

#[test]
fn the_clock_never_goes_back() {
    let mut bench = Bench::new(true);
    let slot = bench.slot();
    bench.machine = 50 * MS;
    assert_eq!(bench.now(), 50 * MS);
    bench.promise(slot, 20 * MS);
    bench.machine = 60 * MS;
    assert_eq!(bench.now(), 50 * MS);
    bench.machine = 10 * MS;
    assert_eq!(bench.now(), 50 * MS);
}

#[test]
fn participants_that_leave_are_not_waited_for() {
    let clock = Clock::holdable(Instant::now());
    clock.hold_for([]);
    let held = Arc::clone(clock.held.as_ref().unwrap());
    let all: Vec<Participant> = (0..SLOTS + 3).map(|_| clock.join(Nanos(0))).collect();
    assert!(held.limit() < FREE && all[SLOTS].slot.is_none());
    drop(all);
    assert_eq!(held.limit(), FREE);
    assert!(held.take_slot().is_some());
}

/// Negative control: a foreign address, loopback or not, is an instrument, and so is every rig that holds
/// one.
#[test]
fn an_instrument_that_this_process_does_not_serve_lets_the_clock_run() {
    let holds = |clock: &Clock| clock.held_back().is_some();
    let [own, foreign] = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
    let [own_at, foreign_at] = [&own, &foreign].map(|one| one.local_addr().unwrap().to_string());
    let served = || {
        let clock = Clock::holdable(Instant::now());
        clock.serves(&own);
        clock
    };
    let clock = served();
    clock.hold_for([own_at.as_str(), own_at.as_str()]);
    assert!(holds(&clock));
    // Once foreign, always foreign; and the other way round nothing is held any more.
    clock.hold_for([own_at.as_str(), foreign_at.as_str()]);
    assert!(!holds(&clock));
    clock.hold_for([own_at.as_str()]);
    assert!(!holds(&clock));
    for elsewhere in [foreign_at.as_str(), "192.168.0.7:502", "can0", "/dev/ttyUSB0", "localhost", ""] {
        let clock = served();
        clock.hold_for([own_at.as_str(), elsewhere]);
        assert!(!holds(&clock), "{elsewhere}");
    }
    let instruments = Clock::from(Instant::now());
    instruments.serves(&own);
    instruments.hold_for([own_at.as_str()]);
    assert!(!holds(&instruments), "a clock of instruments is never held");
}
