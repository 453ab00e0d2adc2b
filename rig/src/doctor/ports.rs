//! The instruments of a setup, each opened by itself; all stay open together.

use super::Role;
use drivers::endpoint::Endpoint;
use drivers::ports::{AmplifierPort, ContactsPort, ForcePort, Merged, StagePort, SupplyPort};
use drivers::{HealthReport, InstrumentSetup, InstrumentsSetup, Links, OpenError};
use realtime::ports::{Amplifier, Contacts, ForceSensor, Nanos, NoData, SafetyInputs, Stage, SupplySwitch};
use realtime::safety::Observation;
use runs::setup::Setup;
use std::time::Instant;

enum Port {
    Force(ForcePort, (bool, bool)),
    Amplifier(AmplifierPort),
    Stage(StagePort),
    Supply(SupplyPort),
    Contacts(ContactsPort),
}

fn open_one(role: Role, instrument: &InstrumentSetup, epoch: Instant) -> Result<(Links, Port), OpenError> {
    let profile = instrument.description()?;
    let (endpoint, port) = match role {
        "force" => Endpoint::force(profile, instrument).map(|(e, (port, axes))| (e, Port::Force(port, axes))),
        "amplifier" => Endpoint::amplifier(profile, instrument).map(|(e, port)| (e, Port::Amplifier(port))),
        "stage" => Endpoint::stage(profile, instrument).map(|(e, port)| (e, Port::Stage(port))),
        "supply_relay" => Endpoint::supply(profile).map(|(e, port)| (e, Port::Supply(port))),
        _ => Endpoint::contacts(profile, instrument).map(|(e, port)| (e, Port::Contacts(port))),
    }
    .map_err(|problem| instrument.mismatch(problem))?;
    Ok((drivers::open_one(instrument, endpoint, epoch)?, port))
}

/// An instrument, and its link where it could be opened.
pub struct Opened<'a> {
    /// What it is to the rig.
    pub role: Role,
    /// Its place in the setup.
    pub instrument: &'a InstrumentSetup,
    /// Which axes it gives, lateral and normal.
    pub axes: (bool, bool),
    /// Its link, or why there is none.
    pub link: Result<Links, OpenError>,
}

impl Opened<'_> {
    /// What its link has counted so far.
    pub fn health(&self) -> HealthReport {
        let links = self.link.as_ref().ok();
        links.and_then(|links| links.health().next().map(|(_, health)| health)).unwrap_or_default()
    }
}

/// The ports of what could be opened.
pub struct Bench {
    force: Box<dyn ForceSensor>,
    /// The amplifier.
    pub amplifier: Option<AmplifierPort>,
    /// The stage.
    pub stage: Option<StagePort>,
    /// The second switch-off channel.
    pub supply: Option<SupplyPort>,
    /// The safety contacts.
    pub contacts: Option<ContactsPort>,
}

/// Opens every instrument; one that fails keeps none of the others from being opened.
pub fn open<'a>(
    setup: &Setup,
    instruments: &'a InstrumentsSetup,
    epoch: Instant,
) -> (Vec<Opened<'a>>, Bench) {
    let force = instruments.force.iter().map(|i| ("force", i));
    let others = [("amplifier", &instruments.amplifier), ("stage", &instruments.stage)];
    let relay = instruments.supply_relay.iter().map(|i| ("supply_relay", i));
    let inputs = instruments.safety_inputs.iter().map(|i| ("safety_inputs", i));
    let mut forces = Vec::new();
    let mut bench = Bench {
        force: Box::new(Merged(Vec::new())),
        amplifier: None,
        stage: None,
        supply: None,
        contacts: None,
    };
    let mut one = |(role, instrument): (Role, &'a InstrumentSetup)| {
        let mut axes = (false, false);
        let link = open_one(role, instrument, epoch).map(|(links, port)| {
            match port {
                Port::Force(port, given) => {
                    axes = given;
                    forces.push((port, given));
                }
                Port::Amplifier(port) => bench.amplifier = Some(port),
                Port::Stage(port) => bench.stage = Some(port),
                Port::Supply(port) => bench.supply = Some(port),
                Port::Contacts(port) => bench.contacts = Some(port),
            }
            links
        });
        Opened { role, instrument, axes, link }
    };
    let all: Vec<Opened<'a>> = force.chain(others).chain(relay).chain(inputs).map(&mut one).collect();
    let merged: Box<dyn ForceSensor> = Box::new(Merged(forces));
    // A certificate speaks of both axes.
    let whole = all.iter().all(|o| o.link.is_ok());
    bench.force = if whole { setup.certificates.calibrated(merged) } else { merged };
    (all, bench)
}

impl Bench {
    /// What the loop would see now.
    pub fn look(&mut self, now: Nanos) -> Observation {
        Observation {
            forces: self.force.read(now),
            amplifier: self.amplifier.as_mut().map_or(Err(NoData::NotFitted), |port| port.state(now)),
            stage: self.stage.as_mut().map_or(Err(NoData::NotFitted), |port| port.state(now)),
            lateness: Nanos(0),
            supply: self.supply.as_mut().map_or(Err(NoData::NotFitted), |port| port.state(now)),
            contacts: self.contacts.as_mut().map_or(Contacts::ABSENT, |port| port.read(now)),
        }
    }
}
