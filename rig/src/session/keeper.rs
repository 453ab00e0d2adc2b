//! Keeps what a sweep yields: record, point table, catalogue. It runs beside the loop and may touch files.
#![allow(clippy::disallowed_methods, reason = "a run says when it began")]

use super::{Job, News, Summary};
use crate::catalogue::{Catalogue, RunEntry};
use crate::run_dir::RunDir;
use crate::sequence::{Event, MeasuredPass, Outcome};
use crate::supervisor::OffReport;
use miette::{IntoDiagnostic, WrapErr};
use models::finger::Finger;
use realtime::cycle::Config;
use realtime::pacing::LoopReport;
use realtime::ports::Nanos;
use realtime::recorder::Preamble;
use realtime::witness::StallReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

/// Name of the file in a record that a replay needs.
pub const REPLAYABLE: &str = "loop.json";

/// What the loop was built from, so that its rows can be run again; the model is that of the finger where the record holds
/// no model file.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Replayable {
    /// Limits, timing, estimate.
    pub config: Config,
    /// The finger of the baseline model.
    pub finger: Finger,
}

/// The open files of a run.
pub struct Keeper {
    dir: RunDir,
    catalogue: Catalogue,
    folder: String,
    passes: usize,
    planned: usize,
    departed: bool,
}

/// The wall clock, in ns since 1970.
pub fn unix_ns() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64)
}

/// What goes first into the record of a job.
pub fn preamble(job: &Job, start_unix_ns: u64) -> miette::Result<Preamble> {
    let identity = job.identity();
    let facts = [
        ("muprime_version", env!("CARGO_PKG_VERSION").to_string()),
        ("setup", job.setup.file.name.clone()),
        ("setup_sha256", identity.setup_sha256),
        ("plan", job.plan.file.name.clone()),
        ("plan_sha256", identity.plan_sha256),
        ("seed", identity.seed.to_string()),
        ("model", job.model.name().to_string()),
        ("model_identity", identity.model),
        ("fingertip", job.setup.tip.name.clone()),
        ("clock", if job.fast { "virtual" } else { "monotonic" }.to_string()),
        ("start_unix_ns", start_unix_ns.to_string()),
        ("amplitude_convention", "w is peak-to-peak everywhere".to_string()),
    ];
    let mut files = vec![
        ("setup.toml".to_string(), job.setup.text.clone()),
        ("plan.toml".to_string(), job.plan.text.clone()),
        ("rig.toml".to_string(), job.setup.rig_file().to_toml().into_diagnostic()?),
    ];
    let replayed = Replayable { config: job.setup.config, finger: job.setup.tip.finger };
    files.push((REPLAYABLE.to_string(), serde_json::to_string_pretty(&replayed).into_diagnostic()?));
    files.extend(job.model_file.clone());
    files.extend(job.setup.certificates.files.iter().cloned());
    for (id, text) in job
        .setup
        .instruments()
        .all()
        .filter_map(|i| drivers::bundled::text(&i.profile).map(|text| (i.profile.clone(), text)))
    {
        files.push((format!("profiles/{id}.toml"), text.to_string()));
    }
    let facts = facts.into_iter().map(|(k, v)| (k.to_string(), v)).collect();
    Ok(Preamble { start_unix_ns, facts, files })
}

impl Keeper {
    /// Opens the catalogue and enters the run.
    ///
    /// # Errors
    /// Whatever file system and SQLite say.
    pub fn begin(job: &Job, dir: RunDir, planned: usize, start_unix_ns: u64) -> miette::Result<Self> {
        dir.write("rig.toml", job.setup.rig_file().to_toml().into_diagnostic()?.as_bytes())?;
        let runs = dir
            .path()
            .parent()
            .filter(|p| !p.as_os_str().is_empty())
            .map_or_else(|| std::path::PathBuf::from("."), std::path::Path::to_path_buf);
        let catalogue = Catalogue::open(&runs)?;
        let folder = dir.path().file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let passes = dir.made.len();
        catalogue.begin(&RunEntry {
            folder: folder.clone(),
            plan: job.plan.file.name.clone(),
            setup: job.setup.file.name.clone(),
            started_unix_s: start_unix_ns as f64 * 1e-9,
            outcome: String::new(),
            passes: passes as i64,
            planned: planned as i64,
            departed: false,
        })?;
        Ok(Keeper { dir, catalogue, folder, passes, planned, departed: false })
    }

    /// Keeps what a row led to and passes it on. Returns the pass, once it is safe.
    ///
    /// # Errors
    /// Whatever file system and SQLite say: the sweep must stop then.
    pub fn keep(
        &mut self,
        events: &[Event],
        pass: Option<&MeasuredPass>,
        news: &mut dyn FnMut(News<'_>),
    ) -> miette::Result<()> {
        for event in events {
            self.departed |= matches!(event, Event::ModelDeparted { .. });
            news(News::Event(event));
        }
        if let Some(pass) = pass {
            self.dir.keep(pass)?;
            self.passes += 1;
            self.catalogue.progress(&self.folder, self.passes as i64, self.departed)?;
            news(News::Pass(pass));
        }
        Ok(())
    }

    /// Ends the run: catalogue, summary, report. What cannot be written is said, and makes a sweep that went well one whose
    /// record is lost; the summary is returned all the same.
    pub fn end(
        self,
        outcome: Outcome,
        departed: bool,
        machine: Option<(LoopReport, StallReport)>,
        record_lost: u64,
        links: BTreeMap<String, serde_json::Value>,
        off: OffReport,
    ) -> Summary {
        let (loop_report, stalls) = machine.unzip();
        let mut summary = Summary {
            outcome,
            folder: self.dir.path().to_path_buf(),
            passes: self.passes,
            planned: self.planned,
            model_departed: departed,
            loop_report,
            stalls,
            record_lost,
            links,
            off,
        };
        if let Err(why) = self.write_end(&summary) {
            tracing::error!("the end of the run could not be kept: {why:#}");
            if matches!(summary.outcome, Outcome::Complete | Outcome::Stopped) {
                summary.outcome = Outcome::RecordLost;
            }
        }
        summary
    }

    fn write_end(&self, summary: &Summary) -> miette::Result<()> {
        let word = serde_json::to_value(&summary.outcome).into_diagnostic()?;
        let word = word.get("outcome").and_then(|o| o.as_str()).unwrap_or("?").to_string();
        self.catalogue.progress(&self.folder, self.passes as i64, summary.model_departed)?;
        self.catalogue.end(&self.folder, &word)?;
        let text = serde_json::to_vec_pretty(summary).into_diagnostic()?;
        self.dir.write("summary.json", &text).wrap_err("the summary")?;
        let html = crate::report::html(self.dir.path()).wrap_err("the report")?;
        self.dir.write("report.html", html.as_bytes()).wrap_err("the report")
    }

    /// A new record file of the run.
    ///
    /// # Errors
    /// Whatever the file system says.
    pub fn new_record(&self) -> miette::Result<std::fs::File> {
        self.dir.new_record()
    }
}

/// Writes what a row led to into a record.
///
/// # Errors
/// Whatever the file says.
pub fn record<W: std::io::Write>(
    recorder: &mut realtime::recorder::Recorder<W>,
    at: Nanos,
    events: &[crate::sequence::Event],
    pass: Option<&MeasuredPass>,
) -> miette::Result<()> {
    for event in events {
        recorder.event(at, event).into_diagnostic()?;
    }
    if let Some(pass) = pass {
        recorder.pass(at, pass).into_diagnostic()?;
    }
    Ok(())
}
