//! The lateral gain is wrong. In a table of means mu0 takes it up, and what is left looks like another lateral stiffness.

use super::{Act, Forces, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "lateral_gain",
    place: Place::Instrument,
    in_library: true,
    in_tables: false,
    imitated: false,
    summary: "the gain of the lateral force is wrong",
    parameters: &[Parameter::factor("factor", 0.03, 0.5)],
    act: Act { setup: None, plate: None, contact: None, forces: Some(act) },
};

fn act(v: &Values, _: &Surroundings, forces: &mut Forces) {
    forces.lateral_n *= v[0];
}
