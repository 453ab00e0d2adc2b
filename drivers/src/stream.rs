//! Frames that come by themselves: bytes in, samples out, whatever carries them.

use super::connection::{Connection, LONGEST_SLEEP};
use super::link_error::LinkError;
use instruments::codec::stream::Cutter;
use instruments::schema::Stream;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// The longest line that an instrument may send.
const LONGEST_LINE: usize = 4096;

/// Takes the first whole line out of what came; returns it without its end.
pub(crate) fn first_line(came: &mut Vec<u8>, end: &[u8]) -> Result<Option<Vec<u8>>, LinkError> {
    match came.windows(end.len()).position(|window| window == end) {
        Some(at) => Ok(Some(came.drain(..at + end.len()).take(at).collect())),
        None if came.len() > LONGEST_LINE => Err(LinkError::Corrupt("a line without an end".into())),
        None => Ok(None),
    }
}

/// Bytes on their way to frames.
enum Framing {
    /// Frames of one length that end with a check.
    Binary(Cutter),
    /// Datagrams, each of one frame or several: they begin with sync, and their transport has checked them.
    Datagrams { sync: Vec<u8>, length: usize },
    /// Lines, which end so.
    Lines { end: Vec<u8>, came: Vec<u8>, believed: bool },
}

impl Framing {
    fn of(connection: &Connection, stream: &Stream, parted: bool) -> Self {
        let link = &connection.endpoint.profile().description.link;
        match (stream.shape(), stream.length) {
            (Some(shape), _) => Self::Binary(Cutter::new(shape)),
            (None, Some(length)) => Self::Datagrams { sync: stream.sync.clone(), length: length.into() },
            // What comes before the first end is half a line; a datagram is whole.
            (None, None) => Self::Lines { end: link.rx_end().into(), came: Vec::new(), believed: parted },
        }
    }
}

/// Hands over frames until the thread is to end. `read` gives what comes until its deadline; `parted` says
/// that each read is a datagram.
///
/// # Errors
/// Silence for longer than an answer may take, and whatever `read` says.
pub fn listen(
    connection: &mut Connection,
    stream: &Stream,
    parted: bool,
    read: &mut dyn FnMut(&mut [u8], Instant) -> Result<usize, LinkError>,
) -> Result<(), LinkError> {
    let (profile, health) = (connection.endpoint.profile(), connection.endpoint.health());
    let frame = profile.frame("stream").ok_or_else(|| LinkError::Io("the profile has no stream".into()))?;
    let shape = profile.frames()[frame.0].clone();
    let limit_ms = profile.description.link.response_timeout_ms;
    let patience = Duration::from_millis(u64::from(limit_ms));
    let mut framing = Framing::of(connection, stream, parted);
    // The longest datagram that there is.
    let mut buffer = vec![0; if parted { 65_536 } else { 1024 }];
    let (mut skipped, mut last) = (0, Instant::now());
    while !connection.stopping() {
        let count = read(&mut buffer, Instant::now() + LONGEST_SLEEP)?;
        let arrived = connection.now();
        let mut outcome = Ok(());
        let mut take = |bytes: &[u8]| {
            last = Instant::now();
            if outcome.is_ok() {
                outcome = connection.endpoint.frame(frame, bytes, arrived);
            }
        };
        match &mut framing {
            Framing::Binary(cutter) => {
                cutter.push(&buffer[..count], &mut take);
                health.corrupt_frames.fetch_add(cutter.lost - skipped, Ordering::Relaxed);
                skipped = cutter.lost;
            }
            Framing::Datagrams { .. } if count == 0 => {}
            Framing::Datagrams { sync, length } => {
                let whole = count.is_multiple_of(*length)
                    && buffer[..count].chunks_exact(*length).all(|frame| frame.starts_with(sync));
                if whole {
                    buffer[..count].chunks_exact(*length).for_each(take);
                } else {
                    health.count(&health.corrupt_frames);
                    health.problem(format!("a datagram of {count} bytes is not a frame of the stream"));
                }
            }
            Framing::Lines { end, came, believed } => {
                came.extend_from_slice(&buffer[..count]);
                if parted && count > 0 && !came.ends_with(end) {
                    came.extend_from_slice(end);
                }
                while let Some(line) = first_line(came, end)? {
                    let whole = std::mem::replace(believed, true);
                    let text = String::from_utf8_lossy(&line);
                    match shape.read_line(&text) {
                        Some(bytes) if whole => take(&bytes),
                        None if whole => {
                            health.count(&health.corrupt_frames);
                            health.problem(format!("`{}` is not a line of the stream", text.trim()));
                        }
                        _ => {}
                    }
                }
            }
        }
        outcome?;
        if health.report().samples > 0 {
            connection.tell(Ok(()));
        }
        if last.elapsed() > patience {
            return Err(LinkError::Timeout(limit_ms));
        }
    }
    Ok(())
}
