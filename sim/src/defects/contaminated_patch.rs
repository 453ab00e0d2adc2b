//! A patch of the plate is greasy or clean: friction differs there, whatever the vibration.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "contaminated_patch",
    place: Place::Plate,
    in_library: false,
    in_tables: true,
    imitated: false,
    summary: "friction differs on a patch of the plate",
    parameters: &[Parameter::signed("relative_change", 0.01, 0.8), Parameter::linear("centre_m", -0.015, 0.015), Parameter::log("width_m", 2e-3, 8e-3)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, at: &Surroundings, contact: &mut Contact) {
    let bump = (-0.5 * ((at.position_m - v[1]) / v[2]).powi(2)).exp();
    contact.friction *= (1.0 + v[0] * bump).max(0.05);
}
