//! A setup: which instruments make up the rig, its limits, its fingertip, its noise.

mod bundled;

use crate::certificates::Certificates;
use crate::fingertip::{Fingertip, FingertipSetup};
use crate::input::{self, BadInput};
use crate::plan::LateralChannel;
use drivers::vibrometer::{Settings, VibrometerSetup};
use drivers::{InstrumentSetup, InstrumentsSetup};
use miette::IntoDiagnostic;
use models::quantity::PeakToPeak;
use realtime::compare::PassNoise;
use realtime::cycle::Config;
use realtime::estimate::EstimateConfig;
use realtime::ports::Nanos;
use realtime::safety::{ChannelTiming, LimitError, Limits};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use bundled::{BUNDLED, text as bundled_text};

/// A setup file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SetupFile {
    /// Name of the rig, for records and reports.
    pub name: String,
    /// The loop.
    #[serde(default, rename = "loop")]
    pub pace: Pace,
    /// Force instruments: one with both axes, or two with one each.
    pub force: Vec<InstrumentSetup>,
    /// The ultrasonic amplifier.
    pub amplifier: InstrumentSetup,
    /// The stage.
    pub stage: InstrumentSetup,
    /// The vibrometer's controller, whose settings calibrations read back; it takes no part in a run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vibrometer: Option<VibrometerSetup>,
    /// Soft limits; what is left out keeps its default.
    #[serde(default)]
    pub limits: LimitsFile,
    /// The fingertip: a name of the library, or its numbers.
    pub finger: FingertipSetup,
    /// Noise of a pass.
    pub noise: PassNoise,
    /// The running estimate.
    #[serde(default = "default_estimate")]
    pub estimate: EstimateConfig,
    /// Certificates by path, relative to the setup file.
    #[serde(default)]
    pub certificates: Vec<PathBuf>,
    /// Temperature at the instruments in deg C, as read at the bench: a certificate that holds within a range of
    /// temperatures asks for it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Zero of the force channels in counts, lateral and normal, where it is not the force certificate's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub zero_counts: Option<[f64; 2]>,
    /// Present: this is a virtual rig, served on its instruments' loopback addresses by `muprime run` itself.
    #[serde(default, rename = "virtual")]
    pub virtual_rig: Option<VirtualRig>,
}

/// Pace of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Pace {
    /// Cycles per second.
    pub rate_hz: f64,
    /// SCHED_FIFO priority to ask for, 1 to 98; 0 asks for none.
    pub priority: i32,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { rate_hz: 1000.0, priority: 80 }
    }
}

/// The embedded virtual rig.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualRig {
    /// No departure from the model at all. Otherwise the bundled world, which departs by one sealed effect.
    pub ideal: bool,
    /// Seed of the finger's true stiffnesses about those that the setup states.
    pub finger_seed: u64,
}

/// Soft limits as a setup states them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsFile {
    /// N.
    pub normal_force_max_n: Option<f64>,
    /// N.
    pub lateral_force_max_n: Option<f64>,
    /// N between two samples.
    pub force_step_max_n: Option<f64>,
    /// N/s.
    pub force_rate_max_n_s: Option<f64>,
    /// m, peak-to-peak.
    pub amplitude_max_pp_m: Option<f64>,
    /// m/s.
    pub amplitude_rate_max_m_s: Option<f64>,
    /// Hz.
    pub frequency_min_hz: Option<f64>,
    /// Hz.
    pub frequency_max_hz: Option<f64>,
    /// m/s.
    pub speed_max_m_s: Option<f64>,
    /// m.
    pub travel_min_m: Option<f64>,
    /// m.
    pub travel_max_m: Option<f64>,
    /// Degrees Celsius.
    pub temperature_max_c: Option<f64>,
    /// Whether a temperature is read.
    pub temperature_fitted: Option<bool>,
    /// Equal raw samples in a row.
    pub frozen_after: Option<u32>,
    /// A human finger is in the rig.
    pub human_contact: Option<bool>,
    /// s.
    pub exposure_max_s: Option<f64>,
    /// s that a link's thread may be held up before its channel counts as stale, beyond three of its periods.
    pub link_stall_s: Option<f64>,
    /// Late cycles among a thousand.
    pub late_cycles_max: Option<u32>,
    /// Late cycles in a row that are one too many.
    pub late_in_a_row_max: Option<u32>,
    /// s, `Q / (pi f)` of the plate.
    pub plate_ring_time_s: Option<f64>,
}

const fn default_estimate() -> EstimateConfig {
    EstimateConfig { window: 50, normal_force_min_n: 0.02, sample_sd_n: 0.002 }
}

/// A setup that passed every check.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The file's contents.
    pub file: SetupFile,
    /// The file's text, for the record.
    pub text: String,
    /// Where it came from.
    pub origin: String,
    /// The fingertip.
    pub tip: Fingertip,
    /// Loop configuration.
    pub config: Config,
    /// Its certificates, verified.
    pub certificates: Certificates,
}

impl Setup {
    /// The bundled setup of that name, or the file at that path.
    ///
    /// # Errors
    /// What is wrong, with the place in the file.
    pub fn load(name_or_path: &str) -> miette::Result<Self> {
        if let Some(text) = bundled::text(name_or_path) {
            return Self::parse(name_or_path, text, Path::new("."));
        }
        let path = Path::new(name_or_path);
        if !path.exists() {
            let known: Vec<_> = BUNDLED.iter().map(|(name, _)| *name).collect();
            miette::bail!(
                help = format!("bundled setups: {}", known.join(", ")),
                "there is no setup '{name_or_path}', neither bundled nor as a file"
            );
        }
        Self::parse(name_or_path, &input::text_of(path)?, path.parent().unwrap_or(Path::new(".")))
    }

    /// Parses and checks a setup.
    ///
    /// # Errors
    /// What is wrong, with the place in the file.
    pub fn parse(origin: &str, text: &str, folder: &Path) -> miette::Result<Self> {
        let file: SetupFile = input::parse_toml(origin, text)?;
        let bad = |path: &[&str], problem: String| {
            BadInput::new(origin, text, input::place_of(text, path), problem, None)
        };
        if !(10.0..=4000.0).contains(&file.pace.rate_hz) {
            return Err(bad(&["loop", "rate_hz"], "the loop runs at 10 to 4000 Hz".into()).into());
        }
        if !(0..=98).contains(&file.pace.priority) {
            return Err(bad(&["loop", "priority"], "a priority is 0 (none) to 98".into()).into());
        }
        if !(1..=realtime::estimate::WINDOW_MAX).contains(&file.estimate.window) {
            let most = realtime::estimate::WINDOW_MAX;
            return Err(bad(&["estimate", "window"], format!("a window has 1 to {most} samples")).into());
        }
        for (name, value) in
            [("pass_relative_sd", file.noise.pass_relative_sd), ("force_sd_n", file.noise.force_sd_n)]
        {
            if !(value.is_finite() && value > 0.0) {
                return Err(bad(
                    &["noise", name],
                    format!("{name} = {value}: a finite number above zero is needed"),
                )
                .into());
            }
        }
        let tip = Fingertip::resolve(&file.finger, folder).map_err(|p| bad(&["finger"], p))?;
        let cycle = Nanos((1e9 / file.pace.rate_hz).round() as u64);
        let limits = limits(&file, cycle).map_err(|error| {
            let name = match error {
                LimitError::AboveHard { name, .. } | LimitError::Unusable { name, .. } => name,
            };
            bad(&["limits", name], error.to_string())
        })?;
        let config = Config { limits, estimate: file.estimate };
        let now_unix_s = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0, |since| since.as_secs() as i64);
        let certificates =
            Certificates::load(&file, folder, now_unix_s).map_err(|p| bad(&["certificates"], p))?;
        Ok(Setup { file, text: text.to_string(), origin: origin.to_string(), tip, config, certificates })
    }

    /// The instruments' part, for the drivers.
    pub fn instruments(&self) -> InstrumentsSetup {
        let mut amplifier = self.file.amplifier.clone();
        // A certificate of the drive's current is what the setup would otherwise have to state.
        amplifier.amplitude_m_per_unit =
            self.certificates.amplitude_m_per_unit.or(amplifier.amplitude_m_per_unit);
        let SetupFile { force, stage, supply_relay, safety_inputs, .. } = &self.file;
        InstrumentsSetup {
            force: force.clone(),
            amplifier,
            stage: stage.clone(),
            supply_relay: supply_relay.clone(),
            safety_inputs: safety_inputs.clone(),
        }
    }

    /// The settings of the vibrometer's controller, read back now; they must cover the drive's frequency.
    ///
    /// # Errors
    /// A setup without one, a controller that does not answer, a decoder that is not there or does not reach so far.
    pub fn vibrometer_settings(&self, frequency_hz: f64) -> miette::Result<Settings> {
        let Some(vibrometer) = &self.file.vibrometer else {
            miette::bail!(
                help = "[vibrometer] profile = \"polytec-ofv5000\", address = \"/dev/ttyS0\", decoder = \"VD-02\"",
                "{}: the setup names no vibrometer",
                self.origin
            );
        };
        let settings = drivers::vibrometer::settings(vibrometer).map_err(|e| miette::miette!("{e}"))?;
        settings.covers(frequency_hz).map_err(|e| miette::miette!("{e}"))?;
        Ok(settings)
    }

    /// What reads the lateral force, by profile, setup and certificate; `None` where no instrument does.
    ///
    /// # Errors
    /// A profile that cannot be used.
    pub fn lateral_channel(&self) -> miette::Result<Option<LateralChannel>> {
        for instrument in &self.file.force {
            let profile = drivers::profile(&instrument.profile).map_err(|e| miette::miette!("{e}"))?;
            let named = instrument.lateral.as_ref().map_or("lateral", |axis| axis.signal.as_str());
            let Some(signal) = profile.signal(named) else { continue };
            let gain = instrument.lateral.as_ref().map_or(1.0, |axis| axis.gain).abs();
            let by_profile = gain * profile.lsb_si(signal, &profile.values());
            let count = match &self.certificates.force {
                None => by_profile,
                Some((calibration, zero)) => {
                    let at = |counts: f64| calibration.apply([counts, 0.0], zero)[0];
                    (at(1.0) - at(0.0)).abs()
                }
            };
            let described = &profile.description.signal[signal.0];
            return Ok(Some(LateralChannel {
                sensor: format!("`{}` ({named})", instrument.profile),
                count_n: Some(count).filter(|count| count.is_finite()),
                noise_n: described.noise.map(|noise| gain * noise * described.si.factor),
                pass_sd_n: self.file.noise.force_sd_n,
            }));
        }
        Ok(None)
    }

    /// The `rig.toml` that goes beside a point table (contract).
    ///
    /// # Errors
    /// Only if TOML cannot express a number.
    pub fn rig_toml(&self) -> miette::Result<String> {
        #[derive(Serialize)]
        struct Rig<'a> {
            finger: &'a models::finger::Finger,
            noise: &'a PassNoise,
            calibration: Calibration<'a>,
        }
        #[derive(Serialize)]
        struct Calibration<'a> {
            #[serde(flatten)]
            priors: &'a calibration::prior::CalibrationPriors,
            /// Which certificate says so, by its kind.
            #[serde(skip_serializing_if = "std::collections::BTreeMap::is_empty")]
            certificates: &'a std::collections::BTreeMap<String, String>,
        }
        let calibration =
            Calibration { priors: &self.certificates.priors, certificates: &self.certificates.names };
        let finger = models::finger::Finger { lateral_recovery_m_per_s: None, ..self.tip.finger };
        toml::to_string(&Rig { finger: &finger, noise: &self.file.noise, calibration }).into_diagnostic()
    }
}

/// How long a link's thread may be held up on a machine that does nothing else, and the longest that a setup may allow.
const LINK_STALL_S: f64 = 0.02;
const LINK_STALL_MAX_S: f64 = 0.05;

/// Soft limits over the paper's, timing from the instruments' profiles.
fn limits(file: &SetupFile, cycle: Nanos) -> Result<Limits, LimitError> {
    let l = &file.limits;
    let mut limits = Limits::paper(cycle);
    let set = |slot: &mut f64, value: Option<f64>| *slot = value.unwrap_or(*slot);
    set(&mut limits.normal_force_max_n, l.normal_force_max_n);
    set(&mut limits.lateral_force_max_n, l.lateral_force_max_n);
    set(&mut limits.force_step_max_n, l.force_step_max_n);
    set(&mut limits.force_rate_max_n_s, l.force_rate_max_n_s);
    set(&mut limits.amplitude_rate_max_m_s, l.amplitude_rate_max_m_s);
    set(&mut limits.frequency_hz.0, l.frequency_min_hz);
    set(&mut limits.frequency_hz.1, l.frequency_max_hz);
    set(&mut limits.speed_max_m_s, l.speed_max_m_s);
    set(&mut limits.travel_m.0, l.travel_min_m);
    set(&mut limits.travel_m.1, l.travel_max_m);
    set(&mut limits.temperature_max_c, l.temperature_max_c);
    set(&mut limits.exposure_max_s, l.exposure_max_s);
    limits.amplitude_max = l.amplitude_max_pp_m.map_or(limits.amplitude_max, PeakToPeak::from_metres);
    limits.temperature_fitted = l.temperature_fitted.unwrap_or(limits.temperature_fitted);
    limits.frozen_after = l.frozen_after.unwrap_or(limits.frozen_after);
    limits.late_cycles_max = l.late_cycles_max.unwrap_or(limits.late_cycles_max);
    limits.late_in_a_row_max = l.late_in_a_row_max.unwrap_or(limits.late_in_a_row_max);
    limits.human_contact = l.human_contact.unwrap_or(limits.human_contact);
    limits.timing.ring_time = l.plate_ring_time_s.map_or(limits.timing.ring_time, Nanos::from_seconds);
    limits.timing.command_expiry = Nanos((2 * cycle.0).max(20_000_000));

    // A channel is stale after a number of its own periods, never of the loop's cycles. On a general-purpose kernel a
    // link thread may be held up for some milliseconds: the latency allows for that and is stated.
    let stall = l.link_stall_s.unwrap_or(LINK_STALL_S);
    if !(0.0..=LINK_STALL_MAX_S).contains(&stall) {
        let needed = "from 0 to 0.05: an amplifier's own watchdog waits no longer";
        return Err(LimitError::Unusable { name: "link_stall_s", value: stall, needed });
    }
    let stall = Nanos::from_seconds(stall);
    let timing = |instrument: &InstrumentSetup| -> ChannelTiming {
        let rate =
            instrument.rate_hz.or_else(|| drivers::nominal_rate_hz(&instrument.profile)).unwrap_or(100.0);
        let period = Nanos((1e9 / rate) as u64).0.max(cycle.0);
        ChannelTiming { period: Nanos(period), latency: stall, periods: 3 }
    };
    if let (Some(first), Some(last)) = (file.force.first(), file.force.last()) {
        let normal_first = file.force.len() == 2 && first.normal.is_some() && first.lateral.is_none();
        let (lateral, normal) = if normal_first { (last, first) } else { (first, last) };
        limits.timing.lateral = timing(lateral);
        limits.timing.normal = timing(normal);
    }
    limits.timing.amplifier = timing(&file.amplifier);
    limits.timing.stage = timing(&file.stage);
    limits.checked()
}
