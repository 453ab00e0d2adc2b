//! `muprime calibrate force|amplitude|latency|phase|finger|creep|gravity|noise|step|tap ...`: data in, a certificate out.

use super::prelude::*;
use calibration::certificate::{Certificate, ReadError};
use rig::live_calibration::AtTheBench;
use runs::format::{number, with_uncertainty};
use tables::calibrate::{Issued, What, certified, verify};

#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, clap::Subcommand)]
enum Verb {
    #[command(flatten)]
    Certify(Box<What>),
    /// Print what verified certificates leave open, as the [calibration] section of rig.toml
    Priors(PriorsArgs),
}

/// Arguments of `priors`.
#[derive(Debug, clap::Args)]
struct PriorsArgs {
    /// Certificates
    #[arg(required = true)]
    certificates: Vec<PathBuf>,
}

/// Calibrates; refused: data that is unfit for a certificate, with the reason; files that cannot be read or
/// written.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    match &args.verb {
        Verb::Priors(args) => priors(args, json),
        Verb::Certify(what) => write(&certified(what, &AtTheBench)?, json),
    }
}

/// Writes the certificate and says what it says.
fn write(issued: &Issued, json: bool) -> miette::Result<ExitCode> {
    let out = &issued.out;
    if out.exists() && !issued.overwrite {
        miette::bail!("{} exists: give another --out, or --overwrite", out.display());
    }
    runs::files::write_whole(out, issued.certificate.to_toml())?;
    if json {
        let mut document = issued.document();
        document["certificate"] = json!(out);
        out!("{document}");
    } else {
        show(&issued.certificate, out);
    }
    exit(DONE)
}

fn priors(args: &PriorsArgs, json: bool) -> miette::Result<ExitCode> {
    let mut priors = models::rig_file::Calibration::default();
    for path in &args.certificates {
        let name = path.display().to_string();
        let text = runs::input::text_of(path)?;
        // Of a file of another kind the place where TOML's reader stopped says nothing.
        let other = |e: &ReadError| matches!(e, ReadError::Syntax(_)) && !text.contains("content_sha256");
        let certificate = Certificate::from_toml(&text).map_err(|e| match other(&e) {
            true => miette::miette!(
                help = "give certificates: 'muprime calibrate noise', 'muprime calibrate force' and the others make them of data",
                "{name} is no certificate, and the priors are those of certificates"
            ),
            false => miette::miette!("{name}: {e}"),
        })?;
        let verified = verify(&name, &certificate, certificate.kind, &certificate.instrument.serial)?;
        calibration::prior::take(&mut priors, verified, None)
            .map_err(|refusal| miette::miette!("{name}: {refusal}"))?;
    }
    if priors == Default::default() {
        say!("none of these certificates bounds an error of the rig: [calibration] stays empty");
    }
    let text = toml::to_string(&priors).into_diagnostic()?;
    answered(json, &json!({ "calibration": priors }), format!("[calibration]\n{}", text.trim_end()))
}

fn show(certificate: &Certificate, out: &Path) {
    out!("{} certificate for {}: {}", certificate.kind, certificate.instrument.serial, out.display());
    for p in &certificate.parameters {
        let value = with_uncertainty(p.value, p.standard_uncertainty, p.ci95, &p.unit);
        out!("  {:<34} {value}", p.name.replace('_', " "));
    }
    let r = &certificate.residuals;
    let [sd, largest] = [r.sd, r.largest].map(number);
    out!("  residuals: {} with sd {sd}, largest {largest} {}", r.count, r.unit);
    certificate.remarks.iter().for_each(|remark| out!("  note: {remark}"));
    out!("  valid until {}", certificate.validity.until);
}
