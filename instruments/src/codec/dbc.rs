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
}

/// All messages of a file, by name.
///
/// # Errors
/// Where the file is no DBC file, or a signal does not lie within its message.
pub fn parse(text: &str) -> Result<HashMap<String, DbcMessage>, String> {
    let dbc = can_dbc::Dbc::try_from(text).map_err(|error| format!("no DBC file: {error:?}"))?;
    let mut messages = HashMap::new();
    for message in &dbc.messages {
        let length = usize::try_from(message.size).map_err(|_| "a message is too long".to_string())?;
        let mut signals = HashMap::new();
        let ranges = |name: &str| {
            dbc.extended_multiplex.iter().any(|one| one.message_id == message.id && one.signal_name == name)
        };
        for signal in &message.signals {
            let float = match dbc.extended_value_type_for_signal(message.id, &signal.name) {
                None | Some(can_dbc::SignalExtendedValueType::SignedOrUnsignedInteger) => None,
                Some(can_dbc::SignalExtendedValueType::IEEEfloat32Bit) => Some(32),
                Some(can_dbc::SignalExtendedValueType::IEEEdouble64bit) => Some(64),
            };
            if float.is_some_and(|bits| bits != signal.size) {
                return Err(format!("signal {} is a float of {} bits", signal.name, signal.size));
            }
            let place = DbcSignal {
                start: u16::try_from(signal.start_bit).map_err(|_| "a start bit is too large")?,
                size: u16::try_from(signal.size).map_err(|_| "a signal is too wide")?,
                little_endian: signal.byte_order == can_dbc::ByteOrder::LittleEndian,
                signed: signal.value_type == can_dbc::ValueType::Signed,
                float: float.is_some(),
                multiplex: match signal.multiplexer_indicator {
                    _ if ranges(&signal.name) => Multiplex::Nested,
                    can_dbc::MultiplexIndicator::Plain => Multiplex::Always,
                    can_dbc::MultiplexIndicator::Multiplexor => Multiplex::Selector,
                    can_dbc::MultiplexIndicator::MultiplexedSignal(value) => Multiplex::Where(value),
                    can_dbc::MultiplexIndicator::MultiplexorAndMultiplexedSignal(_) => Multiplex::Nested,
                },
                factor: signal.factor,
                offset: signal.offset,
            };
            if !place.fits(length) {
                return Err(format!("signal {} does not lie within message {}", signal.name, message.name));
            }
            signals.insert(signal.name.clone(), place);
        }
        let (id, extended) = match message.id {
            can_dbc::MessageId::Standard(id) => (u32::from(id), false),
            can_dbc::MessageId::Extended(id) => (id, true),
        };
        messages.insert(message.name.clone(), DbcMessage { id, extended, length, signals });
    }
    Ok(messages)
}

impl DbcMessage {
    /// The signal that says which others are there.
    #[must_use]
    pub fn selector(&self) -> Option<DbcSignal> {
        self.signals.values().find(|signal| signal.multiplex == Multiplex::Selector).copied()
    }
}

impl DbcSignal {
    /// Its bits, all set, at the low end.
    #[must_use]
    pub const fn mask(&self) -> u64 {
        if self.size >= 64 { u64::MAX } else { (1 << self.size) - 1 }
    }

    fn fits(&self, length: usize) -> bool {
        (1..=64).contains(&self.size) && self.bits().all(|bit| bit.is_some_and(|bit| bit / 8 < length))
    }

    /// Places of the bits in the frame, the least significant first: byte times 8 plus bit.
    fn bits(&self) -> impl Iterator<Item = Option<usize>> {
        let (start, size, little_endian) =
            (usize::from(self.start), usize::from(self.size), self.little_endian);
        (0..size).map(move |significance| {
            if little_endian {
                return Some(start + significance);
            }
            // Motorola counts from the most significant bit towards the right: bit 0 of a byte is
            // followed by bit 7 of the next. Counted from the left of the frame that is plain.
            let from_left = (start / 8) * 8 + (7 - start % 8) + (size - 1 - significance);
            Some((from_left / 8) * 8 + (7 - from_left % 8))
        })
    }

    /// The value; `None` where the frame is too short.
    #[must_use]
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
    #[must_use]
    pub fn raw(&self, frame: &[u8]) -> Option<i64> {
        let mut word: u64 = 0;
        for (significance, bit) in self.bits().enumerate() {
            let bit = bit?;
            word |= u64::from((frame.get(bit / 8)? >> (bit % 8)) & 1) << significance;
        }
        let unused = 64 - u32::from(self.size);
        Some(if self.signed { ((word << unused) as i64) >> unused } else { word as i64 })
    }

    /// Stores `value`, rounded and held to what the bits can say. Other bits are kept.
    /// Returns `false` where the frame is too short.
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
            let Some(byte) = bit.and_then(|bit| frame.get_mut(bit / 8)) else { return false };
            let bit = bit.unwrap_or(0) % 8;
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
        assert!(parse(&text).unwrap_err().contains("Fx"));
        assert!(parse("hello").is_err());
    }
}
