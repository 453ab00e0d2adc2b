//! The zero of the normal force is off: the contact is loaded by the true force, the table holds another. The
//! zero sinks in part while the finger warms the sensor.

use super::{Act, Forces, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "normal_offset",
    place: Place::Instrument,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the zero of the normal force is off",
    parameters: &[Parameter::signed("offset_n", 1.5e-3, 0.12), Parameter::linear("sinking", 0.1, 0.5)],
    act: Act { setup: None, plate: None, contact: None, forces: Some(act) },
};

fn act(v: &Values, at: &Surroundings, forces: &mut Forces) {
    forces.normal_n += v[0] * (1.0 - v[1] * (1.0 - (-at.time_s / 200.0).exp()));
}
