//! MQTT 3.1.1, without TLS: for a broker on this machine or on the laboratory's own network.

use super::Broker;
use miette::IntoDiagnostic;
use rumqttc::{Client, ConnectionError, Event, LastWill, MqttOptions, Outgoing, QoS};
use serde_json::Value;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
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
    dropped: u64,
    shared: Arc<Shared>,
    ended: Receiver<()>,
}

#[derive(Default)]
struct Shared {
    connected: AtomicBool,
    ending: AtomicBool,
    sent: AtomicU64,
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
        // Whoever follows is told when this program is gone without a word.
        let will = LastWill::new(topic(&broker.prefix, "run"), r#"{"state":"lost"}"#, QoS::AtLeastOnce, true);
        options.set_last_will(will);
        if let Some(user) = &broker.user {
            options.set_credentials(user, std::env::var("MUPRIME_MQTT_PASSWORD").unwrap_or_default());
        }
        let (client, mut connection) = Client::new(options, QUEUE);
        let shared = Arc::<Shared>::default();
        let (end, ended) = channel();
        let (seen, place) = (Arc::clone(&shared), format!("{}:{}", broker.host, broker.port));
        std::thread::Builder::new()
            .name("mqtt".into())
            .spawn(move || {
                for event in connection.iter() {
                    if !follow(&event, &seen, &place) {
                        break;
                    }
                }
                let _ = end.send(());
            })
            .into_diagnostic()?;
        Ok(Publisher { client, prefix: broker.prefix.clone(), dropped: 0, shared, ended })
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
        self.dropped += u64::from(sent.is_err());
    }

    /// Waits a moment for what is in the queue, and says how many messages were dropped and whether all others have left.
    pub fn end(mut self) -> (u64, bool) {
        self.shared.ending.store(true, Ordering::Relaxed);
        if !self.shared.connected.load(Ordering::Relaxed) {
            return (self.dropped, false);
        }
        if self.client.try_disconnect().is_err() {
            self.dropped += 1;
            return (self.dropped, false);
        }
        (self.dropped, self.ended.recv_timeout(LAST_WORDS).is_ok())
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
        Ok(Event::Outgoing(Outgoing::Publish(_))) => {
            shared.sent.fetch_add(1, Ordering::Relaxed);
        }
        Ok(Event::Incoming(rumqttc::Packet::ConnAck(_))) => {
            shared.connected.store(true, Ordering::Relaxed);
            tracing::info!(place, "publishing");
        }
        Ok(_) => {}
        Err(_) if ending => return false,
        Err(why) => {
            if shared.connected.swap(false, Ordering::Relaxed) || shared.sent.load(Ordering::Relaxed) == 0 {
                tracing::warn!(place, "nothing is published now, and the run goes on: {why}");
                // Told once; the next word is that it is there again.
                shared.sent.fetch_max(1, Ordering::Relaxed);
            }
            #[allow(clippy::disallowed_methods, reason = "a thread beside everything else")]
            std::thread::sleep(RETRY);
        }
    }
    true
}
