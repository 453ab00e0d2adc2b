//! What happens while the rig runs: the cyclic loop and everything it may touch.
//!
//! | room | purpose |
//! |---|---|
//! | [`ports`] | the seams `ForceSensor`, `Amplifier`, `Stage`; `Reading`, and `NoData` with its reason |
//! | [`cycle`] | pure `step`: commands, safety, estimate, comparison |
//! | [`safety`] | limits, the state machine, the only maker of a [`safety::DriveCommand`] |
//! | [`estimate`] | `mu`, `mu'` with uncertainty and age; means over a pass |
//! | [`compare`] | residuals against the model; the test that says when it has left the measurement |
//! | [`turn`] | one turn of the loop over real ports; the row that it leaves behind |
//! | [`pacing`] | the thread: absolute deadlines, priority, memory lock, lateness histogram |
//! | [`recorder`] | rows, passes and events as MCAP; tolerant reading and recovery |
//!
//! The wall clock is forbidden here, and the monotonic clock is read in `pacing` alone.

pub mod compare;
pub mod cycle;
pub mod estimate;
pub mod pacing;
pub mod ports;
pub mod recorder;
pub mod safety;
pub mod turn;
