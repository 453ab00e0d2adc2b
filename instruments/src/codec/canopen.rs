//! CANopen: network management, service data, heartbeat, emergency (CiA 301), and the states of a
//! drive (CiA 402). Both directions, expedited transfers only: a drive's set-up needs no others.

use super::can::CanFrame;

/// The network command that makes a node operational.
pub fn start(node: u8) -> CanFrame {
    frame(0, &[0x01, node])
}

fn frame(id: u32, data: &[u8]) -> CanFrame {
    CanFrame::new(id, data).unwrap_or_else(|| unreachable!("identifiers here have 11 bits and data 8 bytes"))
}

/// Asks for an object.
pub fn sdo_read(node: u8, index: u16, sub: u8) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    frame(0x600 + u32::from(node), &[0x40, low, high, sub, 0, 0, 0, 0])
}

/// Writes an object of 1, 2 or 4 bytes.
pub fn sdo_write(node: u8, index: u16, sub: u8, bytes: u8, value: i64) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    let unused = 4 - bytes.clamp(1, 4);
    let mut data = [0x23 | unused << 2, low, high, sub, 0, 0, 0, 0];
    let value = value.to_le_bytes();
    data[4..8 - usize::from(unused)].copy_from_slice(&value[..4 - usize::from(unused)]);
    frame(0x600 + u32::from(node), &data)
}

/// An answer to service data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdoAnswer {
    /// The object was written.
    Written,
    /// The object's value, not sign-extended.
    Value(u32),
    /// Refused, with the abort code.
    Aborted(u32),
}

/// The answer in `frame` to a request for that object; `None` where it is something else.
pub fn sdo_answer(frame: &CanFrame, node: u8, index: u16, sub: u8) -> Option<SdoAnswer> {
    let data: [u8; 8] = frame.data().try_into().ok()?;
    let same = frame.id == 0x580 + u32::from(node) && data[1..3] == index.to_le_bytes() && data[3] == sub;
    if !same || frame.extended {
        return None;
    }
    let value = u32::from_le_bytes([data[4], data[5], data[6], data[7]]);
    match data[0] {
        0x60 => Some(SdoAnswer::Written),
        0x80 => Some(SdoAnswer::Aborted(value)),
        command if command & 0xE3 == 0x43 => {
            let unused = 8 * u32::from(command >> 2 & 3);
            Some(SdoAnswer::Value(value << unused >> unused))
        }
        _ => None,
    }
}

/// A request for service data, as the node sees it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SdoRequest {
    /// Object and subindex are wanted.
    Read(u16, u8),
    /// Object, subindex, bytes, value.
    Write(u16, u8, u8, u32),
}

/// The request in `frame`; `None` where it is none for this node, or not expedited.
pub fn sdo_request(frame: &CanFrame, node: u8) -> Option<SdoRequest> {
    let data: [u8; 8] = frame.data().try_into().ok()?;
    if frame.id != 0x600 + u32::from(node) || frame.extended {
        return None;
    }
    let (index, sub) = (u16::from_le_bytes([data[1], data[2]]), data[3]);
    match data[0] {
        0x40 => Some(SdoRequest::Read(index, sub)),
        command if command & 0xE2 == 0x22 => {
            let unused = if command & 1 == 1 { command >> 2 & 3 } else { 0 };
            let shift = 8 * u32::from(unused);
            let value = u32::from_le_bytes([data[4], data[5], data[6], data[7]]);
            Some(SdoRequest::Write(index, sub, 4 - unused, value << shift >> shift))
        }
        _ => None,
    }
}

/// The node's answer.
pub fn sdo_reply(node: u8, index: u16, sub: u8, bytes: u8, answer: SdoAnswer) -> CanFrame {
    let [low, high] = index.to_le_bytes();
    let (command, value) = match answer {
        SdoAnswer::Written => (0x60, 0),
        SdoAnswer::Aborted(code) => (0x80, code),
        SdoAnswer::Value(value) => (0x43 | (4 - bytes.clamp(1, 4)) << 2, value),
    };
    let mut data = [command, low, high, sub, 0, 0, 0, 0];
    data[4..].copy_from_slice(&value.to_le_bytes());
    frame(0x580 + u32::from(node), &data)
}

/// The node's heartbeat: 0 boot-up, 4 stopped, 5 operational, 127 pre-operational.
pub fn heartbeat(node: u8, state: u8) -> CanFrame {
    frame(0x700 + u32::from(node), &[state])
}

/// States of a drive by its status word (CiA 402-2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DriveState {
    /// It starts.
    NotReady,
    /// Switch-on is disabled.
    Disabled,
    /// Ready to be switched on.
    Ready,
    /// Switched on.
    On,
    /// It moves by its set-point.
    Enabled,
    /// A quick stop runs.
    QuickStop,
    /// A fault's reaction runs.
    FaultReaction,
    /// A fault.
    Fault,
}

impl DriveState {
    const TABLE: [(u16, u16, DriveState); 8] = [
        (0x4F, 0x00, DriveState::NotReady),
        (0x4F, 0x40, DriveState::Disabled),
        (0x6F, 0x21, DriveState::Ready),
        (0x6F, 0x23, DriveState::On),
        (0x6F, 0x27, DriveState::Enabled),
        (0x6F, 0x07, DriveState::QuickStop),
        (0x4F, 0x0F, DriveState::FaultReaction),
        (0x4F, 0x08, DriveState::Fault),
    ];

    /// The state that a status word tells; `None` for a word that tells none.
    pub fn of(status: u16) -> Option<Self> {
        Self::TABLE.iter().find(|(mask, value, _)| status & mask == *value).map(|(.., state)| *state)
    }

    /// A status word that tells this state.
    pub fn word(self) -> u16 {
        Self::TABLE.iter().find(|(.., state)| *state == self).map_or(0, |(_, value, _)| *value)
    }

    /// The control word that leads one step towards enabled; `None` where waiting is all that helps.
    /// A fault is never reset here: that is for a person.
    pub const fn towards_enabled(self) -> Option<u16> {
        match self {
            Self::Disabled => Some(0x06),
            Self::Ready => Some(0x07),
            Self::On | Self::Enabled => Some(0x0F),
            Self::QuickStop => Some(0x00),
            Self::NotReady | Self::FaultReaction | Self::Fault => None,
        }
    }

    /// The state after a control word, as a drive without delays has it.
    pub const fn after(self, control: u16, reset_edge: bool) -> Self {
        if matches!(self, Self::Fault) {
            return if reset_edge { Self::Disabled } else { Self::Fault };
        }
        if control & 0x02 == 0 {
            return Self::Disabled;
        }
        if control & 0x04 == 0 {
            let stops = matches!(self, Self::Enabled | Self::QuickStop);
            return if stops { Self::QuickStop } else { Self::Disabled };
        }
        match (self, control & 0x0F) {
            (Self::Disabled | Self::Ready | Self::On | Self::Enabled, 0x06) => Self::Ready,
            (Self::Ready | Self::On | Self::Enabled, 0x07) => Self::On,
            (Self::Ready | Self::On | Self::Enabled, 0x0F) => Self::Enabled,
            _ => self,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The write that the manuals of several drives print.
    #[test]
    fn a_published_write() {
        let frame = sdo_write(2, 0x6040, 0, 2, 6);
        assert_eq!((frame.id, frame.data()), (0x602, [0x2B, 0x40, 0x60, 0, 6, 0, 0, 0].as_slice()));
    }

    #[test]
    fn both_sides_agree() {
        for (bytes, value) in [(1, 3_i64), (2, 0xF00F), (4, -12345)] {
            let frame = sdo_write(5, 0x60FF, 1, bytes, value);
            let expected = value as u32 & (u32::MAX >> (32 - 8 * u32::from(bytes)));
            assert_eq!(sdo_request(&frame, 5), Some(SdoRequest::Write(0x60FF, 1, bytes, expected)));
            assert_eq!(sdo_request(&frame, 6), None);
            let reply = sdo_reply(5, 0x60FF, 1, bytes, SdoAnswer::Value(expected));
            assert_eq!(sdo_answer(&reply, 5, 0x60FF, 1), Some(SdoAnswer::Value(expected)));
            assert_eq!(sdo_answer(&reply, 5, 0x60FF, 0), None, "an answer to another question");
        }
        assert_eq!(sdo_request(&sdo_read(5, 0x6041, 0), 5), Some(SdoRequest::Read(0x6041, 0)));
        let abort = sdo_reply(5, 0x6041, 0, 4, SdoAnswer::Aborted(0x0602_0000));
        assert_eq!(sdo_answer(&abort, 5, 0x6041, 0), Some(SdoAnswer::Aborted(0x0602_0000)));
    }

    #[test]
    fn the_way_to_enabled_and_out_of_a_fault() {
        let mut state = DriveState::Disabled;
        let mut words = Vec::new();
        while state != DriveState::Enabled {
            let word = state.towards_enabled().unwrap();
            words.push(word);
            state = state.after(word, false);
        }
        assert_eq!(words, [6, 7, 0x0F]);
        assert_eq!(DriveState::Fault.towards_enabled(), None);
        assert_eq!(DriveState::Fault.after(0x0F, false), DriveState::Fault);
        assert_eq!(DriveState::Fault.after(0x80, true), DriveState::Disabled);
        assert_eq!(DriveState::Enabled.after(0x02, false), DriveState::QuickStop);
        assert_eq!(DriveState::Enabled.after(0x00, false), DriveState::Disabled);
    }

    #[test]
    fn every_status_word_tells_at_most_one_state() {
        for status in 0..=u16::MAX {
            let matches = DriveState::TABLE.iter().filter(|(mask, value, _)| status & mask == *value).count();
            assert!(matches <= 1, "{status:#06x}");
        }
        for state in DriveState::TABLE.map(|(.., state)| state) {
            assert_eq!(DriveState::of(state.word()), Some(state));
        }
    }
}
