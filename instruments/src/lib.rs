//! Instrument profiles, codecs and golden vectors.
