//! Controller, virtual rig and faults in virtual time, from one seed: each fault of the list strikes in each
//! phase, and the reaction is compared with its bound.
//!
//! `rows` is the list, `scene` runs one, `search` draws scenes, tallies many of them
//! and makes a failure small.

pub mod rows;
pub mod scene;
pub mod search;
mod tamper;

pub use rows::{Expect, FaultRow, Moment, Pace, ROWS};
use runs::out;
pub use scene::{Core, Scene, SceneResult, Strike, run, run_with};
pub use search::Tally;

/// Worst reactions beside their bounds, in cycles of 1 ms.
pub fn table(tally: &Tally) {
    out!("  # fault                          phase    runs  command off / bound  measured off / bound (ms)");
    for ((number, name, moment), r) in &tally.reactions {
        let moment = format!("{moment:?}").to_lowercase();
        let cells = match r.command_bound {
            None => "no trip due".to_string(),
            Some(bound) => {
                let cell = |n: Option<u64>| n.map_or_else(|| "-".into(), |n| n.to_string());
                format!(
                    "{:>11} / {bound:<5} {:>14} / {}",
                    cell(r.command_off),
                    cell(r.measured_off),
                    r.measured_bound
                )
            }
        };
        out!("{number:>3} {name:<30} {moment:<7} {:>6}  {cells}", r.runs);
    }
}
