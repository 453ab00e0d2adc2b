//! What every transport's thread starts from, by itself; its life is in [`life`].

use super::*;
use crate::endpoint::tests::amplifier;
use std::sync::mpsc::{Receiver, sync_channel};
use std::time::Instant;

mod life;

/// Whatever hangs fails instead.
const PATIENCE: Duration = Duration::from_secs(120);

#[test]
fn a_pause_makes_no_burst() {
    let mut periodic = Periodic::new(1000.0, Nanos(0));
    periodic.advance(Nanos(100));
    assert_eq!(periodic.due, Nanos(1_000_000));
    periodic.advance(Nanos(5_500_000));
    assert_eq!(periodic.due, Nanos(6_000_000));
    periodic.advance(Nanos(7_000_000));
    assert_eq!(periodic.due, Nanos(8_000_000));
}

#[test]
fn what_is_periodic_is_due_from_its_time_on() {
    let periodic = Periodic::new(1000.0, Nanos(500));
    assert_eq!([499, 500, 501].map(|now| periodic.is_due(Nanos(now))), [false, true, true]);
}

fn alone() -> (Connection, Receiver<Result<(), LinkError>>) {
    let (ready, opened) = sync_channel(4);
    (Connection::new(amplifier().0, Instant::now() - Duration::from_secs(3), Arc::default(), ready), opened)
}

#[test]
fn the_first_outcome_is_told_once() {
    let (mut connection, opened) = alone();
    assert!(connection.is_first() && connection.tell(Ok(())));
    assert!(!connection.is_first() && !connection.tell(Err(LinkError::Stopped)));
    assert_eq!((opened.try_recv(), opened.try_recv().is_err()), (Ok(Ok(())), true));
}

#[test]
fn a_connection_knows_its_time_and_whether_it_is_to_end() {
    let (mut connection, _opened) = alone();
    assert!(connection.now() >= Nanos(3_000_000_000) && !connection.stopping());
    connection.stop.store(true, Ordering::Release);
    assert!(connection.stopping());
    let began = Instant::now();
    assert!(!connection.off_time_over(), "it begins with the first question");
    while !connection.off_time_over() {
        assert!(began.elapsed() < PATIENCE);
        connection.sleep_until(None);
    }
    assert!(began.elapsed() >= OFF_WITHIN);
}

#[test]
fn a_sleep_is_as_long_as_it_may_be() {
    let (connection, _opened) = alone();
    let slept = |due: Option<Nanos>| {
        let began = Instant::now();
        connection.sleep_until(due);
        began.elapsed()
    };
    let hour = connection.now().plus(Nanos(3_600_000_000_000));
    assert!(slept(None) >= LONGEST_SLEEP && slept(Some(hour)) >= LONGEST_SLEEP);
    assert!(slept(Some(connection.now().plus(Nanos(5_000_000)))) >= Duration::from_millis(4));
}
