//! `muprime calibrate force|amplitude|latency|phase|finger|creep|gravity|noise|step|tap ...`: data in, a certificate out.

mod amplitude;
mod creep;
mod dynamics;
mod finger;
mod force;
mod gravity;
mod guided;
pub mod inverse;
mod latency;
mod live;
mod noise;
mod phase;
mod tables;

use crate::out;
use calibration::certificate::{Certificate, Instrument, Kind, Occasion, Outcome, RawData, date};
use miette::IntoDiagnostic;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{SystemTime, UNIX_EPOCH};

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Dead weights to the force sensor's matrix; without a series, guided at the terminal
    Force(force::Args),
    /// A vibrometer's tables to the plate's amplitude
    Amplitude(amplitude::Args),
    /// Edges and time stamps to delays, jitter and clock drift
    Latency(latency::Args),
    /// Vibrometer waveforms of plate and skin to the contact phase shift (Eq. 1)
    Phase(phase::Args),
    /// Stiffness, friction and (from a phase table) modulus, penalty and retardation time of a fingertip
    Finger(finger::Args),
    /// Creep of a force channel under a standing load
    Creep(creep::Args),
    /// Direction of the force sensor's axes, by gravity at known tilts
    Gravity(gravity::Args),
    /// Spectrum, quantisation and frozen-value rule of the force sensor at rest
    Noise(noise::Args),
    /// Bandwidth and dead time of a channel from steps of force
    Step(dynamics::Args),
    /// Resonance of the sensor's mount from taps
    Tap(dynamics::Args),
    /// Print what verified certificates leave open, as the [calibration] section of rig.toml
    Priors(PriorsArgs),
}

/// What every calibration asks of its operator.
#[derive(Debug, clap::Args)]
struct Common {
    /// Who calibrates
    #[arg(long)]
    operator: String,
    /// Serial number of the instrument (or name of the fingertip): the certificate holds for it alone
    #[arg(long)]
    serial: String,
    /// What the instrument is, for people
    #[arg(long, default_value = "")]
    instrument: String,
    /// When, as 2026-03-01T12:00:00Z [default: now]
    #[arg(long)]
    date: Option<String>,
    /// For how many days the certificate holds
    #[arg(long, default_value_t = 180.0)]
    valid_days: f64,
    /// The certificate's file [default: <kind>-<serial>.toml]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Write over an existing certificate
    #[arg(long)]
    overwrite: bool,
}

/// Arguments of `priors`.
#[derive(Debug, clap::Args)]
struct PriorsArgs {
    /// Certificates
    #[arg(required = true)]
    certificates: Vec<PathBuf>,
}

/// Calibrates.
///
/// # Errors
/// Data that is unfit for a certificate, with the reason; files that cannot be read or written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    match args.what {
        What::Force(args) => force::run(args, json),
        What::Amplitude(args) => amplitude::run(&args, json),
        What::Latency(args) => latency::run(&args, json),
        What::Phase(args) => phase::run(&args, json),
        What::Finger(args) => finger::run(&args, json),
        What::Creep(args) => creep::run(&args, json),
        What::Gravity(args) => gravity::run(&args, json),
        What::Noise(args) => noise::run(&args, json),
        What::Step(args) => dynamics::step(&args, json),
        What::Tap(args) => dynamics::tap(&args, json),
        What::Priors(args) => priors(&args, json),
    }
}

/// Checks a certificate's text: its shape, its hash, what its numbers can be, and whether its time is over.
///
/// # Errors
/// What is wrong with it.
pub fn check(name: &str, text: &str) -> miette::Result<Kind> {
    let certificate = Certificate::from_toml(text).map_err(|e| miette::miette!("{name}: {e}"))?;
    let own_serial = certificate.instrument.serial.clone();
    verify(name, &certificate, certificate.kind, &own_serial)?;
    Ok(certificate.kind)
}

/// Verifies a certificate for an instrument, now.
fn verify<'a>(
    name: &str,
    certificate: &'a Certificate,
    kind: Kind,
    serial: &str,
) -> miette::Result<calibration::certificate::Verified<'a>> {
    let at = calibration::certificate::Circumstances {
        kind,
        serial,
        now_unix_s: now_unix_s()?,
        temperature_c: None,
    };
    certificate.verify(&at).map_err(|refusal| miette::miette!("{name}: {refusal}"))
}

fn now_unix_s() -> miette::Result<i64> {
    Ok(SystemTime::now().duration_since(UNIX_EPOCH).into_diagnostic()?.as_secs() as i64)
}

fn priors(args: &PriorsArgs, json: bool) -> miette::Result<ExitCode> {
    let mut priors = models::rig_file::Calibration::default();
    for path in &args.certificates {
        let name = path.display().to_string();
        let certificate = Certificate::from_toml(&crate::input::text_of(path)?)
            .map_err(|e| miette::miette!("{name}: {e}"))?;
        let verified = verify(&name, &certificate, certificate.kind, &certificate.instrument.serial)?;
        calibration::prior::take(&mut priors, verified)
            .map_err(|refusal| miette::miette!("{name}: {refusal}"))?;
    }
    if json {
        out!("{}", serde_json::json!({ "calibration": priors }));
    } else {
        out!("[calibration]\n{}", toml::to_string(&priors).into_diagnostic()?.trim_end());
    }
    super::exit(super::DONE)
}

impl Common {
    fn occasion(&self, raw_data: RawData) -> miette::Result<Occasion> {
        let unix_s = match &self.date {
            None => now_unix_s()?,
            Some(text) => date::parse(text).ok_or_else(|| {
                miette::miette!("--date {text}: a date like 2026-03-01T12:00:00Z is needed")
            })?,
        };
        if self.serial.trim().is_empty() || self.operator.trim().is_empty() {
            miette::bail!(
                "--serial and --operator must not be empty: a certificate is for one instrument, by one person"
            );
        }
        if !(self.valid_days > 0.0 && self.valid_days <= 3_660.0) {
            miette::bail!("--valid-days {}: more than 0 and at most 3660", self.valid_days);
        }
        Ok(Occasion {
            unix_s,
            operator: self.operator.clone(),
            instrument: Instrument { name: self.instrument.clone(), serial: self.serial.clone() },
            raw_data,
            valid_days: self.valid_days,
        })
    }

    /// Writes the certificate and says what it says.
    fn issue(&self, outcome: Outcome, raw: RawData, json: bool) -> miette::Result<ExitCode> {
        self.issue_with(outcome, raw, json, [])
    }

    /// The same with more to say in JSON.
    fn issue_with<const N: usize>(
        &self,
        outcome: Outcome,
        raw: RawData,
        json: bool,
        more: [(&str, serde_json::Value); N],
    ) -> miette::Result<ExitCode> {
        let certificate = outcome.certify(&self.occasion(raw)?);
        let safe: String =
            self.serial.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let out =
            self.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}-{safe}.toml", certificate.kind)));
        if out.exists() && !self.overwrite {
            miette::bail!("{} exists: give another --out, or --overwrite", out.display());
        }
        crate::files::write_whole(&out, certificate.to_toml())?;
        if json {
            let parameters: Vec<serde_json::Value> = certificate
                .parameters
                .iter()
                .map(|p| {
                    serde_json::json!({
                        "name": p.name, "value": p.value, "unit": p.unit,
                        "standard_uncertainty": p.standard_uncertainty, "ci95": p.ci95,
                    })
                })
                .collect();
            let mut document = serde_json::json!({
                    "certificate": out, "kind": certificate.kind, "serial": self.serial,
                    "content_sha256": certificate.content_sha256, "valid_until": certificate.validity.until,
                    "parameters": parameters, "remarks": certificate.remarks,
            });
            more.into_iter().for_each(|(key, value)| document[key] = value);
            out!("{document}");
        } else {
            show(&certificate, &out);
        }
        super::exit(super::DONE)
    }
}

fn show(certificate: &Certificate, out: &Path) {
    out!("{} certificate for {}: {}", certificate.kind, certificate.instrument.serial, out.display());
    for p in &certificate.parameters {
        out!(
            "  {:<34} {:>14.6e} +- {:.1e} {}  95 %: {:.6e} to {:.6e}",
            p.name,
            p.value,
            p.standard_uncertainty,
            p.unit,
            p.ci95[0],
            p.ci95[1]
        );
    }
    let r = &certificate.residuals;
    out!("  residuals: {} of sd {:.3e}, largest {:.3e} {}", r.count, r.sd, r.largest, r.unit);
    for remark in &certificate.remarks {
        out!("  note: {remark}");
    }
    out!("  valid until {}", certificate.validity.until);
}
