//! The sensor's axes talk to each other: a share of the normal force shows in the lateral channel, and less
//! of the lateral one in the normal channel.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::signed("lateral_per_normal", 0.0015, 0.15),
        Parameter::linear("normal_per_lateral", 0.0, 0.02),
    ],
    imitated: true,
    act: Act::Forces(|v, _, forces| {
        let Forces { lateral_n, normal_n } = *forces;
        forces.lateral_n = lateral_n + v[0] * normal_n;
        forces.normal_n = normal_n + v[1] * lateral_n;
    }),
    ..DefectKind::cause(DefectSite::Instrument, "a share of each force shows in the other channel")
};
