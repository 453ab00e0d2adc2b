//! Certificates: what a calibration leaves behind, as a TOML file.
//!
//! A [`Certificate`] read from a file can be looked at, but not used: only [`Certificate::verify`] makes
//! the [`Verified`] that the loop and the diagnosis take. It refuses what is stale, foreign, out of its
//! temperature, or changed since it was written. The content hash finds hand edits and broken copies; it is
//! no signature and keeps nobody out who sets out to forge one.

pub mod date;
mod verify;

pub use models::rig_file::CertificateKind;
pub use verify::{Circumstances, Refusal, Verified};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// The schema that this version writes and reads.
pub const SCHEMA: &str = "muprime.certificate/1";

/// The instrument (or fingertip) that a certificate is about.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Instrument {
    /// What it is, for people.
    pub name: String,
    /// Its serial number: a certificate of another serial is refused.
    pub serial: String,
}

/// The data that was evaluated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RawData {
    /// File name or origin, for people.
    pub origin: String,
    /// SHA-256 of the bytes, in hexadecimal.
    pub sha256: String,
    /// Rows or samples.
    pub rows: u64,
}

impl RawData {
    /// Describes bytes that were read.
    pub fn of(origin: &str, bytes: &[u8], rows: u64) -> Self {
        RawData { origin: origin.into(), sha256: sha256_hex(bytes), rows }
    }
}

/// One parameter of the model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Parameter {
    /// Name, as the model names it.
    pub name: String,
    /// Best estimate.
    pub value: f64,
    /// Unit of the value.
    pub unit: String,
    /// Standard uncertainty, type A and B combined.
    pub standard_uncertainty: f64,
    /// Effective degrees of freedom (`inf` where the uncertainty is taken as known).
    pub degrees_of_freedom: f64,
    /// The 95 % interval.
    pub ci95: [f64; 2],
}

impl Parameter {
    /// The same with value and interval limited to the quantity's possible values, `least` or more. The part
    /// that is cut off holds no possible value, so the coverage stays the same; a lower end at `least` means
    /// that the data give an upper bound only. The value is then the likelihood's maximum within the range.
    pub fn at_least(self, least: f64) -> Self {
        let ci95 = self.ci95.map(|end| end.max(least));
        Parameter { ci95, value: self.value.max(least), ..self }
    }
}

/// What the model left of the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Residuals {
    /// Number of residuals.
    pub count: u64,
    /// Residual standard deviation.
    pub sd: f64,
    /// The largest in magnitude.
    pub largest: f64,
    /// Unit of both.
    pub unit: String,
    /// Lack-of-fit p value against replicates, where there were replicates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lack_of_fit_p: Option<f64>,
}

/// Where and for how long a certificate holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Validity {
    /// From this instant, RFC 3339 in UTC.
    pub from: String,
    /// Until this instant, RFC 3339 in UTC.
    pub until: String,
    /// Temperature range in degrees Celsius.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 2]>,
    /// Range of each quantity, by its name with unit.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub range: BTreeMap<String, [f64; 2]>,
}

/// A line of the uncertainty budget: relative or absolute as its unit says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BudgetLine {
    /// Where it comes from.
    pub source: String,
    /// `A` (statistics of the readings) or `B` (anything else), GUM 2.3.2 and 2.3.3.
    pub evaluation: Evaluation,
    /// Standard uncertainty.
    pub standard_uncertainty: f64,
    /// Its unit (`1` is relative).
    pub unit: String,
}

impl BudgetLine {
    /// What the statistics of the readings say.
    pub fn a(source: impl Into<String>, standard_uncertainty: f64, unit: &str) -> Self {
        let (source, unit) = (source.into(), unit.into());
        BudgetLine { source, evaluation: Evaluation::A, standard_uncertainty, unit }
    }

    /// What is known by any other means.
    pub fn b(source: impl Into<String>, standard_uncertainty: f64, unit: &str) -> Self {
        BudgetLine { evaluation: Evaluation::B, ..Self::a(source, standard_uncertainty, unit) }
    }
}

/// Type of evaluation of an uncertainty (GUM 0.7).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
pub enum Evaluation {
    /// By statistics of observations.
    A,
    /// By any other means.
    B,
}

/// The content of a certificate file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Certificate {
    /// `muprime.certificate/1`.
    pub schema: String,
    /// What was calibrated.
    pub kind: CertificateKind,
    /// When, RFC 3339 in UTC.
    pub date: String,
    /// By whom.
    pub operator: String,
    /// The model in words and symbols.
    pub model: String,
    /// Choices of the model that its use depends on, by name (tare policy, exponents, ...).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub settings: BTreeMap<String, String>,
    /// What a reader should know: findings, warnings, what was not tested.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub remarks: Vec<String>,
    /// Covariance matrix of the parameters, in their order.
    pub covariance: Vec<Vec<f64>>,
    /// SHA-256 over everything else here, in hexadecimal.
    #[serde(default)]
    pub content_sha256: String,
    /// The instrument.
    pub instrument: Instrument,
    /// The data.
    pub raw_data: RawData,
    /// What the model left.
    pub residuals: Residuals,
    /// Where it holds.
    pub validity: Validity,
    /// The parameters.
    #[serde(rename = "parameter")]
    pub parameters: Vec<Parameter>,
    /// The uncertainty budget.
    #[serde(rename = "budget", default, skip_serializing_if = "Vec::is_empty")]
    pub budget: Vec<BudgetLine>,
}

/// The circumstances of a calibration: what only its operator knows.
#[derive(Clone, Debug, PartialEq)]
pub struct Occasion {
    /// When, in seconds since 1970 (UTC).
    pub unix_s: i64,
    /// By whom.
    pub operator: String,
    /// On what.
    pub instrument: Instrument,
    /// From which data.
    pub raw_data: RawData,
    /// For how many days it shall hold.
    pub valid_days: f64,
}

/// What a calibration found, in the terms that every certificate shares.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationResult {
    /// What was calibrated.
    pub kind: CertificateKind,
    /// The model in words and symbols.
    pub model: String,
    /// Choices that its use depends on.
    pub settings: BTreeMap<String, String>,
    /// Findings.
    pub remarks: Vec<String>,
    /// Parameters with their intervals.
    pub parameters: Vec<Parameter>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// What the model left.
    pub residuals: Residuals,
    /// Temperature range in degrees Celsius.
    pub temperature_c: Option<[f64; 2]>,
    /// Range of each quantity.
    pub range: BTreeMap<String, [f64; 2]>,
    /// The uncertainty budget.
    pub budget: Vec<BudgetLine>,
}

impl CalibrationResult {
    /// The sealed certificate of this outcome.
    pub fn certify(self, occasion: &Occasion) -> Certificate {
        Certificate {
            schema: SCHEMA.into(),
            kind: self.kind,
            date: date::format(occasion.unix_s),
            operator: occasion.operator.clone(),
            model: self.model,
            settings: self.settings,
            remarks: self.remarks,
            covariance: rows(&self.covariance),
            content_sha256: String::new(),
            instrument: occasion.instrument.clone(),
            raw_data: occasion.raw_data.clone(),
            residuals: self.residuals,
            validity: Validity {
                from: date::format(occasion.unix_s),
                until: date::format(occasion.unix_s + (occasion.valid_days * 86_400.0) as i64),
                temperature_c: self.temperature_c,
                range: self.range,
            },
            parameters: self.parameters,
            budget: self.budget,
        }
        .seal()
    }
}

/// Why a file is no certificate.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum ReadError {
    /// Not TOML, or not of this shape; the message has the place.
    #[error("not a certificate: {0}")]
    Syntax(String),
    /// Another version of the schema.
    #[error("schema `{found}` is not known here (this version reads `{SCHEMA}`)")]
    Schema { found: String },
}

impl Certificate {
    /// Reads the text of a certificate file. Nothing is verified yet but its shape.
    ///
    /// # Errors
    /// Not TOML, unknown or missing fields, another schema.
    pub fn from_toml(text: &str) -> Result<Self, ReadError> {
        let certificate: Certificate = toml::from_str(text).map_err(|e| ReadError::Syntax(e.to_string()))?;
        if certificate.schema != SCHEMA {
            return Err(ReadError::Schema { found: certificate.schema });
        }
        Ok(certificate)
    }

    /// The text of the certificate file, with its content hash.
    pub fn to_toml(&self) -> String {
        self.clone().seal().canonical()
    }

    /// Writes the hash of the content into the certificate.
    pub fn seal(mut self) -> Self {
        self.content_sha256 = self.content_hash();
        self
    }

    /// SHA-256 over the canonical text of everything but the hash. Comments and layout do not count.
    pub fn content_hash(&self) -> String {
        let mut open = self.clone();
        open.content_sha256.clear();
        sha256_hex(open.canonical().as_bytes())
    }

    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// How much warmer than the reference temperature it is, in K; zero where either is unknown.
    pub fn kelvin(&self, temperature_c: Option<f64>) -> f64 {
        let reference: Option<f64> =
            self.settings.get("reference_temperature_c").and_then(|t| t.parse().ok());
        temperature_c.zip(reference).map_or(0.0, |(t, reference)| t - reference)
    }

    /// Covariance of the parameters, in their order.
    pub fn covariance_matrix(&self) -> DMatrix<f64> {
        let n = self.parameters.len();
        DMatrix::from_fn(n, n, |i, j| {
            self.covariance.get(i).and_then(|row| row.get(j)).copied().unwrap_or(f64::NAN)
        })
    }

    fn canonical(&self) -> String {
        // The types hold nothing that TOML cannot express, so this cannot fail on a certificate.
        toml::to_string(self).unwrap_or_else(|e| format!("unserialisable: {e}"))
    }
}

/// What a calibration found of one parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Name of the parameter.
    pub name: String,
    /// Unit of the value.
    pub unit: String,
    /// Value and standard uncertainty.
    pub estimate: [f64; 2],
    /// Degrees of freedom of the uncertainty.
    pub degrees_of_freedom: f64,
}

impl Finding {
    /// A finding.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, estimate: [f64; 2], dof: f64) -> Self {
        Finding { name: name.into(), unit: unit.into(), estimate, degrees_of_freedom: dof }
    }

    /// Covariance of findings that were determined apart, but for these blocks, each from its first finding on.
    pub fn covariance(findings: &[Finding], blocks: &[(usize, DMatrix<f64>)]) -> DMatrix<f64> {
        let variances = findings.iter().map(|f| f.estimate[1].powi(2));
        let mut whole = DMatrix::from_diagonal(&DVector::from_iterator(findings.len(), variances));
        for (at, block) in blocks {
            whole.view_mut((*at, *at), block.shape()).copy_from(block);
        }
        whole
    }
}

/// Parameters with their 95 % intervals; their uncertainties are those of the covariance.
pub fn parameters(findings: &[Finding], covariance: &DMatrix<f64>) -> Vec<Parameter> {
    let one = |(i, f): (usize, &Finding)| {
        let (value, u) = (f.estimate[0], covariance[(i, i)].max(0.0).sqrt());
        let half = u * crate::uncertainty::student::coverage_factor(0.95, f.degrees_of_freedom);
        Parameter {
            name: f.name.clone(),
            value,
            unit: f.unit.clone(),
            standard_uncertainty: u,
            degrees_of_freedom: f.degrees_of_freedom,
            ci95: [value - half, value + half],
        }
    };
    findings.iter().enumerate().map(one).collect()
}

/// A matrix as the rows that a certificate holds.
pub fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// SHA-256 in hexadecimal of all that a reader gives, which is never held as a whole.
///
/// # Errors
/// Those of the reader.
pub fn sha256_of(mut from: impl std::io::Read) -> std::io::Result<String> {
    let (mut hash, mut part) = (Sha256::new(), vec![0; 1 << 16]);
    loop {
        match from.read(&mut part)? {
            0 => return Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()),
            n => hash.update(&part[..n]),
        }
    }
}

/// SHA-256 in hexadecimal.
pub fn sha256_hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
