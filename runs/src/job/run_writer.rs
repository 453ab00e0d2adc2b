//! Writes what a sweep yields: record, point table, summary, report. It runs beside the loop, so it may touch
//! files; its errors are theirs.
#![allow(clippy::disallowed_methods, reason = "a run says when it began")]

use super::{Job, Notes, Summary, Unfinished, Update};
use crate::ambient::levels_of;
use crate::files::GuardedFile;
use crate::run_data::remarks::Remarked;
use crate::run_dir::{RunDir, SUMMARY};
use crate::setup::Guards;
use crate::supervisor::OffReport;
use crate::sweep::{Event, MeasuredPass, Outcome, ZeroLevels, Zeros};
use miette::{IntoDiagnostic, WrapErr};
use models::{BuiltIn, Finger, FrictionModel};
use realtime::clock::HeldBack;
use realtime::compare::Agreement;
use realtime::cycle::Config;
use realtime::pacing::LoopReport;
use realtime::recorder::Preamble;
use realtime::stall_monitor::StallReport;
use realtime::{Nanos, TripCause};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::{SystemTime, UNIX_EPOCH};

/// Name of the file in a record that a replay needs.
pub const REPLAYABLE: &str = "loop.json";

/// Name of the file in a record that holds the target that was rendered.
pub const TARGET: &str = "target.json";

/// Name in a record of the model file that led the run: a corrected model, or a law's file.
pub fn model_name(file: &str, text: &str) -> String {
    if crate::model_file::is_corrected(text) { "model.toml".to_string() } else { format!("law/{file}") }
}

/// Whether a file of a record is the model file.
pub fn is_model(name: &str) -> bool {
    name == "model.toml" || name.starts_with("law/")
}

/// What the loop was built from, so that its rows can be run again; the model is that of the finger where the
/// record holds no model file.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Replayable {
    /// Limits, timing, estimate.
    pub config: Config,
    /// The finger of the baseline model.
    pub finger: Finger,
    /// The built-in law that led the run; none: the spring-slider, or the record's model file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub law: Option<BuiltIn>,
    /// -3 dB bandwidth of the lateral channel's filter in Hz, where its profile states one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lateral_passband_hz: Option<f64>,
}

/// The open files of a run.
pub struct RunWriter {
    dir: RunDir,
    passes: usize,
    planned: usize,
    protocol: BTreeMap<String, toml::Value>,
    guards: Guards,
    zeros: Zeros,
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
    let law = BuiltIn::by_name(job.model.name());
    let law = law.filter(|law| job.model_file.is_none() && *law != BuiltIn::SpringSlider);
    let (config, finger, lateral_passband_hz) =
        (job.setup.config, job.setup.tip.finger, job.setup.lateral_passband_hz());
    let replayed = Replayable { config, finger, law, lateral_passband_hz };
    files.push((REPLAYABLE.to_string(), serde_json::to_string_pretty(&replayed).into_diagnostic()?));
    if let Some(target) = job.model.target() {
        files.push((TARGET.to_string(), serde_json::to_string(target).into_diagnostic()?));
        let stated = serde_json::to_string(&job.stated()?).into_diagnostic()?;
        files.push((crate::fidelity::STATED.to_string(), stated));
    }
    files.extend(job.model_file.clone());
    files.extend(job.setup.certificates.files.iter().cloned());
    files.extend(job.setup.profiles().into_iter().map(|(name, text)| (format!("profiles/{name}"), text)));
    let Notes { operator, subject, sample, licence } = &job.notes;
    let notes = [("operator", operator), ("subject", subject), ("sample", sample), ("licence", licence)];
    let notes = notes.into_iter().filter_map(|(k, v)| Some((k, v.clone()?)));
    let base = job.model.base();
    let hash = |law: &dyn FrictionModel| law.sha256().map(String::from);
    let laws = [
        ("model_sha256", hash(&*job.model)),
        ("base_law", base.map(|law| law.name().to_string())),
        ("base_law_sha256", base.and_then(hash)),
    ];
    let laws = laws.into_iter().filter_map(|(k, v)| Some((k, v?)));
    let facts = facts.into_iter().chain(laws).chain(job.setup.guards().facts()).chain(notes);
    let words = |value: &toml::Value| value.as_str().map_or_else(|| value.to_string(), String::from);
    let protocol = identity.protocol.iter().map(|(key, value)| (format!("protocol.{key}"), words(value)));
    let facts = facts.map(|(k, v)| (k.to_string(), v)).chain(protocol).collect();
    Ok(Preamble { start_unix_ns, facts, files })
}

fn write_rig(job: &Job, dir: &RunDir) -> miette::Result<()> {
    dir.write("rig.toml", job.setup.rig_file().to_toml().into_diagnostic()?.as_bytes())
}

impl RunWriter {
    /// Begins a session of the run.
    pub fn begin(job: &Job, mut dir: RunDir, planned: usize) -> miette::Result<Self> {
        dir.begin().and_then(|()| Self::of(job, dir, planned)).wrap_err(Unfinished::NotSaved)
    }

    /// The end of a run whose passes were all made in earlier sessions: nothing is driven. What an earlier
    /// session wrote at its end stays; where none came so far, it is written now.
    pub fn finish(
        job: &Job,
        mut dir: RunDir,
        planned: usize,
        agreement: Agreement,
    ) -> miette::Result<Summary> {
        dir.stay();
        if !dir.path().join("rig.toml").exists() {
            write_rig(job, &dir)?;
        }
        if let Some(summary) =
            Summary::written_in(dir.path()).filter(|s| s.outcome == Outcome::Complete && s.passes == planned)
        {
            return Ok(Summary { folder: dir.path().to_path_buf(), finished_before: true, ..summary });
        }
        let writer = Self::of(job, dir, planned).wrap_err(Unfinished::NotSaved)?;
        Ok(Summary {
            finished_before: true,
            ..writer.end(Outcome::Complete, agreement, None, 0, BTreeMap::new(), OffReport::off())
        })
    }

    fn of(job: &Job, dir: RunDir, planned: usize) -> miette::Result<Self> {
        write_rig(job, &dir)?;
        let (passes, protocol, guards) = (dir.made.len(), job.plan.protocol(), job.setup.guards());
        Ok(RunWriter { dir, passes, planned, protocol, guards, zeros: Zeros::default() })
    }

    /// Keeps what a row led to and passes it on. Returns the pass, once it is safe.
    ///
    /// # Errors
    /// Whatever the file system says: the sweep must stop then. Passes that come until it has stopped may
    /// still be given here: they are written where they can be.
    pub fn save(
        &mut self,
        events: &[Event],
        pass: Option<&MeasuredPass>,
        update: &mut dyn FnMut(Update<'_>),
    ) -> miette::Result<()> {
        for event in events {
            if let Event::Zeros { lateral_n, normal_n, after, .. } = *event {
                let zero = ZeroLevels { lateral_n, normal_n };
                *(if after { &mut self.zeros.after } else { &mut self.zeros.before }) = Some(zero);
            }
            update(Update::Event(event));
        }
        if let Some(pass) = pass {
            self.dir.keep(pass)?;
            self.passes += 1;
            update(Update::Pass(pass));
        }
        Ok(())
    }

    /// Ends the run: summary, report. What cannot be written is logged, and makes a sweep that went well one
    /// whose record is lost; the summary is returned all the same.
    pub fn end(
        self,
        outcome: Outcome,
        agreement: Agreement,
        machine: Option<(LoopReport, StallReport, Option<HeldBack>)>,
        record_lost: u64,
        links: BTreeMap<String, serde_json::Value>,
        off: OffReport,
    ) -> Summary {
        let (loop_report, stalls, held) =
            machine.map_or((None, None, None), |(report, stalls, held)| (Some(report), Some(stalls), held));
        // As far as they can be read: the rest is reported below.
        let passes = crate::run_dir::passes_in(self.dir.path()).unwrap_or_default();
        let rig = crate::input::rig_file(&self.dir.path().join("rig.toml")).ok();
        let mut summary = Summary {
            requirement: outcome.cause().and_then(TripCause::requirement).map(String::from),
            remedy: outcome.remedy().map(String::from),
            outcome,
            folder: self.dir.path().to_path_buf(),
            passes: self.passes,
            planned: self.planned,
            model_departed: agreement == Agreement::Departed,
            agreement,
            zeros: self.zeros,
            loop_report,
            stalls,
            held,
            record_lost,
            links,
            off,
            notes: self.dir.notes().clone(),
            protocol: self.protocol.clone(),
            levels: levels_of(&passes),
            psi_star: rig.and_then(|rig| models::psi_star::of_run(passes.iter().map(|p| &p.pass), &rig)),
            finished_before: false,
            guards: self.guards.clone(),
        };
        if let Err(why) = self.write_end(&summary) {
            tracing::error!("the end of the run could not be saved: {why:#}");
            if matches!(summary.outcome, Outcome::Complete | Outcome::Stopped) {
                summary.outcome = Outcome::RecordLost;
                // As far as it goes: it has just failed.
                let _ = self.write_end(&summary);
            }
        }
        summary
    }

    fn write_end(&self, summary: &Summary) -> miette::Result<()> {
        let pages = || {
            crate::fidelity::write(self.dir.path()).wrap_err("the fidelity")?;
            let html = crate::report::html(self.dir.path(), &[], Some(summary)).wrap_err("the report")?.0;
            self.dir.write("report.html", html.as_bytes()).wrap_err("the report")
        };
        let written = pages();
        // Last, whatever became of them: with it a run is complete, and nothing is written again.
        let text = serde_json::to_vec_pretty(&Remarked::of(summary)).into_diagnostic()?;
        self.dir.write(SUMMARY, &text).wrap_err("the summary")?;
        written
    }

    /// A new record file of the run.
    pub fn new_record(&self) -> miette::Result<GuardedFile> {
        self.dir.new_record().wrap_err(Unfinished::NotSaved)
    }
}

/// Writes what a row led to into a record.
pub fn record<W: std::io::Write>(
    recorder: &mut realtime::recorder::Recorder<W>,
    at: Nanos,
    events: &[Event],
    pass: Option<&MeasuredPass>,
) -> miette::Result<()> {
    events.iter().try_for_each(|event| recorder.event(at, event)).into_diagnostic()?;
    pass.map_or(Ok(()), |pass| recorder.pass(at, pass)).into_diagnostic()
}
