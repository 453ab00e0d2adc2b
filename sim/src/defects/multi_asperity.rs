//! Ridges of unequal height: seven equal shares of a worn surface's heights (a mirrored gamma distribution of shape 2: the
//! tall ones are cut), each its own slider on the one finger, so that the plate leaves them one after another.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "multi_asperity",
    place: Place::Contact,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "ridges of unequal height leave the plate one after another",
    parameters: &[Parameter::log("height_sd_m", 5e-9, 1.5e-6)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    contact.ridge.height_sd_m = v[0];
}
