//! What happens at a rig, published to the laboratory, read only: nothing that a broker says is listened to.
//!
//! Off by default, and never in the loop: messages go into a bounded queue that nothing waits for. If it is
//! full, because a broker is slow or gone, messages are dropped and counted; the run continues.

#[cfg(feature = "mqtt")]
mod mqtt;
#[cfg(not(feature = "mqtt"))]
mod without;

#[cfg(feature = "mqtt")]
pub use mqtt::Publisher;
#[cfg(not(feature = "mqtt"))]
pub use without::Publisher;

/// Where to publish: `mqtt://[user@]host[:port]/prefix`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broker {
    /// Name or address.
    pub host: String,
    /// Port.
    pub port: u16,
    /// What every topic begins with.
    pub prefix: String,
    /// User, whose password is in `MUPRIME_MQTT_PASSWORD`.
    pub user: Option<String>,
}

impl std::str::FromStr for Broker {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = |why: &str| format!("{why}; as in mqtt://127.0.0.1:1883/lab/rig-1");
        let rest = text.strip_prefix("mqtt://").ok_or_else(|| wrong("it begins with mqtt://"))?;
        let (authority, prefix) = rest.split_once('/').unwrap_or((rest, "muprime"));
        let (user, place) = match authority.rsplit_once('@') {
            Some((user, _)) if user.contains(':') => {
                return Err("no password on the command line: put it into MUPRIME_MQTT_PASSWORD".into());
            }
            Some((user, place)) => (Some(user.to_string()), place),
            None => (None, authority),
        };
        let bare = place.starts_with('[') && place.ends_with(']');
        let (host, port) = match place.rsplit_once(':').filter(|_| !bare) {
            Some((host, port)) => (host, port.parse().map_err(|_| wrong("its port is a number"))?),
            None => (place, 1883),
        };
        let host = host.trim_start_matches('[').trim_end_matches(']');
        let prefix = prefix.trim_end_matches('/');
        if host.is_empty() || prefix.is_empty() || prefix.contains(['+', '#', '\0']) {
            return Err(wrong("a host is needed, and a prefix without + and #"));
        }
        Ok(Broker { host: host.into(), port, prefix: prefix.into(), user })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_broker_is_read_from_its_address() {
        let read = |text: &str| text.parse::<Broker>();
        let broker = |host: &str, port, prefix: &str| Broker {
            host: host.into(),
            port,
            prefix: prefix.into(),
            user: None,
        };
        assert_eq!(read("mqtt://127.0.0.1:1884/lab/rig"), Ok(broker("127.0.0.1", 1884, "lab/rig")));
        assert_eq!(read("mqtt://broker"), Ok(broker("broker", 1883, "muprime")));
        assert_eq!(read("mqtt://[::1]:7/x/"), Ok(broker("::1", 7, "x")));
        assert_eq!(read("mqtt://[::1]/x"), Ok(broker("::1", 1883, "x")));
        assert_eq!(read("mqtt://ann@broker/x").unwrap().user.as_deref(), Some("ann"));
        for wrong in
            ["broker", "http://x", "mqtt:///x", "mqtt://x:port/y", "mqtt://x/a/#", "mqtt://a:secret@x/y"]
        {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }
}
