//! Sensor streams: frames that the instrument sends without a request.
//!
//! A stream has no silence to find its frames by. Sync bytes also occur in data, and some streams
//! have none, so alignment stands on the check alone, and it is believed only after several frames
//! in a row: one byte of check lets one wrong place in 128 pass.

use super::checksum::Check;

/// What a stream's frames look like.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameShape {
    /// The bytes that every frame begins with; may be empty.
    pub sync: Vec<u8>,
    /// Length of a frame, sync and check included.
    pub length: usize,
    /// The check at its end.
    pub check: Check,
    /// Bytes at its beginning that the check leaves out.
    pub check_from: usize,
    /// Whether the check's high byte comes first; see [`Check::of`].
    pub check_high_first: Option<bool>,
    /// Frames in a row that make an alignment believed.
    pub believed_after: u32,
}

impl FrameShape {
    /// What keeps bytes from being such a frame; `None` where they are one.
    pub fn misfit(&self, frame: &[u8]) -> Option<String> {
        let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
        if frame.len() != self.length {
            return Some(format!("the frame has {} bytes, not {}", self.length, frame.len()));
        }
        if !frame.starts_with(&self.sync) {
            return Some(format!("the frame begins with {}", hex(&self.sync)));
        }
        let (body, check) = frame.split_at(frame.len() - self.check.length());
        let body = body.get(self.check_from..)?;
        (!self.check.holds(body, check, self.check_high_first)).then(|| {
            let due = self.check.of(body, self.check_high_first);
            format!("the check of these bytes is {}, and the frame ends with {}", hex(&due), hex(check))
        })
    }
}

/// Cuts a stream of bytes into frames.
#[derive(Debug, Clone)]
pub struct Cutter {
    shape: FrameShape,
    buffer: Vec<u8>,
    good_in_a_row: u32,
    /// Bytes that belonged to no frame.
    pub skipped: u64,
    /// Times that an alignment which was believed was lost.
    pub lost: u64,
}

/// Bytes looked at in one go.
const CHUNK: usize = 2048;

impl Cutter {
    /// For frames of that shape.
    pub fn new(shape: FrameShape) -> Self {
        Self { shape, buffer: Vec::with_capacity(2 * CHUNK), good_in_a_row: 0, skipped: 0, lost: 0 }
    }

    /// Takes bytes as they come and gives each whole frame of a believed alignment to `frame`.
    pub fn push(&mut self, bytes: &[u8], mut frame: impl FnMut(&[u8])) {
        for chunk in bytes.chunks(CHUNK) {
            self.buffer.extend_from_slice(chunk);
            let mut at = 0;
            while self.buffer.len() - at >= self.shape.length {
                let candidate = &self.buffer[at..at + self.shape.length];
                if self.fits(candidate) {
                    self.good_in_a_row = self.good_in_a_row.saturating_add(1);
                    if self.good_in_a_row >= self.shape.believed_after {
                        frame(candidate);
                    }
                    at += self.shape.length;
                } else {
                    self.lost += u64::from(self.good_in_a_row >= self.shape.believed_after);
                    self.good_in_a_row = 0;
                    self.skipped += 1;
                    at += 1;
                }
            }
            self.buffer.drain(..at);
        }
    }

    fn fits(&self, candidate: &[u8]) -> bool {
        let (body, check) = candidate.split_at(candidate.len() - self.shape.check.length());
        let FrameShape { sync, check: kind, check_from, check_high_first, .. } = &self.shape;
        candidate.starts_with(sync)
            && body.get(*check_from..).is_some_and(|body| kind.holds(body, check, *check_high_first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::from_hex;

    fn ft300() -> FrameShape {
        FrameShape {
            sync: vec![0x20, 0x4E],
            length: 16,
            check: Check::CRC_16_MODBUS,
            check_from: 0,
            check_high_first: None,
            believed_after: 1,
        }
    }

    fn cut(shape: FrameShape, bytes: &[u8], chunk: usize) -> Vec<Vec<u8>> {
        let (mut cutter, mut frames) = (Cutter::new(shape), Vec::new());
        for piece in bytes.chunks(chunk) {
            cutter.push(piece, |frame| frames.push(frame.to_vec()));
        }
        frames
    }

    #[test]
    fn frames_are_found_however_the_bytes_come() {
        let frame = from_hex("204e96003cf6d2040a00ecff1e0082ad").unwrap();
        let mut bytes = vec![0x20, 0x4E, 0x20];
        for _ in 0..5 {
            bytes.extend(&frame);
        }
        for chunk in 1..40 {
            assert_eq!(cut(ft300(), &bytes, chunk), vec![frame.clone(); 5], "{chunk}");
        }
    }

    #[test]
    fn one_bad_frame_is_lost_and_no_more() {
        let frame = from_hex("204e96003cf6d2040a00ecff1e0082ad").unwrap();
        let mut bytes: Vec<u8> = (0..4).flat_map(|_| frame.clone()).collect();
        bytes[20] ^= 1;
        assert_eq!(cut(ft300(), &bytes, 7).len(), 3);
        bytes.remove(5);
        assert_eq!(cut(ft300(), &bytes, 7).len(), 2);
    }

    /// Without sync bytes a wrong place passes one time in 128: a few frames in a row must agree.
    #[test]
    fn a_stream_without_sync_bytes_is_aligned_by_its_sums() {
        let shape = FrameShape {
            sync: vec![],
            length: 13,
            check: Check::Sum7WithErrorBit,
            check_from: 0,
            check_high_first: None,
            believed_after: 4,
        };
        let mut bytes = vec![7, 7, 7, 7, 7];
        let mut sent = Vec::new();
        for i in 0..200_u8 {
            let mut frame: Vec<u8> =
                (0..12u8).map(|j| i.wrapping_mul(37).wrapping_add(j.wrapping_mul(91))).collect();
            frame.push(Check::Sum7WithErrorBit.of(&frame, None)[0]);
            bytes.extend(&frame);
            sent.push(frame);
        }
        let found = cut(shape, &bytes, 11);
        assert!(found.len() >= 190, "{}", found.len());
        assert!(found.iter().all(|frame| sent.contains(frame)), "a frame that was never sent");
    }

    #[test]
    fn noise_does_not_pile_up() {
        let mut cutter = Cutter::new(ft300());
        cutter.push(&vec![0x20; 100_000], |_| panic!("a frame out of noise"));
        assert!(cutter.buffer.len() < 16);
    }
}
