//! Whether a record of the format is as it was written: by its checksum, or by its form where it has none.

use super::chunk::{self, Message};
use super::{Entry, HEAD, LONGEST, Wanted};
use crate::recorder::CHECKSUM;
use crate::recorder::sink::checksum_of;
use mcap::records::{Metadata, Record, op};
use std::collections::VecDeque;

/// What a sound record of the format comes to.
pub(super) enum Checked {
    Nothing,
    Entry(Entry),
    Chunk(VecDeque<Message>),
    DataEnd(u32),
}

/// Kinds of record that the data of a file may hold.
pub(super) fn known(opcode: u8) -> bool {
    [op::HEADER, op::CHUNK, op::MESSAGE_INDEX, op::ATTACHMENT, op::METADATA, op::DATA_END].contains(&opcode)
}

/// Length of a record from which reading can go on, if one may begin here: of a kind that carries a checksum,
/// or the mark of the data's end.
pub(super) fn may_begin(bytes: &[u8]) -> Option<u64> {
    let head = bytes.first_chunk::<HEAD>()?;
    let length = u64::from_le_bytes(head[1..].try_into().expect("eight bytes"));
    let may = match head[0] {
        op::CHUNK | op::ATTACHMENT | op::METADATA => length <= LONGEST,
        op::DATA_END => length == 4,
        _ => false,
    };
    may.then_some(length)
}

/// Checks a record of the format by all that vouches for it.
pub(super) fn verify(opcode: u8, body: &[u8], wanted: Wanted) -> Result<Checked, String> {
    if opcode == op::ATTACHMENT && !ends(body) {
        return Err("an attachment is shorter than its own head".into());
    }
    let record = mcap::parse_record(opcode, body).map_err(|e| e.to_string())?;
    if length_of(&record).is_some_and(|length| length != body.len()) {
        return Err("a record is longer than what it holds".into());
    }
    match record {
        Record::Chunk { header, data } => chunk::messages(&header, &data, body, wanted).map(Checked::Chunk),
        Record::MessageIndex(_) | Record::Header(_) => Ok(Checked::Nothing),
        Record::Attachment { header, data, crc } => {
            if crc == 0 {
                return Err(format!("the attached file '{}' has no checksum", header.name));
            }
            let (name, time_ns, bytes) = (header.name, header.log_time, data.into_owned());
            Ok(Checked::Entry(Entry::File { name, time_ns, bytes }))
        }
        Record::Metadata(metadata) => {
            let (name, mut facts) = (metadata.name, metadata.metadata);
            match facts.remove(CHECKSUM) {
                None => {
                    Err("a metadata record has no checksum: it is damaged, or from before records had one"
                        .into())
                }
                Some(stated) if stated != checksum_of(&name, &facts) => {
                    Err("the checksum of a metadata record does not agree".into())
                }
                Some(_) => Ok(Checked::Entry(Entry::Facts { name, facts })),
            }
        }
        Record::DataEnd(end) => Ok(Checked::DataEnd(end.data_section_crc)),
        _ => Err("a record of the format is out of place".into()),
    }
}

/// Length in bytes of a record of the format, by what it holds.
fn length_of(record: &Record<'_>) -> Option<usize> {
    Some(match record {
        Record::Header(header) => 8 + header.profile.len() + header.library.len(),
        Record::Chunk { header, data } => 40 + header.compression.len() + data.len(),
        Record::MessageIndex(index) => 6 + 16 * index.records.len(),
        Record::Attachment { header, data, .. } => {
            36 + header.name.len() + header.media_type.len() + data.len()
        }
        Record::Metadata(Metadata { name, metadata }) => {
            8 + name.len() + metadata.iter().map(|(key, value)| 8 + key.len() + value.len()).sum::<usize>()
        }
        Record::DataEnd(_) => 4,
        _ => return None,
    })
}

/// Whether an attachment has room for its length and its checksum behind its times, its name and its kind.
/// The MCAP library (0.26) takes that for granted.
fn ends(attachment: &[u8]) -> bool {
    let after_text = |at: usize| {
        let length = attachment.get(at..)?.first_chunk::<4>()?;
        (at + 4).checked_add(u32::from_le_bytes(*length) as usize)
    };
    let head = after_text(16).and_then(after_text);
    head.and_then(|head| head.checked_add(8 + 4)).is_some_and(|least| least <= attachment.len())
}
