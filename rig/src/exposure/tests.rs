use super::*;

/// A folder as `/var/tmp` is, gone with the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("muprime-exposure-{}-{name}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o1777)).unwrap();
        Folder(path)
    }

    fn open(&self) -> miette::Result<Ledger> {
        self.of(&["tcp/a"])
    }

    fn of(&self, known: &[&str]) -> miette::Result<Ledger> {
        let known: Vec<String> = known.iter().map(ToString::to_string).collect();
        Ledger::open_in(&self.0, &known, &limits())
    }

    fn file(&self) -> PathBuf {
        std::fs::read_dir(&self.0).unwrap().next().unwrap().unwrap().path()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn limits() -> Limits {
    Limits::paper(Nanos(1_000_000)).checked().unwrap()
}

const SECOND: u64 = 1_000_000_000;
const AHEAD_NS: u64 = AHEAD.as_nanos() as u64;

/// Time driven in the last hour and its dose, as the loop would take them over.
fn last_hour(ledger: &Ledger) -> (u64, f64) {
    ledger.exposed().parts.iter().fold((0, 0.0), |(time, dose), (t, d)| (time + t.0, dose + d))
}

/// Waits until it is so, for as long as a slow machine may take.
fn soon(is_so: impl Fn() -> bool) {
    let pauses = (0..12_000).take_while(|_| !is_so()).map(|_| std::thread::sleep(Duration::from_millis(5)));
    assert!(pauses.count() < 12_000, "never");
}

/// Waits for two entries: the second one holds all that was driven before.
fn written_twice(keeping: &Keeping) {
    for _ in 0..2 {
        let before = keeping.state.written_ns.load(Ordering::Relaxed);
        soon(|| keeping.state.written_ns.load(Ordering::Relaxed) != before);
    }
}

/// A loop that drove for so long, and lives until its ledger has noticed.
fn driven(ledger: Ledger, seconds: u64, dose_m2_s: f64) -> Keeping {
    let life = Arc::new(Lifeline::default());
    let keeping = ledger.keep(Arc::clone(&life), || panic!("it can be written")).unwrap();
    life.driven_ns.store(seconds * SECOND, Ordering::Relaxed);
    life.dose_bits.store(dose_m2_s.to_bits(), Ordering::Relaxed);
    written_twice(&keeping);
    assert!(keeping.holds());
    keeping
}

#[test]
fn what_one_run_drove_the_next_one_knows() {
    let folder = Folder::new("next");
    let first = folder.open().unwrap();
    assert!(first.exposed().is_none(), "{:?}", first.exposed());
    driven(first, 100, 2.5).end(true);
    let second = folder.open().unwrap();
    assert_eq!(last_hour(&second), (100 * SECOND, 2.5));
    assert_eq!(second.exposed().in_one_go, Nanos(100 * SECOND));
    // It was not driven in this one.
    driven(second, 0, 0.0).end(true);
    let third = folder.open().unwrap();
    assert_eq!(last_hour(&third), (100 * SECOND, 2.5));
    assert!(third.exposed().resting >= Nanos(SECOND), "{:?}", third.exposed());
}

/// One amplifier in three setups, with no serial number and with two: whatever a file calls it, the worst holds. So does a person's.
#[test]
fn every_identity_counts_and_the_worst_holds() {
    let folder = Folder::new("identities");
    driven(folder.of(&["tcp/a", "person/x"]).unwrap(), 100, 2.5).end(true);
    driven(folder.of(&["tcp/a", "serial/1"]).unwrap(), 50, 1.0).end(true);
    let found = |known: &[&str]| {
        let mut ledger = folder.of(known).unwrap();
        ledger.write().unwrap();
        last_hour(&ledger)
    };
    for known in [&["tcp/a", "serial/2"][..], &["serial/2", "tcp/a"], &["serial/1", "tcp/a"]] {
        assert_eq!(found(known), (150 * SECOND, 3.5), "{known:?}");
    }
    // The same amplifier at another address, and the same person at another amplifier.
    assert_eq!(found(&["tcp/b", "serial/1"]).0, 50 * SECOND);
    assert_eq!(found(&["tcp/c", "person/x"]).0, 100 * SECOND);
    let left = Left::of(&limits(), &folder.of(&["tcp/a"]).unwrap().exposed());
    assert_eq!((left.hour_s, left.dose_m2_s, left.in_one_go_s), (750.0, 21.5, 0.0));
}

/// Two runs that vibrate one person at a time would each know of half of it.
#[test]
fn one_person_is_in_one_run_at_a_time() {
    let folder = Folder::new("two");
    let first = folder.of(&["tcp/a", "person/x"]).unwrap();
    let refused = format!("{:?}", folder.of(&["tcp/b", "person/x"]).err());
    assert!(refused.contains("'x' is in another run on this machine"), "{refused}");
    folder.of(&["tcp/b", "person/y"]).unwrap();
    drop(first);
    folder.of(&["tcp/b", "person/x"]).unwrap();
}

/// An hour that is used up is refused before anybody waits at the rig, with the book that says so.
#[test]
fn an_hour_that_is_used_up_is_refused_with_its_numbers() {
    let folder = Folder::new("hour");
    driven(folder.of(&["tcp/a", "person/x"]).unwrap(), 900, 2.5).end(true);
    // The second refusal has the same numbers: the first one charged nobody.
    for _ in 0..2 {
        let refused = format!("{:?}", folder.of(&["tcp/a", "person/y"]).err());
        assert!(refused.contains("'tcp/a' was driven for 900 s of the last hour"), "{refused}");
        assert!(refused.contains("900 s and 25.0 m2/s are allowed"), "{refused}");
    }
    assert_eq!(last_hour(&folder.of(&["tcp/b", "person/y"]).unwrap()), (0, 0.0));
}

/// What others may write, or what is another's under this user's name, is not a ledger; what other users
/// drove is added.
#[test]
fn nobody_else_can_write_a_ledger_and_what_others_drove_counts() {
    let folder = Folder::new("users");
    driven(folder.open().unwrap(), 100, 2.5).end(true);
    let own = folder.file();
    assert_eq!(own.metadata().unwrap().permissions().mode() & 0o777, 0o644);
    std::fs::set_permissions(&own, Permissions::from_mode(0o666)).unwrap();
    assert!(format!("{:?}", folder.open().err()).contains("its owner alone can write"));
    std::fs::set_permissions(&own, Permissions::from_mode(0o644)).unwrap();
    // A file in another user's name that is not that user's: nobody knows what it leaves out.
    let name = own.file_name().unwrap().to_string_lossy().into_owned();
    let (stem, _) = name.rsplit_once('-').unwrap();
    let other = folder.0.join(format!("{stem}-65534.exposure"));
    std::fs::copy(&own, &other).unwrap();
    assert!(format!("{:?}", folder.open().err()).contains("no human finger"));
    // SAFETY: a path that is a string without zeros.
    let theirs = unsafe {
        let path = std::ffi::CString::new(other.as_os_str().as_encoded_bytes()).unwrap();
        libc::chown(path.as_ptr(), 65534, 65534) == 0
    };
    if theirs {
        assert_eq!(last_hour(&folder.open().unwrap()), (200 * SECOND, 5.0));
    }
}

/// A program that is killed writes no last entry: what it drove is charged, and what it might have driven.
#[test]
fn a_killed_run_is_charged_too_much_and_never_too_little() {
    let folder = Folder::new("killed");
    // What a killed program leaves behind: its files, without their locks.
    let left = Folder::new("left");
    let running = driven(folder.open().unwrap(), 100, 2.5);
    std::fs::copy(folder.file(), left.0.join(folder.file().file_name().unwrap())).unwrap();
    running.end(true);
    let (time, dose) = last_hour(&left.open().unwrap());
    assert_eq!(time, 100 * SECOND + AHEAD_NS);
    assert!(dose > 2.5, "{dose}");
    // Neither is one whose drive was not read back off.
    let folder = Folder::new("on");
    driven(folder.open().unwrap(), 100, 2.5).end(false);
    assert_eq!(last_hour(&folder.open().unwrap()).0, 100 * SECOND + AHEAD_NS);
}

#[test]
fn a_damaged_ledger_refuses_the_finger_and_a_torn_entry_does_not() {
    let folder = Folder::new("damaged");
    driven(folder.open().unwrap(), 100, 2.5).end(true);
    let path = folder.file();
    let good = std::fs::read(&path).unwrap();
    assert_eq!(good.len(), 2 * PLACE);
    let number = |place| read_place(&File::open(&path).unwrap(), place).unwrap().number;
    let newest = usize::from(number(1) > number(0));
    for place in [0, 1] {
        let mut torn = good.clone();
        torn[place * PLACE + 200] ^= 1;
        std::fs::write(&path, &torn).unwrap();
        let (time, _) = last_hour(&folder.open().unwrap());
        // The older entry is ahead of what was driven then.
        assert!(time >= if place == newest { AHEAD_NS } else { 100 * SECOND }, "{place}: {time}");
    }
    for damaged in [vec![0; good.len()], good[..100].to_vec(), b"nothing of the kind".to_vec()] {
        std::fs::write(&path, &damaged).unwrap();
        let why = format!("{:?}", folder.open().err().expect("refused"));
        assert!(why.contains("no human finger") && why.contains("damaged") && why.contains("hour"), "{why}");
        assert_eq!(std::fs::read(&path).unwrap(), damaged, "nothing is repaired silently");
    }
}

#[test]
fn a_ledger_that_cannot_be_kept_refuses_the_finger_or_stops_the_rig() {
    let folder = Folder::new("unwritable");
    let ledger = folder.open().unwrap();
    let path = folder.file();
    let stopped = Arc::new(AtomicBool::new(false));
    let stop = Arc::clone(&stopped);
    let keeping = ledger.keep(Arc::default(), move || stop.store(true, Ordering::Relaxed)).unwrap();
    // Removed in mid-run: the next run would know nothing.
    std::fs::remove_file(&path).unwrap();
    soon(|| stopped.load(Ordering::Relaxed));
    assert!(stopped.load(Ordering::Relaxed) && !keeping.holds());
    // No plain file, and a folder that is not shared.
    std::fs::create_dir(&path).unwrap();
    assert!(format!("{:?}", folder.open().err()).contains("no human finger"));
    std::fs::remove_dir(&path).unwrap();
    std::fs::set_permissions(&folder.0, std::fs::Permissions::from_mode(0o755)).unwrap();
    assert!(format!("{:?}", folder.open().err()).contains("1777"));
}

#[test]
fn a_restart_of_the_machine_forgets_nothing() {
    let minute = |n: u64| n * MINUTE_NS;
    let mut entry = Account { boot: "one".into(), until_ns: minute(100), ..Account::default() };
    entry.add(90 * SECOND, 1.0, Nanos(60 * SECOND), minute(110));
    let moved = entry.clone().moved_to("two");
    // All of it was before the start; ten minutes later all of it counts, an hour later none.
    for (now, time) in [(0, 90), (10, 90), (59, 90), (62, 0)] {
        let mut later = moved.clone();
        later.add(0, 0.0, Nanos(60 * SECOND), minute(now));
        let counted: u64 = later.exposed(minute(now)).parts.iter().map(|(time, _)| time.0).sum();
        assert_eq!(counted, time * SECOND, "{now} min after the start");
        assert_eq!(later.in_one_go_ns > 0, now == 0, "a rest is what is known to be over");
    }
    assert_eq!(entry.clone().moved_to("one"), entry);
}
