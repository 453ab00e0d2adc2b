//! A sweep from its job to its summary. Here in virtual time: in this thread, with the virtual rig's ports.
//!
//! The crate `rig` (rig/src/wall_clock_run.rs) runs the same sweep in wall-clock time, with a thread for
//! the loop and instruments behind drivers. Job, summary and [`RunWriter`], which writes the run's folder, serve
//! both.

mod force_counts;
pub mod licence;
pub mod run_writer;
mod telemetry;
mod virtual_time;

pub use run_writer::{REPLAYABLE, Replayable, RunWriter, TARGET, is_model, model_name, unix_ns};
pub use telemetry::{Deadlines, Extremes, LATENESS_BOUNDS_S, Snapshot, Snapshots};
pub use virtual_time::outcome_json;

use crate::ambient::{LevelsFound, OperatorAnswers};
use crate::fidelity::RenderingStatement;
use crate::fidelity::dynamics::Dynamics;
use crate::plan::{Plan, Point, Resolution, lateral_reach};
use crate::print::quoted;
use crate::run_dir::{Identity, RunDir, SUMMARY};
use crate::setup::{Guards, Setup};
use crate::supervisor::OffReport;
use crate::sweep::{Event, MeasuredPass, Outcome, PAUSE_MAX_S, Sweep, Zeros};
use calibration::certificate::sha256_hex;
use models::law::Rendering;
use models::psi_star::PsiStar;
use models::{FrictionModel, Target};
use realtime::Nanos;
use realtime::clock::HeldBack;
use realtime::compare::Agreement;
use realtime::pacing::LoopReport;
use realtime::stall_monitor::StallReport;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize};

/// What is to be run.
pub struct Job {
    /// The rig.
    pub setup: Setup,
    /// The passes.
    pub plan: Plan,
    /// Seed of the order and of the virtual world.
    pub seed: u64,
    /// The model to compare with.
    pub model: Arc<dyn FrictionModel>,
    /// Name in the record and text of the model file, where one was given.
    pub model_file: Option<(String, String)>,
    /// Defects of the virtual rig in place of its own.
    pub defects: Option<sim::defects::Defects>,
    /// Folder of the run.
    pub out: PathBuf,
    /// In virtual time.
    pub fast: bool,
    /// Who runs it, and on what: for the record.
    pub notes: Notes,
    /// A file with the answers of the person at the rig.
    pub answers: Option<PathBuf>,
}

/// What a person says of a run. It stands in the record and on the report, and changes nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Notes {
    /// Who leads the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub operator: Option<String>,
    /// Whose finger it is: what it was exposed to is counted under this name, whatever the rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub subject: Option<String>,
    /// What is measured: the fingertip, its preparation, the plate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample: Option<String>,
    /// Licence of the data: an SPDX identifier or an address.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
}

impl Notes {
    /// These, and where they say nothing those of an earlier session.
    pub fn or(self, before: &Notes) -> Notes {
        let or = |now: Option<String>, before: &Option<String>| now.or_else(|| before.clone());
        Notes {
            operator: or(self.operator, &before.operator),
            subject: or(self.subject, &before.subject),
            sample: or(self.sample, &before.sample),
            licence: or(self.licence, &before.licence),
        }
    }

    /// Refuses other words than those of an earlier session: they would stand for its passes too.
    ///
    /// # Errors
    /// Another operator, subject or sample than the run in this folder has.
    pub fn agree_with(&self, before: &Notes, folder: &Path) -> miette::Result<()> {
        let all = [
            ("operator", &self.operator, before.operator.as_ref()),
            // Exposure counts for the operator where no subject is stated.
            ("subject", &self.subject, before.subject.as_ref().or(before.operator.as_ref())),
            ("sample", &self.sample, before.sample.as_ref()),
        ];
        for (name, now, before) in all {
            let Some(now) = now else { continue };
            let (shown, was) = (folder.display(), before.map_or("not stated", String::as_str));
            miette::ensure!(
                before == Some(now),
                help = format!(
                    "give another --out for another {name}; to go on with this run, leave --{name} away (`muprime runs {} \
                     --note TEXT` notes more)",
                    quoted(&shown)
                ),
                "{shown} holds passes of a run whose {name} is '{was}', not '{now}'"
            );
        }
        Ok(())
    }
}

/// What happened, for whoever watches.
pub enum Update<'a> {
    /// A pass was saved: it is safe on the disk.
    Pass(&'a MeasuredPass),
    /// Something worth a line.
    Event(&'a Event),
    /// Passes made, planned, s to go.
    Progress(usize, usize, f64),
    /// A cycle ten times a second, and the extremes of all cycles since the last one.
    State(&'a Snapshot),
    /// The rig was switched off for the last time; comes before anything else is done, in wall-clock time.
    Off(&'a OffReport),
}

/// What a run comes to. Its JSON form is what `muprime run --json` ends with.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Summary {
    /// How it ended.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// Requirement (`SR-..`) whose rule ended the run or prevented its arming.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub requirement: Option<String>,
    /// What to do about that.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub remedy: Option<String>,
    /// Folder of the run.
    pub folder: PathBuf,
    /// Passes made in all sessions.
    pub passes: usize,
    /// Passes planned.
    pub planned: usize,
    /// Whether the measurement disagrees with the model.
    pub model_departed: bool,
    /// What the comparison of all passes says.
    #[serde(default = "no_claim")]
    pub agreement: Agreement,
    /// `Psi*` of Eq. 20 for the peak-to-peak amplitude; none where the passes give none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub psi_star: Option<PsiStar>,
    /// Force zeros of the last session; they are in the readings.
    #[serde(default)]
    pub zeros: Zeros,
    /// The loop; `None` in virtual time.
    pub loop_report: Option<LoopReport>,
    /// When the machine did not run ordinary threads; `None` in virtual time.
    pub stalls: Option<StallReport>,
    /// Time that the clock of a virtual rig was held back while the computer did not run its threads; `None`
    /// where the clock cannot be held.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held: Option<HeldBack>,
    /// Rows that the record lost.
    pub record_lost: u64,
    /// What the links counted, by instrument.
    pub links: BTreeMap<String, serde_json::Value>,
    /// Whether the rig was read back off in the end.
    #[serde(default)]
    pub off: OffReport,
    /// Who ran it, and on what.
    #[serde(default)]
    pub notes: Notes,
    /// The plan's `[protocol]`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub protocol: BTreeMap<String, toml::Value>,
    /// What was found of the air, and typed at the rig.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<LevelsFound>,
    /// Every pass had been made before: nothing was driven.
    #[serde(default)]
    pub finished_before: bool,
    /// What is to be known of the rig's guards.
    #[serde(default)]
    pub guards: Guards,
}

impl Summary {
    /// As the last session that ended wrote it in the run's folder; none while one runs.
    pub fn written_in(folder: &Path) -> Option<Self> {
        serde_json::from_slice(&std::fs::read(folder.join(SUMMARY)).ok()?).ok()
    }
}

/// The finding of a summary that was written before it had one.
fn no_claim() -> Agreement {
    Agreement::of(None, false)
}

/// Why a run that had begun did not come to an orderly end. Anything else that goes wrong is a refusal: it
/// comes before the rig or the folder of the run is touched.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, miette::Diagnostic)]
pub enum Unfinished {
    /// The sweep ran, and its record could not be saved.
    #[error("the sweep had begun, and its results could not be saved")]
    NotSaved,
    /// A thread hangs or has panicked: a fault of this program.
    #[error("the sweep had begun; the instruments' own watchdogs switch off; what was measured is saved")]
    Internal,
    /// A signal ended it.
    #[error("stopped by a signal")]
    Interrupted,
    /// The drive was not read back off.
    #[error("the output may still be on: switch the supply off")]
    NotOff,
}

/// The requests to a run from outside.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    /// Number of stop requests: SIGINT, SIGTERM, SIGHUP, SIGQUIT, or somebody who watches.
    pub stops: Arc<AtomicUsize>,
    /// Whether the sweep is to rest before its next pass. In virtual time nothing waits.
    pub paused: Arc<AtomicBool>,
}

/// A run whose folder is open and whose passes are ordered.
pub struct Begun {
    /// The run's folder.
    pub dir: RunDir,
    /// The passes that are left, in their order.
    pub sweep: Sweep,
    /// Passes of the whole plan.
    pub planned: usize,
    /// Where this session begins on the run's clock in s.
    pub start_s: f64,
    /// Who answers for the person at the rig.
    pub answers: OperatorAnswers,
}

impl Begun {
    /// Whether all passes were made in earlier sessions.
    pub fn is_complete(&self) -> bool {
        self.sweep.progress().1 == 0
    }

    /// The summary of a run that is complete: nothing is driven.
    pub fn finish(self, job: &Job) -> miette::Result<Summary> {
        RunWriter::finish(job, self.dir, self.planned, self.sweep.agreement(true))
    }
}

impl Job {
    /// What the run is of.
    pub fn identity(&self) -> Identity {
        let file = self.model_file.as_ref().map(|(_, text)| sha256_hex(text.as_bytes()));
        let model = file.unwrap_or_else(|| self.model.name().to_string());
        Identity {
            plan: self.plan.file.name.clone(),
            setup: self.setup.file.name.clone(),
            planned: 0,
            setup_sha256: self.setup.sha256(),
            plan_sha256: self.plan.sha256(),
            seed: self.seed,
            model,
            defects_sha256: self.defects.as_ref().map(|d| sha256_hex(format!("{d:?}").as_bytes())),
            nobody_touches_the_plate: self.setup.file.finger.nobody_touches_the_plate,
            notes: self.notes.clone(),
            protocol: self.plan.protocol(),
        }
    }

    /// The passes of the plan, checked.
    ///
    /// # Errors
    /// The values that the rig cannot do, or the first series whose expected change of force its sensor
    /// cannot see, with their places in the plan.
    pub fn points(&self) -> miette::Result<Vec<Point>> {
        Ok(self.points_seen(None)?.0)
    }

    /// The same, with the noise in N that the lateral channel was found to have; the target of a plan that
    /// renders one; and remarks.
    ///
    /// # Errors
    /// As [`Job::points`]; a target that cannot be had, or that the rig cannot follow.
    pub fn points_seen(
        &self,
        noise_n: Option<f64>,
    ) -> miette::Result<(Vec<Point>, Option<Target>, Vec<String>)> {
        let resolution = self.resolution()?;
        let points = self.plan.points(self.seed, &self.setup.config.limits, &resolution)?;
        self.plan.check_ambient(&self.setup)?;
        let (mut reaches, most_n) = (self.setup.reaches()?, self.setup.config.limits.lateral_force_max_n);
        reaches.extend(lateral_reach(&points, self.setup.tip.mu0, most_n));
        self.plan.check_reach(&reaches)?;
        if let Some(mut channel) = self.setup.lateral_channel() {
            channel.noise_n = noise_n.or(channel.noise_n);
            let mu0 = self.setup.tip.mu0;
            self.plan.check_visible(&points, &resolution, &*self.model, mu0, &channel)?;
        }
        let (target, remarks) = self.followed(&points)?.unzip();
        let limits = &self.setup.config.limits;
        let beyond = crate::exposure_left::beyond(limits, &self.plan.file.pass, &points);
        Ok((points, target, remarks.into_iter().flatten().chain(beyond).collect()))
    }

    fn followed(&self, points: &[Point]) -> miette::Result<Option<(Target, Vec<String>)>> {
        let (limits, mu0) = (&self.setup.config.limits, self.setup.tip.mu0);
        let known = |frequency_hz| Dynamics::of(&self.setup, frequency_hz);
        let feedback = self.plan.feedback(&known(self.plan.file.base.frequency_hz))?;
        let Some(target) = self.plan.target(mu0, feedback)? else { return Ok(None) };
        let remarks = self.plan.check_followed(&target, points, &*self.model, mu0, limits, &known)?;
        Ok(Some((target, remarks)))
    }

    /// What the plan states of its rendering, and what is known of the rig. Errors: those of [`Job::points`].
    pub fn stated(&self) -> miette::Result<RenderingStatement> {
        let points = self.plan.points(self.seed, &self.setup.config.limits, &self.resolution()?)?;
        let remarks = self.followed(&points)?.map(|(_, remarks)| remarks).unwrap_or_default();
        let known = |hz| Dynamics::of(&self.setup, hz);
        let render = self.plan.file.render.as_ref();
        Ok(render.map_or_else(RenderingStatement::default, |render| {
            RenderingStatement::of(render, &points, known, remarks)
        }))
    }

    /// What the setup's amplifier can set, by its profile.
    fn resolution(&self) -> miette::Result<Resolution> {
        let amplifier = &self.setup.file.amplifier;
        let profile = amplifier.description().map_err(|e| miette::miette!("{e}"))?;
        let step = |name: &str| {
            profile.set(name).map_or(0.0, |set| {
                let described = &profile.description.set[set.0];
                let per_unit = amplifier.amplitude_m_per_unit.filter(|_| name == "amplitude");
                described.scale * per_unit.unwrap_or(described.si.factor)
            })
        };
        Ok(Resolution { amplitude_pp_m: step("amplitude"), frequency_hz: step("frequency") })
    }

    /// Opens the run's folder and orders the passes that are left. Nothing is commanded, and nothing is written yet.
    ///
    /// # Errors
    /// A refusal: passes that the rig cannot do, a licence that is none, a folder of another run or of a
    /// living one.
    pub fn begin(&mut self) -> miette::Result<Begun> {
        self.notes.licence.as_deref().map(licence::address_of).transpose()?;
        let (points, target, _) = self.points_seen(None)?;
        if let Some(target) = target {
            self.model = Arc::new(Rendering { law: Arc::clone(&self.model), target });
        }
        let planned = points.len();
        let answers = self.setup.answers(self.answers.as_deref(), self.asks_a_person())?;
        let mut dir = RunDir::open(&self.out, &Identity { planned, ..self.identity() })?;
        self.notes = dir.notes().clone();
        let left = dir.left_of(points);
        let session = dir.plan_session(run_writer::unix_ns(), self.plan.file.pass.measure_s, self.fast);
        let mut sweep = Sweep::new(
            left,
            crate::plan::times(&self.setup.reaches()?, self.plan.file.pass),
            Arc::clone(&self.model),
            &self.setup.tip,
            self.setup.file.noise,
        )
        .at_rig(&self.plan, &self.setup)
        .guarded_by(&self.setup.config.limits);
        sweep.temperature_ranges.clone_from(&self.setup.certificates.temperature_ranges);
        sweep.guards = self.setup.guards();
        let pause_max_s = self.setup.file.limits.pause_max_s.unwrap_or(PAUSE_MAX_S);
        sweep.pause_max = Nanos::from_seconds(pause_max_s);
        sweep.session = Some(session.session);
        // In virtual time the loop's own time goes on from session to session.
        sweep.start_s = if self.fast { 0.0 } else { session.start_s };
        for pass in &dir.made {
            sweep.remember(pass);
        }
        Ok(Begun { dir, sweep, planned, start_s: session.start_s, answers })
    }

    /// Whether the run waits for a person at the rig.
    pub fn asks_a_person(&self) -> bool {
        let means = self.setup.file.means();
        let air = self.plan.sets_air().into_iter().zip(means);
        let sets = air.into_iter().any(|(sets, by)| sets && by.is_some_and(|by| by.needs_a_person()));
        sets || !self.plan.file.step.is_empty()
    }

    /// Whether that person answers at the terminal.
    pub fn asks_at_the_terminal(&self) -> bool {
        self.asks_a_person() && self.answers.is_none() && self.setup.file.virtual_rig.is_none()
    }

    /// Runs the job in virtual time, as fast as it computes.
    ///
    /// # Errors
    /// A refusal before anything was written (a rig with instruments among them), or a fault of this program.
    pub fn run_in_virtual_time(
        mut self,
        signals: &Signals,
        update: &mut dyn FnMut(Update<'_>),
    ) -> miette::Result<Summary> {
        let begun = self.begin()?;
        if begun.is_complete() {
            begun.finish(&self)
        } else {
            virtual_time::run(self, begun, signals, update)
        }
    }

    /// The world of the virtual rig; an error says why it cannot be.
    pub fn world(&self) -> miette::Result<sim::world::World> {
        let virtual_rig = self.setup.file.virtual_rig.clone().unwrap_or_default();
        let mut config = virtual_rig.world();
        // What the setup states of the air is so in its world.
        let (air, room) = (self.setup.file.stated_air(), &mut config.room);
        room.ambient_pressure_pa = air.ambient_pressure_pa.unwrap_or(room.ambient_pressure_pa);
        room.temperature_c = air.temperature_c.unwrap_or(room.temperature_c);
        room.relative_humidity_pct = air.relative_humidity_pct.unwrap_or(room.relative_humidity_pct);
        if let Some(defects) = &self.defects {
            config.defects = defects.clone();
        }
        // The virtual finger is that of the setup's tip.
        let tip = &self.setup.tip;
        config.finger.mu0 = tip.mu0;
        config.finger.normal_stiffness_n_per_m = tip.finger.normal_stiffness_n_per_m;
        config.finger.lateral_stiffness_n_per_m = tip.finger.lateral_stiffness_n_per_m;
        // The finger is the rig's: it stays the same from run to run, and only noise and order follow the seed.
        let wrong = |e: sim::world::ConfigError| miette::miette!("the virtual rig: {e}");
        let finger = sim::world::World::new(&config, virtual_rig.finger_seed).map_err(wrong)?.finger;
        config.finger.normal_stiffness_n_per_m = finger.normal_stiffness_n_per_m;
        config.finger.lateral_stiffness_n_per_m = finger.lateral_stiffness_n_per_m;
        config.finger.stiffness_relative_sd = 0.0;
        let mut world = sim::world::World::new(&config, self.seed).map_err(wrong)?;
        if virtual_rig.hand_holds {
            world.operator.holds_dead_man_from = Some(Nanos(200_000_000));
        }
        Ok(world)
    }
}
