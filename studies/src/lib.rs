//! Studies: many cases, one table.
//!
//! | module | purpose |
//! |---|---|
//! | [`cases`] | many cases: here at once, or an idempotent worker, engines, one table (feature `cases`) |
//! | [`campaign`] | the claims of a campaign, and its page |
//! | [`validation`] | the blind score of the diagnosis, and the fault bench of the controller |
//! | [`figures`] | the paper's figures recomputed |
//! | [`progress`] | long computations at a terminal: bars, and what there is so far on Ctrl-C |

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod campaign;
pub mod cases;
pub mod figures;
pub mod progress;
pub mod validation;
