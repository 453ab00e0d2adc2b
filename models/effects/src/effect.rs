//! What a candidate effect is.

use crate::contact::Contact;
use crate::operating::{Design, SensorError};
use crate::own::OwnTable;
use models::Condition;
use models::covariate::{self, Covariate};
use models::rig_file::CertifiedKey;
use serde::Serialize;

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Location {
    /// Between skin and plate.
    Contact,
    /// In the finger.
    Finger,
    /// In the plate or its amplifier.
    Plate,
    /// In a sensor, the stage, or the timing.
    Instrument,
}

impl Location {
    /// Every place.
    pub const ALL: [Location; 4] =
        [Location::Contact, Location::Finger, Location::Plate, Location::Instrument];

    /// Its name in a verdict.
    pub const fn name(self) -> &'static str {
        match self {
            Location::Contact => "contact",
            Location::Finger => "finger",
            Location::Plate => "plate",
            Location::Instrument => "instrument",
        }
    }
}

/// What the prior says about a parameter. The fit works in a coordinate `u` that is standard normal under it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Prior {
    /// Size of either sign: normal about zero with this deviation.
    Normal(f64),
    /// Size that cannot be negative: the upper half of a normal with this deviation.
    HalfNormal(f64),
    /// Shape that is positive: median and standard deviation of the logarithm.
    LogNormal(f64, f64),
    /// Shape between two ends.
    Uniform(f64, f64),
}

/// Normal force about which the library states its priors, N: a fingertip's. See [`Parameter::at_load`].
pub const STATED_AT_N: f64 = 0.3;

/// One parameter of one law.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Parameter {
    /// Name.
    pub name: &'static str,
    /// Unit, SI; `1` for a number.
    pub unit: &'static str,
    /// The value at which the effect is absent; none for a shape parameter.
    pub zero: Option<f64>,
    /// Prior.
    pub prior: Prior,
    /// Smallest value that the fit may take.
    pub lower: f64,
    /// Largest value that the fit may take.
    pub upper: f64,
    /// Whether it only bends the law about its middle, where the coordinate is zero: a search begins there
    /// (one that cannot be negative also a deviation above), and the local fit finds it.
    pub bends: bool,
}

impl Parameter {
    /// A size of either sign, absent at zero.
    pub const fn signed(name: &'static str, unit: &'static str, sd: f64, lower: f64, upper: f64) -> Self {
        Self { name, unit, zero: Some(0.0), prior: Prior::Normal(sd), lower, upper, bends: false }
    }
    /// A size that cannot be negative, absent at zero.
    pub const fn positive(name: &'static str, unit: &'static str, sd: f64, upper: f64) -> Self {
        Self { name, unit, zero: Some(0.0), prior: Prior::HalfNormal(sd), lower: 0.0, upper, bends: false }
    }
    /// A positive shape parameter with a lognormal prior, bounded at three deviations.
    pub const fn shape(name: &'static str, unit: &'static str, median: f64, sd_ln: f64) -> Self {
        let prior = Prior::LogNormal(median, sd_ln);
        Self { name, unit, zero: None, prior, lower: 0.0, upper: f64::INFINITY, bends: false }
    }
    /// The same as a shape that only bends the law about its middle: see [`Parameter::bends`].
    pub const fn bending(self) -> Self {
        Self { bends: true, ..self }
    }
    /// The same with a largest value of its own, where another effect begins.
    pub const fn at_most(self, upper: f64) -> Self {
        Self { upper, ..self }
    }
    /// A shape parameter anywhere between two ends.
    pub const fn between(name: &'static str, unit: &'static str, lower: f64, upper: f64) -> Self {
        Self { name, unit, zero: None, prior: Prior::Uniform(lower, upper), lower, upper, bends: false }
    }

    /// The same for a table about this normal force: what has the unit of a force grows with it, and with the stiffnesses that
    /// belong to it. Forces in another unit, or a finger in the place of a pin, then make the same verdict.
    pub fn at_load(self, load_n: f64) -> Self {
        let power = match self.unit {
            "N" | "N/K" | "kg" => 1.0,
            "1/N" | "1/W" => -1.0,
            _ => return self,
        };
        let factor = (load_n / STATED_AT_N).powf(power);
        let prior = match self.prior {
            Prior::Normal(sd) => Prior::Normal(factor * sd),
            Prior::HalfNormal(sd) => Prior::HalfNormal(factor * sd),
            Prior::LogNormal(median, sd) => Prior::LogNormal(factor * median, sd),
            Prior::Uniform(low, high) => Prior::Uniform(factor * low, factor * high),
        };
        Self { prior, lower: factor * self.lower, upper: factor * self.upper, ..self }
    }

    /// The value at coordinate `u`.
    pub fn value(&self, u: f64) -> f64 {
        let raw = match self.prior {
            Prior::Normal(sd) | Prior::HalfNormal(sd) => sd * u,
            Prior::LogNormal(median, sd) => median * (sd * u).exp(),
            // The ends are where u = -3 and 3; a wrapping parameter may pass them.
            Prior::Uniform(low, high) => return low + (high - low) * (u + 3.0) / 6.0,
        };
        raw.clamp(self.lower, self.upper)
    }

    /// The coordinate of a value.
    pub fn coordinate(&self, value: f64) -> f64 {
        match self.prior {
            Prior::Normal(sd) | Prior::HalfNormal(sd) => value / sd,
            Prior::LogNormal(median, sd) => (value / median).ln() / sd,
            Prior::Uniform(low, high) => 6.0 * (value - low) / (high - low) - 3.0,
        }
    }

    /// Range of the coordinate that the fit may use.
    pub fn coordinate_bounds(&self) -> (f64, f64) {
        match self.prior {
            Prior::Normal(sd) => ((self.lower / sd).max(-8.0), (self.upper / sd).min(8.0)),
            Prior::HalfNormal(sd) => (0.0, (self.upper / sd).min(8.0)),
            Prior::LogNormal(..) => (-3.0, self.coordinate(self.upper).min(3.0)),
            Prior::Uniform(..) => (-3.0, 3.0),
        }
    }

    /// Log prior density in the coordinate.
    pub fn log_prior(&self, u: f64) -> f64 {
        let normal = -0.5 * u * u - 0.918_938_533_204_672_8;
        match self.prior {
            Prior::HalfNormal(_) => normal + std::f64::consts::LN_2,
            Prior::Uniform(..) => -(6f64.ln()),
            _ => normal,
        }
    }
}

/// What a cause acts on, and what its size there may be a function of.
///
/// The library's laws are formulae; of many causes a rig knows only this much. A departure that bends what
/// the cause acts on, over these covariates and no others, keeps the mechanism where the formula fails.
#[derive(Debug, Clone, Copy)]
pub struct Acts {
    /// What it acts on.
    pub on: Input,
    /// Covariates that its size depends on.
    pub over: &'static [&'static Covariate],
}

/// An input of the contact or of the reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// Amplitude of the plate, in e-folds.
    Amplitude,
    /// Speed of sliding, in e-folds.
    Speed,
    /// Normal and lateral stiffness together, in e-folds.
    Stiffness,
    /// Friction coefficient, in e-folds.
    Friction,
    /// Load on the contact, N.
    Load,
    /// Lateral force read without load, N.
    Offset,
    /// Lateral force read per newton of normal force.
    Crosstalk,
}

impl Acts {
    /// Whether its size may be another in each run, as what is tared, clamped or tuned before each. Friction
    /// that is another in each run is scatter.
    pub fn by_run(&self) -> bool {
        let of_time = self.over.iter().any(|c| c.name == covariate::TIME.name);
        of_time && self.on != Input::Friction
    }
}

/// How a law acts as a change of the baseline, exactly and on every pass: by e-folds of mu0, normal and
/// lateral stiffness for one e-fold of the law's size.
pub type Rescaling = [f64; 3];

/// A check that sees a law's size without going through friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Check {
    /// What to do, as an instruction.
    pub action: &'static str,
    /// Standard deviation of what it measures, in the unit of the law's size.
    pub sd: f64,
}

/// One functional form of an effect. A cause may follow more than one; all are forms of ONE effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Law {
    /// Name of the form.
    pub name: &'static str,
    /// Its parameters, the size first.
    pub parameters: &'static [Parameter],
    /// What a table must hold for this form beyond what its effect needs.
    #[serde(skip_serializing_if = "<[Need]>::is_empty")]
    pub needs: &'static [Need],
    /// The certificate that bounds its size, in the size's own unit; none where no calibration measures it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub certified_by: Option<CertifiedKey>,
    /// The change of the baseline that does exactly the same, for laws that no table of passes tells from one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub acts_as: Option<Rescaling>,
    /// Effect and law that do the same for the same size but for a small rest: stated on one of the two.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub same_as: Option<(&'static str, &'static str)>,
    /// The check that sees it; none where only friction shows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seen_by: Option<Check>,
}

impl Law {
    /// A form with these parameters, the size first.
    pub const fn new(name: &'static str, parameters: &'static [Parameter]) -> Self {
        Self { name, parameters, needs: &[], certified_by: None, acts_as: None, same_as: None, seen_by: None }
    }
    /// A table must hold this too.
    pub const fn needs(self, needs: &'static [Need]) -> Self {
        Self { needs, ..self }
    }
    /// A certificate bounds the size.
    pub const fn certified_by(self, key: CertifiedKey) -> Self {
        Self { certified_by: Some(key), ..self }
    }
    /// For an e-fold of the size, a change of the baseline by these e-folds does the same.
    pub const fn acts_as(self, rescaling: Rescaling) -> Self {
        Self { acts_as: Some(rescaling), ..self }
    }
    /// A law of another effect does nearly the same.
    pub const fn same_as(self, effect: &'static str, law: &'static str) -> Self {
        Self { same_as: Some((effect, law)), ..self }
    }
    /// A check sees the size with this standard deviation.
    pub const fn seen_by(self, action: &'static str, sd: f64) -> Self {
        Self { seen_by: Some(Check { action, sd }), ..self }
    }
}

/// What a table must hold before an effect can be seen on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Need {
    /// Passes with the plate vibrating.
    Vibration,
    /// More than one amplitude.
    Amplitudes,
    /// More than one normal force.
    Loads,
    /// More than one speed.
    Speeds,
    /// Both directions.
    Directions,
    /// Passes at more than one place on the plate.
    Positions,
    /// Passes spread over time.
    Time,
    /// More than one frequency.
    Frequencies,
    /// More than one run.
    Runs,
    /// A temperature at every pass, and one that changes.
    Temperatures,
    /// A relative humidity at every pass, and one that changes.
    Humidities,
    /// Signals within a pass: a run's record.
    Record,
    /// A calibration of the lateral axis against an outside standard (dead weight).
    OutsideStandard,
    /// A calibration of the normal axis against an outside standard (dead weight).
    NormalStandard,
}

impl Need {
    /// Whether a calibration against an outside standard alone shows it: no table of passes does.
    pub fn is_standard(self) -> bool {
        matches!(self, Need::OutsideStandard | Need::NormalStandard)
    }

    /// What every condition must say for it, beyond what every table says.
    pub fn covariate(self) -> Option<&'static Covariate> {
        match self {
            Need::Temperatures => Some(&covariate::TEMPERATURE),
            Need::Humidities => Some(&covariate::RELATIVE_HUMIDITY),
            _ => None,
        }
    }

    /// The setting of which it asks more than one level.
    pub fn levels_of(self) -> Option<&'static Covariate> {
        match self {
            Need::Amplitudes => Some(&covariate::AMPLITUDE),
            Need::Loads => Some(&covariate::NORMAL_FORCE),
            Need::Speeds => Some(&covariate::SPEED),
            Need::Frequencies => Some(&covariate::FREQUENCY),
            _ => None,
        }
    }

    /// What is missing from a table that does not meet it.
    pub const fn missing(self) -> &'static str {
        match self {
            Need::Vibration => "no pass has the plate vibrating",
            Need::Amplitudes => "a second amplitude is missing",
            Need::Loads => "normal forces differ by less than a quarter: a second load is missing",
            Need::Speeds => "speeds differ by less than a third: a second speed is missing",
            Need::Directions => "only one direction was measured: passes in reverse are missing",
            Need::Positions => "all passes lie at one position_m: a second place is missing",
            Need::Time => "all passes carry one time_s",
            Need::Frequencies => "all passes have one frequency: a second one is missing",
            Need::Runs => "all passes are of one run: a second one is missing",
            Need::Temperatures => "temperature_c is missing, or does not change",
            Need::Humidities => "relative_humidity_pct is missing, or does not change",
            Need::Record => "means over passes do not show it; a time-resolved run record is missing",
            Need::OutsideStandard => {
                "it acts like a change of mu0 and lateral stiffness; calibrate the lateral axis with weights"
            }
            Need::NormalStandard => {
                "it acts like a change of mu0 and normal stiffness; calibrate the normal axis with weights"
            }
        }
    }
}

/// A candidate cause of the gap. It nests the baseline: at the zero of its size nothing changes, bit for
/// bit. Written as JSON it is what `muprime model effects` shows of it.
#[derive(Serialize)]
pub struct Effect {
    /// Name as docs/contract.md has it.
    pub name: &'static str,
    /// Where it sits.
    pub place: Location,
    /// One sentence on the mechanism.
    pub summary: &'static str,
    /// Where form and ranges come from.
    pub source: &'static str,
    /// What a table must hold before it can be seen.
    pub needs: &'static [Need],
    /// Its functional forms.
    pub laws: &'static [Law],
    /// Largest share of its change by which it may depart smoothly from its form. A linear map of the
    /// readings has no shape of its own: what needs more is something else (a vibration in the plane of the
    /// plate looks like a cross-talk that is off by a third).
    #[serde(skip)]
    pub departs_by: f64,
    /// What it acts on over which covariates; none where nothing more than its laws is known.
    #[serde(skip)]
    pub acts: Option<Acts>,
    /// Effects of the library that together nearly do what this one does: as a pair they are not named.
    #[serde(skip)]
    pub imitated_by: &'static [&'static str],
    /// The cause in words, for a sentence; none where its name is a name of the library.
    #[serde(skip)]
    pub words: Option<&'static str>,
    /// Error of mu' by interpolation, root mean square; zero for what is evaluated directly.
    #[serde(skip)]
    pub interpolation_error: f64,
    /// The table of an effect that a user gave as data.
    #[serde(skip)]
    pub own: Option<&'static OwnTable>,
    /// Makes what `change` with this law and these parameters will look up, so that a control loop makes
    /// nothing.
    #[serde(skip)]
    pub prepare: fn(usize, &[f64]),
    /// Changes what the contact is given: by the law, and its parameters in its order.
    #[serde(skip)]
    pub change: fn(usize, &[f64], &Condition, &Design, &mut Contact),
    /// Changes what the instruments make of the friction force.
    #[serde(skip)]
    pub read: fn(usize, &[f64], &Condition, &Design, &mut SensorError),
}

impl Effect {
    /// A cause without a name that changes nothing: what a cause does not state is as here.
    pub const NONE: Effect = Effect {
        name: "",
        place: Location::Contact,
        summary: "",
        source: "",
        laws: &[],
        departs_by: 1.0,
        acts: None,
        needs: &[],
        imitated_by: &[],
        words: None,
        interpolation_error: 0.0,
        own: None,
        prepare: |_, _| (),
        change: |_, _, _, _, _| (),
        read: |_, _, _, _, _| (),
    };
}
