//! Calibrations over real links, as an operator takes them: weighed, looked at, interrupted.

#[path = "calibration/interrupted.rs"]
mod interrupted;
#[path = "calibration/vibrometer.rs"]
mod vibrometer;
#[path = "calibration/wire.rs"]
mod wire;
