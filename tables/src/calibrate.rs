//! Certificates from data: force, amplitude, latency, phase, finger, creep, gravity, noise, step, tap.
//!
//! The options of `muprime calibrate` are the types here; what only instruments can give comes through a [`Bench`].
#![allow(clippy::disallowed_methods, reason = "a certificate is dated, and is valid for a time")]

mod amplitude;
mod creep;
mod dynamics;
mod finger;
mod force;
mod gravity;
pub mod inverse;
mod latency;
mod noise;
mod phase;
mod tables;
#[cfg(test)]
mod tests;

use calibration::certificate::{
    CalibrationResult, Certificate, CertificateKind, Circumstances, Instrument, Occasion, Parameter, RawData,
    Verified, date,
};
use drivers::vibrometer::VibrometerSettings;
use miette::IntoDiagnostic;
use models::PeakToPeak;
use runs::Setup;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};
use tables::{Sources, columns, with_columns};

/// What only instruments at a bench can give; without a bench whatever would open one is refused.
///
/// # Errors
/// No instruments here, or what went wrong with them.
pub trait Bench {
    /// A dead-weight series, taken with an operator; as CSV.
    fn series(&self, _: &SeriesOptions<'_>) -> miette::Result<String> {
        Err(refused())
    }

    /// A table of set-points and amplitudes, driven and read; as CSV.
    fn amplitudes(&self, _setup: &Setup, _: &LiveTable<'_>) -> miette::Result<String> {
        Err(refused())
    }

    /// The settings of the vibrometer's controller, read back now; they cover the drive's frequency.
    fn vibrometer(&self, _setup: &Setup, _frequency_hz: f64) -> miette::Result<VibrometerSettings> {
        Err(refused())
    }
}

fn refused() -> miette::Report {
    miette::miette!(
        help = "`muprime calibrate` does that, with the operator at the bench",
        "from files alone: a series, a table or waveforms are needed, and no setup whose instruments would be opened"
    )
}

/// No bench.
struct FilesAlone;

impl Bench for FilesAlone {}

/// How a dead-weight series is taken and where it is stored.
pub struct SeriesOptions<'a> {
    /// Setup whose force instruments are read; without one the operator types the counts.
    pub setup: Option<&'a str>,
    /// Averaging time of a reading in s.
    pub average_s: f64,
    /// How long a link that went down is waited for, in s.
    pub reconnect_s: f64,
    /// Where the series will be stored; until it is whole, each reading is in the `.part` file beside.
    pub keep: &'a Path,
}

/// Set-points that are driven for a table of amplitudes.
pub struct LiveTable<'a> {
    /// Set-points, peak-to-peak, in m.
    pub set_points_pp_m: &'a [f64],
    /// Frequency in Hz.
    pub frequency_hz: f64,
    /// Passes through the set-points, up and down by turns.
    pub passes: u32,
    /// Wait at a set-point before the reading, in s.
    pub settle_s: f64,
}

/// Largest amplitude of a decoder's output in V: full scale is taken as 20 V peak-to-peak.
const FULL_SCALE_V: f64 = 10.0;

/// Which calibration, with its options.
#[derive(Debug, clap::Subcommand)]
pub enum What {
    /// Dead weights to the force sensor's matrix; without a series, guided at the terminal
    Force(force::Args),
    /// A vibrometer's tables to the plate's amplitude
    Amplitude(Of<amplitude::Args>),
    /// Edges and time stamps to delays, jitter and clock drift
    Latency(Of<latency::Args>),
    /// Vibrometer waveforms of plate and skin to the contact phase shift (Eq. 1)
    Phase(Of<phase::Args>),
    /// Stiffness, friction and (from a phase table) modulus, penalty and retardation time of a fingertip
    Finger(Of<finger::Args>),
    /// Creep of a force channel under a standing load
    Creep(Of<creep::Args>),
    /// Direction of the force sensor's axes, by gravity at known tilts
    Gravity(Of<gravity::Args>),
    /// Spectrum, quantisation and frozen-value rule of the force sensor at rest
    Noise(Of<noise::Args>),
    /// Bandwidth and dead time of a channel from steps of force
    Step(Of<dynamics::Args>),
    /// Resonance of the sensor's mount from taps
    Tap(Of<dynamics::Args>),
}

/// The options of one calibration, then those of all.
#[derive(Debug, clap::Args)]
pub struct Of<T: clap::Args> {
    #[command(flatten)]
    args: T,
    #[command(flatten)]
    common: Common,
}

/// What every calibration asks of its operator.
#[derive(Debug, clap::Args)]
pub struct Common {
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
    /// The certificate's file [default: KIND-SERIAL.toml]
    #[arg(long)]
    out: Option<PathBuf>,
    /// Write over an existing certificate
    #[arg(long)]
    overwrite: bool,
}

/// The certificate that a calibration comes to; `bench` gives what only instruments can. Nothing is written
/// but what the options name (a series that was taken, a phase table, a spectrum).
///
/// # Errors
/// Data that is unfit for a certificate, with the reason; files that cannot be read or written.
pub fn certified(what: &What, bench: &dyn Bench) -> miette::Result<Issued> {
    let (sources, mut more) = (&mut Sources::default(), More::new());
    let (common, outcome) = match what {
        What::Force(args) => (&args.common, force::calibrate(args, bench, sources)?),
        What::Amplitude(of) => (&of.common, amplitude::calibrate(of, bench, sources)?),
        What::Latency(of) => (&of.common, latency::calibrate(&of.args, sources)?),
        What::Phase(of) => (&of.common, phase::calibrate(&of.args, bench, sources)?),
        What::Finger(of) => (&of.common, finger::calibrate(&of.args, sources, &mut more)?),
        What::Creep(of) => (&of.common, creep::calibrate(&of.args, sources)?),
        What::Gravity(of) => (&of.common, gravity::calibrate(&of.args, sources)?),
        What::Noise(of) => (&of.common, noise::calibrate(&of.args, sources)?),
        What::Step(of) => (&of.common, dynamics::step(&of.args, sources)?),
        What::Tap(of) => (&of.common, dynamics::tap(&of.args, sources)?),
    };
    Ok(Issued { more, ..common.certify(outcome, sources.raw_data())? })
}

/// The certificate that a command line of `muprime calibrate` comes to (`words` begin after `calibrate`), from files alone: what would
/// open instruments is refused. Nothing is written but what the words name (phase table, spectrum). `--out` is not looked at.
///
/// # Errors
/// As [`certified`]; words that the command does not take, in its own words.
pub fn from_files(words: &[String]) -> miette::Result<Issued> {
    #[derive(clap::Parser)]
    #[command(name = "calibrate", no_binary_name = true, disable_help_flag = true)]
    struct Line {
        #[command(subcommand)]
        what: What,
    }
    let line = <Line as clap::Parser>::try_parse_from(words).map_err(|e| {
        let text = e.to_string();
        let first = text.lines().take_while(|l| !l.is_empty() && !l.starts_with("Usage")).collect::<Vec<_>>();
        miette::miette!("{}", first.join(" ").trim_start_matches("error: "))
    })?;
    certified(&line.what, &FilesAlone)
}

/// Peak-to-peak displacement of a sine whose velocity shows as so many volts, zero to peak.
///
/// # Errors
/// No amplitude, or one at the rail of the decoder's output.
pub fn displacement(volts: f64, range_m_s_per_v: f64, frequency_hz: f64) -> Result<PeakToPeak, String> {
    if !(volts.is_finite() && volts > 0.0) {
        return Err(format!("{volts} V is not an amplitude: a number above zero is needed, zero to peak"));
    }
    if volts >= FULL_SCALE_V {
        return Err(format!(
            "{volts} V is at the rail of the decoder's output ({FULL_SCALE_V} V): choose a larger range and start over"
        ));
    }
    // v = 2 pi f (w/2), so w = v / (pi f).
    Ok(PeakToPeak::from_metres(volts * range_m_s_per_v / (std::f64::consts::PI * frequency_hz)))
}

/// What `--json` says of a certificate.
pub fn document(certificate: &Certificate) -> serde_json::Value {
    let parameter = |p: &Parameter| {
        json!({
            "name": p.name, "value": p.value, "unit": p.unit,
            "standard_uncertainty": p.standard_uncertainty, "ci95": p.ci95,
        })
    };
    let parameters: Vec<serde_json::Value> = certificate.parameters.iter().map(parameter).collect();
    json!({
        "kind": certificate.kind, "serial": certificate.instrument.serial,
        "content_sha256": certificate.content_sha256, "valid_until": certificate.validity.until,
        "parameters": parameters, "remarks": certificate.remarks,
    })
}

/// What a fit says beyond its certificate: keys of the JSON document, and their values.
type More = Vec<(&'static str, serde_json::Value)>;

/// A certificate that was made and not yet written.
#[derive(Debug)]
pub struct Issued {
    /// The certificate.
    pub certificate: Certificate,
    /// What the fit says beyond it: keys of the JSON document, and their values.
    pub more: More,
    /// Where it goes.
    pub out: PathBuf,
    /// Whether a certificate that is there may be written over.
    pub overwrite: bool,
}

impl Issued {
    /// The document of `--json` without its key `certificate` (the file).
    pub fn document(&self) -> serde_json::Value {
        let mut document = document(&self.certificate);
        self.more.iter().for_each(|(key, value)| document[*key] = value.clone());
        document
    }
}

/// Checks a certificate's text: its shape, its hash, what its numbers can be, and whether its time is over;
/// an error says what is wrong.
pub fn check(name: &str, text: &str) -> miette::Result<CertificateKind> {
    let certificate = Certificate::from_toml(text).map_err(|e| miette::miette!("{name}: {e}"))?;
    verify(name, &certificate, certificate.kind, &certificate.instrument.serial)?;
    Ok(certificate.kind)
}

/// Verifies a certificate for an instrument, now; an error says why it does not hold.
pub fn verify<'a>(
    name: &str,
    certificate: &'a Certificate,
    kind: CertificateKind,
    serial: &str,
) -> miette::Result<Verified<'a>> {
    let at = Circumstances { kind, serial, now_unix_s: now_unix_s()?, temperature_c: None };
    certificate.verify(&at).map_err(|refusal| miette::miette!("{name}: {refusal}"))
}

fn now_unix_s() -> miette::Result<i64> {
    Ok(SystemTime::now().duration_since(UNIX_EPOCH).into_diagnostic()?.as_secs() as i64)
}

impl Common {
    /// Where the table goes that is taken live for a certificate of a kind: beside it.
    fn beside(&self, kind: &str) -> PathBuf {
        self.out.clone().unwrap_or_else(|| format!("{kind}.toml").into()).with_extension("csv")
    }

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

    fn certify(&self, outcome: CalibrationResult, raw: RawData) -> miette::Result<Issued> {
        let origin = raw.origin.clone();
        let certificate = outcome.certify(&self.occasion(raw)?);
        // What `check` would refuse is not issued.
        certificate.verify_content().map_err(|e| miette::miette!("{origin}: no certificate: {e}"))?;
        let safe: String =
            self.serial.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let out =
            self.out.clone().unwrap_or_else(|| PathBuf::from(format!("{}-{safe}.toml", certificate.kind)));
        Ok(Issued { certificate, more: Vec::new(), out, overwrite: self.overwrite })
    }
}
