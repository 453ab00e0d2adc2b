//! A small table for tests.

use crate::data::{RigFile, Table};
use effects::{Active, Baseline, Design, by_name, lateral_force};
use models::{Condition, Direction, PassNoise, PeakToPeak};

/// Normal deviates of a linear congruential generator, by the sum of twelve.
pub struct Deviates(pub u64);

impl Deviates {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// One deviate.
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

const RIG_NOISE: PassNoise = PassNoise { pass_relative_sd: 0.02, force_sd_n: 0.001 };

/// A rig with the fingertip of the paper.
pub fn rig() -> RigFile {
    RigFile { finger: models::finger::Finger::paper(), noise: RIG_NOISE, calibration: Default::default() }
}

/// Thirty-six passes under friction that depends on speed with this exponent.
pub fn table(draw: &mut Deviates, exponent: f64) -> Table {
    let finger = rig().finger;
    let baseline = Baseline {
        mu0: 0.5,
        normal_stiffness_n_per_m: finger.normal_stiffness_n_per_m,
        lateral_stiffness_n_per_m: finger.lateral_stiffness_n_per_m,
    };
    let design = Design {
        duration_s: 180.0,
        reference_load_n: 0.3,
        reference_speed_m_s: 0.03,
        reference_frequency_hz: 30e3,
        reference_temperature_c: 20.0,
        stroke_m: 0.0,
        largest_amplitude_m: 3e-6,
    };
    let pick = |list: &[f64], draw: &mut Deviates| list[(draw.uniform() * list.len() as f64) as usize];
    let passes: Vec<Condition> = (0..36)
        .map(|i| Condition {
            time_s: 5.0 * f64::from(i),
            run_time_s: Some(5.0 * f64::from(i)),
            amplitude: PeakToPeak::from_metres(if i % 6 == 0 {
                0.0
            } else {
                pick(&[0.8e-6, 1.6e-6, 3e-6], draw)
            }),
            frequency_hz: 30e3,
            speed_m_s: pick(&[0.01, 0.03, 0.09], draw),
            direction: if pick(&[1.0, -1.0], draw) > 0.0 { Direction::Forward } else { Direction::Backward },
            normal_force_n: pick(&[0.15, 0.3, 0.6], draw),
            ..Condition::paper()
        })
        .collect();
    let theta = [exponent];
    let effect = by_name("rate_dependent_friction").expect("an effect of the library");
    let active = [Active { effect, law: 0, theta: &theta }];
    let lateral = passes
        .iter()
        .map(|p| {
            let l = lateral_force(&baseline, &active, p, &design);
            l * (1.0 + RIG_NOISE.pass_relative_sd * draw.normal()) + RIG_NOISE.force_sd_n * draw.normal()
        })
        .collect();
    Table { points: (0..36).collect(), passes, lateral, runs: vec![0; 36], run_count: 1, design }
}

/// So many of such tables, one after the other, each a run.
pub fn runs(draw: &mut Deviates, count: usize) -> Table {
    let mut all = table(draw, 0.0);
    let (own, length) = (all.len(), all.design.duration_s);
    for run in 1..count {
        let mut next = table(draw, 0.0);
        next.passes.iter_mut().for_each(|p| p.time_s += run as f64 * length);
        all.passes.append(&mut next.passes);
        all.lateral.append(&mut next.lateral);
    }
    let design = Design { duration_s: count as f64 * length, ..all.design };
    let runs = (0..all.passes.len()).map(|i| i / own).collect();
    Table { points: (0..all.passes.len() as u64).collect(), runs, run_count: count, design, ..all }
}
