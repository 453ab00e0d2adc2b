//! The run's folder described as a Research Object Crate: `ro-crate-metadata.json` beside its files, by which
//! repositories and search engines read what it holds (RO-Crate 1.1, <https://w3id.org/ro/crate/1.1>). Every
//! file is listed with its size, its SHA-256 and what it is.

use super::facts::Facts;
use calibration::certificate::sha256_hex;
use miette::{Context, IntoDiagnostic};
use runs::report::RunData;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Name of the description, which the format prescribes.
pub const FILE: &str = "ro-crate-metadata.json";
const CONTEXT: &str = "https://w3id.org/ro/crate/1.1/context";
const CONFORMS: &str = "https://w3id.org/ro/crate/1.1";

/// The description, for `place`, which must be [`FILE`] in the run's `folder`.
///
/// # Errors
/// No licence, another place, a run without its date, or a file that cannot be read.
pub fn bytes(folder: &Path, run: &RunData, facts: &Facts, place: &Path) -> miette::Result<Vec<u8>> {
    if place != folder.join(FILE) {
        miette::bail!(
            help = "leave --out away, and copy the folder afterwards",
            "an RO-Crate is described by {FILE} in the folder itself, not by {}",
            place.display()
        );
    }
    let Some(licence) = facts.get("licence") else {
        miette::bail!(
            help = "give --licence with an SPDX identifier (CC-BY-4.0) or the address of a text; a run states it from the \
                    beginning with `run --licence`",
            "an RO-Crate says under which licence its data are, and the run does not state one"
        );
    };
    let Some(date) = facts.get("date").filter(|date| date.starts_with(|c: char| c.is_ascii_digit())) else {
        miette::bail!("the folder does not say when the run began: {} has no sessions", folder.display());
    };
    let address = address_of(licence);
    let files = files_of(folder)?;
    let ids: Vec<Value> = files.iter().map(|file| json!({ "@id": file["@id"] })).collect();
    let plan = facts.get("plan").map_or("a plan", String::as_str);
    let mut root = json!({
        "@id": "./",
        "@type": "Dataset",
        "name": format!("Friction sweep '{plan}' of {date}"),
        "description": description(run, facts),
        "datePublished": date,
        "license": { "@id": address },
        "hasPart": ids,
        "mentions": { "@id": "#run" },
        "keywords": "friction, ultrasonic lubrication, tribology, haptics",
        "additionalProperty": facts.keys().map(|name| json!({ "@id": id_of(name) })).collect::<Vec<_>>(),
    });
    let muprime = json!({
        "@id": "#muprime", "@type": "SoftwareApplication", "name": "muprime",
        "softwareVersion": facts.get("muprime_version"),
    });
    let mut action = json!({
        "@id": "#run", "@type": "CreateAction", "name": format!("Run of '{plan}'"),
        "startTime": date, "instrument": { "@id": "#muprime" }, "result": ids,
    });
    let mut graph = Vec::new();
    if let Some(organisation) = facts.get("organisation") {
        let (id, name) = organisation_of(organisation);
        let mut whole = json!({ "@id": id, "@type": "Organization", "name": name });
        if id.contains("://") {
            whole["url"] = json!(id);
        }
        graph.push(whole);
        root["publisher"] = json!({ "@id": id });
    }
    if let Some(operator) = facts.get("operator") {
        let mut person = json!({ "@id": "#operator", "@type": "Person", "name": operator });
        if let Some(organisation) = facts.get("organisation") {
            person["affiliation"] = json!({ "@id": organisation_of(organisation).0 });
        }
        graph.push(person);
        root["author"] = json!({ "@id": "#operator" });
        action["agent"] = json!({ "@id": "#operator" });
    }
    graph.extend(facts.iter().map(
        |(name, value)| json!({ "@id": id_of(name), "@type": "PropertyValue", "name": name, "value": value }),
    ));
    graph.push(json!({ "@id": address, "@type": "CreativeWork", "name": licence }));
    graph.extend([muprime, action]);
    let descriptor = json!({
        "@id": FILE, "@type": "CreativeWork",
        "conformsTo": { "@id": CONFORMS }, "about": { "@id": "./" },
    });
    let whole: Vec<Value> = [descriptor, root].into_iter().chain(files).chain(graph).collect();
    // The vocabulary of RO-Crate 1.1 is older than schema.org's word for the checksum.
    let context = json!([CONTEXT, { "sha256": "https://schema.org/sha256" }]);
    serde_json::to_vec_pretty(&json!({ "@context": context, "@graph": whole })).into_diagnostic()
}

/// Address and name of an organisation that is stated as `NAME` or `NAME <ADDRESS>`.
fn organisation_of(stated: &str) -> (&str, &str) {
    match stated.strip_suffix('>').and_then(|rest| rest.split_once('<')) {
        Some((name, address)) => (address.trim(), name.trim()),
        None => ("#organisation", stated),
    }
}

/// The name of a fact within the crate.
fn id_of(fact: &str) -> String {
    format!("#fact-{fact}")
}

/// The address of a licence: of an SPDX identifier its page, of an address itself.
fn address_of(licence: &str) -> String {
    if licence.contains("://") { licence.into() } else { format!("https://spdx.org/licenses/{licence}") }
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
    paths
        .iter()
        .map(|path| {
            let bytes = std::fs::read(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
            let name = name(path);
            let (kind, words) = about(&name);
            Ok(json!({
                "@id": name, "@type": "File", "name": name, "description": words, "encodingFormat": kind,
                "contentSize": bytes.len().to_string(), "sha256": sha256_hex(&bytes),
            }))
        })
        .collect()
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
