//! The amplifier's supply hums: the amplitude swings at twice the mains frequency, far slower than the plate and far faster
//! than a pass, and friction is the mean over it. It is worst at low set-points, where the supply is least loaded.

use super::{Act, Kind, Parameter, Place, Surroundings, Values};
use crate::contact::Contact;

pub(super) static KIND: Kind = Kind {
    name: "mains_modulation",
    place: Place::Plate,
    in_library: false,
    in_tables: true,
    imitated: false,
    summary: "the amplitude is modulated at twice the mains frequency",
    parameters: &[Parameter::log("depth", 0.05, 0.95), Parameter::log("corner_m", 6e-6, 3e-5)],
    act: Act { setup: None, plate: None, contact: Some(act), forces: None },
};

fn act(v: &Values, _: &Surroundings, contact: &mut Contact) {
    let pp = 2.0 * contact.sine_amplitude_m;
    contact.motion.modulation = (v[0] / (1.0 + pp / v[1])).min(0.95);
}
