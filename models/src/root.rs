//! Root finding in a bracket.

/// The root of `f` in `[lo, hi]`, where `f(lo)` and `f(hi)` differ in sign, by the ITP method
/// (Oliveira and Takahashi, 'An Enhancement of the Bisection Method Average Performance Preserving
/// Minmax Optimality', ACM TOMS 47(1), 2020): never slower than bisection by more than one step.
///
/// The end of smaller absolute value is returned if the signs do not differ (a root on the boundary).
pub fn bracketed(mut f: impl FnMut(f64) -> f64, lo: f64, hi: f64) -> f64 {
    let (mut a, mut b) = (lo, hi);
    let (mut fa, mut fb) = (f(a), f(b));
    if fa == 0.0 {
        return a;
    }
    if fb == 0.0 {
        return b;
    }
    if (fa > 0.0) == (fb > 0.0) {
        return if fa.abs() <= fb.abs() { a } else { b };
    }
    let tolerance = 4.0 * f64::EPSILON * lo.abs().max(hi.abs());
    let mut slack = (b - a) * 0.5;
    // 64 halvings exhaust a double; the interpolation ends long before.
    for _ in 0..128 {
        let width = b - a;
        if width.abs() <= 2.0 * tolerance {
            break;
        }
        let middle = a + 0.5 * width;
        let secant = (fb * a - fa * b) / (fb - fa);
        let truncation = 0.2 / (hi - lo).abs() * width * width;
        let towards = (middle - secant).signum();
        let truncated =
            if truncation <= (middle - secant).abs() { secant + towards * truncation } else { middle };
        let radius = slack - 0.5 * width.abs();
        let x = if (truncated - middle).abs() <= radius.max(0.0) {
            truncated
        } else {
            middle - towards * radius.max(0.0)
        };
        let x = if x <= a.min(b) || x >= a.max(b) || !x.is_finite() { middle } else { x };
        let fx = f(x);
        if fx == 0.0 {
            return x;
        }
        if (fx > 0.0) == (fa > 0.0) {
            (a, fa) = (x, fx);
        } else {
            (b, fb) = (x, fx);
        }
        slack *= 0.5;
        slack = slack.max(tolerance);
    }
    0.5 * (a + b)
}

#[cfg(test)]
mod tests {
    use super::bracketed;

    #[test]
    fn finds_roots_with_known_values() {
        let dottie = bracketed(|x| x.cos() - x, 0.0, 1.0);
        assert!((dottie - 0.739_085_133_215_160_6).abs() < 1e-15);
        let cube = bracketed(|x| x * x * x - 2.0, 0.0, 2.0);
        assert!((cube - 2f64.cbrt()).abs() < 2e-15);
        // A flat root, where a secant alone would crawl.
        assert!((bracketed(|x| (x - 0.3f64).powi(9), 0.0, 1.0) - 0.3).abs() < 1e-2);
    }

    #[test]
    fn gives_the_nearer_end_without_a_sign_change() {
        assert_eq!(bracketed(|x| x + 1.0, 0.0, 1.0), 0.0);
    }
}
