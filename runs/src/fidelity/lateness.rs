//! How late the parts of a rendered run come, beside what is known of them: a slow amplifier or plate shows
//! between the wanted friction and that at the amplitude read back, a slow sensor between that and the
//! measured one.

use super::dynamics::Dynamics;
use super::{Rendered, Sample};
use serde::{Deserialize, Serialize};

/// How late a part comes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Late {
    /// Name: `loop_and_plate`, `sensor`.
    pub part: String,
    /// Its delay in s: mean over the passes.
    pub delay_s: f64,
    /// Standard deviation of that mean in s.
    pub sd_s: f64,
    /// Delay in s that is known of it.
    pub known_s: f64,
    /// Whether it is slower than known, by more than its scatter and what the loop resolves.
    pub slower: bool,
}

/// What the lateness of the passes of a group comes to.
pub(super) struct Found {
    /// Way in m by which the measured friction comes after the wanted one, for each pass.
    pub ways: Vec<f64>,
    /// Root-mean-square difference of `mu'` with that way taken out of each pass.
    pub rms_shifted: f64,
    /// The same with the known delay taken out.
    pub rms_known: Option<f64>,
    /// The same with the mean way of the other passes taken out.
    pub rms_held_out: Option<f64>,
    /// The parts.
    pub parts: Vec<Late>,
}

/// Steps of the search either side of what is known.
const STEPS: i32 = 120;
/// How far it goes: this time at the speed of the pass, at least this way, at most this share of a period.
const UP_TO_S: f64 = 0.12;
const UP_TO_M: f64 = 0.2e-3;
const UP_TO_PERIODS: f64 = 0.45;
/// Nor further than this share of the shortest pass, so that what is compared stays most of it.
const UP_TO_PASS: f64 = 0.25;
/// Samples of a pass that are compared at most.
const COMPARED: usize = 2000;
/// Standard deviations, and cycles of the loop, by which a part that is slower than known exceeds it.
const SURE: f64 = 3.0;
const RESOLVED_CYCLES: f64 = 1.5;

/// Two series of a pass over the way that was slid.
struct Pair {
    from: Vec<(f64, f64)>,
    to: Vec<(f64, f64)>,
}

impl Pair {
    fn of(pass: &Rendered, from: fn(&Sample) -> f64, to: fn(&Sample) -> f64) -> Self {
        let sign = if pass.forward { 1.0 } else { -1.0 };
        let every = pass.samples.len() / COMPARED + 1;
        let series = |of: fn(&Sample) -> f64| pass.samples.iter().map(move |s| (sign * s.x_m, of(s)));
        Pair { from: series(from).collect(), to: series(to).step_by(every).collect() }
    }

    /// Mean square difference where the second series comes this way after the first.
    fn off(&self, way: f64) -> f64 {
        let pairs = self.to.iter().filter_map(|(x, y)| Some((y - at(&self.from, x - way)?).powi(2)));
        let (sum, count) = pairs.fold((0.0, 0.0f64), |(sum, count), square| (sum + square, count + 1.0));
        sum / count.max(1.0)
    }

    /// The way of best agreement within `half` of `around`, with a parabola through the three best steps, and
    /// whether it lies inside.
    fn way(&self, around: f64, half: f64) -> (f64, bool) {
        let step = half / f64::from(STEPS);
        let all: Vec<f64> = (-STEPS..=STEPS).map(|k| self.off(around + f64::from(k) * step)).collect();
        let best = (0..all.len()).min_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or(0);
        let place = best.clamp(1, all.len() - 2);
        let [a, b, c] = [all[place - 1], all[place], all[place + 1]];
        let bend = a - 2.0 * b + c;
        let part = if bend > 0.0 { (0.5 * (a - c) / bend).clamp(-1.0, 1.0) } else { 0.0 };
        (around + step * (place as f64 - f64::from(STEPS) + part), place == best && bend > 0.0)
    }
}

/// A line of points with increasing places, read linearly.
fn at(points: &[(f64, f64)], x: f64) -> Option<f64> {
    let k = points.partition_point(|p| p.0 < x);
    let (a, b) = (points.get(k.checked_sub(1)?)?, points.get(k)?);
    Some(if b.0 > a.0 { a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0) } else { b.1 })
}

fn mean(values: impl Iterator<Item = f64> + Clone) -> f64 {
    values.clone().sum::<f64>() / values.count().max(1) as f64
}

/// Of passes at one speed in m/s. `lead_s` is the time by which the target was read ahead, `period_m` the
/// period of a grating; `open` without feedback, which makes a part's delay one of all parts.
pub(super) fn of(
    passes: &[&Rendered],
    speed: f64,
    known: Option<&Dynamics>,
    (lead_s, period_m, open): (f64, Option<f64>, bool),
) -> Found {
    let slid = |pass: &&Rendered| match (pass.samples.first(), pass.samples.last()) {
        (Some(first), Some(last)) => (last.x_m - first.x_m).abs(),
        _ => 0.0,
    };
    let shortest = passes.iter().map(slid).fold(f64::INFINITY, f64::min);
    let most = period_m.map_or(f64::INFINITY, |m| UP_TO_PERIODS * m).min(UP_TO_PASS * shortest);
    let half = (UP_TO_S * speed).max(UP_TO_M).min(most);
    let found = |known_s: f64, from: fn(&Sample) -> f64, to: fn(&Sample) -> f64| -> Vec<(Pair, f64, bool)> {
        let each = |pass: &&Rendered| {
            let pair = Pair::of(pass, from, to);
            let (way, inside) = pair.way(known_s * speed, half);
            (pair, way, inside)
        };
        passes.iter().map(each).collect()
    };
    let expected = known.map(|known| known.delay_s() - lead_s);
    let all = found(expected.unwrap_or(0.0), |s| s.wanted, |s| s.measured);
    let rms = |way: &dyn Fn(usize) -> f64| {
        mean(all.iter().enumerate().map(|(i, (pair, ..))| pair.off(way(i)))).sqrt()
    };
    let ways: Vec<f64> = all.iter().map(|found| found.1).collect();
    let others = |i: usize| (ways.iter().sum::<f64>() - ways[i]) / (ways.len() - 1) as f64;
    let part = |name: &str, known_s: f64, from, to| {
        let found = found(known_s, from, to);
        let n = found.len() as f64;
        let delay_s = mean(found.iter().map(|f| f.1 / speed));
        let square = mean(found.iter().map(|f| (f.1 / speed - delay_s).powi(2)));
        let sd_s = (square / (n - 1.0)).sqrt();
        let cycle_s = known.map_or(0.0, |known| known.cycle_s);
        let slower = delay_s - known_s > (SURE * sd_s).max(RESOLVED_CYCLES * cycle_s);
        let late = Late { part: name.into(), delay_s, sd_s, known_s, slower };
        (n > 1.0 && found.iter().all(|f| f.2)).then_some(late)
    };
    let parts = known.filter(|_| open).map_or_else(Vec::new, |known| {
        let [sensor, before] = [known.sensor_part_s(), known.delay_s() - known.sensor_part_s()];
        let drive = part("loop_and_plate", before - lead_s, |s| s.wanted, |s| s.predicted);
        drive.into_iter().chain(part("sensor", sensor, |s| s.predicted, |s| s.measured)).collect()
    });
    Found {
        rms_shifted: rms(&|i| ways[i]),
        rms_known: expected.map(|s| rms(&|_| s * speed)),
        rms_held_out: (ways.len() > 1).then(|| rms(&others)),
        parts,
        ways,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sines with delays that are put in, on a stroke shorter than the search would like.
    #[test]
    fn delays_that_were_put_in_are_found_and_what_exceeds_the_known_is_slower() {
        let (speed, period, cycle_s) = (0.04, 1e-3, 1e-3);
        let known = Dynamics {
            ring_time_s: 1e-3,
            amplifier_s: 0.0,
            cycle_s,
            sensor_hz: None,
            sensor_delay_s: 2e-3,
            pad_n_per_m: None,
        };
        let pass = |forward: bool| {
            let sign = if forward { 1.0 } else { -1.0 };
            let of = |k: u32| {
                let way = speed * cycle_s * f64::from(k);
                let at = |late_s: f64| (std::f64::consts::TAU * (way - speed * late_s) / period).sin();
                let [wanted, predicted, measured] = [0.0, 6e-3, 8e-3].map(|late| 0.6 + 0.1 * at(late));
                Sample { x_m: sign * way, wanted, commanded_pp_m: 1e-6, predicted, measured, reached: true }
            };
            Rendered { point: 0, key: [speed, 0.25, 3e4], forward, samples: (0..60).map(of).collect() }
        };
        let passes = [pass(true), pass(false), pass(true)];
        let passes: Vec<&Rendered> = passes.iter().collect();
        let found = of(&passes, speed, Some(&known), (0.0, Some(period), true));
        let [drive, sensor] = &found.parts[..] else { panic!("{:?}", found.parts) };
        assert!((drive.delay_s - 6e-3).abs() < 5e-5 && drive.slower, "{drive:?}");
        assert!((sensor.delay_s - 2e-3).abs() < 5e-5 && !sensor.slower, "{sensor:?}");
        assert!(found.ways.iter().all(|way| (way / speed - 8e-3).abs() < 5e-5), "{:?}", found.ways);
        assert!(found.rms_known.unwrap() > 0.05 && found.rms_held_out.unwrap() < 2e-3);
    }
}
