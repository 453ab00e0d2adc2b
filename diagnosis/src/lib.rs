//! Where simulation and reality part, and why.
//!
//! [`data`] takes the table, [`noise`] settles the variance of each pass, [`hypotheses`] weighs every candidate cause
//! ([`singles`], [`pairs`]) and the open set ([`wildcard`]), [`shrink`] asks how each does on passes it has not seen,
//! [`attribute`] decides, [`verdict`] says it, [`saved`] gives the rig its corrected model.

pub mod attribute;
pub mod data;
pub mod evidence;
#[cfg(test)]
mod example;
pub mod explore;
pub mod fit;
pub mod held_out;
pub mod hypotheses;
pub mod intervals;
pub mod linear;
pub mod locate;
pub mod next;
pub mod noise;
pub mod pairs;
pub mod predict;
pub mod pulls;
pub mod saved;
pub mod shrink;
pub mod singles;
pub mod smooth;
pub mod verdict;
pub mod wildcard;
