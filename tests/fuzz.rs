//! Damaged input for everything that reads: decoders of every bus, configuration, tables, records.
//!
//! Each target takes a committed corpus (`tests/fuzz/*.hex`, and the project's own configuration files) and
//! mutates it from a fixed seed. It holds more than 'no panic': each states what must be true of whatever
//! comes out. `MUPRIME_FUZZ_CASES` sets the cases a target, `MUPRIME_FUZZ_SEED` the seed; an input that fails
//! is printed in hexadecimal, to be added to the corpus. The mutations know nothing of coverage: this finds
//! shallow defects quickly and deep ones slowly. The same targets, guided by coverage, are in `fuzz/` (see
//! its README); `MUPRIME_FUZZ_SEEDS=FOLDER` writes the corpus as they want it.

#[path = "fuzz/chance.rs"]
mod chance;
#[path = "fuzz/configuration.rs"]
mod configuration;
#[path = "fuzz/decoders.rs"]
mod decoders;
#[path = "fuzz/imports.rs"]
mod imports;
#[path = "fuzz/records.rs"]
mod records;

use chance::Chance;
use instruments::codec::from_hex;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use tests::file;

fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name)
        .map_or(otherwise, |text| text.parse().unwrap_or_else(|_| panic!("{name} is not a number")))
}

/// The byte corpus of that name.
fn bytes(name: &str) -> Vec<Vec<u8>> {
    let text = std::fs::read_to_string(file("tests/fuzz").join(name)).unwrap();
    let lines = text.lines().filter(|line| !line.starts_with('#') && !line.is_empty());
    lines
        .map(|line| from_hex(line).unwrap_or_else(|| panic!("{name}: {line} is not a hexadecimal")))
        .collect()
}

/// The files of a folder that end so.
fn files(folder: &str, end: &str) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(file(folder)).unwrap().map(|entry| entry.unwrap().path());
    let mut paths: Vec<_> = entries.filter(|path| path.to_string_lossy().ends_with(end)).collect();
    paths.sort();
    assert!(!paths.is_empty(), "no {end} in {folder}");
    paths.iter().map(|path| std::fs::read(path).unwrap()).collect()
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

/// Writes an input as a coverage-guided target reads it: which of its functions, the seed of its choices, the bytes.
fn seed(folder: &str, target: &str, which: usize, i: usize, input: &[u8]) {
    let folder = std::path::Path::new(folder).join(target);
    std::fs::create_dir_all(&folder).unwrap();
    let head = [u8::try_from(which).unwrap(), 0, 0, 0, 0, 0, 0, 0, 1];
    std::fs::write(folder.join(format!("seed-{which}-{i:02}")), [&head[..], input].concat()).unwrap();
}

/// Runs one function of a target over its corpus and over mutations of it; `share` of the cases are enough for slow ones.
fn run(target: &str, all: &[(&str, fn(&[u8], &mut Chance))], name: &str, corpus: &[Vec<u8>], share: u64) {
    let which = all.iter().position(|(n, _)| *n == name).unwrap();
    let held = all[which].1;
    if let Ok(folder) = std::env::var("MUPRIME_FUZZ_SEEDS") {
        corpus.iter().enumerate().for_each(|(i, input)| seed(&folder, target, which, i, input));
    }
    let seed = setting("MUPRIME_FUZZ_SEED", 1);
    let cases = setting("MUPRIME_FUZZ_CASES", 20_000) / share;
    let mut chance = Chance(seed);
    for case in 0..corpus.len() as u64 + cases {
        let input = match corpus.get(usize::try_from(case).unwrap()) {
            Some(whole) => whole.clone(),
            None => mutated(corpus, &mut chance),
        };
        if let Err(panic) = catch_unwind(AssertUnwindSafe(|| held(&input, &mut chance))) {
            let hex: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
            eprintln!("{name}: seed {seed}, case {case}, input {hex}");
            resume_unwind(panic);
        }
    }
    println!("{name}: {} inputs and {cases} mutations, seed {seed}", corpus.len());
}

fn decoder(name: &str, corpus: &[Vec<u8>], share: u64) {
    run("decoders", decoders::ALL, name, corpus, share);
}

#[test]
fn modbus_rtu() {
    decoder("modbus_rtu", &bytes("rtu.hex"), 1);
}

#[test]
fn slcan() {
    decoder("slcan", &bytes("slcan.hex"), 1);
}

#[test]
fn streams() {
    decoder("streams", &bytes("stream.hex"), 1);
}

#[test]
fn canopen_service_data() {
    decoder("canopen", &bytes("canopen.hex"), 1);
}

#[test]
fn numbers_in_text() {
    decoder("numbers_in_text", &bytes("text.hex"), 1);
}

#[test]
fn dbc_files() {
    let mut corpus = files("drivers/profiles", ".dbc");
    corpus.extend(files("tests/recordings", ".dbc"));
    decoder("dbc_files", &corpus, 20);
}

/// Objects of any data sheet that is accepted can be asked for their process data.
#[test]
fn data_sheets() {
    decoder("data_sheets", &files("drivers/profiles", ".eds"), 20);
}

#[test]
fn profiles() {
    decoder("profiles", &files("drivers/profiles", ".toml"), 20);
}

#[test]
fn setups_plans_models_and_certificates() {
    let mut corpus = files("runs/setups", ".toml");
    corpus.extend(files("runs/plans", ".toml"));
    corpus.extend(files("runs/fingertips", ".toml"));
    run("configuration", configuration::ALL, "configuration", &corpus, 20);
}

/// A damaged certificate is refused, or says what the sound one said: the sum over its contents sees to that.
#[test]
fn certificates() {
    let corpus = files("tests/fuzz/certificates", ".toml");
    assert_eq!(corpus.len(), configuration::SOUND.len());
    // The sound ones are taken: else the target would hold of anything.
    for bytes in &corpus {
        assert!(configuration::taken(std::str::from_utf8(bytes).unwrap()));
    }
    run("configuration", configuration::ALL, "certificates", &corpus, 20);
}

#[test]
fn tables() {
    let table = b"point,time_s,amplitude_pp_m,frequency_hz,speed_m_s,direction,position_m,normal_force_n,lateral_force_n\n\
                  1,0.0,2e-6,27500,0.02,1,0.0,0.25,0.11\n2,1.0,0,27500,0.02,-1,0.0,0.25,-0.125\n";
    run("records", records::ALL, "tables", &[table.to_vec()], 4);
}

#[test]
fn whole_records() {
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
    run("records", records::ALL, "records", &[whole.into_inner()], 4);
}

/// Foreign tables: the readers of several libraries and our own.
#[test]
fn imports_of_text() {
    let corpus = [files("tests/foreign/seeds", ".csv"), files("tests/foreign/seeds", ".txt")].concat();
    run("imports", imports::ALL, "texts", &corpus, 20);
}

#[test]
fn imports_of_binaries() {
    let ends = [".xlsx", ".parquet", ".arrow", ".npy", ".mat", ".h5"];
    let corpus: Vec<Vec<u8>> = ends.iter().flat_map(|end| files("tests/foreign/seeds", end)).collect();
    run("imports", imports::ALL, "binaries", &corpus, 20);
}
