//! Modbus RTU, both directions.
//!
//! An own codec, since sensors on RTU do what the usual ones cannot: they use function codes of
//! their own, leave the protocol for a stream, and need a client that throws late answers away. An
//! answer has no transaction number: all that ties it to its request is unit, function and length,
//! so every one of them is checked, and the length is known before the first byte arrives.

use super::checksum::Check;

/// What may come back to a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what its fields are")]
pub enum RtuError {
    #[error("the instrument refused the request (exception {0})")]
    Exception(u8),
    #[error("the check bytes do not fit the frame")]
    Crc,
    #[error("unit {found} answered instead of unit {expected}")]
    Unit { expected: u8, found: u8 },
    #[error("the answer is to function {found}, not {expected}")]
    Function { expected: u8, found: u8 },
    /// The answer speaks of another length or another register.
    #[error("the answer does not fit the request")]
    Mismatch,
}

/// A request, with what its answer must look like.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Request {
    /// The whole frame.
    pub bytes: Vec<u8>,
    /// Bytes of a whole answer that is not an exception.
    pub answer_length: usize,
}

/// What answers a function of the maker's own that was carried out (ATI Digital F/T).
pub const DONE: u8 = 1;

/// Bytes of an exception.
pub const EXCEPTION_LENGTH: usize = 5;

fn closed(mut body: Vec<u8>) -> Vec<u8> {
    body.extend(Check::CRC_16_MODBUS.of(&body, None));
    body
}

/// The beginning of a frame that speaks of `second`, mostly a count, at an address.
fn addressed(unit: u8, function: u8, address: u16, second: u16) -> Vec<u8> {
    let ([a, b], [c, d]) = (address.to_be_bytes(), second.to_be_bytes());
    vec![unit, function, a, b, c, d]
}

/// Writes what `data` holds of so many neighbouring registers or coils.
fn writing(unit: u8, function: u8, address: u16, registers: usize, data: &[u8]) -> Request {
    let mut body = addressed(unit, function, address, u16::try_from(registers).unwrap_or(u16::MAX));
    body.push(u8::try_from(data.len()).unwrap_or(u8::MAX));
    body.extend(data);
    Request { bytes: closed(body), answer_length: 8 }
}

fn bytes_of(registers: &[u16]) -> Vec<u8> {
    registers.iter().flat_map(|register| register.to_be_bytes()).collect()
}

/// Asks for registers by function 3 or 4, or for bits by function 1 or 2.
pub fn read(unit: u8, function: u8, address: u16, count: u16) -> Request {
    let body = addressed(unit, function, address, count);
    let count = usize::from(count);
    let data = if function <= 2 { count.div_ceil(8) } else { 2 * count };
    Request { bytes: closed(body), answer_length: 5 + data }
}

/// Writes neighbouring coils by function 15: those whose register is not zero are closed.
pub fn write_coils(unit: u8, address: u16, registers: &[u16]) -> Request {
    writing(unit, 15, address, registers.len(), &to_bits(registers))
}

/// Registers of 0 and not 0 as bits, the first in the lowest bit of the first byte.
pub fn to_bits(registers: &[u16]) -> Vec<u8> {
    let byte =
        |eight: &[u16]| eight.iter().rev().fold(0, |byte, register| byte << 1 | u8::from(*register != 0));
    registers.chunks(8).map(byte).collect()
}

/// Bits as registers of 0 and 1; as many as `count` of them.
pub fn from_bits(bits: &[u8], count: usize) -> Vec<u16> {
    let each = bits.iter().flat_map(|byte| (0..8).map(move |bit| u16::from(byte >> bit & 1)));
    each.take(count).collect()
}

/// Writes neighbouring registers by function 16.
pub fn write(unit: u8, address: u16, registers: &[u16]) -> Request {
    writing(unit, 16, address, registers.len(), &bytes_of(registers))
}

/// A request by a function of the maker's own: `data` follows the function code.
pub fn custom(unit: u8, function: u8, data: &[u8], answer_length: usize) -> Request {
    Request { bytes: closed([&[unit, function], data].concat()), answer_length }
}

/// How many bytes the answer that begins with `start` has; `None` until two bytes are there.
pub fn answer_length(request: &Request, start: &[u8]) -> Option<usize> {
    let function = *start.get(1)?;
    Some(if function == request.bytes[1] | 0x80 { EXCEPTION_LENGTH } else { request.answer_length })
}

/// Judges a whole answer; returns what stands between the function code and the check bytes.
///
/// # Errors
/// Whatever does not fit the request.
pub fn payload<'a>(request: &Request, answer: &'a [u8]) -> Result<&'a [u8], RtuError> {
    if answer.len() < EXCEPTION_LENGTH {
        return Err(RtuError::Mismatch);
    }
    let (body, crc) = answer.split_at(answer.len() - 2);
    if !Check::CRC_16_MODBUS.holds(body, crc, None) {
        return Err(RtuError::Crc);
    }
    let (unit, function) = (request.bytes[0], request.bytes[1]);
    if body[0] != unit {
        return Err(RtuError::Unit { expected: unit, found: body[0] });
    }
    if body[1] == function | 0x80 {
        return Err(RtuError::Exception(body[2]));
    }
    if body[1] != function {
        return Err(RtuError::Function { expected: function, found: body[1] });
    }
    if answer.len() != request.answer_length { Err(RtuError::Mismatch) } else { Ok(&body[2..]) }
}

/// The registers of an answer to [`read()`], judged as by [`payload`], as bytes; bits come as registers of 0
/// and 1.
pub fn registers(request: &Request, answer: &[u8]) -> Result<Vec<u8>, RtuError> {
    let payload = payload(request, answer)?;
    if usize::from(payload[0]) != payload.len() - 1 {
        return Err(RtuError::Mismatch);
    }
    if request.bytes[1] <= 2 {
        let count = u16::from_be_bytes([request.bytes[4], request.bytes[5]]);
        return Ok(bytes_of(&from_bits(&payload[1..], usize::from(count))));
    }
    Ok(payload[1..].to_vec())
}

/// Judges an answer to [`write()`] as [`payload`] does; it repeats the address and the count.
pub fn written(request: &Request, answer: &[u8]) -> Result<(), RtuError> {
    if payload(request, answer)? == &request.bytes[2..6] { Ok(()) } else { Err(RtuError::Mismatch) }
}

/// A request, as the instrument's side sees it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Operation {
    /// Function 3 or 4.
    Read {
        /// The function.
        function: u8,
        /// First register.
        address: u16,
        /// How many.
        count: u16,
    },
    /// Function 6 or 16.
    Write {
        /// The function.
        function: u8,
        /// First register.
        address: u16,
        /// The values.
        registers: Vec<u16>,
    },
    /// A one-byte request by a function of the maker's own.
    Custom {
        /// The function.
        function: u8,
        /// Its byte.
        data: u8,
    },
}

/// What the bytes that came so far are.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Parsed {
    /// The start of something.
    Incomplete,
    /// No request begins here: drop a byte and look again.
    Noise,
    /// A request for `unit`, and how many bytes it took.
    Request(u8, Operation, usize),
}

/// Looks for a request at the start of `bytes`; `own` are the functions of the maker's own, whose
/// requests have one byte of data.
pub fn hear(bytes: &[u8], own: &[u8]) -> Parsed {
    let Some(&function) = bytes.get(1) else { return Parsed::Incomplete };
    let length = match function {
        1..=4 | 6 => 8,
        15 | 16 => match bytes.get(6) {
            None => return Parsed::Incomplete,
            Some(&count) => 9 + usize::from(count),
        },
        _ if own.contains(&function) => 5,
        _ => return Parsed::Noise,
    };
    let Some(frame) = bytes.get(..length) else { return Parsed::Incomplete };
    let (body, crc) = frame.split_at(length - 2);
    if !Check::CRC_16_MODBUS.holds(body, crc, None) {
        return Parsed::Noise;
    }
    let word = |at: usize| u16::from_be_bytes([body[at], body[at + 1]]);
    let operation = match function {
        1..=4 => Operation::Read { function, address: word(2), count: word(4) },
        6 => Operation::Write { function, address: word(2), registers: vec![word(4)] },
        15 | 16 => {
            let (data, count) = (&body[7..], usize::from(word(4)));
            let registers = match function {
                15 if data.len() == count.div_ceil(8) => from_bits(data, count),
                16 if data.len() == 2 * count => (0..count).map(|i| word(7 + 2 * i)).collect(),
                _ => return Parsed::Noise,
            };
            Operation::Write { function, address: word(2), registers }
        }
        _ => Operation::Custom { function, data: body[2] },
    };
    Parsed::Request(body[0], operation, length)
}

/// The answer that gives registers, as bits where the function is one of bits.
pub fn give(unit: u8, function: u8, registers: &[u16]) -> Vec<u8> {
    let data = if function <= 2 { to_bits(registers) } else { bytes_of(registers) };
    let head = [unit, function, u8::try_from(data.len()).unwrap_or(u8::MAX)];
    closed([&head, data.as_slice()].concat())
}

/// The answer that confirms a write: the first four bytes after the function of the request.
pub fn confirm(unit: u8, function: u8, address: u16, second: u16) -> Vec<u8> {
    closed(addressed(unit, function, address, second))
}

/// The answer to a function of the maker's own.
pub fn acknowledge(unit: u8, function: u8, data: u8) -> Vec<u8> {
    closed(vec![unit, function, data])
}

/// The answer that refuses.
pub fn refuse(unit: u8, function: u8, exception: u8) -> Vec<u8> {
    closed(vec![unit, function | 0x80, exception])
}

/// The silence that parts two frames: 3.5 characters of 11 bits, and 1.75 ms above 19200 baud, in s
/// (Modbus over serial line, 2.5.1.1).
pub fn silence_s(baud: u32) -> f64 {
    if baud > 19_200 { 1.75e-3 } else { 3.5 * 11.0 / f64::from(baud.max(1)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of the Modbus application protocol 1.1b3, 6.1 and 6.11: coils 20-38 read, coils 20-29 written.
    #[test]
    fn coils_as_the_standard_packs_them() {
        let read = read(1, 1, 19, 19);
        assert_eq!(&read.bytes[..6], &[1, 1, 0, 19, 0, 19]);
        let answer = closed(vec![1, 1, 3, 0xCD, 0x6B, 0x05]);
        let bytes = registers(&read, &answer).unwrap();
        let bits: Vec<u8> = bytes.chunks(2).map(|pair| pair[1]).collect();
        assert_eq!(bits, [1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1]);
        let coils = from_bits(&[0xCD, 0x01], 10);
        let write = write_coils(1, 19, &coils);
        assert_eq!(&write.bytes[..9], &[1, 15, 0, 19, 0, 10, 2, 0xCD, 0x01]);
        let heard = hear(&write.bytes, &[]);
        let operation = Operation::Write { function: 15, address: 19, registers: coils.clone() };
        assert_eq!(heard, Parsed::Request(1, operation, write.bytes.len()));
        assert!(written(&write, &confirm(1, 15, 19, 10)).is_ok());
        assert_eq!(give(1, 1, &coils)[2..5], [2, 0xCD, 0x01]);
    }

    /// ATI's manual prints this request for its diagnostics registers.
    #[test]
    fn a_published_request() {
        assert_eq!(read(10, 4, 0x27, 6).bytes, [0x0A, 0x04, 0x00, 0x27, 0x00, 0x06, 0xC1, 0x78]);
        assert_eq!(custom(10, 0x46, &[0x55], 5).bytes, [0x0A, 0x46, 0x55, 0xA3, 0x9D]);
    }

    #[test]
    fn both_sides_agree() {
        let request = read(9, 3, 180, 2);
        let heard = Parsed::Request(9, Operation::Read { function: 3, address: 180, count: 2 }, 8);
        assert_eq!(hear(&request.bytes, &[]), heard);
        assert_eq!(registers(&request, &give(9, 3, &[1, 0xFFFE])).unwrap(), [0, 1, 0xFF, 0xFE]);
        let request = write(9, 410, &[0x0200, 7]);
        let operation = Operation::Write { function: 16, address: 410, registers: vec![0x0200, 7] };
        assert_eq!(hear(&request.bytes, &[]), Parsed::Request(9, operation, 13));
        assert_eq!(written(&request, &confirm(9, 16, 410, 2)), Ok(()));
        assert_eq!(written(&request, &confirm(9, 16, 411, 2)), Err(RtuError::Mismatch));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let request = read(9, 3, 180, 2);
        let good = give(9, 3, &[1, 2]);
        for bit in 0..good.len() * 8 {
            let mut wrong = good.clone();
            wrong[bit / 8] ^= 1 << (bit % 8);
            assert!(registers(&request, &wrong).is_err(), "bit {bit}");
        }
        assert_eq!(registers(&request, &give(8, 3, &[1, 2])), Err(RtuError::Unit { expected: 9, found: 8 }));
        assert_eq!(
            registers(&request, &give(9, 4, &[1, 2])),
            Err(RtuError::Function { expected: 3, found: 4 })
        );
        assert_eq!(registers(&request, &give(9, 3, &[1])), Err(RtuError::Mismatch));
        assert_eq!(registers(&request, &give(9, 3, &[1, 2, 3])), Err(RtuError::Mismatch));
        assert_eq!(registers(&request, &refuse(9, 3, 2)), Err(RtuError::Exception(2)));
        assert_eq!(registers(&request, &[]), Err(RtuError::Mismatch));
    }

    #[test]
    fn every_cut_of_a_request_is_incomplete() {
        for request in [read(9, 3, 0, 6), write(9, 0, &[1, 2, 3]), custom(9, 0x46, &[0x55], 5)] {
            for cut in 0..request.bytes.len() {
                assert_eq!(hear(&request.bytes[..cut], &[0x46]), Parsed::Incomplete, "{cut}");
            }
        }
    }
}
