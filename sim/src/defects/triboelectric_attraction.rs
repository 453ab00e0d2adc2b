//! Sliding charges the plate, vibration sheds the charge: an attraction that grows with speed, and is shaken off by swing.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "triboelectric_attraction",
    place: Place::Contact,
    in_library: false,
    in_tables: true,
    imitated: false,
    summary: "sliding charges the plate, and the charge attracts the finger",
    parameters: &[Parameter::log("attraction_n", 1e-3, 0.15), Parameter::log("speed_m_s", 5e-3, 5e-2)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    let shed = 1.0 / (1.0 + (2.0 * contact.sine_amplitude_m / 1e-6).powi(2));
    contact.normal_force_n += v[0] * shed * contact.speed_m_s / (contact.speed_m_s + v[1]);
}
