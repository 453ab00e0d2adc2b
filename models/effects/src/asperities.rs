//! Many asperities of unequal height, each a slider of its own on a share of the springs.
//!
//! Heights are represented by five quadrature nodes; the finger's height is found so that together they carry
//! the load. The onset of intermittent contact loses its kink, and the last asperities keep touching at
//! amplitudes where a single slider would fly.

use crate::contact::{Contact, arc_load, lost_to_stick};
use std::f64::consts::PI;

/// Gauss-Hermite nodes and weights (probabilists', five points), heights in units of their deviation.
const GAUSSIAN: [(f64, f64); 5] = [
    (-2.856_970_013_872_806, 0.011_257_411_327_720_69),
    (-1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (0.0, 0.533_333_333_333_333_3),
    (1.355_626_179_974_266, 0.222_075_922_005_612_6),
    (2.856_970_013_872_806, 0.011_257_411_327_720_69),
];

/// Gauss-Laguerre nodes and weights (five points) for exponential heights (few tall ones), zero mean.
const EXPONENTIAL: [(f64, f64); 5] = [
    (-0.736_439_680_281_64, 0.521_755_610_582_809),
    (0.413_403_059_107_29, 0.398_666_811_083_176),
    (2.596_425_771_040_77, 0.075_942_449_681_708),
    (6.085_810_005_858_42, 0.003_611_758_679_922),
    (11.640_800_844_275_27, 0.000_023_369_972_385_8),
];

/// Mean friction of the ensemble over a cycle, N.
pub fn mean_friction(c: &Contact) -> f64 {
    let half = c.half_amplitude();
    let nodes = if c.asperity_exponential { &EXPONENTIAL } else { &GAUSSIAN };
    let spread = c.asperity_height / half;
    let load = c.load_ratio();
    let drag = c.drag();
    // Depth of the mean asperity below the mean plane of the plate, in units of w/2.
    let carried = |depth: f64| -> (f64, f64) {
        nodes.iter().fold((0.0, 0.0), |(sum, slope), &(z, weight)| {
            let (value, rate) = one_load(depth + z * spread);
            (sum + weight * value, slope + weight * rate)
        })
    };
    let (mut low, mut high) = (-1.0 - 12.0 * spread, load + 1.0 + 12.0 * spread);
    let mut depth = if load >= 1.0 { load } else { -crate::contact::half_contact_angle(load, 0.0).cos() };
    for _ in 0..60 {
        let (value, slope) = carried(depth);
        if value > load {
            high = depth;
        } else {
            low = depth;
        }
        let newton = depth - (value - load) / slope.max(1e-12);
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if (next - depth).abs() < 1e-12 * (1.0 + depth.abs()) {
            depth = next;
            break;
        }
        depth = next;
    }
    let mut friction = 0.0;
    for &(z, weight) in nodes {
        let (share, _) = one_load(depth + z * spread);
        if share > 0.0 {
            let phi = (-(depth + z * spread)).clamp(-1.0, 1.0).acos();
            friction += weight * (share - lost_to_stick(phi, drag) / (2.0 * PI));
        }
    }
    // What the sweep knows and this ensemble does not is taken as a common factor on all asperities.
    let alone = Contact { asperity_height: 0.0, friction_factor: 1.0, mass: 0.0, ..*c };
    let plain = Contact {
        adhesion: 0.0,
        load_exponent: 0.0,
        inverse_recovery_speed: 0.0,
        lateral_relaxation_time: 0.0,
        bonding_time: 0.0,
        normal_retardation_time: 0.0,
        ..alone
    };
    let factor = if alone == plain {
        1.0
    } else {
        crate::contact::mean_friction(&alone) / crate::contact::mean_friction(&plain)
    };
    friction * c.mu0 * c.normal_stiffness * half * factor
}

/// Mean load of one asperity at a depth (units of w/2), and its derivative.
fn one_load(depth: f64) -> (f64, f64) {
    if depth >= 1.0 {
        (depth, 1.0)
    } else if depth <= -1.0 {
        (0.0, 0.0)
    } else {
        let phi = (-depth).acos();
        (arc_load(phi), phi / PI)
    }
}
