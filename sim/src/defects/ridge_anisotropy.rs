//! Ridges lean: they are stiffer when stroked one way than the other, as fur is.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "ridge_anisotropy",
    place: Place::Finger,
    in_library: false,
    in_tables: true,
    imitated: false,
    summary: "ridges are stiffer in one direction than in the other",
    parameters: &[Parameter::signed("asymmetry", 0.02, 0.8)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, at: &Surroundings, contact: &mut Contact) {
    contact.lateral_stiffness_n_per_m *= (v[0] * at.direction).exp();
}
