//! `muprime model amplitude-for`: the amplitude for a wanted friction.

use super::conditions::{ConditionArgs, YOUNG_MODULUS_PA};
use super::refused;
use crate::verbs::prelude::*;
use clap::Args;
use models::prediction::Validity;
use models::{PeakToPeak, Surrogate, inverse};
use runs::format::{number, quantity, to_its_uncertainty};

/// Arguments of `muprime model amplitude-for`.
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

impl AmplitudeForArgs {
    /// The wanted mu'; the words of a refusal.
    fn wanted(&self) -> Result<f64, String> {
        self.condition.check(&[("young_modulus_pa", self.young_modulus_pa, YOUNG_MODULUS_PA)])?;
        let condition = self.condition.condition();
        let greatest = condition.mu0 * condition.normal_force_n;
        match self.lateral_force_n {
            _ if self.condition.amplitude_pp_m.is_some() => {
                Err("--amplitude-pp-m is the answer; --largest-amplitude-pp-m bounds it".into())
            }
            Some(force) if greatest > 0.0 && !(force > 0.0 && force <= greatest) => {
                let most = quantity(greatest, "N");
                Err(format!(
                    "--lateral-force-n {force}: give more than 0 and at most {most} (mu0 times normal force)"
                ))
            }
            force => Ok(force.map(|force| force / greatest).or(self.mu_relative).unwrap_or(f64::NAN)),
        }
    }
}

/// Answers; an amplitude out of reach is a failure (1), nonsense is refused (2).
pub fn run(args: &AmplitudeForArgs, json: bool) -> miette::Result<ExitCode> {
    let wanted = args.wanted().map_err(refused)?;
    let condition = args.condition.condition();
    if !(args.largest_amplitude_pp_m > 0.0 && args.largest_amplitude_pp_m <= 50e-6) {
        miette::bail!("--largest-amplitude-pp-m {}: above 0 and at most 50e-6", args.largest_amplitude_pp_m);
    }
    let law = Surrogate::shipped().into_diagnostic()?.with_young_modulus_pa(args.young_modulus_pa);
    let largest = PeakToPeak::from_metres(args.largest_amplitude_pp_m);
    let answer = match inverse::amplitude_for(&law, &condition, wanted, largest) {
        Ok(answer) => answer,
        Err(why @ inverse::NoAmplitude::OutOfReach { .. }) => {
            say!("{why}");
            return Ok(ExitCode::from(1));
        }
        Err(why) => return Err(refused(why)),
    };
    if json {
        answer_json(&json!({
            "amplitude_pp_m": answer.amplitude.metres(),
            "amplitude_pp_sd_m": answer.amplitude_sd_m,
            "mu_relative": answer.prediction.mu_relative,
            "mu_relative_sd": answer.prediction.mu_relative_sd,
            "lateral_force_n": answer.prediction.lateral_force_n,
            "relative_drive_power": answer.relative_drive_power,
            "validity": answer.prediction.validity,
        }));
    } else {
        let w = answer.amplitude.metres();
        out!(
            "w = {} peak-to-peak for mu' = {} (lateral force {}); drive power {} times that of 1 \u{b5}m; {}",
            match answer.amplitude_sd_m {
                Some(sd) =>
                    format!("{} \u{b1} {} \u{b5}m", to_its_uncertainty(w * 1e6, sd * 1e6), number(sd * 1e6)),
                None => quantity(w, "m"),
            },
            number(wanted),
            quantity(answer.prediction.lateral_force_n, "N"),
            number(answer.relative_drive_power),
            if answer.prediction.validity == Validity::Inside {
                "inside the fitted range"
            } else {
                "OUTSIDE the fitted range: an extrapolation"
            }
        );
    }
    Ok(ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Flags {
        #[command(flatten)]
        args: AmplitudeForArgs,
    }

    /// The refusal spoke of a mu_relative that nobody had given; an amplitude was taken and changed nothing.
    #[test]
    fn a_force_beyond_coulombs_and_an_amplitude_are_refused_by_their_options() {
        let wanted = |words: &[&str]| Flags::parse_from([&["mu"], words].concat()).args.wanted();
        for force in ["50", "0", "-0.1", "NaN"] {
            let why = wanted(&[&format!("--lateral-force-n={force}")]).unwrap_err();
            assert!(why.starts_with(&format!("--lateral-force-n {force}: ")), "{why}");
            assert!(why.contains("at most 0.125 N (mu0 times"), "{why}");
        }
        assert_eq!(wanted(&["--lateral-force-n", "0.125"]), Ok(1.0));
        assert_eq!(wanted(&["--mu-relative", "0.4"]), Ok(0.4));
        let why = wanted(&["--mu-relative", "0.4", "--amplitude-pp-m", "1e-6"]).unwrap_err();
        assert!(why.contains("--largest-amplitude-pp-m"), "{why}");
    }
}
