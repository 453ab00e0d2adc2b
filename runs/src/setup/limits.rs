//! Limits of a setup: what the file states over the paper's, and timing from the instruments' profiles.

use super::{SetupFile, guards};
use crate::input::{Problems, unit_meant};
use drivers::InstrumentSetup;
use models::PeakToPeak;
use realtime::Nanos;
use realtime::safety::{ChannelTiming, LimitError, Limits, Timing};
use serde::{Deserialize, Serialize};

/// Soft limits as a setup states them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsFile {
    /// Largest normal force: above 0, to 5, in N. Default: 1.5.
    pub normal_force_max_n: Option<f64>,
    /// Largest lateral force: above 0, to 10, in N. Default: 2.
    pub lateral_force_max_n: Option<f64>,
    /// Largest step between two samples: 0.01 to 5, in N; a single one is a spike. Default: 0.5.
    pub force_step_max_n: Option<f64>,
    /// Fastest change of a force: 1 to 500, in N/s. Default: 60.
    pub force_rate_max_n_s: Option<f64>,
    /// Largest amplitude: peak-to-peak, above 0, to 10e-6, in m. Default: 6e-6.
    pub amplitude_max_pp_m: Option<f64>,
    /// Fastest change of the amplitude: 1e-6 to 0.1, in m/s. Default: 0.02.
    pub amplitude_rate_max_m_s: Option<f64>,
    /// Lowest frequency: 5e3 to 1.2e5, in Hz. Default: 1e4.
    pub frequency_min_hz: Option<f64>,
    /// Highest frequency: 5e3 to 1.2e5, in Hz. Default: 1e5.
    pub frequency_max_hz: Option<f64>,
    /// Largest speed: above 0, to 1, in m/s. Default: 0.25.
    pub speed_max_m_s: Option<f64>,
    /// Lower end of the travel: -0.5 to 0.5, at least 1e-3 below the upper one, in m. Default: -0.06.
    pub travel_min_m: Option<f64>,
    /// Upper end of the travel: -0.5 to 0.5, at least 1e-3 above the lower one, in m. Default: 0.06.
    pub travel_max_m: Option<f64>,
    /// Highest temperature: to 48, in deg C. Default: 45.
    pub temperature_max_c: Option<f64>,
    /// Whether a temperature is read; losing one that is read is a trip. `false` only where the amplifier's
    /// profile has none, and nobody touches the plate. Default: true.
    pub temperature_fitted: Option<bool>,
    /// Equal raw samples in a row that are a frozen channel: 20 to 1000; above 50, at most 2.5 s of them.
    /// Default: 50.
    pub frozen_after: Option<u32>,
    /// Equal raw amplitudes in a row that are a frozen readback: 20 to 1000, while driven. Default: 200 where
    /// the profile states the readback's noise.
    pub amplitude_frozen_after: Option<u32>,
    /// The fingertip says whether a human finger is in the rig; a statement against it is refused. `true` on
    /// a virtual rig with a human fingertip: its guards are rehearsed. Default: by the fingertip.
    pub human_contact: Option<bool>,
    /// A key held at the terminal stands for a dead-man device: for trials. Default: false.
    pub dead_man_key: Option<bool>,
    /// Of vibration in one go, to 600, in s. Default: 60.
    pub exposure_max_s: Option<f64>,
    /// Rest that ends a go, 10 to 3600, in s. Default: 60.
    pub exposure_rest_s: Option<f64>,
    /// Share of the last hour, 1e-3 to 0.5, a ratio. Default: 0.25.
    pub exposure_duty_max: Option<f64>,
    /// Squared rms velocity of the plate over the last hour, 1e-3 to 100, in m2/s. Default: 25.
    pub exposure_dose_max_m2_s: Option<f64>,
    /// Longest pause that an operator may ask for, 1 to 3600, in s; the run ends then. Default: 600.
    pub pause_max_s: Option<f64>,
    /// 0 to 0.05: how long a link's thread may be held up beyond three of its periods, in s. Default: 0.02.
    pub link_stall_s: Option<f64>,
    /// Missed deadlines among a thousand, to 100. Default: 10.
    pub late_cycles_max: Option<u32>,
    /// Missed deadlines in a row that are one too many, to 50. Default: 3.
    pub late_in_a_row_max: Option<u32>,
    /// `Q / (pi f)` of the plate, 1e-5 to 0.05, in s. Default: 0.0025.
    pub plate_ring_time_s: Option<f64>,
}

/// How long a link's thread may be held up on a machine that does nothing else, and the longest that a setup may allow.
const LINK_STALL_S: f64 = 0.02;
const LINK_STALL_MAX_S: f64 = 0.05;
/// A dead force sensor is noticed within this time, in s: 50 samples at 20 a second.
const FROZEN_MAX_S: f64 = 2.5;

/// Equal amplitudes in a row that count as frozen, where the profile states that the readback has noise.
const FROZEN_AFTER: u32 = 200;

/// Rates at which a channel may be read, by who it is: the periods of [`Limits::checked`] as rates.
fn rate(instrument: &InstrumentSetup, name: &'static str, low: f64) -> Result<f64, LimitError> {
    let stated = instrument.rate_hz.or_else(|| drivers::nominal_rate_hz(instrument));
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

/// The limits of a setup; every one that cannot be used is reported.
pub fn all_of(file: &SetupFile, person: bool, cycle: Nanos, wrong: &mut Problems<'_>) -> Option<Limits> {
    let mut file = file.clone();
    let mut reported = Vec::new();
    loop {
        let error = match of(&file, person, cycle) {
            Ok(limits) => return Some(limits),
            Err(error) => error,
        };
        let name = error.name();
        if reported.contains(&name) {
            return None;
        }
        reported.push(name);
        let remedy = match &error {
            LimitError::OutOfRange { value, low, high, .. } => unit_meant(name, *value, [*low, *high]),
            LimitError::AboveHard { value, hard, .. } => unit_meant(name, *value, [1e-3 * hard, *hard]),
            LimitError::Unusable { .. } => None,
        };
        let remedy = remedy
            .or_else(|| Some("docs/setup.md lists the limits with their defaults and hard ranges".into()));
        // The rate of a channel stands with its instrument, every other limit under [limits].
        match name {
            "amplifier" | "stage" | "supply_relay" | "safety_inputs" => {
                wrong.add(&[name, "rate_hz"], error.to_string(), remedy);
            }
            "force" => wrong.add(&["force"], error.to_string(), remedy),
            // The length of the travel is reported by its upper end, and may be the lower one's fault.
            "travel_max_m" if file.limits.travel_max_m.is_none() => {
                wrong.add(&["limits", "travel_min_m"], error.to_string(), remedy);
                file.limits.travel_min_m = None;
            }
            name => wrong.add(&["limits", name], error.to_string(), remedy),
        }
        forget(&mut file, name);
    }
}

/// Takes a reported value out of the file, so that the others are looked at.
fn forget(file: &mut SetupFile, name: &str) {
    let instruments = file.by_table_mut();
    instruments.into_iter().filter(|(table, _)| *table == name).for_each(|(_, one)| one.rate_hz = None);
    let Ok(serde_json::Value::Object(mut limits)) = serde_json::to_value(&file.limits) else { return };
    if limits.remove(name).is_some() {
        file.limits = serde_json::from_value(limits.into()).unwrap_or_default();
    }
}

/// Soft limits over the paper's, timing from the instruments' profiles.
fn of(file: &SetupFile, person: bool, cycle: Nanos) -> Result<Limits, LimitError> {
    let l = &file.limits;
    let mut limits = Limits::paper(cycle);
    macro_rules! stated {
        ($($name:ident)+) => { $(limits.$name = l.$name.unwrap_or(limits.$name);)+ };
    }
    stated!(
        normal_force_max_n lateral_force_max_n force_step_max_n force_rate_max_n_s
        amplitude_rate_max_m_s speed_max_m_s temperature_max_c exposure_max_s exposure_rest_s
        exposure_duty_max exposure_dose_max_m2_s frozen_after late_cycles_max late_in_a_row_max
        temperature_fitted
    );
    let set = |slot: &mut f64, value: Option<f64>| *slot = value.unwrap_or(*slot);
    set(&mut limits.frequency_hz.0, l.frequency_min_hz);
    set(&mut limits.frequency_hz.1, l.frequency_max_hz);
    set(&mut limits.travel_m.0, l.travel_min_m);
    set(&mut limits.travel_m.1, l.travel_max_m);
    limits.amplitude_max = l.amplitude_max_pp_m.map_or(limits.amplitude_max, PeakToPeak::from_metres);
    limits.human_contact = person;
    limits.dead_man_key = l.dead_man_key.unwrap_or(false);
    limits.supply_required = file.supply_relay.is_some();
    limits.load_commanded = file.stage.dead_weight_n.is_none();
    let profile = file.amplifier.description().ok();
    let (fed, supply_fed) = guards::watchdogs(file);
    limits.supply_watchdog = supply_fed;
    // A virtual rig inside this program drives nothing real: it may go without what a real one must have.
    limits.amplifier_watchdog = fed || file.virtual_rig.is_some();
    let noise = profile.as_ref().and_then(|profile| {
        profile.signal("amplitude").and_then(|signal| profile.description.signal[signal.0].noise)
    });
    limits.amplitude_frozen_after = l.amplitude_frozen_after.or(noise.map(|_| FROZEN_AFTER));
    if let Some(seconds) = l.plate_ring_time_s {
        limits.timing.ring_time = Timing::ring_time_of(seconds)?;
    }
    limits.timing.command_expiry = Timing::longest_expiry(cycle);

    // A channel is stale after a number of its own periods, never of the loop's cycles. On a general-purpose
    // kernel a link thread may be held up for some milliseconds: the latency allows for that and is stated.
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
    let pause = l.pause_max_s.unwrap_or(1.0);
    if !(1.0..=3600.0).contains(&pause) {
        let needed = "from 1 to 3600: an unused rig does not wait longer";
        return Err(LimitError::Unusable { name: "pause_max_s", value: pause, needed });
    }
    let slowest_s = limits.timing.lateral.period.max(limits.timing.normal.period).seconds();
    let (low, high) = (20.0, (FROZEN_MAX_S / slowest_s).round().clamp(50.0, 1000.0));
    let (name, value) = ("frozen_after", f64::from(limits.frozen_after));
    if value > high && value <= 1000.0 {
        let why = "more are over 2.5 s of a dead sensor at its rate";
        return Err(LimitError::OutOfRange { name, value, low, high, why });
    }
    limits.checked()
}

#[cfg(test)]
mod tests {
    use crate::setup::{BUNDLED, Setup};
    use std::path::Path;

    fn refused(from: &str, to: &str) -> String {
        let text = Setup::load("virtual-ideal").unwrap().text;
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1);
        Setup::parse("changed", &changed, Path::new(".")).err().map(|e| format!("{e:#}")).unwrap_or_default()
    }

    #[test]
    fn every_bundled_setup_is_within_the_ranges() {
        for (name, _) in BUNDLED {
            Setup::load(name).unwrap_or_else(|e| panic!("{name}: {e:?}"));
        }
    }

    /// Setups that switched rules off, each of which 'check' called good.
    #[test]
    fn no_setup_switches_a_rule_off() {
        for rate in ["0", "nan", "-5", "inf", "1", "0.001", "19.9", "1e6"] {
            let why = refused(
                "profile = \"muprime-force2\"",
                &format!("profile = \"muprime-force2\"\nrate_hz = {rate}"),
            );
            assert!(why.contains("force") && why.contains("20 to 100000"), "{rate}: {why}");
        }
        for rate in ["0.01", "5", "9.9", "nan"] {
            for profile in ["amplifier", "stage"] {
                let stated = format!("profile = \"muprime-{profile}\"");
                let why = refused(&stated, &format!("{stated}\nrate_hz = {rate}"));
                assert!(why.contains(profile) && why.contains("10 to 100000"), "{rate}: {why}");
            }
        }
        for (key, values) in [
            ("plate_ring_time_s", ["2.5", "1e6", "-1", "nan"]),
            ("force_rate_max_n_s", ["1e12", "0", "-1", "nan"]),
            ("travel_min_m", ["-1e9", "0.5", "inf", "nan"]),
            ("travel_max_m", ["1e9", "-0.5", "inf", "nan"]),
            ("force_step_max_n", ["1e9", "0", "-1", "nan"]),
            ("amplitude_rate_max_m_s", ["2.5e3", "0", "-1", "nan"]),
            ("amplitude_frozen_after", ["19", "1001", "0", "4000000000"]),
            ("link_stall_s", ["0.051", "2.5", "-1", "nan"]),
            ("late_in_a_row_max", ["51", "0", "1000", "4000000000"]),
        ] {
            for value in values {
                let text = Setup::load("virtual-ideal").unwrap().text;
                let rest: String =
                    text.lines().filter(|l| !l.starts_with(key)).map(|l| format!("{l}\n")).collect();
                let changed = rest.replacen("[limits]\n", &format!("[limits]\n{key} = {value}\n"), 1);
                let why = Setup::parse("changed", &changed, Path::new(".")).err().map(|e| format!("{e:#}"));
                let why = why.unwrap_or_default();
                assert!(why.contains(key) || why.contains("travel_max_m"), "{key} = {value}: {why}");
            }
        }
        let just = refused("profile = \"muprime-stage\"", "profile = \"muprime-stage\"\nrate_hz = 10");
        assert_eq!(just, "");
    }
}
