//! One number in a frame: its type, its byte order, and the bits of it that count.
//!
//! Byte order belongs to each field, never to a device: one maker uses three of them, and one
//! instrument is big endian in its registers and little endian in its stream.

use schemars::JsonSchema;
use serde::Deserialize;

/// How a number is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum NumberType {
    /// Unsigned, 8 bits.
    U8,
    /// Two's complement, 8 bits.
    I8,
    /// Unsigned, 16 bits.
    U16,
    /// Two's complement, 16 bits.
    I16,
    /// Unsigned, 32 bits.
    U32,
    /// Two's complement, 32 bits.
    I32,
    /// IEEE 754 single.
    F32,
    /// IEEE 754 double; numbers in text are stored so.
    F64,
}

impl NumberType {
    /// Length in bytes.
    pub const fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Smallest and largest value that the type can hold.
    pub fn limits(self) -> (f64, f64) {
        match self {
            Self::U8 => (0.0, f64::from(u8::MAX)),
            Self::I8 => (f64::from(i8::MIN), f64::from(i8::MAX)),
            Self::U16 => (0.0, f64::from(u16::MAX)),
            Self::I16 => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Self::U32 => (0.0, f64::from(u32::MAX)),
            Self::I32 => (f64::from(i32::MIN), f64::from(i32::MAX)),
            Self::F32 => (f64::from(f32::MIN), f64::from(f32::MAX)),
            Self::F64 => (f64::MIN, f64::MAX),
        }
    }
}

/// The order of the bytes, `A` being the most significant of four.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, JsonSchema)]
pub enum ByteOrder {
    /// Big endian; in registers: high word first.
    #[default]
    #[serde(rename = "ABCD", alias = "be")]
    Abcd,
    /// Low word first, each word big endian.
    #[serde(rename = "CDAB")]
    Cdab,
    /// High word first, each word little endian.
    #[serde(rename = "BADC")]
    Badc,
    /// Little endian throughout.
    #[serde(rename = "DCBA", alias = "le")]
    Dcba,
}

/// Where a number stands in a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// First byte.
    pub at: usize,
    /// Type.
    pub number: NumberType,
    /// Byte order.
    pub order: ByteOrder,
    /// First bit (from the least significant) and how many; `None` for all.
    pub bits: Option<(u32, u32)>,
}

impl Field {
    /// The byte after the last.
    pub const fn end(&self) -> usize {
        self.at + self.number.bytes()
    }

    /// The number; `None` where the frame is too short for it.
    // The casts between equal widths are the two's complement they look like; the others only drop zeros.
    pub fn read(&self, frame: &[u8]) -> Option<f64> {
        let word = self.word(frame)?;
        if let Some((first, width)) = self.bits {
            return Some(f64::from((word >> first) as u32 & mask(width)));
        }
        Some(match self.number {
            NumberType::U8 | NumberType::U16 | NumberType::U32 => f64::from(word as u32),
            NumberType::I8 => f64::from(word as u8 as i8),
            NumberType::I16 => f64::from(word as u16 as i16),
            NumberType::I32 => f64::from(word as u32 as i32),
            NumberType::F32 => f64::from(f32::from_bits(word as u32)),
            NumberType::F64 => f64::from_bits(word),
        })
    }

    /// Stores `value`, rounded to the nearest and limited to the type's range, as an instrument's converter
    /// does. Other bits of the same word stay unchanged. A value that is not a number is stored as one only
    /// in floating point; integers take zero. Returns `false` where the frame is too short.
    pub fn write(&self, frame: &mut [u8], value: f64) -> bool {
        let Some(old) = self.word(frame) else { return false };
        let word = if let Some((first, width)) = self.bits {
            let value = value.round().clamp(0.0, f64::from(mask(width))) as u64;
            (old & !(u64::from(mask(width)) << first)) | (value << first)
        } else {
            match self.number {
                NumberType::F32 => u64::from((value as f32).to_bits()),
                NumberType::F64 => value.to_bits(),
                _ => {
                    let (low, high) = self.number.limits();
                    value.round().clamp(low, high) as i64 as u64
                }
            }
        };
        let bytes = word.to_le_bytes();
        for (place, significance) in self.positions() {
            frame[place] = bytes[significance];
        }
        true
    }

    fn word(&self, frame: &[u8]) -> Option<u64> {
        if frame.len() < self.end() {
            return None;
        }
        let mut word = 0;
        for (place, significance) in self.positions() {
            word |= u64::from(frame[place]) << (8 * significance);
        }
        Some(word)
    }

    /// Each byte's place in the frame and its significance (0: least).
    fn positions(&self) -> impl Iterator<Item = (usize, usize)> {
        let (at, length, order) = (self.at, self.number.bytes(), self.order);
        (0..length).map(move |i| {
            let (word, byte, words) = (i / 2, i % 2, length / 2);
            let significance = match order {
                _ if length == 1 => 0,
                ByteOrder::Abcd => length - 1 - i,
                ByteOrder::Dcba => i,
                // Low word first, each word big endian: within 16 bits plain big endian.
                ByteOrder::Cdab => 2 * word + 1 - byte,
                // High word first, each word little endian: within 16 bits plain little endian.
                ByteOrder::Badc => 2 * (words - 1 - word) + byte,
            };
            (at + i, significance)
        })
    }
}

const fn mask(width: u32) -> u32 {
    if width >= 32 { u32::MAX } else { (1 << width) - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field(number: NumberType, order: ByteOrder) -> Field {
        Field { at: 0, number, order, bits: None }
    }

    #[test]
    fn four_byte_orders_of_one_number() {
        // 0x0A0B0C0D as each order's letters say.
        for (order, bytes) in [
            (ByteOrder::Abcd, [0x0A, 0x0B, 0x0C, 0x0D]),
            (ByteOrder::Cdab, [0x0C, 0x0D, 0x0A, 0x0B]),
            (ByteOrder::Badc, [0x0B, 0x0A, 0x0D, 0x0C]),
            (ByteOrder::Dcba, [0x0D, 0x0C, 0x0B, 0x0A]),
        ] {
            let field = field(NumberType::U32, order);
            assert_eq!(field.read(&bytes), Some(f64::from(0x0A0B_0C0D_u32)), "{order:?}");
            let mut written = [0; 4];
            assert!(field.write(&mut written, f64::from(0x0A0B_0C0D_u32)));
            assert_eq!(written, bytes, "{order:?}");
        }
    }

    #[test]
    fn sixteen_bits() {
        assert_eq!(field(NumberType::I16, ByteOrder::Abcd).read(&[0xFF, 0xFE]), Some(-2.0));
        assert_eq!(field(NumberType::I16, ByteOrder::Cdab).read(&[0xFF, 0xFE]), Some(-2.0));
        assert_eq!(field(NumberType::I16, ByteOrder::Dcba).read(&[0xFE, 0xFF]), Some(-2.0));
        assert_eq!(field(NumberType::I16, ByteOrder::Badc).read(&[0xFE, 0xFF]), Some(-2.0));
    }

    #[test]
    fn a_value_beyond_the_type_is_held_at_its_limit() {
        let mut frame = [0; 2];
        field(NumberType::I16, ByteOrder::Abcd).write(&mut frame, 1e9);
        assert_eq!(frame, [0x7F, 0xFF]);
        field(NumberType::I16, ByteOrder::Abcd).write(&mut frame, -1e9);
        assert_eq!(frame, [0x80, 0x00]);
    }

    #[test]
    fn bits_leave_their_neighbours_alone() {
        let mut frame = [0xFF, 0xFF];
        let field = Field { at: 0, number: NumberType::U16, order: ByteOrder::Abcd, bits: Some((4, 3)) };
        field.write(&mut frame, 2.0);
        assert_eq!(frame, [0xFF, 0xAF]);
        assert_eq!(field.read(&frame), Some(2.0));
    }

    #[test]
    fn a_short_frame_is_no_number() {
        let field = field(NumberType::F32, ByteOrder::Abcd);
        assert_eq!(field.read(&[0; 3]), None);
        assert!(!field.write(&mut [0; 3], 1.0));
    }
}
