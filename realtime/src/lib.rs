//! The cyclic loop: ports, safety, estimation, comparison, recording.
