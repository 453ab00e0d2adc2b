//! The fault list in virtual time: each fault in each phase, its worst reaction beside its bound.

use rig::faults::bench::STEADY_AT;
use rig::faults::{Moment, ROWS, Scene, Search, Strike, Tally, run, search};

fn assert_clean(tally: &Tally) {
    rig::cli::faults::table(tally);
    let failures: Vec<_> = tally.failures.iter().map(|f| (f.seed, &f.smallest, &f.wrong)).collect();
    assert_eq!(tally.failed, 0, "{failures:#?}");
}

#[test]
fn every_fault_in_every_phase_is_answered_within_its_bound() {
    let mut tally = Tally::default();
    for (row, fault) in ROWS.iter().enumerate() {
        for moment in fault.moments {
            for seed in 0..3 {
                let strikes = vec![Strike { row, at: STEADY_AT + 37 * seed }];
                tally.take(&Scene { moment: *moment, seed, strikes }, seed == 0);
            }
        }
    }
    assert_clean(&tally);
}

#[test]
fn without_a_fault_nothing_trips() {
    for moment in [Moment::Idle, Moment::Ramp, Moment::Hold, Moment::Slide] {
        for seed in 0..40 {
            let found = run(&Scene { moment, seed, strikes: Vec::new() }, false);
            assert!(found.wrong.is_empty() && found.trip.is_none(), "{moment:?} {seed}: {found:?}");
        }
    }
}

#[test]
fn two_thousand_seeds_and_none_over_a_bound() {
    assert_clean(&search(Search { first: 1, seeds: 2000, pairs: false, twice: false }));
}

#[test]
fn random_pairs_of_faults() {
    let tally = search(Search { first: 1, seeds: 1000, pairs: true, twice: false });
    assert!(tally.reactions.values().map(|r| r.runs).sum::<u64>() > 1900, "pairs have two faults");
    assert_clean(&tally);
}

#[test]
fn seeds_run_twice_give_equal_hashes_and_replay_to_equal_decisions() {
    assert_clean(&search(Search { first: 1, seeds: 100, pairs: false, twice: true }));
}

#[test]
fn the_bench_sees_a_safety_core_that_sleeps() {
    // A row whose bound is too tight by one must fail: the harness can say no.
    let row = ROWS.iter().position(|r| r.name == "forces_stuck").unwrap();
    let found =
        run(&Scene { moment: Moment::Slide, seed: 1, strikes: vec![Strike { row, at: STEADY_AT }] }, false);
    let took = found.command_off[0].unwrap();
    assert!(took > rig::faults::rows::FROZEN - 1, "a frozen value cannot be known sooner: {took}");
}
