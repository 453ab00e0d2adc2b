//! What is wrong with whatever people write and the program wrote, with the place; and whether a plan can run on a setup.

mod cells;
mod own;
mod place;
mod shape;
mod written;

use crate::schemas::bundled;
use crate::schemas::schema::Kind;
use miette::IntoDiagnostic;
use models::prediction::{FrictionModel, SpringSlider};
use realtime::ports::Nanos;
use realtime::safety::{HARD, Limits};
use runs::fingertip::FingertipFile;
use runs::input::{BadInput, Problems, parse_toml, unit_meant, usual};
use runs::plan::{Plan, Resolution};
use runs::session::{Job, Summary};
use runs::setup::Setup;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use place::{Problem, problems_of};

use place::remedy;
pub use place::with_place_and_help;

/// What the plans are judged on.
#[derive(Default)]
pub struct On {
    /// Setup that the plans are to run on.
    pub setup: Option<Setup>,
    /// Corrected model that they are to run with.
    pub model: Option<Arc<dyn FrictionModel>>,
    /// What tries whether the ports of the instruments can be opened; `None` leaves that out.
    pub ports: Option<fn(&Setup) -> miette::Result<()>>,
}

/// What a file that holds is.
#[derive(Debug)]
pub struct Good {
    /// Its kind.
    pub kind: &'static str,
    /// Passes of a table, and of a plan on a setup.
    pub passes: Option<usize>,
    /// What looks wrong and is not refused.
    pub remarks: Vec<String>,
}

/// The text of a file, or of what is bundled under that name.
fn text_of(name: &str) -> miette::Result<String> {
    let bundled = || bundled::all().into_iter().find(|b| b.name == name);
    match (Path::new(name).exists(), bundled()) {
        (false, Some(bundled)) => Ok(bundled.text.into()),
        _ => runs::input::text_of(Path::new(name)),
    }
}

const KINDS: &str = "a profile has [profile], a setup [amplifier], a plan [base] and [[series]], a campaign [[cell]], a fingertip radius_m, a rig.toml [finger], a model \
    [baseline], defects [[defect]], a certificate content_sha256; a table ends in .csv or .parquet, a record in .mcap, a verdict, a summary and \
    an import's log in .json";

/// What kind of file it is, judged by its ending and its own first words.
///
/// # Errors
/// A file that cannot be read, or is none that muprime knows.
pub fn kind_of(name: &str) -> miette::Result<&'static str> {
    let path = Path::new(name);
    if let Some(kind) = own::kind_by_name(path) {
        return Ok(kind);
    }
    let unknown = || miette::miette!(help = KINDS, "{name} is none of the files that muprime knows");
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default() {
        "csv" | "parquet" => return Ok("table"),
        "mcap" => return Ok("record"),
        "jsonl" => return Ok("journal"),
        "json" => {
            let document: serde_json::Value = read_json(name)?;
            let schema = document["schema"].as_str().unwrap_or_default();
            return match schema.split('/').next() {
                Some("muprime.verdict") => Ok("verdict"),
                Some("muprime.import") => Ok("import log"),
                _ if document.get("planned").is_some() || document.get("outcome").is_some() => Ok("summary"),
                _ => own::kind_of_document(path, &document).ok_or_else(unknown),
            };
        }
        _ if path.is_dir() => return Ok("run"),
        _ => {}
    }
    let table: toml::Table = parse_toml(name, &text_of(name)?)?;
    let has = |key: &str| table.contains_key(key);
    let kinds = [
        ("profile", has("profile")),
        ("setup", has("amplifier") || has("force") || has("stage")),
        ("campaign", has("cell") || has("blocks")),
        ("plan", has("series") || has("base")),
        ("certificate", has("content_sha256") || has("covariance")),
        ("defects file", has("defect") || has("channel")),
        ("model", has("baseline") || has("design")),
        ("fingertip", has("radius_m") || has("material")),
        ("identity", has("setup_sha256")),
        ("rig.toml", has("finger") || has("noise") || has("calibration")),
    ];
    kinds.into_iter().find(|(_, is)| *is).map(|(kind, _)| kind).ok_or_else(unknown)
}

fn read_json(name: &str) -> miette::Result<serde_json::Value> {
    let text = runs::input::text_of(Path::new(name))?;
    serde_json::from_str(&text).map_err(|e| {
        let offset = text.lines().take(e.line().saturating_sub(1)).map(|l| l.len() + 1).sum::<usize>();
        let at = (offset + e.column().saturating_sub(1)).min(text.len());
        let remedy = "it was cut or changed by hand: let the program write it again".to_string();
        BadInput::new(name, &text, Some(at..at), e.to_string(), remedy).into()
    })
}

fn schema_of(kind: &str) -> Option<Kind> {
    let name = if kind == "rig.toml" { "rig" } else { kind };
    Kind::all().find(|k| k.name() == name && !matches!(k, Kind::Table | Kind::Verdict))
}

/// Whether a file holds, and its kind.
///
/// # Errors
/// All that is wrong with it: each with its place, where the file has one, and a remedy.
pub fn file(name: &str, on: &On) -> miette::Result<Good> {
    let kind = kind_of(name).map_err(|e| with_place_and_help(e, name, None))?;
    judge(kind, name, on, None).map_err(|report| in_whole(report, kind, name, on))
}

/// The refusal of a file that was to be of this kind (as [`kind_of`] says it), with all that is wrong with
/// the file.
pub fn refusal(why: miette::Report, name: &str, kind: &'static str) -> miette::Report {
    let on = On::default();
    match kind_of(name) {
        _ if !Path::new(name).exists() => with_place_and_help(why, name, Some(kind)),
        Ok(other) if other != kind && file(name, &on).is_ok() => {
            let (other, needed) = (place::with_article(other), place::with_article(kind));
            miette::miette!(help = remedy(Some(kind)), "{name} is {other}; {needed} is needed here")
        }
        _ => in_whole(judge(kind, name, &on, None).err().unwrap_or(why), kind, name, &on),
    }
}

/// A refusal with all that is wrong with the file.
fn in_whole(report: miette::Report, kind: &'static str, name: &str, on: &On) -> miette::Report {
    // A reader stops at the first key that it does not take: the schema goes on, and then the values.
    if let (Some(known), Ok(text)) = (schema_of(kind), text_of(name)) {
        let mut problems = Problems::of(name, &text);
        shape::toml(&known.schema(), &text, &mut problems);
        if !problems.is_empty() && matches!(kind, "setup" | "plan" | "fingertip" | "rig.toml") {
            let meant = shape::as_meant(&known.schema(), &text);
            let judged = meant.map(|meant| judge(kind, name, on, Some(meant)));
            if let Some(Err(values)) = judged {
                let values = with_place_and_help(values, name, Some(kind));
                place::put_all(&values, &text, &mut problems);
            }
        }
        if let Err(all) = problems.end() {
            return with_place_and_help(all, name, Some(kind));
        }
    }
    with_place_and_help(report, name, Some(kind))
}

/// Judges a file, or `instead` of what stands in it.
fn judge(kind: &'static str, name: &str, on: &On, instead: Option<String>) -> miette::Result<Good> {
    let (path, good) = (Path::new(name), Good { kind, passes: None, remarks: Vec::new() });
    let folder = path.parent().unwrap_or(Path::new("."));
    if let Some(judged) = own::judge(kind, path) {
        return judged.map(|passes| Good { passes, ..good });
    }
    match kind {
        "table" => return written::table(path),
        "record" => return written::record(path).map(|()| good),
        "journal" => return written::journal(path).map(|passes| Good { passes, ..good }),
        "run" => return written::run_folder(path).map(|passes| Good { passes: Some(passes), ..good }),
        "verdict" => return written::verdict(name).map(|()| good),
        "import log" => return Ok(good),
        "summary" => {
            serde_json::from_value::<Summary>(read_json(name)?).into_diagnostic()?;
            return Ok(good);
        }
        _ => {}
    }
    let text = instead.map_or_else(|| text_of(name), Ok)?;
    let mut remarks = Vec::new();
    match kind {
        "profile" => {
            let refused = |problem: String| miette::miette!("{problem}");
            if path.exists() {
                runs::rehearsal::of(path).map_err(refused)?;
            } else {
                drivers::profile(name).map_err(|e| refused(e.to_string()))?;
            }
        }
        "setup" => {
            let setup = Setup::parse(name, &text, folder)?;
            complete(&setup)?;
            // What the virtual rig serves is opened when it runs.
            on.ports.filter(|_| setup.file.virtual_rig.is_none()).map_or(Ok(()), |opens| opens(&setup))?;
            remarks = finger_remarks(&[
                ("normal_stiffness_n_per_m", setup.tip.finger.normal_stiffness_n_per_m),
                ("lateral_stiffness_n_per_m", setup.tip.finger.lateral_stiffness_n_per_m),
                ("force_sd_n", setup.file.noise.force_sd_n),
            ]);
        }
        "plan" => {
            let passes = plan_on(on, Plan::parse(name, &text)?)?;
            return Ok(Good { passes, ..good });
        }
        "campaign" => {
            let campaign = runs::campaign::Campaign::parse(name, &text, folder)?;
            let mut passes = 0;
            for setup in &campaign.setups {
                passes += preflight(setup, campaign.plan.clone(), on.model.as_ref(), None)?;
            }
            return Ok(Good { passes: Some(passes * campaign.file.blocks as usize), ..good });
        }
        "certificate" => runs::calibrate::check(name, &text).map(|_| ())?,
        "defects file" => {
            let defects = sim::defects::Defects::parse(&text).map_err(|e| miette::miette!("{e}"))?;
            let config = sim::world::WorldConfig { defects, ..sim::world::WorldConfig::ideal() };
            sim::world::World::new(&config, 1).map_err(|e| miette::miette!("{e}"))?;
        }
        "model" => {
            match &on.setup {
                Some(setup) => runs::model_file::load_for(setup, name, &text)?,
                None => runs::model_file::load(name, &text)?,
            };
        }
        "fingertip" => {
            let tip = fingertip(name, &text)?;
            remarks = finger_remarks(&[
                ("normal_stiffness_n_per_m", tip.finger.normal_stiffness_n_per_m),
                ("lateral_stiffness_n_per_m", tip.finger.lateral_stiffness_n_per_m),
                ("young_modulus_pa", tip.finger.young_modulus_pa.unwrap_or(1e6)),
                ("radius_m", tip.radius_m),
            ]);
        }
        "identity" => {
            parse_toml::<runs::run_dir::Identity>(name, &text)?;
        }
        _ => {
            let rig = runs::input::rig_text(name, &text)?;
            remarks = finger_remarks(&[
                ("normal_stiffness_n_per_m", rig.finger.normal_stiffness_n_per_m),
                ("lateral_stiffness_n_per_m", rig.finger.lateral_stiffness_n_per_m),
                ("young_modulus_pa", rig.finger.young_modulus_pa.unwrap_or(1e6)),
                ("force_sd_n", rig.noise.force_sd_n),
            ]);
        }
    }
    Ok(Good { remarks, ..good })
}

/// The passes of a plan on its setup; none where it is judged by itself.
fn plan_on(on: &On, plan: Plan) -> miette::Result<Option<usize>> {
    let Some(setup) = &on.setup else {
        let fine = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
        plan.points(plan.file.seed, &widest(), &fine)?;
        // The file of a target; how large a lateral force may be, the fingertip of a setup says.
        plan.target(1e6, None)?;
        return Ok(None);
    };
    complete(setup)?;
    let passes = preflight(setup, plan, on.model.as_ref(), None);
    let ports = on.ports.map_or(Ok(()), |opens| opens(setup));
    match (passes, ports) {
        (Ok(passes), Ok(())) => Ok(Some(passes)),
        (Err(why), Ok(())) | (Ok(_), Err(why)) => Err(why),
        (Err(why), Err(closed)) => {
            let help = [&why, &closed].into_iter().flat_map(problems_of).filter_map(|p| p.help);
            Err(miette::miette!(help = help.collect::<Vec<_>>().join("; "), "{why}; {closed}"))
        }
    }
}

/// A fingertip without a problem.
fn fingertip(name: &str, text: &str) -> miette::Result<FingertipFile> {
    let tip: FingertipFile = parse_toml(name, text)?;
    let mut wrong = Problems::of(name, text);
    for (place, problem) in tip.problems() {
        let meant = match place.as_slice() {
            ["radius_m"] => unit_meant("radius_m", tip.radius_m, usual("radius_m")),
            _ => None,
        };
        wrong.add(&place, problem, meant);
    }
    wrong.end()?;
    Ok(tip)
}

fn finger_remarks(values: &[(&str, f64)]) -> Vec<String> {
    values
        .iter()
        .filter_map(|(key, value)| {
            unit_meant(key, *value, usual(key)).map(|meant| format!("{key} = {meant}"))
        })
        .collect()
}

/// What a run asks of a setup beyond what reading it does: both axes, and an amplifier with which the loop would ever be armed.
fn complete(setup: &Setup) -> miette::Result<()> {
    let mut wrong = Problems::of(&setup.origin, &setup.text);
    if let Err(problem) = setup.has_both_axes() {
        let remedy = "give each of the axes `lateral` and `normal` one signal of one instrument";
        wrong.add(&["force"], problem.to_string(), remedy.to_string());
    }
    let limits = &setup.config.limits;
    let amplifier = setup.file.amplifier.description().map_err(|e| miette::miette!("{e}"))?;
    if limits.temperature_fitted && amplifier.signal("temperature").is_none() {
        let problem =
            format!("`{}` has no thermometer: the rig would never be armed (SR-25)", amplifier.id());
        wrong.add(&["amplifier", "profile"], problem, runs::setup::THERMOMETER.to_string());
    }
    if !limits.amplifier_watchdog && setup.file.supply_relay.is_none() {
        let problem = format!("`{}` has no watchdog: the rig would never be armed (SR-38)", amplifier.id());
        let remedy = "give the rig a second switch-off channel, [supply_relay]".to_string();
        wrong.add(&["amplifier", "profile"], problem, remedy);
    }
    wrong.end()
}

/// Everything that a run looks at in a plan before it touches rig or folder; the lateral channel's noise in
/// N, where it was found. Returns the number of passes.
///
/// # Errors
/// What the run would refuse.
pub fn preflight(
    setup: &Setup,
    plan: Plan,
    model: Option<&Arc<dyn FrictionModel>>,
    noise_n: Option<f64>,
) -> miette::Result<usize> {
    let model = match model {
        Some(model) => Arc::clone(model),
        None => Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?),
    };
    let seed = plan.file.seed;
    let (setup, out) = (setup.clone(), PathBuf::new());
    let job = Job {
        setup,
        plan,
        seed,
        model,
        model_file: None,
        defects: None,
        out,
        fast: false,
        notes: Default::default(),
        answers: None,
    };
    Ok(job.points_seen(noise_n)?.0.len())
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
