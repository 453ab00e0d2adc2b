//! How finger and plate meet over a cycle.

use serde::{Deserialize, Serialize};

/// How finger and plate meet over a cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// The reaction force never reaches zero: `w/2 <= F_n/k_n`.
    FullContact,
    /// Contact is lost and the slider sticks during part of it.
    Intermittent,
    /// Contact is lost and the slider never sticks: `mu' = 1`.
    FullSlip,
}
