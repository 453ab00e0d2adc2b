//! Bonds need time: the friction limit of a fresh contact grows as t/(t + tau), second-order kinetics.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "contact_ageing",
    place: Place::Contact,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the friction limit of a fresh contact grows with its age",
    parameters: &[Parameter::log("half_time_s", 1e-8, 3e-5)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    contact.limit.dwell_s = v[0];
}
