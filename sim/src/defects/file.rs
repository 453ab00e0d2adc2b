//! The defects file: TOML, unknown keys refused with their place.
//!
//! A `[[defect]]` has a `name` and either all its `parameters` or a `seed` to draw them from (or both: what
//! is given holds). A `[[channel]]` has a `channel` (force, amplifier, stage), a `fault` (ok, off, stuck,
//! garbage, wrong, slow, delayed, intermittent), and may have `from_s`, `until_s` and a `strength`.

use super::{Defect, DefectKind, Values};
use crate::channel::ChannelFault;
use crate::noise::Noise;
use serde::Deserialize;

/// The defects of one world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defects {
    /// Defects of bodies and instruments, in the order in which they act.
    pub defects: Vec<Defect>,
    /// Faults of communication.
    pub channels: Vec<ChannelFault>,
}

/// Why a defects file was refused.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum DefectsError {
    /// Not TOML, or a key or value that has no place there.
    #[error("{0}")]
    Toml(#[from] toml::de::Error),
    #[error("line {line}: no defect is called '{name}'; known: {known}")]
    UnknownKind { line: usize, name: String, known: String },
    #[error("line {line}: '{defect}' has no parameter '{parameter}'; it has: {known}")]
    UnknownParameter { line: usize, defect: &'static str, parameter: String, known: String },
    #[error("line {line}: '{defect}' needs its parameter '{parameter}' (or a seed to draw it from)")]
    MissingParameter { line: usize, defect: &'static str, parameter: &'static str },
    #[error("line {line}: '{one}' and '{other}' cannot act together in this world; leave one out")]
    Together { line: usize, one: &'static str, other: &'static str },
    #[error("line {line}: '{parameter}' is {value}; a finite number is needed")]
    NotFinite { line: usize, parameter: String, value: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    defect: Vec<DefectEntry>,
    #[serde(default)]
    channel: Vec<toml::Spanned<ChannelFault>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DefectEntry {
    name: toml::Spanned<String>,
    seed: Option<u64>,
    #[serde(default)]
    parameters: std::collections::BTreeMap<String, toml::Spanned<f64>>,
}

impl Defects {
    /// No defect at all.
    pub fn none() -> Self {
        Self::default()
    }

    /// One defect, its parameters drawn from a seed: sealed by name and seed.
    ///
    /// # Errors
    /// An unknown name.
    pub fn sealed(name: &str, seed: u64) -> Result<Self, DefectsError> {
        let kind = DefectKind::named(name).ok_or_else(|| unknown(1, name))?;
        Ok(Self::one(kind, drawn(kind, seed)))
    }

    /// One defect.
    pub fn one(kind: &'static DefectKind, values: Values) -> Self {
        Self { defects: vec![Defect { kind, values }], channels: Vec::new() }
    }

    /// Reads a defects file's text.
    ///
    /// ```
    /// let defects = muprime_sim::defects::Defects::parse(
    ///     r#"
    ///     [[defect]]
    ///     name = "amplitude_droop"
    ///     parameters = { load_ratio_at_1_n = 0.4, flight_per_um = 0.3 }
    ///
    ///     [[defect]]
    ///     name = "plate_tilt"
    ///     seed = 12
    ///
    ///     [[channel]]
    ///     channel = "force"
    ///     fault = "intermittent"
    ///     from_s = 10.0
    ///     until_s = 12.0
    ///     strength = 0.5
    ///     "#,
    /// )?;
    /// assert_eq!(defects.defects.len(), 2);
    /// # Ok::<(), muprime_sim::defects::DefectsError>(())
    /// ```
    ///
    /// # Errors
    /// What is wrong with it, and in which line.
    pub fn parse(text: &str) -> Result<Self, DefectsError> {
        let file: File = toml::from_str(text)?;
        let line = |offset: usize| 1 + text[..offset.min(text.len())].matches('\n').count();
        let mut defects = Vec::with_capacity(file.defect.len());
        for entry in &file.defect {
            let at = line(entry.name.span().start);
            let name = entry.name.get_ref();
            let kind = DefectKind::named(name).ok_or_else(|| unknown(at, name))?;
            let mut values = drawn(kind, entry.seed.unwrap_or(0));
            let mut given = [false; 4];
            for (parameter, value) in &entry.parameters {
                let (line, value) = (line(value.span().start), *value.get_ref());
                let (defect, parameter) = (kind.name, parameter.clone());
                let Some(index) = kind.parameters.iter().position(|p| p.name == parameter) else {
                    let known = kind.parameters.iter().map(|p| p.name).collect::<Vec<_>>().join(", ");
                    return Err(DefectsError::UnknownParameter { line, defect, parameter, known });
                };
                if !value.is_finite() {
                    return Err(DefectsError::NotFinite { line, parameter, value });
                }
                values[index] = value;
                given[index] = true;
            }
            if entry.seed.is_none()
                && let Some(missing) = (0..kind.parameters.len()).find(|i| !given[*i])
            {
                let parameter = kind.parameters[missing].name;
                return Err(DefectsError::MissingParameter { line: at, defect: kind.name, parameter });
            }
            if let Some(clash) = defects.iter().find(|d: &&Defect| !super::compatible(d.kind, kind)) {
                return Err(DefectsError::Together { line: at, one: clash.kind.name, other: kind.name });
            }
            defects.push(Defect { kind, values });
        }
        for entry in &file.channel {
            let fault = entry.get_ref();
            let numbers =
                [("from_s", Some(fault.from_s)), ("until_s", fault.until_s), ("strength", fault.strength)];
            for (parameter, value) in numbers {
                if let Some(value) = value.filter(|v| !v.is_finite()) {
                    let (line, parameter) = (line(entry.span().start), parameter.to_string());
                    return Err(DefectsError::NotFinite { line, parameter, value });
                }
            }
        }
        let channels = file.channel.into_iter().map(toml::Spanned::into_inner).collect();
        Ok(Self { defects, channels })
    }
}

fn drawn(kind: &DefectKind, seed: u64) -> Values {
    kind.draw(&mut Noise::new(seed, kind.name))
}

fn unknown(line: usize, name: &str) -> DefectsError {
    let known = super::ALL.iter().map(|kind| kind.name).collect::<Vec<_>>().join(", ");
    DefectsError::UnknownKind { line, name: name.to_string(), known }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The file that reads back as these defects.
    fn to_toml(of: &Defects) -> String {
        let mut out = String::new();
        for defect in &of.defects {
            out.push_str(&format!("[[defect]]\nname = \"{}\"\n[defect.parameters]\n", defect.kind.name));
            for (parameter, value) in defect.kind.parameters.iter().zip(defect.values) {
                out.push_str(&format!("{} = {value:e}\n", parameter.name));
            }
            out.push('\n');
        }
        for channel in &of.channels {
            let text = toml::to_string(channel).unwrap_or_default();
            out.push_str(&format!("[[channel]]\n{text}\n"));
        }
        out
    }

    #[test]
    fn a_file_reads_back_as_itself() {
        let text = "[[defect]]\nname = \"squeeze_film\"\nseed = 7\n\n[[channel]]\nchannel = \"force\"\nfault = \"stuck\"\nfrom_s = 2.5\nuntil_s = 3.0\n";
        let defects = Defects::parse(text).unwrap();
        assert_eq!(defects.defects[0], Defects::sealed("squeeze_film", 7).unwrap().defects[0]);
        assert_eq!(Defects::parse(&to_toml(&defects)).unwrap(), defects);
    }

    #[test]
    fn every_fault_of_a_file_is_told_with_its_place() {
        for (text, expected) in [
            ("[[channel]]\nchannel = \"force\"\nfault = \"spikes\"\n", "it has one of ok, off, stuck"),
            ("[[defect]]\nname = \"gremlin\"\nseed = 1\n", "line 2: no defect is called 'gremlin'"),
            (
                "[[defect]]\nname = \"squeeze_film\"\nparameters = { area = 1.0 }\n",
                "line 3: 'squeeze_film' has no parameter 'area'",
            ),
            (
                "[[defect]]\nname = \"squeeze_film\"\n",
                "line 2: 'squeeze_film' needs its parameter 'film_area_m2'",
            ),
            (
                "[[defect]]\nname = \"amplitude_droop\"\nparameters = { load_ratio_at_1_n = nan }\n",
                "line 3: 'load_ratio_at_1_n' is NaN",
            ),
            ("[[defect]]\nname = \"squeeze_film\"\nsees = 3\n", "line 3"),
            ("[[channel]]\nchannel = \"force\"\nfault = \"tired\"\n", "line 3"),
            (
                "[[defect]]\nname = \"ridge_inertia\"\nseed = 1\n[[defect]]\nname = \"multi_asperity\"\nseed = 1\n",
                "line 5: 'ridge_inertia' and 'multi_asperity' cannot act together",
            ),
            ("[[channel]]\nchannel = \"force\"\nfault = \"off\"\nfrom_s = nan\n", "'from_s' is NaN"),
            ("colour = 3\n", "line 1"),
        ] {
            let error = Defects::parse(text).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }
}
