//! `muprime model effects`: the library of candidate effects.

use crate::verbs::prelude::*;
use clap::Args;
use effects::effect::Prior;
use runs::format::number;

#[derive(Args)]
pub struct EffectsArgs {
    /// One effect only
    name: Option<String>,
}

/// Lists place, parameters with unit, zero, prior and bounds, source and needed covariates of every effect.
pub fn run(args: &EffectsArgs, json: bool) -> miette::Result<ExitCode> {
    let mut entries = effects::library().to_vec();
    if let Some(name) = &args.name {
        let known: Vec<_> = entries.iter().map(|e| e.name).collect();
        if !known.contains(&name.as_str()) {
            miette::bail!("there is no effect '{name}'; known: {}", known.join(", "));
        }
        entries.retain(|e| e.name == name);
    }
    if json {
        answer_json(&entries);
        return Ok(ExitCode::SUCCESS);
    }
    for entry in entries {
        out!("{} ({})", entry.name, word(&entry.place)?);
        out!("  {}", entry.summary);
        out!("  source: {}", entry.source);
        let needs: Vec<_> = entry.needs.iter().map(word).collect::<miette::Result<_>>()?;
        if !needs.is_empty() {
            out!("  needs: {}", needs.join(", "));
        }
        for law in entry.laws {
            out!("  law: {}", law.name);
            for p in law.parameters {
                let zero = p.zero.map_or_else(|| "none (a shape)".into(), |z| z.to_string());
                let (unit, prior) = (p.unit, prior(p.prior));
                out!("    {} [{unit}]: zero {zero}, prior {prior}, {} to {}", p.name, p.lower, p.upper);
            }
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn prior(prior: Prior) -> String {
    match prior {
        Prior::Normal(sd) => format!("normal with sd {}", number(sd)),
        Prior::HalfNormal(sd) => format!("not negative, half normal with sd {}", number(sd)),
        Prior::LogNormal(median, sd) => {
            format!("positive, median {}, sd of the logarithm {sd}", number(median))
        }
        Prior::Uniform(low, high) => format!("uniform from {low} to {high}"),
    }
}

/// A unit variant as the JSON writes it.
fn word(value: &impl serde::Serialize) -> miette::Result<String> {
    let text = serde_json::to_value(value).into_diagnostic()?;
    Ok(text.as_str().map_or_else(|| text.to_string(), str::to_string))
}
