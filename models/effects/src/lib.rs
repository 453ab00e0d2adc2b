//! Candidate effects: what may part reality from the baseline model.
//!
//! | room | purpose |
//! |---|---|
//! | [`library`] | the candidate causes, one file each, with the facts that others need of them |
//! | [`effect`] | what a cause is: place, laws, parameters with their priors, needs, aliases, checks |
//! | [`contact`] | the one contact that every cause acts on, and its solvers |
//! | [`operating`] | one pass as the table has it; the baseline and the reading |
//! | [`predict`] | the lateral force of a pass under the baseline and any effects |
//! | [`corrected`] | the corrected model that a run loads |
//! | [`listing`] | the library as data |
//!
//! An effect changes what the contact is given ([`contact::Contact`]) or what the instruments make of the
//! force ([`operating::Reading`]); the contact itself is solved in one place. Effects therefore combine, and
//! each nests the baseline exactly. To add one: a file in `library/`, and its line in [`library`]'s list.

pub mod contact;
pub mod corrected;
pub mod effect;
pub mod library;
pub mod listing;
pub mod operating;
pub mod predict;

pub use effect::{Check, Effect, Law, Need, Parameter, Place, Prior};
pub use library::{by_name, imitated, known, library, near, one_cause, twins};
pub use operating::{Baseline, Design, Reading};
pub use predict::{Active, lateral_force};
