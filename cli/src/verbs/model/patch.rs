//! `muprime model patch`: what one ridge in plane strain leaves out, as Psi* of a part of Fig. 12.

use super::refused;
use crate::verbs::prelude::*;
use clap::Args;
use models::Reading;
use models::psi_fit::PsiFit;
use models::ridge::patch::{Patch, plane_stress};
use models::ridge::{RidgeCase, RidgeError, RunSettings, run as run_ridge, short_study};

/// Arguments of `muprime model patch`.
#[derive(Args)]
pub struct PatchArgs {
    /// Elements of each mesh, about
    #[arg(long, default_value_t = 200)]
    elements: usize,
    /// How the paper's w is read
    #[arg(long, value_parser = studies::figures::reading::parser(), default_value = "peak-to-peak")]
    reading: Reading,
}

fn rows(args: &PatchArgs) -> Result<Vec<(&'static str, Option<PsiFit>)>, RidgeError> {
    let base = RidgeCase { elements: args.elements, ..RidgeCase::paper() };
    base.check()?;
    let settings = RunSettings { energy: false, ..RunSettings::default() };
    let patches = [
        ("one ridge, plane strain", Patch::Alike),
        ("pressure of the finger as Hertz has it", Patch::Hertz),
        ("two heights: half carries 3/4 of the load", Patch::TwoHeights { uneven: 0.5 }),
        ("two heights: half carries all of it", Patch::TwoHeights { uneven: 1.0 }),
    ];
    let mut rows = Vec::new();
    for (what, patch) in patches {
        let mu = |case: &RidgeCase| patch.mu_relative(case, &settings);
        rows.push((what, short_study::psi_star_with(base, args.reading, mu)?));
    }
    let thin = |case: &RidgeCase| run_ridge(&plane_stress(*case), &settings).map(|found| found.mu_relative);
    rows.push(("a short ridge: plane stress", short_study::psi_star_with(base, args.reading, thin)?));
    Ok(rows)
}

/// Runs the comparison; refuses bad input.
pub fn run(args: &PatchArgs, json: bool) -> miette::Result<ExitCode> {
    let rows = rows(args).map_err(refused)?;
    if json {
        let row = |(what, fit): &(&str, Option<PsiFit>)| {
            json!({
                "what": what, "psi_star": fit.map(|f| f.psi_star), "psi_star_sd": fit.map(|f| f.psi_star_sd),
                "rmse": fit.map(|f| f.rmse), "points": fit.map_or(0, |f| f.points),
            })
        };
        answer_json(&rows.iter().map(row).collect::<Vec<_>>());
        return Ok(ExitCode::SUCCESS);
    }
    for (what, fit) in rows {
        let words = fit.map_or("no Psi* fits".into(), |f| {
            format!("Psi* {:.3} +- {:.3}, rmse {:.3}, {} points", f.psi_star, f.psi_star_sd, f.rmse, f.points)
        });
        out!("{what:<44} {words}");
    }
    Ok(ExitCode::SUCCESS)
}
