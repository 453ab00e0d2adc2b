//! The run's end of the socket: takes the updates without ever waiting, and sends them to every viewer.
#![allow(clippy::disallowed_methods, reason = "threads beside everything else")]

use super::{Ask, Ended, Message, Progress, Run, State, TimedEvent, View, is_ours, place};
use realtime::threads;
use runs::MeasuredPass;
use runs::job::{Signals, Update};
use rustix::net::sockopt::socket_peercred;
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{
    Receiver, RecvTimeoutError, SyncSender, TryRecvError, TrySendError, channel, sync_channel,
};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tables::export::topics;

/// Messages that wait to be sent at most: several minutes of states in wall-clock time.
const QUEUE: usize = 4096;
/// Lines that wait for a viewer at most.
const VIEWER_QUEUE: usize = 1024;
/// Viewers at once.
const VIEWERS: usize = 16;
/// A viewer that takes nothing for so long is disconnected.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long the end of a run waits for all its viewers together.
const LAST_WORDS: Duration = Duration::from_secs(2);
/// Time between two polls for new viewers.
const POLL_EVERY: Duration = Duration::from_millis(50);
/// Longest line that a viewer may say, in bytes.
const LONGEST_ASK: u64 = 64;

/// Sends viewers what a run does, from its first update on. Dropped, it sends what is left and closes.
pub struct Feed {
    run: Run,
    signals: Signals,
    before: Vec<MeasuredPass>,
    open: Option<Open>,
    now_s: f64,
    lost: u64,
    refused: bool,
}

/// A feed whose place is open.
struct Open {
    queue: SyncSender<Message>,
    teller: JoinHandle<usize>,
}

impl Feed {
    /// A feed of a run and the passes that earlier sessions made of it; what viewers ask goes into `signals`.
    /// Nothing is opened yet: the run's folder may still have to be made.
    pub fn new(run: Run, before: Vec<MeasuredPass>, signals: &Signals) -> Self {
        let signals = signals.clone();
        Feed { run, signals, before, open: None, now_s: 0.0, lost: 0, refused: false }
    }

    /// Passes an update on.
    pub fn update(&mut self, update: &Update<'_>) {
        let message = match update {
            Update::Pass(pass) => Message::Pass(Box::new((*pass).clone())),
            Update::Event(event) => Message::Event(TimedEvent::of(self.now_s, (*event).clone())),
            Update::State(snapshot) => {
                self.now_s = snapshot.row.now.seconds();
                let signals = topics::of_row(&snapshot.row);
                Message::State(Box::new(State { signals, ..State::of(snapshot) }))
            }
            Update::Off(off) if off.read_back => return,
            Update::Off(off) => Message::Off(off.words()),
            Update::Progress(made, _, remaining_s) => {
                let (made, planned) = (self.run.made_before + made, self.run.planned);
                Message::Progress(Progress { made, planned, remaining_s: *remaining_s })
            }
        };
        self.tell(message);
    }

    /// Tells the end.
    pub fn end(mut self, ended: Ended) {
        // A run that never began has nobody who looks at it.
        if self.open.is_some() {
            self.tell(Message::Ended(Box::new(ended)));
        }
        if self.lost > 0 {
            tracing::info!(
                "{} messages were lost for those who watched: they came faster than they could be sent",
                self.lost
            );
        }
        let left_behind = self.close();
        if left_behind > 0 {
            tracing::warn!("{left_behind} viewers read too slowly and did not get everything");
        }
    }

    /// Tells what is left and closes; returns how many viewers did not get everything.
    fn close(&mut self) -> usize {
        let Some(Open { queue, teller }) = self.open.take() else { return 0 };
        drop(queue);
        teller.join().unwrap_or(0)
    }

    /// Puts a message into the queue, or loses it where that is full.
    fn tell(&mut self, message: Message) {
        if self.open.is_none() && !self.refused {
            self.open = self.begin().map_err(|why| tracing::warn!("nobody can watch this run: {why}")).ok();
            self.refused = self.open.is_none();
        }
        if let Some(open) = &self.open {
            self.lost += u64::from(open.queue.try_send(message).is_err());
        }
    }

    fn begin(&mut self) -> io::Result<Open> {
        let listener = UnixListener::bind_addr(&place(&self.run.folder)?)?;
        listener.set_nonblocking(true)?;
        let mut view = View::default();
        view.take(Message::Run(Box::new(self.run.clone())));
        view.passes = std::mem::take(&mut self.before);
        let (queue, messages) = sync_channel(QUEUE);
        let (signals, viewers) = (self.signals.clone(), Vec::new());
        let teller = Teller { listener, signals, view, viewers, left_behind: 0 };
        let session = tracing::Span::current();
        let tell = move || session.in_scope(|| teller.tell(&messages));
        let teller = threads::spawn("viewers", tell)?;
        Ok(Open { queue, teller })
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        self.close();
    }
}

/// The thread that tells.
struct Teller {
    listener: UnixListener,
    signals: Signals,
    view: View,
    viewers: Vec<Seat>,
    /// Viewers that did not get everything.
    left_behind: usize,
}

/// A viewer.
struct Seat {
    lines: SyncSender<Arc<str>>,
    stream: UnixStream,
    /// Ends when everything was written; whether it was.
    written: Receiver<bool>,
}

impl Teller {
    fn tell(mut self, queue: &Receiver<Message>) -> usize {
        loop {
            match queue.recv_timeout(POLL_EVERY) {
                Ok(message) => self.pass_on(message),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.look();
        }
        // The last words reach those who read: all queues end at once, and one bound holds for all viewers together.
        let seats = std::mem::take(&mut self.viewers).into_iter();
        let last: Vec<_> = seats.map(|Seat { stream, written, .. }| (stream, written)).collect();
        let until = Instant::now() + LAST_WORDS;
        for (stream, written) in last {
            let left = until.saturating_duration_since(Instant::now());
            if !written.recv_timeout(left).unwrap_or(false) {
                self.left_behind += 1;
                let _ = stream.shutdown(std::net::Shutdown::Both);
            }
        }
        self.left_behind
    }

    fn pass_on(&mut self, message: Message) {
        if !self.viewers.is_empty()
            && let Some(line) = line(&message)
        {
            let left_behind = &mut self.left_behind;
            self.viewers.retain(|viewer| match viewer.lines.try_send(Arc::clone(&line)) {
                Ok(()) => true,
                Err(why) => {
                    let full = matches!(why, TrySendError::Full(_));
                    *left_behind += usize::from(full || viewer.written.try_recv() == Ok(false));
                    let _ = viewer.stream.shutdown(std::net::Shutdown::Both);
                    false
                }
            });
        }
        self.view.take(message);
    }

    /// Lets in whoever has come.
    fn look(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            let left_behind = &mut self.left_behind;
            self.viewers.retain(|viewer| {
                let written = viewer.written.try_recv();
                *left_behind += usize::from(written == Ok(false));
                written == Err(TryRecvError::Empty)
            });
            if self.viewers.len() >= VIEWERS || !socket_peercred(&stream).is_ok_and(|peer| is_ours(&peer)) {
                continue;
            }
            match self.welcome(stream) {
                Ok(viewer) => self.viewers.push(viewer),
                Err(why) => tracing::warn!("a viewer could not be let in: {why}"),
            }
        }
    }

    fn welcome(&self, stream: UnixStream) -> io::Result<Seat> {
        stream.set_nonblocking(false)?;
        stream.set_write_timeout(Some(PATIENCE))?;
        let before: Vec<Arc<str>> = self.view.messages().iter().filter_map(line).collect();
        let (lines, rest) = sync_channel::<Arc<str>>(VIEWER_QUEUE);
        let (mut to, from) = (stream.try_clone()?, stream.try_clone()?);
        let (done, written) = channel();
        threads::spawn("viewer", move || {
            let whole = before.into_iter().chain(rest).try_for_each(|line| to.write_all(line.as_bytes()));
            let _ = to.shutdown(std::net::Shutdown::Both);
            // One that has gone away by itself misses nothing.
            let gone = |e: &io::Error| {
                matches!(e.kind(), io::ErrorKind::BrokenPipe | io::ErrorKind::ConnectionReset)
            };
            let _ = done.send(whole.map_or_else(|e| gone(&e), |()| true));
        })?;
        let signals = self.signals.clone();
        threads::spawn("viewer's word", move || listen(from, &signals))?;
        Ok(Seat { lines, stream, written })
    }
}

fn line(message: &Message) -> Option<Arc<str>> {
    serde_json::to_string(message).ok().map(|text| Arc::from(text + "\n"))
}

/// Takes what a viewer asks, a word a line, until it says anything else or goes.
fn listen(stream: UnixStream, signals: &Signals) {
    let mut reader = BufReader::new(stream);
    let mut word = String::new();
    while reader.by_ref().take(LONGEST_ASK).read_line(&mut word).is_ok_and(|count| count > 0) {
        match Ask::of(word.trim_end()) {
            Some(Ask::Stop) => {
                signals.stops.fetch_add(1, Ordering::Relaxed);
            }
            Some(ask) => signals.paused.store(ask == Ask::Pause, Ordering::Relaxed),
            None => break,
        }
        word.clear();
    }
}
