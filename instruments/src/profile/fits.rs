//! What the types of a profile cannot say: what its kind of link can carry, and what a role needs.

mod frames;

use super::compile::Compiler;
use super::{CompiledSet, Frame, FrameKind};
use crate::codec::can::CanFrame;
use crate::codec::from_hex;
use crate::error::ProfileError;
use crate::schema::{Init, LinkKind, Message, Role, Set, Stamp, Table};

/// What a role needs: signals, and set-points.
const NEEDS: &[(Role, &[&str], &[&str])] = &[
    (
        Role::DriveUltrasonic,
        &["output_on", "echo_amplitude", "echo_frequency"],
        &["amplitude", "frequency", "enable"],
    ),
    (Role::MotionSlide, &["position", "velocity"], &["velocity"]),
    (Role::MotionLoad, &[], &["load"]),
    (Role::SafetySupply, &["closed"], &["closed"]),
];

/// Set-points that must have a `safe` value where they are: without it there is no 'off'.
const SAFE: &[(Role, &str)] = &[
    (Role::DriveUltrasonic, "enable"),
    (Role::MotionSlide, "velocity"),
    (Role::MotionSlide, "enable"),
    (Role::SafetySupply, "closed"),
];

/// The set-points that are commanded, by role: what has another name would be sent by nobody.
const COMMANDED: &[(Role, &[&str])] = &[
    (Role::DriveUltrasonic, &["amplitude", "frequency", "enable", "heartbeat"]),
    (Role::MotionSlide, &["velocity", "enable", "heartbeat"]),
    (Role::MotionLoad, &["load", "heartbeat"]),
    (Role::SafetySupply, &["closed", "heartbeat"]),
    (Role::AmbientChamber, &["pressure", "temperature", "humidity"]),
];

/// Longest `response_timeout_ms` of what can be switched off: a link tries two seconds to do so.
const LONGEST_ANSWER_MS: u32 = 2000;
/// Most samples per second.
const FASTEST_HZ: f64 = 20_000.0;

impl Compiler<'_> {
    /// Refuses a section, or what is in it.
    fn refuse(&self, section: &str, why: impl ToString) -> Result<(), ProfileError> {
        Err(self.at_text(section, why))
    }

    pub(super) fn check_header(&self) -> Result<(), ProfileError> {
        let link = &self.description.link;
        let wrong = |why: String| self.at_text("[profile]", why);
        let wrong_link = |why: &str| self.refuse("[link]", why);
        if self.description.profile.schema != 1 {
            let why = format!("schema {} is not known", self.description.profile.schema);
            return Err(wrong(why).with_help("this version reads schema = 1"));
        }
        let id = &self.description.profile.id;
        if id.is_empty() || !id.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)) {
            return Err(wrong(format!("`{id}` is not an id: letters, digits, `-`, `_` and `.`")));
        }
        let formed =
            |format: &String| matches!(format.as_bytes(), [b'7' | b'8', b'N' | b'E' | b'O', b'1' | b'2']);
        if let Some(format) = link.format.as_ref().filter(|format| !formed(format)) {
            let problem = format!(
                "`format`: `{format}` is none; data bits 7 or 8, parity N, E or O, stop bits 1 or 2, as 8N1"
            );
            return wrong_link(&problem);
        }
        let switches_off = self.description.set.iter().any(|set| set.safe.is_some());
        if link.response_timeout_ms == 0 || link.connect_timeout_ms == 0 {
            return wrong_link("`response_timeout_ms` and `connect_timeout_ms` are above zero");
        }
        if switches_off && link.response_timeout_ms > LONGEST_ANSWER_MS {
            return wrong_link(&format!(
                "`response_timeout_ms` is at most {LONGEST_ANSWER_MS} with `safe` set-points: an 'off' without an \
                 answer is sent again after this time"
            ));
        }
        if link.baud == Some(0) || link.bitrate == Some(0) {
            return wrong_link("a line of no bits per second carries nothing");
        }
        let serial = matches!(link.kind, LinkKind::ModbusRtu | LinkKind::Serial);
        if serial && (link.baud.is_none() || link.format.is_none()) {
            return wrong_link("a serial link needs `baud` and `format`");
        }
        if self.description.vector.is_empty() {
            return Err(wrong("the profile has no golden vector".into())
                .with_help("add a [[vector]] for every frame: bytes beside the values that they stand for"));
        }
        Ok(())
    }

    pub(super) fn unique<'b>(
        &self,
        names: impl Iterator<Item = &'b toml::Spanned<String>>,
        what: &str,
    ) -> Result<(), ProfileError> {
        let mut seen = std::collections::HashSet::new();
        for name in names {
            if !seen.insert(name.as_ref()) {
                return Err(self.at_name(name, format!("a second {what} is called `{}`", name.as_ref())));
            }
        }
        Ok(())
    }

    /// What each section says, by the kind of link that carries it.
    pub(super) fn check_sections(&self) -> Result<(), ProfileError> {
        let d = self.description;
        for (key, file) in [("dbc", &d.link.dbc), ("eds", &d.link.eds)] {
            if file.as_ref().is_some_and(|file| file.contains(['/', '\\'])) {
                return self.refuse("[link]", format!("`{key}`: the file must be beside the profile"));
            }
        }
        d.init.iter().try_for_each(|init| self.check_init(init))?;
        self.check_udp()?;
        d.poll.iter().try_for_each(|poll| self.check_poll(poll))?;
        self.check_blocks()?;
        self.check_stream()?;
        for alarm in &d.link.unsolicited {
            if self.pattern(alarm)?.head().is_empty() {
                return self.refuse("[link]", format!("the alarm `{alarm}` must begin with text of its own"));
            }
        }
        let messages = d.message.iter().map(|message| (&message.name, message.rate_hz));
        for (name, rate) in messages.chain(d.query.iter().map(|query| (&query.name, query.rate_hz))) {
            if !(rate > 0.0 && rate <= FASTEST_HZ) {
                let problem = format!("`{}`: a `rate_hz` is above 0 and at most {FASTEST_HZ}", name.as_ref());
                return Err(self.at_name(name, problem));
            }
        }
        let long = |m: &&Message| m.request.as_ref().is_some_and(|data| CanFrame::new(0, data).is_none());
        if let Some(message) = d.message.iter().find(long) {
            let problem = format!("`{}`: a `request` has 8 bytes at most", message.name.as_ref());
            return Err(self.at_name(&message.name, problem));
        }
        // An identifier of CANopen has 11 bits; a node's number, at most 127, is added to `cob`.
        let mut cobs =
            d.message.iter().map(|m| (&m.name, m.cob)).chain(d.write.iter().map(|w| (&w.name, w.cob)));
        if let Some((name, Some(cob))) = cobs.find(|(_, cob)| cob.is_some_and(|cob| cob > 0x780)) {
            let problem = format!("`{}`: `cob` = {cob:#x} is above 0x780, the largest", name.as_ref());
            return Err(self.at_name(name, problem));
        }
        for query in &d.query {
            let (name, send) = (query.name.as_ref(), &query.send);
            if d.link.kind == LinkKind::Sysfs
                && (send.is_empty() || send.starts_with('.') || send.contains(['/', ' ']))
            {
                let problem = format!("query `{name}`: `{send}` is no name of an attribute");
                return Err(self.at_name(&query.name, problem));
            }
        }
        let lines = matches!(d.link.kind, LinkKind::Serial | LinkKind::Tcp | LinkKind::Scpi);
        if let Some(set) = d.set.iter().find(|set| lines && set.send.is_none()) {
            let problem = format!("set-point `{}` needs `send`: its link speaks in lines", set.name.as_ref());
            return Err(self.at_name(&set.name, problem));
        }
        self.check_roles()
    }

    /// Datagrams: somebody must know where they are to go.
    fn check_udp(&self) -> Result<(), ProfileError> {
        let d = self.description;
        let (datagrams, local_port) = (d.link.kind == LinkKind::Udp, d.link.local_port.is_some());
        let why = if datagrams && d.stream.is_none() {
            "a link of kind Udp needs a [stream]"
        } else if datagrams && !local_port && d.init.is_empty() {
            "a link of kind Udp needs `local_port`, or an [[init]] that tells the instrument where to send"
        } else {
            return Ok(());
        };
        self.refuse("[link]", why)
    }

    /// Modbus RTU has no transaction number: an answer that comes late to one of two requests that
    /// look alike would be taken for the other's.
    pub(super) fn check_reads(&self, frames: &[Frame]) -> Result<(), ProfileError> {
        if self.description.link.kind != LinkKind::ModbusRtu {
            return Ok(());
        }
        let mut seen: Vec<(Table, u16)> = Vec::new();
        for frame in frames {
            let FrameKind::Poll(index) = frame.kind else { continue };
            let poll = &self.description.poll[index];
            for span in &frame.spans {
                if seen.contains(&(poll.table, span.count)) {
                    let problem =
                        format!("poll `{}` reads the same number of registers as a read before", frame.name);
                    return Err(self.at_name(&poll.name, problem).with_help(
                        "over RTU a late answer to one would be taken for the other's; read one register more, or raise `gap`",
                    ));
                }
                seen.push((poll.table, span.count));
            }
        }
        Ok(())
    }

    /// One [[init]] does one thing.
    fn check_init(&self, init: &Init) -> Result<(), ProfileError> {
        let text = [init.send.is_some(), init.hex.is_some()];
        let bus = [init.can.is_some(), init.sdo.is_some()];
        let modbus = [init.function.is_some(), init.copy.is_some(), init.registers.is_some()];
        let acts = text.iter().chain(&bus).chain(&modbus).filter(|used| **used).count();
        let no_frame = |(id, data): &(u32, Vec<u8>)| CanFrame::build(*id, *id > 0x7FF, data).is_none();
        let no_bytes = |hex: &str| from_hex(hex).is_none_or(|bytes| bytes.is_empty());
        let problem = match &init.registers {
            _ if acts != 1 => "does one thing: send, hex, can, function, copy, registers or sdo",
            Some((_, values)) if values.is_empty() || values.len() > 123 => {
                "one write takes 1 to 123 registers"
            }
            Some(_) if !matches!(init.table, Table::Holding | Table::Coil) => {
                "only holding registers and coils can be written"
            }
            _ if init.can.as_ref().is_some_and(no_frame) => {
                "`can` has an identifier of 29 bits at most, and 8 bytes at most"
            }
            _ if init.hex.as_deref().is_some_and(no_bytes) => "`hex` is not bytes in hexadecimal",
            _ => return Ok(()),
        };
        self.refuse("[[init]]", format!("an [[init]]: {problem}"))
    }

    fn check_roles(&self) -> Result<(), ProfileError> {
        let d = self.description;
        let signal = |name: &str| d.signal.iter().any(|signal| signal.name.as_ref() == name);
        let set = |name: &str| d.set.iter().find(|set| set.name.as_ref() == name);
        if d.profile.roles.is_empty() {
            return self.refuse("[profile]", "`roles` is empty: say what the instrument can be");
        }
        for role in &d.profile.roles {
            let problem = |what: String| {
                self.refuse("[profile]", format!("an instrument of role {role:?} needs {what}"))
            };
            let kind = match role {
                Role::AmbientChamber => LinkKind::ModbusTcp,
                Role::MeasureVibration => LinkKind::Serial,
                _ => d.link.kind,
            };
            if kind != d.link.kind {
                return problem(format!("a link of kind {kind:?}"));
            }
            for (_, signals, sets) in NEEDS.iter().filter(|(named, ..)| named == role) {
                let mut marked =
                    d.signal.iter().filter(|signal| signal.valid_when.is_some()).map(|s| &s.name);
                if let Some(name) = marked.find(|name| signals.contains(&name.as_ref().as_str())) {
                    let why = format!("{role:?} reads `{}` whatever `valid_when` says", name.as_ref());
                    return Err(self
                        .at_name(name, why)
                        .with_help("a [[fault]] of severity stop ends the run"));
                }
                if let Some(missing) = signals.iter().find(|name| !signal(name)) {
                    return problem(format!("a signal `{missing}`"));
                }
                if let Some(missing) = sets.iter().find(|name| set(name).is_none()) {
                    return problem(format!("a set-point `{missing}`"));
                }
            }
            let not_safe = |name: &str| set(name).is_some_and(|set| set.safe.is_none());
            if let Some((_, name)) = SAFE.iter().find(|(named, name)| named == role && not_safe(name)) {
                let what = format!("a `safe` value of its set-point `{name}`: without it there is no 'off'");
                return problem(what);
            }
            if matches!(role, Role::ForceLateral | Role::ForceNormal) && d.signal.is_empty() {
                return problem("a signal".into());
            }
        }
        let clock = d.poll.iter().any(|poll| poll.device_time.is_some());
        if clock != (d.time.stamp == Stamp::Device) {
            let why = "`device_time` of a [[poll]] and `stamp = \"device\"` of [time] belong together";
            return self.refuse(if clock { "device_time" } else { "[time]" }, why);
        }
        self.check_heartbeat()?;
        self.check_commanded()
    }

    /// Over CANopen the driver commands a drive of CiA 402 in profile velocity mode, and nothing else.
    pub(super) fn check_cia402(&self, sets: &[CompiledSet]) -> Result<(), ProfileError> {
        let d = self.description;
        let stage = |role: &Role| matches!(role, Role::MotionSlide | Role::MotionLoad);
        let first = |set: &CompiledSet| set.block.is_some_and(|(_, field)| (field.at, field.end()) == (0, 2));
        let mut controls = d.set.iter().zip(sets).filter(|(set, _)| set.name.as_ref() == "control");
        let missing = if d.link.kind != LinkKind::Canopen {
            return Ok(());
        } else if !(d.profile.roles.contains(&Role::MotionSlide) && d.profile.roles.iter().all(stage)) {
            "the role `motion.slide`, and no other but `motion.load`"
        } else if !d.signal.iter().any(|signal| signal.name.as_ref() == "statusword") {
            "a signal `statusword` (object 0x6041)"
        } else if !controls.any(|(_, set)| first(set)) {
            "a set-point `control` (object 0x6040), the first two bytes of its block"
        } else if d.message.len() != 1 || d.write.len() != 1 || d.write[0].cob.is_none() {
            "one [[message]] and one [[write]], each with `cob`"
        } else {
            return Ok(());
        };
        let why = "CANopen is for drives of CiA 402 in profile velocity mode";
        self.refuse("[link]", format!("{why}: the profile needs {missing}"))
    }

    /// Only a heartbeat has a time that the instrument waits for the next one.
    fn check_heartbeat(&self) -> Result<(), ProfileError> {
        let wrong = |set: &&Set| set.timeout_ms.is_some_and(|ms| ms == 0 || set.name.as_ref() != "heartbeat");
        let problem = "`timeout_ms` is above zero, and belongs to the set-point `heartbeat`";
        let wrong = self.description.set.iter().find(wrong);
        wrong.map_or(Ok(()), |set| Err(self.at_name(&set.name, problem)))
    }

    /// Whether each set-point is one that the roles command.
    fn check_commanded(&self) -> Result<(), ProfileError> {
        let d = self.description;
        let has = |role: &Role| d.profile.roles.contains(role);
        let of_roles = COMMANDED.iter().filter(|(role, _)| has(role)).flat_map(|(_, names)| names.iter());
        let control = (d.link.kind == LinkKind::Canopen).then_some("control");
        let known: Vec<&str> = of_roles.copied().chain(control).collect();
        let unknown = d.set.iter().find(|set| !known.contains(&set.name.as_ref().as_str()));
        let Some(Set { name, .. }) = unknown else { return Ok(()) };
        let (set, names) = (name.as_ref(), known.join(", "));
        let problem = format!("nobody would send the set-point `{set}`; its roles have: {names}");
        Err(self.at_name(name, problem).with_help("what is done once goes into an [[init]]"))
    }

    pub(super) fn check_emulator(&self, index: &dyn Fn(&str) -> Option<usize>) -> Result<(), ProfileError> {
        let emulator = &self.description.emulator;
        let is_set = |name: &String| self.description.set.iter().any(|set| set.name.as_ref() == name);
        let mut shown = emulator.measure.keys().chain(emulator.constant.keys());
        let signal = shown.find(|name| index(name).is_none()).map(|name| (name, "signal"));
        let set = || emulator.command.keys().find(|name| !is_set(name)).map(|name| (name, "set-point"));
        signal.or_else(set).map_or(Ok(()), |(name, what)| {
            self.refuse("[emulator", format!("[emulator] speaks of `{name}`, which is not a {what}"))
        })
    }
}
