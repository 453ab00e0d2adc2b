//! Where simulation and reality part, and why.
//!
//! [`data`] takes the table, [`noise`] settles the variance of each pass, [`hypotheses`] fits every candidate
//! cause and the open set, [`shrink`] asks how each does on passes it has not seen.

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
pub mod shrink;
pub mod smooth;
pub mod verdict;
pub mod wildcard;
