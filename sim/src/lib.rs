//! The virtual rig: an independent time-domain world.
pub mod contact;
