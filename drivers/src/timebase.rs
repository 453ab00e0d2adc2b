//! An instrument's clock and counter, mapped to the loop's.
//!
//! An instrument's clock has its own zero, drifts, and runs round at the width of its register. A
//! sample cannot have been taken after its answer arrived, so `arrival - device time` is the clocks'
//! offset plus a delay that is never negative: its smallest recent value is the best offset.

use realtime::Nanos;

/// The smallest offset is sought over this long, in s: long enough to meet a quick answer, short
/// enough that 50 ppm of drift make no more than 0.2 ms.
const WINDOW_S: f64 = 2.0;

/// A step of the device's clock that differs from ours by more than this is a reset, in s.
const RESET_S: f64 = 1.0;

/// Maps device time to loop time.
#[derive(Debug, Clone)]
pub struct DeviceClock {
    modulo_s: f64,
    last: Option<Last>,
    offset_now: f64,
    offset_before: f64,
    window_began_s: f64,
}

#[derive(Debug, Clone, Copy)]
struct Last {
    raw_s: f64,
    unwrapped_s: f64,
    arrived_s: f64,
}

impl DeviceClock {
    /// For a clock that runs round after `modulo_s` seconds.
    pub const fn new(modulo_s: f64) -> Self {
        Self {
            modulo_s,
            last: None,
            offset_now: f64::INFINITY,
            offset_before: f64::INFINITY,
            window_began_s: 0.0,
        }
    }

    /// When the sample was taken, by the loop's clock, and whether the device's clock was reset.
    pub fn taken_at(&mut self, device_s: f64, arrived: Nanos) -> (Nanos, bool) {
        let arrived_s = arrived.seconds();
        let mut reset = false;
        let unwrapped_s = match self.last {
            None => device_s,
            Some(last) => {
                let mut step = device_s - last.raw_s;
                let ours = arrived_s - last.arrived_s;
                // The nearest number of whole turns to what our own clock says.
                step += self.modulo_s * ((ours - step) / self.modulo_s).round();
                reset = (step - ours).abs() > RESET_S;
                last.unwrapped_s + step
            }
        };
        if reset {
            *self = Self::new(self.modulo_s);
        }
        self.last = Some(Last { raw_s: device_s, unwrapped_s, arrived_s });
        if arrived_s - self.window_began_s > WINDOW_S {
            (self.offset_before, self.offset_now, self.window_began_s) =
                (self.offset_now, f64::INFINITY, arrived_s);
        }
        self.offset_now = self.offset_now.min(arrived_s - unwrapped_s);
        let taken = unwrapped_s + self.offset_now.min(self.offset_before);
        (Nanos::from_seconds(taken).min(arrived), reset)
    }
}

/// What a sample counter says of the next sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CounterStep {
    /// A new sample; this many before it were lost.
    New {
        /// Samples that never came.
        lost: u64,
    },
    /// The same sample again.
    Same,
    /// An older sample than one already seen.
    Old,
    /// The counter started anew.
    Reset,
}

/// Follows a sample counter that runs round.
#[derive(Debug, Clone)]
pub struct Counter {
    modulo: u64,
    last: Option<u64>,
    old_in_a_row: u32,
}

/// So many older samples in a row are an instrument that started anew, not a mixed-up order.
const OLD_MEANS_RESET: u32 = 3;

impl Counter {
    /// For a counter that runs round after `modulo` counts.
    pub const fn new(modulo: u64) -> Self {
        Self { modulo, last: None, old_in_a_row: 0 }
    }

    /// What `count` says.
    pub fn step(&mut self, count: u64) -> CounterStep {
        let Some(last) = self.last else {
            self.last = Some(count);
            return CounterStep::New { lost: 0 };
        };
        let ahead = (count + self.modulo - last) % self.modulo;
        if ahead == 0 {
            return CounterStep::Same;
        }
        if ahead > self.modulo / 2 {
            self.old_in_a_row += 1;
            if self.old_in_a_row < OLD_MEANS_RESET {
                return CounterStep::Old;
            }
            *self = Self { last: Some(count), ..Self::new(self.modulo) };
            return CounterStep::Reset;
        }
        self.last = Some(count);
        self.old_in_a_row = 0;
        CounterStep::New { lost: ahead - 1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quickest_answer_gives_the_offset() {
        let mut clock = DeviceClock::new(1e9);
        // The device is 100 s behind; delays are 1, 5 and 2 ms.
        for (device, delay) in [(0.0, 1e-3), (0.01, 5e-3), (0.02, 2e-3)] {
            let arrived = Nanos::from_seconds(100.0 + device + delay);
            let (taken, reset) = clock.taken_at(device, arrived);
            assert!(!reset);
            let error = taken.seconds() - (100.0 + device);
            assert!((0.0..=1.001e-3).contains(&error), "{error}");
        }
    }

    #[test]
    fn a_clock_of_32_bits_of_microseconds_runs_round() {
        let modulo = 4_294.967_296;
        let mut clock = DeviceClock::new(modulo);
        for i in 0..100 {
            let t = f64::from(i) * 100.0;
            let (taken, reset) = clock.taken_at(t % modulo, Nanos::from_seconds(5.0 + t));
            assert!(!reset, "{t}");
            assert!((taken.seconds() - (5.0 + t)).abs() < 1e-3);
        }
    }

    #[test]
    fn a_restarted_device_is_told_and_followed() {
        let mut clock = DeviceClock::new(1e6);
        clock.taken_at(500.0, Nanos::from_seconds(10.0));
        let (taken, reset) = clock.taken_at(0.001, Nanos::from_seconds(10.5));
        assert!(reset);
        assert!((taken.seconds() - 10.5).abs() < 1e-9);
    }

    #[test]
    fn a_sample_that_waited_is_old() {
        let mut clock = DeviceClock::new(1e6);
        clock.taken_at(0.0, Nanos::from_seconds(0.0));
        let (taken, _) = clock.taken_at(0.1, Nanos::from_seconds(0.12));
        assert!((taken.seconds() - 0.1).abs() < 1e-9, "20 ms of delay are age, not time");
    }

    #[test]
    fn counters() {
        let mut counter = Counter::new(65536);
        assert_eq!(counter.step(65534), CounterStep::New { lost: 0 });
        assert_eq!(counter.step(65534), CounterStep::Same);
        assert_eq!(counter.step(1), CounterStep::New { lost: 2 });
        assert_eq!(counter.step(0), CounterStep::Old);
        assert_eq!(counter.step(65535), CounterStep::Old);
        assert_eq!(counter.step(2), CounterStep::New { lost: 0 });
        for _ in 0..2 {
            assert_eq!(counter.step(60000), CounterStep::Old);
        }
        assert_eq!(counter.step(60000), CounterStep::Reset);
        assert_eq!(counter.step(60001), CounterStep::New { lost: 0 });
    }
}
