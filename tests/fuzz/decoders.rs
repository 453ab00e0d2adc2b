//! Decoders of every bus, and the descriptions that they are built from. What stands here is held of any
//! input, by the mutations of `tests/fuzz.rs` and by the coverage-guided targets in `fuzz/`.

use super::Chance;
use instruments::Profile;
use instruments::codec::can::{CanFrame, SlcanReader, slcan_line};
use instruments::codec::canopen::{self, DriveState, SdoAnswer};
use instruments::codec::checksum::Check;
use instruments::codec::eds;
use instruments::codec::modbus_rtu::{self as rtu, Parsed};
use instruments::codec::stream::{Cutter, FrameShape};
use instruments::codec::{dbc, text};

/// All of them, by name, in the order that the coverage-guided target counts them.
pub const ALL: &[(&str, fn(&[u8], &mut Chance))] = &[
    ("modbus_rtu", modbus_rtu),
    ("slcan", slcan),
    ("streams", streams),
    ("canopen", canopen),
    ("numbers_in_text", numbers_in_text),
    ("dbc_files", dbc_files),
    ("profiles", profiles),
    ("data_sheets", data_sheets),
];

/// Whatever is heard or accepted as Modbus RTU lies within the bytes and carries a right check.
pub fn modbus_rtu(input: &[u8], _: &mut Chance) {
    let question = rtu::read(9, 3, 180, 6);
    if let Parsed::Request(unit, _, length) = rtu::hear(input, &[0x46, 0x6A]) {
        assert_eq!(unit, input[0]);
        let (body, check) = input[..length].split_at(length - 2);
        assert!(instruments::codec::checksum::Check::CRC_16_MODBUS.holds(body, check, None));
    }
    if let Some(length) = rtu::answer_length(&question, input) {
        assert!(length == 5 || length == question.answer_length);
    }
    if let Ok(registers) = rtu::registers(&question, input) {
        assert_eq!((registers.len(), input.len(), &input[..2]), (12, 17, [9, 3].as_slice()));
    }
    let _ = rtu::written(&question, input);
}

fn said(pieces: &[&[u8]]) -> Vec<CanFrame> {
    let (mut reader, mut all) = (SlcanReader::default(), Vec::new());
    pieces.iter().for_each(|piece| reader.push(piece, |one| all.push(one)));
    all
}

/// Split reads change nothing, and a frame that was understood is understood again when it is sent on.
pub fn slcan(input: &[u8], chance: &mut Chance) {
    let whole = said(&[input]);
    let (head, tail) = input.split_at(chance.below(input.len() + 1));
    assert_eq!(whole, said(&[head, tail]), "split at {}", head.len());
    for frame in whole {
        assert_eq!(said(&[&slcan_line(&frame)]), [frame]);
    }
}

/// Every frame cut from a stream has the right length, sync and check, and split reads change nothing.
pub fn streams(input: &[u8], chance: &mut Chance) {
    let shapes = [
        FrameShape {
            sync: vec![0x20, 0x4E],
            length: 16,
            check: Check::CRC_16_MODBUS,
            check_from: 2,
            check_high_first: None,
            believed_after: 1,
        },
        FrameShape {
            sync: Vec::new(),
            length: 13,
            check: Check::Sum7WithErrorBit,
            check_from: 0,
            check_high_first: None,
            believed_after: 3,
        },
    ];
    for shape in &shapes {
        let cut = |pieces: &[&[u8]]| {
            let (mut cutter, mut frames) = (Cutter::new(shape.clone()), Vec::new());
            pieces.iter().for_each(|piece| cutter.push(piece, |frame| frames.push(frame.to_vec())));
            (frames, cutter.skipped, cutter.lost)
        };
        let whole = cut(&[input]);
        for frame in &whole.0 {
            assert!(frame.len() == shape.length && frame.starts_with(&shape.sync));
        }
        assert!(whole.0.len() * shape.length <= input.len());
        let (head, tail) = input.split_at(chance.below(input.len() + 1));
        assert_eq!(whole, cut(&[head, tail]), "split at {}", head.len());
    }
}

/// An answer counts only for the object that was asked, and a request that is understood is one of this node's.
pub fn canopen(input: &[u8], chance: &mut Chance) {
    let data = &input[..input.len().min(8)];
    let id = [0x585, 0x605, 0x586, 0x185][chance.below(4)];
    let frame = CanFrame::new(id, data).unwrap();
    match canopen::sdo_answer(&frame, 5, 0x6041, 0) {
        Some(SdoAnswer::Value(_) | SdoAnswer::Written | SdoAnswer::Aborted(_)) => {
            assert_eq!((id, &data[1..4]), (0x585, [0x41, 0x60, 0].as_slice()));
        }
        None => {}
    }
    assert!(canopen::sdo_request(&frame, 5).is_none() || id == 0x605);
    if let [low, high, ..] = *data
        && let Some(state) = DriveState::of(u16::from_le_bytes([low, high]))
    {
        assert_eq!(DriveState::of(state.word()), Some(state));
    }
}

/// A number that is read from a line is finite.
pub fn numbers_in_text(input: &[u8], _: &mut Chance) {
    if let Ok(line) = std::str::from_utf8(input)
        && let Some(number) = text::number(line)
    {
        assert!(number.is_finite(), "{line:?}");
    }
}

/// Signals of any DBC file that is accepted read and write frames of any content.
pub fn dbc_files(input: &[u8], chance: &mut Chance) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    for message in dbc::parse(text).into_iter().flatten() {
        for signal in message.1.signals.values() {
            let mut frame: [u8; 8] = std::array::from_fn(|_| chance.byte());
            let _ = signal.read(&frame);
            let _ = signal.write(&mut frame, f64::from(chance.byte()));
        }
    }
}

/// A profile that is accepted decodes frames of any content and any length without harm.
pub fn profiles(input: &[u8], chance: &mut Chance) {
    const DBC: &str = include_str!("../../drivers/profiles/muprime-can.dbc");
    const EDS: &str = include_str!("../../drivers/profiles/cia402-profile-velocity.eds");
    let Ok(text) = std::str::from_utf8(input) else { return };
    let sheet = |name: &str| Some(if name.ends_with(".eds") { EDS.to_string() } else { DBC.to_string() });
    let Ok(profile) = Profile::parse_with(text, &sheet) else { return };
    let _ = profile.check(text);
    let mut values = profile.values();
    for frame in 0..profile.frames().len() {
        let length = profile.frame_bytes(instruments::FrameId(frame));
        let mut bytes: Vec<u8> = (0..length).map(|_| chance.byte()).collect();
        let _ = profile.decode(instruments::FrameId(frame), &bytes, &mut values);
        bytes.truncate(chance.below(length));
        let _ = profile.decode(instruments::FrameId(frame), &bytes, &mut values);
    }
    let _ = (profile.broken_signature(&values), profile.fault(&values));
}

/// Objects of any data sheet that is accepted can be asked for their process data.
pub fn data_sheets(input: &[u8], chance: &mut Chance) {
    let Ok(text) = std::str::from_utf8(input) else { return };
    let Ok(objects) = eds::parse(text) else { return };
    for (first, cob) in [(0x1800, 0x180), (0x1400, 0x200), (0x1800, u32::from(chance.byte()))] {
        if let Ok((placed, length)) = eds::mapping(&objects, first, cob) {
            assert!(length <= 8 && placed.iter().all(|(key, at)| *at < 8 && objects.contains_key(key)));
        }
    }
}
