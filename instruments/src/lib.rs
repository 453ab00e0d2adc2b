//! Instrument profiles, codecs and golden vectors.
//!
//! One TOML file describes an instrument: its link, its frames, the signals in them, the set-points
//! it takes, its faults, and golden byte vectors. The driver (crate `rig`), the emulator (crate
//! `sim`) and the generated documentation all stand on that one description, so they cannot drift
//! apart; the vectors and the independent peers of the system tests say whether it is right.
//!
//! This crate is pure: bytes in, values out. It knows no socket, no clock and no file.
//!
//! | room | purpose |
//! |---|---|
//! | [`schema`] | what may stand in a profile: the serde types, one field a key |
//! | [`profile`] | a profile that was read, checked and compiled: names became indices |
//! | [`expression`] | the tiny total language of `when`, `valid_when` and `scale_expr` |
//! | [`field`] | one number in a frame: type, byte order, bit range |
//! | [`codec`] | frames of the wires themselves |
//! | [`vector`] | golden vectors: bytes beside the values they stand for |
//! | [`document`] | a profile as a page for people |
//! | [`error`] | what is wrong with a profile, where, and what to do |

pub mod bus;
pub mod codec;
pub mod document;
pub mod error;
pub mod expression;
pub mod field;
pub mod profile;
pub mod schema;
pub mod vector;

pub use error::ProfileError;
pub use profile::{FrameId, Profile, SetId, SignalId, Values};
