//! What the program itself wrote: tables, records, journals, run folders, verdicts.

use super::place::{self, problems_of, remedy};
use super::{Good, On, judge, kind_of, read_json, shape};
use crate::diagnose::unfit;
use crate::import::{as_csv, remarks};
use crate::schemas::schema::Kind;
use miette::{IntoDiagnostic, WrapErr};
use runs::Summary;
use runs::input::{MAX_TABLE_BYTES, Problems, bytes_of};
use runs::run_dir::RUN_AGAIN;
use runs::sweep::Zeros;
use std::path::Path;

/// A point table, as a diagnosis would take it; one of conditions has no lateral force.
pub(super) fn table(path: &Path) -> miette::Result<Good> {
    let bytes = bytes_of(path, MAX_TABLE_BYTES)?;
    let bytes = as_csv(path, &bytes)?;
    let name = path.display().to_string();
    let text = std::str::from_utf8(&bytes).ok();
    let rows = text.map(runs::model_file::hashed).unwrap_or_default();
    let has = |column: &str| {
        rows.lines().next().is_some_and(|head| head.split([',', ';', '\t']).any(|h| h.trim() == column))
    };
    let good = |kind, passes| Good { kind, passes, remarks: Vec::new() };
    if rows.starts_with("x_m,") {
        let help = "check the plan that names it: muprime check PLAN";
        miette::bail!(help = help, "{name} is a target to render: its plan's loads say what it may hold");
    }
    if let Some(text) = text.filter(|_| has(models::law_table::ANSWERS[0].0) && !has("point")) {
        let loaded = runs::model_file::load(&name, text);
        loaded.map_err(|why| place::with_place_and_help(why, &name, Some("law table")))?;
        return Ok(good("law table", None));
    }
    if has(effects::own::COLUMN) {
        crate::law::own_effects(&[path.to_path_buf()])
            .map_err(|why| place::with_place_and_help(why, &name, Some("effect table")))?;
        return Ok(good("effect table", None));
    }
    let passes = super::cells::passes(&name, &bytes)?;
    if passes.iter().all(|p| p.lateral_force_n.is_none()) {
        return Ok(good("table of conditions", Some(passes.len())));
    }
    diagnosis::data::Table::measured(&passes).map_err(unfit)?;
    Ok(Good { remarks: remarks::of_table(&passes), ..good("table", Some(passes.len())) })
}

/// A record, from its first byte to its last.
pub(super) fn record(path: &Path) -> miette::Result<()> {
    let file = std::fs::File::open(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
    let found = realtime::recorder::inspect(std::io::BufReader::new(file));
    match found.sentences().as_slice() {
        [] => Ok(()),
        found => miette::bail!(help = remedy(Some("record")), "{}: {}", path.display(), found.join("; ")),
    }
}

/// The journals of a run's folder, line by line.
pub(super) fn journal(path: &Path) -> miette::Result<Option<usize>> {
    let text = String::from_utf8(bytes_of(path, MAX_TABLE_BYTES)?).into_diagnostic()?;
    let sessions = path.file_name().is_some_and(|n| n == "sessions.jsonl");
    for (i, line) in text.lines().enumerate() {
        let (what, read) = if sessions {
            ("session", serde_json::from_str::<runs::run_dir::Session>(line).map(drop))
        } else {
            ("pass", serde_json::from_str::<runs::sweep::MeasuredPass>(line).map(drop))
        };
        read.map_err(|e| miette::miette!("{}: line {}: no {what}: {e}", path.display(), i + 1))?;
    }
    Ok((!sessions).then(|| text.lines().count()))
}

/// A run's folder: everything in it that is known, and whether its parts agree.
pub(super) fn run_folder(path: &Path) -> miette::Result<Good> {
    const PARTS: [&str; 6] =
        ["run.toml", "points.csv", "rig.toml", "summary.json", "passes.jsonl", "sessions.jsonl"];
    if !path.join("run.toml").exists() {
        miette::bail!(
            help = "name a folder that `muprime run --out` made; of an imported table check points.csv and rig.toml",
            "{} holds no run: its run.toml is missing",
            path.display()
        );
    }
    let mut passes = 0;
    let (mut problems, mut helps) = (Vec::new(), Vec::new());
    for part in
        PARTS.iter().map(|part| path.join(part)).filter(|part| part.exists() || part.ends_with("rig.toml"))
    {
        let name = part.display().to_string();
        match kind_of(&name).and_then(|kind| judge(kind, &name, &On::default(), None)) {
            Ok(good) => passes = good.passes.unwrap_or(passes),
            // A run that has just begun has too few passes for a diagnosis; its table is checked below.
            Err(_) if part.ends_with("points.csv") => {}
            Err(why) => {
                let named = |p: String| if p.contains(&name) { p } else { format!("{name}: {p}") };
                problems.extend(problems_of(&why).into_iter().map(|p| named(p.problem)));
                helps.push(again(&part));
            }
        }
    }
    let last = runs::run_dir::records_in(path)?.pop().unwrap_or_default();
    let (mut remarks, damage): (Vec<String>, Vec<String>) =
        runs::run_dir::damage_in(path)?.into_iter().partition(|found| is_settled(found, &last));
    helps.extend(damage.iter().map(|damage| {
        let gone = damage.ends_with("is missing");
        match damage.starts_with("run-") {
            true if !gone => {
                "`muprime recover` repairs records; `muprime report` says what a damaged run still tells"
            }
            // The journal has these passes; where both have a value, nothing says which of them was changed.
            false if damage.ends_with("not in points.csv") => again(&path.join("points.csv")),
            _ => again(path),
        }
    }));
    problems.extend(damage);
    if problems.is_empty() {
        let zeros = Summary::written_in(path).map_or_else(Zeros::default, |summary| summary.zeros);
        remarks.extend(runs::run_data::remarks::of_passes(&runs::run_dir::passes_in(path)?, &zeros));
        return Ok(Good { kind: "run", passes: Some(passes), remarks });
    }
    let mut printed = std::collections::BTreeSet::new();
    helps.retain(|help| printed.insert(*help));
    Err(miette::miette!(help = helps.join("; "), "{}", problems.join("; ")))
}

/// Whether nothing is left to do about a finding: its record was made whole, or is that of a session that was
/// killed and taken up by another one.
fn is_settled(found: &str, last: &Path) -> bool {
    let of_last = last.file_name().is_some_and(|last| found.starts_with(&*last.to_string_lossy()));
    found.contains("was made whole by") || found.contains("the record is cut") && !of_last
}

/// What to do about a part of a run's folder that is damaged.
fn again(part: &Path) -> &'static str {
    match part.file_name().and_then(|name| name.to_str()) {
        Some("summary.json" | "points.csv") => RUN_AGAIN,
        Some("rig.toml") if !part.exists() => RUN_AGAIN,
        _ => "take the file from a copy of the folder: it was cut or changed after it was written",
    }
}

/// A verdict as `diagnose --json` prints it.
pub(super) fn verdict(name: &str) -> miette::Result<()> {
    let document = read_json(name)?;
    let text = runs::input::text_of(Path::new(name))?;
    let mut wrong = Problems::of(name, &text);
    if document["schema"] != "muprime.verdict/1" {
        let problem = format!("its schema is {}; this version reads muprime.verdict/1", document["schema"]);
        let remedy = "diagnose the data again with this version".to_string();
        wrong.add_at(text.find("\"schema\"").map(|at| at..at), problem, remedy);
    }
    shape::json(&Kind::Verdict.schema(), &document, &mut wrong);
    let probabilities = document["hypotheses"].as_array().into_iter().flatten();
    let sum: f64 = probabilities.filter_map(|h| h["probability"].as_f64()).sum();
    if wrong.is_empty() && (sum - 1.0).abs() > 1e-6 {
        let place = text.find("\"hypotheses\"").map(|at| at..at);
        wrong.add_at(place, format!("the probabilities of its hypotheses sum to {sum}, not to 1"), None);
    }
    wrong.end()
}

#[cfg(test)]
mod tests {
    /// It named the tool and the columns of a point table.
    #[test]
    fn a_faulty_law_table_is_helped_as_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("law.csv");
        let row = "2e-7,0.01,0.6,0.001\n";
        std::fs::write(&path, format!("amplitude_pp_m,speed_m_s,mu_relative,mu_relative_sd\n{row}{row}"))
            .unwrap();
        let why = super::table(&path).err().unwrap();
        let problem = super::problems_of(&why).remove(0);
        let help = problem.help.unwrap_or_default();
        assert!(problem.line == Some(1) && help.contains("own-law.md"), "{why:?}");
    }

    /// It was helped as a point table.
    #[test]
    fn a_faulty_effect_table_is_helped_as_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sweat.csv");
        for (text, line) in [
            ("# place: skin\nspeed_m_s,friction_change\n0.005,0\n", 1),
            ("speed_m_s,friction_change\n0.005,0\n0.005,0.2\n", 1),
            ("# c\nspeed_m_s;friction_change\n0,005;0\n", 2),
        ] {
            std::fs::write(&path, text).unwrap();
            let problem = super::problems_of(&super::table(&path).err().unwrap()).remove(0);
            let help = problem.help.unwrap_or_default();
            assert!(
                problem.line == Some(line) && help.contains("own-law.md") && !help.contains("import"),
                "{help}"
            );
        }
    }
}
