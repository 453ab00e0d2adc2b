//! The gate between a certificate file and its use.

use super::{Certificate, CertificateKind, Parameter, date};
use nalgebra::DMatrix;

/// Parameters that are above zero by nature: data whose interval reaches zero do not determine them.
const ABOVE_ZERO: &str = "gain resonance_hz quality_factor step.natural_frequency step.bandwidth step.damping_ratio \
                          mount.resonance mount.damping_ratio creep.time_constant \
                          lateral.noise_sd normal.noise_sd orientation.weight";

/// Where, when and on what a certificate is to be used.
#[derive(Clone, Debug, PartialEq)]
pub struct Circumstances<'a> {
    /// What the user needs calibrated.
    pub kind: CertificateKind,
    /// Serial number of the instrument at hand.
    pub serial: &'a str,
    /// Now, in seconds since 1970 (UTC).
    pub now_unix_s: i64,
    /// Temperature at hand in degrees Celsius, where it is measured.
    pub temperature_c: Option<f64>,
}

/// A certificate that may be used here and now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verified<'a>(&'a Certificate);

impl<'a> Verified<'a> {
    /// The content.
    pub fn certificate(&self) -> &'a Certificate {
        self.0
    }
}

/// Why a certificate may not be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum Refusal {
    /// The content is not what was written.
    #[error(
        "the certificate was changed after it was written (its content hashes to {found}, it says \
         {stated}): calibrate again, or restore the file"
    )]
    Tampered { stated: String, found: String },
    /// It is about another instrument.
    #[error("the certificate is for serial {found}, the instrument at hand is {expected}")]
    Foreign { expected: String, found: String },
    /// It is about another quantity.
    #[error("this is a {found} certificate; a {expected} certificate is needed")]
    Kind { expected: CertificateKind, found: CertificateKind },
    /// Its time is over.
    #[error("the certificate ran out at {until} ({days:.1} days ago): calibrate again")]
    Stale { until: String, days: f64 },
    /// Its time has not begun: a clock is wrong here or there.
    #[error("the certificate begins at {from}, which is still to come: check the clocks")]
    NotYetValid { from: String },
    /// It is too cold or too warm for it.
    #[error("the certificate holds from {} to {} degC; it is {found} degC", range[0], range[1])]
    Temperature { found: f64, range: [f64; 2] },
    /// Numbers or dates that cannot be.
    #[error("the certificate cannot be right: {reason}")]
    Malformed { reason: String },
}

impl Certificate {
    /// Every check of a certificate that needs no knowledge of where it will be used:
    /// untouched, with dates, parameters and a covariance that can be.
    ///
    /// # Errors
    /// [`Refusal::Tampered`] or [`Refusal::Malformed`].
    pub fn verify_content(&self) -> Result<(), Refusal> {
        let found = self.content_hash();
        if found != self.content_sha256 {
            let short = |hash: &str| {
                if hash.is_empty() { "nothing".into() } else { hash.chars().take(12).collect::<String>() }
            };
            return Err(Refusal::Tampered { stated: short(&self.content_sha256), found: short(&found) });
        }
        let malformed = |reason: String| Err(Refusal::Malformed { reason });
        for (name, text) in [
            ("date", &self.date),
            ("validity.from", &self.validity.from),
            ("validity.until", &self.validity.until),
        ] {
            if date::parse(text).is_none() {
                return malformed(format!("`{name} = {text}` is not a date like 2026-03-01T12:00:00Z"));
            }
        }
        let n = self.parameters.len();
        if n == 0 {
            return malformed("it has no parameter".into());
        }
        if self.covariance.len() != n || self.covariance.iter().any(|row| row.len() != n) {
            return malformed(format!("its covariance is not {n} x {n}"));
        }
        let covariance = self.covariance_matrix();
        let sd = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        for (i, p) in self.parameters.iter().enumerate() {
            if !p.value.is_finite() || !p.standard_uncertainty.is_finite() || p.standard_uncertainty < 0.0 {
                return malformed(format!("parameter `{}` has no finite value and uncertainty", p.name));
            }
            let [low, high] = p.ci95;
            if !(low <= p.value && p.value <= high) {
                return malformed(format!(
                    "the interval of `{}` ({low:e} to {high:e}) does not hold its value {:e}",
                    p.name, p.value
                ));
            }
            if low <= 0.0 && ABOVE_ZERO.split(' ').any(|name| name == p.name) {
                return malformed(format!(
                    "`{}` is above zero, and its interval ({low:.3e} to {high:.3e}) is not: the data do not determine it",
                    p.name
                ));
            }
            let possible = match p.name.as_str() {
                "step.delay" => p.value.abs() <= 1.0,
                "step.natural_frequency" | "mount.resonance" => p.value >= 1.0,
                _ => true,
            };
            if !possible {
                let Parameter { name, value, unit, .. } = p;
                return malformed(format!(
                    "`{name}` of {value:.3} {unit} cannot be: is time_s in milliseconds? It is read in seconds"
                ));
            }
            if (sd(i) - p.standard_uncertainty).abs() > 1e-6 * p.standard_uncertainty {
                return malformed(format!("the covariance disagrees with the uncertainty of `{}`", p.name));
            }
        }
        // Eigenvalues of the correlation matrix: the covariance mixes units of any size.
        let correlation = DMatrix::from_fn(n, n, |i, j| {
            let scale = sd(i) * sd(j);
            if scale > 0.0 { covariance[(i, j)] / scale } else { f64::from(u8::from(i == j)) }
        });
        let symmetric = (&correlation - correlation.transpose()).abs().max() < 1e-9;
        if !symmetric || correlation.symmetric_eigenvalues().min() < -1e-9 {
            return malformed(
                "its covariance is not a covariance (not symmetric, or a negative variance)".into(),
            );
        }
        Ok(())
    }

    /// May it be used here and now?
    ///
    /// # Errors
    /// The reason why not; the first of: changed, other kind, other serial, dates, temperature.
    pub fn verify(&self, at: &Circumstances) -> Result<Verified<'_>, Refusal> {
        self.verify_content()?;
        if self.kind != at.kind {
            return Err(Refusal::Kind { expected: at.kind, found: self.kind });
        }
        if self.instrument.serial != at.serial {
            return Err(Refusal::Foreign {
                expected: at.serial.into(),
                found: self.instrument.serial.clone(),
            });
        }
        let time = |text: &str| date::parse(text).unwrap_or(i64::MIN);
        if at.now_unix_s < time(&self.validity.from) {
            return Err(Refusal::NotYetValid { from: self.validity.from.clone() });
        }
        let over = at.now_unix_s - time(&self.validity.until);
        if over > 0 {
            return Err(Refusal::Stale { until: self.validity.until.clone(), days: over as f64 / 86_400.0 });
        }
        if let (Some(found), Some(range)) = (at.temperature_c, self.validity.temperature_c)
            && !(range[0]..=range[1]).contains(&found)
        {
            return Err(Refusal::Temperature { found, range });
        }
        Ok(Verified(self))
    }
}
