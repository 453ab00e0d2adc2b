//! MQTT 3.1.1, without TLS: for a broker on this machine or on the laboratory's own network.

use super::Broker;
use miette::IntoDiagnostic;
use realtime::threads;
use rumqttc::{Client, ConnectionError, Event, LastWill, MqttOptions, Outgoing, QoS};
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

/// Messages that wait for the broker at most: 25 s of states.
const QUEUE: usize = 256;
/// Pause between two attempts to reach a broker.
const RETRY: Duration = Duration::from_secs(1);
/// How long the end of a run waits for what is still in the queue.
const LAST_WORDS: Duration = Duration::from_secs(1);
/// Largest message in bytes.
const LARGEST: usize = 1 << 20;

/// A connection to a broker, and the queue to it.
pub struct Publisher {
    client: Client,
    prefix: String,
    given: u64,
    dropped: u64,
    shared: Arc<Shared>,
    ended: Receiver<()>,
}

#[derive(Default)]
struct Shared {
    connected: AtomicBool,
    answered: AtomicBool,
    complained: AtomicBool,
    ending: AtomicBool,
}

impl Publisher {
    /// Begins to connect, in a thread of its own; that a broker is not there is no error.
    ///
    /// # Errors
    /// The system gives no thread.
    pub fn start(broker: &Broker) -> miette::Result<Self> {
        let mut options =
            MqttOptions::new(format!("muprime-{}", std::process::id()), broker.host.as_str(), broker.port);
        options.set_keep_alive(Duration::from_secs(5));
        options.set_max_packet_size(LARGEST, LARGEST);
        // Subscribers get this when the program is gone without a word.
        let will = LastWill::new(topic(&broker.prefix, "run"), r#"{"state":"lost"}"#, QoS::AtLeastOnce, true);
        options.set_last_will(will);
        if let Some(user) = &broker.user {
            options.set_credentials(user, std::env::var("MUPRIME_MQTT_PASSWORD").unwrap_or_default());
        }
        let (client, mut connection) = Client::new(options, QUEUE);
        let shared = Arc::<Shared>::default();
        let (end, ended) = channel();
        let (seen, place) = (Arc::clone(&shared), format!("{}:{}", broker.host, broker.port));
        let connect = move || {
            for event in connection.iter() {
                if !follow(&event, &seen, &place) {
                    break;
                }
            }
            let _ = end.send(());
        };
        threads::spawn("mqtt", connect).into_diagnostic()?;
        Ok(Publisher { client, prefix: broker.prefix.clone(), given: 0, dropped: 0, shared, ended })
    }

    /// Puts a message into the queue, or drops it where that is full.
    pub fn publish(&mut self, name: &str, message: &Value) {
        // States are many, and the next one is better than an old one; everything else is wanted once.
        let (quality, retain) = match name {
            "state" | "progress" => (QoS::AtMostOnce, false),
            "run" | "trip" => (QoS::AtLeastOnce, true),
            _ => (QoS::AtLeastOnce, false),
        };
        let sent = self.client.try_publish(topic(&self.prefix, name), quality, retain, message.to_string());
        self.given += 1;
        self.dropped += u64::from(sent.is_err());
    }

    /// Waits a moment for what is in the queue, and says what was not published; `None` where all was.
    pub fn end(self) -> Option<String> {
        self.shared.ending.store(true, Ordering::Relaxed);
        if !self.shared.answered.load(Ordering::Relaxed) {
            return Some(format!("the broker never answered: none of {} messages was published", self.given));
        }
        let connected = self.shared.connected.load(Ordering::Relaxed);
        let whole =
            connected && self.client.try_disconnect().is_ok() && self.ended.recv_timeout(LAST_WORDS).is_ok();
        match (self.dropped, whole) {
            (0, true) => None,
            (0, false) => Some("the last messages may not have been published".into()),
            (dropped, true) => Some(format!("{dropped} messages were not published")),
            (dropped, false) => {
                Some(format!("{dropped} messages were not published, and the last ones may be missing"))
            }
        }
    }
}

fn topic(prefix: &str, name: &str) -> String {
    format!("{prefix}/{name}")
}

/// Takes what the connection says. False: it is at its end.
fn follow(event: &Result<Event, ConnectionError>, shared: &Shared, place: &str) -> bool {
    let ending = shared.ending.load(Ordering::Relaxed);
    match event {
        Ok(Event::Outgoing(Outgoing::Disconnect)) => return false,
        Ok(Event::Incoming(rumqttc::Packet::ConnAck(_))) => {
            shared.connected.store(true, Ordering::Relaxed);
            shared.answered.store(true, Ordering::Relaxed);
            tracing::info!(place, "publishing");
        }
        Ok(_) => {}
        Err(_) if ending => return false,
        Err(why) => {
            // Once while it is gone; the next word is that it is there again.
            let gone = shared.connected.swap(false, Ordering::Relaxed);
            if !shared.complained.swap(true, Ordering::Relaxed) || gone {
                tracing::warn!(place, "nothing is published now, and the run goes on: {why}");
            }
            #[allow(clippy::disallowed_methods, reason = "a thread beside everything else")]
            std::thread::sleep(RETRY);
        }
    }
    true
}
