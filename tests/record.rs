//! The record under abuse: cut at every byte, bits flipped.

use realtime::recorder::{self, Integrity, Recovery};
use runs::{Job, Plan, Setup, Signals};
use std::io::Cursor;
use std::sync::{Arc, LazyLock};
use tests::contents::{Contents, read};

/// A small record of a real sweep in virtual time.
static RECORD: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = "name = \"tiny\"\nreference_every = 0\ndirections = [1]\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n\
                [base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n\
                [[series]]\namplitude_pp_m = [0.0]\n";
    let model = Arc::new(models::prediction::SpringSlider::new(setup.tip.finger).unwrap());
    let out = folder.path().join("run");
    let job = Job {
        setup,
        plan: Plan::parse("tiny", plan).unwrap(),
        seed: 1,
        model,
        model_file: None,
        defects: None,
        out: out.clone(),
        fast: true,
        notes: Default::default(),
        answers: None,
    };
    rig::wall_clock_run::run(job, &Signals::default(), &mut |_| {}).unwrap();
    std::fs::read(out.join("run-1.mcap")).unwrap()
});

fn bodies(bytes: &[u8]) -> Vec<Vec<u8>> {
    read(bytes).messages.into_iter().map(|m| m.2).collect()
}

fn recovered(bytes: &[u8]) -> (Recovery, Vec<u8>) {
    let mut repaired = Cursor::new(Vec::new());
    let found = recorder::recover(Cursor::new(bytes), &mut repaired).unwrap();
    (found, repaired.into_inner())
}

/// Cuts at every `step`-th byte; each cut is recovered as well where `recover` says so.
fn cut(record: &[u8], step: usize, recover: bool) {
    let whole = bodies(record);
    let mut most = 0;
    for cut in (0..record.len()).step_by(step) {
        let read = read(&record[..cut]);
        let found = read.integrity;
        assert!(found.cut.is_some() && !found.sentences().is_empty(), "cut at {cut}: said to be whole");
        assert!(found.missing.is_empty(), "cut at {cut}: nothing is known of what followed");
        let read: Vec<Vec<u8>> = read.messages.into_iter().map(|m| m.2).collect();
        assert!(read.len() >= most, "a longer file never tells less: cut at {cut}");
        most = read.len();
        assert!(read.iter().eq(whole.iter().take(read.len())), "cut at {cut}: not a prefix");
        if !recover {
            continue;
        }
        match recovered(&record[..cut]) {
            (Recovery::Rewritten { .. }, repaired) => {
                assert_eq!(bodies(&repaired), read, "cut at {cut}");
                let after = tests::contents::read(&repaired).integrity;
                assert!(
                    after.intact() && after.recovered.is_some() && !tests::contents::complete(&after),
                    "cut at {cut}"
                );
            }
            (Recovery::Nothing { .. }, repaired) => assert!(repaired.is_empty()),
            (Recovery::Whole(_), _) => panic!("cut at {cut}: said to be whole"),
        }
    }
    println!("{} bytes, cut every {step}, {} messages", record.len(), whole.len());
}

/// The first rows of the sweep in a record of their own, flushed often, as a young record is.
fn short() -> Vec<u8> {
    let read = read(&RECORD);
    let preamble = recorder::Preamble {
        start_unix_ns: 5,
        facts: [("plan".to_string(), "tiny".to_string())].into(),
        files: vec![("plan.toml".to_string(), "name = \"tiny\"\n".repeat(20))],
    };
    let mut out = Cursor::new(Vec::new());
    let mut recorder = recorder::Recorder::begin(&mut out, preamble).unwrap();
    for (i, row) in read.rows().take(30).enumerate() {
        recorder.row(&row).unwrap();
        if i % 7 == 6 {
            recorder.flush().unwrap();
        }
    }
    recorder.end([("outcome".to_string(), "cut".to_string())].into()).unwrap();
    out.into_inner()
}

#[test]
fn a_short_record_cut_at_every_byte_is_read_up_to_the_cut_and_recovered() {
    let record = short();
    assert!(bodies(&record).len() >= 30);
    cut(&record, 1, true);
}

#[test]
fn a_whole_sweep_cut_at_thousands_of_bytes_is_read_up_to_the_cut() {
    assert!(bodies(&RECORD).len() > 500);
    cut(&RECORD, (RECORD.len() / tests::rounds(4_000, 12_000)).max(1), false);
}

#[test]
fn recovered_files_are_whole_and_hold_what_was_readable() {
    for share in [0.2, 0.5, 0.7, 0.99] {
        let cut = &RECORD[..(RECORD.len() as f64 * share) as usize];
        let (Recovery::Rewritten { messages, .. }, repaired) = recovered(cut) else {
            panic!("a cut file is not whole");
        };
        assert!(matches!(recovered(&repaired).0, Recovery::Whole(_)));
        assert_eq!(bodies(&repaired), bodies(cut));
        assert_eq!(messages, bodies(cut).len());
        // An ordinary reader needs the summary: the crate's own finds it.
        assert!(mcap::Summary::read(&repaired).unwrap().is_some());
    }
    assert_eq!(recovered(&RECORD).0, Recovery::Whole(Integrity::default()));
    assert!(matches!(recovered(&[]).0, Recovery::Nothing { .. }));
}

/// The index is this project's own work, read back from the file; here the MCAP library finds its way by it.
#[test]
fn an_ordinary_reader_finds_every_message_attachment_and_fact_by_the_index() {
    use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions, ReadOrder};
    for record in [RECORD.clone(), short()] {
        let read = read(&record);
        let summary = mcap::Summary::read(&record).unwrap().unwrap();
        let options = IndexedReaderOptions::new().with_order(ReadOrder::File);
        let mut reader = IndexedReader::new_with_options(&summary, options).unwrap();
        let mut found = Vec::new();
        while let Some(event) = reader.next_event() {
            match event.unwrap() {
                IndexedReadEvent::ReadChunkRequest { offset, length } => {
                    let chunk = &record[offset as usize..offset as usize + length];
                    reader.insert_chunk_record_data(offset, chunk).unwrap();
                }
                IndexedReadEvent::Message { header, data } => {
                    let topic = summary.channels[&header.channel_id].topic.clone();
                    found.push((topic, header.log_time, data.to_vec()));
                }
            }
        }
        assert!(
            found
                .iter()
                .map(|m| (m.0.as_str(), m.1, &m.2))
                .eq(read.messages.iter().map(|m| (m.0, m.1, &m.2)))
        );
        let facts = summary.metadata_indexes.iter().map(|i| mcap::read::metadata(&record, i).unwrap());
        let facts = facts.map(|mut m| {
            assert!(m.metadata.remove(recorder::CHECKSUM).is_some());
            (m.name, m.metadata)
        });
        assert!(facts.eq(read.metadata));
        let files = summary.attachment_indexes.iter().map(|i| mcap::read::attachment(&record, i).unwrap());
        assert!(files.map(|a| (a.name, a.data.into_owned())).eq(read.files.iter().cloned()));
        let stats = summary.stats.unwrap();
        assert_eq!(stats.message_count, read.messages.len() as u64);
        assert_eq!(stats.chunk_count as usize, summary.chunk_indexes.len());
        let times = || read.messages.iter().map(|m| m.1);
        assert_eq!(Some(stats.message_start_time), times().min());
        assert_eq!(Some(stats.message_end_time), times().max());
        for (channel, count) in stats.channel_message_counts {
            let topic = &summary.channels[&channel].topic;
            assert_eq!(count, read.messages.iter().filter(|m| m.0 == *topic).count() as u64);
        }
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014): a fixed stream of places.
struct Places(u64);

impl Places {
    fn next(&mut self, below: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 8) as usize % below
    }
}

/// What a damaged record must still be: damage is said, nothing is invented, and what is known to be missing
/// is as much as was lost.
fn judged(damaged: &[u8], whole: &Contents, what: &dyn Fn() -> String) -> Contents {
    let read = read(damaged);
    assert!(
        !tests::contents::complete(&read.integrity) && !read.integrity.sentences().is_empty(),
        "{}: said to be whole",
        what()
    );
    let mut expected = whole.messages.iter();
    for message in &read.messages {
        assert!(expected.any(|m| m == message), "{}: a message that was never written", what());
    }
    for (name, facts) in &read.metadata {
        assert!(
            whole.metadata.iter().any(|(n, f)| (n, f) == (name, facts)),
            "{}: a fact was invented",
            what()
        );
    }
    for file in &read.files {
        assert!(whole.files.contains(file), "{}: a file was invented", what());
    }
    if read.integrity.cut.is_none() && read.facts(recorder::TRAILER).is_some() {
        let missing: u64 = read.integrity.missing.values().sum();
        let lost = (whole.messages.len() - read.messages.len()) as u64;
        assert_eq!(missing, lost, "{}: {:?}", what(), read.integrity);
    }
    read
}

/// Messages of the largest chunk and of the whole.
fn chunk_of(record: &[u8]) -> usize {
    let read = read(record);
    let most = mcap::Summary::read(record).unwrap().unwrap().chunk_indexes.len();
    // Chunks hold equal shares but for the first and the last: four of them are bounded by this.
    4 * read.messages.len().div_ceil(most)
}

/// How many: 1,000, or 3,000 in `tests/run long`; `MUPRIME_DAMAGES` makes more: 100,000 of each take some
/// minutes.
fn damages() -> usize {
    let few = tests::rounds(1_000, 3_000);
    std::env::var("MUPRIME_DAMAGES").map_or(few, |n| n.parse().expect("MUPRIME_DAMAGES is a count"))
}

#[test]
fn one_flipped_bit_anywhere_is_said_and_costs_one_chunk_at_most() {
    let whole = read(&RECORD);
    assert!(tests::contents::complete(&whole.integrity));
    let (mut bytes, mut places, chunk) = (RECORD.clone(), Places(1), chunk_of(&RECORD));
    for _ in 0..damages() {
        let (at, bit) = (places.next(bytes.len()), places.next(8));
        bytes[at] ^= 1 << bit;
        let read = judged(&bytes, &whole, &|| format!("byte {at} bit {bit}"));
        assert!(
            whole.messages.len() - read.messages.len() <= chunk,
            "byte {at} bit {bit}: {} messages are gone with one bit",
            whole.messages.len() - read.messages.len()
        );
        bytes[at] ^= 1 << bit;
    }
    println!("{} flipped bits in {} bytes: each was said", damages(), bytes.len());
}

#[test]
fn every_byte_of_a_short_record_is_watched() {
    let record = short();
    let whole = read(&record);
    let mut bytes = record.clone();
    // By default one bit of each byte, another from byte to byte; all eight in `tests/run long`.
    for at in 0..record.len() {
        for bit in (0..8).map(|bit| (at + bit) % 8).take(tests::rounds(1, 8)) {
            bytes[at] ^= 1 << bit;
            judged(&bytes, &whole, &|| format!("byte {at} bit {bit}"));
            bytes[at] ^= 1 << bit;
        }
    }
    println!("{} bytes, each was said", record.len());
}

#[test]
fn holes_and_cuts_are_said_and_every_chunk_outside_of_them_is_kept() {
    let whole = read(&RECORD);
    let (mut places, chunk) = (Places(2), chunk_of(&RECORD));
    let mut kept = 0;
    for n in 0..damages() / 10 {
        let (from, length) = (places.next(RECORD.len()), 1 + places.next(20_000));
        let to = RECORD.len().min(from + length);
        let mut bytes = RECORD.clone();
        // A hole of zeros, or of noise, or bytes that are gone, or bytes too many.
        match n % 4 {
            0 => bytes[from..to].fill(0),
            1 => bytes[from..to].iter_mut().for_each(|b| *b = places.next(256) as u8),
            2 => drop(bytes.drain(from..to)),
            _ => drop(
                bytes.splice(from..from, (0..length).map(|_| places.next(256) as u8).collect::<Vec<_>>()),
            ),
        }
        if bytes == *RECORD {
            continue;
        }
        let read = judged(&bytes, &whole, &|| format!("damage {n} from {from} to {to}"));
        // What is lost is what the stretch held, and the chunks that it began and ended in.
        let share = whole.messages.len() * (to - from) / RECORD.len();
        let lost = whole.messages.len() - read.messages.len();
        assert!(lost <= 2 * share + 2 * chunk, "damage {n} from {from} to {to}: {lost} messages are gone");
        kept += read.messages.len();
        let (found, repaired) = recovered(&bytes);
        match found {
            Recovery::Rewritten { messages, .. } => {
                assert_eq!(messages, read.messages.len());
                let after = tests::contents::read(&repaired);
                assert_eq!(after.messages, read.messages);
                assert_eq!(after.integrity.missing, read.integrity.missing, "what is missing stays known");
                assert!(after.integrity.intact() && !tests::contents::complete(&after.integrity));
            }
            other => panic!("damage {n} from {from} to {to}: {other:?}"),
        }
    }
    assert!(kept > 0);
}

/// The checksum of the data is this project's own work too: the MCAP library agrees with it.
#[test]
fn an_ordinary_reader_agrees_with_every_checksum() {
    use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
    use std::io::Read;
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut bytes = &RECORD[..];
    let mut records = 0;
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let read = bytes.read(reader.insert(wanted)).unwrap();
                reader.notify_read(read);
            }
            LinearReadEvent::Record { .. } => records += 1,
        }
    }
    assert!(records > 500);
}
