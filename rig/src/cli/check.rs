//! `muprime check FILE...`: says what is wrong with whatever people write or the program wrote, with the place; and whether a plan can
//! run on a setup.

use crate::fingertip::{Fingertip, FingertipSetup};
use crate::input::{MAX_TABLE_BYTES, bytes_of, parse_toml};
use crate::plan::{Plan, Resolution};
use crate::session::Job;
use crate::setup::Setup;
use crate::words::bundled;
use crate::{out, say};
use miette::{IntoDiagnostic, WrapErr};
use models::prediction::{FrictionModel, SpringSlider};
use models::record::read_passes;
use realtime::ports::Nanos;
use realtime::safety::{HARD, Limits};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Files of any kind, or bundled names: plans, setups, profiles, fingertips, rig.toml, point tables, models, certificates, defects
    #[arg(required = true)]
    files: Vec<String>,
    /// Setup that the plans are to run on [default: the setup among the files, where there is one]
    #[arg(long)]
    setup: Option<String>,
    /// Corrected model that they are to run with
    #[arg(long)]
    model: Option<PathBuf>,
}

/// Checks every file, and every plan against the setup; the status tells of the worst.
///
/// # Errors
/// A setup or a model that was named and cannot be used; what is wrong with the files is the answer.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let named = args.setup.as_deref().map(Setup::load).transpose()?;
    let among = args.files.iter().filter(|f| kind_of(f).is_ok_and(|k| k == "setup"));
    let setup = match (named, among.collect::<Vec<_>>().as_slice()) {
        (Some(setup), _) => Some(setup),
        // One that is wrong is told of by itself.
        (None, [one]) => Setup::load(one).ok(),
        (None, _) => None,
    };
    let model = match (&args.model, &setup) {
        (None, _) => None,
        (Some(path), Some(setup)) => {
            let name = path.display().to_string();
            Some(crate::model_file::load_for(setup, &name, &crate::input::text_of(path)?)?)
        }
        (Some(_), None) => miette::bail!(help = "name it with --setup", "--model is judged on a setup"),
    };
    let mut worst = super::DONE;
    for file in &args.files {
        let verdict = check(file, setup.as_ref(), model.as_ref());
        if json {
            let said = match &verdict {
                Ok(good) => {
                    serde_json::json!({ "file": file, "ok": true, "kind": good.kind, "passes": good.passes })
                }
                Err(e) => serde_json::json!({
                    "file": file, "ok": false, "problem": format!("{e}"), "causes": causes(e),
                    "help": e.help().map(|h| h.to_string()),
                }),
            };
            out!("{said}");
        } else {
            match &verdict {
                Ok(good) => say!("{file}: {}", good.words(setup.as_ref())),
                Err(e) => say!("{file}:\n{e:?}"),
            }
        }
        if verdict.is_err() {
            worst = super::REFUSED;
        }
    }
    super::exit(worst)
}

fn causes(error: &miette::Report) -> Vec<String> {
    error.chain().skip(1).map(ToString::to_string).collect()
}

/// The text of a file, or of what is bundled under that name.
fn text_of(name: &str) -> miette::Result<String> {
    let bundled = || bundled::all().into_iter().find(|b| b.name == name);
    match (Path::new(name).exists(), bundled()) {
        (false, Some(bundled)) => Ok(bundled.text.into()),
        _ => crate::input::text_of(Path::new(name)),
    }
}

/// What kind of file it is, judged by its own first words.
fn kind_of(name: &str) -> miette::Result<&'static str> {
    let ending = Path::new(name).extension().and_then(|e| e.to_str()).unwrap_or_default();
    if ["csv", "parquet"].contains(&ending) {
        return Ok("table");
    }
    let table: toml::Table = parse_toml(name, &text_of(name)?)?;
    let has = |key: &str| table.contains_key(key);
    let kinds = [
        ("profile", has("profile")),
        ("setup", has("amplifier") || has("force") || has("stage")),
        ("plan", has("series") || has("base")),
        ("certificate", has("content_sha256") || has("covariance")),
        ("defects file", has("defect") || has("channel")),
        ("model", has("baseline") || has("design")),
        ("fingertip", has("radius_m") || has("material")),
        ("rig.toml", has("finger") || has("noise") || has("calibration")),
    ];
    let Some((kind, _)) = kinds.into_iter().find(|(_, is)| *is) else {
        miette::bail!(
            help = "a profile has [profile], a setup [amplifier], a plan [base] and [[series]], a fingertip radius_m, a rig.toml [finger], a model \
                    [baseline], defects [[defect]], a certificate content_sha256; a table ends in .csv or .parquet",
            "{name} is none of the files that muprime knows"
        )
    };
    Ok(kind)
}

/// What a file that holds is.
struct Good {
    kind: &'static str,
    /// Passes of a table, and of a plan on a setup.
    passes: Option<usize>,
}

impl Good {
    fn words(&self, setup: Option<&Setup>) -> String {
        match (self.kind, self.passes, setup) {
            ("plan", Some(passes), Some(setup)) => {
                format!("a good plan: {passes} passes on {}", setup.file.name)
            }
            (kind, Some(passes), _) => format!("a good {kind} of {passes} passes"),
            (kind, None, _) => format!("a good {kind}"),
        }
    }
}

/// Whether a file holds, and its kind.
fn check(name: &str, setup: Option<&Setup>, model: Option<&Arc<dyn FrictionModel>>) -> miette::Result<Good> {
    let kind = kind_of(name)?;
    let folder = Path::new(name).parent().unwrap_or(Path::new("."));
    if kind == "table" {
        return table(Path::new(name));
    }
    let text = text_of(name)?;
    match kind {
        "profile" => {
            let told = |problem: String| miette::miette!("{problem}");
            if Path::new(name).exists() {
                crate::rehearsal::of(Path::new(name)).map_err(told)?;
            } else {
                drivers::profile(name).map_err(|e| told(e.to_string()))?;
            }
        }
        "setup" => complete(&Setup::parse(name, &text, folder)?)?,
        "plan" => {
            let plan = Plan::parse(name, &text)?;
            match setup {
                None => {
                    let fine = Resolution { amplitude_pp_m: 0.0, frequency_hz: 0.0 };
                    plan.points(plan.file.seed, &widest(), &fine).wrap_err("no rig may do this")?;
                }
                Some(setup) => {
                    complete(setup)?;
                    let passes = preflight(setup, plan, model)?;
                    return Ok(Good { kind, passes: Some(passes) });
                }
            }
        }
        "certificate" => crate::cli::calibrate::check(name, &text).map(|_| ())?,
        "defects file" => {
            sim::defects::Defects::parse(&text).map_err(|e| miette::miette!("{e}"))?;
        }
        "model" => {
            crate::model_file::load(name, &text)?;
        }
        "fingertip" => {
            parse_toml::<crate::fingertip::FingertipFile>(name, &text)?;
            let tip: FingertipSetup =
                toml::from_str(&format!("tip = {}", toml::Value::from(name))).into_diagnostic()?;
            Fingertip::resolve(&tip, Path::new("")).map_err(|e| miette::miette!("{e}"))?;
        }
        _ => {
            crate::input::rig_file(Path::new(name))?;
        }
    }
    Ok(Good { kind, passes: None })
}

/// A point table, as a diagnosis would take it; one of conditions has no lateral force.
fn table(path: &Path) -> miette::Result<Good> {
    let bytes = bytes_of(path, MAX_TABLE_BYTES)?;
    let passes = if bytes.starts_with(b"PAR1") {
        read_passes(crate::export::parquet_as_csv(path)?.as_bytes())
    } else {
        read_passes(&bytes[..])
    };
    let remedy = "`muprime import` makes a point table of a foreign one";
    let passes = passes.map_err(|e| miette::miette!(help = remedy, "{e}"))?;
    if passes.iter().all(|p| p.lateral_force_n.is_none()) {
        passes.iter().try_for_each(diagnosis::data::check).into_diagnostic()?;
        return Ok(Good { kind: "table of conditions", passes: Some(passes.len()) });
    }
    diagnosis::data::Table::measured(&passes).into_diagnostic()?;
    Ok(Good { kind: "table", passes: Some(passes.len()) })
}

/// What a run asks of a setup beyond what reading it does.
fn complete(setup: &Setup) -> miette::Result<()> {
    setup.has_both_axes().map_err(|problem| miette::miette!("the setup {}: {problem}", setup.origin))
}

/// Everything that a run looks at before it touches rig or folder. Returns the number of passes.
fn preflight(setup: &Setup, plan: Plan, model: Option<&Arc<dyn FrictionModel>>) -> miette::Result<usize> {
    let model = match model {
        Some(model) => Arc::clone(model),
        None => Arc::new(SpringSlider::new(setup.tip.finger).into_diagnostic()?),
    };
    let seed = plan.file.seed;
    let (setup, out) = (setup.clone(), PathBuf::new());
    let job = Job { setup, plan, seed, model, model_file: None, defects: None, out, fast: false };
    Ok(job.points()?.len())
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
