//! The controller: a sweep over instruments, in wall-clock time, and the person at the rig. The one crate that needs Linux.
//!
//! | module | purpose |
//! |---|---|
//! | [`wall_clock_run`] | a sweep over instruments from beginning to end |
//! | [`wall_clock_loop`] | the loop in wall-clock time: a thread of its own, instruments behind links |
//! | [`emulators`] | a virtual rig's instruments where the setup looks for them |
//! | [`rig_lock`], [`exposure`] | one controller a rig; a finger's exposure, carried from run to run |
//! | [`dead_man_key`] | a key held at the terminal, for trials |
//! | [`live_calibration`] | calibrations with the instruments at hand |
//! | [`doctor`], [`free_ports`] | instruments and computer as a run needs them; ports that are in use |
//! | [`live`] | a run while it goes on: one feed, and viewers that read it |
//! | [`terminal`], [`watch`] | the terminal taken and given back; the live view on it |
//! | [`dashboard`] | the rig in a browser: one more viewer (feature `dashboard`) |
//! | [`publish`] | what happens at a rig, by MQTT, read only (feature `mqtt`) |

#![deny(clippy::print_stdout, clippy::print_stderr)]

pub mod dashboard;
pub mod dead_man_key;
pub mod doctor;
pub mod emulators;
pub mod exposure;
pub mod free_ports;
pub mod live;
pub mod live_calibration;
pub mod publish;
pub mod rig_lock;
pub mod terminal;
pub mod wall_clock_loop;
pub mod wall_clock_run;
pub mod watch;
