//! Which instrument a setup means, however its address is spelt: what one controller claims and another must find claimed.

use super::OpenError;
use super::modbus_tcp::resolve;
use super::setup::{InstrumentSetup, InstrumentsSetup};
use instruments::LinkKind;
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};

/// The identities of all instruments of a setup that exist outside this process: each by its place and, where
/// the setup names it, by its serial number. What drives or moves is claimed with all that answers at its
/// socket: many devices do not look at the unit of a request, and would be driven twice under two units.
///
/// # Errors
/// A profile that does not exist, or an address that stands for nothing.
pub fn identities(setup: &InstrumentsSetup) -> Result<BTreeSet<String>, OpenError> {
    let mut all = BTreeSet::new();
    for instrument in [&setup.amplifier, &setup.stage].into_iter().chain(&setup.supply_relay) {
        all.extend(every(instrument)?);
    }
    for instrument in setup.force.iter().chain(&setup.safety_inputs) {
        all.extend(place(instrument)?);
        all.extend(by_serial(instrument));
    }
    Ok(all)
}

/// Every identity of one instrument that drives or moves: its place, the socket that it answers at, and its
/// serial number where the setup names it. None where it exists within this process only.
///
/// # Errors
/// A profile that does not exist, or an address that stands for nothing.
pub fn every(instrument: &InstrumentSetup) -> Result<BTreeSet<String>, OpenError> {
    let Some(place) = place(instrument)? else { return Ok(BTreeSet::new()) };
    let socket = place.split_once("/unit ").map(|(socket, _)| socket.to_string());
    Ok(socket.into_iter().chain(by_serial(instrument)).chain([place]).collect())
}

fn by_serial(instrument: &InstrumentSetup) -> Option<String> {
    instrument.serial.as_ref().map(|serial| format!("serial/{}/{serial}", instrument.profile))
}

/// Where an instrument is; `None` where the place is made by this process for itself.
fn place(instrument: &InstrumentSetup) -> Result<Option<String>, OpenError> {
    let address = instrument.address.as_str();
    let profile = instrument.description()?;
    let link = &profile.description.link;
    let line = |address: &str| {
        let path = address.split_once(':').map_or(address, |(_, path)| path);
        let canonical = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        (path != "pty").then(|| format!("line{}", canonical.display()))
    };
    let socket = |address: &str| {
        let found = resolve(address, link.port).map_err(|problem| instrument.mismatch(problem))?;
        Ok((found.port() != 0).then(|| spelt_one_way(found)))
    };
    Ok(match link.kind {
        LinkKind::ModbusTcp if !address.starts_with("rtu:") => {
            let unit = instrument.unit.or(link.unit).unwrap_or(255);
            socket(address)?.map(|socket| format!("tcp/{socket}/unit {unit}"))
        }
        LinkKind::Sysfs => {
            let folder = std::fs::canonicalize(address).unwrap_or_else(|_| address.into());
            Some(format!("folder{}", folder.display()))
        }
        LinkKind::Udp => match link.local_port {
            Some(port) => Some(format!("udp here/{port}")),
            None => socket(address)?.map(|socket| format!("udp/{socket}")),
        },
        LinkKind::Scpi | LinkKind::Tcp | LinkKind::Serial
            if link.kind != LinkKind::Serial || address.starts_with("tcp:") =>
        {
            let host = address.strip_prefix("tcp:").unwrap_or(address);
            socket(host)?.map(|socket| format!("tcp/{socket}"))
        }
        LinkKind::ModbusTcp | LinkKind::ModbusRtu | LinkKind::Serial | LinkKind::Tcp | LinkKind::Scpi => {
            line(address)
        }
        LinkKind::Can | LinkKind::Canopen if address.starts_with("slcan:") => line(address),
        LinkKind::Can | LinkKind::Canopen => {
            let node = instrument.base.or(link.base).or(link.node.map(u32::from)).unwrap_or(0);
            Some(format!("bus/{address}/{node}"))
        }
    })
}

/// All addresses of this machine are one: what listens on one of them mostly listens on all.
fn spelt_one_way(address: SocketAddr) -> SocketAddr {
    let ip = address.ip().to_canonical();
    // Only an address of this machine can be bound.
    let own = ip.is_loopback() || ip.is_unspecified() || UdpSocket::bind((ip, 0)).is_ok();
    SocketAddr::new(if own { IpAddr::V4(Ipv4Addr::LOCALHOST) } else { ip }, address.port())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(profile: &str, address: &str) -> Option<String> {
        place(&InstrumentSetup::new(profile, address)).unwrap()
    }

    #[test]
    fn spellings_of_one_place_are_one_instrument() {
        let all = [
            "127.0.0.1:1502",
            "localhost:1502",
            "0.0.0.0:1502",
            "[::1]:1502",
            "127.0.0.1",
            "[::ffff:127.0.0.1]:1502",
        ];
        let found: BTreeSet<_> =
            all.iter().map(|address| of("muprime-amplifier", address).unwrap()).collect();
        assert_eq!(found.len(), 1, "{found:?}");
        assert_ne!(of("muprime-amplifier", "127.0.0.1:1502"), of("muprime-amplifier", "127.0.0.1:1503"));
        assert_ne!(of("muprime-amplifier", "127.0.0.1"), of("muprime-stage", "127.0.0.1"), "two units");
        let served = |address: &str| of("piezodrive-pdus210", address).unwrap();
        assert_eq!(served("tcp:127.0.0.1:4001"), served("tcp:localhost:4001"), "behind a device server");
    }

    /// A device that does not look at the unit is one device, whatever unit a setup names.
    #[test]
    fn what_drives_has_its_socket_to_itself_and_a_serial_number_hides_no_place() {
        let amplifier = |unit: u8, serial: Option<&str>| {
            let mut one = InstrumentSetup::new("muprime-amplifier", "10.0.0.7");
            (one.unit, one.serial) = (Some(unit), serial.map(String::from));
            every(&one).unwrap()
        };
        assert!(!amplifier(2, None).is_disjoint(&amplifier(7, None)));
        assert!(!amplifier(2, None).is_disjoint(&amplifier(2, Some("a"))));
        assert!(!amplifier(2, Some("b")).is_disjoint(&amplifier(2, Some("a"))));
        let rig = |unit: u8| {
            let at = |profile| InstrumentSetup::new(profile, "10.0.0.7");
            let mut setup = InstrumentsSetup {
                force: vec![at("muprime-force2")],
                amplifier: at("muprime-amplifier"),
                stage: at("muprime-stage"),
                ..Default::default()
            };
            setup.amplifier.unit = Some(unit);
            identities(&setup).unwrap()
        };
        assert!(rig(2).contains("tcp/10.0.0.7:1502") && !rig(2).is_disjoint(&rig(7)));
    }

    #[test]
    fn a_link_to_a_device_is_the_device() {
        let folder = std::env::temp_dir().join(format!("muprime-identity-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (device, by_id) = (folder.join("ttyX"), folder.join("by-id"));
        std::fs::write(&device, "").unwrap();
        std::os::unix::fs::symlink(&device, &by_id).unwrap();
        let (one, other) = (device.to_str().unwrap(), by_id.to_str().unwrap());
        let same = of("piezodrive-pdus210", one) == of("piezodrive-pdus210", other);
        let adapter = of("me-gsv4-can", &format!("slcan:{other}")) == of("piezodrive-pdus210", one);
        std::fs::remove_dir_all(&folder).unwrap();
        assert!(same && adapter);
    }

    #[test]
    fn what_this_process_makes_for_itself_is_nobody_elses() {
        assert_eq!(of("muprime-amplifier", "127.0.0.1:0"), None);
        assert_eq!(of("piezodrive-pdus210", "pty"), None);
        assert_eq!(of("me-gsv4-can", "slcan:pty"), None);
    }
}
