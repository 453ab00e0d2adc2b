//! The virtual rig: an independent world in the time domain, with what can be wrong with it.
//!
//! | module | purpose |
//! |---|---|
//! | [`world`] | composes the bodies and steps them, in virtual or wall-clock time |
//! | [`finger`], [`plate`], [`amplifier`], [`sensor`], [`stage`] | one body each |
//! | [`contact`] | ridge on vibrating plate: exact, sampled, resolved, averaged |
//! | [`channel`], [`room`] | the way from an instrument to its reader; the air around the rig |
//! | [`defects`] | what can be wrong with this world, one kind a file |
//! | [`sealed`] | point tables whose cause only a label knows, and the oracle |
//! | [`virtual_rig`] | the loop's three ports in process and in virtual time |
//! | [`noise`] | named streams of random numbers |
//! | [`wire`] | the same world behind real protocols |
//!
//! ```
//! use muprime_sim::virtual_rig::VirtualRig;
//! use muprime_sim::world::WorldConfig;
//! use realtime::ports::{ForceSensor, Nanos};
//!
//! let mut rig = VirtualRig::new(&WorldConfig::ideal(), 1)?;
//! // Virtual time is what the caller says it is; the finger has not touched the plate yet.
//! let forces = rig.read(Nanos::from_seconds(0.1));
//! assert!(forces.normal.is_ok_and(|reading| reading.value.abs() < 0.05));
//! # Ok::<(), muprime_sim::world::ConfigError>(())
//! ```
//!
//! It shares nouns with `models` and nothing else: no friction law of the project's is called here.

pub mod amplifier;
pub mod channel;
pub mod contact;
pub mod defects;
pub mod finger;
pub mod noise;
pub mod plate;
pub mod room;
pub mod sealed;
pub mod sensor;
pub mod stage;
pub mod virtual_rig;
pub mod wire;
pub mod world;
