//! Commands on a faulty way to the instrument.

use super::*;
use std::sync::{Arc, Mutex};

/// The commands that arrive at an amplifier, by their count, each with the cycle in which it arrived. One
/// leaves in each cycle, and the state is read after each.
fn arrived(faults: &[Fault], seed: u64, cycles: u64) -> Vec<(u32, u64)> {
    let log = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&log);
    let port = Port {
        state: |_: Nanos| Err(NoData::NeverRead),
        command: move |command: DriveCommand, now: Nanos| {
            into.lock().unwrap().push((command.sequence(), now.0 / T));
        },
    };
    let mut faulty = FaultyAmplifier::new(port, faults, seed);
    for cycle in 0..cycles {
        faulty.command(DriveCommand::off(cycle as u32, at(cycle + 100)), at(cycle));
        let _ = faulty.state(at(cycle));
    }
    drop(faulty);
    Arc::into_inner(log).unwrap().into_inner().unwrap()
}

/// All of so many cycles but those that a test leaves out.
fn all_but(left_out: impl Fn(u64) -> bool) -> Vec<(u32, u64)> {
    (0..30).filter(|cycle| !left_out(*cycle)).map(|cycle| (cycle as u32, cycle)).collect()
}

#[test]
fn commands_are_lost_in_the_time_of_the_fault_and_only_there() {
    for mode in [FaultMode::Off, FaultMode::Disconnected, FaultMode::Corrupt] {
        let lost = arrived(&[fault(FaultTarget::Drive, mode, 0.0)], 1, 30);
        assert_eq!(lost, all_but(|cycle| ACTS.contains(&cycle)), "{mode:?}");
        // The way of the states is another.
        assert_eq!(arrived(&[fault(FaultTarget::Amplifier, mode, 0.0)], 1, 30), all_but(|_| false));
    }
}

/// Faults of readings apply to no command.
#[test]
fn faults_of_readings_leave_commands_alone() {
    for mode in [
        FaultMode::Ok,
        FaultMode::Stuck,
        FaultMode::Garbage,
        FaultMode::Wrong,
        FaultMode::Invalid,
        FaultMode::Spikes,
        FaultMode::Saturated,
        FaultMode::Disordered,
        FaultMode::ClockJump,
    ] {
        assert_eq!(arrived(&[fault(FaultTarget::Drive, mode, 1.0)], 1, 30), all_but(|_| false), "{mode:?}");
    }
}

#[test]
fn a_slow_way_carries_one_command_in_so_many() {
    let slow = arrived(&[fault(FaultTarget::Drive, FaultMode::Slow, 4.0)], 1, 30);
    // The command of cycle n is the one numbered n + 1.
    assert_eq!(slow, all_but(|cycle| ACTS.contains(&cycle) && (cycle + 1) % 4 != 0));
    assert_eq!(arrived(&[fault(FaultTarget::Drive, FaultMode::Slow, 0.0)], 1, 30), all_but(|_| false));
}

#[test]
fn an_intermittent_way_loses_its_share_the_same_from_the_same_seed() {
    for share in [0.1, 0.9] {
        let run = |seed| arrived(&[always(FaultTarget::Drive, FaultMode::Intermittent, share)], seed, 4000);
        assert!(about(4000 - run(3).len(), 4000, share), "{} of 4000 at {share}", run(3).len());
        assert_eq!(run(3), run(3));
        assert_ne!(run(3), run(4));
        assert!(run(3).iter().all(|(command, cycle)| u64::from(*command) == *cycle));
    }
}

#[test]
fn a_delayed_command_arrives_by_so_much_later_and_once() {
    // Far more than are under way at a time: the places for them are used again.
    let late = arrived(&[always(FaultTarget::Drive, FaultMode::Delayed, 0.02)], 1, 1000);
    let expected: Vec<(u32, u64)> = (20..1000).map(|cycle| (cycle as u32 - 20, cycle)).collect();
    assert_eq!(late, expected);
}

/// A command that comes in the cycle in which a delayed one arrives is the newer of them.
#[test]
fn a_newer_command_is_the_last_when_the_delay_is_over() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&log);
    let port = Port {
        state: |_: Nanos| Err(NoData::NeverRead),
        command: move |command: DriveCommand, _: Nanos| into.lock().unwrap().push(command.sequence()),
    };
    let mut faulty = FaultyAmplifier::new(port, &[fault(FaultTarget::Drive, FaultMode::Delayed, 0.005)], 1);
    faulty.command(DriveCommand::off(1, at(100)), at(19));
    faulty.command(DriveCommand::off(2, at(100)), at(24));
    assert_eq!(*log.lock().unwrap(), [1, 2]);
}

/// A loop that was held up finds several due at once: they arrive in the order in which they were sent.
#[test]
fn commands_that_are_due_together_arrive_in_their_order() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&log);
    let port = Port {
        state: |_: Nanos| Err(NoData::NeverRead),
        command: move |command: DriveCommand, _: Nanos| into.lock().unwrap().push(command.sequence()),
    };
    let mut faulty = FaultyAmplifier::new(port, &[always(FaultTarget::Drive, FaultMode::Delayed, 0.01)], 1);
    for burst in 0..100 {
        for count in 0..5 {
            faulty.command(
                DriveCommand::off(5 * burst + count, at(1 << 40)),
                at(u64::from(100 * burst + count)),
            );
        }
        let _ = faulty.state(at(u64::from(100 * burst + 50)));
    }
    let came = log.lock().unwrap();
    assert!(came.len() == 500 && came.is_sorted(), "{came:?}");
}

#[test]
fn a_stage_is_told_what_the_loop_tells_it() {
    let log = Arc::new(Mutex::new(Vec::new()));
    let into = Arc::clone(&log);
    let port = Port {
        state: |_: Nanos| Err(NoData::NeverRead),
        command: move |command: StageCommand, now: Nanos| {
            into.lock().unwrap().push((command.sequence(), now))
        },
    };
    let mut faulty = FaultyStage::new(port, &[always(FaultTarget::Stage, FaultMode::Off, 0.0)], 1);
    faulty.command(StageCommand::stop(7, at(10)), at(3));
    assert_eq!(*log.lock().unwrap(), [(7, at(3))]);
}
