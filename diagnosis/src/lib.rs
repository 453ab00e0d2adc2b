//! Where simulation and reality part, and why.
