//! Delay between two evenly sampled channels by cross-correlation.

/// The delay of `late` behind `early`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lag {
    /// Delay in samples; positive where `late` follows `early`.
    pub samples: f64,
    /// Correlation coefficient at the maximum.
    pub correlation: f64,
}

/// The lag of the largest cross-correlation within `+-max_lag` samples, between samples by a parabola
/// through the three largest values. Means are taken off; the overlap is normalised.
/// `None` where the channels are shorter than twice the largest lag, one of them stands still, or the
/// maximum lies at the end of the search.
pub fn lag(early: &[f64], late: &[f64], max_lag: usize) -> Option<Lag> {
    let n = early.len().min(late.len());
    if n < 2 * max_lag + 8 {
        return None;
    }
    let coefficient = |lag: isize| {
        let (a, b) = if lag >= 0 {
            (&early[..n - lag as usize], &late[lag as usize..n])
        } else {
            (&early[(-lag) as usize..n], &late[..n - (-lag) as usize])
        };
        let m = a.len() as f64;
        let (ma, mb) = (a.iter().sum::<f64>() / m, b.iter().sum::<f64>() / m);
        let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
        for (x, y) in a.iter().zip(b) {
            ab += (x - ma) * (y - mb);
            aa += (x - ma) * (x - ma);
            bb += (y - mb) * (y - mb);
        }
        ab / (aa * bb).sqrt()
    };
    let limit = max_lag as isize;
    let values: Vec<f64> = (-limit..=limit).map(coefficient).collect();
    if values.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let k = (0..values.len()).max_by(|a, b| values[*a].total_cmp(&values[*b]))?;
    if k == 0 || k + 1 == values.len() {
        return None;
    }
    let (before, top, after) = (values[k - 1], values[k], values[k + 1]);
    let curvature = before - 2.0 * top + after;
    let shift = if curvature < 0.0 { 0.5 * (before - after) / curvature } else { 0.0 };
    Some(Lag { samples: k as f64 - limit as f64 + shift, correlation: top })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fraction_of_a_sample_is_found() {
        let wave = |t: f64| (0.05 * t).sin() + 0.6 * (0.131 * t + 1.0).sin();
        let early: Vec<f64> = (0..2000).map(|i| wave(f64::from(i))).collect();
        let late: Vec<f64> = (0..2000).map(|i| wave(f64::from(i) - 7.3)).collect();
        let found = lag(&early, &late, 20).unwrap();
        assert!((found.samples - 7.3).abs() < 0.02, "{found:?}");
        assert!((lag(&late, &early, 20).unwrap().samples + 7.3).abs() < 0.02);
    }

    #[test]
    fn nothing_to_correlate_is_no_lag() {
        assert_eq!(lag(&[1.0; 100], &[2.0; 100], 5), None);
        assert_eq!(lag(&[1.0; 10], &[2.0; 10], 5), None);
    }
}
