//! muprime: the controller of a hardware-in-the-loop tribometer.
pub mod drivers;
