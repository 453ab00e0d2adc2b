//! What is wrong with whatever people write and the program wrote, with the place; and whether a plan can run on a setup.

mod cells;
mod own;
mod place;
mod preflight;
mod shape;
mod written;

use crate::schemas::bundled;
use crate::schemas::schema::Kind;
use miette::IntoDiagnostic;
use models::{Finger, FrictionModel};
use runs::fingertip::FingertipFile;
use runs::input::{BadInput, Problems, parse_toml, unit_meant, usual};
use runs::{Plan, Setup, Summary};
use serde::de::DeserializeOwned;
use std::path::Path;
use std::sync::Arc;

pub use place::{InputProblem, problems_of, with_place_and_help};
pub use preflight::preflight;

use place::remedy;
use preflight::{complete, plan_on};

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

/// Refuses a JSON document that is none of these.
fn holds<T: DeserializeOwned>(name: &str) -> miette::Result<()> {
    serde_json::from_value::<T>(read_json(name)?).into_diagnostic().map(drop)
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
        let (schema, mut problems) = (known.schema(), Problems::of(name, &text));
        shape::toml(&schema, &text, &mut problems);
        if !problems.is_empty() && matches!(kind, "setup" | "plan" | "fingertip" | "rig.toml") {
            let meant = shape::as_meant(&schema, &text);
            if let Some(Err(values)) = meant.map(|meant| judge(kind, name, on, Some(meant))) {
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
    let path = Path::new(name);
    let good = |passes| Good { kind, passes, remarks: Vec::new() };
    if let Some(judged) = own::judge(kind, path) {
        return judged.map(good);
    }
    match kind {
        "table" => written::table(path),
        "record" => written::record(path).map(|()| good(None)),
        "journal" => written::journal(path).map(good),
        "run" => written::run_folder(path),
        "verdict" => written::verdict(name).map(|()| good(None)),
        "import log" => Ok(good(None)),
        "summary" => holds::<Summary>(name).map(|()| good(None)),
        _ => {
            let text = instead.map_or_else(|| text_of(name), Ok)?;
            judge_text(kind, name, on, &text).map(|(passes, remarks)| Good { kind, passes, remarks })
        }
    }
}

/// Judges what people write: the passes of a plan, and what looks wrong.
fn judge_text(kind: &str, name: &str, on: &On, text: &str) -> miette::Result<(Option<usize>, Vec<String>)> {
    let (path, mut remarks) = (Path::new(name), Vec::new());
    let folder = path.parent().unwrap_or(Path::new("."));
    match kind {
        "profile" => {
            let known = match path.exists() {
                true => runs::profile_trial::of(path).map(drop),
                false => drivers::profile(name).map(drop).map_err(|e| e.to_string()),
            };
            known.map_err(|problem| miette::miette!("{problem}"))?;
        }
        "setup" => {
            let setup = Setup::parse(name, text, folder)?;
            complete(&setup)?;
            // What the virtual rig serves is opened when it runs.
            on.ports.filter(|_| setup.file.virtual_rig.is_none()).map_or(Ok(()), |opens| opens(&setup))?;
            remarks = finger_remarks(&setup.tip.finger, &[("force_sd_n", setup.file.noise.force_sd_n)]);
        }
        "plan" => return plan_on(on, Plan::parse(name, text)?),
        "campaign" => {
            let campaign = runs::campaign::Campaign::parse(name, text, folder)?;
            let passes = |setup| Ok(preflight(setup, campaign.plan.clone(), on.model.as_ref(), None)?.0);
            let passes: usize = campaign.setups.iter().map(passes).sum::<miette::Result<_>>()?;
            return Ok((Some(passes * campaign.file.blocks as usize), remarks));
        }
        "certificate" => crate::calibrate::check(name, text).map(drop)?,
        "defects file" => {
            let defects = sim::defects::Defects::parse(text).map_err(|e| miette::miette!("{e}"))?;
            let config = sim::world::WorldConfig { defects, ..sim::world::WorldConfig::ideal() };
            sim::world::World::new(&config, 1).map_err(|e| miette::miette!("{e}"))?;
        }
        "model" => match &on.setup {
            Some(setup) => runs::model_file::load_for(setup, name, text).map(drop)?,
            None => runs::model_file::load(name, text).map(drop)?,
        },
        "fingertip" => {
            let tip = fingertip(name, text)?;
            let modulus = tip.finger.young_modulus_pa.unwrap_or(1e6);
            remarks =
                finger_remarks(&tip.finger, &[("young_modulus_pa", modulus), ("radius_m", tip.radius_m)]);
        }
        "identity" => drop(parse_toml::<runs::run_dir::Identity>(name, text)?),
        _ => {
            let rig = runs::input::rig_text(name, text)?;
            let modulus = rig.finger.young_modulus_pa.unwrap_or(1e6);
            let further = [("young_modulus_pa", modulus), ("force_sd_n", rig.noise.force_sd_n)];
            remarks = finger_remarks(&rig.finger, &further);
        }
    }
    Ok((None, remarks))
}

/// A fingertip without a problem.
fn fingertip(name: &str, text: &str) -> miette::Result<FingertipFile> {
    let tip: FingertipFile = parse_toml(name, text)?;
    let mut wrong = Problems::of(name, text);
    for (place, problem) in tip.problems() {
        let radius = Some(tip.radius_m).filter(|_| place == ["radius_m"]);
        let meant = radius.and_then(|radius| unit_meant("radius_m", radius, usual("radius_m")));
        wrong.add(&place, problem, meant);
    }
    wrong.end()?;
    Ok(tip)
}

/// Values of a finger and further ones that look as if they were in another unit.
fn finger_remarks(finger: &Finger, further: &[(&str, f64)]) -> Vec<String> {
    let stiffnesses = [
        ("normal_stiffness_n_per_m", finger.normal_stiffness_n_per_m),
        ("lateral_stiffness_n_per_m", finger.lateral_stiffness_n_per_m),
    ];
    let meant =
        |(key, value): &(&str, f64)| Some(format!("{key} = {}", unit_meant(key, *value, usual(key))?));
    stiffnesses.iter().chain(further).filter_map(meant).collect()
}
