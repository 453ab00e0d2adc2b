//! Signals of CAN messages, as a DBC file describes them. The crate can-dbc reads the file; putting
//! bits into frames and taking them out is done here, and cross-checked with the Python package
//! cantools on random frames by the system tests.

use std::collections::HashMap;

/// One signal of a message.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DbcSignal {
    /// Start bit as the file counts it: for Intel order the least significant bit, for Motorola the most.
    pub start: u16,
    /// Bits.
    pub size: u16,
    /// Intel (little endian) order; else Motorola.
    pub little_endian: bool,
    /// Two's complement.
    pub signed: bool,
    /// IEEE 754 of 32 or 64 bits in place of a whole number.
    pub float: bool,
    /// Whether it is there in every message.
    pub multiplex: Multiplex,
    /// Value = raw times this, plus `offset`.
    pub factor: f64,
    /// See `factor`.
    pub offset: f64,
}

/// Whether a signal is there in every message of its identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Multiplex {
    /// It is.
    Always,
    /// It is, and says which others are.
    Selector,
    /// Only where the message's selector has this value.
    Where(u64),
    /// As several selectors say, or one that is itself not always there (`SG_MUL_VAL_`).
    Nested,
}

/// One message.
#[derive(Debug, Clone, PartialEq)]
pub struct DbcMessage {
    /// Identifier.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    /// Bytes.
    pub length: usize,
    /// Signals by name.
    pub signals: HashMap<String, DbcSignal>,
    /// Their units, where the file states them.
    pub units: HashMap<String, String>,
    /// What is wrong with it, with the line: nobody may use it.
    pub fault: Option<DbcError>,
}

/// What is wrong with a DBC file or one of its messages.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum DbcError {
    #[error("no DBC file: line {line} cannot be read from column {column} on: `{shown}`")]
    Syntax { line: usize, column: usize, shown: String },
    #[error("no DBC file: {0}")]
    NoDbc(#[from] can_dbc::DbcError),
    #[error("the message {0} cannot be found again")]
    Lost(String),
    #[error("line {line}: the identifier {raw} of {message} has more than 29 bits")]
    Identifier { line: usize, raw: u64, message: String },
    #[error("line {line}: another message has the identifier of {message}")]
    SameIdentifier { line: usize, message: String },
    #[error("there are two messages {message}, lines {} and {}", .lines.0, .lines.1)]
    TwoMessages { message: String, lines: (usize, usize) },
    #[error("the message {message} has two signals {signal}, lines {} and {}", .lines.0, .lines.1)]
    TwoSignals { message: String, signal: String, lines: (usize, usize) },
    #[error("line {line}: signal {signal} is a float of {bits} bits")]
    Float { line: usize, signal: String, bits: u64 },
    #[error("line {line}: {what}")]
    TooLarge { line: usize, what: &'static str },
    #[error("line {line}: signal {signal} does not lie within message {message}")]
    Outside { line: usize, signal: String, message: String },
}

/// The message in which editors store signals that no message has.
const STORE: &str = "VECTOR__INDEPENDENT_SIG_MSG";

/// A line that begins a message: its number, identifier and name, and the lines and names of its signals.
struct Beginning {
    line: usize,
    raw: u64,
    name: String,
    signals: Vec<(usize, String)>,
}

/// Where the messages of a file begin; lines within texts are none.
fn beginnings(text: &str) -> Vec<Beginning> {
    let (mut all, mut quoted) = (Vec::<Beginning>::new(), false);
    for (number, line) in (1..).zip(text.lines()) {
        let outside = !quoted;
        quoted ^= line.replace("\\\"", "").matches('"').count() % 2 == 1;
        let line = line.trim_start();
        let mut words = line.split(|c: char| c.is_whitespace() || c == ':').filter(|w| !w.is_empty());
        match (words.next().filter(|_| outside), words.next(), words.next()) {
            (Some("BO_"), Some(raw), Some(name)) => {
                if let Ok(raw) = raw.parse() {
                    all.push(Beginning { line: number, raw, name: name.into(), signals: Vec::new() });
                }
            }
            (Some("SG_"), Some(name), _) => {
                if let Some(message) = all.last_mut() {
                    message.signals.push((number, name.into()));
                }
            }
            _ => {}
        }
    }
    all
}

impl Beginning {
    /// The identifier, and whether it has 29 bits.
    fn identifier(&self) -> Result<(u32, bool), DbcError> {
        // Bit 31 marks identifiers of 29 bits. Some files leave it out where 11 bits are not enough.
        let id = self.raw & 0x7FFF_FFFF;
        let id = u32::try_from(id)
            .ok()
            .filter(|id| *id <= super::can::MOST_EXTENDED && self.raw <= u64::from(u32::MAX));
        let (line, raw) = (self.line, self.raw);
        let id = id.ok_or_else(|| DbcError::Identifier { line, raw, message: self.name.clone() })?;
        Ok((id, self.raw >> 31 == 1 || id > 0x7FF))
    }

    /// Two signals of one name.
    fn twice(&self) -> Option<DbcError> {
        self.signals.iter().enumerate().find_map(|(k, (line, name))| {
            let (first, _) = self.signals[..k].iter().find(|(_, n)| n == name)?;
            let (message, signal) = (self.name.clone(), name.clone());
            Some(DbcError::TwoSignals { message, signal, lines: (*first, *line) })
        })
    }
}

/// The refusal of a file that is no DBC file, with the place where reading stopped.
fn no_dbc(text: &str, error: can_dbc::DbcError) -> DbcError {
    let message = error.to_string();
    let place = message.split_once("--> ").and_then(|(_, rest)| {
        let (line, rest) = rest.split_once(':')?;
        let column = rest.split_whitespace().next()?;
        Some((line.trim().parse::<usize>().ok()?, column.parse::<usize>().ok()?))
    });
    match place {
        Some((line, column)) => {
            let shown = text.lines().nth(line.saturating_sub(1)).unwrap_or_default().trim().into();
            DbcError::Syntax { line, column, shown }
        }
        None => error.into(),
    }
}

/// All messages of a file, by name, and by their long name where the file has one. What is wrong with a
/// message is its `fault`: a file serves for its other messages.
///
/// # Errors
/// Where the file is no DBC file.
pub fn parse(text: &str) -> Result<HashMap<String, DbcMessage>, DbcError> {
    let dbc = can_dbc::Dbc::try_from(text).map_err(|error| no_dbc(text, error))?;
    let beginnings = beginnings(text);
    let mut messages = HashMap::<String, DbcMessage>::new();
    for (k, message) in dbc.messages.iter().enumerate().filter(|(_, message)| message.name != STORE) {
        let own = |b: &&Beginning| b.name == message.name;
        let begins = beginnings.get(k).filter(own).or_else(|| beginnings.iter().find(own));
        let begins = begins.ok_or_else(|| DbcError::Lost(message.name.clone()))?;
        let mut read = one(&dbc, message, begins);
        if let Some(first) = beginnings[..k.min(beginnings.len())].iter().find(own) {
            let (message, lines) = (message.name.clone(), (first.line, begins.line));
            read.fault = Some(DbcError::TwoMessages { message, lines });
        }
        let attribute = |name: &str| match dbc.message_attribute(message.id, name) {
            Some(can_dbc::AttributeValue::String(long)) if !long.is_empty() => Some(long.clone()),
            _ => None,
        };
        if let Some(long) = attribute("SystemMessageLongSymbol").filter(|long| !messages.contains_key(long)) {
            messages.insert(long, read.clone());
        }
        messages.insert(message.name.clone(), read);
    }
    Ok(messages)
}

/// One message, with what is wrong with it.
fn one(dbc: &can_dbc::Dbc, message: &can_dbc::Message, begins: &Beginning) -> DbcMessage {
    let (id, length) = (begins.identifier(), usize::try_from(message.size).unwrap_or(usize::MAX));
    let mut fault = id.clone().err().or_else(|| begins.twice());
    let mut signals = HashMap::new();
    let line =
        |name: &str| begins.signals.iter().find(|(_, n)| n == name).map_or(begins.line, |(line, _)| *line);
    // Identifiers that differ only in what the reader cuts off would share what is apart from the messages.
    let alike = dbc.messages.iter().filter(|other| other.id == message.id).count();
    let apart = dbc.extended_multiplex.iter().any(|one| one.message_id == message.id)
        || dbc.signal_extended_value_type_list.iter().any(|one| one.message_id == message.id);
    if alike > 1 && apart {
        let (line, message) = (begins.line, message.name.clone());
        fault = fault.or(Some(DbcError::SameIdentifier { line, message }));
    }
    for signal in &message.signals {
        match place(dbc, message, signal, length, line(&signal.name)) {
            Ok(place) => {
                if let Some(can_dbc::AttributeValue::String(long)) =
                    dbc.signal_attribute(message.id, &signal.name, "SystemSignalLongSymbol")
                {
                    signals.entry(long.clone()).or_insert(place);
                }
                signals.insert(signal.name.clone(), place);
            }
            Err(why) => fault = fault.or(Some(why)),
        }
    }
    let units = message.signals.iter().map(|signal| (signal.name.clone(), signal.unit.clone())).collect();
    let (id, extended) = id.unwrap_or((u32::MAX, true));
    DbcMessage { id, extended, length, signals, units, fault }
}

fn place(
    dbc: &can_dbc::Dbc,
    message: &can_dbc::Message,
    signal: &can_dbc::Signal,
    length: usize,
    line: usize,
) -> Result<DbcSignal, DbcError> {
    let name = || signal.name.clone();
    let ranges =
        dbc.extended_multiplex.iter().any(|o| o.message_id == message.id && o.signal_name == signal.name);
    let float = match dbc.extended_value_type_for_signal(message.id, &signal.name) {
        None | Some(can_dbc::SignalExtendedValueType::SignedOrUnsignedInteger) => None,
        Some(can_dbc::SignalExtendedValueType::IEEEfloat32Bit) => Some(32),
        Some(can_dbc::SignalExtendedValueType::IEEEdouble64bit) => Some(64),
    };
    if float.is_some_and(|bits| bits != signal.size) {
        return Err(DbcError::Float { line, signal: name(), bits: signal.size });
    }
    let small = |n: u64, what| u16::try_from(n).map_err(|_| DbcError::TooLarge { line, what });
    let place = DbcSignal {
        start: small(signal.start_bit, "a start bit is too large")?,
        size: small(signal.size, "a signal is too wide")?,
        little_endian: signal.byte_order == can_dbc::ByteOrder::LittleEndian,
        signed: signal.value_type == can_dbc::ValueType::Signed,
        float: float.is_some(),
        multiplex: match signal.multiplexer_indicator {
            _ if ranges => Multiplex::Nested,
            can_dbc::MultiplexIndicator::Plain => Multiplex::Always,
            can_dbc::MultiplexIndicator::Multiplexor => Multiplex::Selector,
            can_dbc::MultiplexIndicator::MultiplexedSignal(value) => Multiplex::Where(value),
            can_dbc::MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => Multiplex::Nested,
        },
        factor: signal.factor,
        offset: signal.offset,
    };
    let outside = || DbcError::Outside { line, signal: name(), message: message.name.clone() };
    let within = (1..=64).contains(&place.size) && place.bits().all(|bit| bit / 8 < length);
    within.then_some(place).ok_or_else(outside)
}

impl DbcMessage {
    /// The signal that says which others are there.
    pub fn selector(&self) -> Option<DbcSignal> {
        self.signals.values().find(|signal| signal.multiplex == Multiplex::Selector).copied()
    }
}

impl DbcSignal {
    /// Its bits, all set, at the low end.
    pub const fn mask(&self) -> u64 {
        if self.size >= 64 { u64::MAX } else { (1 << self.size) - 1 }
    }

    /// So many of its bits, counted from the least significant one, as a number of their own; `None` where it
    /// has not all of them, or is more than a whole number.
    pub fn part(&self, (first, size): (u32, u32)) -> Option<Self> {
        let (first, size) = (u16::try_from(first).ok()?, u16::try_from(size).ok().filter(|size| *size > 0)?);
        let last = first.checked_add(size - 1).filter(|last| *last < self.size)?;
        let start = self.bits().nth((if self.little_endian { first } else { last }).into())?;
        let whole = !self.float && (self.factor, self.offset) == (1.0, 0.0);
        whole.then_some(Self { start: u16::try_from(start).ok()?, size, signed: false, ..*self })
    }

    /// Places of the bits in the frame, the least significant first: byte times 8 plus bit.
    fn bits(&self) -> impl Iterator<Item = usize> {
        let (start, size) = (usize::from(self.start), usize::from(self.size));
        let little_endian = self.little_endian;
        (0..size).map(move |significance| {
            if little_endian {
                return start + significance;
            }
            // Motorola counts from the most significant bit towards the right: bit 0 of a byte is
            // followed by bit 7 of the next. Counted from the left of the frame that is plain.
            let from_left = (start / 8) * 8 + (7 - start % 8) + (size - 1 - significance);
            (from_left / 8) * 8 + (7 - from_left % 8)
        })
    }

    /// The value; `None` where the frame is too short.
    // a force of more than 53 bits does not exist
    pub fn read(&self, frame: &[u8]) -> Option<f64> {
        let raw = self.raw(frame)?;
        let number = match (self.float, self.size) {
            (true, 32) => f64::from(f32::from_bits(raw as u32)),
            (true, _) => f64::from_bits(raw as u64),
            (false, _) if self.signed => raw as f64,
            (false, _) => raw as u64 as f64,
        };
        Some(number * self.factor + self.offset)
    }

    /// The raw number; `None` where the frame is too short.
    pub fn raw(&self, frame: &[u8]) -> Option<i64> {
        let mut word: u64 = 0;
        for (significance, bit) in self.bits().enumerate() {
            word |= u64::from((frame.get(bit / 8)? >> (bit % 8)) & 1) << significance;
        }
        let unused = 64 - u32::from(self.size);
        Some(if self.signed { ((word << unused) as i64) >> unused } else { word as i64 })
    }

    /// Stores `value`, rounded and limited to what the bits can hold. Other bits stay unchanged. Returns
    /// `false` where the frame is too short.
    pub fn write(&self, frame: &mut [u8], value: f64) -> bool {
        let number = (value - self.offset) / self.factor;
        let raw = number.round();
        let width = i32::from(self.size);
        let (low, high) = if self.signed {
            (-(2_f64.powi(width - 1)), 2_f64.powi(width - 1) - 1.0)
        } else {
            (0.0, 2_f64.powi(width) - 1.0)
        };
        let word = match (self.float, self.size) {
            (true, 32) => u64::from((number as f32).to_bits()),
            (true, _) => number.to_bits(),
            (false, _) => raw.clamp(low, high) as i128 as u64,
        };
        for (significance, bit) in self.bits().enumerate() {
            let Some(byte) = frame.get_mut(bit / 8) else { return false };
            let bit = bit % 8;
            *byte = (*byte & !(1 << bit)) | ((((word >> significance) & 1) as u8) << bit);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "VERSION \"\"\nNS_ :\nBS_:\nBU_: RIG\n\nBO_ 1552 Meas: 8 RIG\n SG_ Ch1 : 7|16@0+ (1,-32768) [0|0] \"\" RIG\n SG_ Ch4 : 55|16@0+ (1,-32768) [0|0] \"\" RIG\n\nBO_ 437 Short: 8 RIG\n SG_ Fx : 0|16@1- (1,0) [0|0] \"\" RIG\n SG_ Odd : 19|13@1- (0.5,1) [0|0] \"\" RIG\n";

    #[test]
    // whole numbers and halves
    fn both_orders() {
        let messages = parse(TEXT).unwrap();
        let frame = [0x80, 0x00, 0x81, 0x00, 0x7E, 0x00, 0xFF, 0xFF];
        let measured = &messages["Meas"];
        assert_eq!(measured.id, 0x610);
        assert_eq!(measured.signals["Ch1"].read(&frame), Some(0.0));
        assert_eq!(measured.signals["Ch4"].read(&frame), Some(32767.0));
        let short = &messages["Short"];
        assert_eq!(short.signals["Fx"].read(&[0x56, 0x02, 0, 0, 0, 0, 0, 0]), Some(598.0));
        assert_eq!(short.signals["Fx"].read(&[0xFE, 0xFF, 0, 0, 0, 0, 0, 0]), Some(-2.0));
        assert_eq!(short.signals["Fx"].read(&[0xFE]), None);
    }

    #[test]
    fn what_is_written_is_read_and_neighbours_stay() {
        let messages = parse(TEXT).unwrap();
        for (message, name) in [("Meas", "Ch1"), ("Meas", "Ch4"), ("Short", "Fx"), ("Short", "Odd")] {
            let signal = messages[message].signals[name];
            for raw in [-4096.0, -1.0, 0.0, 1.0, 4095.0] {
                let value = raw * signal.factor + signal.offset;
                for background in [0x00_u8, 0xFF] {
                    let mut frame = [background; 8];
                    assert!(signal.write(&mut frame, value));
                    let held = signal.read(&frame).unwrap();
                    let clear = if signal.signed { raw } else { raw.max(0.0) };
                    assert_eq!(held, clear * signal.factor + signal.offset, "{name} {raw}");
                    let zero = |frame: [u8; 8]| {
                        let mut frame = frame;
                        signal.write(&mut frame, signal.offset);
                        frame
                    };
                    assert_eq!(zero(frame), zero([background; 8]), "{name}: neighbours changed");
                }
            }
        }
    }

    #[test]
    fn floats_are_read_as_such_and_the_two_kinds_of_identifier_are_kept_apart() {
        let text = format!(
            "{TEXT}\nBO_ 2147483650 Far: 8 RIG\n SG_ F : 0|32@1- (2,1) [0|0] \"\" RIG\n SG_ U : 32|32@1+ (1,0) [0|0] \"\" RIG\n\nBO_ 5 Mux: 8 RIG\n SG_ M M : 0|8@1+ (1,0) [0|0] \"\" RIG\n SG_ P m1 : 8|8@1+ (1,0) [0|0] \"\" RIG\n\nSIG_VALTYPE_ 2147483650 F : 1;\n"
        );
        let messages = parse(&text).unwrap();
        let far = &messages["Far"];
        assert_eq!((far.id, far.extended, messages["Meas"].extended), (2, true, false));
        let mut frame = [0xFF; 8];
        assert!(far.signals["F"].write(&mut frame, 1.5));
        assert_eq!(frame[..4], 0.25_f32.to_le_bytes());
        assert_eq!(far.signals["F"].read(&frame), Some(1.5));
        assert_eq!(far.signals["U"].read(&frame), Some(f64::from(u32::MAX)));
        let mux = &messages["Mux"].signals;
        assert_eq!((mux["P"].multiplex, mux["M"].multiplex), (Multiplex::Where(1), Multiplex::Selector));
    }

    #[test]
    fn a_signal_outside_its_message_is_refused() {
        let text = TEXT.replace("Fx : 0|16", "Fx : 60|16");
        let messages = parse(&text).unwrap();
        assert!(
            messages["Short"].fault.as_ref().unwrap().to_string().contains("line 11: signal Fx"),
            "{:?}",
            messages["Short"].fault
        );
        assert_eq!(messages["Meas"].fault, None, "the other one serves");
        assert!(parse("hello").unwrap_err().to_string().contains("line 1"));
    }

    #[test]
    fn identifiers_that_do_not_fit_and_names_that_stand_twice_are_told_with_their_lines() {
        let fault = |text: &str, name: &str| parse(text).unwrap()[name].fault.clone().unwrap().to_string();
        for (raw, id) in [("5000", 5000), ("2147483736", 0x58), ("2047", 0x7FF), ("536870911", 0x1FFF_FFFF)] {
            let messages = parse(&TEXT.replace("437", raw)).unwrap();
            assert_eq!((messages["Short"].id, messages["Short"].fault.clone()), (id, None), "{raw}");
            assert_eq!(messages["Short"].extended, raw != "2047", "{raw}");
        }
        for raw in ["536871000", "3221225472", "4294967295"] {
            let why = fault(&TEXT.replace("437", raw), "Short");
            assert!(why.contains("line 10") && why.contains(raw) && why.contains("29 bits"), "{why}");
        }
        let twice = TEXT.replace(" SG_ Odd", " SG_ Fx : 32|16@1- (1,0) [0|0] \"\" RIG\n SG_ Odd");
        assert!(
            fault(&twice, "Short").contains("two signals Fx, lines 11 and 12"),
            "{}",
            fault(&twice, "Short")
        );
        assert!(fault(&TEXT.replace("Short", "Meas"), "Meas").contains("lines 6 and 10"));
        let store =
            format!("{TEXT}\nBO_ 3221225472 {STORE}: 0 RIG\n SG_ Spare : 0|8@1+ (1,0) [0|0] \"\" RIG\n");
        let messages = parse(&store).unwrap();
        assert!(messages.len() == 2 && messages.values().all(|m| m.fault.is_none()), "{messages:?}");
    }

    #[test]
    fn long_names_serve_too() {
        let text = format!(
            "{TEXT}\nBA_DEF_ BO_ \"SystemMessageLongSymbol\" STRING ;\nBA_DEF_ SG_ \"SystemSignalLongSymbol\" STRING ;\nBA_ \"SystemMessageLongSymbol\" BO_ 437 \"AVeryLongNameOfAMessage\";\nBA_ \"SystemSignalLongSymbol\" SG_ 437 Fx \"AVeryLongNameOfASignal\";\n"
        );
        let messages = parse(&text).unwrap();
        assert_eq!(
            messages["AVeryLongNameOfAMessage"].signals["AVeryLongNameOfASignal"],
            messages["Short"].signals["Fx"]
        );
    }
}
