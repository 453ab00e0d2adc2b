//! The lateral stretch over one turn of the plate, piece by piece.
//!
//! Everything is in units of `k_n a` (forces) and radians (time). On each piece the stretch is a straight
//! line or follows the reaction force, so pieces end at roots that are bracketed by known extrema, and their
//! integrals are closed forms.

use crate::root;
use std::f64::consts::PI;

/// The driven stretch: `g(phi) = cos(phi) + offset` while touching.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stretch {
    /// Of the reaction force in units of `k_n a`: `-cos(alpha)`, or `h/a` in full contact.
    pub offset: f64,
    /// Half contact angle; pi where contact is never lost.
    pub alpha: f64,
    pub always_touching: bool,
    /// Growth per radian while sticking.
    pub kappa: f64,
    /// Largest fall per radian; infinite for instant recovery.
    pub rho: f64,
}

/// One turn of the plate.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Turn {
    /// Mean lateral force over the turn.
    pub mean_force: f64,
    /// Stretch at the next touch-down.
    pub left_over: f64,
    /// Phase where the last stick of the turn ended in slip.
    pub slip_onset: Option<f64>,
}

#[derive(Clone, Copy, Debug)]
enum Piece {
    /// On a line below the limit: force is the line.
    Stick,
    /// On the limit: force is the limit.
    Slip,
    /// Above the limit, falling at `rho`: force is the limit.
    Recover,
}

/// Far above rounding, far below any length of a piece.
const AHEAD_RAD: f64 = 1e-9;

impl Stretch {
    fn g(&self, phi: f64) -> f64 {
        phi.cos() + self.offset
    }

    fn start(&self) -> f64 {
        -self.alpha
    }

    /// The periodic steady state: the stretch at touch-down, and the turn from there.
    pub(super) fn steady(&self) -> (f64, Turn) {
        // Instant recovery forgets everything at separation. In full contact the stretch can be no less than
        // the smallest limit, which is where the turn starts: exact for instant recovery, even infinitely
        // slow.
        let mut x = if self.always_touching { self.g(self.start()) } else { 0.0 };
        let mut turn = self.turn(x);
        for _ in 0..3 {
            if (turn.left_over - x).abs() <= 1e-14 * (1.0 + x) {
                return (x, turn);
            }
            x = turn.left_over;
            turn = self.turn(x);
        }
        // The map from one touch-down to the next is monotone with slope at most one: flat where slip forgets
        // what the turn began with, all but a shift below. Secants from above cross both in a few turns.
        let top = self.offset + 1.0;
        let ends = [x, top];
        let change = |at| {
            (x, turn) = (at, self.turn(at));
            turn.left_over - at
        };
        root::secant(change, ends, top, 1e-14 * (1.0 + top));
        (x, turn)
    }

    /// One turn that starts at touch-down with the stretch `x`.
    pub(super) fn turn(&self, x: f64) -> Turn {
        let mut turn = Turn::default();
        let mut sum = 0.0;
        let end = self.alpha;
        let left = self.walk(x, |piece, from, to, at_start| match piece {
            Piece::Stick => {
                let length = to - from;
                sum += length * (at_start + 0.5 * self.kappa * length);
                if to < end {
                    turn.slip_onset = Some(to);
                }
            }
            // The area under `g`.
            Piece::Slip | Piece::Recover => sum += to.sin() - from.sin() + self.offset * (to - from),
        });
        turn.mean_force = sum / (2.0 * PI);
        turn.left_over = if self.always_touching {
            left
        } else {
            let fall = self.rho * 2.0 * (PI - self.alpha);
            if fall.is_finite() { (left - fall).max(0.0) } else { 0.0 }
        };
        turn
    }

    /// Walks the pieces of one contact, calls `visit(piece, from, to, stretch at from)`, and returns the
    /// stretch at its end.
    fn walk(&self, x: f64, mut visit: impl FnMut(Piece, f64, f64, f64)) -> f64 {
        let end = self.alpha;
        let (mut phi, mut x) = (self.start(), x);
        // Each extremum of g - line ends at most one piece, so a turn has only a handful.
        for _ in 0..16 {
            if phi >= end {
                break;
            }
            let gap = self.g(phi) - x;
            let tolerance = 1e-13 * (1.0 + self.offset.abs());
            // The slope just ahead: a slip ends where slope and rate are equal, and rounding must not decide
            // there whether what follows is another slip, to the end of the contact.
            let slope = -(phi + AHEAD_RAD).sin();
            let piece = if gap < -tolerance {
                Piece::Recover
            } else if gap > tolerance || slope > self.kappa {
                Piece::Stick
            } else if slope < -self.rho {
                Piece::Recover
            } else {
                Piece::Slip
            };
            let to = match piece {
                Piece::Stick => self.crossing(phi, x, self.kappa, end, true),
                Piece::Recover if self.rho.is_finite() => self.crossing(phi, x, -self.rho, end, false),
                Piece::Recover => {
                    // Instant recovery: drop onto the limit and look again.
                    x = self.g(phi).max(0.0);
                    continue;
                }
                Piece::Slip => self.leave(phi, end),
            };
            visit(piece, phi, to, x);
            x = match piece {
                Piece::Stick if to >= end => x + self.kappa * (to - phi),
                Piece::Recover if to >= end => x - self.rho * (to - phi),
                _ => self.g(to),
            };
            phi = to;
        }
        x.max(0.0)
    }

    /// Where the line from (`phi`, `x`) with the given slope next meets `g`, coming from below or above.
    fn crossing(&self, phi: f64, x: f64, slope: f64, end: f64, from_below: bool) -> f64 {
        let sign = if from_below { 1.0 } else { -1.0 };
        let ahead = |p: f64| sign * (self.g(p) - x - slope * (p - phi));
        // Extrema of g - line, where -sin(p) = slope, cut the way into monotone stretches.
        let mut cuts = [end; 5];
        if slope.abs() < 1.0 {
            let s = slope.asin();
            cuts = [-s, -PI + s, PI + s, 2.0 * PI - s, end];
            cuts.sort_unstable_by(f64::total_cmp);
        }
        let mut from = phi;
        for cut in cuts {
            let to = cut.min(end);
            // Within the look ahead that chose the piece, `g - line` is rounding alone.
            if to <= from.max(phi + AHEAD_RAD) {
                continue;
            }
            if ahead(to) < 0.0 {
                // The first point of the bracket may itself be a zero (touch-down): step off it.
                let inside = if ahead(from) <= 0.0 { from + (to - from) * 1e-9 } else { from };
                if ahead(inside) <= 0.0 {
                    return inside;
                }
                let with_slope = |p: f64| {
                    let (sin, cos) = p.sin_cos();
                    (sign * (cos + self.offset - x - slope * (p - phi)), sign * (-sin - slope))
                };
                return root::newton(with_slope, inside, to, 0.5 * (inside + to));
            }
            from = to;
        }
        end
    }

    /// Where slip along `g` next becomes impossible: `g` rises faster than `kappa` or falls faster than
    /// `rho`.
    fn leave(&self, phi: f64, end: f64) -> f64 {
        let ends = [(self.kappa, -PI), (self.rho, 0.0)].into_iter().filter(|(rate, _)| *rate < 1.0);
        let ahead = ends.map(|(rate, from)| from + rate.asin()).filter(|p| *p > phi + 1e-12);
        ahead.fold(end, f64::min)
    }

    /// Samples a turn: `make(time from touch-down over period, reaction, lateral)`.
    pub(super) fn sample<T>(&self, x: f64, n: usize, make: impl Fn(f64, f64, f64) -> T) -> Vec<T> {
        let mut pieces = Vec::new();
        self.walk(x, |piece, from, to, at| pieces.push((piece, from, to, at)));
        let value = |i: usize| {
            let turn = i as f64 / n as f64;
            let phi = self.start() + 2.0 * PI * turn;
            let here = pieces.iter().find(|(_, from, to, _)| phi >= *from && phi <= *to);
            match here {
                None => make(turn, 0.0, 0.0),
                Some((Piece::Stick, from, _, at)) => make(turn, self.g(phi), at + self.kappa * (phi - from)),
                Some(_) => make(turn, self.g(phi), self.g(phi)),
            }
        };
        (0..n).map(value).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::Stretch;
    use std::f64::consts::PI;

    /// In full contact a finger that hardly moves has the stretch of the least limit, `h/a - 1`; so has a
    /// skin that hardly recovers, however fast the plate. It was zero for growths of 1e-14 to 1e-9.
    #[test]
    fn the_slowest_stretch_in_full_contact_is_the_least_limit() {
        let compression_ratio = 1.282;
        let turn = |kappa, rho| {
            let offset = compression_ratio;
            Stretch { offset, alpha: PI, always_touching: true, kappa, rho }.steady().1
        };
        for exponent in -18..=-7 {
            let kappa = 10f64.powi(exponent);
            let mean = turn(kappa, f64::INFINITY).mean_force;
            // The stretch grows by `kappa` over most of a turn.
            assert!((mean - (compression_ratio - 1.0)).abs() < 1e-12 + 7.0 * kappa, "{kappa:e}: {mean}");
            // What recovers slower than it grows stays at the limit's largest value that it met.
            let slow = turn(0.1, kappa).mean_force;
            assert!((slow - compression_ratio).abs() < 1e-3, "{kappa:e}: {slow}");
        }
    }
}
