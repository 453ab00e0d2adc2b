//! Frames of the wires: one file a protocol. Pure bytes, no port.
//!
//! | module | purpose |
//! |---|---|
//! | [`modbus_rtu`] | Modbus RTU: requests, answers, both directions |
//! | [`stream`] | sensor streams without a request: sync bytes, length, checksum, resynchronisation |
//! | [`can`] | CAN frames, and the lines of serial CAN adapters |
//! | [`canopen`] | NMT, SDO, heartbeat, emergency, and the states of CiA 402 |
//! | [`eds`] | CANopen objects by an electronic data sheet |
//! | [`encoding`] | texts of other programs, whatever their encoding |
//! | [`dbc`] | signals of CAN messages by a DBC file |
//! | [`pattern`] | lines of text with numbers in them |
//! | [`text`] | answers that are lines of text |
//! | [`checksum`] | the checks that frames end with |

pub mod can;
pub mod canopen;
pub mod checksum;
pub mod dbc;
pub mod eds;
pub mod encoding;
pub mod modbus_rtu;
pub mod pattern;
pub mod stream;
pub mod text;

/// Bytes from hexadecimal digits; spaces are allowed anywhere.
pub fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digits = text.chars().filter(|c| !c.is_whitespace()).map(|c| c.to_digit(16));
    let digits: Vec<u8> = digits.map(|digit| u8::try_from(digit?).ok()).collect::<Option<_>>()?;
    let bytes = digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]);
    digits.len().is_multiple_of(2).then(|| bytes.collect())
}
