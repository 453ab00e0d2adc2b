//! Stiffnesses that are not the nominal ones, beyond their stated scatter. What changed the normal one (modulus, area,
//! thickness) changes the lateral one by some power of it.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "stiffness_error",
    place: Place::Finger,
    in_library: true,
    in_tables: true,
    summary: "the true stiffnesses are far from the nominal ones",
    parameters: &[Parameter::factor("normal_factor", 0.04, 1.8), Parameter::linear("lateral_exponent", -0.5, 1.5)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    contact.normal_stiffness_n_per_m *= v[0];
    contact.lateral_stiffness_n_per_m *= v[0].powf(v[1]);
}
