//! A setup: which instruments make up the rig, its limits, its fingertip, its noise.
//!
//! `SetupFile` is what is written, `Setup` what was checked: profiles found (`profiles`), limits below the
//! hard limits (`limits`), and the guards that the fingertip needs (`guards`). A setup has either addresses
//! of instruments or a virtual rig. Only the clock of the latter may be held while the computer is stalled.
//! A refusal says what is wrong, with the place in the file; else an error is a profile that cannot be used.

mod guards;
mod limits;
mod profiles;

use crate::certificates::Certificates;
use crate::fingertip::{Fingertip, FingertipSetup};
use crate::input::{self, Problems, unit_meant};
use crate::plan::{LateralChannel, Reach};
use drivers::vibrometer::VibrometerSetup;
use drivers::{InstrumentSetup, InstrumentsSetup};
use models::Ambient;
use models::rig_file::{PassNoise, RigFile, RigFileError};
use realtime::Nanos;
use realtime::cycle::Config;
use realtime::estimate::{EstimateConfig, WINDOW_MAX};
use realtime::pacing::Pacing;
use realtime::safety::Exposed;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

pub use limits::LimitsFile;
pub use profiles::{ForceAxisSignal, library, look_in};

/// Name and text of every bundled setup. Add one: a file in `runs/setups/` and a line here.
pub const BUNDLED: &[(&str, &str)] = &[
    ("virtual", include_str!("../setups/virtual.toml")),
    ("virtual-ideal", include_str!("../setups/virtual-ideal.toml")),
    ("virtual-mixed", include_str!("../setups/virtual-mixed.toml")),
    ("virtual-relay", include_str!("../setups/virtual-relay.toml")),
    ("virtual-rtu", include_str!("../setups/virtual-rtu.toml")),
    ("virtual-slcan", include_str!("../setups/virtual-slcan.toml")),
    ("virtual-socketcan", include_str!("../setups/virtual-socketcan.toml")),
];

/// What to do about an amplifier that shows no temperature.
pub const THERMOMETER: &str =
    "state `temperature_fitted = false` in [limits] where nobody touches the plate, or take one that is read";

/// CPUs that a set of Linux may name (`CPU_SETSIZE`).
const MOST_CPUS: usize = 1024;
/// Largest scatter of a sample in N: the noise of a channel in counts stands above it.
const SAMPLE_SD_MAX_N: f64 = 1.0;

/// A setup file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
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
    /// The second switch-off channel: an output that cuts the amplifier's supply, with readback. It is proved
    /// before every arming. A human finger, and an amplifier without a watchdog of its own, need one.
    pub supply_relay: Option<InstrumentSetup>,
    /// Emergency stop, interlock and dead-man device, as digital inputs. A human finger needs the first and the last.
    pub safety_inputs: Option<InstrumentSetup>,
    /// The chamber around the rig, or gauges of the air that only read. It takes no part in the loop.
    pub chamber: Option<InstrumentSetup>,
    /// What the operator sets of the air.
    #[serde(default)]
    pub ambient: crate::ambient::AmbientSetup,
    /// The vibrometer's controller, whose settings calibrations read back; it takes no part in a run.
    pub vibrometer: Option<VibrometerSetup>,
    /// Soft limits; what is left out keeps its default.
    #[serde(default)]
    pub limits: LimitsFile,
    /// The fingertip: a name of the library, or its numbers.
    pub finger: FingertipSetup,
    /// Noise of a pass.
    pub noise: PassNoise,
    /// The running estimate.
    #[serde(default)]
    pub estimate: EstimateConfig,
    /// Certificates by path, relative to the setup file.
    #[serde(default)]
    pub certificates: Vec<PathBuf>,
    /// Temperature at the instruments in deg C, as read at the bench: a certificate that holds within a range
    /// of temperatures asks for it.
    pub temperature_c: Option<f64>,
    /// Ambient pressure in Pa, where a plan does not set it.
    pub ambient_pressure_pa: Option<f64>,
    /// Relative humidity in per cent, as read at the bench.
    pub relative_humidity_pct: Option<f64>,
    /// Standard uncertainty of the stage's speed, relative, where an encoder or a timed stroke gives it.
    pub speed_gain_sd: Option<f64>,
    /// Zero of the force channels in counts, lateral and normal, where it is not the force certificate's.
    pub zero_counts: Option<[f64; 2]>,
    /// Present: this is a virtual rig, served on its instruments' loopback addresses by `muprime run` itself.
    #[serde(default, rename = "virtual")]
    pub virtual_rig: Option<VirtualRigConfig>,
}

impl SetupFile {
    /// What the setup states of the air.
    pub fn stated_air(&self) -> Ambient {
        Ambient {
            ambient_pressure_pa: self.ambient_pressure_pa,
            temperature_c: self.temperature_c,
            relative_humidity_pct: self.relative_humidity_pct,
        }
    }

    /// Judges rate, priority, spinning and CPU of the loop; says whether the rate is one at which it can run.
    fn check_loop(&self, wrong: &mut Problems<'_>) -> bool {
        let Pace { rate_hz, priority, cpu, spin_us, .. } = self.pace;
        let mut add = |key, problem: String, remedy| wrong.add(&["loop", key], problem, remedy);
        let loops = (10.0..=4000.0).contains(&rate_hz);
        if !loops {
            let remedy = unit_meant("rate_hz", rate_hz, [10.0, 4000.0]);
            add("rate_hz", format!("rate_hz = {rate_hz}: the loop runs at 10 to 4000 Hz"), remedy);
        }
        if !(0..=98).contains(&priority) {
            add("priority", "a priority is 0 (none) to 98".into(), None);
        }
        let half_period_us = 0.5e6 / rate_hz;
        if loops && !(0.0..=half_period_us).contains(&spin_us) {
            add("spin_us", format!("spin_us = {spin_us}: 0 to {half_period_us} (half a period)"), None);
        }
        if let Some(cpu) = cpu.filter(|cpu| *cpu >= MOST_CPUS) {
            add("cpu", format!("cpu = {cpu}: they are counted from 0 to {}", MOST_CPUS - 1), None);
        }
        loops
    }

    /// Judges the numbers of `[estimate]` and `[noise]`.
    fn check_noise(&self, wrong: &mut Problems<'_>) {
        if !(1..=WINDOW_MAX).contains(&self.estimate.window) {
            wrong.add(&["estimate", "window"], format!("a window has 1 to {WINDOW_MAX} samples"), None);
        }
        for (table, name, value) in [
            ("noise", "pass_relative_sd", self.noise.pass_relative_sd),
            ("noise", "force_sd_n", self.noise.force_sd_n),
            ("estimate", "normal_force_min_n", self.estimate.normal_force_min_n),
            ("estimate", "sample_sd_n", self.estimate.sample_sd_n),
        ] {
            if !(value.is_finite() && value > 0.0) {
                let problem = format!("{name} = {value}: a finite number above zero is needed");
                wrong.add(&[table, name], problem, None);
            } else if name == "sample_sd_n" && value > SAMPLE_SD_MAX_N {
                let problem = format!("{name} = {value} N: a sample scatters by at most {SAMPLE_SD_MAX_N} N");
                let remedy = "`calibrate noise` gives counts: multiply them by the gain in N per count";
                wrong.add(&[table, name], problem, remedy.to_string());
            }
        }
    }
}

/// Pace of the loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Pace {
    /// Cycles per second.
    pub rate_hz: f64,
    /// SCHED_FIFO priority to ask for, 1 to 98; 0 asks for none.
    pub priority: i32,
    /// CPU to run on and no other: for one that is free of other work.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu: Option<usize>,
    /// Keeps CPUs out of deep sleep while the loop runs, for some watts. Left out: with real instruments, and not on a virtual rig.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub keep_cpus_awake: Option<bool>,
    /// us before each deadline that are spun, not slept; at 1 kHz 100 us cost a tenth of a CPU.
    pub spin_us: f64,
}

impl Default for Pace {
    fn default() -> Self {
        Pace { rate_hz: 1000.0, priority: 80, cpu: None, keep_cpus_awake: None, spin_us: 0.0 }
    }
}

impl Pace {
    /// What the loop's thread is to ask of the machine.
    pub fn pacing(&self) -> Pacing {
        Pacing {
            priority: (self.priority > 0).then_some(self.priority),
            cpu: self.cpu,
            keep_cpus_awake: self.keep_cpus_awake.unwrap_or(false),
            spin_ns: (self.spin_us * 1e3) as u64,
        }
    }
}

/// The embedded virtual rig.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct VirtualRigConfig {
    /// No departure from the model at all. Otherwise the bundled world, which departs by one sealed effect.
    pub ideal: bool,
    /// Seed of the finger's true stiffnesses about those that the setup states.
    pub finger_seed: u64,
    /// Where above zero, the fingertip is the paper's finite element ridge, by its table, on a plate that moves by so many times its stroke: 1 as
    /// it is, 2 with the paper's w as the sine's amplitude. Zero: a slider on springs.
    pub ridge_table_strokes: f64,
    /// A hand grips the virtual dead-man device a fifth of a second after the start, and holds it: for trials
    /// with a human finger that is none.
    pub hand_holds: bool,
}

impl VirtualRigConfig {
    /// What its world is built from, but for defects that a command names.
    pub fn world(&self) -> sim::world::WorldConfig {
        let mut config =
            if self.ideal { sim::world::WorldConfig::ideal() } else { sim::world::WorldConfig::bundled() };
        config.finger.ridge_table_strokes = self.ridge_table_strokes;
        config
    }
}

/// What is to be known of a rig's guards: it stands in the record, the summary, the report and on every page of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Guards {
    /// The fingertip is a person's, and the setup says that nobody touches the plate.
    pub nobody_touches_the_plate: bool,
    /// Contacts of the board that are declared to have no device: they are not watched.
    pub not_wired: Vec<String>,
    /// What happens to output and stage when this program dies.
    pub if_this_program_dies: String,
}

impl Guards {
    /// What a record says of them.
    pub fn of_facts(mut fact: impl FnMut(&str) -> Option<String>) -> Self {
        let contacts = fact("contacts_not_wired").unwrap_or_default();
        Guards {
            nobody_touches_the_plate: fact("nobody_touches_the_plate").is_some(),
            not_wired: contacts.split(", ").filter(|name| !name.is_empty()).map(String::from).collect(),
            if_this_program_dies: fact("if_this_program_dies").unwrap_or_default(),
        }
    }

    /// The same as names and words, for a record.
    pub fn facts(&self) -> Vec<(&'static str, String)> {
        let nobody = self.nobody_touches_the_plate.then(|| ("nobody_touches_the_plate", NOBODY.to_string()));
        let unwatched =
            (!self.not_wired.is_empty()).then(|| ("contacts_not_wired", self.not_wired.join(", ")));
        let dies = Some(("if_this_program_dies", self.if_this_program_dies.clone()));
        [nobody, unwatched, dies].into_iter().flatten().filter(|(_, words)| !words.is_empty()).collect()
    }
}

/// The warning if a person's fingertip is named and nobody is there.
pub const NOBODY: &str = "nobody touches the plate (stated in the setup): the guards for a finger are off";

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
    pub fn load(name_or_path: &str) -> miette::Result<Self> {
        let (text, folder) = crate::bundled::load("setup", BUNDLED, name_or_path)?;
        Self::parse(name_or_path, &text, folder)
    }

    /// Parses and checks a setup.
    pub fn parse(origin: &str, text: &str, folder: &Path) -> miette::Result<Self> {
        let mut file: SetupFile = input::parse_toml(origin, text)?;
        file.pace.keep_cpus_awake.get_or_insert(file.virtual_rig.is_none());
        let mut wrong = Problems::of(origin, text);
        let loops = file.check_loop(&mut wrong);
        file.check_noise(&mut wrong);
        // A world that cannot be is refused here, not by the run that would need it.
        if let Some(rig) = &file.virtual_rig
            && let Err(problem) = sim::world::World::new(&rig.world(), rig.finger_seed)
        {
            wrong.add(&["virtual", "ridge_table_strokes"], problem.to_string(), None);
        }
        let tip = Fingertip::resolve(&file.finger, folder);
        let tip = tip.map_err(|(key, problem)| wrong.add(&["finger", key], problem, None)).ok();
        let mut unfit = profiles::resolve(&mut file, folder);
        if unfit.is_empty() {
            unfit = profiles::fit(&file);
        }
        let described = unfit.is_empty();
        file.check_ambient(&mut wrong);
        for (table, problem) in unfit {
            wrong.add(&table, problem, None);
        }
        let limits = if loops && described {
            let person = guards::person(&file, tip.as_ref());
            limits::all_of(&file, person, Nanos((1e9 / file.pace.rate_hz).round() as u64), &mut wrong)
        } else {
            None
        };
        guards::contradictions(&file, tip.as_ref(), &mut wrong);
        guards::guarded(&file, tip.as_ref(), &mut wrong);
        #[allow(clippy::disallowed_methods, reason = "a certificate is good until a date")]
        let now_unix_s = std::time::SystemTime::now()
            .duration_since(std::time::UNIX_EPOCH)
            .map_or(0, |since| since.as_secs() as i64);
        let certificates = Certificates::load(&file, folder, now_unix_s)
            .map_err(|problem| wrong.add(&["certificates"], problem, None))
            .ok();
        wrong.end()?;
        let (Some(tip), Some(limits), Some(certificates)) = (tip, limits, certificates) else {
            miette::bail!("{origin}: a part is missing, and nothing says which");
        };
        let config = Config { limits, estimate: file.estimate, exposed: Exposed::default() };
        let setup =
            Setup { file, text: text.to_string(), origin: origin.to_string(), tip, config, certificates };
        // What goes beside the point table in the end is known now.
        if let Err(error) = setup.rig_file().check() {
            let path: &[&str] = match &error {
                RigFileError::Value { section: "noise", key, .. } => &["noise", key],
                RigFileError::Value { section: "calibration", key: "speed_gain_sd", .. } => {
                    &["speed_gain_sd"]
                }
                RigFileError::Value { section: "calibration", .. } => &["certificates"],
                _ => &["finger"],
            };
            let mut wrong = Problems::of(origin, text);
            wrong.add(path, error.to_string(), None);
            wrong.end()?;
        }
        Ok(setup)
    }

    /// Whether a key that is held at the terminal stands for the dead-man device: the setup says so, and none is wired.
    pub fn hand_at_key(&self) -> bool {
        let limits = &self.config.limits;
        limits.human_contact && limits.dead_man_key && !guards::is_wired(&self.file, "dead_man")
    }

    /// What is to be known of the rig's guards, for whoever arms it and whoever reads of it later.
    pub fn guards(&self) -> Guards {
        Guards {
            nobody_touches_the_plate: self.file.finger.nobody_touches_the_plate,
            not_wired: guards::not_wired(&self.file),
            if_this_program_dies: guards::if_this_program_dies(&self.file),
        }
    }

    /// The instruments' part, for the drivers.
    pub fn instruments(&self) -> InstrumentsSetup {
        let SetupFile { force, mut amplifier, stage, supply_relay, safety_inputs, chamber, .. } =
            self.file.clone();
        // A certificate of the drive's current is what the setup would otherwise have to state.
        amplifier.amplitude_m_per_unit =
            self.certificates.amplitude_m_per_unit.or(amplifier.amplitude_m_per_unit);
        InstrumentsSetup { force, amplifier, stage, supply_relay, safety_inputs, chamber }
    }

    /// -3 dB bandwidth of the lateral channel's filter in Hz, where its profile states one.
    pub fn lateral_passband_hz(&self) -> Option<f64> {
        let mut axes = self.file.axes();
        axes.find(|axis| axis.name == "lateral")?.profile.description.time.passband_hz
    }

    /// What reads the lateral force, by profile, setup and certificate; `None` where no instrument does.
    pub fn lateral_channel(&self) -> Option<LateralChannel> {
        let axis = self.file.axes().find(|axis| axis.name == "lateral")?;
        let (gain, described) = (axis.gain.abs(), axis.described());
        let count = match &self.certificates.force {
            None => gain * axis.profile.lsb_si(axis.signal, &axis.profile.values()),
            Some((calibration, zero)) => {
                let at = |counts: f64| calibration.apply([counts, 0.0], zero)[0];
                (at(1.0) - at(0.0)).abs()
            }
        };
        Some(LateralChannel {
            sensor: format!("`{}` ({})", axis.instrument.profile, described.name.as_ref()),
            count_n: Some(count).filter(|count| count.is_finite()),
            noise_n: described.noise.map(|noise| gain * noise * described.si.factor),
            pass_sd_n: self.file.noise.force_sd_n,
        })
    }

    /// What its instruments take and see, by their profiles and this setup.
    pub fn reaches(&self) -> miette::Result<Vec<Reach>> {
        let instruments = self.instruments();
        let described = |i: &drivers::InstrumentSetup| i.description().map_err(|e| miette::miette!("{e}"));
        let fastest = [0.0, self.config.limits.speed_max_m_s];
        let by = "`speed_max_m_s` in [limits] allows".to_string();
        let mut all = vec![Reach { column: "speed_m_s", range: fastest, by }];
        let (amplifier, stage) = (described(&instruments.amplifier)?, described(&instruments.stage)?);
        let gain = instruments.amplifier.amplitude_m_per_unit;
        for (profile, set, column, gain) in [
            (&amplifier, "amplitude", "amplitude_pp_m", gain),
            (&amplifier, "frequency", "frequency_hz", None),
            (&stage, "velocity", "speed_m_s", None),
            (&stage, "load", "normal_force_n", None),
        ] {
            let Some(set) = profile.set(set).map(|set| &profile.description.set[set.0]) else { continue };
            let factor = gain.unwrap_or(set.si.factor);
            // A drive that a certificate puts on another scale has its range on that scale.
            let scaled = column == "amplitude_pp_m" && self.certificates.amplitude.is_some();
            if let Some((low, high)) = set.range.filter(|_| !scaled) {
                // At zero the output is off, whatever the smallest amplitude; a speed is driven both ways.
                let range = match column {
                    "amplitude_pp_m" => [0.0, high * factor],
                    "speed_m_s" => [0.0, low.abs().min(high.abs()) * factor.abs()],
                    _ => [low * factor, high * factor],
                };
                let by = format!("`{}` takes", profile.id());
                all.push(Reach { column, range, by });
            }
        }
        if self.certificates.force.is_some() {
            return Ok(all);
        }
        for axis in self.file.axes() {
            let (name, signal) = (axis.name, axis.described());
            let Some((low, high)) = signal.range else { continue };
            let per_load = if name == "normal" { 1.0 } else { self.tip.mu0 };
            let ends = [low, high].map(|end| (end * signal.si.factor * axis.gain).abs());
            // Compression is positive, and sliding goes both ways.
            let end = if name == "normal" && axis.gain > 0.0 { ends[1] } else { ends[0].min(ends[1]) };
            let by = format!("`{}` sees as {name} force", axis.profile.id());
            all.push(Reach { column: "normal_force_n", range: [0.0, end / per_load], by });
        }
        Ok(all)
    }

    /// What is known of this rig, for the `rig.toml` beside a point table (docs/contract.md).
    pub fn rig_file(&self) -> RigFile {
        RigFile {
            finger: models::finger::Finger { lateral_recovery_m_per_s: None, ..self.tip.finger },
            noise: self.file.noise,
            calibration: self.certificates.calibration.clone(),
        }
    }
}
