//! The loop's own thread, behind real drivers, does not allocate; and how late a thread wakes.

use models::SpringSlider;
use realtime::{Command, Nanos, Ports};
use ringbuf::traits::Consumer;
use runs::Setup;
use sim::world::WorldConfig;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::sync::Arc;

thread_local! {
    static COUNTING: Cell<bool> = const { Cell::new(false) };
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting on threads that ask for it.
struct Counting;

// SAFETY: every call is handed on to the system's allocator unchanged; counting touches thread-local cells only.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + u64::from(COUNTING.get()));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        COUNT.set(COUNT.get() + u64::from(COUNTING.get()));
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A force port that counts the allocations of the loop's own thread between two of its cycles.
struct Counted {
    inner: Box<dyn realtime::ports::ForceSensor>,
    reads: u64,
    counted: Arc<std::sync::atomic::AtomicU64>,
}

/// The cycles between which is counted: the first ones touch what the loop touches once.
const COUNTED: std::ops::Range<u64> = 200..3200;

impl realtime::ports::ForceSensor for Counted {
    fn read(&mut self, now: Nanos) -> realtime::ports::Forces {
        self.reads += 1;
        if self.reads == COUNTED.start {
            COUNT.set(0);
            COUNTING.set(true);
        } else if self.reads == COUNTED.end {
            COUNTING.set(false);
            self.counted.store(COUNT.get(), std::sync::atomic::Ordering::Release);
        }
        self.inner.read(now)
    }
}

/// The loop's own thread, `pacing::run` and all, over the ports of real drivers (Modbus TCP on loopback), armed and driving.
#[test]
fn the_loops_thread_allocates_nothing_behind_real_drivers() {
    use realtime::safety::Request;
    use rig::wall_clock_loop::{Parts, WallClockLoop};
    use runs::supervisor::Loop;
    use std::sync::atomic::{AtomicU64, Ordering};
    let setup = tests::slower(&Setup::load("virtual-ideal").unwrap());
    let (epoch, origin_ns) = (std::time::Instant::now(), realtime::pacing::monotonic_ns());
    let world = sim::world::World::new(&WorldConfig::ideal(), 1).unwrap();
    let plant = sim::wire::SharedPlant::new(sim::wire::world::WorldPlant::new(world), epoch);
    let mut instruments = setup.instruments();
    let _emulators = rig::emulators::serve(&mut instruments, &plant, false).unwrap();
    let opened = wall::bench::opened(&instruments, epoch);
    let counted = Arc::new(AtomicU64::new(u64::MAX));
    let mut ports = setup.certificates.applied(Ports::new(opened.force, opened.amplifier, opened.stage));
    ports.force = Box::new(Counted { inner: ports.force, reads: 0, counted: Arc::clone(&counted) });
    let (rig, mut reins, mut record) = WallClockLoop::start(Parts {
        config: setup.config,
        model: Arc::new(SpringSlider::new(setup.tip.finger).unwrap()),
        ports,
        links: opened.links,
        pacing: realtime::pacing::Pacing::default(),
        origin_ns,
    })
    .unwrap();
    let request = Request {
        amplitude: models::quantity::PeakToPeak::from_metres(2e-6),
        frequency_hz: 27_500.0,
        velocity_m_s: 0.0,
        normal_force_n: 0.25,
    };
    let (mut driven, mut last_asked) = (0u64, 0);
    let began = std::time::Instant::now();
    while counted.load(Ordering::Acquire) == u64::MAX && began.elapsed().as_secs() < 60 {
        while record.try_pop().is_some() {}
        let Some(row) = reins.next_row() else { continue };
        driven += u64::from(row.drive_pp_m > 0.0 && COUNTED.contains(&row.cycle));
        if row.cycle > last_asked + 60 {
            last_asked = row.cycle;
            let ask = if row.armed {
                Command::Set(request, realtime::cycle::Marker::default())
            } else {
                Command::Reset
            };
            reins.send(ask);
        }
    }
    let allocations = counted.load(Ordering::Acquire);
    println!("{} cycles behind drivers, {driven} driving, {allocations} allocations", COUNTED.count());
    rig.end();
    assert_eq!(allocations, 0);
    assert!(driven > 500, "the cycles must be those of a driven rig: {driven}");
}

#[test]
fn the_first_deadline_of_a_bare_sleep_is_not_missed_by_a_period() {
    let period = std::time::Duration::from_millis(10);
    let first = || realtime::pacing::lateness_of_sleep(20 * period, period)[0];
    assert!((0..20).any(|_| first() < 10_000_000), "missed by a period in each of 20 runs");
}
