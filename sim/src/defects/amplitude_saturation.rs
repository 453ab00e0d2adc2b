//! The drive runs out of current and clips: the plate, a resonator, follows the fundamental of what is left,
//! whose ceiling falls as the frequency rises, for a piezo draws current in proportion to both.

use super::*;

pub(super) const KIND: DefectKind = DefectKind {
    parameters: &[
        Parameter::log("inverse_ceiling_at_25_khz_per_m", 1.2e5, 1.5e6),
        Parameter::linear("frequency_exponent", 0.3, 1.0),
    ],
    act: Act::Plate(|v, at, pp_m| {
        let inverse = v[0] * (at.frequency_hz.max(1.0) / 25e3).powf(v[1]);
        // The describing function of a clipped sine; its ceiling is 4/pi of where clipping begins.
        let open = (pp_m * inverse).recip().min(1.0);
        pp_m * std::f64::consts::FRAC_2_PI * (open.asin() + open * (1.0 - open * open).sqrt())
    }),
    ..DefectKind::cause(DefectSite::Plate, "the amplitude stops growing with the set-point")
};
