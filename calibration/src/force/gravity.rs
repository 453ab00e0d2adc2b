//! Orientation of the sensor by gravity: the rig is tilted by known angles and the sensor weighs its own tool.

use crate::regression::{FitError, linear};
use nalgebra::{DMatrix, DVector};

/// Calibrated forces at one tilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TiltReading {
    /// Tilt of the rig about the axis across the stroke in rad; positive lets lateral gravity grow.
    pub tilt_rad: f64,
    /// Lateral and normal force in N, zero not taken off.
    pub force_n: [f64; 2],
}

/// Where the sensor's axes point, and what it carries.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orientation {
    /// Angle of the sensor against the rig in rad, with its standard uncertainty.
    pub angle_rad: [f64; 2],
    /// Weight of what the sensor carries in N, with its standard uncertainty.
    pub weight_n: [f64; 2],
    /// Offsets of the two axes in N, which gravity has no part in.
    pub offset_n: [f64; 2],
    /// Standard deviation of what the fit left, and the largest of it, in N.
    pub residual_n: [f64; 2],
}

/// Fits `F_l = W sin(tilt + angle) + o_l`, `F_n = W cos(tilt + angle) + o_n`, which is linear in
/// `W cos(angle)`, `W sin(angle)` and the offsets.
///
/// # Errors
/// Fewer than three tilts, or tilts too close together to tell weight from offset.
pub fn orientation(readings: &[TiltReading]) -> Result<Orientation, FitError> {
    let n = 2 * readings.len();
    let design = DMatrix::from_fn(n, 4, |i, k| {
        let (s, c) = readings[i / 2].tilt_rad.sin_cos();
        if i % 2 == 0 { [s, c, 1.0, 0.0][k] } else { [c, -s, 0.0, 1.0][k] }
    });
    let y = DVector::from_fn(n, |i, _| readings[i / 2].force_n[i % 2]);
    let fit = linear::ordinary(&design, &y)?;
    let (c, s) = (fit.estimates[0], fit.estimates[1]);
    let w2 = c * c + s * s;
    Ok(Orientation {
        angle_rad: [s.atan2(c), fit.standard_uncertainty_along(&[-s / w2, c / w2, 0.0, 0.0])],
        weight_n: [w2.sqrt(), fit.standard_uncertainty_along(&[c / w2.sqrt(), s / w2.sqrt(), 0.0, 0.0])],
        offset_n: [fit.estimates[2], fit.estimates[3]],
        residual_n: [fit.residual_sd(), fit.residuals.amax()],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_sensor_is_found() {
        let readings: Vec<TiltReading> = (-4..=4)
            .map(|i| {
                let tilt = f64::from(i) * 0.1;
                let noise = [1e-4, -1e-4, 1e-4][(i + 4) as usize % 3];
                let (s, c) = (tilt + 0.03f64).sin_cos();
                TiltReading { tilt_rad: tilt, force_n: [0.8 * s + 0.05 + noise, 0.8 * c - 0.2 - noise] }
            })
            .collect();
        let found = orientation(&readings).unwrap();
        assert!((found.angle_rad[0] - 0.03).abs() < 2.5 * found.angle_rad[1], "{found:?}");
        assert!((found.weight_n[0] - 0.8).abs() < 2.5 * found.weight_n[1]);
        assert!(found.angle_rad[1] < 1e-3);
    }

    #[test]
    fn one_tilt_cannot_tell_weight_from_offset() {
        let same = [TiltReading { tilt_rad: 0.1, force_n: [0.1, 0.7] }; 5];
        assert!(matches!(orientation(&same), Err(FitError::Singular { .. })));
    }
}
