//! Studies of many cases, on one machine or on the engine of an institute: a file of cases, an idempotent worker, what it writes,
//! and how that becomes one table. There is no scheduler here: an engine of the institute (`engines`) runs the worker.
//! What is written is Parquet: all but [`file`](mod@file), [`run`] and [`kinds`] need the feature `cases`.
//!
//! | part | holds |
//! |---|---|
//! | [`file`](mod@file) | the file of cases: a header line, and a line a case where the cases do not follow from the header |
//! | [`run`] | runs cases in portions: the one loop of worker, blind score and fault bench |
//! | [`kinds`] | what a case can be, one file each: the inputs that its key is made of, and how it is run |
//! | `study` | a file of cases and the folder of its results, which belong together |
//! | `worker` | runs a range of cases: skipped where it is there, else temporary file, fsync, rename, fsync of the folder |
//! | `shard` | the one format of results: Parquet with its schema and its provenance |
//! | `gather` | all shards as one table, the same bytes whoever ran them; refuses holes, contradictions, mixed versions |
//! | `plan` | what is missing, measured and cut into ranges; how much memory a task needs |
//! | `task_range` | the part of one task of an engine that knows nothing of cases |
//! | `submit` | hands ranges to an engine, follows what comes into the folder, goes on, cancels |
//! | `engines` | one file an engine |
//! | [`adaptive`] | a surrogate whose nodes are chosen where the error is |
//! | `crash_points` | the fault points at which a test kills the worker |

pub mod adaptive;
#[cfg(feature = "cases")]
pub mod crash_points;
#[cfg(feature = "cases")]
pub mod engines;
pub mod file;
#[cfg(feature = "cases")]
pub mod gather;
pub mod kinds;
#[cfg(feature = "cases")]
pub mod plan;
pub mod run;
#[cfg(feature = "cases")]
pub mod shard;
#[cfg(feature = "cases")]
pub mod study;
#[cfg(feature = "cases")]
pub mod submit;
#[cfg(feature = "cases")]
pub mod task_range;
#[cfg(feature = "cases")]
pub mod worker;
