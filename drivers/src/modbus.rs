//! The conversation with an instrument of registers, whatever carries it.

use super::connection::{Connection, Periodic};
use super::endpoint::Due;
use super::link_error::{BAD_IN_A_ROW, LinkError};
use super::off::{self, OFF_ANSWER_MS, OffWay};
use instruments::profile::{Profile, Span};
use instruments::schema::{Poll, Table, Write};
use instruments::{FrameId, SetId};
use std::convert::Infallible;

/// What may come of one request.
#[derive(Debug)]
pub enum Trouble {
    /// The instrument understood, and refused.
    Refused(String),
    /// The answer did not pass its checks; the line is clear again.
    Corrupt(String),
    /// The connection is of no more use.
    LinkError(LinkError),
}

/// Registers at the other end of a wire. What may go wrong with them: [`Trouble`].
pub trait Registers {
    /// Reads registers, as bytes in the order of the wire.
    fn read(&mut self, table: Table, address: u16, count: u16) -> Result<Vec<u8>, Trouble>;

    /// Writes neighbouring registers of a table that can be written.
    fn write(&mut self, table: Table, address: u16, registers: &[u16]) -> Result<(), Trouble>;

    /// A function of the maker's own with its byte; only over RTU.
    fn own_function(&mut self, function: u8, _data: u8) -> Result<(), Trouble> {
        Err(Trouble::Refused(format!("function {function:#04x} goes over RTU only")))
    }

    /// From now on an answer may take so long.
    fn wait_up_to(&mut self, answer_ms: u32);
}

/// A conversation over a wire: blocks as last sent, and bad answers in a row.
pub struct Conversation<'a> {
    wire: &'a mut dyn Registers,
    blocks: Blocks,
    bad: u32,
}

/// The bytes of every block of registers that set-points are written to.
pub struct Blocks(Vec<Vec<u8>>);

impl Blocks {
    /// All of them zero.
    pub fn of(profile: &Profile) -> Self {
        Self(profile.description.write.iter().map(|block| vec![0; 2 * usize::from(block.count)]).collect())
    }

    /// Puts set-points in, and gives every block that holds one of them, in the order in which they name it.
    pub fn put(&mut self, profile: &Profile, set_points: &[(SetId, f64)]) -> Vec<(Write, Vec<u16>)> {
        let mut touched = Vec::new();
        for (set, value) in set_points {
            let holds = |index: &usize| profile.sets_of(*index).any(|here| here == *set);
            if let Some(index) = (0..self.0.len()).find(holds) {
                // Ranges were checked when the command was taken.
                let _ = profile.encode_set(*set, *value, &mut self.0[index]);
                if !touched.contains(&index) {
                    touched.push(index);
                }
            }
        }
        let blocks = &profile.description.write;
        touched.into_iter().map(|index| (blocks[index].clone(), words(&self.0[index]))).collect()
    }

    /// Puts one set-point in, and gives its own registers with their table and the first of their addresses:
    /// its block also holds set-points that nobody requested.
    pub fn put_one(&mut self, profile: &Profile, set: SetId, value: f64) -> Option<(Table, u16, Vec<u16>)> {
        let (block, mut words) = self.put(profile, &[(set, value)]).pop()?;
        let described = &profile.description.set[set.0];
        let count = described.number.map_or(1, |number| number.bytes().div_ceil(2));
        let own = words.drain(..).skip(usize::from(described.register)).take(count).collect();
        Some((block.table, block.address + described.register, own))
    }
}

impl<'a> Conversation<'a> {
    /// Reads everything once, so that the signature is judged before anything is commanded.
    ///
    /// # Errors
    /// Why the connection is of no use.
    pub fn begin(connection: &mut Connection, wire: &'a mut dyn Registers) -> Result<Self, LinkError> {
        let mut conversation = Self { wire, blocks: Blocks::of(connection.endpoint.profile()), bad: 0 };
        off::at_the_beginning(connection, &mut conversation)?;
        let set_up = connection.endpoint.profile().description.init.is_empty();
        connection.endpoint.hold(!set_up);
        for (frame, poll) in polls(connection) {
            conversation.read(connection, frame, &poll)?;
        }
        conversation.initialise(connection)?;
        connection.endpoint.hold(false);
        if !set_up {
            conversation.read_state(connection)?;
        }
        Ok(conversation)
    }

    /// Polls and commands until something is wrong with the connection.
    ///
    /// # Errors
    /// Always: why it ended.
    pub fn go_on(
        mut self,
        connection: &mut Connection,
        rate_hz: Option<f64>,
    ) -> Result<Infallible, LinkError> {
        connection.tell(Ok(()));
        let now = connection.now();
        let often = |(frame, poll): (FrameId, Poll)| {
            poll.rate_hz.map(|rate| (Periodic::new(rate_hz.unwrap_or(rate), now), frame, poll))
        };
        let mut reads: Vec<_> = polls(connection).into_iter().filter_map(often).collect();
        // All blocks at the rate of the fastest: one command is in all of them.
        let blocks = connection.endpoint.profile().description.write.iter();
        let rates = blocks.map(|block| block.rate_hz.unwrap_or(100.0));
        let mut write = rates.reduce(f64::max).map(|rate| Periodic::new(rate, now));
        loop {
            if connection.stopping() {
                return Err(off::at_the_end(connection, &mut self));
            }
            let now = connection.now();
            if let Some(periodic) = write.as_mut().filter(|periodic| periodic.is_due(now)) {
                match connection.endpoint.due(now) {
                    Due::Nothing => {}
                    Due::SetPoints(set_points) => self.command(connection, &set_points)?,
                    Due::Safe(_) => self.send_off(connection)?,
                }
                periodic.advance(connection.now());
            }
            for (periodic, frame, poll) in &mut reads {
                if periodic.is_due(connection.now()) {
                    self.read(connection, *frame, poll)?;
                    periodic.advance(connection.now());
                }
            }
            let next =
                reads.iter().map(|(periodic, ..)| periodic.due).chain(write.as_ref().map(|w| w.due)).min();
            connection.sleep_until(next);
        }
    }

    fn read(&mut self, connection: &mut Connection, frame: FrameId, poll: &Poll) -> Result<(), LinkError> {
        // The first read that brings nothing ends the sample.
        let spans = connection.endpoint.profile().frames()[frame.0].spans.clone();
        let read = |span: &Span| self.wire.read(poll.table, span.address, span.count);
        let answer: Result<Vec<Vec<u8>>, Trouble> = spans.iter().map(read).collect();
        let answer = answer.map(|parts| parts.concat());
        let arrived = connection.now();
        if let Some(bytes) = self.judge(connection, answer)? {
            // A library may check the length in debug builds only; a short answer is refused here.
            connection.endpoint.frame(frame, &bytes, arrived)?;
        }
        Ok(())
    }

    /// Sends the loop's command in one piece. One that is not taken is followed by an 'off' at once.
    fn command(&mut self, connection: &mut Connection, set_points: &[(SetId, f64)]) -> Result<(), LinkError> {
        let answer = self.write(connection, set_points);
        if self.judge(connection, answer)?.is_none() {
            connection.endpoint.refused();
            self.send_off(connection)?;
        }
        Ok(())
    }

    /// Every block that holds one of the set-points, even after a failure; returns the first trouble.
    fn write(&mut self, connection: &Connection, set_points: &[(SetId, f64)]) -> Result<(), Trouble> {
        let mut outcome = Ok(());
        for (block, registers) in self.blocks.put(connection.endpoint.profile(), set_points) {
            match self.wire.write(block.table, block.address, &registers) {
                Err(Trouble::LinkError(ended)) => return Err(Trouble::LinkError(ended)),
                written => outcome = outcome.and(written),
            }
        }
        outcome
    }

    /// Tells 'the instrument refused' from 'we could not talk'. A few bad answers are borne.
    fn judge<T>(
        &mut self,
        connection: &Connection,
        answer: Result<T, Trouble>,
    ) -> Result<Option<T>, LinkError> {
        let health = connection.endpoint.health();
        let ended = match answer {
            Ok(value) => {
                self.bad = 0;
                return Ok(Some(value));
            }
            Err(Trouble::LinkError(ended)) => return Err(ended),
            Err(Trouble::Refused(problem)) => {
                health.count(&health.exceptions);
                LinkError::Refused(problem)
            }
            Err(Trouble::Corrupt(problem)) => {
                health.count(&health.corrupt_frames);
                LinkError::Corrupt(problem)
            }
        };
        health.problem(ended.to_string());
        self.bad += 1;
        // Before the first sample there is nothing to bear with a refusal: the map is wrong.
        let hopeless = connection.is_first() && matches!(ended, LinkError::Refused(_));
        if self.bad >= BAD_IN_A_ROW || hopeless { Err(ended) } else { Ok(None) }
    }

    /// What the profile wants done before the samples count, once the signature is known to hold.
    fn initialise(&mut self, connection: &Connection) -> Result<(), LinkError> {
        for init in &connection.endpoint.profile().description.init {
            let done = match (init.function, init.copy, &init.registers) {
                (Some((function, data)), ..) => self.wire.own_function(function, data),
                (None, Some((from, to, count)), _) => self
                    .wire
                    .read(Table::Holding, from, count)
                    .and_then(|bytes| self.wire.write(Table::Holding, to, &words(&bytes))),
                (None, None, Some((first, values))) => self.wire.write(init.table, *first, values),
                (None, None, None) => Ok(()),
            };
            match done {
                Ok(()) => {}
                Err(Trouble::LinkError(ended)) => return Err(ended),
                Err(Trouble::Refused(problem) | Trouble::Corrupt(problem)) => {
                    return Err(LinkError::Refused(format!("{}: {problem}", init.text)));
                }
            }
        }
        Ok(())
    }
}

fn words(block: &[u8]) -> Vec<u16> {
    block.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect()
}

impl OffWay for Conversation<'_> {
    fn send_off(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let safe = connection.endpoint.hand_out_off(connection.now());
        let health = connection.endpoint.health();
        let mut not_taken = |trouble: Trouble| match trouble {
            Trouble::LinkError(ended) => Err(ended),
            Trouble::Refused(problem) | Trouble::Corrupt(problem) => {
                health.count(&health.exceptions);
                health.problem(format!("'off' was not taken: {problem}"));
                Ok(false)
            }
        };
        let whole = self.write(connection, &safe);
        if whole.map_or_else(&mut not_taken, |()| Ok(true))? {
            return Ok(());
        }
        // Some instruments refuse a block for the sake of one value in it: each by itself then, whatever becomes of the others.
        let mut all = true;
        for (set, value) in safe {
            let own = self.blocks.put_one(connection.endpoint.profile(), set, value);
            let Some((table, address, registers)) = own else { continue };
            let taken = self.wire.write(table, address, &registers);
            all &= taken.map_or_else(&mut not_taken, |()| Ok(true))?;
        }
        if !all {
            connection.endpoint.refused();
        }
        Ok(())
    }

    fn be_patient(&mut self, connection: &Connection) {
        let limit = connection.endpoint.profile().description.link.response_timeout_ms;
        self.wire.wait_up_to(limit.max(OFF_ANSWER_MS));
    }

    fn read_state(&mut self, connection: &mut Connection) -> Result<(), LinkError> {
        let mut regular = polls(connection).into_iter().filter(|(_, poll)| poll.rate_hz.is_some());
        regular.try_for_each(|(frame, poll)| self.read(connection, frame, &poll))
    }
}

fn polls(connection: &Connection) -> Vec<(FrameId, Poll)> {
    connection.endpoint.profile().polls().map(|(frame, poll)| (frame, poll.clone())).collect()
}
