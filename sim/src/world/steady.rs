//! The world without time: what a steady pass would show. The ticking world and the sealed tables stand on it.

use crate::contact::Contact;
use crate::defects::{Defects, Forces, Surroundings};
use crate::finger::VirtualFinger;

/// A steady operating point as the world knows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// The circumstances.
    pub at: Surroundings,
    /// Peak-to-peak amplitude that the amplifier knows of (m).
    pub known_pp_m: f64,
    /// Speed that the stage knows of (m/s).
    pub speed_m_s: f64,
}

/// The contact at a point, with all that is wrong with it.
pub fn steady_contact(finger: &VirtualFinger, defects: &Defects, point: &Point) -> Contact {
    let pp = if point.known_pp_m > 0.0 { defects.plate(&point.at, point.known_pp_m).max(0.0) } else { 0.0 };
    let amplitude = models::quantity::PeakToPeak::from_metres(pp);
    let mut contact = finger.contact(
        amplitude.sine_amplitude_m(),
        point.at.frequency_hz,
        point.speed_m_s,
        point.at.normal_force_n,
    );
    defects.contact(&point.at, &mut contact);
    contact
}

/// The mean forces in the sensor's frame at a point, without noise.
pub fn steady_forces(finger: &VirtualFinger, defects: &Defects, point: &Point) -> Forces {
    let friction = steady_contact(finger, defects, point).steady().lateral_force_n;
    let mut forces = Forces { lateral_n: point.at.direction * friction, normal_n: point.at.normal_force_n };
    defects.forces(&point.at, &mut forces);
    forces
}
