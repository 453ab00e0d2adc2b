//! `muprime model amplitude-for`: the amplitude for a wanted friction.

use super::conditions::ConditionArgs;
use super::refused;
use clap::Args;
use miette::IntoDiagnostic;
use models::inverse;
use models::quantity::PeakToPeak;
use models::surrogate::Surrogate;
use runs::{out, say};
use std::process::ExitCode;

/// Arguments of `muprime model amplitude-for`. The amplitude flag is the largest that may be used.
#[derive(Args)]
pub struct AmplitudeForArgs {
    /// Wanted relative friction, 0 to 1
    #[arg(long, conflicts_with = "lateral_force_n", required_unless_present = "lateral_force_n")]
    mu_relative: Option<f64>,
    /// Wanted mean lateral force in N
    #[arg(long)]
    lateral_force_n: Option<f64>,
    /// Largest amplitude that the plate can give, peak-to-peak, in m
    #[arg(long, default_value_t = 5e-6)]
    largest_amplitude_pp_m: f64,
    /// Young's modulus of the stratum corneum in Pa
    #[arg(long, default_value_t = 28.3e6)]
    young_modulus_pa: f64,
    #[command(flatten)]
    condition: ConditionArgs,
}

/// Answers; an amplitude out of reach is a failure (1), nonsense is refused (2).
pub fn run(args: &AmplitudeForArgs, json: bool) -> miette::Result<ExitCode> {
    if let Err(why) = args.condition.check() {
        return refused(why);
    }
    let condition = args.condition.condition();
    let coulomb = condition.mu0 * condition.normal_force_n;
    let Some(wanted) = args.mu_relative.or(args.lateral_force_n.map(|force| force / coulomb)) else {
        return refused("--mu-relative or --lateral-force-n is needed");
    };
    if !(args.largest_amplitude_pp_m > 0.0 && args.largest_amplitude_pp_m <= 50e-6) {
        return refused(format!(
            "--largest-amplitude-pp-m {}: above 0 and at most 50e-6",
            args.largest_amplitude_pp_m
        ));
    }
    let law = Surrogate::shipped().into_diagnostic()?.with_young_modulus_pa(args.young_modulus_pa);
    let largest = PeakToPeak::from_metres(args.largest_amplitude_pp_m);
    let answer = match inverse::amplitude_for(&law, &condition, wanted, largest) {
        Ok(answer) => answer,
        Err(why @ inverse::NoAmplitude::OutOfReach { .. }) => {
            say!("{why}");
            return Ok(ExitCode::from(1));
        }
        Err(why) => return refused(why),
    };
    if json {
        out!(
            "{}",
            serde_json::json!({
                "amplitude_pp_m": answer.amplitude.metres(),
                "amplitude_pp_sd_m": answer.amplitude_sd_m,
                "mu_relative": answer.prediction.mu_relative,
                "mu_relative_sd": answer.prediction.mu_relative_sd,
                "lateral_force_n": answer.prediction.lateral_force_n,
                "relative_drive_power": answer.relative_drive_power,
                "validity": answer.prediction.validity,
            })
        );
    } else {
        out!(
            "{} for mu' = {wanted:.4} (lateral force {:.5} N){}; drive power {:.2} times that of 1 um; {}",
            answer.amplitude,
            answer.prediction.lateral_force_n,
            answer.amplitude_sd_m.map_or(String::new(), |sd| format!(", +- {:.3} um by the law", sd * 1e6)),
            answer.relative_drive_power,
            if answer.is_valid() { "within the table" } else { "OUTSIDE the table: an extrapolation" }
        );
    }
    Ok(ExitCode::SUCCESS)
}
