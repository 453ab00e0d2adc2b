//! The run's folder described as a Research Object Crate: `ro-crate-metadata.json` beside its files, by which
//! repositories and search engines read what it holds (RO-Crate 1.3, <https://w3id.org/ro/crate/1.3>). Every
//! file is listed with its size, its SHA-256 and what it is.

use super::facts::Facts;
use calibration::certificate::{date, sha256_hex};
use miette::{Context, IntoDiagnostic};
use runs::{Outcome, RunData};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name of the description, which the format prescribes.
pub const FILE: &str = "ro-crate-metadata.json";
const CONTEXT: &str = "https://w3id.org/ro/crate/1.3/context";
const CONFORMS: &str = "https://w3id.org/ro/crate/1.3";

/// The description, for `place`, which must be [`FILE`] in the run's `folder`.
///
/// # Errors
/// No licence or a text that is none, another place, a run without its date, or a file that cannot be read.
pub fn bytes(folder: &Path, run: &RunData, facts: &Facts, place: &Path) -> miette::Result<Vec<u8>> {
    if place != folder.join(FILE) {
        let (help, place) = ("leave --out away, and copy the folder afterwards", place.display());
        miette::bail!(help = help, "an RO-Crate is described by {FILE} in the folder itself, not by {place}");
    }
    let Some(licence) = facts.get("licence") else {
        miette::bail!(
            help = "give --licence with an SPDX identifier (CC-BY-4.0) or the address of a text; a run states it from the \
                    beginning with `run --licence`",
            "an RO-Crate says under which licence its data are, and the run does not state one"
        );
    };
    let Some(began) = facts.get("date").filter(|date| date.starts_with(|c: char| c.is_ascii_digit())) else {
        miette::bail!("the folder does not say when the run began: {} has no sessions", folder.display());
    };
    let address = runs::job::licence::address_of(licence)?;
    let files = files_of(folder)?;
    let ids: Vec<Value> = files.iter().map(|file| json!({ "@id": file["@id"] })).collect();
    let plan = facts.get("plan").map_or("a plan", String::as_str);
    let mut root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": format!("Friction sweep '{plan}' of {began}"),
        "description": description(run, facts),
        "datePublished": began,
        "license": { "@id": address },
        "hasPart": ids,
        "mentions": { "@id": "#run" },
        "keywords": "friction, ultrasonic lubrication, tribology, haptics",
        "additionalProperty": facts.keys().map(|name| json!({ "@id": id_of(name) })).collect::<Vec<_>>(),
    });
    // RO-Crate 1.3 wants an address of a SoftwareApplication: the project has none yet (packaging/home).
    let muprime = json!({
        "@id": "#muprime", "@type": "Product", "name": "muprime", "version": facts.get("muprime_version"),
    });
    let mut action = json!({
        "@id": "#run", "@type": "CreateAction", "name": format!("Run of '{plan}'"),
        "description": description(run, facts), "startTime": began,
        "instrument": { "@id": "#muprime" }, "result": ids,
    });
    if let Some(ended) = ended(run).filter(|ended| ended.as_str() >= began.as_str()) {
        action["endTime"] = json!(ended);
    }
    // A run that was stopped neither failed nor is complete: the vocabulary has no word for it.
    let status = run.summary.as_ref().and_then(|summary| match summary.outcome {
        Outcome::Complete => Some("Completed"),
        Outcome::Stopped => None,
        _ => Some("Failed"),
    });
    if let Some(status) = status {
        action["actionStatus"] = json!(format!("http://schema.org/{status}ActionStatus"));
    }
    let mut graph = Vec::new();
    if let Some(organisation) = facts.get("organisation") {
        let (id, name) = addressed(organisation, "#organisation");
        let mut whole = json!({ "@id": id, "@type": "Organization", "name": name });
        if id.contains("://") {
            whole["url"] = json!(id);
        }
        graph.push(whole);
        root["publisher"] = json!({ "@id": id });
    }
    if let Some(operator) = facts.get("operator") {
        let (id, name) = addressed(operator, "#operator");
        let mut person = json!({ "@id": id, "@type": "Person", "name": name });
        if let Some(organisation) = facts.get("organisation") {
            person["affiliation"] = json!({ "@id": addressed(organisation, "#organisation").0 });
        }
        graph.push(person);
        root["author"] = json!({ "@id": id });
        action["agent"] = json!({ "@id": id });
    }
    graph.extend(facts.iter().map(
        |(name, value)| json!({ "@id": id_of(name), "@type": "PropertyValue", "name": name, "value": value }),
    ));
    let about = format!("The licence of the data, {licence}");
    graph.push(json!({ "@id": address, "@type": "CreativeWork", "name": licence, "description": about }));
    graph.extend([muprime, action]);
    let descriptor = json!({
        "@id": FILE, "@type": "CreativeWork",
        "conformsTo": { "@id": CONFORMS }, "about": { "@id": "./" },
    });
    let whole: Vec<Value> = [descriptor, root].into_iter().chain(files).chain(graph).collect();
    serde_json::to_vec_pretty(&json!({ "@context": CONTEXT, "@graph": whole })).into_diagnostic()
}

/// When the last event of the record was; in virtual time by the clock of the virtual rig, which begins in
/// 2000.
fn ended(run: &RunData) -> Option<String> {
    let start_s = run.facts.get("start_unix_ns")?.parse::<i64>().ok()? / 1_000_000_000;
    let (last_s, _) = run.events.last()?;
    Some(date::format(start_s + *last_s as i64))
}

/// Address and name of a person or an organisation that is stated as `NAME` or `NAME <ADDRESS>`; of one
/// without an address its name within the crate.
fn addressed<'a>(stated: &'a str, within: &'a str) -> (&'a str, &'a str) {
    match stated.strip_suffix('>').and_then(|rest| rest.split_once('<')) {
        Some((name, address)) => (address.trim(), name.trim()),
        None => (within, stated),
    }
}

/// The name of a fact within the crate.
fn id_of(fact: &str) -> String {
    format!("#fact-{fact}")
}

fn description(run: &RunData, facts: &Facts) -> String {
    let fact = |name: &str| facts.get(name).cloned().unwrap_or_else(|| "not stated".into());
    format!(
        "{} passes of a friction sweep on an ultrasonically vibrating plate. Sample: {}. Setup: {}. Compared with the model {}. \
         Units: {}.",
        run.passes.len(),
        fact("sample"),
        fact("setup"),
        fact("model"),
        fact("units")
    )
}

/// The files of a run's folder, by name, as entities of the crate.
fn files_of(folder: &Path) -> miette::Result<Vec<Value>> {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .into_diagnostic()?
        .map(|entry| entry.map(|e| e.path()).into_diagnostic())
        .collect::<miette::Result<_>>()?;
    paths.sort();
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    paths.retain(|path| path.is_file() && !name(path).starts_with('.') && name(path) != FILE);
    let entity = |path: &PathBuf| {
        let bytes = std::fs::read(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        let name = name(path);
        let (kind, words) = about(&name);
        Ok(json!({
            "@id": name, "@type": "File", "name": name, "description": words, "encodingFormat": kind,
            "contentSize": bytes.len().to_string(), "sha256": sha256_hex(&bytes),
        }))
    };
    paths.iter().map(entity).collect()
}

/// Media type of a file of a run's folder, and what it is.
fn about(name: &str) -> (&'static str, &'static str) {
    match (name, name.rsplit('.').next().unwrap_or_default()) {
        ("points.csv", _) => ("text/csv", "the passes: conditions and mean forces"),
        ("passes.jsonl", _) => ("application/x-ndjson", "the passes with their comparisons"),
        ("sessions.jsonl", _) => ("application/x-ndjson", "sessions of the run"),
        ("rig.toml", _) => ("application/toml", "finger, repeatability and certificates"),
        ("run.toml", _) => ("application/toml", "what the run is of: hashes of setup and plan, seed, model"),
        ("summary.json", _) => ("application/json", "how the run ended"),
        ("report.html", _) => ("text/html", "the report"),
        ("signals.mcap", _) => ("application/x-mcap", "every cycle as flat topics"),
        (_, "mcap") => {
            ("application/x-mcap", "the record of a session: everything that a cycle saw and decided")
        }
        (_, "csv") => ("text/csv", "a table"),
        (_, "json") => ("application/json", "a document"),
        (_, "toml") => ("application/toml", "a description"),
        (_, "html") => ("text/html", "a page"),
        (_, "svg") => ("image/svg+xml", "a figure"),
        (_, "pdf") => ("application/pdf", "a document"),
        (_, "parquet") => ("application/vnd.apache.parquet", "the passes, with units"),
        (_, "arrow") => ("application/vnd.apache.arrow.file", "the passes, with units"),
        (_, "h5") => ("application/x-hdf5", "the passes, with units"),
        _ => ("application/octet-stream", "a file of the run's folder"),
    }
}
