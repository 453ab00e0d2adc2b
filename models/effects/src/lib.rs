//! Candidate effects that nest the baseline model.
