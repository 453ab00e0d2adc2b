//! What the instruments themselves can do and see, by their profiles: a plan beyond it would trip in the
//! middle of its sweep.

use super::{PassTimes, Plan, Point};
use crate::format::quantity;
use crate::input::{Problems, place_of};
use models::{Condition, Covariate, PeakToPeak};

/// The values of one setting that an instrument takes or sees, or that a limit allows.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// Column of the setting.
    pub column: &'static str,
    /// Smallest and largest value in SI units.
    pub range: [f64; 2],
    /// Who says so, for messages: as in '`id` takes'.
    pub by: String,
}

impl Plan {
    /// Refuses values beyond what an instrument takes or sees.
    ///
    /// # Errors
    /// Every such value, with its place.
    pub fn check_reach(&self, reaches: &[Reach]) -> miette::Result<()> {
        let mut wrong = Problems::of(&self.origin, &self.text);
        for reach in reaches {
            let allows = |c: &Covariate| (c.name == reach.column).then(|| (reach.range, reach.by.clone()));
            for index in 0..self.file.series.len() {
                self.check_series(index, &allows, &mut wrong);
            }
        }
        let speed = self.file.pass.approach_speed_m_s;
        if let (Some(place), Some(taken)) =
            (place_of(&self.text, &["pass", "approach_speed_m_s"]), of_speed(reaches))
            && speed > taken.range[1] * (1.0 + ROUNDING)
        {
            let problem = format!(
                "the travel's speed is {speed} m/s; {} at most {}",
                taken.by,
                quantity(taken.range[1], "m/s")
            );
            let remedy = "leave the key out: the travel is then as fast as stage and limits allow";
            wrong.add_at(Some(place), problem, remedy.to_string());
        }
        wrong.end()
    }
}

/// Relative rounding of a range that is counted in the instrument's units.
const ROUNDING: f64 = 1e-9;

/// The normal forces at which a pass without vibration does not reach the limit of the lateral force; none
/// where no pass reaches it.
pub fn lateral_reach(points: &[Point], mu0: f64, most_n: f64) -> Option<Reach> {
    let reaches = |c: &Condition| c.amplitude == PeakToPeak::ZERO && mu0 * c.normal_force_n >= most_n;
    points.iter().any(|point| reaches(&point.condition)).then(|| Reach {
        column: "normal_force_n",
        range: [f64::MIN_POSITIVE, (most_n / mu0).next_down()],
        by: format!(
            "lateral_force_max_n = {} allows a pass without vibration at mu0 = {mu0} (SR-05)",
            quantity(most_n, "N")
        ),
    })
}

/// What allows the smallest speed.
fn of_speed(reaches: &[Reach]) -> Option<&Reach> {
    let all = reaches.iter().filter(|reach| reach.column == "speed_m_s");
    all.min_by(|a, b| a.range[1].total_cmp(&b.range[1]))
}

/// The times of a pass with a travel to its start that is no faster than stage and limits. A speed that the
/// plan states was refused where it is ([`Plan::check_reach`]).
pub fn times(reaches: &[Reach], times: PassTimes) -> PassTimes {
    let most = of_speed(reaches).map_or(f64::INFINITY, |taken| taken.range[1]);
    PassTimes { approach_speed_m_s: times.approach_speed_m_s.min(most), ..times }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_an_instrument_does_not_take_is_refused_with_its_name_and_all_at_once() {
        let plan =
            Plan::parse("first-sweep", crate::bundled::text(crate::plan::BUNDLED, "first-sweep").unwrap())
                .unwrap();
        let reach = |column, range, by: &str| Reach { column, range, by: by.into() };
        plan.check_reach(&[reach("frequency_hz", [15e3, 80e3], "`a` takes")]).unwrap();
        let refused = plan
            .check_reach(&[
                reach("frequency_hz", [30e3, 80e3], "`a` takes"),
                reach("normal_force_n", [0.0, 0.2], "`s` sees"),
            ])
            .unwrap_err();
        let message = format!("{refused:?}");
        assert!(message.contains("`a` takes") && message.contains("`s` sees"), "{message}");
    }

    /// It tripped at its first reference (SR-05).
    #[test]
    fn a_load_whose_friction_reaches_the_lateral_limit_is_refused_in_its_place() {
        let text = "name = \"r\"\nreference_every = 0\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\n\
             normal_force_n = 0.25\n[[series]]\namplitude_pp_m = [0, 2e-6]\n";
        let limits = realtime::safety::Limits::paper(realtime::ports::Nanos(1_000_000));
        let fine = crate::plan::Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        let found = |text: &str, most_n| {
            let plan = Plan::parse("r", text).unwrap();
            let points = plan.points(1, &limits, &fine).unwrap();
            plan.check_reach(lateral_reach(&points, 0.5, most_n).as_slice())
        };
        for most_n in [0.11, 0.125] {
            let why = found(text, most_n).unwrap_err();
            let message = format!("{why:?}");
            assert!(message.contains("(SR-05)") && message.contains("r:7:18"), "{message}");
            let help = why.help().unwrap().to_string();
            assert!(help.contains("limits"), "{help}");
        }
        found(text, 0.126).unwrap();
        // With vibration friction stays below it.
        found(&text.replace("[0, 2e-6]", "[1e-6, 2e-6]"), 0.11).unwrap();
    }

    /// A stage that does less than the travel's usual speed: every sweep was refused at the wire, and
    /// reported as a stage that does not follow.
    #[test]
    fn a_travel_is_no_faster_than_the_stage() {
        let reach = [Reach { column: "speed_m_s", range: [0.0, 0.1], by: "`s` takes".into() }];
        let text = "name = \"r\"\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n[base]\namplitude_pp_m = 2e-6\n\
             frequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\namplitude_pp_m = [0, 2e-6]\n";
        let plan = Plan::parse("r", text).unwrap();
        plan.check_reach(&reach).unwrap();
        assert!(plan.file.pass.approach_speed_m_s > 0.1);
        assert_eq!(times(&reach, plan.file.pass).approach_speed_m_s, 0.1);
        let mut limits = crate::setup::Setup::load("virtual-ideal").unwrap();
        limits.config.limits.speed_max_m_s = 0.08;
        let both = [&reach[..], &limits.reaches().unwrap()].concat();
        assert_eq!(times(&both, plan.file.pass).approach_speed_m_s, 0.08);
        for (from, to) in [
            ("speed_m_s = 0.02", "speed_m_s = 0.12"),
            ("settle_s = 0.05", "settle_s = 0.05\napproach_speed_m_s = 0.15"),
        ] {
            let plan = Plan::parse("r", &text.replacen(from, to, 1)).unwrap();
            let message = format!("{:?}", plan.check_reach(&reach).unwrap_err());
            assert!(message.contains("`s` takes"), "{to}: {message}");
        }
    }
}
