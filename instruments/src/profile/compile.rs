//! From a description to a profile: names become indices, and every refusal names its place.

use super::{
    CompiledSet, CompiledSignal, Frame, FrameId, FrameKind, Part, Place, Profile, SetId, SignalId, Span,
};
use crate::codec::dbc::{self, DbcMessage, Multiplex};
use crate::codec::eds::{self, Objects};
use crate::codec::pattern::Pattern;
use crate::codec::text::Form;
use crate::error::ProfileError;
use crate::expression::Expression;
use crate::field::{ByteOrder, Field, NumberType};
use crate::schema::{Description, Message, Poll};
use std::collections::HashMap;
use std::fmt::Display;
use std::ops::Range;

/// Gives the text of another file by its name.
type Files<'a> = &'a dyn Fn(&str) -> Option<String>;

/// Turns a description into a profile.
pub(in crate::profile) struct Compiler<'a> {
    /// The file, for places.
    pub text: &'a str,
    /// What it says.
    pub description: &'a Description,
    /// The files that it names.
    pub file: Files<'a>,
}

/// Messages of the profile's DBC file, by name.
type Messages = HashMap<String, DbcMessage>;

impl Compiler<'_> {
    /// Checks everything that the types cannot say, and compiles.
    pub fn compile(&self) -> Result<Profile, ProfileError> {
        let d = self.description;
        self.check_header()?;
        self.check_keys()?;
        self.check_sections()?;
        let messages = self.dbc()?;
        let sheet = self.eds()?;
        self.unique(d.signal.iter().map(|s| &s.name), "signal")?;
        self.unique(d.set.iter().map(|s| &s.name), "set-point")?;
        let by_name: HashMap<String, usize> =
            d.signal.iter().enumerate().map(|(i, s)| (s.name.as_ref().clone(), i)).collect();
        let index = |name: &str| by_name.get(name).copied();
        let frames = self.frames(&messages, &index)?;
        self.check_reads(&frames)?;
        let signal = |s| self.signal(s, &frames, &messages, &sheet, &index);
        let signals = d.signal.iter().map(signal).collect::<Result<Vec<_>, _>>()?;
        let mut taken = HashMap::new();
        for (signal, CompiledSignal { frame, place, .. }) in d.signal.iter().zip(&signals) {
            let Place::Bytes(field @ Field { bits: None, .. }) = place else { continue };
            for byte in field.at..field.end() {
                if let Some(first) = taken.insert((frame.0, byte), &signal.name) {
                    let [name, first] = [signal.name.as_ref(), first.as_ref()];
                    let why = format!("`{name}` and `{first}` share bytes: parts of one number have `bits`");
                    return Err(self.at_name(&signal.name, why));
                }
            }
        }
        let sets = d.set.iter().map(|s| self.set(s, &sheet)).collect::<Result<Vec<_>, _>>()?;
        let condition = |when: &toml::Spanned<String>| {
            Expression::compile(when.as_ref(), &index).map_err(|why| self.at(when.span(), why))
        };
        let signatures = d.signature.iter().map(|s| condition(&s.when)).collect::<Result<_, _>>()?;
        let faults = d.fault.iter().map(|f| condition(&f.when)).collect::<Result<_, _>>()?;
        for (set, compiled) in d.set.iter().zip(&sets) {
            let echo = set.echo.as_deref().and_then(index);
            self.check_echo(set, compiled, echo, echo.map(|at| &frames[signals[at].frame.0]))?;
        }
        self.check_cia402(&sets)?;
        self.check_emulator(&index)?;
        self.check_frames(&frames, &signals)?;
        Ok(Profile { description: d.clone(), frames, signals, sets, signatures, faults, by_name })
    }

    pub(super) fn at(&self, span: Range<usize>, message: impl ToString) -> ProfileError {
        ProfileError::at(self.text, Some(span), message)
    }

    /// A refusal of what has this name.
    pub(super) fn at_name(&self, name: &toml::Spanned<String>, message: impl ToString) -> ProfileError {
        self.at(name.span(), message)
    }

    /// A file that the profile names, read by its parser; refusals stand where the profile names it.
    fn read<T, E: Display>(&self, name: &str, parse: fn(&str) -> Result<T, E>) -> Result<T, ProfileError> {
        let text = (self.file)(name);
        let text = text.ok_or_else(|| self.at_text(name, format!("the file `{name}` is not there")))?;
        parse(text.trim_start_matches('\u{feff}')).map_err(|why| self.at_text(name, format!("{name}: {why}")))
    }

    /// A refusal of a text of the profile, at its first place there.
    pub(super) fn at_text(&self, text: &str, message: impl ToString) -> ProfileError {
        let place = self.text.find(text).map(|at| at..at + text.len());
        ProfileError::at(self.text, place, message)
    }

    /// The messages of the DBC file, if the profile names one.
    fn dbc(&self) -> Result<Messages, ProfileError> {
        let Some(name) = &self.description.link.dbc else { return Ok(HashMap::new()) };
        self.read(name, dbc::parse)
    }

    /// The objects of the profile's data sheet, if it names one, and what the profile writes to them at connection.
    fn eds(&self) -> Result<Objects, ProfileError> {
        let Some(name) = &self.description.link.eds else { return Ok(Objects::new()) };
        let error = |why: &dyn Display| self.at_text(name, format!("{name}: {why}"));
        let sheet = self.read(name, eds::parse)?;
        for (index, sub, bytes, _) in self.description.init.iter().filter_map(|init| init.sdo) {
            let wrong = match sheet.get(&(index, sub)) {
                None => "is not in the data sheet",
                Some(object) if !object.writable() => "cannot be written",
                Some(object) if object.number().map(NumberType::bytes) != Some(usize::from(bytes)) => {
                    "has another length"
                }
                Some(_) => continue,
            };
            return Err(error(&format!("object {index:04X}sub{sub} of an [[init]] {wrong}")));
        }
        let d = self.description;
        let sent =
            d.message.iter().filter_map(|m| Some((0x1800, m.cob?, usize::from(m.length.unwrap_or(8)))));
        let taken = d.write.iter().filter_map(|w| Some((0x1400, w.cob?, 2 * usize::from(w.count))));
        for (first, cob, length) in sent.chain(taken) {
            let (_, mapped) = eds::mapping(&sheet, first, cob).map_err(|why| error(&why))?;
            if mapped != length {
                let why = format!("the frame {cob:#x} has {mapped} bytes, the profile says {length}");
                return Err(error(&why));
            }
        }
        Ok(sheet)
    }

    /// Where an object stands in its process data, by the data sheet.
    fn mapped(
        &self,
        (object, bits): (Option<eds::Key>, Option<(u32, u32)>),
        first: u16,
        cob: Option<u32>,
        sheet: &Objects,
        name: &toml::Spanned<String>,
    ) -> Result<Field, ProfileError> {
        let error = |why: &dyn Display| self.at_name(name, format!("`{}`: {why}", name.as_ref()));
        let (object, cob) = object.zip(cob).ok_or_else(|| error(&"`object` needs a frame with `cob`"))?;
        let (placed, _) = eds::mapping(sheet, first, cob).map_err(|why| error(&why))?;
        let at = placed.iter().find(|(key, _)| *key == object).map(|(_, at)| *at);
        let at = at.ok_or_else(|| error(&format!("{:04X}sub{} is not mapped there", object.0, object.1)))?;
        let number = sheet.get(&object).and_then(eds::Object::number);
        let number = number.ok_or_else(|| error(&"the object is not a number of at most 32 bits"))?;
        // CANopen is little endian throughout.
        Ok(Field { at, number, order: ByteOrder::Dcba, bits })
    }

    /// All frames, in the order that indices follow.
    fn frames(
        &self,
        messages: &Messages,
        index: &dyn Fn(&str) -> Option<usize>,
    ) -> Result<Vec<Frame>, ProfileError> {
        let d = self.description;
        let by_name = |name: &Option<String>| name.as_deref().and_then(index).map(SignalId);
        let mut frames = Vec::new();
        for (i, poll) in d.poll.iter().enumerate() {
            let spans = self.spans(poll)?;
            let bytes = spans.iter().map(|span| 2 * usize::from(span.count)).sum();
            frames.push(Frame {
                spans,
                sequence: by_name(&poll.sequence),
                device_time: by_name(&poll.device_time),
                ..Frame::new(poll.name.as_ref(), bytes, FrameKind::Poll(i))
            });
        }
        if let Some(stream) = &d.stream {
            let text = stream.line.as_deref().map(|line| self.pattern(line)).transpose()?.map(Form::Pattern);
            let length = || usize::from(stream.length.unwrap_or(0));
            let bytes = text.as_ref().map_or_else(length, |form| 8 * form.numbers());
            let sequence = by_name(&stream.sequence);
            frames.push(Frame { sequence, text, ..Frame::new("stream", bytes, FrameKind::Stream) });
        }
        for (i, message) in d.message.iter().enumerate() {
            let parts = self.parts(message, messages)?;
            let bytes = parts.iter().map(|part| part.length).sum();
            let sequence = by_name(&message.sequence);
            let kind = FrameKind::Messages(i, parts);
            frames.push(Frame { sequence, ..Frame::new(message.name.as_ref(), bytes, kind) });
        }
        for (i, query) in d.query.iter().enumerate() {
            let text = match (query.length, &query.answer, &query.unit) {
                (None, Some(answer), _) => Some(Form::Pattern(self.pattern(answer)?)),
                (None, None, Some(unit)) => Some(Form::Quantity(unit.clone())),
                (None, None, None) => Some(Form::Number),
                (Some(_), ..) => None,
            };
            let numbers = text.as_ref().map_or(0, Form::numbers);
            let bytes = query.length.map_or(NumberType::F64.bytes() * numbers, usize::from);
            frames.push(Frame { text, ..Frame::new(query.name.as_ref(), bytes, FrameKind::Query(i)) });
        }
        let mut seen = std::collections::HashSet::new();
        let blocks = d.write.iter().map(|block| block.name.as_ref().as_str());
        let mut names = frames.iter().map(|frame| frame.name.as_str()).chain(blocks);
        if let Some(name) = names.find(|name| !seen.insert(*name)) {
            let place = self.text.rfind(&format!("\"{name}\"")).map(|at| at..at + name.len() + 2);
            let why = format!("a second frame or block is called `{name}`");
            return Err(ProfileError::at(self.text, place, why));
        }
        Ok(frames)
    }

    /// Identifiers (less their base) and lengths of a group's messages.
    fn parts(&self, group: &Message, messages: &Messages) -> Result<Vec<Part>, ProfileError> {
        let name = group.name.as_ref();
        let wrong = |why: String| self.at_name(&group.name, why);
        if let Some(cob) = group.cob {
            let length = usize::from(group.length.unwrap_or(8));
            return Ok(vec![Part { id: cob, extended: false, length, selector: None }]);
        }
        if group.replies.is_empty() {
            return Err(wrong(format!("message group `{name}` needs `replies` or `cob`")));
        }
        let part = |reply: &String| {
            let missing = || wrong(format!("`{reply}` of `{name}` is not a message of the DBC file"));
            let message = messages.get(reply).ok_or_else(missing)?;
            if let Some(fault) = &message.fault {
                return Err(wrong(format!("`{reply}` of `{name}` cannot be used: {fault}")));
            }
            let id = message.id.checked_sub(group.dbc_base.unwrap_or(0));
            let id = id.ok_or_else(|| wrong(format!("the identifier of `{reply}` is below `dbc_base`")))?;
            if message.length > 8 {
                let why = format!("`{reply}` has {} bytes: CAN FD is not supported", message.length);
                return Err(wrong(why));
            }
            let selector = group.multiplex.zip(message.selector()).map(|(value, signal)| (signal, value));
            if let Some((signal, value)) = selector.filter(|(signal, value)| *value > signal.mask()) {
                let why = format!("`multiplex` of `{name}`: {value} does not fit the {} bits", signal.size);
                return Err(wrong(why));
            }
            Ok(Part { id, extended: message.extended, length: message.length, selector })
        };
        let parts: Vec<Part> = group.replies.iter().map(part).collect::<Result<_, _>>()?;
        if group.multiplex.is_some() && parts.iter().all(|part| part.selector.is_none()) {
            return Err(wrong(format!("`multiplex` of `{name}`: none of its messages has a multiplexor")));
        }
        Ok(parts)
    }

    fn spans(&self, poll: &Poll) -> Result<Vec<Span>, ProfileError> {
        if let (Some(address), Some(count)) = (poll.address, poll.count) {
            return Ok(vec![Span { address, count }]);
        }
        let (name, alone) = (poll.name.as_ref(), self.description.poll.len() == 1);
        let mut wanted = Vec::new();
        for signal in &self.description.signal {
            let stands = signal.frame.as_ref().map_or(alone, |frame| frame == name);
            let Some(address) = signal.address.filter(|_| stands) else { continue };
            // A number has at most 8 bytes.
            let count = signal.number.map_or(1, |number| number.bytes().div_ceil(2)) as u16;
            if u32::from(address) + u32::from(count) > 65536 {
                let why = format!("signal `{}` runs past register 65535", signal.name.as_ref());
                return Err(self.at_name(&signal.name, why));
            }
            wanted.push(Span { address, count });
        }
        if wanted.is_empty() {
            let needs = "needs `address` and `count`, or signals with an `address` of their own";
            return Err(self.at_name(&poll.name, format!("poll `{name}` {needs}")));
        }
        Ok(Span::cover(wanted, poll.gap))
    }

    /// Where a register of the instrument's map stands in a frame; `None` where the frame does not hold all of the number.
    fn within(spans: &[Span], wanted: Span) -> Option<usize> {
        let mut before = 0;
        for span in spans {
            if wanted.address >= span.address && wanted.end() <= span.end() {
                return Some(before + 2 * usize::from(wanted.address - span.address));
            }
            before += 2 * usize::from(span.count);
        }
        None
    }

    fn signal(
        &self,
        s: &crate::schema::Signal,
        frames: &[Frame],
        messages: &Messages,
        sheet: &Objects,
        index: &dyn Fn(&str) -> Option<usize>,
    ) -> Result<CompiledSignal, ProfileError> {
        let name = s.name.as_ref();
        let wrong = |why: String| self.at_name(&s.name, why);
        let in_signal = |why| wrong(format!("signal `{name}`: {why}"));
        let frame = match &s.frame {
            Some(wanted) => frames
                .iter()
                .position(|frame| frame.name == *wanted)
                .ok_or_else(|| wrong(format!("the frame of signal `{name}`, `{wanted}`, does not exist")))?,
            None if frames.len() == 1 => 0,
            None => {
                // The pattern of an answer says itself which numbers it holds.
                let holds = |frame: &Frame| match &frame.text {
                    Some(Form::Pattern(pattern)) => pattern.fields().any(|(field, _)| field == name),
                    _ => false,
                };
                let mut holding = (0..frames.len()).filter(|&i| holds(&frames[i]));
                let (Some(one), None) = (holding.next(), holding.next()) else {
                    let names: Vec<&str> = frames.iter().map(|frame| frame.name.as_str()).collect();
                    return Err(wrong(format!("signal `{name}` needs `frame`, one of {}", names.join(", "))));
                };
                one
            }
        };
        let place = match &s.value {
            None if s.object.is_some() => {
                let cob = match frames[frame].kind {
                    FrameKind::Messages(group, _) => self.description.message[group].cob,
                    _ => None,
                };
                Place::Bytes(self.mapped((s.object, s.bits), 0x1800, cob, sheet, &s.name)?)
            }
            None => self.place(s, &frames[frame], messages)?,
            Some(value) => Place::Computed(Expression::compile(value, index).map_err(in_signal)?),
        };
        if let Place::Bytes(field) = &place {
            let bit =
                matches!(frames[frame].kind, FrameKind::Poll(i) if self.description.poll[i].table.is_bits());
            self.check_field(field, frames[frame].bytes, bit, &s.name)?;
        }
        let scales = [s.scale, s.si.factor];
        if scales.contains(&0.0) || !scales.iter().chain([&s.offset]).all(|x| x.is_finite()) {
            return Err(wrong(format!("a scale or the offset of signal `{name}` is zero or not finite")));
        }
        self.check_unit(&s.name, &s.unit, s.si.factor, &s.si)?;
        if let (Some((message, signal)), None) =
            (s.dbc.as_deref().and_then(|d| d.split_once('.')), &s.scale_expr)
            && let Some(unit) = messages.get(message).and_then(|m| m.units.get(signal))
        {
            self.check_unit(&s.name, unit, s.scale * s.si.factor, &s.si)?;
        }
        if s.range.is_some_and(|(low, high)| low >= high || low.is_nan() || high.is_nan()) {
            return Err(wrong(format!("the range of signal `{name}` is empty")));
        }
        let compile = |text: &Option<String>| {
            text.as_ref().map(|text| Expression::compile(text, index).map_err(in_signal)).transpose()
        };
        if s.resolution_si.is_some_and(|step| !(step.is_finite() && step > 0.0)) {
            return Err(wrong(format!("`resolution_si` of signal `{name}` must be above zero")));
        }
        if s.noise.is_some_and(|sd| !(sd.is_finite() && sd >= 0.0)) {
            return Err(wrong(format!("`noise` of signal `{name}` must not be below zero")));
        }
        let step = match (&place, &frames[frame].text) {
            (_, Some(Form::Pattern(pattern))) => {
                pattern.fields().find(|(field, _)| field == name).and_then(|(_, form)| form.step())
            }
            (place, _) if !place.has_counts() => None,
            (Place::Dbc(_, signal), _) => Some(signal.factor),
            _ => Some(1.0),
        };
        Ok(CompiledSignal {
            frame: FrameId(frame),
            resolution_si: s.resolution_si,
            step: step.unwrap_or(f64::NAN),
            place,
            scale: s.scale,
            scale_expression: compile(&s.scale_expr)?,
            offset: s.offset,
            si_factor: s.si.factor,
            range: s.range,
            valid_when: compile(&s.valid_when)?,
        })
    }

    fn place(
        &self,
        s: &crate::schema::Signal,
        frame: &Frame,
        messages: &Messages,
    ) -> Result<Place, ProfileError> {
        let name = s.name.as_ref();
        let wrong = |why: String| self.at_name(&s.name, why);
        if let Some(path) = &s.dbc {
            let unknown = || wrong(format!("`{path}` of signal `{name}` is not a signal of its messages"));
            let (message, signal) = path.split_once('.').ok_or_else(unknown)?;
            let signal = messages.get(message).and_then(|m| m.signals.get(signal)).ok_or_else(unknown)?;
            let FrameKind::Messages(group, _) = frame.kind else { return Err(unknown()) };
            let replies = &self.description.message[group].replies;
            let of_group = self.description.message[group].multiplex;
            let multiplexed = |how: &str| wrong(format!("`{path}` of signal `{name}` is multiplexed{how}"));
            match signal.multiplex {
                Multiplex::Where(value) if of_group != Some(value) => {
                    let how = format!(": it is there only where the multiplexor is {value}");
                    let help = format!("put it into a [[message]] of its own with `multiplex = {value}`");
                    return Err(multiplexed(&how).with_help(help));
                }
                Multiplex::Nested => {
                    let how = " by ranges or in two steps (SG_MUL_VAL_), which is not supported";
                    return Err(multiplexed(how).with_help("choose a message that always has it"));
                }
                _ => {}
            }
            let which = replies.iter().position(|reply| reply == message).ok_or_else(unknown)?;
            let before =
                replies[..which].iter().filter_map(|reply| messages.get(reply)).map(|m| m.length).sum();
            let part = s.bits.map_or(Some(*signal), |bits| signal.part(bits));
            let part = part.ok_or_else(|| {
                let why = format!("`bits` of signal `{name}`: `{path}` has not these bits, or is scaled");
                wrong(why).with_help("`bits` takes a part of a whole number without factor and offset")
            })?;
            return Ok(Place::Dbc(before, part));
        }
        let text_answer = frame.text.is_some();
        let placed = s.register.is_some() || s.address.is_some() || s.byte.is_some();
        let typed = s.number.is_some() || s.bits.is_some() || s.byte_order != ByteOrder::default();
        if text_answer && (placed || typed) {
            let has = "is in a line of text: it has no register, byte, type, byte order or bits";
            return Err(wrong(format!("signal `{name}` {has}")));
        }
        if let Some(Form::Pattern(pattern)) = &frame.text {
            let missing = || wrong(format!("signal `{name}` is not in the line of `{}`", frame.name));
            let at = pattern.fields().position(|(field, _)| field == name).ok_or_else(missing)?;
            let (number, order) = (NumberType::F64, ByteOrder::Abcd);
            return Ok(Place::Bytes(Field { at: 8 * at, number, order, bits: None }));
        }
        if let Some(address) = s.address {
            let number = s.number.ok_or_else(|| wrong(format!("signal `{name}` needs `type`")))?;
            let wanted = Span { address, count: number.bytes().div_ceil(2) as u16 };
            let alone = s.register.is_none() && s.byte.is_none();
            let at = Self::within(&frame.spans, wanted).filter(|_| alone).ok_or_else(|| {
                let help =
                    "`address` is a register of a [[poll]], and takes the place of `register` and `byte`";
                let why = format!("`address` {address} of signal `{name}` is not read by `{}`", frame.name);
                wrong(why).with_help(help)
            })?;
            return Ok(Place::Bytes(Field { at, number, order: s.byte_order, bits: s.bits }));
        }
        let mut polls = self.description.poll.iter();
        if let Some(poll) = polls.find(|poll| *poll.name.as_ref() == frame.name && poll.address.is_none()) {
            let poll = poll.name.as_ref();
            let why = format!("signal `{name}` needs `address`: poll `{poll}` names no registers of its own");
            return Err(wrong(why));
        }
        let at = match (s.register, s.byte) {
            (None, None) if text_answer => 0,
            (Some(register), None) => 2 * usize::from(register),
            (None, Some(byte)) => usize::from(byte),
            _ => return Err(wrong(format!("signal `{name}` needs either `register` or `byte`"))),
        };
        let number = if text_answer { Some(NumberType::F64) } else { s.number };
        let number = number.ok_or_else(|| wrong(format!("signal `{name}` needs `type`")))?;
        Ok(Place::Bytes(Field { at, number, order: s.byte_order, bits: s.bits }))
    }

    fn set(&self, s: &crate::schema::Set, sheet: &Objects) -> Result<CompiledSet, ProfileError> {
        let name = s.name.as_ref();
        let wrong = |why: String| self.at_name(&s.name, why);
        self.check_set(s)?;
        if let Some(send) = &s.send {
            return Ok(CompiledSet { block: None, scale: s.scale, line: Some(self.sent_line(s, send)?) });
        }
        let blocks = &self.description.write;
        let block = match &s.block {
            Some(block) => blocks.iter().position(|b| b.name.as_ref() == block).ok_or_else(|| {
                wrong(format!("the block of set-point `{name}`, `{block}`, does not exist"))
            })?,
            None if blocks.len() == 1 => 0,
            None => return Err(wrong(format!("set-point `{name}` needs `block` or `send`"))),
        };
        let field = if s.object.is_some() {
            self.mapped((s.object, None), 0x1400, blocks[block].cob, sheet, &s.name)?
        } else {
            let number = s.number.ok_or_else(|| wrong(format!("set-point `{name}` needs `type`")))?;
            Field { at: 2 * usize::from(s.register), number, order: s.byte_order, bits: None }
        };
        let number = field.number;
        let (bytes, bit) = (2 * usize::from(blocks[block].count), blocks[block].table.is_bits());
        self.check_field(&field, bytes, bit, &s.name)?;
        if let Some((low, high)) = s.range {
            let (least, most) = (number.limits().0 * s.scale, number.limits().1 * s.scale);
            if low < least.min(most) || high > least.max(most) {
                return Err(wrong(format!("the range of set-point `{name}` is more than its type can hold")));
            }
        }
        Ok(CompiledSet { block: Some((block, field)), scale: s.scale, line: None })
    }

    /// A pattern of the file, its place the text itself.
    pub(super) fn pattern(&self, text: &str) -> Result<Pattern, ProfileError> {
        Pattern::parse(text).map_err(|why| self.at_text(text, format!("`{text}`: {why}")))
    }

    /// The line that carries a set-point, and whose values stand in it.
    fn sent_line(
        &self,
        s: &crate::schema::Set,
        send: &str,
    ) -> Result<(Pattern, Vec<Option<SetId>>), ProfileError> {
        let name = s.name.as_ref();
        let wrong = |why: String| self.at_name(&s.name, why);
        let pattern = self.pattern(send)?;
        let own = |field: &str| field.is_empty() || field == name;
        let owner = |(field, _): (&str, &_)| {
            if own(field) {
                return Ok(None);
            }
            let sets = &self.description.set;
            let other = sets.iter().position(|set| set.name.as_ref() == field && set.send.is_some());
            other.map(|other| Some(SetId(other))).ok_or_else(|| {
                wrong(format!("`{{{field}}}` in the line of set-point `{name}` is not a set-point of text"))
            })
        };
        let owners = pattern.fields().map(owner).collect::<Result<Vec<_>, _>>()?;
        // A heartbeat alone may be the same whatever its value.
        let alike = s.send_zero.as_ref().is_none_or(|zero| zero == send) && name != "heartbeat";
        if !owners.contains(&None) && (alike || !owners.is_empty()) {
            return Err(wrong(format!("the line of set-point `{name}` has no `{{}}` for its own value")));
        }
        Ok((pattern, owners))
    }

    fn check_field(
        &self,
        field: &Field,
        frame_bytes: usize,
        bit: bool,
        named: &toml::Spanned<String>,
    ) -> Result<(), ProfileError> {
        let (name, end) = (named.as_ref(), field.end());
        if end > frame_bytes {
            let why = format!("`{name}` ends at byte {end} of a frame of {frame_bytes}");
            return Err(self.at_name(named, why));
        }
        if bit && field.number.bytes() > 2 {
            return Err(self.at_name(named, format!("`{name}` is a bit of its table: its type is `u16`")));
        }
        if let Some((first, width)) = field.bits {
            // a number has at most 4 bytes
            let most = 8 * field.number.bytes() as u32;
            if width == 0 || first >= most || width > most - first {
                return Err(self.at_name(named, format!("the bits of `{name}` lie outside its {most} bits")));
            }
        }
        Ok(())
    }
}
