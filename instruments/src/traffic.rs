//! How much of a line's capacity an instrument's samples take.
//!
//! Only what the line itself needs is counted: bits, and the pauses that the protocol demands. What an
//! instrument takes to answer comes on top, and so do set-points; what does not fit so cannot work at all.

use crate::codec::modbus_rtu::silence_s;
use crate::codec::pattern::Pattern;
use crate::{FrameKind, LinkKind, Profile};

/// What a setup may state of a line.
#[derive(Debug, Clone, Copy, Default)]
pub struct LineSetup {
    /// Registers of a Modbus TCP profile over a serial line.
    pub over_rtu: bool,
    /// A serial line behind a device server: how fast that is, nobody states.
    pub over_tcp: bool,
    /// Symbols per second, where they are not the profile's.
    pub baud: Option<u32>,
    /// Samples per second, where they are not the profile's.
    pub rate_hz: Option<f64>,
}

/// Bits of one byte on a serial line: start, data, parity, stop.
fn bits_a_byte(format: &str) -> f64 {
    let digit = |at: usize| format.as_bytes().get(at).map_or(0, |byte| byte.saturating_sub(b'0'));
    let parity = u8::from(format.as_bytes().get(1).is_some_and(|&letter| letter != b'N'));
    f64::from(1 + digit(0) + parity + digit(2))
}

impl Profile {
    /// The share of its line that an instrument's samples take: above 1 they do not fit. `None` for a line
    /// whose capacity nobody states, such as TCP.
    pub fn line_share(&self, setup: LineSetup) -> Option<f64> {
        let d = &self.description;
        let serial = |default: u32| f64::from(setup.baud.or(d.link.baud).unwrap_or(default));
        let byte_s = |baud: f64| bits_a_byte(d.link.line_format()) / baud;
        let share: f64 = match d.link.kind {
            LinkKind::ModbusTcp if !setup.over_rtu => return None,
            LinkKind::Scpi | LinkKind::Tcp | LinkKind::Udp | LinkKind::Sysfs => return None,
            LinkKind::Serial if setup.over_tcp => return None,
            LinkKind::ModbusTcp | LinkKind::ModbusRtu => {
                let baud = serial(19_200);
                let pause = silence_s(baud as u32);
                let polls = self.polls().filter_map(|(frame, poll)| {
                    let rate = setup.rate_hz.or(poll.rate_hz).filter(|_| poll.rate_hz.is_some())?;
                    let bytes =
                        |count: u16| f64::from(count) * if poll.table.is_bits() { 0.125 } else { 2.0 };
                    let spans = self.frames()[frame.0].spans.iter();
                    let reads = spans.map(|span| (8.0 + 5.0 + bytes(span.count)) * byte_s(baud) + pause);
                    Some(rate * reads.sum::<f64>())
                });
                polls.sum::<f64>() + self.stream_bytes_s() * byte_s(baud)
            }
            LinkKind::Serial => {
                let baud = serial(9600);
                let (sent, came) = (d.link.tx_end().len(), d.link.rx_end().len());
                let queries = d.query.iter().map(|query| {
                    let line = query.answer.as_deref().and_then(|answer| Pattern::parse(answer).ok());
                    let least = line.map_or(1, |line| line.least_length());
                    let answer = query.length.map_or(came + least, usize::from);
                    let bytes = query.send.len() + sent + answer;
                    let seconds = bytes as f64 * byte_s(baud);
                    setup.rate_hz.unwrap_or(query.rate_hz) * seconds.max(d.link.min_gap_ms * 1e-3)
                });
                queries.sum::<f64>() + self.stream_bytes_s() * byte_s(baud)
            }
            LinkKind::Can | LinkKind::Canopen => {
                let bitrate = f64::from(d.link.bitrate.unwrap_or(1_000_000));
                let groups = self.frames().iter().filter_map(|frame| {
                    let FrameKind::Messages(index, parts) = &frame.kind else { return None };
                    let message = &d.message[*index];
                    // Besides its data a classic CAN frame has start, identifier, control, CRC, acknowledgement,
                    // end and pause, without the stuffing, which adds up to a fifth.
                    let overhead = |extended| if extended { 67.0 } else { 47.0 };
                    let bits = |extended, bytes: usize| overhead(extended) + 8.0 * bytes as f64;
                    let request = message.request.as_ref().map_or(0.0, |data| bits(false, data.len()));
                    let answer: f64 = parts.iter().map(|part| bits(part.extended, part.length)).sum();
                    Some(setup.rate_hz.unwrap_or(message.rate_hz) * (request + answer))
                });
                groups.sum::<f64>() / bitrate
            }
        };
        Some(share)
    }

    fn stream_bytes_s(&self) -> f64 {
        let d = &self.description;
        d.stream.as_ref().map_or(0.0, |stream| {
            let line = stream.line.as_deref().and_then(|line| Pattern::parse(line).ok());
            let whole = |line: Pattern| line.least_length() + d.link.rx_end().len();
            let bytes = line.map_or(usize::from(stream.length.unwrap_or(0)), whole);
            stream.rate_hz * bytes as f64
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn polled(rate_hz: f64) -> Profile {
        let text = format!(
            "[profile]\nschema = 1\nid = \"a\"\nmaker = \"m\"\nmodels = [\"m\"]\nroles = [\"force.normal\"]\n\
             provenance = \"p\"\nverified = \"emulator-only\"\n\
             [link]\nkind = \"modbus_rtu\"\nbaud = 9600\nformat = \"8N1\"\n\
             [[poll]]\nname = \"sample\"\naddress = 0\ncount = 2\nrate_hz = {rate_hz}\n\
             [[signal]]\nname = \"normal\"\nregister = 0\ntype = \"i32\"\n\
             [[vector]]\nregisters = [0, 1]\nexpect = {{ normal = 1 }}\n"
        );
        Profile::parse(&text).unwrap()
    }

    /// 8 bytes ask, 9 answer, at 10 bits each; 3.5 characters of 11 bits part them.
    #[test]
    fn polls_by_hand() {
        let seconds = (8.0 + 9.0) * 10.0 / 9600.0 + 3.5 * 11.0 / 9600.0;
        let share = polled(30.0).line_share(LineSetup::default()).unwrap();
        assert!((share - 30.0 * seconds).abs() < 1e-12, "{share}");
        assert!(polled(500.0).line_share(LineSetup::default()).unwrap() > 1.0, "500 a second at 9600 baud");
        let faster = LineSetup { baud: Some(1_000_000), ..LineSetup::default() };
        assert!(polled(500.0).line_share(faster).unwrap() < 1.0 + 0.5);
    }
}
