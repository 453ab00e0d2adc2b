//! `muprime doctor`: judges this machine truthfully, and talks to the instruments of a setup.

mod peek;

use super::prelude::*;
use rig::doctor::{Finding, InspectionScope, machine};
use rig::emulators::Emulators;
use runs::print::folded;
use runs::{Plan, Setup};
use sim::wire::SharedPlant;
use sim::wire::world::WorldPlant;
use sim::world::World;
use std::time::Instant;

#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// Setup whose instruments are talked to
    #[arg(long)]
    setup: Option<String>,
    /// Plan that is to run on it: forces, loads and noise are judged by what it asks for
    #[arg(long, requires = "setup")]
    plan: Option<String>,
    /// How long lateness is measured, in s
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// Only the setup's instruments, not the machine: the exit status then speaks of them alone
    #[arg(long, requires = "setup")]
    instruments_only: bool,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Show the registers, CAN frames or lines of an instrument without a profile; it never writes
    Peek(peek::Args),
}

/// Judges; refused: a setup or a plan that cannot be used.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if let Some(What::Peek(args)) = &args.what {
        return peek::run(args, json);
    }
    let setup = args.setup.as_deref().map(super::setup).transpose()?;
    let (findings, lateness_us) = (!args.instruments_only).then(|| machine::judge(args.seconds)).unzip();
    let findings = findings.unwrap_or_default();
    let plan = args.plan.as_deref().map(super::plan).transpose()?;
    let instruments = setup.as_ref().map(|setup| talk(setup, plan.as_ref())).transpose()?.unwrap_or_default();
    let good = findings.iter().chain(&instruments).all(|f| f.good);
    if json {
        let judgement =
            json!({ "findings": findings, "lateness_us": lateness_us, "instruments": instruments });
        answer_json(&json!({ "good": good, "judgement": judgement }));
    } else {
        for f in findings.iter().chain(&instruments) {
            let mark = if f.good { "OK" } else { "FIX" };
            out!("{}", folded(&format!("{mark}  {}: {}", f.subject, f.found), 6));
            if !f.good {
                out!("{}", folded(&format!("      {}", f.advice), 0));
            }
            for channel in &f.channels {
                out!("{}", folded(&format!("      {}", channel.words()), 2));
            }
        }
        if let Some(late) = &lateness_us {
            for (when, [p50, p99, p999, max]) in [("idle", late.idle), ("loaded", late.loaded)] {
                let line = format!(
                    "      lateness {when}: median {p50:.0} \u{b5}s, 99 % {p99:.0}, 99.9 % {p999:.0}, worst {max:.0} \u{b5}s"
                );
                out!("{}", folded(&line, 2));
            }
        }
    }
    exit(if good { DONE } else { FAILED })
}

/// Checks every instrument of a setup as a run would, also after one that fails; what was found of each.
fn talk(setup: &Setup, plan: Option<&Plan>) -> miette::Result<Vec<Finding>> {
    let mut instruments = setup.instruments();
    let (_rig_lock, _emulators);
    if setup.file.virtual_rig.is_some() {
        _emulators = serve(setup, &mut instruments)?;
    } else {
        // Every driver ends with an 'off': that must not reach a rig that another program drives.
        _rig_lock = match rig::rig_lock::RigLock::take(setup) {
            Ok(lock) => lock,
            Err(why) => {
                let found = format!("{why}: {}", why.root_cause());
                return Ok(vec![Finding::new("instruments", false, found, "wait until it ends, or end it")]);
            }
        };
    }
    let inspected = rig::doctor::inspect(setup, &instruments);
    let mut findings = rig::doctor::judge(&inspected, &InspectionScope { setup, plan });
    if let Some(v) = &setup.file.vibrometer {
        let settings = drivers::vibrometer::settings(v);
        findings.push(Finding::new(
            format!("vibrometer `{}` at {}", v.profile, v.address),
            settings.is_ok(),
            settings.map_or_else(|problem| problem.to_string(), |settings| settings.to_string()),
            "check line, power and that no other program holds it; Echo must be off",
        ));
    }
    Ok(findings)
}

/// A virtual rig's instruments, served for the check.
fn serve(setup: &Setup, instruments: &mut drivers::InstrumentsSetup) -> miette::Result<Emulators> {
    let config = setup.file.virtual_rig.clone().unwrap_or_default().world();
    let world = World::new(&config, 1).map_err(|e| miette::miette!("{e}"))?;
    let plant = SharedPlant::new(WorldPlant::new(world), Instant::now());
    rig::emulators::serve(instruments, &plant, false)
}
