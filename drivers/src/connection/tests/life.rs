//! The life of a link whose conversations a test leads: threads and pauses are real, the wire is not needed.
//!
//! Pauses are checked from below; from above only to separate a pause of seconds from none.

use super::super::*;
use super::PATIENCE;
use crate::endpoint::Due;
use crate::endpoint::tests::{on, show};
use crate::ports::AmplifierPort;
use crate::{InstrumentSetup, profile};
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

fn io(text: &str) -> LinkError {
    LinkError::from(std::io::Error::other(text))
}

/// What a conversation does: the so manieth, from 1.
type Script = dyn FnMut(usize, &mut Connection) -> LinkError + Send;

/// A link on its thread.
struct Link {
    stop: Arc<AtomicBool>,
    opened: Receiver<Result<(), LinkError>>,
    port: Arc<Mutex<AmplifierPort>>,
    /// When each conversation began and ended.
    times: Arc<Mutex<Vec<(Instant, Instant)>>>,
    health: Arc<crate::Health>,
    closed: Receiver<Closed>,
}

impl Link {
    /// An amplifier's link with such pauses in ms.
    fn start(first_ms: u32, longest_ms: u32, mut script: Box<Script>) -> Self {
        let mut profile = profile("muprime-amplifier").unwrap();
        let link = &mut profile.description.link;
        (link.backoff_first_ms, link.backoff_longest_ms) = (first_ms, longest_ms);
        let setup = InstrumentSetup::new("muprime-amplifier", "");
        let (endpoint, port) = Endpoint::amplifier(profile, &setup).unwrap();
        let (health, stop) = (endpoint.health(), Arc::<AtomicBool>::default());
        let (ready, opened) = sync_channel(4);
        let times = Arc::new(Mutex::new(Vec::new()));
        let log = Arc::clone(&times);
        let connection = Connection::new(endpoint, Instant::now(), Arc::clone(&stop), ready);
        let thread = connection
            .spawn(move |connection| {
                let (began, number) = (Instant::now(), log.lock().unwrap().len() + 1);
                log.lock().unwrap().push((began, began));
                let ended = std::panic::catch_unwind(AssertUnwindSafe(|| script(number, connection)));
                log.lock().unwrap()[number - 1].1 = Instant::now();
                ended.map_or_else(|cause| std::panic::resume_unwind(cause), Err)
            })
            .unwrap();
        let (done, closed) = sync_channel(1);
        std::thread::spawn(move || done.send(thread.join().unwrap()));
        Self { stop, opened, port: Arc::new(Mutex::new(port)), times, health, closed }
    }

    fn closed(&self) -> Closed {
        self.closed.recv_timeout(PATIENCE).expect("it goes on and on")
    }

    /// The pause before the so manieth conversation.
    fn pause_before(&self, number: usize) -> Duration {
        let times = self.times.lock().unwrap();
        times[number - 1].0 - times[number - 2].1
    }

    fn conversations(&self) -> usize {
        self.times.lock().unwrap().len()
    }
}

/// A conversation that works: it gives a sample, which shows whether the output is on.
fn works(number: usize, connection: &mut Connection, on: bool) {
    connection.tell(Ok(()));
    let arrived = connection.now().0;
    show(&mut connection.endpoint, number as u16, on, arrived);
}

/// 'Off' leaves and is read back.
fn switches_off(number: usize, connection: &mut Connection) -> LinkError {
    connection.endpoint.hand_out_off(connection.now());
    std::thread::sleep(Duration::from_millis(1));
    works(number, connection, false);
    LinkError::Stopped
}

#[test]
fn nobody_there_is_told_to_whoever_opens_and_not_tried_again() {
    let link = Link::start(1, 1, Box::new(|_, _| io("nobody there")));
    assert_eq!(link.closed(), Closed::NotReadBack("nobody there".into()));
    assert_eq!(link.opened.recv(), Ok(Err(io("nobody there"))));
    assert_eq!((link.conversations(), link.health.report().last_problem.as_str()), (1, "nobody there"));
    // A sensor has nothing that could be on.
    let setup = InstrumentSetup::new("muprime-force2", "");
    let (endpoint, _port) = Endpoint::force(profile("muprime-force2").unwrap(), &setup).unwrap();
    let (ready, _opened) = sync_channel(1);
    let connection = Connection::new(endpoint, Instant::now(), Arc::default(), ready);
    assert_eq!(connection.spawn(|_| Err(io("nobody"))).unwrap().join().unwrap(), Closed::NothingToSwitch);
}

#[test]
fn an_orderly_end_says_what_was_read_back() {
    let link = Link::start(1, 1, Box::new(switches_off));
    assert_eq!(link.closed(), Closed::ReadBackOff);
    let link = Link::start(
        1,
        1,
        Box::new(|_, connection| {
            connection.tell(Ok(()));
            LinkError::Stopped
        }),
    );
    assert!(matches!(link.closed(), Closed::NotReadBack(why) if why.contains("before a state")));
}

#[test]
fn a_lost_link_is_made_anew_until_it_is_to_end() {
    let link = Link::start(
        1,
        1,
        Box::new(|number, connection| match number {
            1..=3 => {
                works(number, connection, false);
                if number == 2 { LinkError::Timeout(50) } else { io("cut") }
            }
            4 => panic!("a fault of {}", "this program"),
            _ => switches_off(number, connection),
        }),
    );
    assert_eq!((link.closed(), link.conversations()), (Closed::ReadBackOff, 5));
    let report = link.health.report();
    assert_eq!(
        (report.timeouts, report.last_problem.as_str()),
        (1, "the driver panicked: a fault of this program")
    );
}

#[test]
fn a_link_that_owes_nothing_is_not_made_anew_for_the_end() {
    let link = Link::start(
        60_000,
        60_000,
        Box::new(|number, connection| {
            works(number, connection, false);
            connection.stop.store(true, Ordering::Release);
            io("cut")
        }),
    );
    assert_eq!((link.closed(), link.conversations()), (Closed::NotReadBack("cut".into()), 1));
}

/// The program ends while the link of a plate that is driven is down: it is made anew, in short pauses whatever the profile says.
#[test]
fn a_link_that_owes_off_is_made_anew_for_the_end() {
    let link = Link::start(
        30_000,
        60_000,
        Box::new(|number, connection| {
            match number {
                1 => works(number, connection, true),
                2..=4 => connection.stop.store(true, Ordering::Release),
                _ => return switches_off(number, connection),
            }
            io("cut")
        }),
    );
    assert_eq!((link.closed(), link.conversations()), (Closed::ReadBackOff, 5));
}

#[test]
fn the_end_waits_for_an_off_no_longer_than_it_may() {
    let link = Link::start(
        1,
        1,
        Box::new(|number, connection| {
            if number == 1 {
                works(number, connection, true);
            }
            connection.stop.store(true, Ordering::Release);
            io("gone for good")
        }),
    );
    assert_eq!(link.closed(), Closed::NotReadBack("gone for good".into()));
    let tried = link.times.lock().unwrap();
    assert!(tried.len() > 3 && tried[tried.len() - 1].1 - tried[0].1 >= OFF_WITHIN / 2);
}

#[test]
fn pauses_double_up_to_the_longest_and_begin_anew_after_a_good_link() {
    let pauses = || {
        let link = Link::start(
            10,
            2000,
            Box::new(|number, connection| match number {
                1 => {
                    works(number, connection, false);
                    io("cut")
                }
                2..=7 => io("nobody"),
                8 => {
                    works(number, connection, false);
                    io("cut")
                }
                _ => LinkError::Stopped,
            }),
        );
        link.closed();
        for (number, least_ms) in [(2, 10), (3, 20), (4, 40), (5, 80), (6, 160), (7, 320), (8, 640), (9, 10)]
        {
            let pause = link.pause_before(number);
            assert!(pause >= Duration::from_millis(least_ms), "{pause:?} before conversation {number}");
        }
        link.pause_before(9)
    };
    // It would have been twice 640 ms each time; a machine that stalls adds to one.
    let anew = (0..5).map(|_| pauses()).find(|anew| *anew < Duration::from_millis(1000));
    assert!(anew.is_some());
    // No longer than the longest.
    let link = Link::start(
        10,
        30,
        Box::new(|number, connection| {
            connection.tell(Ok(()));
            if number < 12 { io("nobody") } else { LinkError::Stopped }
        }),
    );
    link.closed();
    let pause = (3..=12).map(|number| link.pause_before(number)).min().unwrap();
    assert!((30..1000).contains(&pause.as_millis()), "{pause:?}");
}

/// Where 'off' is owed, a good link that was lost is reopened at once; vain attempts pause.
#[test]
fn an_owed_off_is_tried_at_once_and_then_with_pauses() {
    let at_once = || {
        let link = Link::start(
            1500,
            1500,
            Box::new(|number, connection| {
                match number {
                    1 => works(number, connection, true),
                    2 => {}
                    _ => return switches_off(number, connection),
                }
                io("cut")
            }),
        );
        assert_eq!(link.closed(), Closed::ReadBackOff);
        let later = link.pause_before(3);
        assert!(later >= Duration::from_millis(1500), "{later:?}");
        link.pause_before(2)
    };
    // A machine that stalls adds to one of them.
    assert!((0..5).any(|_| at_once() < Duration::from_millis(1000)));
}

/// A pause of an hour does not hold up the end, and the loop's commands during it are not stored.
#[test]
fn a_pause_ends_with_the_program_and_keeps_no_command() {
    let link = Link::start(
        3_600_000,
        3_600_000,
        Box::new(|number, connection| {
            works(number, connection, false);
            io("cut")
        }),
    );
    assert_eq!(link.opened.recv_timeout(PATIENCE), Ok(Ok(())));
    std::thread::sleep(Duration::from_millis(100));
    link.stop.store(true, Ordering::Release);
    assert_eq!((link.closed(), link.conversations()), (Closed::NotReadBack("cut".into()), 1));

    let (sender, due) = sync_channel(1);
    let link = Link::start(
        300,
        300,
        Box::new(move |number, connection| {
            if number == 1 {
                works(number, connection, false);
                return io("cut");
            }
            let _ = sender.send(connection.endpoint.due(connection.now()));
            switches_off(number, connection)
        }),
    );
    assert_eq!(link.opened.recv_timeout(PATIENCE), Ok(Ok(())));
    std::thread::sleep(Duration::from_millis(100));
    link.port.lock().unwrap().push(on(1, u64::MAX));
    assert_eq!(due.recv_timeout(PATIENCE), Ok(Due::Nothing), "wanted during the pause, gone after it");
    assert_eq!(link.closed(), Closed::ReadBackOff);
}
