//! Work of a reading: linear in the file, whatever the file holds. Counted in bytes that are read, not in time.

use super::super::*;
use std::io::Cursor;

/// A file that counts the bytes that are read of it; every look at a place costs a buffer.
struct Counted<'a>(Cursor<&'a [u8]>, u64);

impl Read for Counted<'_> {
    fn read(&mut self, into: &mut [u8]) -> std::io::Result<usize> {
        let count = self.0.read(into)?;
        self.1 += count as u64;
        Ok(count)
    }
}

impl Seek for Counted<'_> {
    fn seek(&mut self, to: SeekFrom) -> std::io::Result<u64> {
        self.1 += 4096;
        self.0.seek(to)
    }
}

/// Bytes that a reading of `bytes` costs, in lengths of the file.
fn lengths_read(bytes: &[u8]) -> f64 {
    let mut counted = Counted(Cursor::new(bytes), 0);
    Reader::new(&mut counted).no_messages().for_each(drop);
    counted.1 as f64 / bytes.len() as f64
}

/// Heads of chunks that reach to the end of the file, `every` so many bytes, with what stands between.
fn heads(length: usize, every: usize, between: &[u8]) -> Vec<u8> {
    let mut bytes = mcap::MAGIC.to_vec();
    while bytes.len() + every < length {
        let rest = (length - bytes.len() - HEAD) as u64;
        let begin = bytes.len();
        bytes.push(op::CHUNK);
        bytes.extend(rest.to_le_bytes());
        bytes.extend(between);
        bytes.resize(begin + every.max(HEAD + between.len()), 0);
    }
    bytes.resize(length, 0);
    bytes
}

/// A sound record of a few bytes.
fn facts() -> Vec<u8> {
    let mut facts = BTreeMap::new();
    let checksum = crate::recorder::sink::checksum_of("a", &facts);
    facts.insert(crate::recorder::CHECKSUM.to_string(), checksum);
    let mut writer = mcap::WriteOptions::new().create(Cursor::new(Vec::new())).unwrap();
    writer.write_metadata(&mcap::records::Metadata { name: "a".into(), metadata: facts }).unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let begin = bytes.iter().enumerate().position(|(i, b)| {
        *b == op::METADATA && bytes[i + 1..].first_chunk::<8>().is_some_and(|l| u64::from_le_bytes(*l) < 100)
    });
    let begin = begin.unwrap();
    let length = u64::from_le_bytes(*bytes[begin + 1..].first_chunk::<8>().unwrap()) as usize;
    bytes[begin..begin + HEAD + length].to_vec()
}

#[test]
fn bytes_that_look_like_heads_of_long_chunks_cost_a_few_lengths_of_the_file() {
    let sound = facts();
    for length in [1 << 18, 1 << 20, 1 << 22] {
        for (what, bytes) in [
            ("side by side", heads(length, HEAD, &[])),
            ("with chunks' own heads", heads(length, 64, &[7; 40])),
            ("each behind a sound record", heads(length, 128, &sound)),
        ] {
            let read = lengths_read(&bytes);
            let most = 20.0 + (8 << 20) as f64 / length as f64;
            assert!(read < most, "{what}, {length} bytes: read {read:.0} times");
        }
    }
}

/// Small records, every second one damaged: what is read to find the next one is not a window of many of them each time.
#[test]
fn damage_at_every_second_record_costs_a_few_lengths_of_the_file() {
    let sound = facts();
    let mut bytes = mcap::MAGIC.to_vec();
    while bytes.len() < 1 << 20 {
        bytes.extend(&sound);
        bytes.extend([0xff; 5]);
    }
    let mut reader = Reader::new(Cursor::new(&bytes[..]));
    let found = reader.by_ref().count();
    assert_eq!(found, (bytes.len() - 8) / (sound.len() + 5), "none is lost");
    let looks = 4096.0 * 6.0 / sound.len() as f64;
    let read = lengths_read(&bytes);
    assert!(read < 30.0 + looks, "read {read:.0} times");
}
