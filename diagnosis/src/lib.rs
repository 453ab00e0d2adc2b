//! Where measurement and model disagree, and why: a table of friction passes in, a verdict out.
//!
//! | module | purpose |
//! |---|---|
//! | [`data`] | the table: passes in the order of measurement, and what its design can show |
//! | [`noise`], [`scatter`] | the variance of each pass, from rig.toml, replicates and the table itself: suspects, shifts of runs |
//! | [`constants`], [`progress`], `draws` | tunable constants; progress; repeatable random numbers |
//! | [`law`] | a base law in place of the spring-slider |
//! | [`member`], [`fit`], [`layout`], [`least_squares`] | the regression problem of a hypothesis, its vector of parameters, its fit |
//! | [`gaussian`], [`kernel`] | Gaussian algebra of low rank; smooth functions over the operating space |
//! | [`departure`] | how a hypothesis may depart from its form: smoothly, and by bending what its cause acts on |
//! | [`bases`] | the smooth functions by which it may, on one table |
//! | [`evidence`] | marginal likelihood by Laplace's method, with that departure |
//! | [`recalibration`] | what recalibrating the baseline imitates of a change |
//! | [`discrepancy`] | the open set: a Gaussian-process discrepancy of the baseline |
//! | [`starts`], [`singles`], [`pairs`], [`hypotheses`] | global starts; one cause, two causes, all with their probabilities |
//! | [`left_out`] | extrapolation to left-out regions of the operating space |
//! | [`fitted`], [`decision`] | probabilities; the verdict rule |
//! | [`structure`] | jumps, bumps, periods, memories and other departures that no smooth map follows |
//! | [`intervals`], [`pulls`] | profile intervals; how far the stiffnesses went from their calibration |
//! | [`locate`] | which part of the operating space, and of the rig, carries the gap |
//! | [`shrinkage`], [`predict`], [`novelty`], `run_shifts` | held-out passes; predictions, also in runs |
//! | [`next`], [`power`] | the experiment that separates the leading hypotheses; detectable sizes |
//! | [`reading`] | which reading of the paper's w the passes favour |
//! | [`unstated`] | what conditions must state before the verdict's model predicts them |
//! | [`describe`] | what an unknown departure looks like; causes that are sure all the same |
//! | [`mod@format`] | names and numbers in the sentences of a verdict |
//! | [`timing`] | what the edges in a run's record say of lags and shifts in time |
//! | [`verdict`], [`document`], [`remarks`], [`certificates`], [`saved`] | report, JSON, remarks, model |
//! | [`with_suspects`] | the verdict if suspect passes counted as any other |
//!
//! docs/diagnosis/model.md states the whole model once, with the module of each section. An example:
//!
//! ```
//! use models::pass::read_passes;
//! use muprime_diagnosis::{Verdict, data::{RigFile, Table}, hypotheses::Options, verdict::diagnose};
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

pub mod bases;
pub mod certificates;
pub mod constants;
pub mod data;
pub mod decision;
pub mod departure;
pub mod describe;
pub mod discrepancy;
pub mod document;
mod draws;
pub mod evidence;
pub mod fit;
pub mod fitted;
pub mod format;
pub mod gaussian;
pub mod hypotheses;
pub mod intervals;
pub mod kernel;
pub mod law;
pub mod layout;
pub mod least_squares;
pub mod left_out;
pub mod locate;
pub mod member;
pub mod next;
pub mod noise;
pub mod novelty;
pub mod pairs;
pub mod power;
pub mod predict;
pub mod progress;
pub mod pulls;
pub mod reading;
pub mod recalibration;
pub mod remarks;
mod run_shifts;
pub mod saved;
pub mod scatter;
pub mod shrinkage;
pub mod singles;
pub mod starts;
pub mod structure;
#[cfg(test)]
mod tests;
pub mod timing;
pub mod unstated;
pub mod verdict;
pub mod with_suspects;

pub use decision::Verdict;
