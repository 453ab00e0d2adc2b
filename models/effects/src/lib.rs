//! Candidate effects: what may separate measurements from the baseline model.
//!
//! | module | purpose |
//! |---|---|
//! | [`mod@library`] | the candidate causes, one file each, with the facts that others need of them |
//! | [`effect`] | what a cause is: place, laws, parameters with their priors, needs, aliases, checks |
//! | [`contact`] | the one contact that every cause acts on, and its solvers |
//! | [`mod@own`] | a candidate cause of a user's own, as a table |
//! | [`operating`] | one pass as the table has it; the baseline and the reading |
//! | [`predict`] | the lateral force of a pass under the baseline and any effects |
//! | [`corrected`] | the corrected model that a run loads |
//!
//! An effect changes what the contact is given ([`contact::Contact`]) or what the instruments make of the
//! force ([`operating::SensorError`]); the contact itself is solved in one place. Effects therefore combine, and
//! each nests the baseline exactly. To add one: a file in `library/`, and its line in [`mod@library`]'s list.
//!
//! ```
//! use models::condition::Condition;
//! use muprime_effects::{Active, Baseline, Design, by_name, lateral_force};
//!
//! let baseline = Baseline { mu0: 0.5, normal_stiffness_n_per_m: 3.9e6, lateral_stiffness_n_per_m: 1.5e6 };
//! let design = Design {
//!     duration_s: 60.0,
//!     reference_load_n: 0.25,
//!     reference_speed_m_s: 0.02,
//!     reference_frequency_hz: 27_500.0,
//!     reference_temperature_c: 20.0,
//!     stroke_m: 0.0,
//!     largest_amplitude_m: 2e-6,
//! };
//! let pass = Condition::paper();
//! let effect = by_name("amplitude_miscalibration").ok_or("no effect of that name")?;
//! // The plate moves by half of the set amplitude: friction falls less.
//! let half = [Active { effect, law: 0, theta: &[0.5_f64.ln()] }];
//! let expected = lateral_force(&baseline, &[], &pass, &design);
//! assert!(lateral_force(&baseline, &half, &pass, &design) > expected);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod contact;
pub mod corrected;
pub mod effect;
pub mod library;
pub mod operating;
pub mod own;
pub mod predict;

pub use contact::Contact;
pub use effect::{Acts, Check, Effect, Input, Law, Location, Need, Parameter, Prior, STATED_AT_N};
pub use library::{imitated, known, library, one_cause, twins};
pub use operating::{Baseline, Design, SensorError};
pub use own::{at, by_name, own};
pub use predict::{Active, lateral_force, read};
