//! How late the parts of a rendered run come, beside what is known of them: a slow amplifier or plate shows
//! between the wanted friction and that at the amplitude read back, a slow sensor between that and the
//! measured one.

use super::dynamics::Dynamics;
use super::{Rendered, Sample};
use calibration::uncertainty::student::coverage_factor;
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
pub(super) struct GroupLateness {
    /// Way in m by which the measured friction comes after the wanted one, for each pass; none: [`HIDDEN`].
    pub ways: Vec<Option<f64>>,
    /// Root-mean-square difference of `mu'` with that way taken out of each pass that has one.
    pub rms_shifted: f64,
    /// The same with the known delay taken out.
    pub rms_known: Option<f64>,
    /// The same with the mean way of the other passes taken out.
    pub rms_held_out: Option<f64>,
    /// The parts.
    pub parts: Vec<Late>,
}

/// Why a pass has no way of best agreement.
pub(super) const HIDDEN: &str =
    "a shift looks like an offset or a gain of mu' on this stroke, or is beyond what is searched";

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
/// Misfit on both sides of the best way, at least, beside that of the best; 1e-12 is rounding.
const SHOWN: f64 = 1.5;
/// Coverage of the interval (three standard deviations of many passes), and cycles of the loop, by which a
/// part that is slower than known exceeds it.
const SURE: f64 = 0.9973;
const RESOLVED_CYCLES: f64 = 1.5;
/// Passes that show scatter at least.
const PASSES_MIN: f64 = 3.0;

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

    /// The same between these places, less the best offset and gain: a law that is off is not late. A gain
    /// below 0 would take half a period for agreement.
    fn misfit(&self, way: f64, [low, high]: [f64; 2]) -> f64 {
        let inside = self.to.iter().filter(|(x, _)| (low..=high).contains(x));
        let pairs: Vec<[f64; 2]> = inside.filter_map(|(x, y)| Some([at(&self.from, x - way)?, *y])).collect();
        let [mx, my] = [0, 1].map(|i| mean(pairs.iter().map(|pair| pair[i])));
        let product =
            |i: usize, j: usize| mean(pairs.iter().map(|p| (p[i] - [mx, my][i]) * (p[j] - [mx, my][j])));
        let (xx, xy) = (product(0, 0), product(0, 1).max(0.0));
        product(1, 1) - if xx > 0.0 { xy * xy / xx } else { 0.0 }
    }

    /// The way of best agreement within `half` of `around`, with a parabola through the three best steps.
    fn way(&self, around: f64, half: f64) -> Option<f64> {
        let [first, last] = [self.from.first()?.0, self.from.last()?.0];
        // The same places for all ways: on a straight line the misfit is then the same.
        let places = [first + around + half, last + around - half];
        let step = half / f64::from(STEPS);
        let of = |k: i32| self.misfit(around + f64::from(k) * step, places);
        let all: Vec<f64> = (-STEPS..=STEPS).map(of).collect();
        let best = (0..all.len()).min_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap_or(0);
        let most = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        if most(&all[..best]).min(most(&all[best..])) <= SHOWN * all[best] + 1e-12 {
            return None;
        }
        let [a, b, c] = [all[best - 1], all[best], all[best + 1]];
        let part = 0.5 * (a - c) / (a - 2.0 * b + c);
        Some(around + step * (best as f64 - f64::from(STEPS) + part))
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
) -> GroupLateness {
    let slid = |pass: &&Rendered| (pass.samples[pass.samples.len() - 1].x_m - pass.samples[0].x_m).abs();
    let shortest = passes.iter().map(slid).fold(f64::INFINITY, f64::min);
    let most = period_m.map_or(f64::INFINITY, |m| UP_TO_PERIODS * m).min(UP_TO_PASS * shortest);
    let half = (UP_TO_S * speed).max(UP_TO_M).min(most);
    let found =
        |known_s: f64, from: fn(&Sample) -> f64, to: fn(&Sample) -> f64| -> Vec<(Option<f64>, Pair)> {
            let pairs = passes.iter().map(|pass| Pair::of(pass, from, to));
            pairs.map(|pair| (pair.way(known_s * speed, half), pair)).collect()
        };
    let expected = known.map(|known| known.delay_s() - lead_s);
    let all = found(expected.unwrap_or(0.0), |s| s.wanted, |s| s.measured);
    let rms = |way: &dyn Fn(usize) -> f64| {
        mean(all.iter().enumerate().map(|(i, (_, pair))| pair.off(way(i)))).sqrt()
    };
    let ways: Vec<Option<f64>> = all.iter().map(|found| found.0).collect();
    let others = |i: usize| mean(ways[..i].iter().chain(&ways[i + 1..]).copied().flatten());
    let part = |name: &str, known_s: f64, from, to| {
        let found: Vec<f64> = found(known_s, from, to).into_iter().map(|f| f.0).collect::<Option<_>>()?;
        let n = found.len() as f64;
        let delay_s = mean(found.iter().map(|way| way / speed));
        let sd_s = (mean(found.iter().map(|way| (way / speed - delay_s).powi(2))) / (n - 1.0)).sqrt();
        let cycle_s = known.map_or(0.0, |known| known.cycle_s);
        let least = (coverage_factor(SURE, n - 1.0) * sd_s).max(RESOLVED_CYCLES * cycle_s);
        let slower = n >= PASSES_MIN && delay_s - known_s > least;
        (n > 1.0).then(|| Late { part: name.into(), delay_s, sd_s, known_s, slower })
    };
    let parts = known.filter(|_| open).map_or_else(Vec::new, |known| {
        let [sensor, before] = [known.sensor_part_s(), known.delay_s() - known.sensor_part_s()];
        let drive = part("loop_and_plate", before - lead_s, |s| s.wanted, |s| s.predicted);
        drive.into_iter().chain(part("sensor", sensor, |s| s.predicted, |s| s.measured)).collect()
    });
    GroupLateness {
        rms_shifted: rms(&|i| ways[i].unwrap_or(0.0)),
        rms_known: expected.map(|s| rms(&|_| s * speed)),
        rms_held_out: (ways.iter().flatten().count() > 1).then(|| rms(&others)),
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
        assert!(found.ways.iter().all(|way| (way.unwrap() / speed - 8e-3).abs() < 5e-5), "{:?}", found.ways);
        assert!(found.rms_known.unwrap() > 0.05 && found.rms_held_out.unwrap() < 2e-3);
    }

    /// Passes of `shape` with these delays of the measurement in s, and `mu'` off by an offset and a gain.
    fn passes(shape: fn(f64) -> f64, late_s: &[f64]) -> Vec<Rendered> {
        let pass = |late_s: &f64| {
            let of = |k: u32| {
                let x_m = 2e-5 * f64::from(k);
                // A small wave that the target does not have.
                let measured = 0.03 + 1.1 * shape(x_m - 0.02 * late_s) + 0.003 * (9e3 * x_m).sin();
                let wanted = shape(x_m);
                Sample { x_m, wanted, commanded_pp_m: 1e-6, predicted: wanted, measured, reached: true }
            };
            let samples = (0..1000).map(of).collect();
            Rendered { point: 0, key: [0.02, 0.25, 3e4], forward: true, samples }
        };
        late_s.iter().map(pass).collect()
    }

    fn found(passes: &[Rendered]) -> GroupLateness {
        let known = Dynamics {
            ring_time_s: 0.0,
            amplifier_s: 0.0,
            cycle_s: 1e-4,
            sensor_hz: None,
            sensor_delay_s: 1.6e-3,
            pad_n_per_m: None,
        };
        of(&passes.iter().collect::<Vec<_>>(), 0.02, Some(&known), (0.0, None, true))
    }

    /// An offset of a ramp looked like 59 ms, and the sensor was accused.
    #[test]
    fn a_ramp_has_no_delay_and_a_bump_that_is_off_has_the_one_put_in() {
        let ramp = found(&passes(|x| 0.4 + 20.0 * x, &[1.6e-3; 3]));
        assert!(ramp.ways.iter().all(|way| way.is_none()) && ramp.parts.is_empty(), "{:?}", ramp.ways);
        assert!(ramp.rms_held_out.is_none() && ramp.rms_shifted > 0.02, "{}", ramp.rms_shifted);
        let bump = |x: f64| 0.4 + 0.2 * (1.0 - (x - 0.01).abs() / 0.004).max(0.0);
        let near = found(&passes(bump, &[1.6e-3; 3]));
        assert!(near.ways.iter().all(|way| (way.unwrap() - 3.2e-5).abs() < 4e-6), "{:?}", near.ways);
        // Beyond the search: its bound was stated as found.
        let far = found(&passes(bump, &[0.15; 3]));
        assert!(far.ways.iter().all(|way| way.is_none()), "{:?}", far.ways);
    }

    /// Three standard deviations of two or three passes are little: one of 22 sound sensors was accused.
    #[test]
    fn few_passes_that_scatter_accuse_no_sensor() {
        let bump = |x: f64| 0.4 + 0.2 * (-((x - 0.01) / 0.002).powi(2)).exp();
        let slower = |late_s: &[f64]| found(&passes(bump, late_s)).parts.last().unwrap().slower;
        assert!(!slower(&[5e-3; 2]), "two passes");
        assert!(!slower(&[3.0e-3, 4.0e-3, 3.6e-3]), "6 standard deviations of the mean of three");
        assert!(slower(&[5e-3, 5.1e-3, 5.0e-3]) && slower(&[3.0e-3, 4.0e-3, 3.6e-3, 3.4e-3, 3.5e-3, 3.6e-3]));
    }
}
