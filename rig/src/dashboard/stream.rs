//! A live stream to a browser. What a viewer hears is passed on line by line. A browser that reads nothing is
//! disconnected; a slow one gets fewer states, never fewer passes or events.

use super::guard::PROTOCOL;
use super::server::Shared;
use crate::live::{Heard, Message, Viewer};
use axum::extract::ws::{self, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::sync::mpsc::{Receiver, Sender, channel};

/// Streams at once.
const STREAMS: usize = 16;
/// Lines that wait for a browser at most: passes and events of hours. A run ends soon after its last pass and
/// waits for no viewer, so a slow browser's lines wait here.
const QUEUE: usize = 4096;
/// Lines that wait from which on states are left out.
const WITHOUT_STATES: usize = 128;
/// A browser that takes nothing for so long is let go.
const PATIENCE: Duration = Duration::from_secs(5);
/// Largest message from a browser in bytes: it has nothing to say here.
const LARGEST: usize = 256;
/// How long a viewer waits for a message before it looks whether the browser is still there.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// Answers a request for a stream.
pub async fn stream(
    State(shared): State<Arc<Shared>>,
    Path(name): Path<String>,
    upgrade: WebSocketUpgrade,
) -> Response {
    let Some(folder) = shared.folder(&name) else { return StatusCode::NOT_FOUND.into_response() };
    if shared.streams.fetch_add(1, Ordering::Relaxed) >= STREAMS {
        shared.streams.fetch_sub(1, Ordering::Relaxed);
        return StatusCode::SERVICE_UNAVAILABLE.into_response();
    }
    let place = Place(shared);
    upgrade
        .protocols([PROTOCOL])
        .max_message_size(LARGEST)
        .max_frame_size(LARGEST)
        .write_buffer_size(0)
        .on_upgrade(move |socket| async move {
            follow(socket, folder).await;
            drop(place);
        })
}

/// A place among the streams.
struct Place(Arc<Shared>);

impl Drop for Place {
    fn drop(&mut self) {
        self.0.streams.fetch_sub(1, Ordering::Relaxed);
    }
}

async fn follow(mut socket: WebSocket, folder: PathBuf) {
    let (to, mut from) = channel(QUEUE);
    // The viewer's reads wait: a thread of its own, which ends with the channel or the run.
    let viewer = std::thread::Builder::new().name("stream".into()).spawn(move || hear(&folder, &to));
    if viewer.is_ok() {
        pass_on(&mut socket, &mut from).await;
    }
    let _ = tokio::time::timeout(PATIENCE, socket.send(ws::Message::Close(None))).await;
}

/// Hears a run and puts its lines into the queue, until either end is gone.
fn hear(folder: &std::path::Path, to: &Sender<String>) {
    let Ok(mut viewer) = Viewer::connect(folder) else { return };
    while !to.is_closed() {
        let message = match viewer.hear(LOOK_EVERY) {
            Heard::Message(message) => message,
            Heard::Nothing => continue,
            Heard::Gone => return,
        };
        if matches!(*message, Message::State(_)) && to.max_capacity() - to.capacity() >= WITHOUT_STATES {
            continue;
        }
        let Ok(line) = serde_json::to_string(&message) else { continue };
        if to.blocking_send(line).is_err() {
            return;
        }
    }
}

async fn pass_on(socket: &mut WebSocket, lines: &mut Receiver<String>) {
    loop {
        tokio::select! {
            line = lines.recv() => {
                let Some(line) = line else { return };
                let sent = tokio::time::timeout(PATIENCE, socket.send(ws::Message::Text(line.into()))).await;
                if !matches!(sent, Ok(Ok(()))) {
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
