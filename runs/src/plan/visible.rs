//! Whether the force sensor can see what a sweep is to show. A sweep whose whole expected change of force is
//! a count or two, or drowns in the sensor's noise, measures the sensor: it is refused before anything moves.

use super::points::{Visit, series_place};
use super::{Plan, Point, Resolution};
use crate::format::quantity;
use crate::input::BadInput;
use diagnosis::report::next::grid::expected_change_n;
use models::{Condition, FrictionModel};

/// Counts of the sensor that the largest expected change of a series must span. One count either way is
/// rounding of the two readings whose difference is taken; four leave a curve of some shape.
pub const COUNTS_MIN: f64 = 4.0;

/// What reads the lateral force, as far as it is known before the instrument is connected.
#[derive(Clone, Debug, PartialEq)]
pub struct LateralChannel {
    /// Instrument and signal, for messages.
    pub sensor: String,
    /// N of one count; `None` where only the instrument itself knows its scale.
    pub count_n: Option<f64>,
    /// Standard deviation of one sample in N, where the profile states one.
    pub noise_n: Option<f64>,
    /// Standard deviation of a pass's mean in N, by the setup.
    pub pass_sd_n: f64,
}

impl LateralChannel {
    /// The smallest change in N that a sweep may be made for, and what sets it.
    fn least_change_n(&self) -> (f64, String) {
        let pass = format!("the setup's force_sd_n of a pass is {} mN", mn(self.pass_sd_n));
        let count = |n| format!("its count is {} mN, and {COUNTS_MIN} of them are needed", mn(n));
        let count = self.count_n.map(|n| (COUNTS_MIN * n, count(n)));
        let noise = self.noise_n.map(|n| (n, format!("its noise is {} mN", mn(n))));
        let larger = |a: (f64, String), b: (f64, String)| if b.0.total_cmp(&a.0).is_ge() { b } else { a };
        count.into_iter().chain(noise).fold((self.pass_sd_n, pass), larger)
    }
}

/// Three significant digits of a force in mN.
fn mn(newtons: f64) -> String {
    let value = newtons * 1e3;
    let decimals = if value == 0.0 { 0.0 } else { (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) };
    format!("{value:.*}", decimals as usize)
}

impl Plan {
    /// Refuses a series whose largest expected change of lateral force the sensor cannot see. The change is
    /// from the reference without vibration, `(1 - mu') mu_0 F_n` (Eq. 5); of a series without vibration it
    /// is the friction itself, `mu_0 F_n`. A condition outside the model's domain expects nothing and so
    /// refuses nothing.
    ///
    /// # Errors
    /// The first such series, with its best point, the sensor, both forces and what would do.
    pub fn check_visible(
        &self,
        points: &[Point],
        resolution: &Resolution,
        model: &dyn FrictionModel,
        mu0: f64,
        channel: &LateralChannel,
    ) -> miette::Result<()> {
        let (least_n, because) = channel.least_change_n();
        for (index, series) in self.file.series.iter().enumerate() {
            let conditions = self.conditions_of(index, resolution);
            let change = |v: &Visit<'_>| Some((v.condition, expected_change_n(&v.condition, model, mu0)?));
            let expected = conditions.iter().filter_map(change);
            let Some((best, change_n)) = expected.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            if change_n >= least_n {
                continue;
            }
            let is_best = |p: &&Point| p.condition == Condition { direction: p.condition.direction, ..best };
            let number =
                points.iter().find(is_best).map_or(String::new(), |p| format!(" (point {})", p.number));
            let [w, f] = [quantity(best.amplitude.metres(), "m"), quantity(best.frequency_hz, "Hz")];
            let [u, n] = [quantity(best.speed_m_s, "m/s"), quantity(best.normal_force_n, "N")];
            let problem = format!(
                "series '{}': the largest change of lateral force that {} expects is {} mN, at w = {w}, f = {f}, \
                 U = {u}, Fn = {n}{number}; {} sees no less than {} mN: {because}",
                series.name,
                model.name(),
                mn(change_n),
                channel.sensor,
                mn(least_n),
            );
            let remedy = format!(
                "raise the normal force or the amplitude of this series, or take a force sensor whose count is at most \
                 {} mN and whose noise is below {} mN",
                mn(change_n / COUNTS_MIN),
                mn(change_n)
            );
            let place = series_place(&self.text, index, "amplitude_pp_m")
                .or_else(|| series_place(&self.text, index, "name"));
            return Err(BadInput::new(&self.origin, &self.text, place, problem, remedy).into());
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use models::{Finger, SpringSlider};
    use realtime::{Limits, Nanos};

    const PLAN: &str = r#"
name = "p"
[base]
amplitude_pp_m = 2e-6
frequency_hz = 27500
speed_m_s = 0.02
normal_force_n = 0.25
[[series]]
name = "a"
amplitude_pp_m = [0.5e-6, 3e-6]
"#;
    const FINE: Resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };

    fn judge(text: &str, channel: &LateralChannel) -> Result<(), String> {
        let plan = Plan::parse("p.toml", text).unwrap();
        let points = plan.points(1, &Limits::paper(Nanos(1_000_000)), &FINE).unwrap();
        let model = SpringSlider::new(Finger::paper()).unwrap();
        let shown =
            |e: miette::Report| format!("{e} / {}", e.help().map_or(String::new(), |h| h.to_string()));
        plan.check_visible(&points, &FINE, &model, 0.5, channel).map_err(shown)
    }

    fn channel(count_n: Option<f64>, noise_n: Option<f64>) -> LateralChannel {
        LateralChannel { sensor: "`s` (fx)".into(), count_n, noise_n, pass_sd_n: 0.0008 }
    }

    /// The change cannot exceed mu0 Fn = 0.125 N, and at 3 um it is more than half of it: between 16 and 32
    /// mN a count some count must be the last that passes.
    #[test]
    fn a_count_too_coarse_for_the_sweep_is_refused_with_its_numbers() {
        assert_eq!(judge(PLAN, &channel(Some(0.0156), None)), Ok(()));
        let refusal = judge(PLAN, &channel(Some(0.0313), None)).unwrap_err();
        for part in
            ["series 'a'", "w = 3 µm", "Fn = 0.25 N", "(point ", "`s` (fx)", "its count is 31.3 mN", "125 mN"]
        {
            assert!(refusal.contains(part), "{part}: {refusal}");
        }
        // OnRobot's count is 0.1 N: useless for a fingertip at a quarter of a newton.
        assert!(judge(PLAN, &channel(Some(0.1), None)).is_err());
    }

    #[test]
    fn noise_above_the_change_is_refused() {
        assert_eq!(judge(PLAN, &channel(None, Some(0.06))), Ok(()));
        let refusal = judge(PLAN, &channel(Some(1e-5), Some(0.126))).unwrap_err();
        assert!(refusal.contains("its noise is 126 mN"), "{refusal}");
        let rough = LateralChannel { pass_sd_n: 0.126, ..channel(Some(1e-5), None) };
        assert!(judge(PLAN, &rough).unwrap_err().contains("force_sd_n"));
    }

    /// Full contact below w = 2 Fn/kn: the model expects no change at all there. Alone such a series shows
    /// nothing.
    #[test]
    fn a_series_that_shows_nothing_is_refused_and_one_point_that_shows_something_is_enough() {
        let silent = PLAN.replace("[0.5e-6, 3e-6]", "[1e-8]");
        let refusal = judge(&silent, &channel(Some(1e-5), None)).unwrap_err();
        assert!(refusal.contains("expects is 0"), "{refusal}");
        let both = PLAN.replace("[0.5e-6, 3e-6]", "[1e-8, 3e-6]");
        assert_eq!(judge(&both, &channel(Some(1e-5), None)), Ok(()));
        // Without vibration it is the friction itself that is measured: 125 mN.
        let still = PLAN.replace("[0.5e-6, 3e-6]", "[0.0]");
        assert_eq!(judge(&still, &channel(Some(0.03125), None)), Ok(()));
        assert!(judge(&still, &channel(Some(0.0313), None)).is_err());
    }
}
