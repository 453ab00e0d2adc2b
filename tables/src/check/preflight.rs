//! Whether a plan can run on a setup.

use super::{On, problems_of};
use miette::IntoDiagnostic;
use models::{FrictionModel, SpringSlider};
use realtime::Nanos;
use realtime::safety::{HARD, Limits};
use runs::input::Problems;
use runs::plan::{Plan, Resolution};
use runs::{Job, Setup};
use std::path::PathBuf;
use std::sync::Arc;

/// The passes of a plan on its setup, none where it is judged by itself; and remarks.
pub(super) fn plan_on(on: &On, plan: Plan) -> miette::Result<(Option<usize>, Vec<String>)> {
    let Some(setup) = &on.setup else {
        let fine = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        plan.points(plan.file.seed, &widest(), &fine)?;
        // The file of a target; how large a lateral force may be, the fingertip of a setup says.
        plan.target(1e6, None)?;
        return Ok((None, Vec::new()));
    };
    complete(setup)?;
    let judged = preflight(setup, plan, on.model.as_ref(), None);
    let ports = on.ports.map_or(Ok(()), |opens| opens(setup));
    match (judged, ports) {
        (Ok((passes, remarks)), Ok(())) => Ok((Some(passes), remarks)),
        (Err(why), Ok(())) | (Ok(_), Err(why)) => Err(why),
        (Err(why), Err(closed)) => {
            let help = [&why, &closed].into_iter().flat_map(problems_of).filter_map(|p| p.help);
            Err(miette::miette!(help = help.collect::<Vec<_>>().join("; "), "{why}; {closed}"))
        }
    }
}

/// What a run asks of a setup beyond what reading it does: both axes, and an amplifier with which the loop would ever be armed.
pub(super) fn complete(setup: &Setup) -> miette::Result<()> {
    let mut wrong = Problems::of(&setup.origin, &setup.text);
    if let Err(problem) = setup.has_both_axes() {
        let remedy = "give each of the axes `lateral` and `normal` one signal of one instrument";
        wrong.add(&["force"], problem.to_string(), remedy.to_string());
    }
    let limits = &setup.config.limits;
    let amplifier = setup.file.amplifier.description().map_err(|e| miette::miette!("{e}"))?;
    let mut lacks = |what: &str, remedy: &str| {
        let problem = format!("`{}` has no {what}", amplifier.id());
        wrong.add(&["amplifier", "profile"], problem, remedy.to_string());
    };
    if limits.temperature_fitted && amplifier.signal("temperature").is_none() {
        lacks("thermometer: the rig would never be armed (SR-25)", runs::setup::THERMOMETER);
    }
    if !limits.amplifier_watchdog && setup.file.supply_relay.is_none() {
        let remedy = "give the rig a second switch-off channel, [supply_relay]";
        lacks("watchdog of at most 1 s (`timeout_ms`): the rig would never be armed (SR-38)", remedy);
    }
    wrong.end()
}

/// Everything that a run looks at in a plan before it touches rig or folder; the lateral channel's noise in
/// N, where it was found. Returns the number of passes, and remarks.
///
/// # Errors
/// What the run would refuse.
pub fn preflight(
    setup: &Setup,
    plan: Plan,
    model: Option<&Arc<dyn FrictionModel>>,
    noise_n: Option<f64>,
) -> miette::Result<(usize, Vec<String>)> {
    let model = match model {
        Some(model) => Arc::clone(model),
        None => Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?),
    };
    let job = Job {
        setup: setup.clone(),
        seed: plan.file.seed,
        plan,
        model,
        model_file: None,
        defects: None,
        out: PathBuf::new(),
        fast: false,
        notes: Default::default(),
        answers: None,
    };
    let (points, _, remarks) = job.points_seen(noise_n)?;
    Ok((points.len(), remarks))
}

/// The limits of a rig that has the hard ones only.
fn widest() -> Limits {
    /// The longest travel that a setup may state, m.
    const TRAVEL_M: f64 = 0.5;
    let mut limits = Limits::paper(Nanos(1_000_000));
    limits.normal_force_max_n = HARD.normal_force_max_n;
    limits.amplitude_max = HARD.amplitude_max;
    limits.frequency_hz = HARD.frequency_hz;
    limits.speed_max_m_s = HARD.speed_max_m_s;
    limits.travel_m = (-TRAVEL_M, TRAVEL_M);
    limits
}
