mod work;

use super::*;
use mcap::WriteOptions;
use mcap::records::MessageHeader;
use std::io::Cursor;

/// An uncompressed chunk, with its checksum or without, and where its message's length stands.
fn uncompressed(checksum: bool) -> (Vec<u8>, usize) {
    let options = WriteOptions::new().compression(None).calculate_chunk_crcs(checksum);
    let mut writer = options.create(Cursor::new(Vec::new())).unwrap();
    let channel = writer.add_channel(0, "/cycle", "json", &BTreeMap::new()).unwrap();
    let header = MessageHeader { channel_id: channel, sequence: 1, log_time: 2, publish_time: 2 };
    writer.write_to_known_channel(&header, b"{\"a\":1}").unwrap();
    writer.finish().unwrap();
    let bytes = writer.into_inner().into_inner();
    let body = bytes.windows(7).position(|w| w == b"{\"a\":1}").unwrap();
    // Opcode and length, then 22 bytes of header.
    (bytes, body - 30)
}

fn read(bytes: &[u8]) -> (usize, Integrity) {
    let mut reader = Reader::new(Cursor::new(bytes));
    let messages = reader.by_ref().filter(|e| matches!(e, Entry::Message { .. })).count();
    (messages, reader.integrity().clone())
}

/// Found by coverage-guided fuzzing.
#[test]
fn a_record_that_is_longer_than_its_chunk_is_left_out() {
    let (mut bytes, length) = uncompressed(true);
    assert_eq!(read(&bytes), (1, Integrity::default()));
    bytes[length] += 1;
    let (messages, found) = read(&bytes);
    assert_eq!((messages, found.places[0].why.contains("do not fit")), (0, true));
}

#[test]
fn a_chunk_without_a_checksum_is_not_believed() {
    let (messages, found) = read(&uncompressed(false).0);
    assert_eq!((messages, found.places[0].why.contains("no checksum")), (0, true));
}

/// Found by coverage-guided fuzzing.
#[test]
fn an_attachment_that_is_shorter_than_its_head_is_left_out() {
    let attachment = |length: usize| {
        // Times, an empty name, an empty kind, no data, no checksum.
        let head = [&[op::ATTACHMENT][..], &(length as u64).to_le_bytes()].concat();
        [mcap::MAGIC, &head, &vec![0; length]].concat()
    };
    let why = |length: usize| {
        let bytes = attachment(length);
        let mut reader = Reader::new(Cursor::new(&bytes));
        assert_eq!(reader.next(), None, "{length}");
        reader.integrity().cut.clone().unwrap()
    };
    assert!(why(36).contains("has no checksum"));
    for length in 0..36 {
        assert!(why(length).contains("shorter than its own head"), "{length}");
    }
}
