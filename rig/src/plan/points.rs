//! From a plan to its passes, each checked against the limits before anything moves.

use super::Plan;
use crate::input::{self, BadInput};
use models::condition::Condition;
use models::quantity::{Direction, PeakToPeak};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha12Rng;
use realtime::safety::{HARD, Limits};
use serde::{Deserialize, Serialize};

/// One pass of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Number in the order of measurement, from 0.
    pub number: u32,
    /// The condition; `time_s` and `mu0` are not known yet.
    pub condition: Condition,
    /// Which repeat of its condition.
    pub replicate: u32,
    /// A pass without vibration that anchors `mu_0`.
    pub reference: bool,
}

/// What the amplifier can set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Step of the amplitude set-point in m, peak-to-peak.
    pub amplitude_pp_m: f64,
    /// Step of the frequency set-point in Hz.
    pub frequency_hz: f64,
}

impl Resolution {
    fn amplitude(&self, wanted: f64) -> f64 {
        quantise(wanted, self.amplitude_pp_m)
    }

    fn frequency(&self, wanted: f64) -> f64 {
        quantise(wanted, self.frequency_hz)
    }
}

fn quantise(wanted: f64, step: f64) -> f64 {
    if step > 0.0 { (wanted / step).round() * step } else { wanted }
}

/// Why a plan cannot be run on a rig.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct PlanProblem(String);

/// A condition of a series, before directions and repeats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Wanted {
    pub(super) amplitude_pp_m: f64,
    pub(super) frequency_hz: f64,
    pub(super) speed_m_s: f64,
    pub(super) normal_force_n: f64,
    pub(super) position_m: f64,
    pub(super) ambient_pressure_pa: Option<f64>,
    /// The series' own direction; none where the plan's are made in turn.
    pub(super) direction: Option<i8>,
}

impl Wanted {
    /// The condition of a pass in that direction; `time_s` is not known yet.
    pub(super) fn condition(&self, direction: Direction, mu0: f64) -> Condition {
        Condition {
            amplitude: PeakToPeak::from_metres(self.amplitude_pp_m),
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            direction,
            normal_force_n: self.normal_force_n,
            mu0,
            position_m: self.position_m,
            time_s: 0.0,
            ambient_pressure_pa: self.ambient_pressure_pa,
        }
    }
}

impl Plan {
    /// The passes in the order of measurement.
    ///
    /// # Errors
    /// The first value beyond a limit, or that the rig cannot do, with its place in the file. Nothing has moved.
    pub fn points(&self, seed: u64, limits: &Limits, resolution: &Resolution) -> miette::Result<Vec<Point>> {
        let mut conditions = Vec::new();
        for index in 0..self.file.series.len() {
            self.check_series(index, limits)?;
            conditions.extend(self.conditions_of(index, resolution));
        }
        self.check_travel(&conditions, limits)?;
        Ok(self.order(conditions, seed))
    }

    /// The conditions of one series: the product of its lists, at what the amplifier can set.
    pub(super) fn conditions_of(&self, index: usize, resolution: &Resolution) -> Vec<Wanted> {
        let (series, base) = (&self.file.series[index], &self.file.base);
        let or_base = |list: &Vec<f64>, base: f64| if list.is_empty() { vec![base] } else { list.clone() };
        let pressures: Vec<Option<f64>> = match &series.ambient_pressure_pa[..] {
            [] => vec![None],
            listed => listed.iter().copied().map(Some).collect(),
        };
        let directions: Vec<Option<i8>> = match &series.directions[..] {
            [] => vec![None],
            listed => listed.iter().copied().map(Some).collect(),
        };
        let mut conditions = Vec::new();
        for &ambient_pressure_pa in &pressures {
            for &frequency_hz in &or_base(&series.frequency_hz, base.frequency_hz) {
                for &speed_m_s in &or_base(&series.speed_m_s, base.speed_m_s) {
                    for &normal_force_n in &or_base(&series.normal_force_n, base.normal_force_n) {
                        for &position_m in &or_base(&series.position_m, base.position_m) {
                            for &amplitude_pp_m in &or_base(&series.amplitude_pp_m, base.amplitude_pp_m) {
                                conditions.extend(directions.iter().map(|&direction| Wanted {
                                    amplitude_pp_m: resolution.amplitude(amplitude_pp_m),
                                    frequency_hz: resolution.frequency(frequency_hz),
                                    speed_m_s,
                                    normal_force_n,
                                    position_m,
                                    ambient_pressure_pa,
                                    direction,
                                }));
                            }
                        }
                    }
                }
            }
        }
        conditions
    }

    /// Repeats, shuffles within each pressure, interleaves references, and turns conditions into passes.
    fn order(&self, conditions: Vec<Wanted>, seed: u64) -> Vec<Point> {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let mut pressures: Vec<Option<f64>> = conditions.iter().map(|c| c.ambient_pressure_pa).collect();
        pressures.dedup();
        let mut points = Vec::new();
        for pressure in pressures {
            let here = conditions.iter().filter(|c| c.ambient_pressure_pa == pressure);
            let mut visits: Vec<(Wanted, u32)> =
                here.flat_map(|c| (0..self.file.replicates).map(move |r| (*c, r))).collect();
            if self.file.randomise {
                visits.shuffle(&mut rng);
            }
            let every = self.file.reference_every as usize;
            let mut references = 0;
            for (i, (wanted, replicate)) in visits.iter().enumerate() {
                if every > 0 && i % every == 0 {
                    self.visit(&mut points, &Wanted { amplitude_pp_m: 0.0, ..*wanted }, references, true);
                    references += 1;
                }
                self.visit(&mut points, wanted, *replicate, wanted.amplitude_pp_m == 0.0);
            }
            if let (true, Some((last, _))) = (every > 0, visits.last()) {
                self.visit(&mut points, &Wanted { amplitude_pp_m: 0.0, ..*last }, references, true);
            }
        }
        points
    }

    fn visit(&self, points: &mut Vec<Point>, wanted: &Wanted, replicate: u32, reference: bool) {
        let own = wanted.direction.map(|d| [d]);
        for sign in own.as_ref().map_or(&self.file.directions[..], |d| &d[..]) {
            let direction = Direction::try_from(*sign).expect("checked when the plan was read");
            points.push(Point {
                number: points.len() as u32,
                condition: wanted.condition(direction, 1.0),
                replicate,
                reference,
            });
        }
    }

    /// Length of stroke that a pass needs in m: settling, averaging, and getting up to speed.
    pub fn stroke_m(&self, speed_m_s: f64) -> f64 {
        speed_m_s * (self.file.pass.settle_s + self.file.pass.measure_s) * 1.1 + 1e-3
    }

    fn check_series(&self, index: usize, limits: &Limits) -> Result<(), BadInput> {
        let (series, base) = (&self.file.series[index], &self.file.base);
        let (lowest, highest) = limits.frequency_hz;
        let amplitude_max = limits.amplitude_max.metres().min(HARD.amplitude_max.metres());
        let tiny = f64::MIN_POSITIVE;
        let checks: [(&str, &[f64], f64, f64, f64); 6] = [
            ("amplitude_pp_m", &series.amplitude_pp_m, base.amplitude_pp_m, 0.0, amplitude_max),
            ("frequency_hz", &series.frequency_hz, base.frequency_hz, lowest, highest),
            ("speed_m_s", &series.speed_m_s, base.speed_m_s, tiny, limits.speed_max_m_s),
            ("normal_force_n", &series.normal_force_n, base.normal_force_n, tiny, limits.normal_force_max_n),
            ("position_m", &series.position_m, base.position_m, limits.travel_m.0, limits.travel_m.1),
            ("ambient_pressure_pa", &series.ambient_pressure_pa, 101_325.0, 0.0, 200_000.0),
        ];
        for (name, list, base, low, high) in checks {
            let listed = list.iter().map(|v| (true, *v));
            for (in_series, value) in listed.chain(list.is_empty().then_some((false, base))) {
                if value.is_finite() && value >= low && value <= high {
                    continue;
                }
                let place = if in_series {
                    series_place(&self.text, index, name)
                } else {
                    input::place_of(&self.text, &["base", name])
                };
                let low = if low == tiny { 0.0 } else { low };
                let problem =
                    format!("{name} = {value:e} is outside what this rig allows, {low:e} to {high:e}");
                let remedy =
                    "change the plan, or the [limits] of the setup below the hard limits".to_string();
                return Err(BadInput::new(&self.origin, &self.text, place, problem, remedy));
            }
        }
        Ok(())
    }

    fn check_travel(&self, conditions: &[Wanted], limits: &Limits) -> Result<(), BadInput> {
        let (left, right) = limits.travel_m;
        for c in conditions {
            let half = 0.5 * self.stroke_m(c.speed_m_s);
            if c.position_m - half < left || c.position_m + half > right {
                let (speed, position) = (c.speed_m_s, c.position_m);
                let problem = format!(
                    "a pass at {speed} m/s about {position} m needs {:.4} m of stroke; the travel is {left} to {right} m",
                    2.0 * half
                );
                let remedy = "shorten [pass] settle_s or measure_s, or slow down".to_string();
                let place = input::place_of(&self.text, &["pass", "measure_s"])
                    .or_else(|| input::place_of(&self.text, &["base", "speed_m_s"]));
                return Err(BadInput::new(&self.origin, &self.text, place, problem, remedy));
            }
        }
        Ok(())
    }
}

pub(super) fn series_place(text: &str, index: usize, name: &str) -> Option<std::ops::Range<usize>> {
    let table = toml::de::DeTable::parse(text).ok()?;
    let series = table.get_ref().get("series")?.get_ref().as_array()?;
    series.get(index)?.get_ref().as_table()?.get(name).map(toml::Spanned::span)
}
