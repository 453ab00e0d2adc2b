//! Damaged input for everything that reads: decoders of every bus, configuration, tables, records.
//!
//! Each target takes a committed corpus (`tests/fuzz/*.hex`, and the project's own configuration
//! files) and mutates it from a fixed seed. It holds more than 'no panic': each states what must be
//! true of whatever comes out. `MUPRIME_FUZZ_CASES` sets the cases a target, `MUPRIME_FUZZ_SEED` the
//! seed; an input that fails is printed in hexadecimal, to be added to the corpus. The mutations
//! know nothing of coverage: this finds shallow defects quickly and deep ones slowly.

use instruments::Profile;
use instruments::codec::can::{CanFrame, SlcanReader, SlcanSaid, slcan_line};
use instruments::codec::canopen::{self, DriveState, SdoAnswer};
use instruments::codec::checksum::Check;
use instruments::codec::modbus_rtu::{self as rtu, Heard};
use instruments::codec::stream::{Cutter, Shape};
use instruments::codec::{dbc, text};
use instruments::vector::from_hex;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use realtime::recorder::Recovery;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::path::Path;
use tests::file;

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name)
        .map_or(otherwise, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
}

/// The byte corpus of that name.
fn bytes(name: &str) -> Vec<Vec<u8>> {
    let text = std::fs::read_to_string(file("tests/fuzz").join(name)).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    lines.map(|line| from_hex(line).unwrap_or_else(|| panic!("{name}: {line} is no hexadecimal"))).collect()
}

/// The files of a folder that end so.
fn files(folder: &str, end: &str) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(file(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = entries.filter(|path| path.to_string_lossy().ends_with(end)).collect();
    paths.sort();
    assert!(!paths.is_empty(), "no {end} in {folder}");
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
}

struct Chance(ChaCha8Rng);

impl Chance {
    #[allow(clippy::cast_possible_truncation)] // below `end`
    fn below(&mut self, end: usize) -> usize {
        (self.0.next_u64() % end.max(1) as u64) as usize
    }

    #[allow(clippy::cast_possible_truncation)] // one byte is meant
    fn byte(&mut self) -> u8 {
        const TELLING: [u8; 16] = *b"\0\x01\x7f\x80\xff\r\n\"'-.=[]#9";
        if self.below(2) == 0 { TELLING[self.below(TELLING.len())] } else { self.0.next_u32() as u8 }
    }
}

/// One to six changes: bits, bytes, cuts, doublings, and pieces of another input.
fn mutated(corpus: &[Vec<u8>], chance: &mut Chance) -> Vec<u8> {
    let mut input = corpus[chance.below(corpus.len())].clone();
    for _ in 0..=chance.below(6) {
        let (len, at) = (input.len(), chance.below(input.len()));
        match chance.below(7) {
            0 if len > 0 => input[at] ^= 1 << chance.below(8),
            1 if len > 0 => input[at] = chance.byte(),
            2 => input.insert(at, chance.byte()),
            3 => input.truncate(at),
            4 if len > 0 => drop(input.drain(at..(at + 1 + chance.below(16)).min(len))),
            5 if len > 0 => {
                let piece = input[at..(at + 1 + chance.below(64)).min(len)].to_vec();
                input.extend(piece);
            }
            _ => {
                let other = &corpus[chance.below(corpus.len())];
                let from = chance.below(other.len());
                let piece = &other[from..(from + 1 + chance.below(64)).min(other.len())];
                input.splice(at..at, piece.iter().copied());
            }
        }
    }
    input
}

/// Runs a target over its corpus and over mutations of it; `share` of the cases are enough for slow ones.
fn run(name: &str, corpus: &[Vec<u8>], share: u64, mut target: impl FnMut(&[u8], &mut Chance)) {
    let seed = setting("MUPRIME_FUZZ_SEED", 1);
    let cases = setting("MUPRIME_FUZZ_CASES", 20_000) / share;
    let mut chance = Chance(ChaCha8Rng::seed_from_u64(seed));
    for case in 0..corpus.len() as u64 + cases {
        let input = match corpus.get(usize::try_from(case).unwrap()) {
            Some(whole) => whole.clone(),
            None => mutated(corpus, &mut chance),
        };
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| target(&input, &mut chance))) {
            let hex: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
            eprintln!("{name}: seed {seed}, case {case}, input {hex}");
            resume_unwind(panic);
        }
    }
    println!("{name}: {} inputs and {cases} mutations, seed {seed}", corpus.len());
}

/// Whatever is heard or accepted as Modbus RTU lies within the bytes and carries a right check.
#[test]
fn modbus_rtu() {
    let question = rtu::read(9, 3, 180, 6);
    run("modbus_rtu", &bytes("rtu.hex"), 1, |input, _| {
        if let Heard::Request(unit, _, length) = rtu::hear(input, &[0x46, 0x6A]) {
            assert_eq!(unit, input[0]);
            let (body, check) = input[..length].split_at(length - 2);
            assert_eq!(instruments::codec::checksum::crc16_modbus(body).to_le_bytes(), check);
        }
        if let Some(length) = rtu::answer_length(&question, input) {
            assert!(length == 5 || length == question.answer_length);
        }
        if let Ok(registers) = rtu::registers(&question, input) {
            assert_eq!((registers.len(), input.len(), &input[..2]), (12, 17, [9, 3].as_slice()));
        }
        let _ = rtu::written(&question, input);
    });
}

fn said(pieces: &[&[u8]]) -> Vec<SlcanSaid> {
    let (mut reader, mut all) = (SlcanReader::default(), Vec::new());
    pieces.iter().for_each(|piece| reader.push(piece, |one| all.push(one)));
    all
}

/// Split reads change nothing, and a frame that was understood is understood again when it is sent on.
#[test]
fn slcan() {
    run("slcan", &bytes("slcan.hex"), 1, |input, chance| {
        let whole = said(&[input]);
        let (head, tail) = input.split_at(chance.below(input.len() + 1));
        assert_eq!(whole, said(&[head, tail]), "split at {}", head.len());
        for one in whole {
            if let SlcanSaid::Frame(frame) = one {
                assert_eq!(said(&[&slcan_line(&frame)]), [SlcanSaid::Frame(frame)]);
            }
        }
    });
}

/// Every frame cut from a stream has the right length, sync and check, and split reads change nothing.
#[test]
fn streams() {
    let shapes = [
        Shape { sync: vec![0x20, 0x4E], length: 16, check: Check::Crc16Modbus, believed_after: 1 },
        Shape { sync: Vec::new(), length: 13, check: Check::Sum7WithErrorBit, believed_after: 3 },
    ];
    run("streams", &bytes("stream.hex"), 1, |input, chance| {
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
    });
}

/// An answer counts only for the object that was asked, and a request that is understood is one of this node's.
#[test]
fn canopen_service_data() {
    run("canopen", &bytes("canopen.hex"), 1, |input, chance| {
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
    });
}

/// A number that is read from a line is finite.
#[test]
fn numbers_in_text() {
    run("numbers_in_text", &bytes("text.hex"), 1, |input, _| {
        if let Ok(line) = std::str::from_utf8(input)
            && let Some(number) = text::number(line)
        {
            assert!(number.is_finite(), "{line:?}");
        }
    });
}

/// Signals of any DBC file that is accepted read and write frames of any content.
#[test]
fn dbc_files() {
    let mut corpus = files("rig/profiles", ".dbc");
    corpus.extend(files("tests/recordings", ".dbc"));
    run("dbc_files", &corpus, 20, |input, chance| {
        let Ok(text) = std::str::from_utf8(input) else { return };
        for message in dbc::parse(text).into_iter().flatten() {
            for signal in message.1.signals.values() {
                let mut frame: [u8; 8] = std::array::from_fn(|_| chance.byte());
                let _ = signal.read(&frame);
                let _ = signal.write(&mut frame, f64::from(chance.byte()));
            }
        }
    });
}

/// A profile that is accepted decodes frames of any content and any length without harm.
#[test]
fn profiles() {
    let dbc = std::fs::read_to_string(file("rig/profiles/muprime-can.dbc")).unwrap();
    run("profiles", &files("rig/profiles", ".toml"), 20, |input, chance| {
        let Ok(text) = std::str::from_utf8(input) else { return };
        let Ok(profile) = Profile::parse_with(text, &|_| Some(dbc.clone())) else { return };
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
    });
}

/// Setups, plans, models and certificates: read, or refused with a message.
#[test]
fn configuration() {
    let mut corpus = files("rig/setups", ".toml");
    corpus.extend(files("rig/plans", ".toml"));
    corpus.extend(files("rig/fingertips", ".toml"));
    run("configuration", &corpus, 20, |input, _| {
        let Ok(text) = std::str::from_utf8(input) else { return };
        let refusals = [
            rig::setup::Setup::parse("fuzz", text, Path::new(".")).err(),
            rig::plan::Plan::parse("fuzz", text).err(),
            rig::model_file::load("fuzz", text).err(),
        ];
        for refusal in refusals.into_iter().flatten() {
            assert!(!format!("{refusal:?}").is_empty());
        }
        let _ = calibration::certificate::Certificate::from_toml(text);
    });
}

/// Tables of passes: whatever is read has finite numbers.
#[test]
fn tables() {
    let table = b"point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n\n\
                  1,0.0,2e-6,27500,0.02,1,0.0,0.25,0.11\n2,1.0,0,27500,0.02,-1,0.0,0.25,-0.125\n";
    run("tables", &[table.to_vec()], 4, |input, _| {
        for pass in models::record::read_passes(input).into_iter().flatten() {
            assert!(pass.normal_force_n.is_finite());
        }
    });
}

/// Bytes that are hardly a record are read without a panic, and what is recovered can be read again.
#[test]
fn records() {
    let mut whole = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::Writer::new(&mut whole).unwrap();
    let channel = writer.add_channel(0, "samples", "raw", &std::collections::BTreeMap::new()).unwrap();
    for i in 0..20_u32 {
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: i,
            log_time: u64::from(i),
            publish_time: u64::from(i),
        };
        writer.write_to_known_channel(&header, b"{\"a\":1.5}").unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    run("records", &[whole.into_inner()], 4, |input, _| {
        let before = realtime::recorder::read(input).messages.len();
        let mut out = std::io::Cursor::new(Vec::new());
        match realtime::recorder::recover(input, &mut out).unwrap() {
            Recovery::Rewritten { messages, .. } => {
                let after = realtime::recorder::read(out.get_ref());
                assert_eq!((messages, after.messages.len(), after.cut), (before, before, None));
            }
            Recovery::Whole | Recovery::Nothing { .. } => assert!(out.get_ref().is_empty()),
        }
    });
}
