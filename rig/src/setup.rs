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
use realtime::pacing::Pacing;
use realtime::ports::Nanos;
use realtime::safety::{ChannelTiming, LimitError, Limits, Timing};
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
    /// The second switch-off channel: an output that cuts the amplifier's supply, with readback. It is proved before every
    /// arming. A human finger, and an amplifier without a watchdog of its own, need one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub supply_relay: Option<InstrumentSetup>,
    /// Emergency stop, interlock and dead-man device, as digital inputs. A human finger needs the first and the last.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety_inputs: Option<InstrumentSetup>,
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
    /// CPU to run on and no other: for one that is kept free of other work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu: Option<usize>,
    /// Keeps CPUs out of deep sleep while the loop runs, for some watts.
    pub keep_cpus_awake: bool,
    /// us before each deadline that are spun, not slept; at 1 kHz 100 us cost a tenth of a CPU.
    pub spin_us: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { rate_hz: 1000.0, priority: 80, cpu: None, keep_cpus_awake: false, spin_us: 0.0 }
    }
}

impl Pace {
    /// What the loop's thread is to ask of the machine.
    pub fn pacing(&self) -> Pacing {
        Pacing {
            priority: (self.priority > 0).then_some(self.priority),
            cpu: self.cpu,
            keep_cpus_awake: self.keep_cpus_awake,
            spin_ns: (self.spin_us * 1e3) as u64,
        }
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
    /// A hand grips the virtual dead-man device a fifth of a second after the start, and holds it: for trials with a human
    /// finger that is none.
    pub hand_holds: bool,
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
    /// Equal raw amplitudes in a row, while driven; left out, 200 where the profile states the readback's noise.
    pub amplitude_frozen_after: Option<u32>,
    /// A human finger is in the rig.
    pub human_contact: Option<bool>,
    /// A key held at the terminal stands for a dead-man device: for trials.
    pub dead_man_key: Option<bool>,
    /// s in one go.
    pub exposure_max_s: Option<f64>,
    /// s of rest that end a go.
    pub exposure_rest_s: Option<f64>,
    /// Share of the last hour.
    pub exposure_duty_max: Option<f64>,
    /// m2/s: the squared rms velocity of the plate, summed over the last hour.
    pub exposure_dose_max_m2_s: Option<f64>,
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
        let half_period_us = 0.5e6 / file.pace.rate_hz;
        if !(0.0..=half_period_us).contains(&file.pace.spin_us) {
            let problem = format!("spin_us = {}: 0 to {half_period_us} (half a period)", file.pace.spin_us);
            return Err(bad(&["loop", "spin_us"], problem).into());
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
            // The rate of a channel stands with its instrument, every other limit under [limits].
            match error.name() {
                table @ ("amplifier" | "stage" | "supply_relay" | "safety_inputs") => {
                    bad(&[table, "rate_hz"], error.to_string())
                }
                "force" => bad(&["force"], error.to_string()),
                name => bad(&["limits", name], error.to_string()),
            }
        })?;
        guarded(&file).map_err(|problem| bad(&["limits", "human_contact"], problem))?;
        let config = Config { limits, estimate: file.estimate };
        #[allow(clippy::disallowed_methods, reason = "a certificate is good until a date")]
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

/// A human finger needs its guards, and is refused with what is missing.
fn guarded(file: &SetupFile) -> Result<(), String> {
    let human = file.limits.human_contact == Some(true);
    let key = file.limits.dead_man_key == Some(true);
    let missing = match (&file.supply_relay, &file.safety_inputs) {
        _ if !human => None,
        (None, _) => Some("a second switch-off channel ([supply_relay])"),
        (_, None) if key => Some("an emergency stop ([safety_inputs])"),
        (_, None) => Some("an emergency stop and a dead-man device ([safety_inputs])"),
        _ => None,
    };
    missing.map_or(Ok(()), |what| Err(format!("human_contact = true: a finger needs {what}")))
}

/// Rates at which a channel may be read, by who it is: what [`Limits::checked`] demands of periods, said of rates.
fn rate(instrument: &InstrumentSetup, name: &'static str, low: f64) -> Result<f64, LimitError> {
    let stated = instrument.rate_hz.or_else(|| drivers::nominal_rate_hz(&instrument.profile));
    let value = stated.unwrap_or(100.0);
    let high = 1e5;
    if value >= low && value <= high {
        Ok(value)
    } else {
        let why = "samples a second: a slower channel shows what goes wrong too late";
        Err(LimitError::OutOfRange { name, value, low, high, why })
    }
}

/// Slowest rates of forces and of states, in Hz.
const FORCE_RATE_MIN_HZ: f64 = 20.0;
const STATE_RATE_MIN_HZ: f64 = 10.0;

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
    set(&mut limits.exposure_rest_s, l.exposure_rest_s);
    set(&mut limits.exposure_duty_max, l.exposure_duty_max);
    set(&mut limits.exposure_dose_max_m2_s, l.exposure_dose_max_m2_s);
    limits.amplitude_max = l.amplitude_max_pp_m.map_or(limits.amplitude_max, PeakToPeak::from_metres);
    limits.temperature_fitted = l.temperature_fitted.unwrap_or(limits.temperature_fitted);
    limits.frozen_after = l.frozen_after.unwrap_or(limits.frozen_after);
    limits.late_cycles_max = l.late_cycles_max.unwrap_or(limits.late_cycles_max);
    limits.late_in_a_row_max = l.late_in_a_row_max.unwrap_or(limits.late_in_a_row_max);
    limits.human_contact = l.human_contact.unwrap_or(limits.human_contact);
    limits.dead_man_key = l.dead_man_key.unwrap_or(false);
    limits.supply_required = file.supply_relay.is_some();
    limits.load_commanded = file.stage.dead_weight_n.is_none();
    if let Ok(profile) = drivers::profile(&file.amplifier.profile) {
        limits.amplifier_watchdog = profile.set("heartbeat").is_some();
        let noisy = profile.signal("amplitude").and_then(|s| profile.description.signal[s.0].noise);
        limits.amplitude_frozen_after = l.amplitude_frozen_after.or(noisy.map(|_| 200));
    }
    // What is no number of seconds stays one that is refused: a cast would make it zero, or the largest there is.
    let ring_s = l.plate_ring_time_s.unwrap_or(limits.timing.ring_time.seconds());
    limits.timing.ring_time = if ring_s.is_finite() { Nanos::from_seconds(ring_s) } else { Nanos(u64::MAX) };
    limits.timing.command_expiry = Timing::longest_expiry(cycle);

    // A channel is stale after a number of its own periods, never of the loop's cycles. On a general-purpose kernel a
    // link thread may be held up for some milliseconds: the latency allows for that and is stated.
    let stall = l.link_stall_s.unwrap_or(LINK_STALL_S);
    if !(0.0..=LINK_STALL_MAX_S).contains(&stall) {
        let needed = "from 0 to 0.05: an amplifier's own watchdog waits no longer";
        return Err(LimitError::Unusable { name: "link_stall_s", value: stall, needed });
    }
    let stall = Nanos::from_seconds(stall);
    let timing = |instrument: &InstrumentSetup, name: &'static str| -> Result<ChannelTiming, LimitError> {
        let low = if name == "force" { FORCE_RATE_MIN_HZ } else { STATE_RATE_MIN_HZ };
        let period = ((1e9 / rate(instrument, name, low)?) as u64).max(cycle.0);
        Ok(ChannelTiming { period: Nanos(period), latency: stall, periods: 3 })
    };
    if let (Some(first), Some(last)) = (file.force.first(), file.force.last()) {
        let normal_first = file.force.len() == 2 && first.normal.is_some() && first.lateral.is_none();
        let (lateral, normal) = if normal_first { (last, first) } else { (first, last) };
        limits.timing.lateral = timing(lateral, "force")?;
        limits.timing.normal = timing(normal, "force")?;
    }
    limits.timing.amplifier = timing(&file.amplifier, "amplifier")?;
    limits.timing.stage = timing(&file.stage, "stage")?;
    if let Some(relay) = &file.supply_relay {
        limits.timing.supply = timing(relay, "supply_relay")?;
    }
    if let Some(inputs) = &file.safety_inputs {
        limits.timing.contacts = timing(inputs, "safety_inputs")?;
    }
    limits.checked()
}
