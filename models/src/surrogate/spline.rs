//! A five-dimensional table: refined once with monotone cubics, then read multilinearly.

/// How many times finer each axis becomes: modulus, force, frequency, speed, amplitude.
const REFINE: [usize; 5] = [2, 2, 2, 4, 4];

/// A dense table on equally spaced places from 0 to 1.
#[derive(Clone, Debug)]
pub(super) struct Dense {
    shape: [usize; 5],
    values: Vec<f32>,
}

impl Dense {
    /// From coarse values, last axis fastest. An axis of one value stays one value.
    pub(super) fn refined(shape: [usize; 5], values: &[f64]) -> Dense {
        let (mut shape, mut values) = (shape, values.to_vec());
        for axis in 0..5 {
            if shape[axis] > 1 {
                (shape, values) = refine(shape, &values, axis, REFINE[axis]);
            }
        }
        Dense { shape, values: values.into_iter().map(|v| v as f32).collect() }
    }

    /// The value at a place; places outside 0 to 1 count as its end.
    #[inline]
    pub(super) fn at(&self, place: [f64; 5]) -> f64 {
        let mut base = 0;
        let mut share = [0.0_f64; 5];
        let mut stride = [0_usize; 5];
        let mut step = 1;
        for axis in (0..5).rev() {
            let last = self.shape[axis] - 1;
            let position = place[axis].clamp(0.0, 1.0) * last as f64;
            let cell = (position as usize).min(last.saturating_sub(1));
            share[axis] = position - cell as f64;
            stride[axis] = if last > 0 { step } else { 0 };
            base += cell * step;
            step *= self.shape[axis];
        }
        // Fold the 32 corners axis by axis, the fastest first.
        let mut corner = [0.0_f64; 16];
        for (k, c) in corner.iter_mut().enumerate() {
            let picked = stride.iter().take(4).enumerate().filter(|(axis, _)| k >> (3 - axis) & 1 == 1);
            let at = base + picked.map(|(_, step)| step).sum::<usize>();
            let (a, b) = (f64::from(self.values[at]), f64::from(self.values[at + stride[4]]));
            *c = a + share[4] * (b - a);
        }
        let mut count = 8;
        for axis in (0..4).rev() {
            for k in 0..count {
                let (a, b) = (corner[2 * k], corner[2 * k + 1]);
                corner[k] = a + share[axis] * (b - a);
            }
            count /= 2;
        }
        corner[0]
    }
}

/// Inserts `factor - 1` values between neighbours along `axis`.
fn refine(shape: [usize; 5], values: &[f64], axis: usize, factor: usize) -> ([usize; 5], Vec<f64>) {
    let n = shape[axis];
    let inner: usize = shape[axis + 1..].iter().product();
    let outer: usize = shape[..axis].iter().product();
    let mut fine_shape = shape;
    fine_shape[axis] = (n - 1) * factor + 1;
    let m = fine_shape[axis];
    let mut fine = vec![0.0; outer * m * inner];
    for o in 0..outer {
        for i in 0..inner {
            let line: Vec<f64> = (0..n).map(|k| values[(o * n + k) * inner + i]).collect();
            for k in 0..m {
                let cell = (k / factor).min(n - 2);
                let t = (k - cell * factor) as f64 / factor as f64;
                fine[(o * m + k) * inner + i] = monotone_cubic(&line, cell, t);
            }
        }
    }
    (fine_shape, fine)
}

/// Fritsch and Carlson's cubic on equal spacing: it never overshoots its nodes.
fn monotone_cubic(line: &[f64], cell: usize, t: f64) -> f64 {
    let n = line.len();
    let rise = |k: usize| line[k + 1] - line[k];
    let slope = |k: usize| -> f64 {
        if n == 2 {
            return rise(0);
        }
        if k == 0 || k == n - 1 {
            // One-sided and of second order, limited so that it neither changes sign nor overshoots.
            let (near, far) = if k == 0 { (rise(0), rise(1)) } else { (rise(n - 2), rise(n - 3)) };
            let s = 1.5 * near - 0.5 * far;
            return if s * near <= 0.0 {
                0.0
            } else if near * far <= 0.0 && s.abs() > 3.0 * near.abs() {
                3.0 * near
            } else {
                s
            };
        }
        let (before, after) = (rise(k - 1), rise(k));
        if before * after <= 0.0 { 0.0 } else { 2.0 * before * after / (before + after) }
    };
    let (a, b) = (slope(cell), slope(cell + 1));
    let (t2, t3) = (t * t, t * t * t);
    (2.0 * t3 - 3.0 * t2 + 1.0) * line[cell]
        + (t3 - 2.0 * t2 + t) * a
        + (3.0 * t2 - 2.0 * t3) * line[cell + 1]
        + (t3 - t2) * b
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_field_is_exact_and_nodes_are_kept() {
        let shape = [3, 2, 4, 5, 6];
        let field = |p: [f64; 5]| 1.0 + p[0] - 2.0 * p[1] + 0.5 * p[2] + 3.0 * p[3] - p[4];
        let mut values = Vec::new();
        for index in 0..shape.iter().product::<usize>() {
            let mut rest = index;
            let mut place = [0.0; 5];
            for axis in (0..5).rev() {
                place[axis] = (rest % shape[axis]) as f64 / (shape[axis] - 1) as f64;
                rest /= shape[axis];
            }
            values.push(field(place));
        }
        let dense = Dense::refined(shape, &values);
        for place in [[0.0; 5], [1.0; 5], [0.3, 0.7, 0.11, 0.95, 0.42], [0.5, 0.0, 1.0, 0.2, 0.8]] {
            assert!((dense.at(place) - field(place)).abs() < 1e-5);
        }
        // Beyond the end: the end.
        assert!((dense.at([2.0, 1.0, 1.0, 1.0, 1.0]) - field([1.0; 5])).abs() < 1e-5);
    }

    #[test]
    fn a_cubic_does_not_overshoot() {
        let line = [0.0, 0.0, 1.0, 1.0, 0.9];
        for cell in 0..4 {
            for k in 0..=10 {
                let v = monotone_cubic(&line, cell, f64::from(k) / 10.0);
                assert!((-1e-12..=1.0 + 1e-12).contains(&v), "{cell} {k}: {v}");
            }
        }
    }
}
