//! Live streams: each is a viewer of a run, in a queue that ends a client that reads nothing and gives a
//! slow one fewer states, never fewer passes or events. A browser gets the messages line by line;
//! [`super::foxglove`] gets them in the same way.

use super::api::Server;
use super::guard::PROTOCOL;
use super::server::Shared;
use crate::live::{Message, Received, Viewer};
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use realtime::threads;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Streams at once.
const STREAMS: usize = 16;
/// Messages that wait for a client at most: passes and events of hours. A run ends soon after its last pass
/// and waits for no viewer, so a slow client's messages wait here.
const QUEUE: usize = 4096;
/// Messages that wait from which on states are left out.
const WITHOUT_STATES: usize = 128;
/// A client that takes nothing for so long is disconnected.
const PATIENCE: Duration = Duration::from_secs(5);
/// Largest message from a browser in bytes: it has nothing to say here.
const LARGEST: usize = 256;
/// How long a viewer waits for a message before it looks whether the client is still there.
const POLL_EVERY: Duration = Duration::from_millis(200);

/// Answers a browser's request for a stream.
pub async fn stream(State(shared): Server, Path(name): Path<String>, upgrade: WebSocketUpgrade) -> Response {
    let Some(folder) = shared.folder(&name) else { return StatusCode::NOT_FOUND.into_response() };
    let upgrade = upgrade.protocols([PROTOCOL]);
    let source = move |shared: &Shared, to: &Sender<Message>| hear(&folder, shared, to);
    accept(shared, upgrade, LARGEST, source, async |_, mut socket, mut messages| {
        pass_on(&mut socket, &mut messages).await;
        socket
    })
}

/// A place among the streams.
struct Place(Arc<Shared>);

impl Place {
    fn take(shared: Arc<Shared>) -> Result<Self, StatusCode> {
        let place = Place(shared);
        let before = place.0.streams.fetch_add(1, Ordering::Relaxed);
        if before < STREAMS { Ok(place) } else { Err(StatusCode::SERVICE_UNAVAILABLE) }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.streams.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Gives a client a place, and a thread of its own that hears for it: a viewer's reads wait. `talk` gives
/// the socket back to close.
pub fn accept<F>(
    shared: Arc<Shared>,
    upgrade: WebSocketUpgrade,
    largest: usize,
    source: impl FnOnce(&Shared, &Sender<Message>) + Send + 'static,
    talk: impl FnOnce(Arc<Shared>, WebSocket, Receiver<Message>) -> F + Send + 'static,
) -> Response
where
    F: Future<Output = WebSocket> + Send + 'static,
{
    let place = match Place::take(shared) {
        Ok(place) => place,
        Err(status) => return status.into_response(),
    };
    let upgrade = upgrade.max_message_size(largest).max_frame_size(largest).write_buffer_size(0);
    upgrade.on_upgrade(move |socket| async move {
        let (to, messages) = channel(QUEUE);
        let hearing = Arc::clone(&place.0);
        let work = move || source(&hearing, &to);
        // It ends with the channel or the run.
        if threads::spawn("stream", work).is_ok() {
            let mut socket = talk(Arc::clone(&place.0), socket, messages).await;
            let _ = tokio::time::timeout(PATIENCE, socket.send(ws::Message::Close(None))).await;
        }
        drop(place);
    })
}

/// Hears a run and puts its messages into the queue, until either end is gone.
pub fn hear(folder: &std::path::Path, shared: &Shared, to: &Sender<Message>) {
    let Ok(mut viewer) = Viewer::connect(folder) else { return };
    while !to.is_closed() {
        let message = match viewer.hear(POLL_EVERY) {
            Received::Message(message) => *message,
            Received::Nothing => continue,
            Received::Gone => return,
        };
        if matches!(message, Message::State(_)) && to.max_capacity() - to.capacity() >= WITHOUT_STATES {
            shared.dropped.fetch_add(1, Ordering::Relaxed);
            continue;
        }
        if to.blocking_send(message).is_err() {
            return;
        }
    }
}

/// Sends, within a bound; whether the client took it.
pub async fn send(socket: &mut WebSocket, message: ws::Message) -> bool {
    matches!(tokio::time::timeout(PATIENCE, socket.send(message)).await, Ok(Ok(())))
}

async fn pass_on(socket: &mut WebSocket, messages: &mut Receiver<Message>) {
    loop {
        tokio::select! {
            message = messages.recv() => {
                let Some(message) = message else { return };
                let Ok(line) = serde_json::to_string(&message) else { continue };
                if !send(socket, ws::Message::Text(line.into())).await {
                    return;
                }
            }
            // Pings and a close; anything else is none of this stream's business, and its end.
            message = socket.recv() => match message {
                Some(Ok(ws::Message::Ping(_) | ws::Message::Pong(_))) => {}
                _ => return,
            }
        }
    }
}
