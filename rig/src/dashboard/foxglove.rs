//! The Foxglove WebSocket protocol (`foxglove.sdk.v1`, and `foxglove.websocket.v1` with the same messages):
//! the topics of an export, live, for Foxglove, PlotJuggler and other clients. See
//! <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>.
//!
//! Every topic is advertised at once; `/force/..` and the like have a message per state, ten a second, with
//! the time that the record has for that cycle. Passes and events have the time of the state before them. A
//! new subscription begins with all passes and events so far and the last state. Nothing that a client sends
//! reaches the run.

use super::api::Server;
use super::server::Shared;
use super::{pages, stream};
use crate::live::{Message, TimedEvent, View};
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use runs::MeasuredPass;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;
use tables::export::topics::{self, Topic};
use tokio::sync::mpsc::{Receiver, Sender};

/// The subprotocols, the newer one first.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Largest message from a client in bytes: subscriptions to all topics are some kilobytes.
const LARGEST: usize = 64 * 1024;
/// Time between two polls for a live run.
const POLL_EVERY: Duration = Duration::from_millis(500);
/// First byte of a binary message with data.
const MESSAGE_DATA: u8 = 1;

/// Levels of a status: information, an error of the client.
const INFO: u8 = 0;
const ERROR: u8 = 2;

/// Answers a client that follows the newest live run, and the next one after its end.
pub async fn newest(State(shared): Server, upgrade: WebSocketUpgrade) -> Response {
    begin(shared, None, upgrade)
}

/// Answers a client that follows one run.
pub async fn one(State(shared): Server, Path(name): Path<String>, upgrade: WebSocketUpgrade) -> Response {
    match shared.folder(&name) {
        Some(_) => begin(shared, Some(name), upgrade),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

fn begin(shared: Arc<Shared>, name: Option<String>, upgrade: WebSocketUpgrade) -> Response {
    let upgrade = upgrade.protocols(PROTOCOLS);
    if upgrade.selected_protocol().is_none() {
        let why = format!("the client must offer a subprotocol: {}", PROTOCOLS.join(" or "));
        return (StatusCode::BAD_REQUEST, why).into_response();
    }
    let source = move |shared: &Shared, to: &Sender<Message>| hear(shared, name.as_deref(), to);
    stream::accept(shared, upgrade, LARGEST, source, async |shared, socket, mut messages| {
        let mut client = Client::new(shared, socket);
        client.serve(&mut messages).await;
        client.socket
    })
}

/// Hears one run, or the newest live one, again and again until the client is gone.
#[allow(clippy::disallowed_methods, reason = "a thread beside everything else")]
fn hear(shared: &Shared, name: Option<&str>, to: &Sender<Message>) {
    while !to.is_closed() {
        let newest = || pages::live(&shared.options.runs).into_iter().next();
        if let Some(run) = name.map(String::from).or_else(newest) {
            stream::hear(&shared.options.runs.join(run), shared, to);
        }
        std::thread::sleep(POLL_EVERY);
    }
}

/// What a client sends.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase", rename_all_fields = "camelCase")]
enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

/// A client: its subscriptions by channel, and the run so far.
struct Client {
    shared: Arc<Shared>,
    socket: WebSocket,
    topics: Vec<Topic>,
    subscriptions: BTreeMap<usize, u32>,
    view: View,
}

/// Messages by channel, the number of a topic in the list of all.
type Payloads = Vec<(usize, Vec<u8>)>;

impl Client {
    fn new(shared: Arc<Shared>, socket: WebSocket) -> Self {
        let mut topics = topics::of_cycles();
        topics.push(topics::of_events());
        topics.extend(topics::of_passes());
        Client { shared, socket, topics, subscriptions: BTreeMap::new(), view: View::default() }
    }

    async fn serve(&mut self, messages: &mut Receiver<Message>) {
        if !self.introduce().await {
            return;
        }
        loop {
            let goes_on = tokio::select! {
                message = messages.recv() => match message {
                    Some(message) => self.tell(message).await,
                    None => false,
                },
                request = self.socket.recv() => match request {
                    Some(Ok(ws::Message::Text(text))) => self.answer(&text).await,
                    Some(Ok(ws::Message::Ping(_) | ws::Message::Pong(_))) => true,
                    _ => false,
                },
            };
            if !goes_on {
                return;
            }
        }
    }

    /// Who serves, which runs are live, and all topics.
    async fn introduce(&mut self) -> bool {
        let version = env!("CARGO_PKG_VERSION");
        let live = live(&self.shared).await;
        let channels = self.topics.iter().enumerate().map(|(id, topic)| {
            json!({ "id": id, "topic": topic.name, "encoding": "json", "schemaName": topic.schema_name(),
                    "schema": topic.schema(), "schemaEncoding": "jsonschema" })
        });
        let advertised = json!({ "op": "advertise", "channels": channels.collect::<Vec<_>>() });
        let info = json!({ "op": "serverInfo", "name": format!("muprime {version}"), "capabilities": [],
                           "metadata": { "muprime_version": version, "live_runs": live } });
        let words = format!("live runs: {}", if live.is_empty() { "none yet" } else { live.as_str() });
        self.send(&info).await && self.send(&advertised).await && self.status(INFO, &words).await
    }

    /// Passes a run's message on; whether the client took it.
    async fn tell(&mut self, message: Message) -> bool {
        let (mut payloads, mut words) = (Payloads::new(), None);
        match &message {
            Message::State(state) => payloads = curves(0, &state.signals),
            Message::Pass(pass) => payloads = of_pass(pass),
            Message::Event(event) => payloads = of_event(event),
            Message::Run(run) => {
                let name = run.folder.file_name().unwrap_or_default().to_string_lossy();
                words = Some(format!("streaming run {name}; live runs: {}", live(&self.shared).await));
            }
            Message::Ended(_) => words = Some("the run has ended".into()),
            Message::Off(off) => words = Some(off.clone()),
            Message::Progress(_) => {}
        }
        // A state is of its own time, everything else of the last state's.
        self.view.take(message);
        let taken = match words {
            Some(words) => self.status(INFO, &words).await,
            None => true,
        };
        let to = self.subscriptions.clone();
        taken && self.data(&payloads, &to).await
    }

    /// Answers a request; whether the client took the answer.
    async fn answer(&mut self, text: &str) -> bool {
        match serde_json::from_str(text) {
            Ok(Request::Subscribe { subscriptions }) => {
                let mut new = BTreeMap::new();
                for Subscription { id, channel_id } in subscriptions {
                    let taken = self.subscriptions.contains_key(&channel_id)
                        || self.subscriptions.values().any(|other| *other == id);
                    if taken || channel_id >= self.topics.len() {
                        let why =
                            format!("subscription {id}: there is no channel {channel_id}, or it is taken");
                        if !self.status(ERROR, &why).await {
                            return false;
                        }
                    } else {
                        self.subscriptions.insert(channel_id, id);
                        new.insert(channel_id, id);
                    }
                }
                self.catch_up(&new).await
            }
            Ok(Request::Unsubscribe { subscription_ids }) => {
                self.subscriptions.retain(|_, id| !subscription_ids.contains(id));
                true
            }
            Ok(Request::Other) | Err(_) => {
                self.status(ERROR, "this server streams: it takes subscribe and unsubscribe").await
            }
        }
    }

    /// What new subscriptions missed.
    async fn catch_up(&mut self, to: &BTreeMap<usize, u32>) -> bool {
        let mut payloads: Payloads = self.view.passes.iter().flat_map(of_pass).collect();
        payloads.extend(self.view.events.iter().flat_map(of_event));
        payloads.extend(self.view.states.back().into_iter().flat_map(|state| curves(0, &state.signals)));
        self.data(&payloads, to).await
    }

    /// Sends messages to whoever of these subscriptions they are for.
    async fn data(&mut self, payloads: &[(usize, Vec<u8>)], to: &BTreeMap<usize, u32>) -> bool {
        let now = self.view.states.back().map_or(0, |state| state.unix_ns);
        for (channel, payload) in payloads {
            let Some(id) = to.get(channel) else { continue };
            let mut frame = Vec::with_capacity(13 + payload.len());
            frame.push(MESSAGE_DATA);
            frame.extend(id.to_le_bytes());
            frame.extend(now.to_le_bytes());
            frame.extend(payload);
            if !stream::send(&mut self.socket, ws::Message::Binary(frame.into())).await {
                return false;
            }
        }
        true
    }

    async fn status(&mut self, level: u8, message: &str) -> bool {
        self.send(&json!({ "op": "status", "level": level, "message": message })).await
    }

    async fn send(&mut self, message: &Value) -> bool {
        stream::send(&mut self.socket, ws::Message::Text(message.to_string().into())).await
    }
}

/// Values of topics from the `first` on.
fn curves(first: usize, values: &[Option<f64>]) -> Payloads {
    let message = |(k, value): (usize, &Option<f64>)| {
        let mut text = Vec::with_capacity(32);
        topics::message(*value, &mut text).map(|()| (first + k, text))
    };
    values.iter().enumerate().filter_map(message).collect()
}

fn of_pass(pass: &MeasuredPass) -> Payloads {
    curves(topics::SIGNALS.len() + 1, &topics::of_pass(pass))
}

fn of_event(event: &TimedEvent) -> Payloads {
    serde_json::to_vec(&event.event).map(|text| (topics::SIGNALS.len(), text)).into_iter().collect()
}

/// The live runs in words, newest first.
fn live(shared: &Arc<Shared>) -> impl Future<Output = String> + use<> {
    let shared = Arc::clone(shared);
    let live = tokio::task::spawn_blocking(move || pages::live(&shared.options.runs).join(", "));
    async move { live.await.unwrap_or_default() }
}
