//! Talks to the instruments of a setup one by one and says of each what it found; one that fails keeps none of the
//! others from being asked. Nothing is commanded but the safe set-points with which every driver ends.

use super::{Endpoint, mismatch, open_one};
use super::{HealthReport, InstrumentSetup, InstrumentsSetup, OpenError};
use realtime::ports::{Amplifier, ForceSensor, Nanos, NoData, Reading, Stage};
use std::time::{Duration, Instant};

/// What one instrument said.
#[derive(Debug)]
pub struct Probed {
    /// Profile of the instrument.
    pub id: String,
    /// Where the setup says that it is.
    pub address: String,
    /// What the setup uses it as: `force`, `amplifier` or `stage`.
    pub role: &'static str,
    /// Its state in words and what its link counted, or why there is none.
    pub outcome: Result<(String, HealthReport), OpenError>,
}

/// Asks every instrument for so long.
pub fn probe(setup: &InstrumentsSetup, each: Duration) -> Vec<Probed> {
    let force = setup.force.iter().map(|instrument| ("force", instrument));
    let all = force.chain([("amplifier", &setup.amplifier), ("stage", &setup.stage)]);
    all.map(|(role, instrument)| Probed {
        id: instrument.profile.clone(),
        address: instrument.address.clone(),
        role,
        outcome: one(role, instrument, each),
    })
    .collect()
}

fn one(
    role: &str,
    instrument: &InstrumentSetup,
    each: Duration,
) -> Result<(String, HealthReport), OpenError> {
    let wrong = |problem: String| mismatch(instrument, problem);
    let found = instrument.description()?;
    let epoch = Instant::now();
    let talk = |endpoint: Endpoint, state: &mut dyn FnMut(Nanos) -> String| {
        let health = endpoint.health();
        let _link = open_one(instrument, endpoint, epoch)?;
        let (asked, mut last) = (Instant::now(), String::new());
        while asked.elapsed() < each {
            // Read as the loop would, else the ring fills and samples are counted as refused.
            std::thread::sleep(Duration::from_millis(5));
            last = state(Nanos(u64::try_from(epoch.elapsed().as_nanos()).unwrap_or(u64::MAX)));
        }
        Ok((last, health.report()))
    };
    match role {
        "force" => {
            let (endpoint, (mut port, (lateral, normal))) =
                Endpoint::force(found, instrument).map_err(wrong)?;
            talk(endpoint, &mut |now| {
                let forces = port.read(now);
                let axes = [("lateral", lateral, forces.lateral), ("normal", normal, forces.normal)];
                let fitted = axes.into_iter().filter(|(_, fitted, _)| *fitted);
                fitted.map(|(name, _, read)| force(name, read)).collect::<Vec<_>>().join(", ")
            })
        }
        "amplifier" => {
            let (endpoint, mut port) = Endpoint::amplifier(found, instrument).map_err(wrong)?;
            talk(endpoint, &mut |now| match port.state(now) {
                Err(reason) => format!("no state: {reason:?}"),
                Ok(s) => format!(
                    "output {}, set to {:.2} um peak-to-peak at {:.1} Hz{}",
                    if s.output_on { "ON" } else { "off" },
                    s.echoed_amplitude.metres() * 1e6,
                    s.echoed_frequency_hz,
                    if s.fault { ", FAULT" } else { "" }
                ),
            })
        }
        _ => {
            let (endpoint, mut port) = Endpoint::stage(found, instrument).map_err(wrong)?;
            talk(endpoint, &mut |now| match port.state(now) {
                Err(reason) => format!("no state: {reason:?}"),
                Ok(s) => format!(
                    "at {:.3} mm, {:.2} mm/s{}{}",
                    s.position_m * 1e3,
                    s.velocity_m_s * 1e3,
                    if s.at_limit { ", on a limit of its travel" } else { "" },
                    if s.fault { ", FAULT" } else { "" }
                ),
            })
        }
    }
}

fn force(axis: &str, read: Result<Reading, NoData>) -> String {
    match read {
        Ok(reading) => format!("{axis} {:+.4} N ({:?})", reading.value, reading.quality),
        Err(reason) => format!("{axis} missing: {reason:?}"),
    }
}
