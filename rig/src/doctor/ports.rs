//! The instruments of a setup, each opened by itself; all stay open together.

use super::Role;
use drivers::endpoint::Endpoint;
use drivers::ports::{AmplifierPort, ContactsPort, Merged, StagePort, SupplyPort};
use drivers::{HealthReport, InstrumentSetup, InstrumentsSetup, Links, OpenError, SetupError};
use instruments::Profile;
use realtime::ports::{Amplifier, Contacts, ForceSensor, Nanos, NoData, SafetyInputs, Stage, SupplySwitch};
use realtime::safety::Observation;
use runs::Setup;
use std::time::Instant;

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
pub struct OpenPorts {
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

/// Opens one instrument beside those that are open; its port where that worked.
fn open_one<'a, Port>(
    all: &mut Vec<Opened<'a>>,
    (role, instrument): (Role, &'a InstrumentSetup),
    epoch: Instant,
    endpoint: impl FnOnce(Profile) -> Result<(Endpoint, Port), SetupError>,
) -> Option<Port> {
    let opened = instrument.description().and_then(|profile| {
        let (endpoint, port) = endpoint(profile).map_err(|problem| instrument.mismatch(problem))?;
        Ok((drivers::open_one(instrument, endpoint, epoch)?, port))
    });
    let (link, port) = match opened {
        Ok((links, port)) => (Ok(links), Some(port)),
        Err(error) => (Err(error), None),
    };
    all.push(Opened { role, instrument, axes: (false, false), link });
    port
}

/// Opens every instrument; one that fails keeps none of the others from being opened.
pub fn open<'a>(
    setup: &Setup,
    instruments: &'a InstrumentsSetup,
    epoch: Instant,
) -> (Vec<Opened<'a>>, OpenPorts) {
    let (mut all, mut forces) = (Vec::new(), Vec::new());
    for own in &instruments.force {
        let opened = open_one(&mut all, ("force", own), epoch, |profile| Endpoint::force(profile, own));
        if let (Some((port, axes)), Some(own)) = (opened, all.last_mut()) {
            own.axes = axes;
            forces.push((port, axes));
        }
    }
    let own = &instruments.amplifier;
    let amplifier =
        open_one(&mut all, ("amplifier", own), epoch, |profile| Endpoint::amplifier(profile, own));
    let own = &instruments.stage;
    let stage = open_one(&mut all, ("stage", own), epoch, |profile| Endpoint::stage(profile, own));
    let relay = instruments.supply_relay.as_ref();
    let supply = relay.and_then(|own| open_one(&mut all, ("supply_relay", own), epoch, Endpoint::supply));
    let contacts = instruments.safety_inputs.as_ref().and_then(|own| {
        open_one(&mut all, ("safety_inputs", own), epoch, |profile| Endpoint::contacts(profile, own))
    });
    let merged: Box<dyn ForceSensor> = Box::new(Merged(forces));
    // A certificate speaks of both axes.
    let whole = all.iter().all(|o| o.link.is_ok());
    let force = if whole { setup.certificates.calibrated(merged) } else { merged };
    (all, OpenPorts { force, amplifier, stage, supply, contacts })
}

impl OpenPorts {
    /// What the loop would see now.
    pub fn read(&mut self, now: Nanos) -> Observation {
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
