//! Reading a record from its beginning, entry by entry, in memory that does not depend on its length.

use super::integrity::Integrity;
use super::{RECOVERED, TOPICS, TRAILER, WRITTEN};
use binrw::BinRead;
use chunk::Message;
use mcap::records::{ChunkHeader, op};
use std::collections::{BTreeMap, VecDeque};
use std::io::{Cursor, Read, Seek, SeekFrom};
use verify::{Checked, known, may_begin, verify};

mod chunk;
mod verify;

/// Something that a record holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Entry {
    /// A metadata record.
    Facts {
        /// Its name.
        name: String,
        /// What it says, without its checksum.
        facts: BTreeMap<String, String>,
    },
    /// An attached file.
    File {
        /// Its name.
        name: String,
        /// When it was attached, in ns since 1970.
        time_ns: u64,
        /// Its contents.
        bytes: Vec<u8>,
    },
    /// A message.
    Message {
        /// Its topic.
        topic: &'static str,
        /// Its number within its topic, from 1.
        number: u32,
        /// Log time in ns since 1970.
        log_time: u64,
        /// JSON text.
        text: Vec<u8>,
    },
}

/// Longest record of the format that is read, in bytes.
const LONGEST: u64 = 64 << 20;
/// Length of an opcode and the length that follows it.
const HEAD: usize = 9;
/// Bytes that are looked through at once for the next good record: few at first, for it is mostly near.
const WINDOWS: std::ops::RangeInclusive<usize> = 256..=64 * 1024;
/// Bytes that are read for what turns out to be no record, in lengths of the file, and beyond them: bytes
/// that look like heads of long chunks would otherwise cost the square of the file.
const IN_VAIN: (u64, u64) = (4, 1 << 20);
/// What a look at something that is no record costs at least, in bytes: a place is looked up, and a buffer is filled.
const A_LOOK: u64 = 8 * 1024;

/// Reads whatever a record still holds, in the order it was written. Never panics, never invents: what a
/// checksum does not vouch for is left out and noted in [`Reader::integrity`], and reading goes on behind it.
pub struct Reader<R> {
    from: R,
    /// Where the next record of the format begins.
    at: u64,
    part: Part,
    body: Vec<u8>,
    messages: VecDeque<Message>,
    wanted: Wanted,
    /// Log times outside of which chunks are passed over, in ns since 1970.
    window: [u64; 2],
    /// Number of the last message of every topic.
    last: [u32; TOPICS.len()],
    /// Length of the file when reading began.
    size: Option<u64>,
    /// Bytes that were read for what turned out to be no record.
    in_vain: u64,
    /// Of the data so far, then of the index; `None` once something was left out.
    checksum: Option<crc32fast::Hasher>,
    found: Integrity,
}

/// Which part of the file comes next.
#[derive(Clone, Copy, PartialEq)]
enum Part {
    Magic,
    Data,
    Index,
    Over,
}

/// Topics whose messages are given out.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Wanted {
    All,
    Only(&'static str),
    None,
}

/// Why a record of the format could not be read.
enum Trouble {
    /// The file ends within it.
    Short,
    Bad(String),
}

impl From<std::io::Error> for Trouble {
    fn from(why: std::io::Error) -> Self {
        Trouble::Bad(why.to_string())
    }
}

impl<R: Read + Seek> Reader<R> {
    /// A reader at the beginning of a record.
    pub fn new(from: R) -> Self {
        Reader {
            from,
            at: 0,
            part: Part::Magic,
            body: Vec::new(),
            messages: VecDeque::new(),
            wanted: Wanted::All,
            window: [0, u64::MAX],
            last: [0; TOPICS.len()],
            size: None,
            in_vain: 0,
            checksum: Some(crc32fast::Hasher::new()),
            found: Integrity::default(),
        }
    }

    /// Passes over messages of other topics than `topic`: they are checked, not given out.
    pub fn only(mut self, topic: &'static str) -> Self {
        self.wanted = Wanted::Only(topic);
        self
    }

    /// From here on passes over chunks that lie wholly outside of these log times, in ns since 1970: they are
    /// not opened, so [`Reader::integrity`] takes their messages for missing.
    pub fn between(&mut self, window: [u64; 2]) {
        self.window = window;
    }

    /// Whether the record that was read is a chunk outside of the window.
    fn is_outside(&self, opcode: u8) -> bool {
        let [from, to] = self.window;
        let outside = |head: ChunkHeader| head.message_end_time < from || head.message_start_time > to;
        opcode == op::CHUNK && ChunkHeader::read_le(&mut Cursor::new(&self.body)).is_ok_and(outside)
    }

    /// Checks the messages and gives none out.
    pub(super) fn no_messages(mut self) -> Self {
        self.wanted = Wanted::None;
        self
    }

    /// What was found to be other than it was written; known once there are no more entries.
    pub fn integrity(&self) -> &Integrity {
        &self.found
    }

    /// Reads up to `wanted` bytes into the body; whether there were as many.
    fn fill(&mut self, wanted: u64) -> std::io::Result<bool> {
        self.body.clear();
        Ok((&mut self.from).take(wanted).read_to_end(&mut self.body)? as u64 == wanted)
    }

    /// Reads the head of a record of the format: opcode, length, and the bytes themselves. `None` at the end of the file.
    fn head(&mut self) -> Result<Option<(u8, u64, [u8; HEAD])>, Trouble> {
        if !self.fill(HEAD as u64)? {
            return if self.body.is_empty() { Ok(None) } else { Err(Trouble::Short) };
        }
        let head: [u8; HEAD] = self.body[..].try_into().expect("as many bytes as requested");
        let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
        Ok(Some((head[0], length, head)))
    }

    /// Reads the record of the format that begins at `at`, where the file is read now; `None` at the end of the file.
    fn record(&mut self, at: u64) -> Result<Option<(Checked, [u8; HEAD])>, Trouble> {
        let size = self.size(at)?;
        let Some((opcode, length, head)) = self.head()? else { return Ok(None) };
        if !known(opcode) {
            return Err(Trouble::Bad(format!("no record is of the kind {opcode:#04x}")));
        }
        if length > LONGEST {
            return Err(Trouble::Bad(format!("a record of {length} bytes is longer than any")));
        }
        if at + HEAD as u64 + length > size || !self.fill(length)? {
            return Err(Trouble::Short);
        }
        if self.is_outside(opcode) {
            return Ok(Some((Checked::Nothing, head)));
        }
        let sound = verify(opcode, &self.body, self.wanted).map_err(Trouble::Bad);
        if sound.is_err() {
            self.in_vain += length + A_LOOK;
        }
        Ok(Some((sound?, head)))
    }

    fn seek(&mut self, to: u64) -> Result<(), Trouble> {
        Ok(self.from.seek(SeekFrom::Start(to)).map(drop)?)
    }

    /// The next place from `from` on where a sound record begins, by its checksum or by its form alone where
    /// it is the mark of the data's end.
    fn next_sound(&mut self, from: u64) -> Option<u64> {
        let mut window = Vec::new();
        let (mut base, mut length, size) = (from, *WINDOWS.start(), self.size(from).ok()?);
        loop {
            self.seek(base).ok()?;
            window.clear();
            (&mut self.from).take(length as u64).read_to_end(&mut window).ok()?;
            let starts = window.len().checked_sub(HEAD)?;
            for i in 0..=starts {
                let at = base + i as u64;
                if may_begin(&window[i..]).is_none_or(|length| at + HEAD as u64 + length > size) {
                    continue;
                }
                if self.is_in_vain(size) {
                    return None;
                }
                self.seek(at).ok()?;
                if matches!(self.record(at), Ok(Some(_))) {
                    return Some(at);
                }
            }
            base += starts as u64 + 1;
            length = (2 * length).min(*WINDOWS.end());
        }
    }

    /// Whether so much was read for nothing that the search ends.
    fn is_in_vain(&self, size: u64) -> bool {
        self.in_vain > IN_VAIN.0.saturating_mul(size).saturating_add(IN_VAIN.1)
    }

    /// Length of the file; it is read on from `at` then.
    fn size(&mut self, at: u64) -> std::io::Result<u64> {
        if let Some(size) = self.size {
            return Ok(size);
        }
        let size = self.from.seek(SeekFrom::End(0))?;
        self.from.seek(SeekFrom::Start(at))?;
        Ok(*self.size.insert(size))
    }

    /// Leaves out what cannot be read from here on, up to the next good record; without one the record is cut here.
    fn leave_out(&mut self, trouble: Trouble) {
        self.checksum = None;
        let from = self.at;
        let next = self.next_sound(from + 1);
        let why = match trouble {
            Trouble::Short => "a record is longer than what follows it".into(),
            Trouble::Bad(why) => why,
        };
        match next {
            Some(next) if self.seek(next).is_ok() => {
                self.found.place(from, next, why);
                self.at = next;
            }
            _ => {
                let size = self.size(from).unwrap_or(from);
                self.part = Part::Over;
                let what = if self.is_in_vain(size) {
                    "too much looks like a record and is none: the search ended, and nothing is read"
                } else {
                    "nothing can be read"
                };
                self.found.cut = Some(format!("{what} behind byte {from} of {size} ({why})"));
            }
        }
    }

    fn magic(&mut self) {
        let magic = mcap::MAGIC;
        self.part = Part::Data;
        let whole = self.fill(magic.len() as u64).unwrap_or(false);
        if self.body.is_empty() {
            (self.part, self.found.cut) = (Part::Over, Some("the file is empty".into()));
        } else if !whole || self.body != magic {
            self.at = 0;
            self.leave_out(Trouble::Bad("it does not begin as an MCAP file does".into()));
        } else {
            self.at = magic.len() as u64;
            self.hash(magic);
        }
    }

    fn hash(&mut self, bytes: &[u8]) {
        if let Some(checksum) = &mut self.checksum {
            checksum.update(bytes);
        }
    }

    /// Reads on in the data.
    fn data(&mut self) -> Option<Entry> {
        let (sound, head) = match self.record(self.at) {
            Ok(Some(read)) => read,
            Ok(None) => {
                self.part = Part::Over;
                self.found.cut = Some("the file ends before its footer".into());
                return None;
            }
            Err(trouble) => {
                self.leave_out(trouble);
                return None;
            }
        };
        self.at += (HEAD + self.body.len()) as u64;
        if !matches!(sound, Checked::DataEnd(_))
            && let Some(checksum) = &mut self.checksum
        {
            checksum.update(&head);
            checksum.update(&self.body);
        }
        match sound {
            Checked::Nothing => {}
            Checked::Chunk(messages) => self.messages = messages,
            Checked::Entry(entry) => {
                self.heard(&entry);
                return Some(entry);
            }
            Checked::DataEnd(stated) => {
                let found = self.checksum.replace(crc32fast::Hasher::new()).map(|c| c.finalize());
                if found.is_some_and(|found| found != stated) {
                    // Every chunk, attachment and fact has been checked by its own checksum: what is damaged lies between.
                    let why = "the checksum of the data does not agree; every chunk, file and fact is as it was \
                               written, so it is in the heads or indexes between them";
                    self.found.somewhere = Some(why.into());
                }
                self.part = Part::Index;
            }
        }
        None
    }

    /// What the last words say of the messages, compared with those that came.
    fn heard(&mut self, entry: &Entry) {
        let Entry::Facts { name, facts } = entry else { return };
        if name == RECOVERED {
            self.found.recovered = facts.get("found").cloned();
        }
        if name != TRAILER {
            return;
        }
        for (kind, fact) in WRITTEN.iter().enumerate() {
            if let Some(written) = facts.get(*fact).and_then(|n| n.parse::<u32>().ok()) {
                self.came(kind, written.wrapping_add(1));
                self.last[kind] = written;
            }
        }
    }

    /// Notes that message `number` of a topic came, or would have come: what is missing before it.
    fn came(&mut self, kind: usize, number: u32) {
        let after = self.last[kind];
        let missing = number.wrapping_sub(after).wrapping_sub(1);
        // A number before the last one is no gap: no writer goes back.
        if missing > 0 && missing < u32::MAX / 2 {
            self.found.gap(TOPICS[kind], u64::from(after), u64::from(missing));
        }
    }

    /// Reads the index through: nothing of it is given out, all of it is checked.
    fn index(&mut self) {
        let read = self.index_record();
        let start = self.at;
        match read {
            Ok(Some(0)) => self.part = Part::Over,
            Ok(Some(length)) => self.at += length,
            Ok(None) | Err(Trouble::Short) => {
                self.part = Part::Over;
                self.found.cut = Some("the file ends within its index; all of its data is there".into());
            }
            Err(Trouble::Bad(why)) => {
                self.part = Part::Over;
                let size = self.size(start).unwrap_or(start);
                self.found.place(start, size, format!("the index: {why}; all of the data is there"));
            }
        }
    }

    /// Reads a record of the index and returns its length, 0 for the footer and what follows it.
    fn index_record(&mut self) -> Result<Option<u64>, Trouble> {
        let Some((opcode, length, head)) = self.head()? else { return Ok(None) };
        if length > LONGEST {
            return Err(Trouble::Bad(format!("a record of {length} bytes is longer than any")));
        }
        if !self.fill(length)? {
            return Err(Trouble::Short);
        }
        let body = std::mem::take(&mut self.body);
        self.hash(&head);
        if opcode != op::FOOTER {
            self.hash(&body);
            self.body = body;
            return Ok(Some(HEAD as u64 + length));
        }
        let Some((covered, stated)) = body.split_last_chunk::<4>() else {
            return Err(Trouble::Bad("the footer is too short".into()));
        };
        self.hash(covered);
        let found = self.checksum.take().map(|c| c.finalize());
        if found != Some(u32::from_le_bytes(*stated)) {
            return Err(Trouble::Bad("its checksum does not agree".into()));
        }
        let magic = mcap::MAGIC;
        if !self.fill(magic.len() as u64)? {
            return Err(Trouble::Short);
        }
        if self.body != magic {
            return Err(Trouble::Bad("the file does not end as an MCAP file does".into()));
        }
        if self.fill(1)? { Err(Trouble::Bad("something follows its end".into())) } else { Ok(Some(0)) }
    }
}

impl<R: Read + Seek> Iterator for Reader<R> {
    type Item = Entry;

    fn next(&mut self) -> Option<Entry> {
        loop {
            while let Some(Message { kind, number, log_time, text }) = self.messages.pop_front() {
                self.came(kind, number);
                self.last[kind] = number;
                if let Some(text) = text {
                    return Some(Entry::Message { topic: TOPICS[kind], number, log_time, text });
                }
            }
            match self.part {
                Part::Magic => self.magic(),
                Part::Data => {
                    if let Some(entry) = self.data() {
                        return Some(entry);
                    }
                }
                Part::Index => self.index(),
                Part::Over => return None,
            }
        }
    }
}

#[cfg(test)]
mod tests;
