#![allow(clippy::disallowed_methods, reason = "waits for threads of the system")]

use super::*;
use models::{Condition, Pass};
use runs::job::{Signals, Update};
use runs::{Event, MeasuredPass};
use std::io::{Read, Write};
use std::os::unix::net::UnixStream;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

const SOON: Duration = Duration::from_secs(60);

fn run(folder: &Path) -> Run {
    Run {
        folder: folder.into(),
        plan: "p".into(),
        setup: "s".into(),
        model: "m".into(),
        operator: None,
        sample: None,
        started_unix_s: 0.0,
        fast: false,
        process: 1,
        planned: 9,
        made_before: 2,
        guards: Default::default(),
    }
}

fn pass(point: u64) -> MeasuredPass {
    let pass = Pass::at(point, &Condition::paper(), Some(-0.05));
    MeasuredPass {
        pass,
        reference: false,
        comparison: None,
        regime: None,
        psi_eq17: None,
        temperature_flags: Vec::new(),
        commanded_normal_force_n: None,
        levels: Vec::new(),
    }
}

/// A viewer's picture, once it is that of `done`.
fn seen(viewer: &mut Viewer, view: &mut View, done: impl Fn(&View) -> bool) {
    let began = Instant::now();
    while !done(view) {
        assert!(began.elapsed() < SOON, "{view:?}");
        match viewer.hear(Duration::from_millis(20)) {
            Received::Message(message) => view.take(*message),
            Received::Nothing => {}
            Received::Gone => panic!("the feed is gone: {view:?}"),
        }
    }
}

#[test]
fn whoever_comes_late_has_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let mut feed = Feed::new(run(folder.path()), vec![pass(1), pass(2)], &Signals::default());
    assert!(Viewer::connect(folder.path()).is_err(), "nothing was sent yet");
    feed.update(&Update::Event(&Event::Armed));
    let (mut early, mut view) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut early, &mut view, |view| view.events.len() == 1);
    feed.update(&Update::Pass(&pass(3)));
    feed.update(&Update::Progress(1, 7, 5.0));
    feed.update(&Update::Event(&Event::Paused { point: 4 }));
    seen(&mut early, &mut view, |view| view.paused);
    let (mut late, mut same) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut late, &mut same, |view| view.progress.made == 3);
    assert_eq!(view, same);
    assert_eq!(view.passes.iter().map(|p| p.pass.point).collect::<Vec<_>>(), [1, 2, 3]);
    feed.end(Ended { outcome: None, remedy: None, error: Some("x".into()), off: None, agreement: None });
    seen(&mut late, &mut same, |view| view.ended.is_some());
    assert_eq!(late.hear(SOON), Received::Gone);
    assert!(Viewer::connect(folder.path()).is_err(), "it is over");
}

#[test]
fn what_viewers_ask_is_heard_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let signals = Signals::default();
    let mut feed = Feed::new(run(folder.path()), Vec::new(), &signals);
    feed.update(&Update::Event(&Event::Armed));
    let heard = |what: &dyn Fn() -> bool| {
        let began = Instant::now();
        while !what() {
            assert!(began.elapsed() < SOON);
            std::thread::sleep(Duration::from_millis(5));
        }
    };
    let mut ask = Viewer::connect(folder.path()).unwrap().asking().unwrap();
    ask(Ask::Pause).unwrap();
    heard(&|| signals.paused.load(Ordering::Relaxed));
    ask(Ask::Resume).unwrap();
    heard(&|| !signals.paused.load(Ordering::Relaxed));
    for wrong in ["arm", "stop now", "STOP", &"x".repeat(1000)] {
        let mut stream = UnixStream::connect_addr(&place(folder.path()).unwrap()).unwrap();
        // It may be cut off in the middle.
        let _ = writeln!(stream, "{wrong}\npause");
    }
    std::thread::sleep(Duration::from_millis(200));
    assert!(!signals.paused.load(Ordering::Relaxed), "a viewer that says anything else is not heard again");
    assert_eq!(signals.stops.load(Ordering::Relaxed), 0);
    ask(Ask::Stop).unwrap();
    heard(&|| signals.stops.load(Ordering::Relaxed) == 1);
}

#[test]
fn a_viewer_that_reads_nothing_holds_nobody_up() {
    let folder = tempfile::tempdir().unwrap();
    let mut feed = Feed::new(run(folder.path()), Vec::new(), &Signals::default());
    feed.update(&Update::Event(&Event::Armed));
    let mut deaf = UnixStream::connect_addr(&place(folder.path()).unwrap()).unwrap();
    let (mut viewer, mut view) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut viewer, &mut view, |view| view.events.len() == 1);
    for point in 0..4000 {
        feed.update(&Update::Pass(&pass(point)));
        while view.passes.len() + 500 < point as usize {
            seen(&mut viewer, &mut view, |view| view.passes.len() + 500 >= point as usize);
        }
    }
    seen(&mut viewer, &mut view, |view| view.passes.len() == 4000);
    // It was disconnected: what the kernel holds for it comes, and then the end.
    deaf.set_read_timeout(Some(SOON)).unwrap();
    let mut held = Vec::new();
    deaf.read_to_end(&mut held).unwrap();
    assert!(held.len() < 2_000_000, "{} bytes were held for it", held.len());
}

/// Viewers that take a few bytes now and then: the end of the run waits for all of them together, and not for each of their lines.
#[test]
fn slow_viewers_hold_up_no_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut feed = Feed::new(run(folder.path()), Vec::new(), &Signals::default());
    feed.update(&Update::Event(&Event::Armed));
    for _ in 0..3 {
        let mut slow = UnixStream::connect_addr(&place(folder.path()).unwrap()).unwrap();
        std::thread::spawn(move || {
            let mut few = [0; 64];
            while slow.read(&mut few).is_ok_and(|count| count > 0) {
                std::thread::sleep(Duration::from_millis(100));
            }
        });
    }
    let (mut viewer, mut view) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut viewer, &mut view, |view| view.events.len() == 1);
    for point in 0..900 {
        feed.update(&Update::Pass(&pass(point)));
        while view.passes.len() + 300 < point as usize {
            seen(&mut viewer, &mut view, |view| view.passes.len() + 300 >= point as usize);
        }
    }
    let (done, over) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        feed.end(Ended { outcome: None, remedy: None, error: None, off: None, agreement: None });
        let _ = done.send(());
    });
    // The one that reads gets everything.
    seen(&mut viewer, &mut view, |view| view.ended.is_some());
    assert_eq!(view.passes.len(), 900);
    over.recv_timeout(Duration::from_secs(30)).expect("the end waits for slow viewers");
}

#[test]
fn a_drive_that_is_not_off_is_reported_before_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let mut feed = Feed::new(run(folder.path()), Vec::new(), &Signals::default());
    feed.update(&Update::Off(&runs::supervisor::OffReport::off()));
    feed.update(&Update::Event(&Event::Armed));
    let (mut viewer, mut view) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut viewer, &mut view, |view| view.events.len() == 1);
    assert_eq!(view.not_off, None);
    let not_off = runs::supervisor::NotOff { instrument: "x".into(), drives: true, why: "silent".into() };
    let off = runs::supervisor::OffReport { read_back: false, not_read_back: vec![not_off] };
    feed.update(&Update::Off(&off));
    seen(&mut viewer, &mut view, |view| view.not_off.is_some());
    assert_eq!(view.not_off, Some(off.words()));
    let (mut late, mut same) = (Viewer::connect(folder.path()).unwrap(), View::default());
    seen(&mut late, &mut same, |view| view.not_off.is_some());
}
