//! Frames of the wires: one file a protocol.
