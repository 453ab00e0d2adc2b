//! A friction sweep without an instrument: what people write, the order of the passes, virtual time, the run's folder, the report.
//!
//! No instrument and no loop in wall-clock time is here: the crate `rig` runs the same sweep over
//! instruments. Downstream: `input` -> `setup`, `plan` -> `certificates` -> `sweep`, `supervisor` ->
//! `job` -> `run_dir` -> `run_data` -> `report`.
//!
//! | module | purpose |
//! |---|---|
//! | [`input`], [`parse_quantity`], [`files`] | files of people, refused with their place; units; files that are written |
//! | [`mod@format`] | quantities as people read them |
//! | [`mod@print`], [`exit`], [`version`] | how the program prints, and ends; the build and its models |
//! | [`setup`], [`plan`], [`fingertip`] | rigs, plans, fingertips, all checked with the place in the file |
//! | [`bundled`] | those that come with the program, by name |
//! | [`campaign`] | one plan with several tips, conditions and days: its sessions in their order |
//! | [`certificates`], [`model_file`] | a setup's certificates, verified and applied once; a corrected model from its file to the loop |
//! | [`profile_trial`] | a profile tried before any instrument is |
//! | [`sweep`] | the steps of a sweep through its passes: a pure state machine over the loop's rows |
//! | [`supervisor`] | the one way to lead a loop: stop first, switch off, read back; and the loop in virtual time |
//! | [`job`] | a sweep from its job to its summary, in virtual time |
//! | [`ambient`], [`exposure_left`] | levels of the air, set and read; what is left of a finger's exposure |
//! | [`run_dir`], [`run_data`], [`catalogue`] | a run's folder; the run as read from there; the list of runs |
//! | [`report`], [`compare`], [`fidelity`] | pages; runs side by side; how faithfully a target was rendered |
//! | [`edges`] | the steps and turns in a run's record, for what a verdict says of time |
//! | [`verdict_text`] | a verdict as text for people at a terminal, and the plan of the next experiment |
//!
//! ```
//! use muprime_runs::plan::Plan;
//! use muprime_runs::setup::Setup;
//!
//! let setup = Setup::load("virtual-ideal")?;
//! assert!(!setup.instruments().force.is_empty());
//! // Bad input is refused with its place and the remedy, and nothing is touched.
//! let refused = Plan::parse("plan.toml", "name = 'p'\nspeed = 1").err().unwrap();
//! assert!(format!("{refused:?}").contains("speed"));
//! # Ok::<(), miette::Report>(())
//! ```

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod ambient;
pub mod bundled;
pub mod campaign;
pub mod catalogue;
pub mod certificates;
pub mod compare;
pub mod edges;
pub mod exit;
pub mod exposure_left;
pub mod fidelity;
pub mod files;
pub mod fingertip;
pub mod format;
pub mod input;
pub mod job;
pub mod model_file;
pub mod parse_quantity;
pub mod plan;
pub mod print;
pub mod profile_trial;
pub mod report;
pub mod run_data;
pub mod run_dir;
pub mod setup;
pub mod supervisor;
pub mod sweep;
pub mod verdict_text;
pub mod version;

pub use job::{Job, Signals, Summary};
pub use plan::Plan;
pub use run_data::RunData;
pub use setup::Setup;
pub use sweep::{Event, MeasuredPass, Outcome, Sweep};
