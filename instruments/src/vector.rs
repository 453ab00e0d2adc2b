//! Golden vectors: bytes beside the values that they stand for.
//!
//! A vector is decoded and compared; where the frame's bytes are all covered by signals it is
//! encoded again as well. The same vectors are put to independent peers by the system tests.

use crate::codec::from_hex;
use crate::error::ProfileError;
use crate::field::NumberType;
use crate::profile::{FrameId, FrameKind, Profile};
use crate::schema::Vector;

/// Relative error that a vector's value may have: decimal numbers are not exact in binary.
const TOLERANCE: f64 = 1e-12;
/// The same where the instrument sends single precision.
const TOLERANCE_SINGLE: f64 = 1e-7;

impl Profile {
    /// Runs every golden vector, and demands one for every frame and every block.
    ///
    /// # Errors
    /// The first vector that does not come out, or the first frame without one.
    pub fn check(&self, text: &str) -> Result<(), ProfileError> {
        let d = &self.description;
        let mut seen = vec![false; self.frames().len() + d.write.len()];
        for vector in &d.vector {
            seen[self.check_vector(vector, text)?] = true;
        }
        let blocks = d.write.iter().map(|block| block.name.as_ref());
        for (name, seen) in self.frames().iter().map(|frame| &frame.name).chain(blocks).zip(seen) {
            if !seen {
                let place = text.find(&format!("\"{name}\"")).or_else(|| text.find(&format!("[{name}]")));
                let place = place.map(|at| at..at + name.len() + 2);
                let error = ProfileError::at(text, place, format!("`{name}` has no golden vector"));
                return Err(error.with_help("add a [[vector]] for it"));
            }
        }
        Ok(())
    }

    /// Runs one vector; returns the index of what it is for: frames first, then blocks.
    fn check_vector(&self, vector: &Vector, text: &str) -> Result<usize, ProfileError> {
        let d = &self.description;
        let polls = self.frames().len();
        let error = |message: String| ProfileError::at(text, Some(vector.expect.span()), message);
        let names: Vec<&String> =
            self.frames().iter().map(|f| &f.name).chain(d.write.iter().map(|w| w.name.as_ref())).collect();
        let which = match &vector.frame {
            Some(frame) => names
                .iter()
                .position(|name| *name == frame)
                .ok_or_else(|| error(format!("no frame is called `{frame}`")))?,
            None if names.len() == 1 => 0,
            None => {
                // What it expects says which frame or block it is of, where only one has all of that.
                let mut having = (0..names.len()).filter(|&which| self.has_all(which, vector));
                let (Some(one), None) = (having.next(), having.next()) else {
                    let names: Vec<&str> = names.iter().map(|name| name.as_str()).collect();
                    return Err(error(format!("the vector needs `frame`, one of {}", names.join(", "))));
                };
                one
            }
        };
        let bytes = match (&vector.line, self.frames().get(which)) {
            (Some(line), Some(frame)) => frame
                .read_line(line)
                .ok_or_else(|| error(format!("`{line}` is not a line of `{}`", frame.name)))?,
            _ => match (&vector.registers, &vector.hex) {
                (Some(registers), None) => registers.iter().flat_map(|r| r.to_be_bytes()).collect(),
                (None, Some(hex)) => {
                    from_hex(hex).ok_or_else(|| error(format!("`{hex}` is not hexadecimal bytes")))?
                }
                _ => return Err(error("a vector needs one of `registers`, `hex` and `line`".into())),
            },
        };
        let mut values = self.values();
        for (name, &given) in &vector.given {
            let signal = self.signal(name).filter(|&s| self.frame_of(s).0 != which);
            let signal = signal.ok_or_else(|| error(format!("`{name}` is not a signal of another frame")))?;
            values.set(signal, given);
        }
        if which < polls {
            self.decode(FrameId(which), &bytes, &mut values).map_err(|e| error(e.to_string()))?;
            self.misfit(which, &bytes).map_or(Ok(()), |misfit| Err(error(misfit)))?;
        } else if bytes.len() != 2 * usize::from(d.write[which - polls].count) {
            let (registers, bytes) = (d.write[which - polls].count, bytes.len());
            return Err(error(format!("the block has {registers} registers, the vector {bytes} bytes")));
        }
        for (name, &expected) in vector.expect.as_ref() {
            let found = if which < polls {
                self.signal(name).filter(|&s| self.frame_of(s).0 == which).map(|signal| values.get(signal))
            } else {
                self.sets_of(which - polls)
                    .find(|set| d.set[set.0].name.as_ref() == name)
                    .and_then(|set| self.decode_set(set, &bytes))
            };
            let found =
                found.ok_or_else(|| error(format!("`{name}` does not stand in `{}`", names[which])))?;
            let single =
                d.signal.iter().any(|s| s.name.as_ref() == name && s.number == Some(NumberType::F32));
            let tolerance = if single { TOLERANCE_SINGLE } else { TOLERANCE };
            let close = (found - expected).abs() <= tolerance * expected.abs().max(1.0);
            if !close {
                let found = format!("the vector says {name} = {expected}; its bytes decode to {found}");
                return Err(error(found));
            }
        }
        self.check_encoding(which, &bytes, &values).map_err(error)?;
        Ok(which)
    }

    /// Whether all that a vector expects stands in one frame or block.
    fn has_all(&self, which: usize, vector: &Vector) -> bool {
        let polls = self.frames().len();
        let stands = |name: &String| match which.checked_sub(polls) {
            None => self.signal(name).is_some_and(|signal| self.frame_of(signal).0 == which),
            Some(block) => self.sets_of(block).any(|set| self.description.set[set.0].name.as_ref() == name),
        };
        !vector.expect.as_ref().is_empty() && vector.expect.as_ref().keys().all(stands)
    }

    /// Why the driver would not take the bytes as a stream's frame: its sync bytes, or its check.
    fn misfit(&self, which: usize, bytes: &[u8]) -> Option<String> {
        let stream = matches!(self.frames().get(which).map(|frame| &frame.kind), Some(FrameKind::Stream));
        let shape = self.description.stream.as_ref().filter(|_| stream).and_then(|stream| stream.shape());
        shape.and_then(|shape| shape.misfit(bytes))
    }

    /// The decoded values, encoded over the vector's bytes, must leave them as they are.
    fn check_encoding(&self, which: usize, bytes: &[u8], values: &crate::Values) -> Result<(), String> {
        let mut again = bytes.to_vec();
        let polls = self.frames().len();
        if which < polls {
            self.encode(FrameId(which), &mut again, &mut |signal| {
                Some(values.get(signal)).filter(|v| !v.is_nan())
            });
        } else {
            for set in self.sets_of(which - polls) {
                let value = self.decode_set(set, bytes).ok_or("the block is too short")?;
                self.encode_set(set, value, &mut again).map_err(|e| e.to_string())?;
            }
        }
        let other = || format!("encoding the values again gives {again:02x?}, not {bytes:02x?}");
        if again == bytes { Ok(()) } else { Err(other()) }
    }
}
