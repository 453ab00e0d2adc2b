//! The run's end of the socket: takes the news without ever waiting, and tells them to every viewer.
#![allow(clippy::disallowed_methods, reason = "threads beside everything else")]

use super::{Ask, Ended, Message, Progress, Run, State, Told, View, place};
use runs::sequence::MeasuredPass;
use runs::session::{Signals, Update};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::os::unix::net::{UnixListener, UnixStream};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// Messages that wait to be told at most: several minutes of states in wall-clock time.
const QUEUE: usize = 4096;
/// Lines that wait for a viewer at most.
const VIEWER_QUEUE: usize = 1024;
/// Viewers at once.
const VIEWERS: usize = 16;
/// A viewer that takes nothing for so long is let go.
const PATIENCE: Duration = Duration::from_secs(5);
/// Time between two looks for new viewers.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// Longest line that a viewer may say, in bytes.
const LONGEST_ASK: u64 = 64;

/// Tells viewers what a run does, from its first news on. Dropped, it tells what is left and closes.
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
    teller: JoinHandle<()>,
}

impl Feed {
    /// A feed of a run and the passes that earlier sessions made of it; what viewers ask goes into `signals`. Nothing is opened yet: the
    /// run's folder may still have to be made.
    pub fn new(run: Run, before: Vec<MeasuredPass>, signals: &Signals) -> Self {
        let signals = signals.clone();
        Feed { run, signals, before, open: None, now_s: 0.0, lost: 0, refused: false }
    }

    /// Tells news.
    pub fn news(&mut self, news: &Update<'_>) {
        let message = match news {
            Update::Pass(pass) => Message::Pass(Box::new((*pass).clone())),
            Update::Event(event) => Message::Event(Told::of(self.now_s, (*event).clone())),
            Update::State(glimpse) => {
                self.now_s = glimpse.row.now.seconds();
                Message::State(Box::new(State::of(glimpse)))
            }
            Update::Progress(made, _, remaining_s) => Message::Progress(Progress {
                made: self.run.made_before + made,
                planned: self.run.planned,
                remaining_s: *remaining_s,
            }),
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
                "{} messages were lost for those who watched: they came faster than they could be told",
                self.lost
            );
        }
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
        let (queue, told) = sync_channel(QUEUE);
        let teller = Teller { listener, signals: self.signals.clone(), view, viewers: Vec::new() };
        let tell = move || teller.tell(&told);
        let teller = std::thread::Builder::new().name("viewers".into()).spawn(tell)?;
        Ok(Open { queue, teller })
    }
}

impl Drop for Feed {
    fn drop(&mut self) {
        if let Some(Open { queue, teller }) = self.open.take() {
            drop(queue);
            let _ = teller.join();
        }
    }
}

/// The thread that tells.
struct Teller {
    listener: UnixListener,
    signals: Signals,
    view: View,
    viewers: Vec<Seat>,
}

/// A viewer.
struct Seat {
    lines: SyncSender<Arc<str>>,
    stream: UnixStream,
    writer: JoinHandle<()>,
}

impl Teller {
    fn tell(mut self, queue: &Receiver<Message>) {
        loop {
            match queue.recv_timeout(LOOK_EVERY) {
                Ok(message) => self.pass_on(message),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.look();
        }
        // The last words reach those who read.
        for Seat { lines, writer, .. } in self.viewers {
            drop(lines);
            let _ = writer.join();
        }
    }

    fn pass_on(&mut self, message: Message) {
        if !self.viewers.is_empty()
            && let Some(line) = line(&message)
        {
            self.viewers.retain(|viewer| {
                let told = viewer.lines.try_send(Arc::clone(&line)).is_ok();
                if !told {
                    let _ = viewer.stream.shutdown(std::net::Shutdown::Both);
                }
                told
            });
        }
        self.view.take(message);
    }

    /// Lets in whoever has come.
    fn look(&mut self) {
        while let Ok((stream, _)) = self.listener.accept() {
            self.viewers.retain(|viewer| !viewer.writer.is_finished());
            if self.viewers.len() >= VIEWERS || !is_ours(&stream) {
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
        let writer = std::thread::Builder::new().name("viewer".into()).spawn(move || {
            for line in before.into_iter().chain(rest) {
                if to.write_all(line.as_bytes()).is_err() {
                    break;
                }
            }
            let _ = to.shutdown(std::net::Shutdown::Both);
        })?;
        let signals = self.signals.clone();
        std::thread::Builder::new().name("viewer's word".into()).spawn(move || listen(from, &signals))?;
        Ok(Seat { lines, stream, writer })
    }
}

/// Whether the other end is a process of the same user, or of the one who may do everything.
fn is_ours(stream: &UnixStream) -> bool {
    rustix::net::sockopt::socket_peercred(stream)
        .is_ok_and(|peer| peer.uid == rustix::process::geteuid() || peer.uid.is_root())
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
