//! Ridges with mass: a table of the steady friction of a bouncing oscillator; nodes come on first use.
//!
//! In units of `k_n w/2` and radians: `r^2 x'' + 2 zeta r x' + s (x + depth) = force`, the plate at
//! `sin(theta)`, `r = 2 pi f sqrt(m/k_n)`. The skin's surface is a spring beside a dashpot ([`Surface`]), so
//! that a landing takes time and gives back what the dashpot leaves; `s` is such that both springs in series
//! are `k_n`. The table holds the ratio to a massless slider, so that it is exactly one
//! where there is no mass. Its interpolation error is [`STATED_ERROR`].

use crate::contact::{Contact, arc_load, half_contact_angle, lost_to_stick};
use std::f64::consts::PI;
use std::sync::OnceLock;

/// The skin's surface under the ridge's mass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Its stiffness over the normal stiffness.
    pub stiffness: f64,
    /// Its damping ratio under the ridge's mass.
    pub damping: f64,
}

impl Surface {
    /// Stiffness of the ridge, so that both in series are the normal stiffness.
    fn ridge(&self) -> f64 {
        self.stiffness / (self.stiffness - 1.0)
    }
    fn dashpot(&self, ratio: f64) -> f64 {
        2.0 * self.damping * self.stiffness.sqrt() * ratio
    }
}

/// Surfaces that have tables: a hard one that lands without rebound, one that gives back about half of the
/// speed, and a soft one, where the mass lies within the skin rather than at its surface.
pub const LANDINGS: [Surface; 3] = [
    Surface { stiffness: 60.0, damping: 1.0 },
    Surface { stiffness: 60.0, damping: 0.2 },
    Surface { stiffness: 2.5, damping: 0.02 },
];
/// Error of mu' by interpolation, root mean square, measured between the nodes by the tests; half of all
/// places lie within a thirtieth of it. The rest is where a bounce takes two cycles, or wanders.
pub const STATED_ERROR: f64 = 0.007;

/// One axis of the table: nodes spaced evenly between two coordinates.
struct Axis {
    first: f64,
    last: f64,
    count: usize,
}

impl Axis {
    fn node(&self, i: usize) -> f64 {
        self.first + (self.last - self.first) * i as f64 / (self.count - 1) as f64
    }
    /// The node below a coordinate and the share of the way to the next one; clamped to the axis.
    fn place(&self, value: f64) -> (usize, f64) {
        let top = (self.count - 1) as f64;
        let s = ((value - self.first) / (self.last - self.first) * top).clamp(0.0, top);
        let i = (s as usize).min(self.count - 2);
        (i, s - i as f64)
    }
}

/// Logarithm of the load ratio; `r`; logarithm of the damping ratio; logarithm of the drag.
const LOAD: Axis = Axis { first: -5.3, last: 0.0, count: 34 };
const RATIO: Axis = Axis { first: 0.0, last: 1.6, count: 25 };
const DAMPING: Axis = Axis { first: -2.4, last: 0.8, count: 9 };
const DRAG: Axis = Axis { first: -6.9, last: 0.6, count: DRAGS };
const DRAGS: usize = 20;

type Node = OnceLock<[f32; DRAGS]>;

fn table(landing: usize) -> &'static [Node] {
    static TABLES: [OnceLock<Vec<Node>>; LANDINGS.len()] = [const { OnceLock::new() }; LANDINGS.len()];
    let count = LOAD.count * RATIO.count * DAMPING.count;
    TABLES[landing].get_or_init(|| (0..count).map(|_| OnceLock::new()).collect())
}

/// Logarithm of the ratio of friction with mass to that without, at a node, for every drag.
fn node(landing: usize, load: usize, ratio: usize, damping: usize) -> &'static [f32; DRAGS] {
    table(landing)[(load * RATIO.count + ratio) * DAMPING.count + damping].get_or_init(|| {
        if ratio == 0 {
            return [0.0; DRAGS];
        }
        let (ratio, damping) = (RATIO.node(ratio), DAMPING.node(damping).exp());
        let swing = swing(ratio, damping, LANDINGS[landing]);
        let load = LOAD.node(load).exp();
        let drags: [f64; DRAGS] = std::array::from_fn(|k| DRAG.node(k).exp());
        let bouncing = Bouncing { load: load * swing, ratio, damping, landing: LANDINGS[landing] };
        let friction = bouncing.friction(&drags.map(|d| d * swing));
        std::array::from_fn(|k| {
            let pressed = massless(load, drags[k]) * swing;
            ((friction[k] + LEAST * load * swing) / (pressed + LEAST * load * swing)).ln() as f32
        })
    })
}

/// mu' below which a ratio says nothing.
const LEAST: f64 = 0.005;

/// Mean friction of the massless slider in units of `mu0 k_n w/2`.
fn massless(load: f64, drag: f64) -> f64 {
    let phi = half_contact_angle(load, 0.0);
    let carried = if phi >= PI { load } else { arc_load(phi) };
    carried - lost_to_stick(phi, drag) / (2.0 * PI)
}

/// Amplitude of the force in a contact that never ends, over that of the massless slider: the dynamic
/// stiffnesses of ridge and surface in series.
fn swing(ratio: f64, damping: f64, landing: Surface) -> f64 {
    let ridge = (landing.ridge() - ratio * ratio, 2.0 * damping * ratio);
    let surface = (landing.stiffness, landing.dashpot(ratio));
    surface.0.hypot(surface.1) * ridge.0.hypot(ridge.1) / (ridge.0 + surface.0).hypot(ridge.1 + surface.1)
}

/// Ratio of the mean friction with mass to that without.
///
/// A contact that never ends is a massless slider whose force swings by another amount: what the table holds
/// is the ratio to that one, so it need not follow where contact begins to be lost.
pub fn friction_ratio(c: &Contact) -> f64 {
    let r = 2.0 * PI * c.frequency * (c.mass / c.normal_stiffness).sqrt();
    if r < 1e-6 {
        return 1.0;
    }
    let swing = swing(r, c.ridge_damping_ratio, LANDINGS[c.landing]);
    let (own_load, own_drag) = (c.load_ratio() / swing, c.drag() / swing);
    let pressed = massless(own_load, own_drag) * swing;
    let base = massless(c.load_ratio(), c.drag());
    if own_load >= 1.0 {
        return pressed / base;
    }
    let (load, ratio) = (LOAD.place(own_load.ln()), RATIO.place(r));
    let (damping, drag) = (DAMPING.place(c.ridge_damping_ratio.ln()), DRAG.place(own_drag.ln()));
    let mut sum = 0.0;
    for corner in 0..8usize {
        let side = |(i, part): (usize, f64), bit: usize| {
            if corner >> bit & 1 == 1 { (i + 1, part) } else { (i, 1.0 - part) }
        };
        let ((i, wi), (j, wj), (k, wk)) = (side(load, 0), side(ratio, 1), side(damping, 2));
        let weight = wi * wj * wk;
        if weight > 0.0 {
            let values = node(c.landing, i, j, k);
            let (low, high) = (f64::from(values[drag.0]), f64::from(values[drag.0 + 1]));
            sum += weight * (low + drag.1 * (high - low));
        }
    }
    let least = LEAST * c.load_ratio();
    ((sum.exp() * (pressed + least) - least) / base).max(0.0)
}

/// Makes every node that a landing and damping ratios between two can ask for, so that none is made inside a
/// control loop.
pub fn prepare(landing: usize, damping_ratios: [f64; 2]) {
    let [a, b] = damping_ratios.map(|d| DAMPING.place(d.ln()).0);
    for load in 0..LOAD.count {
        for ratio in 0..RATIO.count {
            for damping in a.min(b)..=a.max(b) + 1 {
                let _ = node(landing, load, ratio, damping);
            }
        }
    }
}

/// A ridge with mass on a vibrating plate, in the units of this module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bouncing {
    /// Mean load.
    pub load: f64,
    /// Frequency of the plate over the ridge's own.
    pub ratio: f64,
    /// Damping ratio of the ridge.
    pub damping: f64,
    /// The skin's surface.
    pub landing: Surface,
}

/// Steps of a cycle.
const STEPS: usize = 240;
/// Cycles at most before averaging, and averaged.
const CYCLES: (usize, usize) = (120, 24);
/// Relative change from cycle to cycle below which the motion repeats.
const REPEATS: f64 = 3e-4;

/// A linear oscillator driven by the plate, `x'' + 2 g x' + k x = p sin(theta) + q cos(theta) - constant`, solved exactly.
struct Oscillator {
    gamma: f64,
    stiffness: f64,
    sine: f64,
    cosine: f64,
    /// Pull of the ridge's own spring per unit of depth.
    pull: f64,
    step: [f64; 4],
}

impl Oscillator {
    fn new(gamma: f64, stiffness: f64, drive: (f64, f64), pull: f64, h: f64) -> Self {
        // Response at unit frequency: solve (k - 1) a - 2 g b = p, (k - 1) b + 2 g a = q for a sin + b cos.
        let (d, e) = (stiffness - 1.0, 2.0 * gamma);
        let norm = d * d + e * e;
        let (p, q) = drive;
        let (sine, cosine) =
            if norm > 0.0 { ((d * p + e * q) / norm, (d * q - e * p) / norm) } else { (0.0, 0.0) };
        let own = Oscillator { gamma, stiffness, sine, cosine, pull, step: [0.0; 4] };
        Oscillator { step: own.transition(h), ..own }
    }

    /// Transition matrix of the free motion over a time.
    fn transition(&self, t: f64) -> [f64; 4] {
        let (g, k) = (self.gamma, self.stiffness);
        let discriminant = g * g - k;
        let (c, s) = if discriminant < 0.0 {
            let root = (-discriminant).sqrt();
            let decay = (-g * t).exp();
            (decay * (root * t).cos(), decay * (root * t).sin() / root)
        } else {
            let root = discriminant.sqrt().max(1e-9);
            let (slow, fast) = ((-k / (g + root) * t).exp(), (-(g + root) * t).exp());
            (0.5 * (slow + fast), 0.5 * (slow - fast) / root)
        };
        [c + g * s, s, -k * s, c - g * s]
    }

    /// Position and velocity after a transition from one phase (sine, cosine) to another.
    fn advance(
        &self,
        map: &[f64; 4],
        (x, v): (f64, f64),
        depth: f64,
        (s0, c0): (f64, f64),
        (s1, c1): (f64, f64),
    ) -> (f64, f64) {
        let rest = -self.pull * depth / self.stiffness;
        let q = x - rest - self.sine * s0 - self.cosine * c0;
        let p = v - self.sine * c0 + self.cosine * s0;
        (
            map[0] * q + map[1] * p + rest + self.sine * s1 + self.cosine * c1,
            map[2] * q + map[3] * p + self.sine * c1 - self.cosine * s1,
        )
    }
}

/// The ridge in flight and in contact.
fn oscillators(ratio: f64, damping: f64, landing: Surface, h: f64) -> [Oscillator; 2] {
    let inertia = ratio * ratio;
    let ridge = 2.0 * damping * ratio;
    let (surface, dashpot) = (landing.stiffness, landing.dashpot(ratio));
    let pull = landing.ridge() / inertia;
    let (gamma, stiffness) = (0.5 * (ridge + dashpot) / inertia, (landing.ridge() + surface) / inertia);
    let drive = (surface / inertia, dashpot / inertia);
    [
        Oscillator::new(0.5 * ridge / inertia, pull, (0.0, 0.0), pull, h),
        Oscillator::new(gamma, stiffness, drive, pull, h),
    ]
}

impl Bouncing {
    /// Mean friction (units of `mu0 k_n w/2`) at several drags.
    ///
    /// The finger's depth is steered by its mean force until the load is carried and the motion repeats; what
    /// does not repeat (a bounce may take two cycles, or wander) is averaged over many cycles.
    pub fn friction<const N: usize>(&self, drags: &[f64; N]) -> [f64; N] {
        let h = 2.0 * PI / STEPS as f64;
        let (surface, dashpot) = (self.landing.stiffness, self.landing.dashpot(self.ratio));
        let [flight, pressed] = oscillators(self.ratio, self.damping, self.landing, h);
        let force_at = |(x, v): (f64, f64), (s, c): (f64, f64)| surface * (s - x) + dashpot * (c - v);
        let (turn_s, turn_c) = h.sin_cos();
        let mut depth = if self.load >= 1.0 { self.load } else { -half_contact_angle(self.load, 0.0).cos() };
        let (mut state, mut touching, mut force) = ((0.0, 1.0), true, 0.0f64);
        let (mut stretch, mut sums, mut before) = ([0.0f64; N], [0.0f64; N], [0.0f64; N]);
        let (mut carried, mut counted, mut quiet) = (0.0, 0usize, 0usize);
        let (mut sin, mut cos) = (0.0f64, 1.0f64);
        for cycle in 0..CYCLES.0 + CYCLES.1 {
            let (mut mean, mut touched, mut now) = (0.0, 0.0, [0.0f64; N]);
            for _ in 0..STEPS {
                let (s0, c0) = (sin, cos);
                (sin, cos) = (sin * turn_c + cos * turn_s, cos * turn_c - sin * turn_s);
                let own = if touching { &pressed } else { &flight };
                let next = own.advance(&own.step, state, depth, (s0, c0), (sin, cos));
                // What must stay positive: the force in contact, the gap in flight.
                let indicator = |touching: bool, state: (f64, f64), phase: (f64, f64)| {
                    if touching { force_at(state, phase) } else { state.0 - phase.0 }
                };
                let after = indicator(touching, next, (sin, cos));
                if after >= 0.0 {
                    state = next;
                    let end = if touching { after } else { 0.0 };
                    if touching {
                        slide(&mut stretch, &mut now, drags, h, (force, end));
                        mean += 0.5 * (force + end) * h;
                        touched += h;
                    }
                    force = end;
                    continue;
                }
                // The change of state within the step, then the rest of the step in the other state.
                let at = indicator(touching, state, (s0, c0)).max(0.0);
                let part = (at / (at - after)).clamp(1e-6, 1.0 - 1e-6) * h;
                let (ps, pc) = part.sin_cos();
                let phase = (s0 * pc + c0 * ps, c0 * pc - s0 * ps);
                let turned = own.advance(&own.transition(part), state, depth, (s0, c0), phase);
                if touching {
                    slide(&mut stretch, &mut now, drags, part, (force, 0.0));
                    mean += 0.5 * force * part;
                    touched += part;
                }
                touching = !touching;
                let other = if touching { &pressed } else { &flight };
                let start = if touching { force_at(turned, phase).max(0.0) } else { 0.0 };
                state = other.advance(&other.transition(h - part), turned, depth, phase, (sin, cos));
                let end = if touching { force_at(state, (sin, cos)).max(0.0) } else { 0.0 };
                stretch = [0.0; N];
                if touching {
                    slide(&mut stretch, &mut now, drags, h - part, (start, end));
                    mean += 0.5 * (start + end) * (h - part);
                    touched += h - part;
                }
                force = end;
            }
            mean /= 2.0 * PI;
            let settled = cycle >= CYCLES.0 || quiet >= 3;
            if settled {
                carried += mean;
                counted += 1;
                sums.iter_mut().zip(&now).for_each(|(sum, now)| *sum += now);
                // A motion that repeats needs no average.
                if quiet >= 3 || counted == CYCLES.1 {
                    break;
                }
            }
            let steady = (mean / self.load - 1.0).abs() < REPEATS
                && (0..N).all(|n| (now[n] - before[n]).abs() <= REPEATS * now[n].abs());
            quiet = if steady { quiet + 1 } else { 0 };
            before = now;
            depth += 0.3 * (self.load - mean) / (touched / (2.0 * PI)).max(0.1);
        }
        // What little the steering left is made up in proportion.
        let correction = (self.load * counted as f64 / carried).clamp(0.8, 1.25);
        sums.map(|s| s / (2.0 * PI * counted as f64) * correction)
    }
}

/// The lateral springs over a step in contact: each stretches with the drag and never passes the friction limit.
fn slide<const N: usize>(
    stretch: &mut [f64; N],
    sums: &mut [f64; N],
    drags: &[f64; N],
    h: f64,
    (start, end): (f64, f64),
) {
    for n in 0..N {
        let first = stretch[n].min(start);
        stretch[n] = (stretch[n] + drags[n] * h).min(end);
        sums[n] += 0.5 * (first + stretch[n]) * h;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Active, Baseline, Design, Effect, by_name, lateral_force};
    use models::{Condition, PeakToPeak};

    /// The control loop asks a prepared model for any condition: no node may be made there, which takes milliseconds. One
    /// law with a damping that is the same at any speed of the plate, and one with a power of it.
    #[test]
    fn a_prepared_table_makes_no_node_when_asked() {
        let effect = by_name("ridge_inertia").expect("an effect of the library");
        for (law, exponent, dampings) in [(0, 0.0, 2), (1, 0.6, 6), (2, 0.0, 2)] {
            let made = || table(law).iter().filter(|node| node.get().is_some()).count();
            (effect.prepare)(law, &[1e-5, 0.35, exponent, 0.0]);
            let before = made();
            assert_eq!(before, dampings * LOAD.count * RATIO.count);
            assert!(changed_passes(effect, law, exponent) > 50);
            assert_eq!(made(), before);
        }
    }

    /// Passes of a wide grid on which a mass changes the friction by more than a per cent.
    fn changed_passes(effect: &'static Effect, law: usize, exponent: f64) -> usize {
        let baseline = Baseline { mu0: 0.5, normal_stiffness_n_per_m: 1.2e6, lateral_stiffness_n_per_m: 4e5 };
        let design = Design {
            duration_s: 100.0,
            reference_load_n: 0.3,
            reference_speed_m_s: 0.03,
            reference_frequency_hz: 30e3,
            reference_temperature_c: 20.0,
            stroke_m: 0.0,
            largest_amplitude_m: 1e-5,
        };
        let mut changed = 0;
        for amplitude_pp_m in [0.0, 1e-8, 0.5e-6, 2e-6, 1e-5] {
            for frequency_hz in [20e3, 33e3, 100e3] {
                for speed_m_s in [1e-4, 0.02, 0.5] {
                    for normal_force_n in [1e-3, 0.2, 5.0] {
                        for mass_kg in [1e-6, 2e-5, 1e-4] {
                            let pass = Condition {
                                time_s: 10.0,
                                amplitude: PeakToPeak::from_metres(amplitude_pp_m),
                                frequency_hz,
                                speed_m_s,
                                normal_force_n,
                                ..Condition::paper()
                            };
                            let theta = [mass_kg, 0.35, exponent, 0.0];
                            let active = [Active { effect, law, theta: &theta }];
                            let with = lateral_force(&baseline, &active, &pass, &design);
                            let without = lateral_force(&baseline, &[], &pass, &design);
                            changed += usize::from((with / without - 1.0).abs() > 0.01);
                        }
                    }
                }
            }
        }
        changed
    }
}
