//! A sweep over one contact, for laws that change the friction limit or the recovery within the cycle.
//!
//! Semantics of finite recovery (section 5.3 of the paper, as its figures show it): in contact the stretch
//! grows with the plate; where the spring's force passes the limit the slider slips and the force is the
//! limit, while the stretch follows the limit down no faster than the recovery allows; out of contact the
//! force is zero and the stretch recovers; the next contact starts from what is left. Viscous slip changes
//! what the stretch does while it slips, not the force.

use crate::contact::retarded::Retarded;
use crate::contact::{Contact, half_contact_angle};
use std::f64::consts::PI;

/// Points over the contact. The mean force is then within 1e-3 of the converged sweep (tested).
pub const POINTS: usize = 96;
/// The same where a search only looks for places to begin: within 1e-2 (tested).
pub const COARSE_POINTS: usize = 24;

/// Stretch at which the relaxation time is what it is stated to be, m.
pub const STATED_STRETCH_M: f64 = 1e-7;

/// Share of the largest stretch within which a cycle ends as it began.
const SETTLED: f64 = 1e-7;

/// Mean friction over the periodic steady state, N.
pub fn mean_friction(c: &Contact) -> f64 {
    let scale = c.normal_stiffness * c.half_amplitude();
    let omega = 2.0 * PI * c.frequency;
    let points = if c.coarse { COARSE_POINTS } else { POINTS };
    let mut room = [0.0; POINTS + 1];
    let limits = &mut room[..=points];
    let pull = c.adhesion / scale;
    let load = c.load_ratio();
    let carried = load * scale;
    let (arc, airborne) = if c.normal_retardation_time > 0.0 {
        let lag = omega * c.normal_retardation_time;
        let contact = Retarded::carrying(load, lag);
        let mut turn = Turn::new(contact.start, contact.arc / points as f64);
        for f in limits.iter_mut() {
            *f = scale * (turn.sin + contact.depth + lag * turn.cos).max(0.0) + c.adhesion;
            turn.step();
        }
        (contact.arc, 2.0 * PI - contact.arc)
    } else {
        let phi = half_contact_angle(load, pull);
        let offset = if phi >= PI { load + pull } else { -phi.cos() };
        let damping = c.indentation_damping * c.half_amplitude() * omega;
        let mut turn = Turn::new(-phi, 2.0 * phi / points as f64);
        for f in limits.iter_mut() {
            *f = scale * (turn.cos + offset).max(0.0);
            if damping > 0.0 {
                *f *= 1.0 - (damping * turn.sin).tanh();
            }
            turn.step();
        }
        (2.0 * phi, 2.0 * (PI - phi))
    };
    let dt = arc / (points as f64 * omega);
    let always = airborne < 1e-9;
    // The friction limit over the contact, as the stretch at which the spring pulls as hard.
    let (mut pressed, mut before, unit) = (0.0, 0.0, 0.5 * dt / carried);
    for (i, f) in limits.iter_mut().enumerate() {
        pressed += unit * (before + *f);
        before = *f;
        let mut limit = c.mu0 * (*f + c.attraction.at(*f));
        if c.load_exponent != 0.0 {
            limit *= (*f / c.reference_load).max(1e-6).powf(c.load_exponent);
        }
        if !always {
            limit *= c.bonds.grown(i as f64 * dt, pressed);
        }
        *f = limit / c.lateral_stiffness;
    }
    if c.held.share > 0.0 && !always {
        return c.held.mean_stretch(limits, c.speed * dt, [arc, airborne], omega) * c.lateral_stiffness;
    }
    let lateral = Lateral::new(c, dt, airborne / omega);
    // The map from the stretch at touch-down to that at the next one rises with slope at most one: its
    // fixed point is bracketed by zero and the stretch of the largest limit.
    if c.inverse_recovery_speed == 0.0 && c.lateral_relaxation_time == 0.0 && !always {
        return lateral.cycle(limits, 0.0).0 * arc / (2.0 * PI);
    }
    // Where the slip forgets what it began with, the map is flat: one look from above finds its fixed
    // point. Below lies what keeps its stretch, where the map is all but a shift: a secant crosses that in
    // a few looks.
    let beyond = if lateral.drawn > 0.0 { c.speed * c.lateral_relaxation_time } else { 0.0 };
    let top = limits.iter().fold(0.0f64, |a, &b| a.max(b)) + c.speed * dt + beyond;
    let mut mean = 0.0;
    let change = |x: f64| {
        let (force, left) = lateral.cycle(limits, x);
        mean = force;
        left - x
    };
    models::root::secant(change, [0.0, top], top, SETTLED * top);
    mean * arc / (2.0 * PI)
}

/// Sine and cosine of equally spaced phases by rotation.
struct Turn {
    sin: f64,
    cos: f64,
    by: (f64, f64),
}

impl Turn {
    fn new(start: f64, step: f64) -> Self {
        let (sin, cos) = start.sin_cos();
        Self { sin, cos, by: step.sin_cos() }
    }
    fn step(&mut self) {
        let (s, c) = self.by;
        (self.sin, self.cos) = (self.sin * c + self.cos * s, self.cos * c - self.sin * s);
    }
}

/// The lateral spring during one contact.
struct Lateral {
    stiffness: f64,
    advance: f64,
    rate_step: f64,
    keep_step: f64,
    /// What a step at stretch `x` keeps less, by `1 + grown_step x`, where the rate grows with the stretch.
    grown_step: f64,
    drawn: f64,
    rate_airborne: f64,
    keep_airborne: f64,
    grown_airborne: f64,
    knee: f64,
}

impl Lateral {
    fn new(c: &Contact, dt: f64, airborne: f64) -> Self {
        let rate =
            if c.inverse_recovery_speed > 0.0 { 1.0 / c.inverse_recovery_speed } else { f64::INFINITY };
        // dx/dt = -x/time (1 - g + g x/stated): at no stretch the rate is the share that does not grow.
        let slow = c.lateral_relaxation_time / (1.0 - c.relaxation_growth);
        let growth = c.relaxation_growth / ((1.0 - c.relaxation_growth) * STATED_STRETCH_M);
        let grown = |time: f64| if slow > 0.0 { -growth * (-time / slow).exp_m1() } else { 0.0 };
        let keep = |time: f64| match c.lateral_relaxation_time > 0.0 {
            _ if time < 1e-15 => 1.0,
            true => (-time / slow).exp(),
            false => f64::from(u8::from(rate.is_finite())),
        };
        let fall = |time: f64| if rate.is_finite() { rate * time } else { 0.0 };
        Self {
            stiffness: c.lateral_stiffness,
            advance: c.speed * dt,
            rate_step: fall(dt),
            keep_step: keep(dt),
            grown_step: grown(dt),
            // Of what a step adds evenly, this much is still there at its end.
            drawn: match c.lateral_relaxation_time {
                t if c.viscous_slip && t > 0.0 => -(-dt / t).exp_m1() * t / dt,
                _ => 0.0,
            },
            rate_airborne: fall(airborne),
            keep_airborne: keep(airborne),
            grown_airborne: grown(airborne),
            knee: c.recovery_knee,
        }
    }

    /// Mean force over the contact and the stretch at the next touch-down, under limits given as stretches.
    fn cycle(&self, limits: &[f64], start: f64) -> (f64, f64) {
        // The loop is compiled once for each way to slip back: its steps wait for each other.
        if self.drawn > 0.0 {
            self.contact(limits, start, |x, before, limit| {
                let excess = (x - before).max(0.0);
                let added = self.advance - (limit - before) + (x - before).min(0.0);
                (limit + relaxed(excess, self.keep_step, self.grown_step) + added * self.drawn).max(limit)
            })
        } else if self.knee > 0.0 && self.rate_step.is_finite() {
            self.contact(limits, start, |x, _, limit| softened(x, self.rate_step, self.knee).max(limit))
        } else if self.grown_step > 0.0 {
            self.contact(limits, start, |x, _, limit| {
                (limit + relaxed(x - limit, self.keep_step, self.grown_step)).max(limit)
            })
        } else {
            self.contact(limits, start, |x, _, limit| {
                (limit + (x - limit) * self.keep_step - self.rate_step).max(limit)
            })
        }
    }

    /// The same, `slipped` being the stretch after a step of slip: from the stretch and the limit before
    /// it, and the limit after it.
    #[inline(always)]
    fn contact(&self, limits: &[f64], start: f64, slipped: impl Fn(f64, f64, f64) -> f64) -> (f64, f64) {
        let mut x = start;
        let mut before = limits[0];
        let mut held = x.min(before);
        let mut sum = 0.5 * held;
        for &limit in &limits[1..] {
            let pulled = x + self.advance;
            if pulled <= limit {
                x = pulled;
                held = pulled;
            } else {
                // Slip begins within the step: the trapezoid would cut that corner.
                let (room, beyond) = (before - x, pulled - limit);
                if room > 0.0 && beyond > 0.0 {
                    let part = room / (room + beyond);
                    let corner = x + part * self.advance;
                    sum += 0.5 * (corner - part * limit - (1.0 - part) * x.min(before));
                }
                x = if self.drawn == 0.0 && x <= limit { limit } else { slipped(x, before, limit) };
                held = limit;
            }
            before = limit;
            sum += held;
        }
        sum -= 0.5 * held;
        (self.stiffness * sum / (limits.len() - 1) as f64, self.recovered(x))
    }

    /// What is left of a stretch at the end of the flight.
    fn recovered(&self, x: f64) -> f64 {
        if self.knee > 0.0 && self.rate_airborne.is_finite() {
            return softened(x, self.rate_airborne, self.knee).max(0.0);
        }
        (relaxed(x, self.keep_airborne, self.grown_airborne) - self.rate_airborne).max(0.0)
    }
}

/// What is left of a stretch that relaxes by a factor, and by more the longer it is.
fn relaxed(x: f64, keep: f64, grown: f64) -> f64 {
    x * keep / (1.0 + grown * x)
}

/// Share of a stretch that is little to lose in one step.
const LITTLE: f64 = 0.02;

/// What is left of a stretch `x` that recovers at a speed `v x/(x + knee)` for a time in which it would have
/// lost `rate` at the full speed: the root of `y + knee ln y = x + knee ln x - rate`.
fn softened(x: f64, rate: f64, knee: f64) -> f64 {
    if x <= 0.0 {
        return 0.0;
    }
    let (whole, lost) = (x + knee, rate * knee);
    // Most steps of a sweep lose little: there the rule of Rosenbrock (one step of the linearised law, by its
    // midpoint) is exact to a part in 1e6.
    if rate < LITTLE * whole {
        return x - rate * x * whole / (whole * whole + 0.5 * lost);
    }
    let (own, lost) = (x / knee, rate / knee);
    // In z = ln(y/x) the equation is convex and rises: Newton from the left of the root needs no guard.
    let mut z = -lost / (1.0 + own);
    for _ in 0..12 {
        let y = own * z.exp();
        let step = (y + z - own + lost) / (1.0 + y);
        z -= step;
        // Newton squares the error: what is left is below a part in 1e8.
        if step.abs() < 1e-4 {
            break;
        }
    }
    x * z.exp()
}

/// Root of a function that rises through zero between two ends, by regula falsi (Illinois).
pub(crate) fn root(low: f64, high: f64, width: f64, f: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut a, mut b) = (low, high);
    let (mut fa, mut fb) = (f(a), f(b));
    if !(fa <= 0.0 && fb >= 0.0) {
        return None;
    }
    let mut side = 0;
    for _ in 0..60 {
        if b - a < width || fb == fa {
            break;
        }
        let x = (a * fb - b * fa) / (fb - fa);
        let fx = f(x);
        if fx.abs() < 1e-10 {
            return Some(x);
        }
        let (before, above) = (side, fx > 0.0);
        side = if above { 1 } else { -1 };
        // An end that stays twice counts half.
        let half = if before == side { 0.5 } else { 1.0 };
        ((a, fa), (b, fb)) = if above { ((a, half * fa), (x, fx)) } else { ((x, fx), (b, half * fb)) };
    }
    Some(0.5 * (a + b))
}

#[cfg(test)]
mod tests {
    use super::softened;

    /// The law of recovery in small steps.
    #[test]
    fn a_softened_recovery_follows_its_law() {
        for knee in [1e-8, 1e-7, 2e-6] {
            for x in [1e-9, 3e-8, 1e-6] {
                for lost in [1e-3, 0.019, 0.021, 0.5, 4.0] {
                    let rate = lost * (x + knee);
                    let h = rate / 100_000.0;
                    let mut y: f64 = x;
                    for _ in 0..100_000 {
                        let middle = y - 0.5 * h * y / (y + knee);
                        y -= h * middle / (middle + knee);
                    }
                    let found = softened(x, rate, knee);
                    assert!((found - y).abs() < 2e-6 * x, "{knee} {x} {lost}: {found} is {y}");
                }
            }
        }
    }
}
