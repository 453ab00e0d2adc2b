//! Which experiment next: the conditions, or the instrument action, that best part the leading hypotheses.

use crate::data::{Rig, Table};
use crate::evidence::Explained;
use crate::fit::Problem;
use crate::hypotheses::{Candidate, Fitted};
use effects::Operating;
use nalgebra::DMatrix;
use serde::Serialize;

/// A condition of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Condition {
    /// Amplitude, peak to peak, m.
    pub amplitude_pp_m: f64,
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Direction.
    pub direction: f64,
    /// Normal force, N.
    pub normal_force_n: f64,
    /// Ambient pressure, Pa, where it was varied.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ambient_pressure_pa: Option<f64>,
}

/// A next experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Experiment {
    /// Conditions to run; empty for an action on an instrument.
    pub conditions: Vec<Condition>,
    /// The two hypotheses that it parts.
    pub separates: [String; 2],
    /// Expected gain of the better one's log evidence over the other's.
    pub expected_nats: f64,
    /// In words.
    pub text: String,
}

/// Passes of a designed experiment.
const PASSES: usize = 12;

/// Designs experiments for the two leading hypotheses (indices of candidates).
pub fn experiments(
    fitted: &Fitted,
    table: &Table,
    rig: &Rig,
    first: usize,
    second: usize,
) -> Vec<Experiment> {
    let (a, b) = (&fitted.candidates[first], &fitted.candidates[second]);
    let names = [a.names().join("+"), b.names().join("+")];
    let mut list = Vec::new();
    let (rows, nats) = design(fitted, rig, a, b, &grid(table), PASSES);
    if nats > 0.05 {
        let conditions = rows.iter().map(condition).collect();
        list.push(Experiment {
            conditions,
            text: format!(
                "{PASSES} passes where {} and {} differ most; {nats:.1} nats expected",
                names[0], names[1]
            ),
            separates: names.clone(),
            expected_nats: nats,
        });
    }
    for (effect, other) in [(a, b), (b, a)] {
        let own: Vec<&'static str> = effect.names();
        for (name, text, sd) in ACTIONS {
            if own.contains(name) && !other.names().contains(name) {
                let size = size_of(effect, name);
                let nats = 0.5 * (size / sd).powi(2);
                list.push(Experiment {
                    conditions: Vec::new(),
                    separates: names.clone(),
                    expected_nats: nats.min(500.0),
                    text: (*text).to_string(),
                });
            }
        }
    }
    list.sort_by(|x, y| y.expected_nats.total_cmp(&x.expected_nats));
    list
}

/// Actions that see one effect without going through friction, with the deviation of what they measure in the
/// units of the effect's size.
const ACTIONS: &[(&str, &str, f64)] = &[
    ("amplitude_miscalibration", "Measure the plate with a vibrometer at three drives.", 0.02),
    ("amplitude_saturation", "Measure the plate with a vibrometer at the largest drives.", 2e4),
    ("amplitude_droop", "Measure the plate with a vibrometer while the finger is pressed on it.", 0.05),
    ("resonance_detuning", "Retune the drive (sweep its frequency) at the start and the end of a run.", 0.05),
    ("mode_shape", "Scan the plate with a vibrometer along the stroke.", 0.03),
    ("lateral_gain", "Hang a dead weight on the lateral axis of the force sensor.", 0.005),
    ("normal_offset", "Lift the finger and read the normal force; put a dead weight on it.", 0.001),
    ("speed_error", "Time the stage over its stroke, or read its encoder.", 0.003),
    (
        "force_crosstalk",
        "Press on the sensor with a dead weight and no motion, plate levelled; read the lateral axis.",
        0.001,
    ),
    (
        "plate_tilt",
        "Put a spirit level (or the sensor, unloaded and turned by 180 degrees) on the plate.",
        0.002,
    ),
    ("lateral_offset_drift", "Lift the finger every few passes and read the lateral force.", 0.0005),
    ("squeeze_film", "Repeat the largest amplitudes at 0.2 atm.", 5e4),
];

fn size_of(c: &Candidate, name: &str) -> f64 {
    let thetas = Problem::thetas(&c.best.members, &c.best.u);
    c.best
        .members
        .iter()
        .zip(thetas)
        .find(|(m, _)| m.name() == name)
        .map_or(0.0, |(_, t)| t.first().copied().unwrap_or(0.0))
}

/// Conditions within the limits that the table has shown to be safe.
fn grid(table: &Table) -> Vec<Operating> {
    let levels = |f: fn(&Operating) -> f64, count: usize| -> Vec<f64> {
        let mut v: Vec<f64> = table.passes.iter().map(f).collect();
        v.sort_by(f64::total_cmp);
        let (low, high) = (v[0], v[v.len() - 1]);
        if high <= low * 1.05 {
            return vec![0.5 * (low + high)];
        }
        (0..count).map(|i| low * (high / low).powf(i as f64 / (count - 1) as f64)).collect()
    };
    let vibrating: Vec<f64> = table.passes.iter().map(|p| p.amplitude_pp_m).filter(|w| *w > 0.0).collect();
    let (low, high) = vibrating.iter().fold((f64::INFINITY, 0.0f64), |(a, b), w| (a.min(*w), b.max(*w)));
    let mut amplitudes = vec![0.0];
    if high > 0.0 {
        amplitudes.extend((0..5).map(|i| low * (high / low).powf(i as f64 / 4.0)));
    }
    let mut frequencies: Vec<f64> = table.passes.iter().map(|p| p.frequency_hz).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup_by(|a, b| (*a / *b - 1.0).abs() < 1e-3);
    let mut pressures: Vec<Option<f64>> = table.passes.iter().map(|p| p.ambient_pressure_pa).collect();
    pressures.sort_by(|a, b| a.unwrap_or(0.0).total_cmp(&b.unwrap_or(0.0)));
    pressures.dedup();
    pressures.truncate(3);
    let template = *table.passes.last().expect("a table has passes");
    let mut list = Vec::new();
    for &w in &amplitudes {
        for &f in frequencies.iter().take(4) {
            for &u in &levels(|p| p.speed_m_s, 4) {
                for &load in &levels(|p| p.normal_force_n, 3) {
                    for direction in [1.0, -1.0] {
                        for &p in &pressures {
                            list.push(Operating {
                                amplitude_pp_m: w,
                                frequency_hz: f,
                                speed_m_s: u,
                                normal_force_n: load,
                                direction,
                                ambient_pressure_pa: p,
                                ..template
                            });
                        }
                    }
                }
            }
        }
    }
    list
}

fn condition(p: &Operating) -> Condition {
    Condition {
        amplitude_pp_m: p.amplitude_pp_m,
        frequency_hz: p.frequency_hz,
        speed_m_s: p.speed_m_s,
        direction: p.direction,
        normal_force_n: p.normal_force_n,
        ambient_pressure_pa: p.ambient_pressure_pa,
    }
}

/// Greedy design: each pass is the one whose difference of predictions is largest against its noise and both
/// hypotheses' parameter uncertainty, which shrinks as passes are added. Gives passes and expected nats.
pub fn design(
    fitted: &Fitted,
    rig: &Rig,
    a: &Candidate,
    b: &Candidate,
    grid: &[Operating],
    count: usize,
) -> (Vec<Operating>, f64) {
    let problem = Problem {
        passes: grid.to_vec(),
        lateral: vec![0.0; grid.len()],
        variance: vec![1.0; grid.len()],
        ..fitted.problem.select(&[])
    };
    let side = |e: &Explained| {
        let m = problem.predict(&e.members, &e.u);
        let j = problem.jacobian(&e.members, &e.u, &m);
        (m, j, e.covariance.clone())
    };
    let (ma, ja, mut ca) = side(&a.best);
    let (mb, jb, mut cb) = side(&b.best);
    let level: Vec<f64> = ma.iter().zip(&mb).map(|(x, y)| x.abs().max(y.abs())).collect();
    let noise = crate::noise::variance(&problem, rig, &a.best.u, &level, fitted.pure.used);
    let mut chosen = Vec::new();
    let mut total = 0.0;
    for _ in 0..count {
        let Some((best, gain)) = (0..grid.len())
            .map(|i| {
                let (ra, rb) = (ja.row(i).transpose(), jb.row(i).transpose());
                let spread = ra.dot(&(&ca * &ra)) + rb.dot(&(&cb * &rb));
                (i, 0.5 * (ma[i] - mb[i]).powi(2) / (noise[i] + spread))
            })
            .max_by(|x, y| x.1.total_cmp(&y.1).then(y.0.cmp(&x.0)))
        else {
            break;
        };
        total += gain;
        chosen.push(grid[best]);
        ca = updated(&ca, &ja, best, noise[best]);
        cb = updated(&cb, &jb, best, noise[best]);
    }
    (chosen, total)
}

fn updated(c: &DMatrix<f64>, j: &DMatrix<f64>, i: usize, noise: f64) -> DMatrix<f64> {
    let row = j.row(i).transpose();
    let cr = c * &row;
    let scale = noise + row.dot(&cr);
    c - &cr * cr.transpose() / scale
}
