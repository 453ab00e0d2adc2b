//! The lateral zero is off and settles as the sensor warms: an offset that relaxes exponentially to another.

use super::{Act, Forces, Kind, Parameter, Place, Surroundings, Values};

pub(super) static KIND: Kind = Kind {
    name: "lateral_offset_drift",
    place: Place::Instrument,
    in_library: true,
    in_tables: true,
    imitated: false,
    summary: "the zero of the lateral force is off and drifts",
    parameters: &[Parameter::signed("end_n", 4e-4, 0.04), Parameter::linear("start_over_end", -1.0, 1.0), Parameter::log("time_s", 40.0, 600.0)],
    act: Act { setup: None, plate: None, contact: None, forces: Some(act) },
};

fn act(v: &Values, at: &Surroundings, forces: &mut Forces) {
    let settled = 1.0 - (-at.time_s / v[2]).exp();
    forces.lateral_n += v[0] * (v[1] + (1.0 - v[1]) * settled);
}
