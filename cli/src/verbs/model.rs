//! `muprime model`: evaluates the models.

#[cfg(feature = "parquet")]
mod adapt;
mod amplitude_for;
mod conditions;
mod effects;
mod patch;
mod point;
mod reproduce;
mod ridge;
mod stiffness;
mod table;
mod tabulate;

use crate::verbs::prelude::*;
use clap::{Args, Subcommand};

/// Arguments of `muprime model`.
#[derive(Args)]
pub struct ModelArgs {
    #[command(subcommand)]
    verb: ModelVerb,
}

#[derive(Subcommand)]
enum ModelVerb {
    /// One condition through the spring-slider, the empirical law or the surrogate.
    Point(point::PointArgs),
    /// One case of the finite element ridge, to its steady state.
    Ridge(ridge::RidgeArgs),
    /// What one ridge in plane strain leaves out: several ridges, and one of finite length.
    Patch(patch::PatchArgs),
    /// Static stiffnesses of the ridge across and along the plate, and their ratio.
    Stiffness(stiffness::StiffnessArgs),
    /// A parametric study on all cores: Fig. 9, or the surrogate's table. It can be stopped and resumed at any time.
    Table(table::TableArgs),
    /// A surrogate over up to ten variables, its nodes chosen in rounds where the error is.
    #[cfg(feature = "parquet")]
    Adapt(Box<adapt::AdaptArgs>),
    /// A law of your own, which a program computes, as a table for `run --model` and `diagnose --model`.
    Tabulate(tabulate::TabulateArgs),
    /// The paper's figures recomputed, as CSV and SVG with a line of comparison each.
    Reproduce(reproduce::ReproduceArgs),
    /// The candidate effects: place, parameters, units, zero, prior, source, covariates needed.
    Effects(effects::EffectsArgs),
    /// The amplitude (and relative drive power) for a wanted friction: open-loop control.
    AmplitudeFor(amplitude_for::AmplitudeForArgs),
}

/// Runs the subcommand. Bad input is refused with exit status 2; else it fails for an inner reason, such as a
/// file that cannot be written.
pub fn run(args: ModelArgs, json: bool) -> miette::Result<ExitCode> {
    // A study of it says more.
    let nothing = move |_| {
        if json {
            answer_json(&json!({ "partial": true }));
        }
    };
    studies::progress::on_interrupt(&indicatif::ProgressBar::hidden(), nothing)?;
    match args.verb {
        ModelVerb::Point(args) => point::run(&args, json),
        ModelVerb::Ridge(args) => ridge::run(&args, json),
        ModelVerb::Patch(args) => patch::run(&args, json),
        ModelVerb::Stiffness(args) => stiffness::run(&args, json),
        ModelVerb::Table(args) => table::run(&args, json),
        #[cfg(feature = "parquet")]
        ModelVerb::Adapt(args) => adapt::run(&args, json),
        ModelVerb::Tabulate(args) => tabulate::run(&args, json),
        ModelVerb::Reproduce(args) => reproduce::run(&args, json),
        ModelVerb::Effects(args) => effects::run(&args, json),
        ModelVerb::AmplitudeFor(args) => amplitude_for::run(&args, json),
    }
}

/// Bad input: a refusal, with the words of its error.
fn refused(why: impl std::fmt::Display) -> miette::Report {
    miette::miette!("{why}")
}
