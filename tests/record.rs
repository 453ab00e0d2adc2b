//! The record under abuse: cut at every byte, bits flipped.

use realtime::recorder::{self, Recovery};
use rig::plan::Plan;
use rig::session::{Job, Signals};
use rig::setup::Setup;
use std::io::Cursor;
use std::sync::{Arc, LazyLock};

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
    };
    job.run(&Signals::default(), &mut |_| {}).unwrap();
    std::fs::read(out.join("run-1.mcap")).unwrap()
});

fn bodies(bytes: &[u8]) -> Vec<Vec<u8>> {
    recorder::read(bytes).messages.into_iter().map(|m| m.2).collect()
}

/// Cuts at every `step`-th byte; each cut is recovered as well where `recover` says so.
fn cut(record: &[u8], step: usize, recover: bool) {
    let whole = bodies(record);
    let mut most = 0;
    for cut in (0..record.len()).step_by(step) {
        let read = bodies(&record[..cut]);
        assert!(read.len() >= most, "a longer file never tells less: cut at {cut}");
        most = read.len();
        assert!(read.iter().eq(whole.iter().take(read.len())), "cut at {cut}: not a prefix");
        if !recover {
            continue;
        }
        let mut repaired = Cursor::new(Vec::new());
        match recorder::recover(&record[..cut], &mut repaired).unwrap() {
            Recovery::Rewritten { .. } => assert_eq!(bodies(repaired.get_ref()), read, "cut at {cut}"),
            // All is there, and only the end mark was cut: or nothing is.
            Recovery::Whole | Recovery::Nothing { .. } => assert!(repaired.get_ref().is_empty()),
        }
    }
    println!("{} bytes, cut every {step}, {} messages", record.len(), whole.len());
}

/// The first rows of the sweep in a record of their own, flushed often, as a young record is.
fn short() -> Vec<u8> {
    let read = recorder::read(&RECORD);
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
    cut(&RECORD, (RECORD.len() / 12_000).max(1), false);
}

#[test]
fn recovered_files_are_whole_and_hold_what_was_readable() {
    for share in [0.2, 0.5, 0.7, 0.99] {
        let cut = &RECORD[..(RECORD.len() as f64 * share) as usize];
        let mut repaired = Cursor::new(Vec::new());
        let Recovery::Rewritten { messages, .. } = recorder::recover(cut, &mut repaired).unwrap() else {
            panic!("a cut file is not whole");
        };
        let repaired = repaired.into_inner();
        assert_eq!(recorder::recover(&repaired, Cursor::new(Vec::new())).unwrap(), Recovery::Whole);
        assert_eq!(bodies(&repaired), bodies(cut));
        assert_eq!(messages, bodies(cut).len());
        // An ordinary reader needs the summary: the crate's own finds it.
        assert!(mcap::Summary::read(&repaired).unwrap().is_some());
    }
    assert_eq!(recorder::recover(&RECORD, Cursor::new(Vec::new())).unwrap(), Recovery::Whole);
    assert!(matches!(recorder::recover(&[], Cursor::new(Vec::new())).unwrap(), Recovery::Nothing { .. }));
}

/// The index is this project's own work, read back from the file; here the MCAP library finds its way by it.
#[test]
fn an_ordinary_reader_finds_every_message_attachment_and_fact_by_the_index() {
    use mcap::sans_io::indexed_reader::{IndexedReadEvent, IndexedReader, IndexedReaderOptions, ReadOrder};
    for record in [RECORD.clone(), short()] {
        let read = recorder::read(&record);
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
        assert_eq!(found, read.messages);
        let facts = summary.metadata_indexes.iter().map(|i| mcap::read::metadata(&record, i).unwrap());
        assert!(facts.map(|m| (m.name, m.metadata)).eq(read.metadata));
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

#[test]
fn flipped_bits_never_give_a_silently_wrong_value() {
    let whole: std::collections::HashSet<Vec<u8>> = bodies(&RECORD).into_iter().collect();
    let mut bytes = RECORD.clone();
    let mut random = 0x9e37_79b9_7f4a_7c15u64;
    let mut noticed = 0;
    const FLIPS: usize = 4_000;
    for _ in 0..FLIPS {
        // SplitMix64 (Steele, Lea, Flood 2014): a fixed stream of places.
        random = random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        let (at, bit) = ((z >> 8) as usize % bytes.len(), (z & 7) as u8);
        bytes[at] ^= 1 << bit;
        let read = recorder::read(&bytes);
        noticed += usize::from(read.cut.is_some() || read.damaged > 0);
        for (_, _, body) in &read.messages {
            assert!(whole.contains(body), "byte {at} bit {bit}: a message that was never written");
        }
        bytes[at] ^= 1 << bit;
    }
    println!("{noticed} of {FLIPS} flips were noticed, none gave a wrong value");
}
