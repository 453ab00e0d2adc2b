//! Root finding in a bracket.

/// The root of `f` in `[lo, hi]`, where `f(lo)` and `f(hi)` differ in sign, by Newton's method within the
/// bracket; `f` gives value and derivative, `start` is where it begins. Where a step leaves the bracket or
/// hardly shrinks, the bracket is halved.
///
/// The end of smaller absolute value is returned if the signs do not differ (a root on the boundary).
pub fn newton(mut f: impl FnMut(f64) -> (f64, f64), lo: f64, hi: f64, start: f64) -> f64 {
    let (at_lo, at_hi) = (f(lo).0, f(hi).0);
    if at_lo == 0.0 {
        return lo;
    }
    if at_hi == 0.0 || (at_lo > 0.0) == (at_hi > 0.0) {
        return if at_lo.abs() <= at_hi.abs() { lo } else { hi };
    }
    let tolerance = 4.0 * f64::EPSILON * lo.abs().max(hi.abs());
    newton_between(f, at_lo < 0.0, [lo, hi], start, tolerance)
}

/// [`newton`] where `f` is known to rise or to fall through zero between the ends, which it then need not
/// evaluate. It ends with the first step of at most `tolerance`.
pub fn newton_between(
    mut f: impl FnMut(f64) -> (f64, f64),
    rises: bool,
    [lo, hi]: [f64; 2],
    start: f64,
    tolerance: f64,
) -> f64 {
    let (mut low, mut high) = (lo, hi);
    let mut x = if start > lo && start < hi { start } else { 0.5 * (lo + hi) };
    let mut last = hi - lo;
    for _ in 0..128 {
        let (value, slope) = f(x);
        if value == 0.0 {
            return x;
        }
        (low, high) = if (value < 0.0) == rises { (x, high) } else { (low, x) };
        let step = value / slope;
        let to = x - step;
        let newton = to > low && to < high && 2.0 * step.abs() <= last.abs();
        let to = if newton { to } else { 0.5 * (low + high) };
        (last, x) = (to - x, to);
        if last.abs() <= tolerance {
            break;
        }
    }
    x
}

/// The bracket after so many halvings: where `below` holds in the middle, the root lies above it.
pub fn halved([mut low, mut high]: [f64; 2], times: u32, mut below: impl FnMut(f64) -> bool) -> [f64; 2] {
    for _ in 0..times {
        let middle = 0.5 * (low + high);
        if below(middle) { low = middle } else { high = middle }
    }
    [low, high]
}

/// The middle of the bracket after so many halvings: see [`halved`].
pub fn bisection(ends: [f64; 2], times: u32, below: impl FnMut(f64) -> bool) -> f64 {
    let [low, high] = halved(ends, times, below);
    0.5 * (low + high)
}

/// The root in a bracket by Newton's rule from `start`. `look` gives at a place whether the root lies below
/// it and where the rule leads; the middle stands for a place outside of the bracket. It ends with a step
/// shorter than `close`, which depends on the place before it.
pub fn newton_or_half(
    [mut low, mut high]: [f64; 2],
    start: f64,
    close: impl Fn(f64) -> f64,
    mut look: impl FnMut(f64) -> (bool, f64),
) -> f64 {
    let mut x = start;
    for _ in 0..60 {
        let (above, to) = look(x);
        (low, high) = if above { (low, x) } else { (x, high) };
        let before = std::mem::replace(&mut x, if to > low && to < high { to } else { 0.5 * (low + high) });
        if (x - before).abs() < close(before) {
            break;
        }
    }
    x
}

/// The root of an `f` that falls through zero between the ends, by secants within the bracket, from `start`
/// and then from `start + f(start)`: the next value where `f` is the change that a map makes. It ends where
/// `f`, or the bracket, is below `settled`; the root is where `f` was evaluated last.
pub fn secant(mut f: impl FnMut(f64) -> f64, [mut low, mut high]: [f64; 2], start: f64, settled: f64) -> f64 {
    let (mut x, mut last) = (start, None::<(f64, f64)>);
    for _ in 0..60 {
        let gap = f(x);
        if gap.abs() < settled {
            break;
        }
        (low, high) = if gap > 0.0 { (x, high) } else { (low, x) };
        if high - low < settled {
            break;
        }
        let next = match last {
            Some((x0, gap0)) if gap0 != gap => x - gap * (x - x0) / (gap - gap0),
            _ => x + gap,
        };
        last = Some((x, gap));
        x = if next > low && next < high { next } else { 0.5 * (low + high) };
    }
    x
}

#[cfg(test)]
mod tests {
    use super::{newton, secant};

    #[test]
    fn secants_find_the_fixed_point_of_a_map() {
        let found = secant(|x: f64| x.cos() - x, [0.0, 1.0], 1.0, 1e-14);
        assert!((found - 0.739_085_133_215_160_6).abs() < 1e-13, "{found}");
        // Flat above, all but a shift below.
        let mut looks = 0;
        let map = |x: f64| (x + 0.02).min(0.37);
        let found = secant(|x| (looks += 1, map(x) - x).1, [0.0, 1.0], 1.0, 1e-14);
        assert!((found - 0.37).abs() < 1e-13 && looks < 4, "{found} {looks}");
    }

    #[test]
    fn newton_agrees_with_the_bracket() {
        let found = newton(|x| (x.cos() - x, -x.sin() - 1.0), 0.0, 1.0, 0.5);
        assert!((found - 0.739_085_133_215_160_6).abs() < 1e-15);
        // Started where Newton alone runs away, and where the slope vanishes.
        for start in [-2.9, 0.0, 2.9] {
            let found = newton(|x: f64| (x.atan(), 1.0 / (1.0 + x * x)), -3.0, 2.5, start);
            assert!(found.abs() < 1e-14, "{found}");
            let cube = newton(|x| (x * x * x - 2.0, 3.0 * x * x), -3.0, 3.0, start);
            assert!((cube - 2f64.cbrt()).abs() < 4e-15, "{cube}");
        }
        assert_eq!(newton(|x| (x + 1.0, 1.0), 0.0, 1.0, 0.5), 0.0);
    }
}
