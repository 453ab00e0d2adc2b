//! muprime: the controller of a hardware-in-the-loop tribometer.
//!
//! | room | purpose |
//! |---|---|
//! | [`setup`], [`plan`], [`fingertip`] | what people write: rigs, plans, fingertips, all checked with the place in the file |
//! | [`check`] | what is wrong with any file, and whether a plan can run on a setup |
//! | [`certificates`] | a setup's certificates, verified and applied once |
//! | [`rehearsal`] | a profile tried before any instrument is |
//! | [`doctor`] | the instruments of a setup, looked at as a run would and judged by what it needs |
//! | [`embed`] | a virtual rig's instruments where the setup looks for them |
//! | [`sequence`] | the order of a sweep, a pure state machine over rows |
//! | [`supervisor`] | the one way to lead a loop: it stops first, switches off, reads back |
//! | [`claim`], [`exposure`] | one controller a rig; what a human finger has had, carried from run to run |
//! | [`dashboard`] | the rig in a browser: one more viewer (feature `dashboard`) |
//! | [`dead_man_key`] | a key held at the terminal, for trials |
//! | [`session`] | a sweep from beginning to end, in wall-clock or in virtual time |
//! | [`run_dir`], [`catalogue`] | a run's folder and the catalogue of runs |
//! | [`figures`] | the paper's figures recomputed |
//! | [`files`], [`mod@print`] | how files are written, and how the program speaks: each in one place |
//! | [`live`] | a run while it goes on: one feed, and viewers that read it |
//! | [`terminal`], [`watch`] | the terminal taken and given back; the live view on it |
//! | [`publish`] | what happens at a rig, by MQTT, read only |
//! | `cases` | studies past one machine: cases, an idempotent worker, engines, one table (feature `parquet`) |
//! | [`progress`] | long computations at a terminal: bars, and what there is so far on Ctrl-C |
//! | [`compare`] | two runs side by side: whether they differ, and in what |
//! | [`report`], [`export`] | what people look at and take elsewhere |
//! | [`mod@import`] | foreign tables made into point tables |
//! | [`model_file`] | a corrected model from its file to the loop |
//! | [`input`] | files that people wrote, refused with the place |
//! | [`validation`] | the blind score of the diagnosis, and the fault bench of the controller |
//! | [`version`] | what this program is: the build, and the models that it holds |
//! | [`words`] | schemas, the reference of all keys, commented beginnings, what is bundled |
//! | [`cli`] | one file a subcommand |
//!
//! ```
//! use muprime_rig::plan::Plan;
//! use muprime_rig::setup::Setup;
//!
//! let setup = Setup::load("virtual-ideal")?;
//! assert!(!setup.instruments().force.is_empty());
//! // What people write is refused with the place and the remedy, and nothing is touched.
//! let refused = Plan::parse("plan.toml", "name = 'p'\nspeed = 1").err().unwrap();
//! assert!(format!("{refused:?}").contains("speed"));
//! # Ok::<(), miette::Report>(())
//! ```

#![deny(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "parquet")]
pub mod ambient;
pub mod cases;
pub mod catalogue;
pub mod certificates;
pub mod check;
pub mod claim;
pub mod cli;
pub mod compare;
pub mod dashboard;
pub mod dead_man_key;
pub mod doctor;
pub mod embed;
pub mod export;
pub mod exposure;
pub mod figures;
pub mod files;
pub mod fingertip;
pub mod import;
pub mod input;
pub mod live;
pub mod model_file;
pub mod plan;
pub mod print;
pub mod progress;
pub mod publish;
pub mod rehearsal;
pub mod report;
pub mod run_dir;
pub mod sequence;
pub mod session;
pub mod setup;
pub mod supervisor;
pub mod terminal;
pub mod validation;
pub mod version;
pub mod watch;
pub mod words;
