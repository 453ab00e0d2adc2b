//! The fingertip library: size, material, moduli, springs, each with its source.

use crate::bundled;
use crate::input::{self, BadInput};
use models::Finger;
use models::rig_file::{Calibration, PassNoise, RigFile, RigFileError};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A fingertip as its file describes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FingertipFile {
    /// Name in the library.
    pub name: String,
    /// `human`, `artificial` or `probe`.
    pub kind: FingertipKind,
    /// What it is made of.
    pub material: String,
    /// Radius of the tip in m.
    pub radius_m: f64,
    /// Coulomb friction coefficient to expect on the plate, for planning and as a first guess.
    pub mu0: f64,
    /// Springs and moduli.
    pub finger: Finger,
    /// Where the numbers come from; each key is a number's name.
    pub source: std::collections::BTreeMap<String, String>,
}

/// What kind of tip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum FingertipKind {
    /// A person's finger: dead-man input and exposure limits apply.
    Human,
    /// An artificial fingertip.
    Artificial,
    /// A probe of simple shape.
    Probe,
}

/// How a setup names its fingertip: `tip = "name"`, with numbers of its own where a calibration has better ones.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FingertipSetup {
    /// Name in the library, or path of a file, relative to the setup.
    pub tip: String,
    /// The numbers of a human fingertip are used and nobody touches the plate: the guards for a finger are
    /// off. Record, report and every page of a run say so.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub nobody_touches_the_plate: bool,
    /// Overrides, N/m.
    pub normal_stiffness_n_per_m: Option<f64>,
    /// Overrides, N/m.
    pub lateral_stiffness_n_per_m: Option<f64>,
    /// Overrides, relative.
    pub stiffness_relative_sd: Option<f64>,
    /// Overrides.
    pub mu0: Option<f64>,
}

/// A fingertip, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Fingertip {
    /// Name.
    pub name: String,
    /// Kind.
    pub kind: FingertipKind,
    /// Friction coefficient to expect.
    pub mu0: f64,
    /// Springs and moduli.
    pub finger: Finger,
}

/// Name and text of every bundled fingertip. Add one: a file in `runs/fingertips/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[
    ("artificial-silicone", include_str!("../fingertips/artificial-silicone.toml")),
    ("human-index-moist", include_str!("../fingertips/human-index-moist.toml")),
    ("human-index-dry", include_str!("../fingertips/human-index-dry.toml")),
    ("probe-pmma-sphere", include_str!("../fingertips/probe-pmma-sphere.toml")),
];

impl FingertipFile {
    /// What of it cannot be used: table and key (or the whole), and the problem.
    pub fn problems(&self) -> Vec<(Vec<&'static str>, String)> {
        let above = |v: f64| v.is_finite() && v > 0.0;
        let mut wrong = Vec::new();
        if !above(self.mu0) {
            wrong.push((vec!["mu0"], format!("mu0 = {}; a number above zero is needed", self.mu0)));
        }
        if !(above(self.radius_m) && self.radius_m <= RADIUS_MAX_M) {
            let needed = format!("above 0, to {RADIUS_MAX_M}, in m");
            wrong.push((vec!["radius_m"], format!("radius_m = {}; {needed} is needed", self.radius_m)));
        }
        if let Err((key, problem)) = usable(&self.finger) {
            wrong.push((vec!["finger", key], problem));
        }
        wrong
    }

    /// Reads the text of the file called `name`: what this takes is what a check of the file approves.
    ///
    /// # Errors
    /// The first problem, with its place.
    fn read(name: &str, text: &str) -> Result<Self, BadInput> {
        let file: FingertipFile = input::parse_toml(name, text)?;
        match file.problems().into_iter().next() {
            None => Ok(file),
            Some((place, problem)) => {
                Err(BadInput::new(name, text, input::place_of(text, &place), problem, None))
            }
        }
    }
}

/// Springs that a run's rig.toml takes, or else the key and the problem. The file of a tip and a setup's
/// overrides have one judge, so that no run is refused for what a check approved.
fn usable(finger: &Finger) -> Result<(), (&'static str, String)> {
    let rig = RigFile { finger: *finger, noise: PassNoise::default(), calibration: Calibration::default() };
    rig.check().map_err(|error| {
        let RigFileError::Value { key, value, needed, .. } = error else { return ("", error.to_string()) };
        let meant = input::unit_meant(key, value, input::usual(key));
        let meant = meant.map_or(String::new(), |meant| format!(" ({meant})"));
        (key, format!("{key} = {value}: {needed} is needed{meant}"))
    })
}

/// Largest radius of a tip, m: a fist.
const RADIUS_MAX_M: f64 = 0.2;

impl Fingertip {
    /// The tip that a setup names, with the setup's overrides.
    ///
    /// # Errors
    /// A tip that is not there or not usable: the key of [`FingertipSetup`] that is wrong, and the problem.
    pub fn resolve(setup: &FingertipSetup, folder: &Path) -> Result<Self, (&'static str, String)> {
        let text = match bundled::text(BUNDLED, &setup.tip) {
            Some(text) => text.to_string(),
            None => input::text_of(&folder.join(&setup.tip)).map_err(|e| {
                ("tip", format!("no fingertip '{}' ({e}); bundled: {}", setup.tip, bundled::names(BUNDLED)))
            })?,
        };
        let file = FingertipFile::read(&setup.tip, &text)
            .map_err(|e| ("tip", format!("fingertip '{}'{}", setup.tip, e.after_its_name())))?;
        let mut finger = file.finger;
        let set = |slot: &mut f64, stated: Option<f64>| *slot = stated.unwrap_or(*slot);
        set(&mut finger.normal_stiffness_n_per_m, setup.normal_stiffness_n_per_m);
        set(&mut finger.lateral_stiffness_n_per_m, setup.lateral_stiffness_n_per_m);
        set(&mut finger.stiffness_relative_sd, setup.stiffness_relative_sd);
        let named = |(key, problem)| (key, format!("fingertip '{}': {problem}", setup.tip));
        usable(&finger).map_err(named)?;
        let mu0 = setup.mu0.unwrap_or(file.mu0);
        if !(mu0.is_finite() && mu0 > 0.0) {
            return Err(named(("mu0", format!("mu0 = {mu0}; a number above zero is needed"))));
        }
        Ok(Fingertip { name: file.name, kind: file.kind, mu0, finger })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolved_with(own: &str, text: &str) -> Result<Fingertip, (&'static str, String)> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("tip.toml"), text).unwrap();
        let setup: FingertipSetup = toml::from_str(&format!("tip = \"tip.toml\"\n{own}")).unwrap();
        Fingertip::resolve(&setup, folder.path())
    }

    fn resolved(text: &str) -> Result<Fingertip, String> {
        resolved_with("", text).map_err(|(_, problem)| problem)
    }

    /// A setup's own key was blamed for the number of the tip's file that it replaces.
    #[test]
    fn a_problem_names_the_key_of_the_setup_that_causes_it() {
        let (good, bad) = (BUNDLED[0].1.to_string(), BUNDLED[0].1.replace("mu0 = 0.5", "mu0 = -0.5"));
        let key = |own: &str, text: &str| resolved_with(own, text).unwrap_err().0;
        assert_eq!(key("mu0 = 0.7", &bad), "tip");
        for own in ["mu0", "normal_stiffness_n_per_m", "lateral_stiffness_n_per_m", "stiffness_relative_sd"] {
            assert_eq!(key(&format!("{own} = -1.0"), &good), own);
        }
    }

    /// The file of a tip passed its check, and a setup that named it refused it with an error of TOML.
    #[test]
    fn a_setup_takes_a_tip_with_units_and_refuses_with_the_tips_own_place() {
        let text = BUNDLED[0].1;
        let units = text
            .replace("radius_m = 8e-3", "radius_m = \"8mm\"")
            .replace("normal_stiffness_n_per_m = 3.9e6", "normal_stiffness_n_per_m = \"3.9N/um\"");
        assert_ne!(units, text);
        assert_eq!(resolved(&units).unwrap(), resolved(text).unwrap());
        let why = resolved(&text.replace("mu0 = 0.5", "mu0 = \"much\"")).unwrap_err();
        assert!(why.starts_with("fingertip 'tip.toml', line 5: ") && !why.contains('\n'), "{why}");
    }

    /// A check approved these, and every setup that named them was refused for its rig.toml.
    #[test]
    fn what_a_setup_refuses_a_check_of_the_tip_refuses_too() {
        for (from, to, words) in [
            (
                "= 3.9e6",
                "= 2.5",
                "normal_stiffness_n_per_m = 2.5: a number from 100 to 10000000000 is needed",
            ),
            ("= 3.9e6", "= 2.5", "N/\u{b5}m meant?"),
            ("_sd = 0.05", "_sd = 30", "stiffness_relative_sd = 30: a number from 0 to 2 is needed"),
        ] {
            let text = BUNDLED[0].1.replace(from, to);
            let problems = toml::from_str::<FingertipFile>(&text).unwrap().problems();
            assert_eq!(problems.len(), 1, "{to}");
            assert!(problems[0].1.contains(words), "{problems:?}");
            assert!(resolved(&text).unwrap_err().contains(words), "{to}");
        }
    }
}
