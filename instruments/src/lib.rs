//! Instrument profiles, codecs and golden vectors.
//!
//! One TOML file describes an instrument: its link, its frames, the signals in them, the set-points
//! it takes, its faults, and golden byte vectors. The profiles themselves are files in drivers/profiles. The
//! driver (crate `drivers`), the emulator (crate `sim`) and the generated documentation all use that one
//! description; the vectors and the independent peers of the system tests say whether it is right.
//!
//! This crate is pure: bytes in, values out. It opens no socket or file; a deadline is an argument.
//!
//! | module | purpose |
//! |---|---|
//! | [`schema`] | what may stand in a profile: the serde types, one field a key |
//! | [`profile`] | a profile that was read, checked and compiled: names became indices |
//! | [`expression`] | the tiny total language of `when`, `valid_when` and `scale_expr` |
//! | [`field`] | one number in a frame: type, byte order, bit range |
//! | [`codec`] | frames of the wires themselves |
//! | [`bus`] | the seam of a CAN bus: frames, and what a bus may report instead |
//! | [`vector`] | golden vectors: bytes beside the values they stand for |
//! | [`traffic`] | the share of a line that samples take |
//! | [`document`] | a profile as a page for people |
//! | [`units`] | names of units, in profiles and in foreign tables, with their factors to SI |
//! | [`error`] | what is wrong with a profile, where, and what to do |
//!
//! ```
//! use muprime_instruments::Profile;
//!
//! let profile = Profile::parse(r#"
//!     [profile]
//!     schema = 1
//!     id = "a-cell"
//!     maker = "A maker"
//!     models = ["one axis"]
//!     roles = ["force.normal"]
//!     provenance = "its manual, page 12"
//!     verified = "emulator-only"
//!     [link]
//!     kind = "modbus_tcp"
//!     [[poll]]
//!     name = "sample"
//!     address = 0
//!     count = 2
//!     rate_hz = 500
//!     [[signal]]
//!     name = "normal"
//!     register = 0
//!     type = "i32"
//!     scale = 1e-5
//!     unit = "N"
//!     si = { factor = 1.0, unit = "N" }
//!     range = [-20.0, 20.0]
//!     [[vector]]
//!     registers = [0, 25000]
//!     expect = { normal = 0.25 }
//! "#)?;
//! let (sample, normal) = (profile.frame("sample").unwrap(), profile.signal("normal").unwrap());
//! let mut values = profile.values();
//! profile.decode(sample, &[0x00, 0x00, 0x61, 0xA8], &mut values)?;
//! assert_eq!(profile.si(normal, &values), 0.25);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod bus;
pub mod codec;
pub mod document;
pub mod error;
pub mod expression;
pub mod field;
pub mod profile;
pub mod schema;
pub mod traffic;
pub mod units;
pub mod vector;

pub use bus::{CanEvent, CanPort};
pub use codec::can::CanFrame;
pub use error::ProfileError;
pub use profile::{FrameId, FrameKind, Profile, SetId, SignalId, Values};
pub use schema::LinkKind;
pub use units::{Dimension, Unit};
