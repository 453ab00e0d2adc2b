//! The server's door: so many connections at once, so long for a request's head, its answer and a whole connection, and no more.

use axum::Router;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// Connections at once, live streams among them.
const CONNECTIONS: usize = 64;
/// Time that the head of a request may take, also that of the next one on a connection that stays open.
const HEAD_WITHIN: Duration = Duration::from_secs(10);
/// Time that the other end may let pass without taking what was sent to it.
const TAKEN_WITHIN: Duration = Duration::from_secs(5);
/// Time after which a connection gets no further request, and what the last answer may take after that. A live stream is none of these.
const WHOLE_WITHIN: Duration = Duration::from_secs(30);
const LAST_ANSWER_WITHIN: Duration = Duration::from_secs(10);
const HEAD_BYTES: usize = 16 * 1024;
/// What the system may hold for one that reads slowly, in bytes (it takes twice as much): with its own bound
/// of some megabytes a slow page would show what was minutes ago, and states could not be left out for it.
const HELD_BYTES: usize = 32 * 1024;
/// Time from one try to the next where the system has no descriptor to give.
const AGAIN: Duration = Duration::from_millis(100);

/// Serves until the process ends.
pub async fn serve(listener: TcpListener, routes: Router) {
    let listener =
        tokio::net::TcpListener::from_std(listener).expect("a listener that does not block, in a runtime");
    let free = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(AGAIN).await;
            continue;
        };
        // A client without a place does not wait: a browser comes again by itself.
        let Ok(place) = Arc::clone(&free).try_acquire_owned() else { continue };
        let routes = routes.clone();
        tokio::spawn(async move {
            let _place = place;
            let _ = stream.set_nodelay(true);
            let _ = rustix::net::sockopt::set_socket_send_buffer_size(&stream, HELD_BYTES);
            let _ = rustix::net::sockopt::set_tcp_user_timeout(&stream, TAKEN_WITHIN.as_millis() as u32);
            let socket = rustix::io::fcntl_dupfd_cloexec(&stream, 0);
            let service = TowerToHyperService::new(routes);
            let connection = hyper::server::conn::http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEAD_WITHIN)
                .max_buf_size(HEAD_BYTES)
                .serve_connection(TokioIo::new(stream), service)
                .with_upgrades();
            tokio::pin!(connection);
            // An error is that of the other end.
            if tokio::time::timeout(WHOLE_WITHIN, connection.as_mut()).await.is_err() {
                connection.as_mut().graceful_shutdown();
                let _ = tokio::time::timeout(LAST_ANSWER_WITHIN, connection).await;
            } else if let Ok(socket) = socket {
                // What is left is a live stream with a bound of its own: a slow browser may take longer to make room.
                let _ = rustix::net::sockopt::set_tcp_user_timeout(&socket, 0);
            }
        });
    }
}
