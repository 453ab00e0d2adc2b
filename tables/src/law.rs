//! A friction law by name or from a file, CSV and Parquet alike; a law that was tabulated, as the file that
//! is written.

use crate::import::{as_csv, is_parquet};
use calibration::certificate::sha256_hex;
use miette::{Context, IntoDiagnostic};
use models::law::{BuiltIn, Named};
use models::law_table::grid::Tabulated;
use models::law_table::{OF_LAWS, VARIABLES, Variable};
use models::pass::{Pass, coulomb_coefficient};
use models::{Finger, FrictionModel};
use runs::Setup;
use runs::input::bytes_of;
use runs::job::model_name;
use runs::model_file::{HASH_MARK, built_in, hashed, law, load_for};
use std::path::Path;
use std::sync::Arc;

/// Largest file of a law in bytes.
const MOST_BYTES: u64 = 1 << 28;

/// A law that is ready.
pub struct Loaded {
    /// The law.
    pub model: Arc<dyn FrictionModel>,
    /// Its name in a record and its text; none for a built-in law.
    pub file: Option<(String, String)>,
}

/// The law that `--model` names, for a run of this setup.
///
/// # Errors
/// A file that cannot be read or used: says where, and what to type.
pub fn for_run(what: &Path, setup: &Setup) -> miette::Result<Loaded> {
    named(what, &setup.tip.finger, |shown, name, text| {
        let model = load_for(setup, shown, &text)?;
        Ok(Loaded { model, file: Some((model_name(&name, &text), text)) })
    })
}

/// The law that `--model` names, as the base of a diagnosis.
///
/// # Errors
/// As [`for_run`].
pub fn for_finger(what: &Path, finger: &Finger) -> miette::Result<Loaded> {
    named(what, finger, |shown, name, text| of_text(shown, name, text, finger))
}

/// A built-in law, or the file as `loads` takes it: how messages call it, its name and its text.
fn named(
    what: &Path,
    finger: &Finger,
    loads: impl FnOnce(&str, String, String) -> miette::Result<Loaded>,
) -> miette::Result<Loaded> {
    let shown = what.to_string_lossy();
    if let Some(model) = built_in(&shown, finger) {
        return Ok(Loaded { model: model?, file: None });
    }
    let (name, text) = text_of(what)?;
    loads(&shown, name, text)
}

/// A law from its text, as the base of a diagnosis; `shown` is how messages call it.
///
/// # Errors
/// As [`for_run`].
pub fn of_text(shown: &str, name: String, text: String, finger: &Finger) -> miette::Result<Loaded> {
    let mut model = law(finger, shown, &text)?;
    if model.sha256().is_none() {
        // A corrected model may itself be corrected: it is known by the hash of its file.
        let sha256 = sha256_hex(text.as_bytes());
        model = Arc::new(Named { name: model.name().to_string(), law: model, sha256 });
    }
    Ok(Loaded { model, file: Some((name, text)) })
}

/// A law's file name and its text; Parquet as CSV.
fn text_of(path: &Path) -> miette::Result<(String, String)> {
    let bytes = bytes_of(path, MOST_BYTES).map_err(|e| {
        let files = "the path of a ridge table, a law table, a surrogate.json or a MODEL.toml";
        miette::miette!(help = format!("--model takes {}, or {files}", BuiltIn::names()), "{e}")
    })?;
    let name = path.file_name().map_or_else(|| "law".into(), |n| n.to_string_lossy());
    let name = if is_parquet(&bytes) { format!("{name}.csv") } else { name.into_owned() };
    let text = String::from_utf8(as_csv(path, &bytes)?.into_owned()).into_diagnostic();
    Ok((name, text.wrap_err_with(|| format!("{}: no text", path.display()))?))
}

/// The candidate effects of the user's own in these files, by their numbers; the name of each is that of its file.
///
/// # Errors
/// A file that cannot be read or is no table of an effect: says where, and what to do.
pub fn own_effects(files: &[std::path::PathBuf]) -> miette::Result<Vec<usize>> {
    let one = |path: &std::path::PathBuf| {
        let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
        let text = text_of(path)
            .map_err(|why| miette::miette!(help = "--effect takes a CSV or Parquet file", "{why}"))?
            .1;
        let number =
            effects::own(&name, &text).map_err(|why| miette::miette!("{}: {why}", path.display()))?;
        Ok((name, number))
    };
    let all: Vec<(String, usize)> = files.iter().map(one).collect::<miette::Result<_>>()?;
    for (k, (name, number)) in all.iter().enumerate() {
        if let Some(other) = all[..k].iter().position(|(n, of)| n == name && of != number) {
            let (files, help) = (
                [other, k].map(|k| files[k].display()),
                "rename one: each file's name is that of its effect",
            );
            miette::bail!(help = help, "{} and {} differ and are both '{name}'", files[0], files[1]);
        }
    }
    let mut numbers: Vec<usize> = all.into_iter().map(|(_, number)| number).collect();
    numbers.sort_unstable();
    numbers.dedup();
    Ok(numbers)
}

/// The file of a law that was tabulated, and the hash of its rows; `origin` says of what it was made.
///
/// # Errors
/// An interpolation error above `tolerance`: says where, and what to do.
pub fn file_of(made: &Tabulated, origin: &str, tolerance: f64) -> miette::Result<(String, String)> {
    let Tabulated { csv, greatest, place, rms, checks } = made;
    // An error that is not a number is above any tolerance.
    if greatest.partial_cmp(&tolerance).is_none_or(std::cmp::Ordering::is_gt) {
        miette::bail!(
            help = "give the grid more nodes there, or equal ratios (:log); to take the table as it is, raise the tolerance",
            "the table differs from a fresh call by {greatest:.4} of mu' at {place}; the tolerance is {tolerance}"
        );
    }
    let sha256 = sha256_hex(hashed(csv).as_bytes());
    let origin: String = origin.split_whitespace().collect::<Vec<_>>().join(" ");
    let text = format!(
        "# muprime.law/1, made by muprime {}\n# origin: {origin}\n# interpolation error in mu': greatest {greatest:.2e} at {place}; \
         rms {rms:.2e} over {checks} fresh calls, in mu_relative_sd\n{HASH_MARK}{sha256}\n{csv}",
        env!("CARGO_PKG_VERSION")
    );
    Ok((text, sha256))
}

/// Nodes of an amplitude, of a speed, of another variable, and of mu_0.
const NODES: [usize; 4] = [17, 9, 5, 3];
/// Share by which a grid goes beyond a table, and beyond its mu_0.
const BEYOND: [f64; 2] = [0.02, 0.2];

/// A grid over the passes of a table for the variables of these names, in equal ratios.
///
/// # Errors
/// A name that is no variable, a table without what it takes.
pub fn grid_over(passes: &[Pass], names: &[String]) -> miette::Result<Vec<(String, Vec<f64>)>> {
    let mu0 = coulomb_coefficient(passes).unwrap_or(0.5);
    let one = |name: &String| {
        let variable = Variable::by_name(name).ok_or_else(|| {
            let names = VARIABLES[..OF_LAWS].iter().map(|v| v.name).collect::<Vec<_>>().join(", ");
            miette::miette!(help = format!("name its arguments {names}"), "a law has no variable '{name}'")
        })?;
        let values = passes.iter().map(|p| variable.of(&p.condition(mu0))).filter(|v| *v > 0.0);
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(v), b.max(v)));
        if low > high {
            miette::bail!("no pass of the table has a '{name}' above zero");
        }
        let (count, beyond) = match name.as_str() {
            "amplitude_pp_m" => (NODES[0], BEYOND[0]),
            "speed_m_s" => (NODES[1], BEYOND[0]),
            "mu0" => (NODES[3], BEYOND[1]),
            _ => (NODES[2], BEYOND[0]),
        };
        let (low, high) = (low / (1.0 + beyond), high * (1.0 + beyond));
        let node = |i: usize| low * (high / low).powf(i as f64 / (count - 1) as f64);
        Ok((name.clone(), (0..count).map(node).collect()))
    };
    names.iter().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::own_effects;

    #[test]
    fn two_effects_of_one_name_are_refused_with_both_files() {
        let folder = tempfile::tempdir().unwrap();
        let file = |part: &str, change: f64| {
            let path = folder.path().join(part).join("twin.csv");
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, format!("speed_m_s,friction_change\n0.005,0\n0.08,{change}\n")).unwrap();
            path
        };
        let [a, b, same] = [file("a", 0.3), file("b", 0.4), file("c", 0.3)];
        assert_eq!(own_effects(&[a.clone(), same, a.clone()]).unwrap().len(), 1);
        let why = own_effects(&[a.clone(), b.clone()]).unwrap_err();
        let (why, help) = (why.to_string(), why.help().unwrap().to_string());
        assert!(why.contains(&a.display().to_string()) && why.contains(&b.display().to_string()), "{why}");
        assert!(why.contains("'twin'") && help.contains("rename"), "{why} {help}");
    }
}
