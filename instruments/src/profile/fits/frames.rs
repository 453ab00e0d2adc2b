//! What a frame must be: within its table, its rate and its line, with its counters.

use super::FASTEST_HZ;
use crate::error::ProfileError;
use crate::profile::compile::Compiler;
use crate::profile::{CompiledSignal, Frame, FrameKind, MOST_REGISTERS, Place};
use crate::schema::{LinkKind, Table};

impl Compiler<'_> {
    pub(super) fn check_poll(&self, poll: &crate::schema::Poll) -> Result<(), ProfileError> {
        let stated = poll.address.zip(poll.count);
        let past = |(address, count): (u16, u16)| u32::from(address) + u32::from(count) > 65536;
        let read = match (poll.once, poll.rate_hz) {
            (true, rate) => rate.is_none(),
            (false, rate) => rate.is_some_and(|rate| rate > 0.0 && rate <= FASTEST_HZ),
        };
        let why = if let Some((_, count)) = stated.filter(|(_, n)| !(1..=MOST_REGISTERS).contains(n)) {
            format!("has {count} registers; one read takes 1 to {MOST_REGISTERS}")
        } else if stated.is_some_and(past) {
            "runs past register 65535".into()
        } else if poll.address.is_some() != poll.count.is_some() {
            "needs both `address` and `count`, or neither".into()
        } else if !read {
            format!("needs either `once = true` or a `rate_hz` above 0 and at most {FASTEST_HZ}")
        } else {
            return Ok(());
        };
        Err(self.at_name(&poll.name, format!("poll `{}` {why}", poll.name.as_ref())))
    }

    pub(super) fn check_blocks(&self) -> Result<(), ProfileError> {
        for block in &self.description.write {
            let name = block.name.as_ref();
            let why = if !(1..=123).contains(&block.count) {
                format!("block `{name}` has {} registers; one write takes 1 to 123", block.count)
            } else if !matches!(block.table, Table::Holding | Table::Coil) {
                format!("block `{name}`: only holding registers and coils can be written")
            } else if block.rate_hz.is_some_and(|rate| !(rate > 0.0 && rate <= FASTEST_HZ)) {
                format!("block `{name}`: a `rate_hz` is above 0 and at most {FASTEST_HZ}")
            } else {
                continue;
            };
            return Err(self.at_name(&block.name, why));
        }
        Ok(())
    }

    pub(super) fn check_stream(&self) -> Result<(), ProfileError> {
        let d = self.description;
        let Some(stream) = &d.stream else { return Ok(()) };
        let free = matches!(d.link.kind, LinkKind::Serial | LinkKind::Tcp | LinkKind::Udp);
        let starts = stream.start_register.is_some() || stream.start_function.is_some();
        let (line, length, check) = (stream.line.is_some(), stream.length.map(usize::from), stream.check);
        let (sync, check_from) = (stream.sync.len(), usize::from(stream.check_from));
        let around = check.map(|check| check_from.max(sync) + check.length());
        let why = if !line && (length.is_none() || check.is_none() && d.link.kind != LinkKind::Udp) {
            "`length` and `check` are needed, or `line`: without a check a stream cannot be trusted"
        } else if check.is_none() && length.is_some_and(|length| length <= sync) {
            "`length` leaves no byte after sync"
        } else if length.zip(around).is_some_and(|(length, around)| length <= around) {
            "`length` leaves no byte between sync and check"
        } else if !(stream.rate_hz > 0.0 && stream.rate_hz <= FASTEST_HZ) {
            "a `rate_hz` is above 0 and at most 20000"
        } else if free && !(d.query.is_empty() && d.set.is_empty()) {
            "it leaves no room for [[query]] and [[set]] on its line"
        } else if !free && starts && stream.stop.is_none() {
            "what is started needs `stop`"
        } else if !free && !starts {
            "needs `start_register` or `start_function`; one that runs by itself is of kind `serial`, `tcp` or `udp`"
        } else if d.poll.iter().any(|poll| poll.rate_hz.is_some()) {
            "while it runs nothing is polled: polls can be read `once`"
        } else {
            return Ok(());
        };
        self.refuse("[stream]", format!("[stream]: {why}"))
    }

    /// Counters stand in the frames that they count, and every number of a line has its signal.
    pub(in crate::profile) fn check_frames(
        &self,
        frames: &[Frame],
        signals: &[CompiledSignal],
    ) -> Result<(), ProfileError> {
        let d = self.description;
        for (index, frame) in frames.iter().enumerate() {
            let (counter, clock) = match &frame.kind {
                FrameKind::Stream => (d.stream.as_ref().and_then(|stream| stream.sequence.as_ref()), None),
                FrameKind::Messages(group, _) => (d.message[*group].sequence.as_ref(), None),
                FrameKind::Poll(poll) => {
                    (d.poll[*poll].sequence.as_ref(), d.poll[*poll].device_time.as_ref())
                }
                FrameKind::Query(_) => (None, None),
            };
            let placed = |name: &str| {
                let own = |signal: &CompiledSignal| {
                    signal.frame.0 == index && !matches!(signal.place, Place::Computed(_))
                };
                d.signal.iter().zip(signals).find(|(signal, s)| own(s) && signal.name.as_ref() == name)
            };
            let stands = |name: &str| placed(name).is_some();
            // A number in a line of text is stored as a float.
            let counts =
                |name: &str| placed(name).is_some_and(|(_, s)| frame.text.is_some() || s.place.has_counts());
            let wrong_counter = counter.filter(|name| !counts(name)).map(|name| ("sequence", name));
            let wrong_clock = clock.filter(|name| !stands(name)).map(|name| ("device_time", name));
            if let Some((key, name)) = wrong_counter.or(wrong_clock) {
                let what = if stands(name) { "a float, which counts nothing" } else { "not a signal in it" };
                let why = format!("`{key}` of `{}`: `{name}` is {what}", frame.name);
                return self.refuse(&format!("{key} = \"{name}\""), why);
            }
            if let Some(crate::codec::text::Form::Pattern(pattern)) = &frame.text
                && let Some((name, _)) = pattern.fields().find(|(name, _)| !stands(name))
            {
                let why =
                    format!("`{{{name}}}` in the line of `{}` is not a signal of that frame", frame.name);
                let refusal = self.at_text(&format!("{{{name}"), why);
                return Err(refusal.with_help("`{*}` stands for what does not matter"));
            }
        }
        Ok(())
    }
}
