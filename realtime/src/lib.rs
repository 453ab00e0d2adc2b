//! What happens while the rig runs: the cyclic loop and everything it may touch.
//!
//! | module | purpose |
//! |---|---|
//! | [`ports`], `signals` | the seams `ForceSensor`, `Amplifier`, `Stage`, `SupplySwitch`, `SafetyInputs`; `Sample`, and `NoData` with its reason |
//! | [`cycle`] | pure `step`: commands, safety, estimate, comparison |
//! | [`safety`] | limits, the state machine, the only maker of a [`safety::DriveCommand`] |
//! | [`estimate`] | `mu`, `mu'` with uncertainty and age; means over a pass |
//! | [`compare`] | residuals against the model; the test that says when they disagree |
//! | [`render`] | the amplitude of the next cycle for a wanted friction |
//! | [`cycle_io`] | one cycle of the loop over real ports; the row that it leaves behind |
//! | [`pacing`] | the thread: absolute deadlines, lateness histogram; in `pacing/machine.rs` what it asks of the machine |
//! | [`clock`] | time of drivers, loop and virtual world; a virtual rig's can be held |
//! | [`queue`] | commands to the loop; a stop waits behind nothing |
//! | [`fault`] | ports around ports that the loop cannot tell from bare ones: faults |
//! | [`stall_monitor`], [`threads`] | when ordinary threads of the machine could not run; starting threads |
//! | [`replay`] | recorded cycles through the same code again |
//! | [`recorder`], `number` | rows, passes, events as MCAP, infinite numbers too; tolerant reading, recovery |
//!
//! ```
//! use muprime_realtime::ports::Nanos;
//! use muprime_realtime::safety::Limits;
//!
//! // A setup may narrow the limits, and widen them up to bounds that are compiled in.
//! let mut limits = Limits::paper(Nanos(1_000_000));
//! limits.normal_force_max_n = 4.0;
//! assert!(limits.checked().is_ok());
//! limits.normal_force_max_n = 40.0;
//! assert!(limits.checked().is_err());
//! ```
//!
//! The wall clock is forbidden here, and the monotonic clock is read by `pacing` and `clock` alone.

pub mod clock;
pub mod compare;
pub mod cycle;
pub mod cycle_io;
pub mod estimate;
pub mod fault;
mod number;
pub mod pacing;
pub mod ports;
pub mod queue;
pub mod recorder;
pub mod render;
pub mod replay;
pub mod safety;
mod signals;
pub mod stall_monitor;
pub mod threads;

pub use clock::Clock;
pub use cycle::{Command, Phase};
pub use cycle_io::{Ports, Row};
pub use ports::Nanos;
pub use safety::{Limits, TripCause};
