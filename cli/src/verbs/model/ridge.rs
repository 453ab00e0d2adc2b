//! `muprime model ridge`: one case of the finite element model.

mod start;

use super::conditions::{ConditionArgs, ContactArgs};
use super::refused;
use crate::verbs::prelude::*;
use clap::{Args, ValueEnum};
use models::Reading;
use models::ridge::{
    self, FrictionRule, RidgeCase, RidgeError, RidgeProfile, RidgeRun, RunSettings, Strain, case,
};
use runs::format::{number, quantity};
use serde::Serialize;
use start::OtherStart;
use std::time::Instant;
use studies::progress::Study;

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Profile {
    Parabola,
    Ellipse,
    Flat,
}

/// Arguments of `muprime model ridge`.
#[derive(Args)]
pub struct RidgeArgs {
    #[command(flatten)]
    condition: ConditionArgs,
    /// Young's modulus of the stratum corneum in Pa
    #[arg(long, default_value_t = 28.3e6)]
    young_modulus_pa: f64,
    /// Retardation time of the tissue in s (0: elastic)
    #[arg(long, default_value_t = 0.0)]
    retardation_time_s: f64,
    #[command(flatten)]
    contact: ContactArgs,
    /// Mean pressure of the gross contact in Pa (from the force, by Hertz, if left out)
    #[arg(long)]
    mean_pressure_pa: Option<f64>,
    /// Mass damping in 1/s
    #[arg(long, default_value_t = case::MASS_DAMPING_PER_S)]
    mass_damping_per_s: f64,
    /// Stiffness-proportional damping in s (needs far smaller steps)
    #[arg(long, default_value_t = 0.0)]
    stiffness_damping_s: f64,
    /// Run it a second time, down from twice the amplitude, and say whether the answer depends on the start
    #[arg(long)]
    both_starts: bool,
    /// Number of elements, about
    #[arg(long, default_value_t = case::ELEMENTS)]
    elements: usize,
    /// Time step in s (the largest stable one if left out; an unstable one is refused)
    #[arg(long)]
    time_step_s: Option<f64>,
    /// Tolerance on mu' at which the cycles count as steady
    #[arg(long, default_value_t = 0.004)]
    tolerance: f64,
    /// Coulomb's limit at each node instead of for the whole ridge
    #[arg(long)]
    local_friction: bool,
    /// Small strain instead of the velocity strain on the moving geometry
    #[arg(long)]
    small_strain: bool,
    /// Shape of the ridge's top
    #[arg(long, value_enum, default_value = "parabola")]
    profile: Profile,
}

impl RidgeArgs {
    fn case(&self) -> RidgeCase {
        let mut case = self.contact.of(self.condition.ridge_case(self.mean_pressure_pa));
        case.young_modulus_pa = self.young_modulus_pa;
        case.retardation_time_s = self.retardation_time_s;
        case.mass_damping_per_s = self.mass_damping_per_s;
        case.stiffness_damping_s = self.stiffness_damping_s;
        case.elements = self.elements;
        case.friction = if self.local_friction { FrictionRule::Local } else { FrictionRule::Global };
        case.strain = if self.small_strain { Strain::Small } else { Strain::Objective };
        case.geometry.profile = match self.profile {
            Profile::Parabola => RidgeProfile::Parabola,
            Profile::Ellipse => RidgeProfile::Ellipse,
            Profile::Flat => RidgeProfile::Flat,
        };
        case
    }
}

/// Cycles that the mean of a case is over where it is ended before it is steady, at most.
const LAST_CYCLES: usize = 10;

#[derive(Serialize)]
struct Answer<'a> {
    #[serde(flatten)]
    run: &'a RidgeRun,
    wall_seconds: f64,
    element_updates_per_second: f64,
    case: &'a RidgeCase,
    /// Where it was run from both starts.
    #[serde(skip_serializing_if = "Option::is_none")]
    from_above: Option<&'a OtherStart>,
}

/// What there is where Ctrl-C ends a case: the cycles so far, which need not be steady.
fn partial(mu: &[f64], cycles: u64, json: bool) {
    let last = &mu[mu.len() - (mu.len() / 2).min(LAST_CYCLES)..];
    let mean = (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64);
    if json {
        answer_json(&json!({ "partial": true, "cycles": cycles, "mu_relative": mean, "steady": false }));
        return;
    }
    let over = |mean| format!(", NOT steady; mu' = {mean:.4} over the last {}", last.len());
    out!("partial: {cycles} cycles{}", mean.map_or_else(|| "; too few for a mean".into(), over));
}

/// Runs the case; refuses bad input, and fails with a reason where the run diverged.
pub fn run(args: &RidgeArgs, json: bool) -> miette::Result<ExitCode> {
    args.condition.check(&[]).map_err(refused)?;
    let case = args.case();
    let mut settings = RunSettings { step_s: args.time_step_s, ..RunSettings::default() };
    settings.steady.tolerance = args.tolerance;
    if !(args.tolerance > 0.0 && args.tolerance < 1.0) {
        miette::bail!("--tolerance {}: above 0 and below 1", args.tolerance);
    }
    let clock = Instant::now();
    // It ends where the cycles are steady: the time to go is the longest.
    let most = settings.steady.at_most;
    let study = Study::begin(most as u64, "cycles at most", move |mu: Vec<f64>, cycles| {
        partial(&mu, cycles, json);
    })?;
    let run = ridge::run_watched(&case, &settings, &mut |mu_relative| study.done(Some(mu_relative)));
    drop(study);
    let wall_seconds = clock.elapsed().as_secs_f64();
    let other = match (&run, args.both_starts) {
        (Ok(run), true) => start::from_above(&case, &settings, run).map(Some),
        _ => Ok(None),
    };
    let (run, other) = match run.and_then(|run| other.map(|other| (run, other))) {
        Ok(both) => both,
        Err(why @ RidgeError::Diverged) => {
            say!("{why}");
            return Ok(ExitCode::from(1));
        }
        Err(why) => return Err(refused(why)),
    };
    let element_updates_per_second = run.elements as f64 * run.steps as f64 / wall_seconds;
    let from_above = other.as_ref();
    let answer = Answer { run: &run, wall_seconds, element_updates_per_second, case: &case, from_above };
    if json {
        answer_json(&answer);
        return Ok(ExitCode::SUCCESS);
    }
    let law = |reading: Reading| {
        let psi = models::psi::PsiEq17(run.psi_eq17);
        models::psi::relative_friction(psi, reading.psi_star().0)
    };
    let [stroke, sine] = Reading::ALL.map(law);
    let (mu, sd) = (run.mu_relative, run.mu_relative_sd);
    out!(
        "mu' = {mu:.3} \u{b1} {sd:.3}   (Eq. 20: {stroke:.3} if the paper's w is peak-to-peak, {sine:.3} if it is the sine's amplitude)"
    );
    let forces_n =
        [run.lateral_force_n, run.mean_reaction_force_n, case.normal_force_n, run.peak_reaction_force_n];
    let [lateral, mean, applied, greatest] = forces_n.map(|force| quantity(force, "N"));
    out!("lateral force {lateral}, mean reaction {mean} for {applied} applied, greatest {greatest}");
    out!(
        "contact {:.0} % of the time, phase shift {}, {}{}",
        100.0 * run.contact_fraction,
        run.phase_shift_deg.map_or("none".into(), |p| format!("{p:.0} deg")),
        if run.steady { "steady" } else { "NOT steady" },
        if run.period_doubled { ", period doubled" } else { "" }
    );
    let RidgeRun { elements, cycles, averaged_cycles, steps, step_s, .. } = run;
    out!(
        "{elements} elements, {cycles} cycles ({averaged_cycles} averaged), {steps} steps of {step_s:.2e} s, \
         {wall_seconds:.2} s, {:.0} million element updates/s",
        element_updates_per_second / 1e6
    );
    if let Some(other) = &other {
        out!("{}", other.words(&run));
    } else if start::is_lightly_damped(&case) {
        let below = number(start::LIGHTLY_DAMPED_PER_S);
        out!(
            "lightly damped: below {below} /s the answer may depend on how the run began; try --both-starts"
        );
    }
    Ok(ExitCode::SUCCESS)
}
