//! `muprime model point`: one condition through a law that answers at once.

use super::conditions::ConditionArgs;
use super::refused;
use crate::verbs::prelude::*;
use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use models::condition::Condition;
use models::finger::Finger;
use models::law::BuiltIn;
use models::prediction::EmpiricalPsi;
use models::psi::{PsiEq16, PsiEq17};
use models::reading::Reading;
use models::spring_slider;
use models::surrogate::Surrogate;
use runs::human::quantity;
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
    /// Normal stiffness of the finger in N/m
    #[arg(long, default_value_t = 3.9e6, allow_negative_numbers = true)]
    normal_stiffness_n_per_m: f64,
    /// Lateral stiffness of the finger in N/m
    #[arg(long, default_value_t = 1.5e6, allow_negative_numbers = true)]
    lateral_stiffness_n_per_m: f64,
    /// Speed of the skin's lateral recovery in m/s (infinite if left out)
    #[arg(long, allow_negative_numbers = true)]
    lateral_recovery_m_per_s: Option<f64>,
    /// Young's modulus of the stratum corneum in Pa (surrogate)
    #[arg(long, default_value_t = 28.3e6, allow_negative_numbers = true)]
    young_modulus_pa: f64,
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
    args.condition.check().map_err(refused)?;
    let condition = args.condition.condition();
    let finger = Finger {
        normal_stiffness_n_per_m: args.normal_stiffness_n_per_m,
        lateral_stiffness_n_per_m: args.lateral_stiffness_n_per_m,
        poisson_ratio: args.condition.poisson_ratio,
        young_modulus_pa: Some(args.young_modulus_pa),
        lateral_recovery_m_per_s: args.lateral_recovery_m_per_s.filter(|v| v.is_nan() || *v < f64::INFINITY),
        ..Finger::paper()
    };
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
        let (surrogate, modulus_pa) = (Surrogate::shipped().into_diagnostic()?, args.young_modulus_pa);
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
