//! The checks that frames end with.

use schemars::JsonSchema;
use serde::Deserialize;

const CRC16_MODBUS: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS);
const CRC16_X25: crc::Crc<u16> = crc::Crc::<u16>::new(&crc::CRC_16_IBM_SDLC);

/// Kinds of check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Check {
    /// CRC-16/MODBUS, low byte first.
    Crc16Modbus,
    /// CRC-16/X-25, low byte first.
    Crc16X25,
    /// One byte: bit 7 says that the instrument has an error, bits 0 to 6 are the sum of all bytes before it.
    Sum7WithErrorBit,
}

impl Check {
    /// Bytes that the check takes.
    #[must_use]
    pub const fn length(self) -> usize {
        match self {
            Self::Crc16Modbus | Self::Crc16X25 => 2,
            Self::Sum7WithErrorBit => 1,
        }
    }

    /// The check of `body`, as it stands in the frame.
    #[must_use]
    pub fn of(self, body: &[u8]) -> Vec<u8> {
        match self {
            Self::Crc16Modbus => crc16_modbus(body).to_le_bytes().to_vec(),
            Self::Crc16X25 => CRC16_X25.checksum(body).to_le_bytes().to_vec(),
            Self::Sum7WithErrorBit => vec![sum7(body)],
        }
    }

    /// Whether `check` fits `body`.
    #[must_use]
    pub fn holds(self, body: &[u8], check: &[u8]) -> bool {
        match self {
            Self::Sum7WithErrorBit => check.len() == 1 && check[0] & 0x7F == sum7(body),
            _ => check == self.of(body),
        }
    }
}

/// CRC-16/MODBUS.
#[must_use]
pub fn crc16_modbus(bytes: &[u8]) -> u16 {
    CRC16_MODBUS.checksum(bytes)
}

fn sum7(body: &[u8]) -> u8 {
    body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte)) & 0x7F
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The catalogue's check values of '123456789', and ATI's published stream start frame.
    #[test]
    fn published_values() {
        assert_eq!(Check::Crc16X25.of(b"123456789"), 0x906E_u16.to_le_bytes());
        assert_eq!(Check::Crc16Modbus.of(b"123456789"), 0x4B37_u16.to_le_bytes());
        assert_eq!(Check::Crc16Modbus.of(&[0x0A, 0x46, 0x55]), [0xA3, 0x9D]);
    }

    #[test]
    fn the_error_bit_is_no_part_of_the_sum() {
        assert!(Check::Sum7WithErrorBit.holds(&[1, 2, 3], &[0x06]));
        assert!(Check::Sum7WithErrorBit.holds(&[1, 2, 3], &[0x86]));
        assert!(!Check::Sum7WithErrorBit.holds(&[1, 2, 3], &[0x07]));
    }
}
