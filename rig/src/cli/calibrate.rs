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
    if let What::Priors(args) = &args.what {
        return priors(args, json);
    }
    certified(&args.what)?.write(json)
}

fn certified(what: &What) -> miette::Result<Issued> {
    match what {
        What::Force(args) => force::certified(args),
        What::Amplitude(args) => amplitude::certified(args),
        What::Latency(args) => latency::certified(args),
        What::Phase(args) => phase::certified(args),
        What::Finger(args) => finger::certified(args),
        What::Creep(args) => creep::certified(args),
        What::Gravity(args) => gravity::certified(args),
        What::Noise(args) => noise::certified(args),
        What::Step(args) => dynamics::step(args),
        What::Tap(args) => dynamics::tap(args),
        What::Priors(_) => miette::bail!("priors are printed, they are no certificate"),
    }
}

/// The certificate that a command line of `muprime calibrate` comes to (`words` begin after `calibrate`), from files alone: what would
/// open instruments is refused. Nothing is written but what the words name (phase table, spectrum). `--out` is not looked at.
///
/// # Errors
/// As [`run`]; words that the command does not take, in its own words.
pub fn from_files(words: &[String]) -> miette::Result<Issued> {
    #[derive(clap::Parser)]
    #[command(name = "calibrate", no_binary_name = true, disable_help_flag = true)]
    struct Line {
        #[command(subcommand)]
        what: What,
    }
    let line = <Line as clap::Parser>::try_parse_from(words).map_err(|e| {
        let said = e.to_string();
        let first = said.lines().take_while(|l| !l.is_empty() && !l.starts_with("Usage")).collect::<Vec<_>>();
        miette::miette!("{}", first.join(" ").trim_start_matches("error: "))
    })?;
    let instruments = match &line.what {
        What::Force(args) => args.asks_instruments(),
        What::Amplitude(args) => args.asks_instruments(),
        What::Phase(args) => args.asks_instruments(),
        _ => false,
    };
    if instruments {
        miette::bail!(
            help = "`muprime calibrate` does that, with the operator at the bench",
            "from files alone: a series, a table or waveforms are needed, and no setup whose instruments would be opened"
        );
    }
    certified(&line.what)
}

/// What `--json` says of a certificate.
pub fn document(certificate: &Certificate) -> serde_json::Value {
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
    serde_json::json!({
        "kind": certificate.kind, "serial": certificate.instrument.serial,
        "content_sha256": certificate.content_sha256, "valid_until": certificate.validity.until,
        "parameters": parameters, "remarks": certificate.remarks,
    })
}

/// A certificate that was made and not yet written.
#[derive(Debug)]
pub struct Issued {
    /// The certificate.
    pub certificate: Certificate,
    /// What the fit says beyond it: keys of the JSON document, and their values.
    pub more: Vec<(&'static str, serde_json::Value)>,
    out: PathBuf,
    overwrite: bool,
}

impl Issued {
    /// The document of `--json` without its key `certificate` (the file).
    pub fn document(&self) -> serde_json::Value {
        let mut document = document(&self.certificate);
        for (key, value) in &self.more {
            document[*key] = value.clone();
        }
        document
    }

    /// Writes the certificate and says what it says.
    fn write(&self, json: bool) -> miette::Result<ExitCode> {
        let out = &self.out;
        if out.exists() && !self.overwrite {
            miette::bail!("{} exists: give another --out, or --overwrite", out.display());
        }
        crate::files::write_whole(out, self.certificate.to_toml())?;
        if json {
            let mut document = self.document();
            document["certificate"] = serde_json::json!(out);
            out!("{document}");
        } else {
            show(&self.certificate, out);
        }
        super::exit(super::DONE)
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

    /// Makes the certificate.
    fn certify(&self, outcome: Outcome, raw: RawData) -> miette::Result<Issued> {
        self.certify_with(outcome, raw, [])
    }

    /// The same with more to say in JSON.
    fn certify_with(
        &self,
        outcome: Outcome,
        raw: RawData,
        more: impl IntoIterator<Item = (&'static str, serde_json::Value)>,
    ) -> miette::Result<Issued> {
        let certificate = outcome.certify(&self.occasion(raw)?);
        let safe: String =
            self.serial.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let out =
            self.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}-{safe}.toml", certificate.kind)));
        Ok(Issued { certificate, more: more.into_iter().collect(), out, overwrite: self.overwrite })
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
