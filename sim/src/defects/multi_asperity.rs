//! Ridges of unequal height: seven equal shares of a worn surface's heights (a mirrored gamma distribution of shape 2: the
//! tall ones are cut), each its own slider on the one finger, so that the plate leaves them one after another.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[Parameter::log("height_sd_m", 5e-9, 1.5e-6)],
    act: Act::Contact(|v, _, contact| contact.ridge.height_sd_m = v[0]),
    ..DefectKind::cause(DefectSite::Contact, "ridges of unequal height leave the plate one after another")
};
