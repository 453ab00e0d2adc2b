//! Where measurement and model disagree, and why: a table of friction passes in, a verdict out.
//!
//! | module | purpose |
//! |---|---|
//! | [`data`] | the table: passes in the order of measurement, and what its design can show |
//! | [`base_law`] | a base law in place of the spring-slider |
//! | [`scatter`] | the variance of each pass, from rig.toml, replicates and the table: suspects, shifts of runs |
//! | [`regression`] | the fit of one hypothesis, its smooth departure from its form, its evidence |
//! | [`hypotheses`] | no gap, one cause, two causes and the open set, with their probabilities |
//! | [`verdict`] | the answer and the rule that gives it; extrapolation to left-out regions |
//! | [`report`] | beside the answer: where, how far, intervals, what next; JSON, sentences, saved model |
//! | [`constants`], [`progress`], `random` | tunable constants; progress; repeatable random numbers |
//!
//! docs/diagnosis/model.md states the whole model once, with the module of each section. An example:
//!
//! ```
//! use models::pass::read_passes;
//! use muprime_diagnosis::{Verdict, data::{RigFile, Table}, hypotheses::Options, report::diagnose};
//!
//! // Twelve passes of a plate that stands still: friction of 0.5 N/N in both directions, repeatable to half a per cent.
//! let mut csv = String::from("point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n\n");
//! for i in 0..12 {
//!     let (direction, load) = (if i % 2 == 0 { 1.0 } else { -1.0 }, 0.2 + 0.05 * (i % 4) as f64);
//!     let force = 0.5 * load * direction * (1.0 + 0.005 * [1.0, -1.0, -1.0, 1.0, 0.0][i % 5]);
//!     csv += &format!("{i},{},0,27500,0.02,{direction},0.01,{load},{force}\n", 5 * i);
//! }
//! let rig = RigFile { finger: models::finger::Finger::paper(), noise: Default::default(), calibration: Default::default() };
//! let table = Table::measured(&read_passes(csv.as_bytes())?)?;
//! let diagnosis = diagnose(&table, &rig, &Options::default(), String::new());
//! assert_eq!(diagnosis.report.verdict, Verdict::NoGap);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod base_law;
pub mod constants;
pub mod data;
pub mod hypotheses;
pub mod progress;
mod random;
pub mod regression;
pub mod report;
pub mod scatter;
#[cfg(test)]
mod tests;
pub mod verdict;

pub use data::Table;
pub use hypotheses::Options;
pub use report::{Diagnosis, Hypothesis, Report, diagnose, predict::Forecast};
pub use verdict::Verdict;
