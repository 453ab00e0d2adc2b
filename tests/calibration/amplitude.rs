//! Amplitude: the true plate under a vibrometer whose scale error is withheld.

use crate::bench::{Coverage, seed, trials};
use crate::bound::{independent, jacobian};
use crate::force::{at, occasion};
use calibration::amplitude::AmplitudePoint;
use calibration::amplitude::apply::{AmplitudeCalibration, AmplitudeFit};
use calibration::amplitude::droop::{Exponent, droop};
use calibration::amplitude::gain::{GainForm, fit};
use calibration::amplitude::map::mode_shape;
use calibration::amplitude::resonance::sweep;
use calibration::amplitude::vibrometer::{Decoder, amplitude};
use calibration::certificate::{CalibrationResult, CertificateKind};
use calibration::uncertainty::student::coverage_factor;
use models::PeakToPeak;
use realtime::Nanos;
use sim::amplifier::AmplifierInput;
use sim::defects::{Defects, Surroundings};
use sim::noise::Noise;
use sim::world::{World, WorldConfig};
use std::f64::consts::PI;

/// A world with a plate to find, and a laser vibrometer on it.
pub struct Bench {
    world: World,
    draw: Noise,
    /// Relative error of the vibrometer's scale, which the operator knows only the size of.
    scale_error: f64,
    decoder: Decoder,
    heartbeat: u32,
    drive: (f64, f64),
}

const SCALE_SD: f64 = 0.01;
/// Noise of the vibrometer's velocity signal in m/s a sample.
const NOISE_M_S: f64 = 2e-3;
/// Relative repeatability from spot to spot.
const SPECKLE_SD: f64 = 0.005;

/// True standard deviation of one measured amplitude: speckle, and what a sine fitted to 200 samples leaves
/// of the noise.
fn reading_sd(amplitude_pp_m: f64, frequency_hz: f64) -> f64 {
    (SPECKLE_SD * amplitude_pp_m).hypot(NOISE_M_S * (2.0f64 / 200.0).sqrt() / (PI * frequency_hz))
}

impl Bench {
    pub fn new(config: &WorldConfig, seed: u64) -> Self {
        let mut draw = Noise::new(seed, "amplitude bench");
        Bench {
            world: World::new(config, seed).unwrap(),
            scale_error: SCALE_SD * draw.normal(),
            decoder: Decoder::from_settings("VD-02", "125mm/s/V", "8.16 us").unwrap(),
            draw,
            heartbeat: 0,
            drive: (0.0, 27_500.0),
        }
    }

    fn wait(&mut self, seconds: f64) {
        let mut left = (seconds / 0.01).ceil() as u32;
        while left > 0 {
            left -= 1;
            self.heartbeat += 1;
            let (pp, frequency_hz) = self.drive;
            let enable = pp > 0.0;
            let amplitude = PeakToPeak::from_metres(pp);
            self.world.command_amplifier(AmplifierInput {
                amplitude,
                frequency_hz,
                enable,
                heartbeat: self.heartbeat,
            });
            let now = self.world.now();
            self.world.advance_to(Nanos(now.0 + 10_000_000));
        }
    }

    /// The vibrometer's waveform of what moves at a position under a load, evaluated.
    pub fn measure(&mut self, set_pp_m: f64, frequency_hz: f64, position_m: f64, normal_force_n: f64) -> f64 {
        self.drive = (set_pp_m, frequency_hz);
        self.wait(0.1);
        let at = Surroundings {
            time_s: self.world.now().seconds(),
            contact_time_s: 1.0,
            position_m,
            direction: 1.0,
            frequency_hz,
            normal_force_n,
            ambient_pressure_pa: 101_325.0,
            temperature_c: 22.0,
        };
        let known = self.world.truth.amplitude_pp_m;
        let pp = self.world.config.defects.plate(&at, known);
        let (rate, phase) = (1e6, self.draw.between(0.0, std::f64::consts::TAU));
        let v = PI * frequency_hz * pp * (1.0 + self.scale_error);
        let volts: Vec<f64> = (0..200)
            .map(|i| {
                let angle = 2.0 * PI * frequency_hz * f64::from(i) / rate + phase;
                (v * angle.cos() + NOISE_M_S * self.draw.normal()) / self.decoder.range_m_s_per_v
            })
            .collect();
        // Speckle changes the signal from spot to spot: half a per cent of repeatability.
        let speckle = 1.0 + SPECKLE_SD * self.draw.normal();
        amplitude(&volts, rate, frequency_hz, &self.decoder).unwrap().metres() * speckle
    }
}

fn defects(text: &str) -> Defects {
    Defects::parse(text).unwrap()
}

fn ci(outcome: &CalibrationResult, name: &str) -> [f64; 2] {
    outcome.parameters.iter().find(|p| p.name == name).unwrap().ci95
}

#[test]
fn gain_resonance_droop_are_covered_as_stated() {
    let (mut gain, mut resonance, mut quality, mut drooped) =
        (Coverage::default(), Coverage::default(), Coverage::default(), Coverage::default());
    let mut refused = 0;
    for trial in 0..trials() {
        let mut draw = Noise::new(seed(trial), "amplitude truth");
        let load_ratio = draw.log_between(0.05, 0.5);
        let mut config = WorldConfig::default();
        config.plate.quality_factor = draw.between(80.0, 250.0);
        config.plate.resonance_hz = draw.between(27_450.0, 27_550.0);
        config.plate.warming_k = 0.0;
        config.defects = defects(&format!(
            "[[defect]]\nname = \"amplitude_droop\"\nparameters = {{ load_ratio_at_1_n = {load_ratio}, flight_per_um = 0 }}\n"
        ));
        let (f0, q) = (config.plate.resonance_hz, config.plate.quality_factor);
        let mut bench = Bench::new(&config, seed(trial));
        // The sweep first: the operator tunes to what it finds.
        let points: Vec<AmplitudePoint> = (-15..=15)
            .map(|i| {
                let f = (27_500.0 + f64::from(i) * 20.0).round();
                AmplitudePoint { at: f, amplitude_pp_m: bench.measure(2e-6, f, 0.0, 0.0) }
            })
            .collect();
        let found = sweep(&points).unwrap();
        let tuned = found.frequency_hz[0].round();
        let table: Vec<AmplitudePoint> = (1..=8)
            .flat_map(|k| [f64::from(k) * 0.4e-6; 3])
            .map(|s| AmplitudePoint { at: s, amplitude_pp_m: bench.measure(s, tuned, 0.0, 0.0) })
            .collect();
        let loads: Vec<AmplitudePoint> = (0..8)
            .flat_map(|k| [f64::from(k) * 0.15; 3])
            .map(|n| AmplitudePoint { at: n, amplitude_pp_m: bench.measure(2e-6, tuned, 0.0, n) })
            .collect();
        let (gain_fit, droop_fit) =
            (fit(&table, GainForm::Proportional, SCALE_SD), droop(&loads, Exponent::Hertz));
        let (Ok(gain_fit), Ok(droop_fit)) = (gain_fit, droop_fit) else {
            refused += 1;
            continue;
        };
        let sds = |of: &[AmplitudePoint], f: &dyn Fn(&AmplitudePoint) -> f64| -> Vec<f64> {
            of.iter().map(|p| reading_sd(p.amplitude_pp_m, f(p))).collect()
        };
        let line = |b: &[f64]| table.iter().map(|p| b[0] * p.at).collect();
        let gain_bound = independent(&jacobian(line, &[1.0], &[1e-3]), &sds(&table, &|_| tuned));
        let curve = |b: &[f64]| {
            points.iter().map(|p| b[0] / (1.0 + (2.0 * b[2] * (p.at - b[1]) / b[1]).powi(2)).sqrt()).collect()
        };
        let sweep_bound =
            independent(&jacobian(curve, &[2e-6, f0, q], &[1e-9, 0.01, 0.01]), &sds(&points, &|p| p.at));
        let bent = |b: &[f64]| loads.iter().map(|p| b[0] / (1.0 + b[1] * p.at.powf(2.0 / 3.0))).collect();
        let droop_bound =
            independent(&jacobian(bent, &[2e-6, load_ratio], &[1e-9, 1e-4]), &sds(&loads, &|_| tuned));
        let k = |dof: f64| coverage_factor(0.95, dof);
        let half = [
            k(gain_fit.fit.degrees_of_freedom) * gain_fit.fit.standard_uncertainty(0),
            k(found.degrees_of_freedom) * found.frequency_hz[1],
            k(found.degrees_of_freedom) * found.quality_factor[1],
            k(droop_fit.fit.degrees_of_freedom) * droop_fit.coefficient[1],
        ];
        let bound = [gain_bound[(0, 0)], sweep_bound[(1, 1)], sweep_bound[(2, 2)], droop_bound[(1, 1)]]
            .map(f64::sqrt);
        let whole = AmplitudeFit {
            gain: gain_fit,
            set_point_unit: "m".into(),
            table_at_m: 0.0,
            vibrometer_relative_sd: SCALE_SD,
            resonance: Some(found),
            mode_shape: None,
            droop: Some(droop_fit),
        };
        let outcome = whole.outcome();
        // The drive settles at its set-point at resonance, at 1 / sqrt(1 + (2 Q df / f0)^2) off it.
        let off = 2.0 * q * (tuned - f0) / f0;
        gain.add_with_bound(ci(&outcome, "gain"), 1.0 / (1.0 + off * off).sqrt(), half[0], bound[0]);
        resonance.add_with_bound(ci(&outcome, "resonance_hz"), f0, half[1], bound[1]);
        quality.add_with_bound(ci(&outcome, "quality_factor"), q, half[2], bound[2]);
        drooped.add_with_bound(ci(&outcome, "droop"), load_ratio, half[3], bound[3]);
        if trial == 0 {
            let certificate = outcome.certify(&occasion());
            let use_it = AmplitudeCalibration::compile(
                certificate.verify(&at(CertificateKind::Amplitude, "F-0017")).unwrap(),
            )
            .unwrap();
            let w = PeakToPeak::from_metres(1.5e-6);
            let s = use_it.free_set_point(w).unwrap();
            assert!((use_it.free_amplitude(s).metres() / w.metres() - 1.0).abs() < 1e-12);
        }
    }
    println!("refused: {refused} of {}", trials());
    assert!(50 * refused <= trials(), "at most 2 % of good tables may be refused");
    gain.judge("amplitude gain");
    resonance.judge("resonance frequency");
    quality.judge("quality factor");
    drooped.judge("droop");
}

#[test]
fn mode_shapes_are_covered_as_stated() {
    let (mut wavelength, mut antinode, mut share) =
        (Coverage::default(), Coverage::default(), Coverage::default());
    for trial in 0..trials() {
        let mut draw = Noise::new(seed(trial), "mode truth");
        let (depth, phase, half_wave) =
            (draw.between(0.3, 0.9), draw.between(0.2, 2.9), draw.between(9e-3, 18e-3));
        let config = WorldConfig {
            defects: defects(&format!(
                "[[defect]]\nname = \"mode_shape\"\nparameters = {{ depth = {depth}, phase_rad = {phase}, half_wave_at_25_khz_m = {half_wave}, edge_over_wave = 0 }}\n"
            )),
            ..WorldConfig::default()
        };
        let mut bench = Bench::new(&config, seed(trial));
        let points: Vec<AmplitudePoint> = (0..=60)
            .map(|i| {
                let x = -0.03 + 1e-3 * f64::from(i);
                AmplitudePoint { at: x, amplitude_pp_m: bench.measure(2e-6, 25_000.0, x, 0.0) }
            })
            .collect();
        let found = mode_shape(&points).unwrap();
        let dof = found.fit.degrees_of_freedom;
        let k = coverage_factor(0.95, dof);
        let interval = |[v, u]: [f64; 2]| [v - k * u, v + k * u];
        let wave = |b: &[f64]| {
            points
                .iter()
                .map(|p| b[0] * (1.0 - b[3] + b[3] * (2.0 * PI * (p.at - b[2]) / b[1]).cos().abs()))
                .collect()
        };
        let truth = [2e-6, 2.0 * half_wave, -phase / PI * half_wave, depth];
        let sd: Vec<f64> = points.iter().map(|p| reading_sd(p.amplitude_pp_m, 25_000.0)).collect();
        let bound = independent(&jacobian(wave, &truth, &[1e-10, 1e-7, 1e-7, 1e-4]), &sd);
        let half = |[_, u]: [f64; 2]| k * u;
        let sd = |i: usize| bound[(i, i)].sqrt();
        wavelength.add_with_bound(
            interval(found.wavelength_m),
            2.0 * half_wave,
            half(found.wavelength_m),
            sd(1),
        );
        share.add_with_bound(interval(found.standing_share), depth, half(found.standing_share), sd(3));
        // Antinodes stand every half wave; the one nearest to the stated place is meant.
        let first = -phase / PI * half_wave;
        let n = ((found.antinode_at_m[0] - first) / half_wave).round();
        // An antinode n half waves further on also takes up n halves of the wavelength's error.
        let there = nalgebra::DVector::from_row_slice(&[0.0, n / 2.0, 1.0, 0.0]);
        let antinode_sd = (there.transpose() * &bound * &there)[(0, 0)].sqrt();
        antinode.add_with_bound(
            interval(found.antinode_at_m),
            first + n * half_wave,
            half(found.antinode_at_m),
            antinode_sd,
        );
    }
    wavelength.judge("wavelength of the mode");
    antinode.judge("place of the antinode");
    share.judge("standing share");
}
