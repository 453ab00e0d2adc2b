//! What validates, apart from what runs: the diagnosis scored on sealed sets, and the controller struck with faults.
//!
//! Nothing that drives a rig depends on this module.

pub mod blind;
pub mod faults;
