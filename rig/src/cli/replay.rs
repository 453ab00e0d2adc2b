//! `muprime replay`: a recorded run through the same cycle again.

use crate::run_dir::records_in;
use crate::session::{REPLAYABLE, Replayable};
use miette::{IntoDiagnostic, WrapErr};
use models::prediction::{FrictionModel, SpringSlider};
use realtime::recorder::{CYCLES, Entry, Reader};
use realtime::replay::{Replay, replay};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;

/// Arguments.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of a run, or one of its records
    run: PathBuf,
}

/// Runs every cycle of every record of a run again, and compares its decisions with those recorded, bit for bit.
///
/// # Errors
/// A record that cannot be read, or that lacks what a replay needs.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    let records = if args.run.is_dir() { records_in(&args.run)? } else { vec![args.run.clone()] };
    if records.is_empty() {
        miette::bail!("{} holds no record", args.run.display());
    }
    let mut holds = true;
    for path in records {
        let found = again(&path)?;
        holds &= found.holds();
        if json {
            println!("{}", serde_json::json!({ "record": path, "replay": found, "holds": found.holds() }));
        } else {
            say(&path, &found);
        }
    }
    super::exit(if holds { super::DONE } else { super::FAILED })
}

fn say(path: &Path, found: &Replay) {
    let Replay { cycles, equal, missing, first_difference } = found;
    println!("{}: {equal} of {cycles} cycles decide as recorded", path.display());
    if *missing > 0 {
        println!(
            "  {missing} cycles are missing from the record: what follows them cannot be expected to agree"
        );
    }
    if let Some(cycle) = first_difference {
        println!("  the first that differs is cycle {cycle}");
    }
}

fn again(path: &Path) -> miette::Result<Replay> {
    let entries = || {
        let file = File::open(path).into_diagnostic().wrap_err_with(|| path.display().to_string())?;
        Ok::<_, miette::Report>(Reader::new(BufReader::new(file)).only(CYCLES))
    };
    // The files come first: what follows the first row holds none.
    let files: Vec<(String, Vec<u8>)> = entries()?
        .take_while(|entry| !matches!(entry, Entry::Message { .. }))
        .filter_map(|entry| if let Entry::File { name, bytes } = entry { Some((name, bytes)) } else { None })
        .collect();
    let Some((_, built)) = files.iter().find(|f| f.0 == REPLAYABLE) else {
        miette::bail!("{}: the record holds no {REPLAYABLE}, which a replay needs", path.display());
    };
    let built: Replayable = serde_json::from_slice(built)
        .into_diagnostic()
        .wrap_err_with(|| format!("{REPLAYABLE} in {}", path.display()))?;
    let model = model_of(&files, &built)?;
    let rows = entries()?.filter_map(|entry| {
        let Entry::Message { text, .. } = entry else { return None };
        serde_json::from_slice(&text).ok()
    });
    Ok(replay(&built.config, &*model, rows))
}

fn model_of(files: &[(String, Vec<u8>)], built: &Replayable) -> miette::Result<Arc<dyn FrictionModel>> {
    match files.iter().find(|f| f.0 == "model.toml") {
        Some((name, text)) => crate::model_file::load(name, &String::from_utf8_lossy(text)),
        None => Ok(Arc::new(SpringSlider::new(built.finger).into_diagnostic()?)),
    }
}
