//! Contact phase shift: the paper's section 2 as a procedure.
//!
//! Velocity waveforms of plate and skin give the phase shift of Eq. 1,
//! `Phi = 360 |t_pa - t_sa| / T`, with the instants of maximum acceleration; ten repeats give its
//! uncertainty. Each vibrometer's range and delay are applied first.

pub mod outcome;
pub mod table;
pub mod waveform;

pub use outcome::{Acquisition, outcome};
pub use table::{PhasePoint, TableError, read_phases, write_phases};
pub use waveform::{PhaseError, Shift, Waveforms, shift};

use crate::uncertainty::Input;

/// Phase shift of one amplitude over its repeats.
#[derive(Clone, Debug, PartialEq)]
pub struct RepeatedShift {
    /// Mean shift in degrees in [0, 360), its standard uncertainty and degrees of freedom.
    pub phase_deg: Input,
    /// Standard deviation from repeat to repeat in degrees.
    pub repeat_sd_deg: f64,
    /// How many repeats show a doubled period.
    pub period_doubled: usize,
    /// Number of repeats.
    pub repeats: usize,
}

/// Mean over repeats on the circle: phases of 359 and 1 degree have the mean 0.
/// `delay_sd_s` is the standard uncertainty of the vibrometers' delays, common to all repeats.
///
/// # Errors
/// Fewer than three repeats, or repeats that point everywhere.
pub fn repeated(shifts: &[Shift], frequency_hz: f64, delay_sd_s: f64) -> Result<RepeatedShift, PhaseError> {
    if shifts.len() < 3 {
        return Err(PhaseError::TooFewRepeats { found: shifts.len() });
    }
    let n = shifts.len() as f64;
    let (s, c) = shifts.iter().fold((0.0, 0.0), |(s, c), x| {
        let a = x.phase_deg.to_radians();
        (s + a.sin() / n, c + a.cos() / n)
    });
    if s.hypot(c) < 0.5 {
        return Err(PhaseError::Scattered { resultant: s.hypot(c) });
    }
    let mean = s.atan2(c).to_degrees();
    let unwrapped: Vec<f64> =
        shifts.iter().map(|x| mean + (x.phase_deg - mean + 180.0).rem_euclid(360.0) - 180.0).collect();
    let mut phase_deg = Input::type_a(&unwrapped);
    let statistical = phase_deg.standard_uncertainty;
    let common = 360.0 * frequency_hz * delay_sd_s;
    phase_deg.standard_uncertainty = statistical.hypot(common);
    if statistical > 0.0 {
        phase_deg.degrees_of_freedom *= (phase_deg.standard_uncertainty / statistical).powi(4);
    }
    phase_deg.value = phase_deg.value.rem_euclid(360.0);
    Ok(RepeatedShift {
        phase_deg,
        repeat_sd_deg: statistical * n.sqrt(),
        period_doubled: shifts.iter().filter(|x| x.period_doubled).count(),
        repeats: shifts.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_goes_round_the_circle() {
        let shifts: Vec<Shift> = [358.0, 2.0, 0.0, 1.0, 359.0]
            .iter()
            .map(|p| Shift { phase_deg: *p, period_doubled: false })
            .collect();
        let found = repeated(&shifts, 27_500.0, 0.0).unwrap();
        assert!(found.phase_deg.value < 1e-9 || found.phase_deg.value > 360.0 - 1e-9);
        // sd of (-2, 2, 0, 1, -1) is sqrt(10/4).
        assert!((found.repeat_sd_deg - 2.5f64.sqrt()).abs() < 1e-9);
    }
}
