//! How faithfully a run rendered its target: wanted, commanded, predicted and measured over position, the
//! error in `mu'` and in millimetres, the transfer function, and where it ends by the known dynamics. All
//! of it is made from the record's rows.

pub mod dynamics;
mod lateness;
mod spectra;

use crate::job::TARGET;
use crate::plan::{Point, RenderPlan};
use crate::run_dir::{open_record, records_in};
use dynamics::{ChainStage, Dynamics};
pub use lateness::Late;
use miette::IntoDiagnostic;
use models::Target;
use realtime::recorder::{self, Entry};
use realtime::{Command, Phase, Row};
use serde::{Deserialize, Serialize};
use spectra::Spectra;
pub use spectra::{Bin, Corner};
use std::path::Path;

/// The file in a run's folder.
pub const FILE: &str = "fidelity.json";
/// The file in a record with what a plan states of its rendering, and what is known of the rig.
pub const STATED: &str = "render.json";
/// Form of the file.
pub const SCHEMA: &str = "muprime.fidelity/1";

/// What a plan states of its rendering, and what is known of the rig at each drive frequency.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RenderingStatement {
    /// Difference of `mu'` that counts as rendered.
    pub tolerance: f64,
    /// Drive frequency in Hz, and the dynamics there.
    pub known: Vec<(f64, Dynamics)>,
    /// What the rig will not show of the target, in sentences.
    pub remarks: Vec<String>,
    /// Period of a grating in m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub period_m: Option<f64>,
}

impl RenderingStatement {
    /// Of the passes of a plan.
    pub fn of(
        render: &RenderPlan,
        points: &[Point],
        known: impl Fn(f64) -> Dynamics,
        remarks: Vec<String>,
    ) -> Self {
        let mut frequencies: Vec<f64> = points.iter().map(|p| p.condition.frequency_hz).collect();
        frequencies.sort_by(f64::total_cmp);
        frequencies.dedup();
        let known = frequencies.into_iter().map(|f| (f, known(f))).collect();
        let grating = render.target == crate::plan::TargetKind::Grating;
        RenderingStatement {
            tolerance: render.tolerance,
            known,
            remarks,
            period_m: render.period_m.filter(|_| grating),
        }
    }

    fn at(&self, frequency_hz: f64) -> Option<Dynamics> {
        let off = |f: f64| (f - frequency_hz).abs();
        self.known.iter().min_by(|a, b| off(a.0).total_cmp(&off(b.0))).map(|(_, known)| *known)
    }
}

/// How faithfully a run rendered its target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fidelity {
    /// Form of this document: [`SCHEMA`].
    pub schema: String,
    /// Difference of `mu'` that counts as rendered.
    pub tolerance: f64,
    /// What the rig was not expected to show of the target.
    pub remarks: Vec<String>,
    /// By speed, load and drive frequency.
    pub groups: Vec<Group>,
}

/// The passes at one speed, load and drive frequency.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Group {
    /// Speed in m/s.
    pub speed_m_s: f64,
    /// Normal force in N.
    pub normal_force_n: f64,
    /// Drive frequency in Hz.
    pub frequency_hz: f64,
    /// Time in s by which the target was read ahead.
    #[serde(default)]
    pub lead_s: f64,
    /// Passes.
    pub passes: usize,
    /// Cycles that were compared.
    pub cycles: usize,
    /// Share of the cycles in which the wanted friction could not be had.
    pub saturated: f64,
    /// Root-mean-square difference of measured and wanted `mu'`, cycle by cycle.
    pub rms: f64,
    /// Mean difference of measured and wanted `mu'`.
    pub bias: f64,
    /// Share of the cycles within the tolerance.
    pub within_tolerance: f64,
    /// Root-mean-square difference of predicted (at the amplitude read back) and wanted `mu'`: what
    /// amplifier and loop cost.
    pub rms_command: f64,
    /// Root-mean-square difference of measured and predicted `mu'`: what the law and the sensor cost.
    pub rms_law: f64,
    /// Way in m by which the measured friction comes after the wanted one, forward and backward; negative:
    /// before it.
    pub shift_m: [Option<f64>; 2],
    /// Standard deviation of that way over the passes, in m; none of single passes.
    pub shift_sd_m: Option<f64>,
    /// Why it is missing of passes that were made, and with it the delays of the parts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift_missing: Option<String>,
    /// Root-mean-square difference of `mu'` once that way is taken out; as it is of passes without one.
    pub rms_shifted: f64,
    /// The same with the known delay taken out; none where no dynamics are known.
    pub rms_known: Option<f64>,
    /// The same with the mean way of the other passes taken out; none of a single pass.
    pub rms_held_out: Option<f64>,
    /// How late loop and plate, and the sensor, come beside what is known; empty with a feedback, and where
    /// the target does not show it.
    #[serde(default)]
    pub late: Vec<Late>,
    /// Transfer function from wanted to measured `mu'`, where the target has power.
    pub transfer: Vec<Bin>,
    /// Where the measured transfer function has fallen to -3 dB; none where the target does not reach as far.
    pub minus_3_db: Option<Corner>,
    /// The same frequency in Hz from the known dynamics.
    pub known_minus_3_db_hz: Option<f64>,
    /// The known dynamics.
    pub known: Option<Dynamics>,
    /// Its parts by name, the one that ends rendering first.
    pub parts: Vec<ChainStage>,
    /// Means over the passes against position, forward and backward.
    pub profiles: [Vec<PlaceMeans>; 2],
}

/// Means over the passes of one direction at one place.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PlaceMeans {
    /// Position in m.
    pub x_m: f64,
    /// Wanted `mu'`.
    pub wanted: f64,
    /// Commanded amplitude, peak-to-peak in m.
    pub commanded_pp_m: f64,
    /// Predicted `mu'` at the amplitude read back.
    pub predicted: f64,
    /// Measured `mu'`.
    pub measured: f64,
    /// Standard deviation of the measured `mu'` there.
    pub measured_sd: f64,
}

/// One cycle of a rendered pass.
#[derive(Clone, Copy, Debug)]
struct Sample {
    x_m: f64,
    wanted: f64,
    commanded_pp_m: f64,
    predicted: f64,
    measured: f64,
    reached: bool,
}

/// The cycles of one pass.
#[derive(Clone, Debug)]
struct Rendered {
    point: u32,
    key: [f64; 3],
    forward: bool,
    samples: Vec<Sample>,
}

/// Takes rows in the order of their cycles.
#[derive(Default)]
pub struct Collector {
    passes: Vec<Rendered>,
    mu0: Option<f64>,
    request: [f64; 3],
}

/// Places of a profile.
const PLACES: usize = 200;

impl Collector {
    /// Takes a row.
    pub fn row(&mut self, row: &Row) {
        for command in row.inputs.commands.iter().flatten() {
            match command {
                Command::Mu0(mu0) => self.mu0 = Some(mu0.value),
                Command::Render(r, _) => {
                    self.request = [r.velocity_m_s.abs(), r.normal_force_n, r.frequency_hz]
                }
                _ => {}
            }
        }
        let seen = &row.inputs.seen;
        let (Some(rendered), Ok(lateral), Ok(normal), Ok(stage), Some(mu0)) =
            (row.rendered, seen.forces.lateral, seen.forces.normal, seen.stage, self.mu0)
        else {
            return;
        };
        if row.marker.phase != Phase::Measure || !row.usable || normal.value <= 0.0 {
            return;
        }
        let sign = row.velocity_m_s.signum();
        let Some(predicted) = row.online.map(|online| online.predicted) else { return };
        // Where the finger was when the force was sampled.
        let late = stage.taken_at.seconds() - lateral.taken_at.seconds();
        let sample = Sample {
            x_m: stage.position_m - stage.velocity_m_s * late,
            wanted: rendered.wanted,
            commanded_pp_m: row.drive_pp_m,
            predicted,
            measured: sign * lateral.value / (normal.value * mu0),
            reached: rendered.reach == models::inverse::Reach::Within,
        };
        let point = row.marker.point;
        if self.passes.last().is_none_or(|pass| pass.point != point) {
            self.passes.push(Rendered { point, key: self.request, forward: sign > 0.0, samples: Vec::new() });
        }
        self.passes.last_mut().expect("one was just put there").samples.push(sample);
    }

    /// What the rows come to.
    pub fn finish(self, target: &Target, stated: &RenderingStatement, cycle_s: f64) -> Fidelity {
        let mut keys: Vec<[f64; 3]> = self.passes.iter().map(|pass| pass.key).collect();
        keys.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
        keys.dedup();
        let of = |key: &[f64; 3]| {
            let passes: Vec<&Rendered> =
                self.passes.iter().filter(|p| p.key == *key && p.samples.len() > 16).collect();
            (!passes.is_empty()).then(|| group(*key, &passes, target, stated, cycle_s))
        };
        Fidelity {
            schema: SCHEMA.into(),
            tolerance: stated.tolerance,
            remarks: stated.remarks.clone(),
            groups: keys.iter().filter_map(of).collect(),
        }
    }
}

fn group(
    [speed, load, hz]: [f64; 3],
    passes: &[&Rendered],
    target: &Target,
    stated: &RenderingStatement,
    cycle_s: f64,
) -> Group {
    let samples = || passes.iter().flat_map(|pass| &pass.samples);
    let n = samples().count() as f64;
    let rms = |of: fn(&Sample) -> f64| (samples().map(|s| of(s).powi(2)).sum::<f64>() / n).sqrt();
    let share = |of: &dyn Fn(&Sample) -> bool| samples().filter(|s| of(s)).count() as f64 / n;
    let known = stated.at(hz);
    let rendering = (target.lead_s, stated.period_m, target.feedback.is_none());
    let late = lateness::of(passes, speed, known.as_ref(), rendering);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let ways = |forward: bool| -> Vec<f64> {
        let found = passes.iter().zip(&late.ways).filter(|(pass, _)| pass.forward == forward);
        found.filter_map(|(_, way)| *way).collect()
    };
    let [forward, backward] = [ways(true), ways(false)];
    let all: Vec<f64> = late.ways.iter().flatten().copied().collect();
    let off = [&forward, &backward].map(|w| w.iter().map(|v| (v - mean(w)).powi(2)).sum::<f64>());
    let shift_of = |w: &[f64]| (!w.is_empty()).then(|| mean(w));
    // Passes beyond the one that gives the shift of each way.
    let spare = all.len().saturating_sub([&forward, &backward].iter().filter(|w| !w.is_empty()).count());
    let delay = (mean(&all) / (speed * cycle_s)).round().max(0.0) as usize;
    let bins = |segments: usize| {
        let mut spectra = Spectra::for_passes(passes.iter().map(|p| p.samples.len()), segments, cycle_s);
        for pass in passes {
            let [wanted, measured]: [Vec<f64>; 2] = [|s: &Sample| s.wanted, |s: &Sample| s.measured]
                .map(|of: fn(&Sample) -> f64| pass.samples.iter().map(of).collect());
            spectra.add(&wanted, &measured, delay);
        }
        spectra.bins(speed)
    };
    let narrow = bins(spectra::SEGMENTS[0]);
    let transfer = if narrow.len() > spectra::BROAD { bins(spectra::SEGMENTS[1]) } else { narrow };
    let mut parts = known.map_or_else(Vec::new, |known| known.parts());
    parts.sort_by(|a, b| a.corner_hz.unwrap_or(f64::MAX).total_cmp(&b.corner_hz.unwrap_or(f64::MAX)));
    Group {
        speed_m_s: speed,
        normal_force_n: load,
        frequency_hz: hz,
        lead_s: target.lead_s,
        passes: passes.len(),
        cycles: n as usize,
        saturated: share(&|s| !s.reached),
        rms: rms(|s| s.measured - s.wanted),
        bias: samples().map(|s| s.measured - s.wanted).sum::<f64>() / n,
        within_tolerance: share(&|s| (s.measured - s.wanted).abs() <= stated.tolerance),
        rms_command: rms(|s| s.predicted - s.wanted),
        rms_law: rms(|s| s.measured - s.predicted),
        shift_m: [shift_of(&forward), shift_of(&backward)],
        shift_sd_m: (spare > 0).then(|| (off.iter().sum::<f64>() / spare as f64).sqrt()),
        shift_missing: late.ways.contains(&None).then(|| lateness::HIDDEN.into()),
        rms_shifted: late.rms_shifted,
        rms_known: late.rms_known,
        rms_held_out: late.rms_held_out,
        late: late.parts,
        minus_3_db: spectra::minus_3_db(&transfer),
        known_minus_3_db_hz: known.and_then(|known| known.minus_3_db_hz()),
        transfer,
        known,
        parts,
        profiles: [true, false].map(|forward| profile(passes, forward)),
    }
}

fn profile(passes: &[&Rendered], forward: bool) -> Vec<PlaceMeans> {
    let samples = || passes.iter().filter(|p| p.forward == forward).flat_map(|p| &p.samples);
    let [low, high] =
        samples().fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], s| [a.min(s.x_m), b.max(s.x_m)]);
    let mut places = vec![(0.0f64, [0.0f64; 6]); PLACES];
    for s in samples() {
        let k = ((s.x_m - low) / (high - low) * PLACES as f64) as usize;
        let place = &mut places[k.min(PLACES - 1)];
        place.0 += 1.0;
        let all = [s.x_m, s.wanted, s.commanded_pp_m, s.predicted, s.measured, s.measured * s.measured];
        place.1.iter_mut().zip(all).for_each(|(sum, v)| *sum += v);
    }
    let mean = |(n, sums): &(f64, [f64; 6])| {
        let [x_m, wanted, commanded_pp_m, predicted, measured, square] = sums.map(|v| v / n);
        let measured_sd = (square - measured * measured).max(0.0).sqrt();
        PlaceMeans { x_m, wanted, commanded_pp_m, predicted, measured, measured_sd }
    };
    places.iter().filter(|p| p.0 > 0.0).map(mean).collect()
}

/// The fidelity of a run from its records; `None` of a run that rendered nothing.
///
/// # Errors
/// A record that cannot be opened; what is damaged is left out.
pub fn of_run(folder: &Path) -> miette::Result<Option<Fidelity>> {
    let mut found = Collector::default();
    let (mut stated, mut target, mut cycle_s) = (RenderingStatement::default(), None, 1e-3);
    for path in records_in(folder)? {
        for entry in open_record(&path, recorder::CYCLES)? {
            match entry {
                Entry::File { name, bytes, .. } if name == TARGET => {
                    target = serde_json::from_slice::<Target>(&bytes).ok();
                }
                Entry::File { name, bytes, .. } if name == STATED => {
                    stated = serde_json::from_slice(&bytes).unwrap_or_default();
                }
                Entry::File { name, bytes, .. } if name == crate::job::REPLAYABLE => {
                    let built = serde_json::from_slice::<crate::job::Replayable>(&bytes).ok();
                    cycle_s = built.map_or(cycle_s, |built| built.config.limits.timing.cycle.seconds());
                }
                // The files come first.
                Entry::Message { .. } if target.is_none() => return Ok(None),
                Entry::Message { text, .. } => {
                    serde_json::from_slice::<Row>(&text).iter().for_each(|row| found.row(row));
                }
                _ => {}
            }
        }
    }
    Ok(target
        .map(|target| found.finish(&target, &stated, cycle_s))
        .filter(|fidelity| !fidelity.groups.is_empty()))
}

/// The same, written into the run's folder; an error of the file system too.
pub fn write(folder: &Path) -> miette::Result<Option<Fidelity>> {
    let found = of_run(folder)?;
    if let Some(fidelity) = &found {
        let text = serde_json::to_string(fidelity).into_diagnostic()?;
        crate::files::write_output(&folder.join(FILE), text)?;
    }
    Ok(found)
}

/// The fidelity that a run's folder holds.
pub fn read(folder: &Path) -> Option<Fidelity> {
    serde_json::from_slice(&std::fs::read(folder.join(FILE)).ok()?).ok()
}
