//! What can be wrong with this world.
//!
//! A defect is a [`DefectKind`]: a name, a place, its parameters, and what it does at one of four points: to
//! the world's set-up, to the plate's amplitude under the finger, to the contact, to the forces on their way
//! to the sensor. Its formulae are this world's own. Where a library effect bears the same name, the cause is
//! the same and the formula another.
//!
//! To add one: a file in this folder with a `KIND`, and its name in the list below.

mod file;

use crate::contact::Contact;
use crate::noise::Noise;
use crate::world::WorldConfig;

pub use file::{Defects, DefectsError};

/// Where a defect sits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DefectSite {
    /// Between finger and plate.
    Contact,
    /// In the fingertip.
    Finger,
    /// Plate and amplifier.
    Plate,
    /// Sensor, stage, timing.
    Instrument,
}

/// How a parameter is drawn between its bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draw {
    /// Evenly.
    Linear,
    /// Evenly in its logarithm.
    Log,
    /// Evenly in its logarithm, with a random sign.
    Signed,
    /// Evenly in its logarithm, and then perhaps its reciprocal: a factor.
    Factor,
}

/// A parameter of a defect. The first one is its size: towards `none` the defect vanishes.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Name, with its unit.
    pub name: &'static str,
    /// Lowest value drawn.
    pub low: f64,
    /// Highest value drawn.
    pub high: f64,
    /// How it is drawn.
    pub draw: Draw,
}

/// Values of a defect's parameters, in their order; unused ones are zero.
pub type Values = [f64; 4];

/// The circumstances of an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surroundings {
    /// Time from the start of the run (s).
    pub time_s: f64,
    /// Time since the finger was put on (s).
    pub contact_time_s: f64,
    /// Position along the stroke (m).
    pub position_m: f64,
    /// 1 or -1.
    pub direction: f64,
    /// Frequency of the plate (Hz).
    pub frequency_hz: f64,
    /// True normal force (N).
    pub normal_force_n: f64,
    /// Ambient pressure (Pa).
    pub ambient_pressure_pa: f64,
    /// Temperature of the plate (deg C).
    pub temperature_c: f64,
}

/// The two forces in the sensor's frame (N).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Forces {
    /// Lateral, signed.
    pub lateral_n: f64,
    /// Normal, positive in compression.
    pub normal_n: f64,
}

/// What a defect does.
#[derive(Clone, Copy)]
enum Act {
    /// Changes the world before it starts.
    Setup(fn(&Values, &mut WorldConfig)),
    /// Peak-to-peak amplitude under the finger (m) from the one the amplifier knows of.
    Plate(fn(&Values, &Surroundings, f64) -> f64),
    /// Changes the contact.
    Contact(fn(&Values, &Surroundings, &mut Contact)),
    /// Changes the forces on their way to the sensor.
    Forces(fn(&Values, &Surroundings, &mut Forces)),
}

/// A kind of defect.
pub struct DefectKind {
    /// Its name: the effect's, where the library has one for the same cause.
    pub name: &'static str,
    /// Where it sits.
    pub place: DefectSite,
    /// Whether an effect of that name exists.
    pub in_library: bool,
    /// Whether a table of steady passes can show it.
    pub in_tables: bool,
    /// Whether another cause of the library does the same by construction (gains of stiffness, speed,
    /// amplitude; tilt and cross-talk).
    pub imitated: bool,
    /// What it is, and its source.
    pub summary: &'static str,
    /// Its parameters, the size first; at most four.
    pub parameters: &'static [Parameter],
    act: Act,
}

impl DefectKind {
    /// A cause that a table of steady passes shows and the library has an effect for.
    const fn cause(place: DefectSite, summary: &'static str) -> Self {
        let (act, parameters) = (Act::Setup(|_, _| {}), [].as_slice());
        let (name, in_library, in_tables, imitated) = ("", true, true, false);
        DefectKind { name, place, in_library, in_tables, imitated, summary, parameters, act }
    }

    /// A fault of the rig, which is none of the causes that a table shows.
    const fn fault(place: DefectSite, summary: &'static str) -> Self {
        DefectKind { in_library: false, in_tables: false, ..Self::cause(place, summary) }
    }

    /// The kind of a name.
    pub fn named(name: &str) -> Option<&'static DefectKind> {
        ALL.iter().copied().find(|kind| kind.name == name)
    }

    /// Draws its parameters.
    pub fn draw(&self, noise: &mut Noise) -> Values {
        std::array::from_fn(|i| self.parameters.get(i).map_or(0.0, |parameter| parameter.draw(noise)))
    }

    /// Sets its size to a share of its range: 0 the smallest, 1 the largest; a sign or a factor's side stays.
    pub fn resize(&self, values: &mut Values, share: f64) {
        if let Some(size) = self.parameters.first() {
            values[0] = size.at(share, values[0]);
        }
    }

    /// Sets its first shape to a share of that one's range.
    pub fn reshape(&self, values: &mut Values, share: f64) {
        if let Some(shape) = self.parameters.get(1) {
            values[1] = shape.at(share, values[1]);
        }
    }

    /// Sets the sign of its size, or whether a factor lies above one.
    pub fn turn(&self, values: &mut Values, up: bool) {
        match self.parameters.first().map(|p| p.draw) {
            Some(Draw::Signed) if (values[0] > 0.0) != up => values[0] = -values[0],
            Some(Draw::Factor) if (values[0] > 1.0) != up => values[0] = 1.0 / values[0],
            _ => {}
        }
    }
}

impl Parameter {
    const fn linear(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, draw: Draw::Linear }
    }

    const fn log(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, draw: Draw::Log }
    }

    const fn signed(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, draw: Draw::Signed }
    }

    const fn factor(name: &'static str, low: f64, high: f64) -> Self {
        Self { name, low, high, draw: Draw::Factor }
    }

    /// The value at a share of the range, on the side on which `now` lies.
    fn at(&self, share: f64, now: f64) -> f64 {
        let log = (self.low.ln() + share * (self.high.ln() - self.low.ln())).exp();
        match self.draw {
            Draw::Linear => self.low + share * (self.high - self.low),
            Draw::Log => log,
            Draw::Signed => log.copysign(now),
            Draw::Factor if now >= 1.0 => 1.0 + log,
            Draw::Factor => 1.0 / (1.0 + log),
        }
    }

    /// Draws a value.
    pub fn draw(&self, noise: &mut Noise) -> f64 {
        match self.draw {
            Draw::Linear => noise.between(self.low, self.high),
            Draw::Log => noise.log_between(self.low, self.high),
            Draw::Signed => {
                noise.log_between(self.low, self.high) * if noise.chance(0.5) { 1.0 } else { -1.0 }
            }
            Draw::Factor => {
                let size = noise.log_between(self.low, self.high);
                if noise.chance(0.5) { 1.0 + size } else { 1.0 / (1.0 + size) }
            }
        }
    }
}

/// One defect with its parameters' values.
#[derive(Clone, Copy)]
pub struct Defect {
    /// What kind.
    pub kind: &'static DefectKind,
    /// Its parameters' values, in the kind's order.
    pub values: Values,
}

impl PartialEq for Defect {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.kind, other.kind) && self.values == other.values
    }
}

impl std::fmt::Debug for Defect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}{:?}", self.kind.name, &self.values[..self.kind.parameters.len()])
    }
}

/// Kinds that make ridges fly, which this world solves for one ridge on a plain sine only.
const FLYING: [&str; 2] = ["ridge_inertia", "normal_damping"];
/// Kinds that need many ridges or a plate that does not move as a plain sine.
const SHAPED: [&str; 3] = ["multi_asperity", "second_harmonic", "in_plane_motion"];

/// Whether this world can solve two kinds at once.
pub fn compatible(one: &DefectKind, other: &DefectKind) -> bool {
    let clash = |a: &DefectKind, b: &DefectKind| FLYING.contains(&a.name) && SHAPED.contains(&b.name);
    !clash(one, other) && !clash(other, one)
}

impl Defects {
    /// Peak-to-peak amplitude under the finger (m).
    pub fn plate(&self, at: &Surroundings, pp_m: f64) -> f64 {
        self.defects.iter().fold(pp_m, |pp_m, defect| match defect.kind.act {
            Act::Plate(act) => act(&defect.values, at, pp_m),
            _ => pp_m,
        })
    }

    /// Changes the contact.
    pub fn contact(&self, at: &Surroundings, contact: &mut Contact) {
        for defect in &self.defects {
            if let Act::Contact(act) = defect.kind.act {
                act(&defect.values, at, contact);
            }
        }
    }

    /// Changes the forces on their way to the sensor.
    pub fn forces(&self, at: &Surroundings, forces: &mut Forces) {
        for defect in &self.defects {
            if let Act::Forces(act) = defect.kind.act {
                act(&defect.values, at, forces);
            }
        }
    }

    /// Changes the world before it starts.
    pub fn setup(&self, config: &mut WorldConfig) {
        for defect in &self.defects {
            if let Act::Setup(act) = defect.kind.act {
                act(&defect.values, config);
            }
        }
    }
}

/// Declares the files of this folder and lists their kinds, each with its file's name.
macro_rules! kinds {
    ($($file:ident)*) => {
        $(mod $file;)*
        /// Every kind of defect.
        pub static ALL: &[&DefectKind] = &[$(&DefectKind { name: stringify!($file), ..$file::KIND }),*];
    };
}

kinds! {
    amplifier_refuses_off amplifier_without_watchdog adhesion amplitude_droop amplitude_miscalibration
    amplitude_saturation chamber_stuck chamber_vents contact_ageing contaminated_patch force_crosstalk
    frictional_heating in_plane_motion lateral_gain lateral_offset_drift lateral_recovery
    lateral_resonance load_dependent_friction mains_modulation mode_shape moisture_drift multi_asperity
    normal_damping normal_offset plate_tilt rate_dependent_friction resonance_detuning ridge_anisotropy
    ridge_inertia second_harmonic sensor_lag slow_amplifier speed_error speed_ripple squeeze_film stage_stall
    stiffness_error subsurface_relaxation time_misalignment triboelectric_attraction
}
