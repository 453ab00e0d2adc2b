//! The air that a plan asks for: who sets it, who reads it, and what was found.
//!
//! A level of a plan is true only where somebody set it and somebody read it: a chamber behind its profile,
//! the operator, or the world of a virtual rig. What a pass holds is what was found, with its source and its
//! age, never what was planned.

mod ambient_control;

pub use ambient_control::{AmbientControl, OperatorAnswers, SimulatedAir};

use crate::input::{Problems, unit_meant, unit_of};
use crate::plan::{Plan, series_place};
use crate::setup::{Setup, SetupFile};
use crate::sweep::MeasuredPass;
use models::covariate::{self, Covariate};
use models::{Ambient, Condition};
use realtime::Nanos;
use serde::{Deserialize, Serialize};

/// The quantities of the air that a plan can ask for, with the names that profiles give their signals and
/// set-points.
pub static AIR: [(&Covariate, &str); 3] = [
    (&covariate::AMBIENT_PRESSURE, "pressure"),
    (&covariate::TEMPERATURE, "temperature"),
    (&covariate::RELATIVE_HUMIDITY, "humidity"),
];

/// A level in words, by the place of its quantity in [`AIR`], in the unit that people use.
pub fn shown(at: usize, value: f64) -> String {
    let (factor, unit) = AIR[at].0.shown;
    format!("{} {} {unit}", AIR[at].0.words, (value * factor * 1e3).round() / 1e3)
}

/// Something for each quantity of [`AIR`].
pub type OfAir<T> = [T; 3];

/// The values of the air, in the order of [`AIR`].
pub const fn values(air: &Ambient) -> OfAir<Option<f64>> {
    [air.ambient_pressure_pa, air.temperature_c, air.relative_humidity_pct]
}

/// What is known of the air, each quantity in words.
pub fn air_words(air: &Ambient) -> impl Iterator<Item = String> {
    values(air).into_iter().enumerate().filter_map(|(at, value)| value.map(|value| shown(at, value)))
}

impl MeasuredPass {
    /// The levels of the air that its plan states.
    pub fn levels_set(&self) -> Ambient {
        let planned = |c: &Covariate| self.levels.iter().find(|level| level.quantity == c.name)?.planned;
        let [ambient_pressure_pa, temperature_c, relative_humidity_pct] = AIR.map(|(c, _)| planned(c));
        Ambient { ambient_pressure_pa, temperature_c, relative_humidity_pct }
    }

    /// The levels of these quantities: the plan's, else what was found.
    pub fn air(&self, of: OfAir<bool>) -> OfAir<Option<f64>> {
        let (set, found) = (values(&self.levels_set()), values(&Ambient::of(&self.pass.condition(1.0))));
        std::array::from_fn(|at| set[at].or(found[at]).filter(|_| of[at]))
    }
}

/// Quantities of the air that the plan of some passes sets: their levels are part of a condition.
pub fn air_set(passes: &[MeasuredPass]) -> OfAir<bool> {
    std::array::from_fn(|at| passes.iter().any(|p| values(&p.levels_set())[at].is_some()))
}

/// Whether the levels of two passes are one.
pub fn one_air([a, b]: [OfAir<Option<f64>>; 2]) -> bool {
    let within = Tolerances::default().of_air();
    (0..AIR.len()).all(|at| match (a[at], b[at]) {
        (Some(x), Some(y)) => (x - y).abs() <= within[at],
        (x, y) => x == y,
    })
}

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// An instrument read it.
    Instrument,
    /// The operator confirmed or typed it.
    Operator,
    /// A file of answers gave it in the operator's place.
    AnswersFile,
    /// A virtual rig: nothing real was set or read.
    Simulated,
}

impl std::fmt::Display for Source {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Source::Instrument => "measured",
            Source::Operator => "confirmed by the operator",
            Source::AnswersFile => "from the answers file",
            Source::Simulated => "simulated",
        })
    }
}

/// A value that was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AirLevel {
    /// In the unit of its quantity.
    pub value: f64,
    /// When, in loop time.
    pub at: Nanos,
    /// By whom.
    pub source: Source,
}

/// Who does something about a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// The chamber, by its profile.
    Chamber,
    /// The operator.
    Operator,
    /// The world of a virtual rig.
    World,
}

/// Who sets a quantity and who reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Means {
    /// Who brings a level about.
    pub sets: By,
    /// Who says that it is there.
    pub reads: By,
}

impl Means {
    /// Whether somebody has to come to the rig.
    pub fn needs_a_person(&self) -> bool {
        self.sets == By::Operator || self.reads == By::Operator
    }
}

/// `[ambient]` of a setup.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AmbientSetup {
    /// Quantities that the operator sets when the run asks for them, by the columns of the point table:
    /// `ambient_pressure_pa`, `temperature_c`, `relative_humidity_pct`. Where the chamber's profile reads
    /// one, its gauge confirms it; else the operator types what the gauge shows.
    pub by_operator: Vec<String>,
}

/// `[tolerances]` of a plan: how close the air must be to a level, and how long a run waits for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Tolerances {
    /// Pa.
    pub ambient_pressure_pa: f64,
    /// deg C.
    pub temperature_c: f64,
    /// Per cent of relative humidity.
    pub relative_humidity_pct: f64,
    /// s that a run waits for a level at most, from the moment that it was set.
    pub reached_within_s: f64,
}

impl Default for Tolerances {
    fn default() -> Self {
        Tolerances {
            ambient_pressure_pa: 1000.0,
            temperature_c: 0.5,
            relative_humidity_pct: 3.0,
            reached_within_s: 1800.0,
        }
    }
}

impl Tolerances {
    /// In the order of [`AIR`].
    pub fn of_air(&self) -> OfAir<f64> {
        [self.ambient_pressure_pa, self.temperature_c, self.relative_humidity_pct]
    }

    /// Says which value makes no sense.
    pub(crate) fn check(&self, wrong: &mut Problems<'_>) {
        let air = AIR.map(|(covariate, _)| covariate.name).into_iter().zip(self.of_air());
        for (key, value) in air.chain([("reached_within_s", self.reached_within_s)]) {
            if !(value.is_finite() && value > 0.0) {
                let problem = format!("{key} = {value}: a finite number above zero is needed");
                wrong.add(&["tolerances", key], problem, None);
            }
        }
    }
}

/// What the table of a pass holds of a quantity around the rig, and how it came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Column of the point table, or the name of what was typed.
    pub quantity: String,
    /// The plan's value; none if the plan leaves the quantity as it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned: Option<f64>,
    /// What was found, on average over the pass.
    pub value: f64,
    /// Smallest and largest value over the pass.
    pub range: [f64; 2],
    /// By whom.
    pub source: Source,
    /// Age of the last reading at the end of the pass, in s.
    pub age_s: f64,
    /// It left the plan's tolerance during the pass.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lost: bool,
}

/// What the passes of a run found of one quantity at one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LevelsFound {
    /// Column of the point table, or the name of what was typed.
    pub quantity: String,
    /// The plan's value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planned: Option<f64>,
    /// Passes.
    pub passes: usize,
    /// Mean over them.
    pub mean: f64,
    /// Smallest and largest value within a pass.
    pub range: [f64; 2],
    /// By whom.
    pub source: Source,
    /// Age of the oldest reading, in s.
    pub oldest_s: f64,
    /// Passes in which the level was lost.
    pub lost: usize,
}

/// The levels of a run's passes, by quantity, level and source, in the order in which they first came.
pub fn levels_of(passes: &[MeasuredPass]) -> Vec<LevelsFound> {
    let mut all: Vec<LevelsFound> = Vec::new();
    for level in passes.iter().flat_map(|pass| &pass.levels) {
        let same = |f: &&mut LevelsFound| {
            f.quantity == level.quantity && f.planned == level.planned && f.source == level.source
        };
        let [low, high] = level.range;
        match all.iter_mut().find(same) {
            Some(found) => {
                found.passes += 1;
                found.mean += (level.value - found.mean) / found.passes as f64;
                found.range = [found.range[0].min(low), found.range[1].max(high)];
                found.oldest_s = found.oldest_s.max(level.age_s);
                found.lost += usize::from(level.lost);
            }
            None => all.push(LevelsFound {
                quantity: level.quantity.clone(),
                planned: level.planned,
                passes: 1,
                mean: level.value,
                range: level.range,
                source: level.source,
                oldest_s: level.age_s,
                lost: usize::from(level.lost),
            }),
        }
    }
    all
}

/// Values that air around a rig can have: none in kPa, in kelvin or as a share passes for one in Pa, deg C or
/// per cent. Below 1 % a hygrometer shows nothing.
pub(crate) fn possible(covariate: &Covariate) -> [f64; 2] {
    match covariate.name {
        "ambient_pressure_pa" => [200.0, 200_000.0],
        "temperature_c" => [-40.0, 100.0],
        "relative_humidity_pct" => [1.0, 100.0],
        _ => covariate.range,
    }
}

impl SetupFile {
    /// Who sets and reads each quantity on this setup; `None` where nobody sets it.
    pub fn means(&self) -> OfAir<Option<Means>> {
        AIR.map(|(covariate, name)| {
            let profile = self.chamber.as_ref().and_then(|chamber| chamber.description().ok());
            let set = profile.as_ref().is_some_and(|p| p.set(name).is_some());
            let read = profile.as_ref().is_some_and(|p| p.signal(name).is_some());
            let by_operator = self.ambient.by_operator.iter().any(|one| one == covariate.name);
            let reads = |other: By| if read { By::Chamber } else { other };
            match (set, by_operator, self.virtual_rig.is_some()) {
                (true, ..) => Some(Means { sets: By::Chamber, reads: reads(By::Operator) }),
                (_, true, _) => Some(Means { sets: By::Operator, reads: reads(By::Operator) }),
                (.., true) => Some(Means { sets: By::World, reads: reads(By::World) }),
                _ => None,
            }
        })
    }

    /// What of `[ambient]` and `[chamber]` cannot be.
    pub(crate) fn check_ambient(&self, wrong: &mut Problems<'_>) {
        for name in &self.ambient.by_operator {
            if AIR.iter().all(|(covariate, _)| covariate.name != name) {
                let names = AIR.map(|(covariate, _)| covariate.name).join(", ");
                let problem = format!("'{name}' is not a quantity of the air; there are {names}");
                wrong.add(&["ambient", "by_operator"], problem, None);
            }
        }
        let air = Condition::paper().within(&self.stated_air());
        for (c, _) in AIR {
            let [low, high] = possible(c);
            if let Some(value) = c.of(&air).filter(|v| !(low..=high).contains(v)) {
                let remedy = unit_meant(c.name, value, [low, high]);
                let unit = unit_of(c.name);
                let problem = format!("{} = {value}: {low} to {high} {unit} is needed", c.name);
                wrong.add(&[c.name], problem, remedy);
            }
        }
        let Some(chamber) = &self.chamber else { return };
        let served = chamber.description().and_then(|profile| drivers::chamber::serves(&profile));
        if let Err(why) = served {
            wrong.add(&["chamber", "profile"], why.to_string(), None);
        }
    }
}

impl Plan {
    /// Which quantities of the air the plan sets in any of its series.
    pub fn sets_air(&self) -> OfAir<bool> {
        std::array::from_fn(|at| self.file.series.iter().any(|series| !series.air()[at].1.is_empty()))
    }

    /// Refuses a series that sets one quantity of the air and leaves another to what was left behind.
    pub(crate) fn check_left_behind(&self, wrong: &mut Problems<'_>) {
        for (index, series) in self.file.series.iter().enumerate() {
            let Some((set, _)) = series.air().into_iter().find(|(_, list)| !list.is_empty()) else {
                continue;
            };
            for ((covariate, list), sets) in series.air().into_iter().zip(self.sets_air()) {
                if sets && list.is_empty() {
                    let (set, name) = (set.name, covariate.name);
                    let problem =
                        format!("the series sets {set} and leaves {name} at what another series sets");
                    let place = series_place(&self.text, index, set);
                    wrong.add_at(place, problem, format!("add {name} = [VALUE] to this series"));
                }
            }
        }
    }

    /// Refuses levels that nobody brings about on a setup: they would be written and not be there.
    ///
    /// # Errors
    /// Every such list, with its place.
    pub fn check_ambient(&self, setup: &Setup) -> miette::Result<()> {
        let mut wrong = Problems::of(&self.origin, &self.text);
        let means = setup.file.means();
        for (index, series) in self.file.series.iter().enumerate() {
            for (at, (covariate, list)) in series.air().into_iter().enumerate() {
                if list.is_empty() || means[at].is_some() {
                    continue;
                }
                let (name, on) = (covariate.name, &setup.file.name);
                let problem = format!("nothing on '{on}' sets {name}: the run could not reach this level");
                let remedy = format!(
                    "add a [chamber] to the setup whose profile sets `{}`, or let the operator set it: [ambient] by_operator = \
                     [\"{name}\"]; or delete the list",
                    AIR[at].1
                );
                wrong.add_at(series_place(&self.text, index, name), problem, remedy);
            }
        }
        wrong.end()
    }
}
