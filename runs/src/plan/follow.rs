//! Whether a rig can follow a target, before anything moves: amplitude, rate, loop, plate, sensor and pad,
//! each with its number.

use super::{Plan, Point};
use crate::fidelity::dynamics::Dynamics;
use crate::format::{number, quantity};
use crate::input::{Problems, place_of};
use models::inverse::{Reach, quick};
use models::{Condition, FrictionModel, Target};
use realtime::Limits;
use std::f64::consts::TAU;

/// Cycles of the loop in one period of the target at least.
const CYCLES_MIN: f64 = 4.0;
/// Share of the setup's largest amplitude above which noise of the amplitude read back reaches the limit.
const ROOM: f64 = 0.99;
/// Share of a sine below which nothing is rendered.
const LEAST_GAIN: f64 = 0.3;

/// What a target demands of a rig at most.
struct Demand {
    /// Smallest and largest `mu'`.
    range: [f64; 2],
    /// Steepest change of `mu'` in 1/m.
    steepest_per_m: f64,
    /// Period in m of a sine of that range and steepness, or the shortest wave stated.
    period_m: f64,
}

fn demand(target: &Target, shortest_m: Option<f64>) -> Demand {
    let values = target.mu_relative.iter().copied();
    let range = values.fold([f64::INFINITY, 0.0], |[a, b], v| [v.min(a), v.max(b)]);
    let steps = target.mu_relative.windows(2).map(|v| (v[1] - v[0]).abs());
    let steepest_per_m = steps.fold(0.0, f64::max) / target.step_m;
    let sine = 0.5 * TAU * (range[1] - range[0]) / steepest_per_m.max(1e-12);
    let sine = if sine > 0.0 { sine } else { f64::INFINITY };
    Demand { range, steepest_per_m, period_m: shortest_m.unwrap_or(sine) }
}

impl Plan {
    /// Refuses a target that the rig cannot follow, and says of the rest what will be missing.
    ///
    /// # Errors
    /// Each reason why it cannot be followed, with its number.
    pub fn check_followed(
        &self,
        target: &Target,
        points: &[Point],
        law: &dyn FrictionModel,
        mu0: f64,
        limits: &Limits,
        known: &dyn Fn(f64) -> Dynamics,
    ) -> miette::Result<Vec<String>> {
        let Some(render) = &self.file.render else { return Ok(Vec::new()) };
        let demand = demand(target, render.shortest_m());
        let mut wrong = Problems::of(&self.origin, &self.text);
        let mut remarks = Vec::new();
        let mut seen: Vec<Condition> = Vec::new();
        for point in points.iter().filter(|p| !p.reference) {
            let c = Condition { mu0, direction: Default::default(), ..point.condition };
            if seen.contains(&c) {
                continue;
            }
            seen.push(c);
            let dynamics = known(c.frequency_hz);
            self.amplitudes(&demand, &c, law, limits, &mut wrong);
            let shown = (render.depth, render.tolerance);
            self.frequencies(&demand, &c, &dynamics, shown, &mut wrong, &mut remarks);
        }
        wrong.end()?;
        let limit = limits.amplitude_max;
        if seen.iter().any(|c| c.amplitude.metres() > ROOM * limit.metres()) {
            remarks.push(format!(
                "rendering may use the largest amplitude of the setup, {}: noise of the amplitude read back can trip SR-07 there; a smaller \
                 amplitude_pp_m leaves room",
                quantity(limit.metres(), "m")
            ));
        }
        Ok(remarks)
    }

    /// The amplitudes that the target needs, and how fast they change.
    fn amplitudes(
        &self,
        demand: &Demand,
        c: &Condition,
        law: &dyn FrictionModel,
        limits: &Limits,
        wrong: &mut Problems<'_>,
    ) {
        let speed = quantity(c.speed_m_s, "m/s");
        let place = ["depth", "file"].iter().find_map(|key| place_of(&self.text, &["render", key]));
        for wanted in demand.range {
            let found = quick(law, c, wanted, c.amplitude, None);
            let largest = quantity(c.amplitude.metres(), "m");
            let problem = match found.map(|f| (f.reach, f.mu_relative)) {
                None => format!("the law '{}' has no answer at {speed}", law.name()),
                Some((Reach::Within, _)) => {
                    // The amplitude changes at its fastest where friction does, at the flattest end of the
                    // law.
                    let slope = found.map_or(0.0, |f| f.slope_per_m).abs();
                    let rate = c.speed_m_s * demand.steepest_per_m / slope.max(1e-12);
                    let most = limits.amplitude_rate_max_m_s;
                    if wanted < 1.0 && rate > most {
                        let [rate, most] = [rate, most].map(|v| quantity(v, "m/s"));
                        let problem =
                            format!("at {speed} the amplitude must change by {rate}; the limit is {most}");
                        let remedy = "render more slowly, more coarsely or less deeply".to_string();
                        wrong.add_at(place.clone(), problem, remedy);
                    }
                    continue;
                }
                Some((Reach::TooLow, mu)) => {
                    format!("mu' = {wanted:.3} is wanted at {speed}; {largest} peak-to-peak gives {mu:.3}")
                }
                Some((_, mu)) => {
                    format!("mu' = {wanted:.3} is wanted at {speed}; '{}' reaches {mu:.3}", law.name())
                }
            };
            let remedy =
                "want another friction, give the series a larger amplitude_pp_m, or slide more slowly";
            wrong.add_at(place.clone(), problem, remedy.to_string());
        }
    }

    /// The frequencies of the target at the speeds of the passes, beside what loop, plate, sensor and pad leave of them.
    fn frequencies(
        &self,
        demand: &Demand,
        c: &Condition,
        dynamics: &Dynamics,
        (depth, tolerance): (f64, f64),
        wrong: &mut Problems<'_>,
        remarks: &mut Vec<String>,
    ) {
        let (speed, period) = (quantity(c.speed_m_s, "m/s"), quantity(demand.period_m, "m"));
        let hz = c.speed_m_s / demand.period_m;
        let passes = format!("a period of {period} at {speed} is {} Hz", number(hz));
        let place = || ["period_m", "target"].iter().find_map(|key| place_of(&self.text, &["render", key]));
        let remedy = || "slide more slowly, or render longer waves".to_string();
        let most = 1.0 / (CYCLES_MIN * dynamics.cycle_s);
        if hz > most {
            let problem =
                format!("{passes}; the loop follows {} Hz ({CYCLES_MIN} cycles a period)", number(most));
            return wrong.add_at(place(), problem, remedy());
        }
        let share = |v: f64| format!("{:.0} %", 100.0 * v);
        let gain = dynamics.gain(hz);
        let [plate, sensor] = [dynamics.plate(hz), dynamics.sensor(hz)].map(share);
        let left = format!(
            "{passes}: {} of its depth is rendered and seen (plate {plate}, sensor {sensor})",
            share(gain)
        );
        if gain < LEAST_GAIN {
            return wrong.add_at(place(), left, remedy());
        }
        if depth * (1.0 - gain) > tolerance {
            remarks.push(left);
        }
        let needed = c.mu0 * c.normal_force_n * demand.steepest_per_m;
        if let Some(pad) = dynamics.pad_n_per_m.filter(|pad| needed > *pad) {
            let [needed, pad] = [needed, pad].map(|v| quantity(v, "N/m"));
            remarks.push(format!(
                "{period}: friction must rise by {needed}; the finger's pad raises it by {pad} at most"
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It was one of 0 um, or inf Hz: "slide more slowly".
    #[test]
    fn a_flat_target_has_no_period() {
        let flat =
            Target { start_m: 0.0, step_m: 0.01, mu_relative: vec![0.5; 3], lead_s: 0.0, feedback: None };
        assert_eq!(demand(&flat, None).period_m, f64::INFINITY);
        let bump = Target { mu_relative: vec![0.5, 0.6, 0.5], ..flat };
        assert!((demand(&bump, None).period_m - 0.01 * std::f64::consts::PI).abs() < 1e-12);
    }
}
