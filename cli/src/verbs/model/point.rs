//! `muprime model point`: one condition through a law that answers at once.

use super::conditions::{ConditionArgs, YOUNG_MODULUS_PA};
use super::refused;
use crate::verbs::prelude::*;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use models::prediction::EmpiricalPsi;
use models::psi::{PsiEq16, PsiEq17};
use models::rig_file::STIFFNESS_N_PER_M;
use models::{BuiltIn, Condition, Finger, Reading, Surrogate, spring_slider};
use runs::format::quantity;
use serde::Serialize;

/// Reads a law's name on the command line.
fn law() -> impl TypedValueParser<Value = BuiltIn> {
    PossibleValuesParser::new(BuiltIn::ALL.map(BuiltIn::name))
        .try_map(|name| BuiltIn::by_name(&name).ok_or("no such law"))
}

/// Arguments of `muprime model point`.
#[derive(Args)]
pub struct PointArgs {
    #[command(flatten)]
    condition: ConditionArgs,
    /// Which law
    #[arg(long, value_parser = law(), default_value = "spring-slider")]
    model: BuiltIn,
    /// Normal stiffness of the finger in N/m (spring-slider; 3.9e6 if left out)
    #[arg(long)]
    normal_stiffness_n_per_m: Option<f64>,
    /// Lateral stiffness of the finger in N/m (spring-slider; 1.5e6 if left out)
    #[arg(long)]
    lateral_stiffness_n_per_m: Option<f64>,
    /// Speed of the skin's lateral recovery in m/s (spring-slider; infinite if left out)
    #[arg(long)]
    lateral_recovery_m_per_s: Option<f64>,
    /// Young's modulus of the stratum corneum in Pa (surrogate; 28.3e6 if left out)
    #[arg(long)]
    young_modulus_pa: Option<f64>,
}

impl PointArgs {
    /// The finger that the law takes; refused are values that it does not depend on, or that no finger has.
    fn finger(&self) -> Result<Finger, String> {
        let (paper, recovery) = (Finger::paper(), self.lateral_recovery_m_per_s);
        let options = [
            ("normal_stiffness_n_per_m", self.normal_stiffness_n_per_m, BuiltIn::SpringSlider),
            ("lateral_stiffness_n_per_m", self.lateral_stiffness_n_per_m, BuiltIn::SpringSlider),
            ("lateral_recovery_m_per_s", recovery, BuiltIn::SpringSlider),
            ("young_modulus_pa", self.young_modulus_pa, BuiltIn::Surrogate),
            ("poisson_ratio", None, BuiltIn::Psi),
        ];
        let flags = |all: &[(&str, Option<f64>, BuiltIn)]| {
            let flag = |(key, ..): &(&str, _, _)| format!("--{}", key.replace('_', "-"));
            all.iter().map(flag).collect::<Vec<_>>().join(", ")
        };
        let (own, other): (Vec<_>, Vec<_>) = options.into_iter().partition(|(.., law)| *law == self.model);
        if let Some(given) = other.iter().find(|(_, value, _)| value.is_some()) {
            let (given, own, law) = (flags(&[*given]), flags(&own), self.model.name());
            return Err(format!("{given}: the law '{law}' does not depend on it; it takes {own}"));
        }
        let modulus = self.young_modulus_pa.or(paper.young_modulus_pa);
        let k_n = self.normal_stiffness_n_per_m.unwrap_or(paper.normal_stiffness_n_per_m);
        let k_l = self.lateral_stiffness_n_per_m.unwrap_or(paper.lateral_stiffness_n_per_m);
        self.condition.check(&[
            (options[0].0, k_n, STIFFNESS_N_PER_M),
            (options[1].0, k_l, STIFFNESS_N_PER_M),
            (options[3].0, modulus.unwrap_or(f64::NAN), YOUNG_MODULUS_PA),
        ])?;
        Ok(Finger {
            normal_stiffness_n_per_m: k_n,
            lateral_stiffness_n_per_m: k_l,
            poisson_ratio: self.condition.poisson_ratio,
            young_modulus_pa: modulus,
            lateral_recovery_m_per_s: recovery.filter(|v| v.is_nan() || *v < f64::INFINITY),
            ..paper
        })
    }
}

/// The law under one reading.
#[derive(Serialize)]
struct Read {
    reading: Reading,
    psi_star: f64,
    psi_star_sd: f64,
    mu_relative: f64,
    mu_relative_sd: f64,
}

#[derive(Serialize)]
struct Answer {
    model: String,
    mu_relative: f64,
    mu_relative_sd: f64,
    lateral_force_n: f64,
    mean_reaction_force_n: f64,
    contact_fraction: f64,
    phase_shift_deg: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    touch_down_deg: Option<f64>,
    regime: models::prediction::Regime,
    /// Of the law 'psi': what each reading of the paper's w says.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    readings: Vec<Read>,
    psi_eq16: f64,
    psi_eq17: f64,
    validity: models::prediction::Validity,
}

/// Answers, or refuses a condition outside the law's domain.
pub fn run(args: &PointArgs, json: bool) -> miette::Result<ExitCode> {
    let finger = args.finger().map_err(refused)?;
    let condition = args.condition.condition();
    let cycle = spring_slider::solve(&condition, &finger).map_err(refused)?;
    let law = args.model.law(&finger).map_err(refused)?;
    let mut readings = Vec::new();
    if args.model == BuiltIn::Psi {
        let empirical = EmpiricalPsi::paper(finger).map_err(refused)?;
        for reading in Reading::ALL {
            let (mu_relative, mu_relative_sd) = empirical.under(&condition, reading).map_err(refused)?;
            let (psi_star, psi_star_sd) = reading.psi_star();
            readings.push(Read { reading, psi_star, psi_star_sd, mu_relative, mu_relative_sd });
        }
    }
    let prediction = law.predict(&condition).map_err(refused)?;
    let mut answer = Answer {
        model: law.name().to_string(),
        mu_relative: prediction.mu_relative,
        mu_relative_sd: prediction.mu_relative_sd,
        lateral_force_n: prediction.lateral_force_n,
        mean_reaction_force_n: cycle.mean_reaction_force_n,
        contact_fraction: cycle.contact_fraction,
        phase_shift_deg: cycle.phase_shift_deg,
        touch_down_deg: Some(cycle.touch_down_deg),
        regime: prediction.regime,
        readings,
        psi_eq16: PsiEq16::at(&condition, &finger).0,
        psi_eq17: PsiEq17::at(&condition, finger.poisson_ratio).0,
        validity: prediction.validity,
    };
    if args.model == BuiltIn::Surrogate {
        let Condition { amplitude, frequency_hz, speed_m_s, normal_force_n, mu0, .. } = condition;
        let surrogate = Surrogate::shipped().into_diagnostic()?;
        let modulus_pa = finger.young_modulus_pa.unwrap_or_default();
        let at = surrogate.at(amplitude, frequency_hz, speed_m_s / mu0, normal_force_n, modulus_pa);
        answer.contact_fraction = at.contact_fraction;
        answer.phase_shift_deg = at.phase_shift_deg.rem_euclid(360.0);
        answer.touch_down_deg = None;
    }
    if json {
        answer_json(&answer);
    } else {
        // A law without an error of its own says nothing of how far off it is: no uncertainty is not one of zero.
        let sd = match answer.mu_relative_sd {
            sd if sd > 0.0 => format!(" \u{b1} {sd:.3}"),
            _ => String::new(),
        };
        let Answer { model, mu_relative, phase_shift_deg, .. } = &answer;
        let (force, contact) = (quantity(answer.lateral_force_n, "N"), 100.0 * answer.contact_fraction);
        out!(
            "{model}: mu' = {mu_relative:.3}{sd}, lateral force {force}, contact {contact:.0} % of the time, \
             phase shift {phase_shift_deg:.0} deg"
        );
        if answer.validity == models::prediction::Validity::Extrapolated {
            out!("  outside the range that the law was made for: an extrapolation");
        }
        for Read { reading, mu_relative, mu_relative_sd, .. } in &answer.readings {
            out!("  where {}: mu' = {mu_relative:.3} \u{b1} {mu_relative_sd:.3}", reading.words());
        }
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
        point: PointArgs,
    }

    /// Such an option was taken and changed nothing.
    #[test]
    fn what_a_law_does_not_depend_on_is_refused() {
        let finger = |model: &str, flag: &str| {
            let words = ["mu", "--model", model, flag, "2e6"];
            Flags::parse_from(words).point.finger()
        };
        let (k_n, modulus) = ("--normal-stiffness-n-per-m", "--young-modulus-pa");
        let (k_l, recovery) = ("--lateral-stiffness-n-per-m", "--lateral-recovery-m-per-s");
        for (model, flags, takes) in [
            ("spring-slider", &[modulus][..], "-per-m, --lateral-recovery-m-per-s"),
            ("psi", &[k_n, k_l, recovery, modulus], "it takes --poisson-ratio"),
            ("surrogate", &[k_n, k_l, recovery], "it takes --young-modulus-pa"),
        ] {
            for flag in [k_n, k_l, recovery, modulus] {
                match finger(model, flag) {
                    Err(why) => assert!(
                        flags.contains(&flag) && why.starts_with(flag) && why.contains(takes),
                        "{why}"
                    ),
                    Ok(_) => assert!(!flags.contains(&flag), "{model} {flag}"),
                }
            }
        }
        assert_eq!(Flags::parse_from(["mu"]).point.finger(), Ok(Finger::paper()));
    }
}
