//! Which instrument a setup means, however its address is spelt: what one controller claims and another must find claimed.

use super::modbus_tcp::resolve;
use super::setup::{InstrumentSetup, InstrumentsSetup};
use super::{OpenError, mismatch};
use instruments::schema::LinkKind;
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, UdpSocket};

/// The identities of all instruments of a setup that exist outside this process. An instrument has one by its address and, where
/// the setup names its serial number, one by that.
///
/// # Errors
/// A profile that does not exist, or an address that stands for nothing.
pub fn identities(setup: &InstrumentsSetup) -> Result<BTreeSet<String>, OpenError> {
    let mut all = BTreeSet::new();
    for instrument in setup.all() {
        all.extend(place(instrument)?);
        all.extend(by_serial(instrument));
    }
    Ok(all)
}

/// The identity of one instrument: by its serial number where the setup names it, else by its address. `None` where it exists
/// within this process only.
///
/// # Errors
/// A profile that does not exist, or an address that stands for nothing.
pub fn identity(instrument: &InstrumentSetup) -> Result<Option<String>, OpenError> {
    let place = place(instrument)?;
    Ok(place.map(|place| by_serial(instrument).unwrap_or(place)))
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
        let found = resolve(address, link.port).map_err(|problem| mismatch(instrument, problem))?;
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
        LinkKind::Udp => {
            let own = link.local_port.map(|port| format!("udp here/{port}"));
            own.map_or_else(
                || socket(address).map(|s| s.map(|socket| format!("udp/{socket}"))),
                |own| Ok(Some(own)),
            )?
        }
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
