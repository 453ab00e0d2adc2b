//! The maker of one sealed set: its fingertip, its noise, its causes' sizes, its measurement.

use super::design::Planned;
use super::oracle::Case;
use crate::defects::{Defect, DefectKind, Defects, Surroundings};
use crate::finger::{FingerConfig, VirtualFinger};
use crate::noise::Noise;
use crate::world::{Point, steady_forces};
use models::{Calibration, Pass, PassNoise, PeakToPeak, RigFile};
use serde::{Deserialize, Serialize};

/// The noise of a set's forces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetNoise {
    /// True repeatability of the lateral force from pass to pass.
    pub pass_relative_sd: f64,
    /// True scatter of a pass's mean force, each axis (N).
    pub force_sd_n: f64,
    /// Degrees of freedom of the scatter's Student distribution; 0: normal.
    pub tail: f64,
    /// Resolution of the forces (N).
    pub count_n: f64,
    /// Relative scatter of the true normal force about its set-point.
    pub load_relative_sd: f64,
}

/// What a set is measured on.
pub(super) struct SetMaker {
    pub(super) finger: VirtualFinger,
    pub(super) nominal: VirtualFinger,
    pub(super) scatter: SetNoise,
    config: FingerConfig,
    /// Stated over true scatter: nobody knows his own repeatability exactly.
    pub(super) stated: f64,
    warming_k: f64,
    warming_time_s: f64,
    thermometer: bool,
}

/// Noise-free measurements.
pub(super) struct NoiseFree {
    /// The points with the normal force that the sensor would show.
    pub(super) known: Vec<Point>,
    /// Lateral forces, sensor's frame (N).
    pub(super) lateral_n: Vec<f64>,
    /// Standard deviation of each as measured (N).
    pub(super) sd_n: Vec<f64>,
}

/// Rms of the recalibrated gap in standard deviations that sizes are drawn for, evenly in the logarithm.
pub(super) const GAP: [f64; 2] = [0.12, 20.0];
/// Halvings of a size's range.
const HALVINGS: usize = 8;

impl SetMaker {
    pub(super) fn draw(noise: &mut Noise, seed: u64) -> Self {
        let normal = noise.log_between(0.8e6, 4e6);
        let poisson_ratio = noise.between(0.3, 0.49);
        let lateral = normal / (2.0 * (1.0 + poisson_ratio)) * noise.between(0.9, 1.1);
        let round = |x: f64| (x / 1e4).round() * 1e4;
        let config = FingerConfig {
            normal_stiffness_n_per_m: round(normal),
            lateral_stiffness_n_per_m: round(lateral),
            stiffness_relative_sd: [0.03, 0.05, 0.1][noise.below(3)],
            mu0: noise.log_between(0.3, 1.0),
            poisson_ratio: (poisson_ratio * 100.0).round() / 100.0,
            ..FingerConfig::default()
        };
        let scatter = SetNoise {
            pass_relative_sd: noise.log_between(0.008, 0.025),
            force_sd_n: noise.log_between(4e-4, 1.6e-3),
            tail: [0.0, 0.0, 4.0, 6.0][noise.below(4)],
            count_n: [1e-5, 1e-4, 2.5e-4][noise.below(3)],
            load_relative_sd: noise.between(0.005, 0.03),
        };
        Self {
            finger: VirtualFinger::new(&config, seed),
            nominal: VirtualFinger::new(&FingerConfig { stiffness_relative_sd: 0.0, ..config }, seed),
            scatter,
            config,
            stated: noise.between(0.93, 1.07),
            warming_k: noise.between(2.0, 10.0),
            warming_time_s: noise.log_between(40.0, 500.0),
            thermometer: noise.chance(0.6),
        }
    }

    /// The true circumstances of planned passes.
    pub(super) fn circumstances(&self, planned: &[Planned], unsteady: bool, noise: &mut Noise) -> Vec<Point> {
        let point = |p: &Planned| {
            let c = &p.condition;
            let wander = if unsteady { self.scatter.load_relative_sd * noise.normal() } else { 0.0 };
            let at = Surroundings {
                time_s: c.time_s,
                contact_time_s: c.time_s,
                position_m: c.position_m,
                direction: c.direction.sign(),
                frequency_hz: c.frequency_hz,
                normal_force_n: c.normal_force_n * (1.0 + wander),
                ambient_pressure_pa: c.ambient_pressure_pa.unwrap_or(101_325.0),
                temperature_c: 22.0 + self.warming_k * (1.0 - (-c.time_s / self.warming_time_s).exp()),
            };
            Point { at, known_pp_m: c.amplitude.metres(), speed_m_s: c.speed_m_s }
        };
        planned.iter().map(point).collect()
    }

    /// What the sensor would show without noise.
    pub(super) fn noise_free(&self, points: &[Point], defects: &Defects) -> NoiseFree {
        let mut out = NoiseFree { known: points.to_vec(), lateral_n: Vec::new(), sd_n: Vec::new() };
        for known in &mut out.known {
            let forces = steady_forces(&self.finger, defects, known);
            known.at.normal_force_n = forces.normal_n.max(1e-3);
            let force = self.scatter.force_sd_n * (1.0 + self.finger.mu0.powi(2)).sqrt();
            let rounding = self.scatter.count_n / 12.0_f64.sqrt();
            out.sd_n.push((self.scatter.pass_relative_sd * forces.lateral_n).hypot(force).hypot(rounding));
            out.lateral_n.push(forces.lateral_n);
        }
        out
    }

    pub(super) fn case<'a>(&self, data: &'a NoiseFree) -> Case<'a> {
        Case {
            known: &data.known,
            lateral_n: &data.lateral_n,
            sd_n: &data.sd_n,
            nominal: self.nominal,
            stiffness_sd: self.config.stiffness_relative_sd,
            beside: &[],
            place: 0,
        }
    }

    /// Causes, each with a size whose recalibrated gap, in deviations of a pass, comes nearest to one drawn from a range.
    pub(super) fn sized(
        &self,
        kinds: &[&'static DefectKind],
        points: &[Point],
        gap: [f64; 2],
        noise: &mut Noise,
    ) -> Defects {
        let mut out = Defects::none();
        for kind in kinds {
            let mut values = kind.draw(noise);
            kind.turn(&mut values, noise.chance(0.5));
            let low = if kinds.len() > 1 { gap[0].max(1.0) } else { gap[0] };
            let target = noise.log_between(low, gap[1]);
            let (mut small, mut large) = (0.0, 1.0);
            let mut nearest = (f64::INFINITY, values);
            for _ in 0..HALVINGS {
                let share = 0.5 * (small + large);
                kind.resize(&mut values, share);
                let data = self.noise_free(points, &Defects::one(kind, values));
                let chi2 = self.case(&data).fit(&Defects::none(), 5).chi2;
                let gap = (chi2 / points.len() as f64).sqrt();
                let miss = (gap / target).ln().abs();
                if miss < nearest.0 {
                    nearest = (miss, values);
                }
                if miss < 0.05 {
                    break;
                }
                if gap < target { small = share } else { large = share }
            }
            out.defects.push(Defect { kind, values: nearest.1 });
        }
        out
    }

    fn scattered(&self, noise: &mut Noise) -> f64 {
        if self.scatter.tail > 2.0 { noise.heavy(self.scatter.tail) } else { noise.normal() }
    }

    /// The table, with noise. A pass whose mean normal force reads zero or less counts as contact lost and is no pass.
    pub(super) fn measure(
        &self,
        points: &[Point],
        planned: &[Planned],
        defects: &Defects,
        noise: &mut Noise,
    ) -> Vec<Pass> {
        let s = self.scatter;
        let counts = |x: f64| (x / s.count_n).round() * s.count_n;
        let with_samples = noise.chance(0.5);
        let pass = |(i, (point, plan)): (usize, (&Point, &Planned))| {
            let forces = steady_forces(&self.finger, defects, point);
            let repeat = 1.0 + s.pass_relative_sd * self.scattered(noise);
            let lateral = forces.lateral_n * repeat + s.force_sd_n * self.scattered(noise);
            let normal = forces.normal_n + s.force_sd_n * self.scattered(noise);
            let mut pass = self.row(i, plan, point, counts(normal));
            pass.lateral_force_n = Some(counts(lateral));
            if with_samples {
                pass.samples = Some(500);
                pass.normal_force_sd_n = Some(normal.abs() * s.load_relative_sd);
                pass.lateral_force_sd_n = Some((lateral.abs() * s.load_relative_sd).hypot(2e-3));
            }
            pass
        };
        let passes = points.iter().zip(planned).enumerate().map(pass);
        passes.filter(|pass| pass.normal_force_n > 0.0).collect()
    }

    pub(super) fn row(&self, i: usize, plan: &Planned, point: &Point, normal_n: f64) -> Pass {
        let mut pass = Pass::at(i as u64 + 1, &plan.condition, None);
        pass.amplitude = PeakToPeak::from_metres(point.known_pp_m);
        pass.normal_force_n = normal_n;
        pass.temperature_c = self.thermometer.then(|| (point.at.temperature_c * 100.0).round() / 100.0);
        pass.replicate = Some(plan.replicate);
        pass.run = Some(format!("run-{}", plan.run + 1));
        pass
    }

    /// Hidden conditions as a table without lateral forces.
    pub(super) fn conditions(&self, data: &NoiseFree, planned: &[Planned]) -> Vec<Pass> {
        let rows = data.known.iter().zip(planned).enumerate();
        rows.map(|(i, (point, plan))| self.row(i, plan, point, point.at.normal_force_n)).collect()
    }

    /// Lateral forces of the ideal baseline of a fingertip (N).
    pub(super) fn ideal(&self, data: &NoiseFree, finger: &VirtualFinger) -> Vec<f64> {
        let none = Defects::none();
        data.known.iter().map(|point| steady_forces(finger, &none, point).lateral_n).collect()
    }

    /// Rms error over mu0 F of the ideal baseline of a fingertip.
    pub(super) fn error(&self, data: &NoiseFree, finger: &VirtualFinger) -> f64 {
        let model = self.ideal(data, finger);
        let pairs = data.known.iter().zip(data.lateral_n.iter().zip(&model));
        rms(pairs.map(|(point, (lateral, m))| (lateral - m) / (finger.mu0 * point.at.normal_force_n)))
    }

    /// Rms over mu0 F of what repeatability leaves.
    pub(super) fn floor(&self, data: &NoiseFree) -> f64 {
        let sds = data.known.iter().zip(&data.sd_n);
        rms(sds.map(|(point, sd)| sd / (self.finger.mu0 * point.at.normal_force_n)))
    }

    /// What its owner would know of the set's rig.
    pub(super) fn rig_file(&self) -> RigFile {
        let f = &self.config;
        let finger = models::finger::Finger {
            normal_stiffness_n_per_m: f.normal_stiffness_n_per_m,
            lateral_stiffness_n_per_m: f.lateral_stiffness_n_per_m,
            stiffness_relative_sd: f.stiffness_relative_sd,
            poisson_ratio: f.poisson_ratio,
            young_modulus_pa: None,
            lateral_recovery_m_per_s: None,
        };
        let force_sd_n = self.scatter.force_sd_n.hypot(self.scatter.count_n / 12.0_f64.sqrt()) * self.stated;
        let noise = PassNoise {
            pass_relative_sd: stated(format!("{:.5}", self.scatter.pass_relative_sd * self.stated)),
            force_sd_n: stated(format!("{force_sd_n:.3e}")),
        };
        RigFile { finger, noise, calibration: Calibration::default() }
    }
}

/// The number that a written one is: nobody states his repeatability with all digits.
fn stated(written: String) -> f64 {
    written.parse().expect("a number as it was written")
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, n) = values.fold((0.0, 0.0), |(sum, n), x| (sum + x * x, n + 1.0));
    f64::sqrt(sum / f64::max(n, 1.0))
}
