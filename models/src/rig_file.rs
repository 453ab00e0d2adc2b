//! `rig.toml`: what is known of a rig beside a table of passes. One form, one check, one writer.
//!
//! The finger's calibration, the repeatability of passes, and what certificates leave open. Unknown keys are refused,
//! so that a misspelt certificate cannot go unread. Whoever needs the file reads it with [`RigFile::parse`] and writes
//! it with [`RigFile::to_toml`]; [`CertifiedKey`] is the list of what a certificate can bound.

use crate::finger::Finger;
use crate::pass::Pass;
#[cfg(doc)]
use crate::pass::coulomb_coefficient;
use crate::quantity::PeakToPeak;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What a calibration certificate is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CertificateKind {
    /// Counts of the force sensor to newtons.
    Force,
    /// Drive set-point to peak-to-peak amplitude.
    Amplitude,
    /// Delay and clock of a channel.
    Latency,
    /// Phase shift of the skin against the plate.
    Phase,
    /// Stiffness and friction of a fingertip.
    Finger,
    /// What a force sensor is besides its matrix: creep, orientation, noise, dynamics.
    Sensor,
}

/// The name that files have.
impl std::fmt::Display for CertificateKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.serialize(f)
    }
}

/// Declares what a certificate can bound: the key, its words, the kind of certificate that states it; its
/// entry in `[calibration]`, and the largest standard uncertainty that can be meant.
macro_rules! certified_keys {
    ($(
        $(#[$about:meta])* $key:ident, $words:literal, $kind:expr;
        $(#[$of:meta])* $sd:ident up to $largest:literal;
    )*) => {
        /// A quantity whose error an outside calibration bounds: a key of `[calibration]`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
        #[serde(rename_all = "snake_case")]
        pub enum CertifiedKey {
            $($(#[$about])* $key,)*
        }

        /// Standard uncertainties that outside calibrations leave; missing where there is no certificate.
        #[derive(Clone, Debug, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields)]
        pub struct Calibration {
            $(
                $(#[$of])*
                #[serde(default, skip_serializing_if = "Option::is_none")]
                pub $sd: Option<f64>,
            )*
            /// File name of each certificate that says so, by its kind.
            #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
            pub certificates: BTreeMap<CertificateKind, String>,
        }

        impl CertifiedKey {
            /// Every key.
            pub const ALL: [CertifiedKey; 9] = [$(CertifiedKey::$key),*];

            const fn facts(self) -> (&'static str, &'static str, Option<CertificateKind>, f64) {
                match self {
                    $(CertifiedKey::$key => (stringify!($sd), $words, $kind, $largest),)*
                }
            }
        }

        impl Calibration {
            fn stated(&self, key: CertifiedKey) -> Option<f64> {
                match key {
                    $(CertifiedKey::$key => self.$sd,)*
                }
            }
        }
    };
}

certified_keys! {
    /// Gain of the vibration amplitude.
    AmplitudeGain, "gain of the amplitude", Some(CertificateKind::Amplitude);
    /// Of the amplitude's gain (vibrometer), relative, 0 to 1.
    amplitude_gain_sd up to 1.0;
    /// Gain of the lateral force.
    LateralGain, "gain of the lateral force", FORCE;
    /// Of the lateral force's gain (dead weight), relative, 0 to 1.
    lateral_gain_sd up to 1.0;
    /// Gain of the normal force.
    NormalGain, "gain of the normal force", FORCE;
    /// Of the normal force's gain (dead weight), relative, 0 to 1.
    normal_gain_sd up to 1.0;
    /// Gain of the sliding speed.
    SpeedGain, "gain of the sliding speed", None;
    /// Of the speed's gain (encoder, or the stroke against a clock), relative, 0 to 1.
    speed_gain_sd up to 1.0;
    /// Zero of the lateral force.
    LateralOffset, "zero of the lateral force", FORCE;
    /// Of the lateral force's zero, N, 0 to 100.
    lateral_offset_sd_n up to 100.0;
    /// Zero of the normal force.
    NormalOffset, "zero of the normal force", FORCE;
    /// Of the normal force's zero, N, 0 to 100.
    normal_offset_sd_n up to 100.0;
    /// Direction of the plate in the sensor's frame.
    Tilt, "level of the plate in the sensor's frame", FORCE;
    /// Of the level of the plate in the sensor's frame (the direction of the normal pull), rad, 0 to 1.
    tilt_sd_rad up to 1.0;
    /// Share of the normal force that is read as lateral force.
    Crosstalk, "cross-talk of the normal onto the lateral force", FORCE;
    /// Of the cross-talk of normal onto lateral force, N/N, 0 to 1. It also stands for the other one where
    /// `crosstalk_onto_normal_sd` does not state that apart.
    crosstalk_sd up to 1.0;
    /// Share of the lateral force that is read as normal force.
    CrosstalkOntoNormal, "cross-talk of the lateral onto the normal force", FORCE;
    /// Of the cross-talk of lateral onto normal force, N/N, 0 to 1.
    crosstalk_onto_normal_sd up to 1.0;
}
const FORCE: Option<CertificateKind> = Some(CertificateKind::Force);

impl CertifiedKey {
    /// The key in `[calibration]`.
    pub const fn name(self) -> &'static str {
        self.facts().0
    }

    /// The quantity in words, as in 'the gain of the amplitude'.
    pub const fn words(self) -> &'static str {
        self.facts().1
    }

    /// The kind of certificate that states it; `None` where no certificate does and rig.toml states it by itself.
    pub const fn kind(self) -> Option<CertificateKind> {
        self.facts().2
    }

    /// Largest standard uncertainty that can be meant, in the key's unit.
    pub const fn largest(self) -> f64 {
        self.facts().3
    }
}

/// Repeatability of passes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PassNoise {
    /// Repeatability of the lateral force from pass to pass, one relative standard deviation, 0 to 1.
    pub pass_relative_sd: f64,
    /// Standard deviation of a pass's mean force, each axis, in N, 0 to 100.
    pub force_sd_n: f64,
}

impl PassNoise {
    /// Standard uncertainty of a pass's relative friction at a normal force, with `mu_0` and its own
    /// uncertainty.
    pub fn mu_relative_sd(&self, mu_relative: f64, normal_force_n: f64, [mu0, mu0_sd]: [f64; 2]) -> f64 {
        let force = self.force_sd_n / (mu0 * normal_force_n) * (mu_relative * mu0).hypot(1.0);
        (mu_relative * self.pass_relative_sd.hypot(mu0_sd / mu0)).hypot(force)
    }

    /// Standard uncertainty of `mu_0` as [`coulomb_coefficient`] has it from these passes.
    pub fn coulomb_coefficient_sd<'a>(&self, mu0: f64, passes: impl IntoIterator<Item = &'a Pass>) -> f64 {
        let still = passes.into_iter().filter(|p| p.amplitude == PeakToPeak::ZERO);
        let forces = still.filter_map(|p| Some((p.friction_force_n()?, p.normal_force_n)));
        let (mut variance, mut bottom) = (0.0, 0.0);
        for (friction, load) in forces {
            let force = self.force_sd_n * self.force_sd_n * (1.0 + mu0 * mu0);
            variance += load * load * (force + (self.pass_relative_sd * friction).powi(2));
            bottom += load * load;
        }
        variance.sqrt() / bottom
    }

    /// The first value that cannot be meant.
    ///
    /// # Errors
    /// A value that is not finite, negative or too large; both zero.
    pub fn check(&self) -> Result<(), RigFileError> {
        let refuse = |key, value, needed: &str| {
            Err(RigFileError::Value { section: "noise", key, value, needed: needed.to_string() })
        };
        if !(0.0..=1.0).contains(&self.pass_relative_sd) {
            return refuse("pass_relative_sd", self.pass_relative_sd, "a number from 0 to 1");
        }
        if !(0.0..=100.0).contains(&self.force_sd_n) {
            return refuse("force_sd_n", self.force_sd_n, "a number of newtons from 0 to 100");
        }
        if self.pass_relative_sd + self.force_sd_n == 0.0 {
            return refuse("force_sd_n", 0.0, "noise of at least one kind (pass_relative_sd or force_sd_n)");
        }
        Ok(())
    }
}

impl Default for PassNoise {
    /// What a rig of the paper's kind repeats to, where rig.toml says nothing.
    fn default() -> Self {
        PassNoise { pass_relative_sd: 0.015, force_sd_n: 0.0008 }
    }
}

impl Calibration {
    /// The standard uncertainty that bounds a quantity, in the key's unit; `None` without a certificate.
    pub fn sd(&self, key: CertifiedKey) -> Option<f64> {
        let other = (key == CertifiedKey::CrosstalkOntoNormal).then_some(CertifiedKey::Crosstalk);
        self.stated(key).or_else(|| self.stated(other?))
    }

    /// The certificate behind a key for people, as in 'force certificate (cell-7.toml)'. A quantity that no
    /// kind of certificate covers has rig.toml's own word.
    pub fn certificate_of(&self, key: CertifiedKey) -> String {
        let Some(kind) = key.kind() else { return format!("{} that rig.toml states", key.name()) };
        match self.certificates.get(&kind) {
            Some(file) => format!("{kind} certificate ({file})"),
            None => format!("{kind} certificate"),
        }
    }

    /// True where nothing is certified.
    pub fn is_empty(&self) -> bool {
        *self == Calibration::default()
    }
}

/// `rig.toml`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigFile {
    /// The finger's calibration.
    pub finger: Finger,
    /// The repeatability.
    #[serde(default)]
    pub noise: PassNoise,
    /// What certificates leave open.
    #[serde(default, skip_serializing_if = "Calibration::is_empty")]
    pub calibration: Calibration,
}

/// A `rig.toml` that cannot be used: what is wrong and where.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum RigFileError {
    /// No TOML, a key that is missing, or one that no rig.toml has; the message names line and column.
    #[error("{0}")]
    Form(#[from] toml::de::Error),
    /// A value that cannot be meant.
    #[error("[{section}] {key} = {value}: {needed} is needed")]
    Value { section: &'static str, key: &'static str, value: f64, needed: String },
}

impl RigFile {
    /// Reads and checks a file's text.
    ///
    /// # Errors
    /// Text that is no rig.toml, and the first value that [`RigFile::check`] refuses.
    pub fn parse(text: &str) -> Result<Self, RigFileError> {
        let file: RigFile = toml::from_str(text)?;
        file.check()?;
        Ok(file)
    }

    /// The first value that cannot be meant, with its place and what would be accepted.
    ///
    /// # Errors
    /// A value that is not finite, negative, or beyond what any finger, sensor or certificate has.
    pub fn check(&self) -> Result<(), RigFileError> {
        let within = |section, key, value: f64, [low, high]: [f64; 2]| {
            if value >= low && value <= high {
                return Ok(());
            }
            let needed = format!("a number from {low} to {high}");
            Err(RigFileError::Value { section, key, value, needed })
        };
        let f = &self.finger;
        within("finger", "normal_stiffness_n_per_m", f.normal_stiffness_n_per_m, STIFFNESS_N_PER_M)?;
        within("finger", "lateral_stiffness_n_per_m", f.lateral_stiffness_n_per_m, STIFFNESS_N_PER_M)?;
        within("finger", "stiffness_relative_sd", f.stiffness_relative_sd, [0.0, STIFFNESS_RELATIVE_SD_MAX])?;
        if let Some(modulus) = f.young_modulus_pa {
            within("finger", "young_modulus_pa", modulus, YOUNG_MODULUS_PA)?;
        }
        f.check().map_err(|e| RigFileError::Value {
            section: "finger",
            key: e.name,
            value: e.value,
            needed: e.needed.to_string(),
        })?;
        self.noise.check()?;
        for key in CertifiedKey::ALL {
            if let Some(sd) = self.calibration.sd(key) {
                within("calibration", key.name(), sd, [0.0, key.largest()])?;
            }
        }
        Ok(())
    }

    /// The file's text; [`RigFile::parse`] gives the same values back, bit for bit.
    ///
    /// # Errors
    /// A value that [`RigFile::check`] refuses: what would not be read is not written.
    pub fn to_toml(&self) -> Result<String, RigFileError> {
        self.check()?;
        Ok(toml::to_string(self).expect("numbers, names and tables are TOML"))
    }
}

/// Stiffness of anything that a plate can rub against, N/m: fingertips have 1e3 (slow) to 1e7 (ultrasonic).
pub const STIFFNESS_N_PER_M: [f64; 2] = [1e2, 1e10];
/// Largest relative uncertainty of a stiffness: beyond a factor of seven either way nothing is known of it.
const STIFFNESS_RELATIVE_SD_MAX: f64 = 2.0;
/// Young's modulus in Pa: from gels to diamond.
const YOUNG_MODULUS_PA: [f64; 2] = [1e2, 2e12];

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[finger]\nnormal_stiffness_n_per_m = 3.9e6\nlateral_stiffness_n_per_m = 1.5e6\n\
                        stiffness_relative_sd = 0.05\n\n[noise]\npass_relative_sd = 0.015\nforce_sd_n = 0.0008\n";

    fn refusal(text: &str) -> String {
        RigFile::parse(text).expect_err(text).to_string()
    }

    #[test]
    fn what_is_written_is_read_back_bit_for_bit() {
        let mut file = RigFile::parse(TEXT).expect("the contract's file");
        assert!(file.calibration.is_empty());
        let third = 1.0 / 3.0;
        file.finger.stiffness_relative_sd = third;
        file.finger.young_modulus_pa = Some(28.3e6 * third);
        file.noise.force_sd_n = 1e-5 * third;
        file.calibration = Calibration {
            amplitude_gain_sd: Some(0.1 * third),
            lateral_gain_sd: Some(0.2 * third),
            normal_gain_sd: Some(0.3 * third),
            speed_gain_sd: Some(0.4 * third),
            lateral_offset_sd_n: Some(0.5 * third),
            normal_offset_sd_n: Some(0.6 * third),
            tilt_sd_rad: Some(0.7 * third),
            crosstalk_sd: Some(0.8 * third),
            crosstalk_onto_normal_sd: Some(0.9 * third),
            certificates: [(CertificateKind::Force, "cell \"7\".toml".to_string())].into(),
        };
        let text = file.to_toml().expect("a file that passes its own check");
        assert_eq!(RigFile::parse(&text).expect(&text), file);
        // Each key is one that the file has, and reads what stands there.
        for key in CertifiedKey::ALL {
            assert!(text.contains(&format!("\n{} = ", key.name())), "{text}");
            let written = text.lines().find_map(|l| l.strip_prefix(&format!("{} = ", key.name())));
            assert_eq!(written.and_then(|v| v.parse().ok()), file.calibration.sd(key), "{}", key.name());
        }
    }

    #[test]
    fn a_key_that_no_file_has_is_refused_in_every_section() {
        for wrong in [
            "[fingers]\n",
            "[calibration]\nnormal_gain = 0.1\n",
            "[calibration.certificates]\nspeed = \"s.toml\"\n",
        ] {
            let message = refusal(&format!("{TEXT}\n{wrong}"));
            assert!(message.contains("unknown"), "{wrong}: {message}");
        }
        assert!(refusal(&TEXT.replace("force_sd_n", "force_sd")).contains("unknown field `force_sd`"));
    }

    #[test]
    fn values_that_cannot_be_meant_are_refused_with_their_place() {
        for (from, to, place) in [
            (
                "stiffness_relative_sd = 0.05",
                "stiffness_relative_sd = 1e6",
                "[finger] stiffness_relative_sd = 1000000",
            ),
            (
                "stiffness_relative_sd = 0.05",
                "stiffness_relative_sd = nan",
                "[finger] stiffness_relative_sd = NaN",
            ),
            ("3.9e6", "-3.9e6", "[finger] normal_stiffness_n_per_m"),
            ("1.5e6", "inf", "[finger] lateral_stiffness_n_per_m"),
            ("pass_relative_sd = 0.015", "pass_relative_sd = inf", "[noise] pass_relative_sd = inf"),
            ("force_sd_n = 0.0008", "force_sd_n = inf", "[noise] force_sd_n = inf"),
            ("force_sd_n = 0.0008", "force_sd_n = -1e-3", "[noise] force_sd_n"),
            ("[noise]", "poisson_ratio = 0.6\n[noise]", "[finger] poisson_ratio = 0.6"),
        ] {
            assert!(TEXT.contains(from), "{from}");
            let message = refusal(&TEXT.replacen(from, to, 1));
            assert!(message.contains(place) && message.contains("is needed"), "{to}: {message}");
        }
        for key in CertifiedKey::ALL {
            for value in ["nan", "-0.01", "1e3"] {
                let message = refusal(&format!("{TEXT}[calibration]\n{} = {value}\n", key.name()));
                assert!(message.contains(&format!("[calibration] {}", key.name())), "{message}");
            }
        }
        let silent = TEXT.replace("= 0.015", "= 0.0").replace("= 0.0008", "= 0.0");
        assert!(refusal(&silent).contains("at least one kind"));
    }

    #[test]
    fn the_schema_beside_is_that_of_the_code() {
        let stored = include_str!("../rig.schema.json");
        let schema = serde_json::to_string_pretty(&schemars::schema_for!(RigFile)).expect("JSON");
        assert_eq!(schema + "\n", stored, "write this schema to models/rig.schema.json");
    }
}
