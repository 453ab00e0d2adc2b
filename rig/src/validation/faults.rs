//! Controller, virtual rig and faults in virtual time, from one seed: each fault of the list strikes in each phase, and
//! the reaction is held against its bound.
//!
//! `rows` is the list, `bench` runs one scene, `search` runs many seeds over all cores and makes a failure small.

pub mod bench;
pub mod rows;
pub mod search;
mod tamper;

pub use bench::{Core, Found, Scene, Strike, run, run_with};
pub use rows::{ELSEWHERE, Expect, FaultRow, Moment, Pace, ROWS};
pub use search::{Search, Tally, search};
