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

#[test]
fn cut_at_every_byte_nothing_panics_and_what_is_read_is_a_prefix() {
    let whole = bodies(&RECORD);
    assert!(whole.len() > 500);
    let mut most = 0;
    let step = (RECORD.len() / 12_000).max(1);
    for cut in (0..RECORD.len()).step_by(step) {
        let read = bodies(&RECORD[..cut]);
        assert!(read.len() >= most, "a longer file never tells less: cut at {cut}");
        most = read.len();
        assert!(read.iter().eq(whole.iter().take(read.len())), "cut at {cut}: not a prefix");
    }
    assert_eq!(bodies(&RECORD).len(), whole.len());
    println!("{} bytes, cut every {step}, {} messages", RECORD.len(), whole.len());
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
