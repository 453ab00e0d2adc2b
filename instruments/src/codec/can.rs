//! CAN frames, and the line protocol of serial CAN adapters (slcan, after Lawicel). Signals in a frame,
//! multiplexed ones too: `dbc`; their keys `schema/frames`, their check `profile/compile`.

/// A data frame of classic CAN.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    /// Identifier: 11 bits, or 29 where `extended`.
    pub id: u32,
    /// Whether the identifier has 29 bits.
    pub extended: bool,
    data: [u8; 8],
    length: u8,
}

/// Largest identifier of 29 bits.
pub const MOST_EXTENDED: u32 = 0x1FFF_FFFF;

impl CanFrame {
    /// A frame with a standard identifier; `None` where the identifier has more than 11 bits or there
    /// are more than 8 bytes.
    pub fn new(id: u32, data: &[u8]) -> Option<Self> {
        Self::build(id, false, data)
    }

    /// A frame of either kind; `None` where it cannot be.
    pub fn build(id: u32, extended: bool, data: &[u8]) -> Option<Self> {
        let most = if extended { MOST_EXTENDED } else { 0x7FF };
        if id > most || data.len() > 8 {
            return None;
        }
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(data);
        Some(Self { id, extended, data: bytes, length: u8::try_from(data.len()).ok()? })
    }

    /// The data.
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.length)]
    }
}

/// The letter that sets an adapter's bit rate; `None` for one that the protocol does not know.
pub fn slcan_speed(bits_per_second: u32) -> Option<u8> {
    let speeds = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
    (b'0'..).zip(speeds).find(|(_, speed)| *speed == bits_per_second).map(|(letter, _)| letter)
}

/// A frame as the adapter's line, with its end.
pub fn slcan_line(frame: &CanFrame) -> Vec<u8> {
    use std::fmt::Write;
    let mut line = if frame.extended { format!("T{:08X}", frame.id) } else { format!("t{:03X}", frame.id) };
    let _ = write!(line, "{}", frame.length);
    for byte in frame.data() {
        let _ = write!(line, "{byte:02X}");
    }
    line.push('\r');
    line.into_bytes()
}

/// Finds the frames in the bytes of an adapter. The rest is not needed: whether a command was taken, a
/// version, a serial number, remote frames, damaged bytes.
#[derive(Debug, Clone, Default)]
pub struct SlcanReader {
    line: Vec<u8>,
    overlong: bool,
}

/// `T`, 8 digits, length, 16 digits, and 4 digits of a time stamp.
const LONGEST_LINE: usize = 30;

impl SlcanReader {
    /// Takes bytes as they come and gives each frame to `sink`.
    pub fn push(&mut self, bytes: &[u8], mut sink: impl FnMut(CanFrame)) {
        for &byte in bytes {
            match byte {
                // The end of a line, or the bell of a refusal.
                b'\r' | 0x07 => {
                    if let Some(frame) = frame(&self.line).filter(|_| byte == b'\r' && !self.overlong) {
                        sink(frame);
                    }
                    self.line.clear();
                    self.overlong = false;
                }
                _ if self.line.len() >= LONGEST_LINE => self.overlong = true,
                _ => self.line.push(byte),
            }
        }
    }
}

fn frame(line: &[u8]) -> Option<CanFrame> {
    let extended = match line.first()? {
        b't' => false,
        b'T' => true,
        _ => return None,
    };
    let digits = if extended { 8 } else { 3 };
    let hex = |bytes: &[u8]| {
        bytes.iter().try_fold(0_u32, |sum, &byte| Some(sum << 4 | char::from(byte).to_digit(16)?))
    };
    let id = hex(line.get(1..=digits)?)?;
    let length = usize::try_from(hex(line.get(digits + 1..digits + 2)?)?).ok()?;
    let data = line.get(digits + 2..digits + 2 + 2 * length)?;
    // Four further digits are the adapter's time stamp.
    let rest = line.len() - (digits + 2 + 2 * length);
    if length > 8 || (rest != 0 && rest != 4) {
        return None;
    }
    let bytes: Option<Vec<u8>> =
        data.chunks_exact(2).map(|pair| hex(pair).and_then(|n| u8::try_from(n).ok())).collect();
    CanFrame::build(id, extended, &bytes?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decoded(bytes: &[u8]) -> Vec<CanFrame> {
        let (mut reader, mut all) = (SlcanReader::default(), Vec::new());
        reader.push(bytes, |one| all.push(one));
        all
    }

    #[test]
    fn lines_both_ways() {
        let frame = CanFrame::new(0x1B4, &[0x02]).unwrap();
        assert_eq!(slcan_line(&frame), b"t1B4102\r");
        assert_eq!(decoded(b"t1B4102\r"), [frame]);
        assert_eq!(decoded(b"t1b410200FF\r"), [frame], "with a time stamp");
        let long = CanFrame::build(0x0123_4567, true, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap();
        assert_eq!(slcan_line(&long), b"T0123456780102030405060708\r");
        assert_eq!(decoded(&slcan_line(&long)), [long]);
    }

    #[test]
    fn what_is_no_frame_is_none() {
        assert_eq!(decoded(b"z\r\r\x07t1B4102\x07"), []);
        for line in ["t1B49\r", "t1B41\r", "tXYZ0\r", "t1B4102000\r", "V1013\r", "T1B4102\r", "t8001FF\r"] {
            assert_eq!(decoded(line.as_bytes()), [], "{line}");
        }
        let mut noise = vec![b'0'; 100_000];
        noise.extend(b"\rt1B4102\r");
        assert_eq!(decoded(&noise).len(), 1, "an endless line ends with its own end");
    }

    #[test]
    fn frames_have_limits() {
        assert!(CanFrame::new(0x800, &[]).is_none());
        assert!(CanFrame::new(0x7FF, &[0; 9]).is_none());
        assert!(CanFrame::build(0x2000_0000, true, &[]).is_none());
        assert_eq!(slcan_speed(1_000_000), Some(b'8'));
        assert_eq!(slcan_speed(123), None);
    }
}
