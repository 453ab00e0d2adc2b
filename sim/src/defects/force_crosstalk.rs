//! The sensor's axes talk to each other: a share of the normal force shows in the lateral channel, and less
//! of the lateral one in the normal channel.

use super::{Act, Forces, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "force_crosstalk",
    place: Place::Instrument,
    in_library: true,
    in_tables: true,
    imitated: true,
    summary: "a share of each force shows in the other channel",
    parameters: &[Parameter::signed("lateral_per_normal", 0.0015, 0.15), Parameter::linear("normal_per_lateral", 0.0, 0.02)],
    act: Act { setup: None, plate: None, contact: None, forces: Some(act) },
};

fn act(v: &Values, _: &Surroundings, forces: &mut Forces) {
    let Forces { lateral_n, normal_n } = *forces;
    forces.lateral_n = lateral_n + v[0] * normal_n;
    forces.normal_n = normal_n + v[1] * lateral_n;
}
