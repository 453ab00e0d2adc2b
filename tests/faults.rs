//! The fault list in virtual time: each fault in each phase, its worst reaction beside its bound, and its cause.

use studies::cases::kinds::faults::{FaultSettings, search};
use studies::validation::faults::rows::What;
use studies::validation::faults::scene::STEADY_AT;
use studies::validation::faults::search::judged;
use studies::validation::faults::{Core, Expect, Moment, Pace, ROWS, Scene, Strike, Tally, run, run_with};
use tests::rounds;

const PACES: [Pace; 2] = [Pace::Fast, Pace::Default];

fn assert_clean(tally: &Tally) {
    studies::validation::faults::table(tally);
    let failures: Vec<_> = tally.failures.iter().map(|f| (f.seed, &f.smallest, &f.wrong)).collect();
    assert_eq!(tally.failed, 0, "{failures:#?}");
}

#[test]
fn every_fault_in_every_phase_is_answered_within_its_bound_and_for_its_cause() {
    for pace in PACES {
        let mut tally = Tally::default();
        for (row, fault) in ROWS.iter().enumerate() {
            for moment in fault.moments {
                // Seed 1 is struck by the tests of the page (`tests/requirements.rs`).
                for seed in [0, 2] {
                    let strikes = vec![Strike { row, at: STEADY_AT + 37 * seed }];
                    let scene = Scene { moment: *moment, seed, strikes, pace };
                    tally.count(&scene, judged(&scene, seed == 0), seed == 0);
                }
            }
        }
        assert_clean(&tally);
    }
}

/// Every fault that may strike while the rig slides, while a grating is rendered: the amplitude never
/// stands, and nothing is over its bound.
#[test]
fn every_fault_is_answered_within_its_bound_while_a_target_is_rendered() {
    for pace in PACES {
        let mut tally = Tally::default();
        for (row, fault) in
            ROWS.iter().enumerate().filter(|(_, fault)| fault.moments.contains(&Moment::Slide))
        {
            for seed in 0..rounds(2, 100) {
                let strikes = vec![Strike { row, at: STEADY_AT + 37 * seed % 401 }];
                let scene = Scene { moment: Moment::Render, seed, strikes, pace };
                tally.count(&scene, judged(&scene, seed == 0), seed == 0);
            }
            assert!(!fault.name.is_empty());
        }
        println!(
            "{pace:?}: {} faults struck while a target was rendered, {} over a bound",
            tally.scenes, tally.failed
        );
        assert_clean(&tally);
    }
}

#[test]
fn without_a_fault_nothing_trips() {
    for pace in PACES {
        for moment in [Moment::Idle, Moment::Ramp, Moment::Hold, Moment::Slide, Moment::Render] {
            for seed in 0..rounds(3, 40) {
                let found = run(&Scene { moment, seed, strikes: Vec::new(), pace }, false);
                assert!(found.wrong.is_empty() && found.trip.is_none(), "{moment:?} {seed}: {found:?}");
            }
        }
    }
}

fn many(settings: FaultSettings, seeds: u64) -> Tally {
    search(&settings, seeds, &mut |_| {}).unwrap()
}

/// Two thousand seeds in `tests/run long`.
#[test]
fn hundreds_of_seeds_and_none_over_a_bound() {
    let seeds = rounds(150, 2000);
    for pace in PACES {
        assert_clean(&many(FaultSettings { pace, ..FaultSettings::default() }, seeds));
    }
}

#[test]
fn random_pairs_of_faults() {
    let seeds = rounds(75, 1000);
    let tally = many(FaultSettings { pairs: true, ..FaultSettings::default() }, seeds);
    let struck = tally.reactions.values().map(|r| r.runs).sum::<u64>();
    assert!(10 * struck > 19 * seeds, "pairs have two faults: {struck}");
    assert_clean(&tally);
}

/// Pairs that hide each other: a rogue master that sets half the amplitude, with a readback of twice of it,
/// or garbage, or a link that is cut while its heartbeat goes on. The slower of the two bounds counts.
#[test]
fn faults_that_hide_each_other_are_off_within_the_slower_bound() {
    let row = |name: &str| ROWS.iter().position(|r| r.name == name).unwrap();
    let rogue = row("rogue_master");
    for other in ["amplitude_times_two", "amplifier_link_cut", "amplifier_garbage", "amplitude_sensor_zero"] {
        for moment in [Moment::Hold, Moment::Slide] {
            for (seed, apart) in [(15_898, 19), (46_578, 1), (48_970, 0), (1, 40)] {
                for (first, second) in [(rogue, row(other)), (row(other), rogue)] {
                    let strikes = vec![
                        Strike { row: first, at: STEADY_AT },
                        Strike { row: second, at: STEADY_AT + apart },
                    ];
                    let found = run(&Scene { moment, seed, strikes, pace: Pace::Fast }, false);
                    assert!(found.wrong.is_empty(), "{other} {moment:?} {seed} {apart}: {found:?}");
                }
            }
        }
    }
}

#[test]
fn seeds_run_twice_give_equal_hashes_and_replay_to_equal_decisions() {
    assert_clean(&many(FaultSettings { twice: true, ..FaultSettings::default() }, rounds(12, 100)));
}

/// Negative controls: a core that sleeps, that is deaf, or that trips for a wrong cause, and the bench says
/// so for every fault that must switch off.
#[test]
fn a_core_that_sleeps_is_deaf_or_mistaken_is_found_out_by_every_fault() {
    for core in [Core::Sleeps, Core::Deaf, Core::Mistaken] {
        for (row, fault) in ROWS.iter().enumerate() {
            // What the world itself shows a deaf core: a slide that stands, a watchdog that fired meanwhile, its own clock.
            let heard = matches!(fault.what, What::StageStalls | What::Paused(_) | What::Exposure);
            if !matches!(fault.expect, Expect::Off(_)) || (core == Core::Deaf && heard) {
                continue;
            }
            let moment = *fault.moments.last().unwrap();
            let strikes = vec![Strike { row, at: STEADY_AT }];
            let scene = Scene { moment, seed: 1, strikes, pace: Pace::Fast };
            let found = run_with(&scene, false, core);
            assert!(!found.wrong.is_empty(), "{core:?} passes for sound with {}: {found:?}", fault.name);
        }
    }
}
