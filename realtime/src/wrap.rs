//! Ports around ports. The loop cannot tell a wrapped port from a bare one.

pub mod fault;
