//! The stage does not slide as fast as it says: a scale, and a slip that grows with speed.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "speed_error",
    place: Place::Instrument,
    in_library: true,
    in_tables: true,
    imitated: true,
    summary: "the true sliding speed is not the one stated",
    parameters: &[Parameter::factor("factor", 0.02, 0.8)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    let speed = contact.speed_m_s;
    contact.speed_m_s = speed * (1.0 + (v[0] - 1.0) * (0.9 + 0.2 * speed / (speed + 0.05)));
}
