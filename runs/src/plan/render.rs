//! What a plan renders: a wanted friction over position, generated or from a file.

mod file;

use super::{Plan, Series};
use crate::fidelity::dynamics::Dynamics;
use crate::format::quantity;
use crate::input::Problems;
use models::target::{Feedback, MOST_DELAY, Target};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// `[render]`: every pass of the plan with an amplitude renders this target; the amplitude of its series is
/// the largest used.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderPlan {
    /// Kind of the target.
    pub target: TargetKind,
    /// Wanted `mu'` in the middle of a grating or of noise, and at the ends of a ramp's middle.
    #[serde(default = "middle")]
    pub mean: f64,
    /// Half the difference of the largest and the smallest wanted `mu'`.
    #[serde(default = "depth")]
    pub depth: f64,
    /// m, period of a grating.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_m: Option<f64>,
    /// m, shortest and longest wave of noise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub waves_m: Option<[f64; 2]>,
    /// Power of the wave number with which the noise's amplitude falls: 0 is white.
    #[serde(default)]
    pub fall: f64,
    /// Seed of the noise.
    #[serde(default)]
    pub seed: u64,
    /// File beside the plan: CSV with the columns `x_m` and `mu_relative` or `lateral_force_n` of a table, a
    /// grey PNG of an image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// m, width of a pixel of an image.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pixel_m: Option<f64>,
    /// Row of an image, from 0 at the top; the middle one without it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub row: Option<u32>,
    /// s, time by which the target is read ahead, for what loop, amplifier and plate take.
    #[serde(default)]
    pub lead_s: f64,
    /// Difference of `mu'` that counts as rendered.
    #[serde(default = "tolerance")]
    pub tolerance: f64,
    /// Feedback on the measured lateral force.
    #[serde(default)]
    pub feedback: Control,
    /// 1/s, integral gain of the feedback in place of that from the known dynamics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub integral_per_s: Option<f64>,
}

/// Kinds of targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TargetKind {
    /// A sine of `period_m`.
    Grating,
    /// From `mean - depth` to `mean + depth` over the stroke.
    Ramp,
    /// A sum of sines with random phases.
    Noise,
    /// A CSV file.
    Table,
    /// A row of a grey image: black is `mean - depth`, white `mean + depth`; its middle lies in the middle of
    /// the stroke.
    Image,
}

/// Whether the measured force corrects what is rendered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Control {
    /// Open loop: the law alone.
    #[default]
    None,
    /// Proportional and integral, with gains from the known dynamics.
    Pi,
}

const fn middle() -> f64 {
    0.6
}
const fn depth() -> f64 {
    0.2
}
const fn tolerance() -> f64 {
    0.05
}

/// Sines of a noise.
const SINES: u32 = 48;
/// Values of a target in its shortest wave, and over the stroke at least.
const VALUES: [f64; 2] = [32.0, 400.0];
/// Values of a target at most.
const MOST: f64 = 200_000.0;

impl RenderPlan {
    /// The shortest wave in m that the plan states; none of a ramp or a table.
    pub fn shortest_m(&self) -> Option<f64> {
        match self.target {
            TargetKind::Grating => self.period_m,
            TargetKind::Noise => self.waves_m.map(|waves| waves[0]),
            TargetKind::Ramp | TargetKind::Table | TargetKind::Image => None,
        }
    }

    pub(super) fn check(&self, wrong: &mut Problems<'_>) {
        let generated = self.target != TargetKind::Table;
        let inside = self.mean - self.depth > 0.0 && self.mean + self.depth <= 1.0 && self.depth > 0.0;
        if generated && !inside {
            // At a key that is in the file: the other one may have its default.
            let RenderPlan { mean, depth: half, .. } = *self;
            let key = if half == depth() || !(0.0..1.0).contains(&mean) { "mean" } else { "depth" };
            let needed = "mean - depth and depth must be above 0, mean + depth at most 1";
            let problem = format!("[render] mean = {mean}, depth = {half}: {needed}");
            wrong.add(&["render", key], problem, "for example mean = 0.6, depth = 0.2".to_string());
        }
        let mut needs = |key: &str, good: bool, needed: &str| {
            if !good {
                wrong.add(&["render", key], format!("[render] {key}: {needed}"), None);
            }
        };
        let length = |m: f64| m.is_finite() && (1e-5..=1.0).contains(&m);
        let tolerance = self.tolerance > 0.0 && self.tolerance < 1.0;
        needs("tolerance", tolerance, "a number between 0 and 1 is needed");
        needs("fall", (-2.0..=4.0).contains(&self.fall), "a number from -2 to 4 is needed");
        let period = self.target != TargetKind::Grating || self.period_m.is_some_and(length);
        needs("period_m", period, "a grating needs a period of 10 \u{b5}m to 1 m");
        let waves = self.waves_m.is_some_and(|[a, b]| length(a) && length(b) && a < b);
        let noise = self.target == TargetKind::Noise;
        needs("waves_m", !noise || waves, "noise needs the shortest and the longest wave, 10 \u{b5}m to 1 m");
        let gain = self.integral_per_s.is_none_or(|k| k.is_finite() && k > 0.0);
        needs("integral_per_s", gain, "a number above 0 is needed");
        let image = self.target == TargetKind::Image;
        let filed = !image && self.target != TargetKind::Table || self.file.is_some();
        needs("file", filed, "a table needs the name of a CSV file, an image that of a PNG file");
        let pixel = self.pixel_m.is_some_and(|m| m.is_finite() && (1e-7..=1e-2).contains(&m));
        needs("pixel_m", !image || pixel, "an image needs the width of a pixel, 0.1 \u{b5}m to 10 mm");
        needs("lead_s", (0.0..=0.5).contains(&self.lead_s), "a time from 0 to 0.5 s is needed");
    }

    /// The target over this span in m; `mu0` and load (N) turn a lateral force into `mu'`.
    fn made(&self, plan: &Plan, span: [f64; 2], mu0: f64) -> miette::Result<Target> {
        let length = span[1] - span[0];
        let waves: Vec<[f64; 3]> = match self.target {
            TargetKind::Table => return self.table(plan, mu0),
            TargetKind::Image => return self.image(plan, 0.5 * (span[0] + span[1])),
            TargetKind::Ramp => Vec::new(),
            TargetKind::Grating => vec![[TAU / self.period_m.unwrap_or(length), 1.0, 0.0]],
            TargetKind::Noise => {
                let mut rng = ChaCha12Rng::seed_from_u64(self.seed);
                let [short, long] = self.waves_m.unwrap_or([length; 2]).map(|m| TAU / m);
                let each = |i: u32| {
                    let k = long + (short - long) * (f64::from(i) + rng.random::<f64>()) / f64::from(SINES);
                    [k, k.powf(-self.fall), TAU * rng.random::<f64>()]
                };
                (0..SINES).map(each).collect()
            }
        };
        let step = self.shortest_m().map_or(f64::INFINITY, |m| m / VALUES[0]).min(length / VALUES[1]);
        let count = ((length / step).ceil() + 1.0).min(MOST);
        let step_m = length / (count - 1.0);
        let at = |i: usize| {
            let x = span[0] + step_m * i as f64;
            match self.target {
                TargetKind::Ramp => 2.0 * (x - span[0]) / length - 1.0,
                _ => waves.iter().map(|[k, size, phase]| size * (k * x + phase).sin()).sum::<f64>(),
            }
        };
        let mut shape: Vec<f64> = (0..count as usize).map(at).collect();
        if self.target == TargetKind::Noise {
            let range = [f64::INFINITY, f64::NEG_INFINITY];
            let [low, high] = shape.iter().fold(range, |[low, high], v| [low.min(*v), high.max(*v)]);
            shape.iter_mut().for_each(|v| *v = (2.0 * *v - low - high) / (high - low));
        }
        let mu_relative = shape.into_iter().map(|v| self.mean + self.depth * v).collect();
        Ok(Target { start_m: span[0], step_m, mu_relative, lead_s: self.lead_s, feedback: None })
    }
}

/// Strokes that a target is long at most: one of a thousand is written in mm.
const LONGEST: f64 = 100.0;
/// Phase margin in degrees and gain margin that a feedback needs: what the law's slope is off by takes from
/// the second.
const MARGINS_MIN: [f64; 2] = [45.0, 2.0];

impl Plan {
    /// The gains of the plan's feedback on the known dynamics; none in open loop.
    ///
    /// # Errors
    /// A stability margin that is too thin, or a delay that is too long, with the number.
    pub fn feedback(&self, known: &Dynamics) -> miette::Result<Option<Feedback>> {
        let Some(render) = self.file.render.as_ref().filter(|r| r.feedback == Control::Pi) else {
            return Ok(None);
        };
        let gains = known.feedback(render.integral_per_s);
        let [phase, gain] = known.margins(&gains);
        let long = gains.delay_cycles > MOST_DELAY;
        if phase < MARGINS_MIN[0] || gain < MARGINS_MIN[1] || long {
            let problem = format!(
                "a feedback of {:.0} /s has a phase margin of {phase:.0} degrees and a gain margin of {gain:.1} on this rig (a delay of {} \
                 cycles); {} degrees, {} and {MOST_DELAY} cycles are needed",
                gains.integral_per_s, gains.delay_cycles, MARGINS_MIN[0], MARGINS_MIN[1]
            );
            let remedy = format!(
                "leave integral_per_s out, for {:.0} /s, or feedback, for open loop",
                known.feedback(None).integral_per_s
            );
            return Err(self.refused(&["render", "integral_per_s"], problem, remedy).into());
        }
        Ok(Some(gains))
    }

    /// The target of a plan that renders one.
    ///
    /// # Errors
    /// A file that cannot be used, or that does not cover the stroke of a pass.
    pub fn target(&self, mu0: f64, feedback: Option<Feedback>) -> miette::Result<Option<Target>> {
        let Some(render) = &self.file.render else { return Ok(None) };
        let base = self.file.base;
        let speeds =
            |s: &Series| if s.speed_m_s.is_empty() { vec![base.speed_m_s] } else { s.speed_m_s.clone() };
        let strokes = self.file.series.iter().flat_map(speeds).map(|u| self.stroke_m(u, 0));
        let (middle, half) = (base.position_m, 0.5 * strokes.fold(0.0, f64::max));
        let target = render.made(self, [middle - half, middle + half], mu0)?;
        let [low, high] = target.span_m();
        if low > middle - half + 1e-3 || high < middle + half - 1e-3 {
            let [low, high, a, b] = [low, high, middle - half, middle + half].map(|m| m * 1e3);
            let problem = format!(
                "the target covers {low:.1} to {high:.1} mm; the passes slide from {a:.1} to {b:.1} mm"
            );
            let remedy = "lengthen the target, or shorten [pass] measure_m and settle_s".to_string();
            return Err(self.refused(&["render", "file"], problem, remedy).into());
        }
        if high - low > LONGEST * 2.0 * half {
            let [target, used] = [high - low, 2.0 * half].map(|m| quantity(m, "m"));
            let problem = format!("the target is {target} long, and the passes slide over {used} of it");
            let remedy = "write x_m in m, or shorten the target".to_string();
            return Err(self.refused(&["render", "file"], problem, remedy).into());
        }
        Ok(Some(Target { feedback, ..target }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: &str = "name = \"p\"\n[base]\namplitude_pp_m = \"5um\"\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
                        normal_force_n = 0.25\n[[series]]\nname = \"a\"\n";

    fn plan(render: &str, series: &str) -> miette::Result<Plan> {
        Plan::parse("plan.toml", &format!("{BASE}{series}[render]\n{render}"))
    }

    /// The largest absolute value was taken for half the range: 0.141 to 0.184 for a depth of 0.2.
    #[test]
    fn noise_reaches_from_mean_less_depth_to_mean_and_depth() {
        for seed in 0..5 {
            let text = format!("target = \"noise\"\nwaves_m = [2e-3, 10e-3]\nfall = 1\nseed = {seed}\n");
            let values = plan(&text, "").unwrap().target(0.5, None).unwrap().unwrap().mu_relative;
            let [low, high] = [f64::min, f64::max].map(|of| values.iter().copied().reduce(of).unwrap());
            assert!((low - 0.4).abs() < 1e-12 && (high - 0.8).abs() < 1e-12, "{low} {high}");
        }
    }

    /// It had no line and no remedy, and the depth that nobody wrote was blamed.
    #[test]
    fn a_mean_that_cannot_be_is_refused_at_its_line_with_the_remedy() {
        let why = plan("target = \"ramp\"\nmean = 1.5\n", "").unwrap_err();
        assert!(format!("{why:?}").contains("plan.toml:11:8"), "{why:?}");
        assert!(why.help().unwrap().to_string().contains("mean = 0.6"));
        let why = plan("target = \"ramp\"\ndepth = 0.7\n", "").unwrap_err();
        assert!(format!("{why:?}").contains("plan.toml:11:9"), "{why:?}");
    }

    /// The base's load, whatever the series had: 0.168 N were measured where 0.080 N were wanted.
    #[test]
    fn newtons_are_divided_by_the_load_of_the_passes_and_two_loads_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        // As a spreadsheet writes it.
        let rows = "\u{feff}x_m,lateral_force_n\r\n-0.05,0.1\r\n0.05,0.1\r\n";
        std::fs::write(folder.path().join("t.csv"), rows).unwrap();
        let of = |series: &str| {
            let mut plan = plan("target = \"table\"\nfile = \"t.csv\"\n", series).unwrap();
            plan.origin = folder.path().join("plan.toml").display().to_string();
            plan.target(0.5, None).map(|target| target.unwrap().mu_relative[0])
        };
        assert!((of("").unwrap() - 0.8).abs() < 1e-12);
        assert!((of("normal_force_n = [0.5]\n").unwrap() - 0.4).abs() < 1e-12);
        let why = of("normal_force_n = [0.25, 0.5]\n").unwrap_err();
        assert!(
            why.to_string().contains("t.csv is in N") && why.to_string().contains("[0.25, 0.5] N"),
            "{why}"
        );
        assert!(why.help().unwrap().to_string().contains("one plan for each load"));
    }
}
