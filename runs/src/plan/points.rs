//! From a plan to its passes, each checked against the limits before anything moves.

use super::Plan;
use crate::format::quantity;
use crate::input::{self, BadInput, Problems, unit_meant};
use models::{Ambient, Condition, Covariate, Direction, PeakToPeak};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha12Rng;
use realtime::safety::{HARD, Limits};
use serde::{Deserialize, Serialize};
use std::ops::Range;

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
    /// How many times the drive goes off and on after the average.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub edges: u32,
}

const fn is_zero(n: &u32) -> bool {
    *n == 0
}

/// What the amplifier can set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolution {
    /// Step of the amplitude set-point in m, peak-to-peak.
    pub amplitude_pp_m: f64,
    /// Step of the frequency set-point in Hz.
    pub frequency_hz: f64,
}

/// Steps of the amplifier that an amplitude has at least: the loop looks for a fifth of it (SR-22), which is
/// then one step.
const STEPS_MIN: f64 = 5.0;

fn quantised(wanted: f64, step: f64) -> f64 {
    if step > 0.0 { (wanted / step).round() * step } else { wanted }
}

/// A condition of a series, and how it is visited.
#[derive(Clone, Copy)]
pub(super) struct Visit<'a> {
    pub(super) condition: Condition,
    /// The directions, in turn.
    directions: &'a [i8],
    edges: u32,
    /// How often the series left this state of the air before: 1 where a chamber has gone back to a pressure.
    returns: u32,
}

impl Plan {
    /// The passes in the order of measurement.
    ///
    /// # Errors
    /// Every value beyond a limit, or else the first pass that needs more travel than there is, with its
    /// place in the file. Nothing has moved.
    pub fn points(&self, seed: u64, limits: &Limits, resolution: &Resolution) -> miette::Result<Vec<Point>> {
        let mut wrong = Problems::of(&self.origin, &self.text);
        let allows = |c: &Covariate| Some((allowed(c, limits), "this rig allows".to_string()));
        for index in 0..self.file.series.len() {
            self.check_series(index, &allows, &mut wrong);
            self.check_settable(index, resolution, &mut wrong);
        }
        self.check_left_behind(&mut wrong);
        wrong.end()?;
        let conditions: Vec<Visit<'_>> =
            (0..self.file.series.len()).flat_map(|index| self.conditions_of(index, resolution)).collect();
        self.check_travel(&conditions, limits)?;
        Ok(self.order(&conditions, seed))
    }

    /// The conditions of one series: the product of its lists, at what the amplifier can set.
    pub(super) fn conditions_of(&self, index: usize, resolution: &Resolution) -> Vec<Visit<'_>> {
        let series = &self.file.series[index];
        let mut conditions = vec![self.file.base.condition()];
        for (covariate, list) in series.lists() {
            if !list.is_empty() {
                let each = |c: &Condition| {
                    let with = |&value: &f64| {
                        let mut c = *c;
                        covariate.put(&mut c, value);
                        c
                    };
                    list.iter().map(with).collect::<Vec<_>>()
                };
                conditions = conditions.iter().flat_map(each).collect();
            }
        }
        let set = |c: Condition| Condition {
            amplitude: PeakToPeak::from_metres(quantised(c.amplitude.metres(), resolution.amplitude_pp_m)),
            frequency_hz: quantised(c.frequency_hz, resolution.frequency_hz),
            ..c
        };
        // A series' own directions are settings like others; the plan's are visited in turn.
        let (mut left, mut here) = (Vec::new(), None);
        let visits = |condition: Condition| -> Vec<Visit<'_>> {
            let state = Ambient::of(&condition);
            if here != Some(state) {
                left.extend(here.replace(state));
            }
            let returns = left.iter().filter(|was| **was == state).count() as u32;
            let visit = |directions| Visit { condition, directions, edges: series.edges, returns };
            match &series.directions[..] {
                [] => vec![visit(&self.file.directions[..])],
                own => own.iter().map(|d| visit(std::slice::from_ref(d))).collect(),
            }
        };
        conditions.into_iter().map(set).flat_map(visits).collect()
    }

    /// Repeats, shuffles within each visit of a state of the air, interleaves references, and turns
    /// conditions into passes.
    fn order<'a>(&'a self, conditions: &[Visit<'a>], seed: u64) -> Vec<Point> {
        let mut rng = ChaCha12Rng::seed_from_u64(seed);
        let state_of = |v: &Visit<'_>| (Ambient::of(&v.condition), v.returns);
        let mut states: Vec<(Ambient, u32)> = Vec::new();
        for visit in conditions {
            let state = state_of(visit);
            if !states.contains(&state) {
                states.push(state);
            }
        }
        // What leaves the air as it is comes before anything is set.
        states.sort_by_key(|(state, _)| *state != Ambient::default());
        let mut points = Vec::new();
        for state in states {
            let here = conditions.iter().filter(|v| state_of(v) == state);
            let repeats = state.1 * self.file.replicates..(state.1 + 1) * self.file.replicates;
            let mut visits: Vec<_> = here.flat_map(|v| repeats.clone().map(move |r| (v, r))).collect();
            if self.file.randomise {
                visits.shuffle(&mut rng);
            }
            let every = self.file.reference_every as usize;
            let mut references = 0;
            let still = |v: &Visit<'a>| Visit {
                condition: Condition { amplitude: PeakToPeak::ZERO, ..v.condition },
                edges: 0,
                ..*v
            };
            for (i, (here, replicate)) in visits.iter().enumerate() {
                if every > 0 && i % every == 0 {
                    visit(&mut points, &still(here), references, true);
                    references += 1;
                }
                let reference = here.condition.amplitude == PeakToPeak::ZERO;
                let edges = if reference { 0 } else { here.edges };
                visit(&mut points, &Visit { edges, ..**here }, *replicate, reference);
            }
            if let (true, Some((last, _))) = (every > 0, visits.last()) {
                visit(&mut points, &still(last), references, true);
            }
        }
        points
    }

    /// Length of stroke that a pass needs in m: settling, averaging, edges, and getting up to speed.
    pub fn stroke_m(&self, speed_m_s: f64, edges: u32) -> f64 {
        speed_m_s * self.file.pass.sliding_s(edges, speed_m_s)[0] * 1.1 + 1e-3
    }

    /// Where the values of a series stand: with it, or with the base.
    fn setting(&self, index: usize, name: &str) -> Option<Range<usize>> {
        series_place(&self.text, index, name).or_else(|| input::place_of(&self.text, &["base", name]))
    }

    /// Tells of every value of a series that is outside what somebody allows.
    pub(super) fn check_series(
        &self,
        index: usize,
        allows: &dyn Fn(&Covariate) -> Option<([f64; 2], String)>,
        wrong: &mut Problems<'_>,
    ) {
        let series = &self.file.series[index];
        let base = self.file.base.condition();
        for (covariate, list) in series.lists() {
            let name = covariate.name;
            let Some(([low, high], by)) = allows(covariate) else { continue };
            let based = covariate.of(&base).filter(|_| list.is_empty());
            for value in list.iter().copied().chain(based) {
                if value.is_finite() && value >= low && value <= high {
                    continue;
                }
                let place = self.setting(index, name);
                let remedy = unit_meant(name, value, [low, high]).unwrap_or_else(|| match value {
                    v if v < 0.0 && low >= 0.0 => {
                        format!("{name} is a magnitude: write it without the minus sign")
                    }
                    0.0 if low >= 0.0 => format!("give {name} a value above zero"),
                    _ => "change the plan, or the [limits] of the setup below the hard limits".into(),
                });
                let low = if low == f64::MIN_POSITIVE { 0.0 } else { low };
                let [value, low, high] = [value, low, high].map(|v| quantity(v, input::unit_of(name)));
                let problem = format!("{name} = {value} is outside what {by}, {low} to {high}");
                wrong.add_at(place, problem, remedy);
            }
        }
    }

    /// Tells of every amplitude of a series that the amplifier would set to nothing, or to so little that the
    /// run would end for a plate that does not respond.
    fn check_settable(&self, index: usize, resolution: &Resolution, wrong: &mut Problems<'_>) {
        let list = &self.file.series[index].amplitude_pp_m;
        let based = list.is_empty().then_some(self.file.base.amplitude_pp_m);
        let least = STEPS_MIN * resolution.amplitude_pp_m;
        // 5e-9 is not below five times 1e-9, whatever the last digits say.
        for value in list.iter().copied().chain(based).filter(|w| *w > 0.0 && *w < least * (1.0 - 1e-9)) {
            let place = self.setting(index, "amplitude_pp_m");
            let [value, step, least] = [value, resolution.amplitude_pp_m, least].map(|w| quantity(w, "m"));
            let problem = format!(
                "amplitude_pp_m = {value} is too small for this rig: the amplifier sets steps of {step}, and of \
                 less than {STEPS_MIN} steps the loop cannot see whether the plate responds (SR-22)"
            );
            let remedy = format!("give at least {least}, or 0 for a pass without vibration");
            wrong.add_at(place, problem, remedy);
        }
    }

    fn check_travel(&self, conditions: &[Visit<'_>], limits: &Limits) -> Result<(), BadInput> {
        let (left, right) = limits.travel_m;
        for Visit { condition: c, edges, .. } in conditions {
            let half = 0.5 * self.stroke_m(c.speed_m_s, *edges);
            if c.position_m - half < left || c.position_m + half > right {
                let [speed, position, stroke, left, right] =
                    [(c.speed_m_s, "m/s"), (c.position_m, "m"), (2.0 * half, "m"), (left, "m"), (right, "m")]
                        .map(|(value, unit)| quantity(value, unit));
                let problem = format!(
                    "a pass at {speed} about {position} needs {stroke} of stroke; the travel is {left} to {right}"
                );
                let remedy = "shorten [pass] settle_s, measure_s or edge_s, have fewer edges, or slow down"
                    .to_string();
                let place = input::place_of(&self.text, &["pass", "measure_s"])
                    .or_else(|| input::place_of(&self.text, &["base", "speed_m_s"]));
                return Err(BadInput::new(&self.origin, &self.text, place, problem, remedy));
            }
        }
        Ok(())
    }
}

/// Makes the passes of one visit, in each of its directions.
fn visit(points: &mut Vec<Point>, visit: &Visit<'_>, replicate: u32, reference: bool) {
    let Visit { condition, directions, edges, .. } = *visit;
    for sign in directions {
        let direction = Direction::try_from(*sign).expect("checked when the plan was read");
        let number = points.len() as u32;
        let condition = Condition { direction, ..condition };
        points.push(Point { number, condition, replicate, reference, edges });
    }
}

/// What this rig's limits leave of a setting.
fn allowed(covariate: &Covariate, limits: &Limits) -> [f64; 2] {
    match covariate.name {
        "amplitude_pp_m" => [0.0, limits.amplitude_max.metres().min(HARD.amplitude_max.metres())],
        "frequency_hz" => [limits.frequency_hz.0, limits.frequency_hz.1],
        "speed_m_s" => [f64::MIN_POSITIVE, limits.speed_max_m_s],
        "normal_force_n" => [f64::MIN_POSITIVE, limits.normal_force_max_n],
        "position_m" => [limits.travel_m.0, limits.travel_m.1],
        _ => crate::ambient::possible(covariate),
    }
}

pub(crate) fn series_place(text: &str, index: usize, name: &str) -> Option<Range<usize>> {
    input::place_in(text, "series", index, name)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two series without a load of their own: the base's was reported twice, with the rig's limits as the
    /// remedy.
    #[test]
    fn a_negative_load_is_one_problem_and_its_minus_sign_the_remedy() {
        let text = "name = \"p\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
                    normal_force_n = -0.25\n[[series]]\namplitude_pp_m = [1e-6]\n[[series]]\nspeed_m_s = [0.04]\n";
        let plan = Plan::parse("p", text).unwrap();
        let limits = Limits::paper(realtime::ports::Nanos(1_000_000));
        let resolution = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        let why = plan.points(1, &limits, &resolution).unwrap_err();
        assert!(why.to_string().starts_with("normal_force_n = -0.25 N is outside"), "{why}");
        let help = why.help().unwrap().to_string();
        assert_eq!(help, "normal_force_n is a magnitude: write it without the minus sign");
    }

    /// Every pass of it was made twice.
    #[test]
    fn a_series_that_is_there_twice_is_refused_in_its_place() {
        let series = |name: &str| format!("[[series]]\nname = \"{name}\"\namplitude_pp_m = [1e-6, 2e-6]\n");
        let base = "name = \"p\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
                    normal_force_n = 0.25\n";
        let text = format!("{base}{}{}", series("a"), series("a"));
        let why = Plan::parse("p", &text).unwrap_err();
        assert!(format!("{why:?}").contains("p:12:18") && why.help().is_some(), "{why:?}");
        Plan::parse("p", &format!("{text}edges = 1\n")).unwrap();
        // As a designed experiment repeats a condition.
        Plan::parse("p", &format!("{base}{}{}", series("a"), series("b"))).unwrap();
    }

    /// It had neither a place nor a remedy.
    #[test]
    fn a_direction_of_a_series_that_is_none_is_refused_in_its_place() {
        let text = "name = \"p\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
                    normal_force_n = 0.25\n[[series]]\namplitude_pp_m = [1e-6]\ndirections = [2]\n";
        let why = Plan::parse("p", text).unwrap_err();
        assert!(format!("{why:?}").contains("p:9:14"), "{why:?}");
        assert_eq!(why.help().unwrap().to_string(), "write [1], [-1] or [1, -1]");
    }

    /// 1 nm ended in a trip of a plate that does not respond, and 0.4 nm was no vibration, in silence.
    #[test]
    fn an_amplitude_below_what_the_amplifier_sets_is_refused_in_its_place() {
        let text = "name = \"p\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
                    normal_force_n = 0.25\n[[series]]\namplitude_pp_m = [0, WWW, 2e-6]\n";
        let limits = Limits::paper(realtime::ports::Nanos(1_000_000));
        let of = |w: &str, step| {
            let plan = Plan::parse("p", &text.replace("WWW", w)).unwrap();
            plan.points(1, &limits, &Resolution { amplitude_pp_m: step, frequency_hz: 0.1 })
        };
        for w in ["0.4e-9", "1e-9", "4.9e-9"] {
            let why = of(w, 1e-9).unwrap_err();
            assert!(why.to_string().contains("steps of 1 nm"), "{w}: {why}");
            let help = why.help().unwrap().to_string();
            assert_eq!(help, "give at least 5 nm, or 0 for a pass without vibration");
            assert!(format!("{why:?}").contains("p:8:18"), "{why:?}");
        }
        assert!(of("5e-9", 1e-9).is_ok() && of("1e-9", 0.0).is_ok());
    }

    /// Two series that list the same pressures: each of their passes was made twice, and a pressure was
    /// visited again.
    #[test]
    fn series_that_share_their_pressures_are_grouped_by_pressure_and_made_once() {
        let series = "[[series]]\nambient_pressure_pa = [101325, 50000]\n";
        let text = format!(
            "name = \"p\"\nreference_every = 0\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
             normal_force_n = 0.25\n{series}amplitude_pp_m = [1e-6, 2e-6]\n{series}speed_m_s = [0.01, 0.04]\n"
        );
        let plan = Plan::parse("p", &text).unwrap();
        let limits = Limits::paper(realtime::ports::Nanos(1_000_000));
        let points = plan.points(1, &limits, &Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 }).unwrap();
        // Two pressures, four conditions each, both ways.
        assert_eq!(points.len(), 16);
        let pressures: Vec<_> = points.iter().map(|p| p.condition.ambient_pressure_pa.unwrap()).collect();
        assert_eq!(pressures.windows(2).filter(|w| w[0] != w[1]).count(), 1, "{pressures:?}");
        // A series that leaves the pressure as it is is measured before a chamber was ever set.
        let plan = Plan::parse("p", &format!("{text}[[series]]\namplitude_pp_m = [3e-6]\n")).unwrap();
        let points = plan.points(1, &limits, &Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 }).unwrap();
        assert!(points[..2].iter().all(|p| p.condition.ambient_pressure_pa.is_none()), "{points:?}");
    }

    /// A chamber that returns to a pressure shows whether the friction does too: the last level was measured
    /// together with the first.
    #[test]
    fn a_pressure_that_a_series_returns_to_is_visited_again_at_its_place() {
        let text = "name = \"p\"\nreference_every = 0\ndirections = [1]\nreplicates = 2\n[base]\namplitude_pp_m = 2e-6\n\
                    frequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
                    ambient_pressure_pa = [101325, 50000, 101325]\n";
        let plan = Plan::parse("p", text).unwrap();
        let limits = Limits::paper(realtime::ports::Nanos(1_000_000));
        let points = plan.points(1, &limits, &Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 }).unwrap();
        let visits: Vec<_> =
            points.iter().map(|p| (p.condition.ambient_pressure_pa.unwrap(), p.replicate / 2)).collect();
        let [first, low, last] = [(101_325.0, 0), (50_000.0, 0), (101_325.0, 1)];
        assert_eq!(visits, [first, first, low, low, last, last]);
    }
}
