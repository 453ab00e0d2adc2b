//! A plan: which passes to make, in which order, and how each is made.
//!
//! ```text
//! PlanFile (as written) -> Plan (checked, with its text for places) -> points (limits, resolution, seed) ->
//! Point
//! ```
//!
//! A series is the product of its lists; what it leaves out is the base's. Its conditions are repeated and
//! shuffled within each state of the air, with passes without vibration between them. `points` makes the
//! passes, `reach` checks what the instruments can do, `visible` what the sensors can see, `render` a wanted
//! friction, `follow` how a force is held. Every point is checked before anything moves. `PassTimes` are the
//! only times of a pass that a plan sets. A refusal says what is wrong, with the place in the file.

mod follow;
mod points;
mod reach;
mod render;
mod steps;
mod visible;

use crate::input::{self, BadInput, Problems};
use models::covariate::{self, Covariate};
use models::{Condition, PeakToPeak};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

pub(crate) use points::series_place;
pub use points::{Point, Resolution};
pub use reach::{Reach, lateral_reach, times};
pub use render::{Control, RenderPlan, TargetKind};
pub(crate) use steps::SKIN_MOISTURE;
pub use steps::{Action, Step, When};
pub use visible::{COUNTS_MIN, LateralChannel};

/// Name and text of every bundled plan. Add one: a file in `runs/plans/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[
    ("first-sweep", include_str!("../plans/first-sweep.toml")),
    ("fig9-artificial", include_str!("../plans/fig9-artificial.toml")),
    ("part2-validation", include_str!("../plans/part2-validation.toml")),
    ("render-grating", include_str!("../plans/render-grating.toml")),
    ("psi-reading", include_str!("../plans/psi-reading.toml")),
];

/// A plan file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PlanFile {
    /// Name, for records and reports.
    pub name: String,
    /// What the plan is for.
    #[serde(default)]
    pub about: String,
    /// Runs that this plan was designed from, as `muprime diagnose --save-plan` was given them: the run's end
    /// proposes to diagnose all of them together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub continues: Vec<PathBuf>,
    /// Seed of the order. `--seed` overrides it.
    #[serde(default)]
    pub seed: u64,
    /// Whether the order of conditions is randomised.
    #[serde(default = "yes")]
    pub randomise: bool,
    /// Repeats of every condition.
    #[serde(default = "one")]
    pub replicates: u32,
    /// Directions of every condition, in turn: 1, -1 or both.
    #[serde(default = "both")]
    pub directions: Vec<i8>,
    /// A reference without vibration before every so many conditions, and at the end; 0 for none.
    #[serde(default = "eight")]
    pub reference_every: u32,
    /// How a pass is made.
    #[serde(default)]
    pub pass: PassTimes,
    /// Values of everything that a series does not vary.
    pub base: Base,
    /// Series: each is the product of its lists, everything else at its base value.
    #[serde(default)]
    pub series: Vec<Series>,
    /// How close the air must be to the levels of the series, and how long a run waits for them.
    #[serde(default)]
    pub tolerances: crate::ambient::Tolerances,
    /// What the passes render, where they do not hold an amplitude.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(with = "RenderPlan")]
    pub render: Option<RenderPlan>,
    /// What a person does before the passes, between groups of them and after; the rig is disarmed meanwhile.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub step: Vec<Step>,
    /// Preparation and environment, as section 2.2 of the paper records them: copied into the record.
    #[serde(default)]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub protocol: BTreeMap<String, toml::Value>,
}

/// Passes that one plan may ask for: a pass takes half a second, so this is half a day, and what a run keeps
/// of its passes fits into memory.
pub const MAX_PASSES: u64 = 100_000;

impl PlanFile {
    /// Passes that the plan asks for, references left out, counted without making them.
    fn passes(&self) -> u64 {
        let of_series = |s: &Series| {
            let directions = if s.directions.is_empty() { &self.directions } else { &s.directions };
            let sizes = s.lists().map(|(_, list)| list.len().max(1) as u64);
            let conditions = sizes.into_iter().fold(1, u64::saturating_mul);
            conditions.saturating_mul(directions.len() as u64)
        };
        let conditions = self.series.iter().map(of_series).fold(0, u64::saturating_add);
        conditions.saturating_mul(u64::from(self.replicates))
    }
}

/// Edges that a pass may have: more need more travel than a stage has.
const MAX_EDGES: u32 = 20;

/// Times of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PassTimes {
    /// s from loading and starting until the average begins.
    pub settle_s: f64,
    /// s that are averaged.
    pub measure_s: f64,
    /// m that are measured in place of `measure_s`: the same way at every speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measure_m: Option<f64>,
    /// m/s of the lifted travel to the start of a pass. Left out: 0.15, or what the stage takes where that is less.
    pub approach_speed_m_s: f64,
    /// s from one edge to the next, in series with `edges`; at least 0.2.
    pub edge_s: f64,
}

impl PassTimes {
    /// s that are measured at a speed in m/s.
    pub fn measured_s(&self, speed_m_s: f64) -> f64 {
        self.measure_m.map_or(self.measure_s, |way| way / speed_m_s)
    }

    /// s for which a pass slides forward, and s that follow back: with `edges` the drive goes off and on so
    /// many times after the average, off once more, and the stage turns round.
    pub fn sliding_s(&self, edges: u32, speed_m_s: f64) -> [f64; 2] {
        let average = self.settle_s + self.measured_s(speed_m_s);
        if edges == 0 {
            [average, 0.0]
        } else {
            [average + f64::from(2 * edges + 1) * self.edge_s, self.edge_s]
        }
    }
}

impl Default for PassTimes {
    fn default() -> Self {
        PassTimes { settle_s: 0.15, measure_s: 0.25, measure_m: None, approach_speed_m_s: 0.15, edge_s: 0.3 }
    }
}

/// Base values of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Base {
    /// m, peak-to-peak.
    pub amplitude_pp_m: f64,
    /// Hz.
    pub frequency_hz: f64,
    /// m/s.
    pub speed_m_s: f64,
    /// N.
    pub normal_force_n: f64,
    /// m, where the middle of every pass lies.
    #[serde(default)]
    pub position_m: f64,
}

/// One series: the product of its lists.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Series {
    /// Name, for reports.
    pub name: String,
    /// m, peak-to-peak.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub amplitude_pp_m: Vec<f64>,
    /// Hz.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub frequency_hz: Vec<f64>,
    /// m/s.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub speed_m_s: Vec<f64>,
    /// N.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub normal_force_n: Vec<f64>,
    /// m.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub position_m: Vec<f64>,
    /// Pa: somebody sets it, a chamber or the operator; passes are grouped by the levels of the air; one that the
    /// list returns to is visited again.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub ambient_pressure_pa: Vec<f64>,
    /// deg C: likewise.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub temperature_c: Vec<f64>,
    /// Per cent: likewise.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub relative_humidity_pct: Vec<f64>,
    /// Directions of this series alone, 1 and -1; empty for the plan's.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub directions: Vec<i8>,
    /// Edges after the average of each pass with vibration: the drive goes off and on so many times while
    /// the finger slides on, then the stage turns round. `diagnose` finds lags and shifts in time with
    /// them. 0 for none, at most 20.
    pub edges: u32,
}

impl Base {
    /// The base as a condition; what it does not say is the paper's.
    pub fn condition(&self) -> Condition {
        Condition {
            amplitude: PeakToPeak::from_metres(self.amplitude_pp_m),
            frequency_hz: self.frequency_hz,
            speed_m_s: self.speed_m_s,
            normal_force_n: self.normal_force_n,
            position_m: self.position_m,
            mu0: 1.0,
            ..Condition::paper()
        }
    }
}

impl Series {
    /// What the series varies, slowest first; an empty list stands for the base's value.
    pub fn lists(&self) -> [(&'static Covariate, &[f64]); 8] {
        [
            (&covariate::AMBIENT_PRESSURE, &self.ambient_pressure_pa),
            (&covariate::TEMPERATURE, &self.temperature_c),
            (&covariate::RELATIVE_HUMIDITY, &self.relative_humidity_pct),
            (&covariate::FREQUENCY, &self.frequency_hz),
            (&covariate::SPEED, &self.speed_m_s),
            (&covariate::NORMAL_FORCE, &self.normal_force_n),
            (&covariate::POSITION, &self.position_m),
            (&covariate::AMPLITUDE, &self.amplitude_pp_m),
        ]
    }

    /// Its levels of the air, in the order of [`crate::ambient::AIR`].
    pub fn air(&self) -> [(&'static Covariate, &[f64]); 3] {
        let [pressure, temperature, humidity, ..] = self.lists();
        [pressure, temperature, humidity]
    }
}

const fn yes() -> bool {
    true
}
const fn one() -> u32 {
    1
}
const fn eight() -> u32 {
    8
}
fn both() -> Vec<i8> {
    vec![1, -1]
}

/// A plan that was read.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The file's contents.
    pub file: PlanFile,
    /// The file's text, for the record.
    pub text: String,
    /// Where it came from.
    pub origin: String,
}

impl Plan {
    /// The bundled plan of that name, or the file at that path.
    pub fn load(name_or_path: &str) -> miette::Result<Self> {
        Self::parse(name_or_path, &crate::bundled::load("plan", BUNDLED, name_or_path)?.0)
    }

    /// Parses and checks a plan by itself. Against limits it is checked by [`Plan::points`].
    pub fn parse(origin: &str, text: &str) -> miette::Result<Self> {
        let file: PlanFile = input::parse_toml(origin, text)?;
        let mut wrong = Problems::of(origin, text);
        if file.series.is_empty() {
            wrong.add(
                &["name"],
                "a plan needs at least one [[series]]",
                "add [[series]] with a list, as in amplitude_pp_m = [1e-6, 2e-6]".to_string(),
            );
        }
        let remedy = || "write [1], [-1] or [1, -1]".to_string();
        let unknown = |all: &[i8]| !matches!(all, [] | [1] | [-1] | [1, -1] | [-1, 1]);
        if file.directions.is_empty() || unknown(&file.directions) {
            wrong.add(&["directions"], "directions are 1, -1 or both", remedy());
        }
        for (index, series) in file.series.iter().enumerate() {
            // A designed experiment repeats conditions as passes with names of their own.
            if file.series[..index].contains(series) {
                let place = series.lists().iter().find_map(|(c, _)| series_place(text, index, c.name));
                let remedy =
                    "delete one of the two, or give them names; `replicates` repeats every condition";
                wrong.add_at(place, "two series are the same", remedy.to_string());
            }
            if unknown(&series.directions) {
                let place = points::series_place(text, index, "directions");
                wrong.add_at(place, "directions are 1, -1 or both", remedy());
            }
            for (k, (covariate, list)) in series.lists().into_iter().enumerate() {
                let Some(place) = points::series_place(text, index, covariate.name) else { continue };
                // A level of the air, of which there are three, is visited again where the list returns to it.
                let same = |a: &f64, b: &f64| k > 2 && (a - b).abs() <= 1e-9 * b.abs();
                let again = (1..list.len()).any(|k| list[..k].iter().any(|value| same(value, &list[k])));
                let (what, remedy) = match again {
                    _ if list.is_empty() => ("no value", "list its values, or leave the key out"),
                    true => ("a value twice", "list it once; `replicates` repeats every condition"),
                    false => continue,
                };
                wrong.add_at(Some(place), format!("{} lists {what}", covariate.name), remedy.to_string());
            }
        }
        if !(1..=1000).contains(&file.replicates) {
            wrong.add(&["replicates"], "replicates are 1 to 1000", None);
        }
        let passes = file.passes();
        if passes > MAX_PASSES {
            let problem =
                format!("the plan asks for {passes} passes; at most {MAX_PASSES} are made in one run");
            wrong.add(&["series"], problem, "shorten the lists, or make several plans of it".to_string());
        }
        if file.series.iter().any(|series| series.edges > MAX_EDGES) {
            wrong.add(&["series"], format!("edges are 0 to {MAX_EDGES}"), None);
        }
        let times = [
            ("edge_s", file.pass.edge_s),
            ("settle_s", file.pass.settle_s),
            ("measure_s", file.pass.measure_s),
            ("approach_speed_m_s", file.pass.approach_speed_m_s),
        ];
        for (name, value) in times {
            if !(value.is_finite() && value > 0.0 && value < 3600.0) {
                wrong.add(&["pass", name], format!("{name} = {value}: a number above zero is needed"), None);
            }
        }
        if file.pass.edge_s < 0.2 {
            wrong.add(&["pass", "edge_s"], "edge_s is at least 0.2: an edge needs its levels", None);
        }
        if let Some(way) = file.pass.measure_m
            && !(way.is_finite() && (1e-3..=1.0).contains(&way))
        {
            wrong.add(&["pass", "measure_m"], format!("measure_m = {way}: 1 mm to 1 m is needed"), None);
        }
        if let Some(render) = &file.render {
            render.check(&mut wrong);
            if file.series.iter().any(|series| series.edges > 0) {
                wrong.add(&["series"], "a plan that renders has no edges", None);
            }
        }
        file.tolerances.check(&mut wrong);
        file.step.iter().for_each(|step| step.check(&mut wrong));
        wrong.end()?;
        Ok(Plan { file, text: text.to_string(), origin: origin.to_string() })
    }

    /// A refusal of the plan, at the value of a key.
    fn refused(&self, path: &[&str], problem: String, remedy: String) -> BadInput {
        BadInput::new(&self.origin, &self.text, input::place_of(&self.text, path), problem, remedy)
    }

    /// What `[protocol]` states; what is left empty states nothing.
    pub fn protocol(&self) -> BTreeMap<String, toml::Value> {
        let stated = |value: &toml::Value| value.as_str().is_none_or(|text| !text.trim().is_empty());
        self.file.protocol.iter().filter(|(_, v)| stated(v)).map(|(k, v)| (k.clone(), v.clone())).collect()
    }
}
