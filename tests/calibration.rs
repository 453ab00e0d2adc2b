//! Calibrations on the virtual rig: what was withheld is recovered within the stated intervals, over trials
//! whose seeds were fixed beforehand; what is unfit is refused with the reason.
//!
//! `cargo test --release -p muprime-tests --test calibration -- --nocapture` prints coverage and interval lengths.

#[path = "calibration/absorbed.rs"]
mod absorbed;
#[path = "calibration/amplitude.rs"]
mod amplitude;
#[path = "calibration/bench.rs"]
mod bench;
#[path = "calibration/bound.rs"]
mod bound;
#[path = "calibration/closing.rs"]
mod closing;
#[path = "calibration/finger.rs"]
mod finger;
#[path = "calibration/force.rs"]
mod force;
#[path = "calibration/latency.rs"]
mod latency;
#[path = "calibration/phase.rs"]
mod phase;
#[path = "calibration/refusals.rs"]
mod refusals;
#[path = "calibration/sensor.rs"]
mod sensor;
#[path = "calibration/whole.rs"]
mod whole;
