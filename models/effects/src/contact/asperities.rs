//! Many asperities of unequal height, each a slider of its own on a share of the springs.
//!
//! Nine equal shares stand for a distribution of heights; the finger's height is found so that together they
//! carry the load. The onset of intermittent contact loses its kink, and the last asperities keep touching at
//! amplitudes where a single slider would fly.

use crate::contact::{Contact, arc_load_of, stick};
use std::f64::consts::PI;

/// Distribution of the heights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Heights {
    /// Gaussian.
    #[default]
    Gaussian,
    /// Few tall ones: exponential above the lowest.
    Exponential,
    /// Evenly spread between lowest and highest.
    Even,
    /// Two: this share lies lower than the rest by the scale.
    Two(f64),
}

/// Number of asperities that stand for a distribution, each of an equal share.
const SHARES: usize = 9;

impl Heights {
    /// Heights in units of the scale, about a mean of zero, with the share of asperities at each, and how
    /// many there are. Of a distribution they are the medians of equal shares.
    ///
    /// Equal shares rather than quadrature nodes: as the plate takes leave of one asperity after another, a
    /// node of half the weight would leave at once.
    fn nodes(self) -> ([[f64; 2]; SHARES], usize) {
        let equal = |heights: [f64; SHARES]| (heights.map(|z| [z, 1.0 / SHARES as f64]), SHARES);
        match self {
            Heights::Two(low) => {
                let mut nodes = [[0.0; 2]; SHARES];
                (nodes[0], nodes[1]) = ([low, 1.0 - low], [low - 1.0, low]);
                (nodes, 2)
            }
            Heights::Gaussian => equal([
                -1.593_219, -0.967_422, -0.589_456, -0.282_216, 0.0, 0.282_216, 0.589_456, 0.967_422,
                1.593_219,
            ]),
            Heights::Exponential => equal([
                -0.904_847, -0.779_684, -0.636_583, -0.469_529, -0.268_859, -0.017_544, 0.318_928, 0.829_754,
                1.928_366,
            ]),
            Heights::Even => equal([
                -1.539_601, -1.154_701, -0.769_800, -0.384_900, 0.0, 0.384_900, 0.769_800, 1.154_701,
                1.539_601,
            ]),
        }
    }
}

/// Mean friction of the ensemble over a cycle, N.
pub fn mean_friction(c: &Contact) -> f64 {
    let half = c.half_amplitude();
    let (nodes, count) = c.asperity_heights.nodes();
    let nodes = &nodes[..count];
    let spread = c.asperity_height / half;
    let load = c.load_ratio();
    let drag = c.drag();
    // Depth of the mean asperity below the mean plane of the plate, in units of w/2.
    let carried = |depth: f64| -> (f64, f64) {
        nodes.iter().fold((0.0, 0.0), |(sum, slope), &[z, weight]| {
            let (value, rate) = one_load(depth + z * spread);
            (sum + weight * value, slope + weight * rate)
        })
    };
    let ends = [-1.0 - 12.0 * spread, load + 1.0 + 12.0 * spread];
    let start = if load >= 1.0 { load } else { -crate::contact::half_contact_angle(load, 0.0).cos() };
    // Newton squares the error: what is left is below 1e-12.
    let close = |depth: f64| 1e-7 * (1.0 + depth.abs());
    let depth = models::root::newton_or_half(ends, start, close, |depth| {
        let (value, slope) = carried(depth);
        (value > load, depth - (value - load) / slope.max(1e-12))
    });
    // Each asperity is a contact of its own under its own load; what belongs to the whole finger it has in
    // its share.
    let plain = c.adhesion == 0.0 && !c.needs_sweep();
    let unit = c.normal_stiffness * half;
    let one = |z: f64| {
        let own_depth = depth + z * spread;
        let (carries, _) = one_load(own_depth);
        if carries <= 0.0 {
            return 0.0;
        }
        if plain {
            let cos = (-own_depth).clamp(-1.0, 1.0);
            let lost = stick::lost(cos.acos(), ((1.0 - cos * cos).sqrt(), cos), drag);
            return (carries - lost / (2.0 * PI)) * c.mu0 * unit;
        }
        crate::contact::mean_friction(&Contact {
            asperity_height: 0.0,
            friction_factor: 1.0,
            mass: 0.0,
            normal_force: carries * unit,
            solid_share: 1.0,
            ..*c
        })
    };
    nodes.iter().map(|&[z, weight]| weight * one(z)).sum::<f64>()
}

/// Mean load of one asperity at a depth (units of w/2), and its derivative.
fn one_load(depth: f64) -> (f64, f64) {
    if depth >= 1.0 {
        (depth, 1.0)
    } else if depth <= -1.0 {
        (0.0, 0.0)
    } else {
        let phi = (-depth).acos();
        (arc_load_of(phi, ((1.0 - depth * depth).sqrt(), -depth)), phi / PI)
    }
}
