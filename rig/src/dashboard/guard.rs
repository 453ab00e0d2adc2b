//! Access control: a literal list of hosts (comparing `Host` with `Origin` stops no rebinding of names), a
//! literal list of origins, a token, and a bound on the rate of requests.

use axum::http::{HeaderMap, StatusCode, header};
use rand::TryRng;
use std::net::SocketAddr;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Name of the protocol of a live stream; the token is the one after it.
pub const PROTOCOL: &str = "muprime";
/// Asks that are passed on within [`WITHIN`] at most.
const ASKS: usize = 20;
/// Time over which asks are counted.
const WITHIN: Duration = Duration::from_secs(10);

/// Checks requests. What it refuses comes with the status to answer with.
pub struct Guard {
    hosts: Vec<String>,
    /// Further origins that may read streams, and nothing else.
    origins: Vec<String>,
    token: String,
    recent: Mutex<Vec<Instant>>,
}

impl Guard {
    /// A guard of a server, with a new token.
    pub fn new(address: SocketAddr, more: &[String], origins: &[String]) -> Self {
        let port = address.port();
        let mut hosts =
            vec![format!("127.0.0.1:{port}"), format!("localhost:{port}"), format!("[::1]:{port}")];
        if !address.ip().is_unspecified() {
            hosts.push(address.to_string());
        }
        hosts.extend(more.iter().map(|host| host.to_ascii_lowercase()));
        let mut bytes = [0u8; 32];
        rand::rngs::SysRng.try_fill_bytes(&mut bytes).expect("the system gives random bytes");
        let token = bytes.iter().map(|b| format!("{b:02x}")).collect();
        let origins = origins.iter().map(|origin| origin.to_ascii_lowercase()).collect();
        Guard { hosts, origins, token, recent: Mutex::default() }
    }

    /// The token.
    pub fn token(&self) -> &str {
        &self.token
    }

    /// Whether a request names this server by a name that it has, and comes from one of its own pages or
    /// from no page at all; a `stream` may also be read from the further origins.
    pub fn place(&self, headers: &HeaderMap, stream: bool) -> Result<(), StatusCode> {
        let one = |name| {
            let mut all = headers.get_all(name).iter();
            (all.next().map(|v| v.to_str().unwrap_or("?").to_ascii_lowercase()), all.next().is_some())
        };
        let (host, twice) = one(header::HOST);
        if twice || !host.is_some_and(|host| self.hosts.contains(&host)) {
            return Err(StatusCode::MISDIRECTED_REQUEST);
        }
        let (origin, twice) = one(header::ORIGIN);
        let known = |origin: &String| {
            origin.strip_prefix("http://").is_some_and(|o| self.hosts.iter().any(|h| h == o))
                || (stream && self.origins.contains(origin))
        };
        if twice || origin.as_ref().is_some_and(|origin| !known(origin)) {
            return Err(StatusCode::FORBIDDEN);
        }
        Ok(())
    }

    /// Whether a request has the token: in `Authorization: Bearer`, beside [`PROTOCOL`] among the protocols
    /// of a live stream, or as `token` in the `query` of an address that may have it there.
    pub fn token_of(&self, headers: &HeaderMap, query: Option<&str>) -> Result<(), StatusCode> {
        let text = |name| headers.get(name).and_then(|v| v.to_str().ok());
        let bearer = text(header::AUTHORIZATION).and_then(|v| v.strip_prefix("Bearer "));
        let beside = || {
            let mut all = text(header::SEC_WEBSOCKET_PROTOCOL)?.split(',').map(str::trim);
            (all.next() == Some(PROTOCOL)).then(|| all.next())?
        };
        let in_query = || query?.split('&').find_map(|pair| pair.strip_prefix("token="));
        let given = bearer.or_else(beside).or_else(in_query);
        given.filter(|given| same(given, &self.token)).map(|_| ()).ok_or(StatusCode::UNAUTHORIZED)
    }

    /// Counts an ask; refuses it where there were too many of late.
    pub fn count(&self) -> Result<(), StatusCode> {
        let mut recent = self.recent.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let now = now();
        recent.retain(|at| now.duration_since(*at) < WITHIN);
        if recent.len() >= ASKS {
            return Err(StatusCode::TOO_MANY_REQUESTS);
        }
        recent.push(now);
        Ok(())
    }
}

#[allow(clippy::disallowed_methods, reason = "a server beside everything else")]
fn now() -> Instant {
    Instant::now()
}

/// Compares in a time that does not depend on where two texts of one length differ.
fn same(a: &str, b: &str) -> bool {
    a.len() == b.len() && a.bytes().zip(b.bytes()).fold(0, |differ, (a, b)| differ | (a ^ b)) == 0
}
