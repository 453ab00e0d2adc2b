//! The parts of the loop's thread, each by itself: first deadline, counts, and last commands.

use super::*;
use crate::ports::{SupplyState, SupplySwitch};

/// Touches so many pages that the thread has not met before, each a page of its own.
pub(super) fn touch_new_pages(pages: usize) {
    if pages == 0 {
        return;
    }
    let length = pages * 4096;
    // SAFETY: a new private mapping of `length` bytes, written inside its bounds one byte a page, and given
    // back; it is not used where the kernel refuses it.
    unsafe {
        let (prot, flags) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_PRIVATE | libc::MAP_ANONYMOUS);
        let memory = libc::mmap(std::ptr::null_mut(), length, prot, flags, -1, 0);
        assert_ne!(memory, libc::MAP_FAILED);
        libc::madvise(memory, length, libc::MADV_NOHUGEPAGE);
        for page in 0..pages {
            std::ptr::write_volatile(memory.cast::<u8>().add(4096 * page), 1);
        }
        libc::munmap(memory, length);
    }
}

/// The first cycle waits for the first deadline, a period after the loop begins; on a busy machine the best of some tries.
#[test]
fn the_first_cycle_misses_no_deadline() {
    let first = || {
        let mut running = Running::start(50);
        let row = running.until("the first row", |row| row.cycle == 1);
        let (report, _) = running.end();
        assert_eq!((report.grants.policy.as_str(), report.grants.priority), ("unchanged", 0));
        row.inputs.seen.lateness
    };
    let least = (0..20).map(|_| first()).find(|late| *late < PERIOD);
    assert!(least.is_some(), "the first cycle of 20 loops was late by a period");
}

/// Page faults are those after the first cycle, which brings in what the loop needs.
#[test]
fn faults_are_counted_from_the_second_cycle_on() {
    let _alone = super::super::super::machine::tests::alone();
    let mut running = Running::with(50, 16384, Scene { touches: 4000, ..Scene::default() });
    running.until("some cycles", |row| row.cycle >= 3);
    running.scene.lock().unwrap().touches = 500;
    let at = running.rows.try_iter_last_cycle();
    running.until("some more", |row| row.cycle >= at + 3);
    let (report, _) = running.end();
    assert!((500..4000).contains(&report.minor_faults), "{report:?}");
}

/// Each deadline has its place in the histogram: the last of a stall is late by the least.
#[test]
fn a_stall_counts_every_deadline_at_its_place() {
    const MS: u64 = 1_000_000;
    let mut histogram = lateness_histogram();
    count_deadlines(&mut histogram, 41 * MS, 4, 10 * MS);
    assert_eq!(histogram.len(), 5);
    for late in [1, 11, 21, 31, 41] {
        assert_eq!(histogram.count_at(late * MS), 1, "{late} ms");
    }
    // In time: one.
    let mut histogram = lateness_histogram();
    count_deadlines(&mut histogram, 5_000, 0, MS);
    assert_eq!((histogram.len(), histogram.count_at(5_000)), (1, 1));
}

/// However long a stall, what is counted of it is bounded: it is the loop's own time.
#[test]
fn a_stall_of_hours_counts_ten_seconds_of_deadlines() {
    let mut histogram = lateness_histogram();
    let (stall, period) = (3600 * LONGEST_NS, 100_000_000);
    count_deadlines(&mut histogram, stall, stall / period, period);
    assert_eq!(histogram.len(), 101);
    assert!(histogram.min() >= LONGEST_NS / 100 * 99, "all of them above the resolved range");
}

#[test]
fn a_bare_sleep_has_one_lateness_a_deadline() {
    let (during, period) = (Duration::from_millis(200), Duration::from_millis(10));
    let began = monotonic_ns();
    assert_eq!(lateness_of_sleep(during, period).len(), 20);
    assert!(monotonic_ns() - began >= 200_000_000, "twenty deadlines, each a period after the other");
    // Shorter than a period, or no period at all: one sleep.
    assert_eq!(lateness_of_sleep(Duration::from_millis(1), period).len(), 1);
    assert_eq!(lateness_of_sleep(Duration::ZERO, Duration::ZERO).len(), 1);
}

#[test]
fn deadlines_stay_on_their_grid_until_one_is_missed() {
    assert_eq!(deadline_after(100, 103, 10), 110);
    assert_eq!(deadline_after(100, 110, 10), 110, "just in time");
    assert_eq!(deadline_after(100, 111, 10), 121, "missed: a period from now");
    assert_eq!(deadline_after(100, 175, 10), 185);
}

/// The commands to the ports, in order, and which of the ports panics.
#[derive(Default)]
struct EndLog {
    by: Vec<&'static str>,
    panics: [bool; 3],
}

struct End(Arc<Mutex<EndLog>>);

impl End {
    fn tell(&self, which: usize, what: &'static str) {
        let panics = {
            let mut log = self.0.lock().unwrap();
            log.by.push(what);
            log.panics[which]
        };
        assert!(!panics, "{what} is too much");
    }
}

impl ForceSensor for End {
    fn read(&mut self, _: Nanos) -> Forces {
        Forces::missing(NoData::NotFitted)
    }
}

impl Amplifier for End {
    fn command(&mut self, command: DriveCommand, now: Nanos) {
        assert!(!command.enable() && command.amplitude() == PeakToPeak::ZERO && command.expires_at() > now);
        self.tell(0, "off");
    }

    fn state(&mut self, _: Nanos) -> Result<AmplifierState, NoData> {
        Err(NoData::NotFitted)
    }
}

impl Stage for End {
    fn command(&mut self, command: StageCommand, now: Nanos) {
        assert!(
            command.velocity_m_s() == 0.0 && command.normal_force_n() == 0.0 && command.expires_at() > now
        );
        self.tell(1, "stop");
    }

    fn state(&mut self, _: Nanos) -> Result<StageState, NoData> {
        Err(NoData::NotFitted)
    }
}

impl SupplySwitch for End {
    fn command(&mut self, command: SupplyCommand, _: Nanos) {
        self.tell(2, if command == SupplyCommand::Cut { "cut" } else { "restore" });
    }

    fn state(&mut self, _: Nanos) -> Result<SupplyState, NoData> {
        Err(NoData::NotFitted)
    }
}

/// The supply is cut only if the amplifier's command failed: a cut needs a proof before the next run.
#[test]
fn a_port_that_panics_at_the_end_leaves_the_others_commanded() {
    let commands = |panics| {
        let log = Arc::new(Mutex::new(EndLog { by: Vec::new(), panics }));
        let end = || Box::new(End(Arc::clone(&log)));
        let mut ports = Ports { supply: end(), ..Ports::new(end(), end(), end()) };
        switch_off(&mut ports, Nanos(7));
        log.lock().unwrap().by.clone()
    };
    assert_eq!(commands([false, false, false]), ["off", "stop"]);
    assert_eq!(commands([true, false, false]), ["off", "stop", "cut"]);
    assert_eq!(commands([false, true, false]), ["off", "stop"]);
    assert_eq!(commands([true, true, true]), ["off", "stop", "cut"]);
}
