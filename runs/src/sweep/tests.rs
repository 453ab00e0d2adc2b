use super::*;
use crate::plan::{Plan, Resolution};
use crate::setup::Setup;
use crate::supervisor::{self, End, Requests, VirtualLoop};
use models::SpringSlider;
use realtime::Ports;
use sim::virtual_rig::VirtualRig;

const PLAN: &str = "name = \"p\"\nseed = 3\nreference_every = 0\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n[base]\n\
    amplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
    amplitude_pp_m = [2e-6, 1e-6, 2.5e-6, 3e-6, 1.5e-6]\n";

/// Sweeps with somebody who asks for a pause in these spans of time (s); returns the passes, the events and
/// every row with whether the sweep rested then.
fn swept(pauses: &[[f64; 2]]) -> Swept {
    let world = sim::world::WorldConfig::ideal();
    let pause = |row: &Row| pauses.iter().any(|[from, to]| (*from..*to).contains(&row.now.seconds()));
    swept_on(&world, 600.0, pause, None)
}

type Swept = (Vec<MeasuredPass>, Vec<Event>, Vec<(Row, bool)>, Outcome);

/// The same on a rig of this world with a relay, a longest pause in s, somebody who asks for a pause after
/// such rows, and an end from outside at a time in s.
fn swept_on(
    world: &sim::world::WorldConfig,
    pause_max_s: f64,
    pause: impl Fn(&Row) -> bool,
    mut ends: Option<(f64, End)>,
) -> Swept {
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = Plan::parse("plan.toml", PLAN).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut sweep = Sweep::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise);
    sweep.pause_max = Nanos::from_seconds(pause_max_s);
    let [force, amplifier, stage] = VirtualRig::new(world, 1).unwrap().split();
    let mut ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage.clone()));
    // A welded relay would not pass its proof.
    if !world.amplifier.relay_welded {
        ports.supply = Box::new(stage);
    }
    let mut rig = VirtualLoop::new(setup.config, model, ports);
    let (asks, now) = (std::cell::Cell::new(false), std::cell::Cell::new(0.0));
    let mut ask = || {
        let end = ends.take_if(|(at, _)| now.get() >= *at).map(|(_, end)| end);
        Requests { end, pause: asks.get() }
    };
    let (mut passes, mut events, mut rows, mut rests) = (Vec::new(), Vec::new(), Vec::new(), false);
    let outcome = supervisor::sweep(&mut rig, &mut sweep, &mut ask, &mut |row, _, reaction| {
        asks.set(pause(row));
        now.set(row.now.seconds());
        for event in &reaction.events {
            rests = match event {
                Event::Paused { .. } => true,
                Event::Resumed => false,
                _ => rests,
            };
        }
        rows.push((*row, rests));
        passes.extend(reaction.pass);
        events.extend(reaction.events);
    });
    (passes, events, rows, outcome)
}

#[test]
fn a_pause_rests_without_drive_and_lifted_off_and_loses_no_pass() {
    let (plain, _, _, outcome) = swept(&[]);
    // Each amplitude in both directions.
    assert_eq!((plain.len(), outcome), (10, Outcome::Complete));
    // Before the first pass; in the midst of one, for longer than any time that a rule waits for; and between
    // two.
    let (passes, events, rows, outcome) = swept(&[[0.0, 2.0], [2.65, 40.3], [41.0, 41.1]]);
    assert_eq!(outcome, Outcome::Complete, "{events:?}");
    let points = |passes: &[MeasuredPass]| passes.iter().map(|p| p.pass.point).collect::<Vec<_>>();
    assert_eq!(points(&passes), points(&plain));
    let paused = events.iter().filter(|e| matches!(e, Event::Paused { .. })).count();
    let resumed = events.iter().filter(|e| **e == Event::Resumed).count();
    assert!(paused >= 2 && paused == resumed, "{events:?}");
    // Each pause disarms, and each end of one proves the second channel again before it arms.
    let armed = events.iter().filter(|e| **e == Event::Armed).count();
    let proofs = rows.windows(2).filter(|w| w[1].0.proving && !w[0].0.proving).count();
    assert_eq!((armed, proofs), (1 + paused, 1 + paused), "{events:?}");
    // A zero is that of the unloaded sensor: what a pause cut short is no part of it.
    let zeros = events.iter().filter_map(|e| match e {
        Event::Zeros { normal_n, .. } => *normal_n,
        _ => None,
    });
    let worst = zeros.map(f64::abs).fold(0.0, f64::max);
    assert!(worst < 0.005, "{worst} N");
    let mut since = None;
    let (mut rested, mut longest) = (0, 0.0f64);
    for (row, rests) in &rows {
        let from = *since.get_or_insert(row.now);
        if !rests {
            since = None;
            continue;
        }
        let age = row.now.since(from).seconds();
        longest = longest.max(age);
        // The finger is lifted and the drive ramped down within a few tenths of a second.
        if age > 0.5 {
            rested += 1;
            let seen = &row.inputs.seen;
            assert!(!row.armed, "{age} s");
            assert_eq!(row.marker.phase, Phase::Idle);
            assert!(seen.amplifier.is_ok_and(|a| !a.output_on), "it drives {age} s into a pause");
            assert!(
                seen.forces.normal.is_ok_and(|n| n.value.abs() < 0.02),
                "it touches {age} s into a pause"
            );
        }
    }
    assert!(rested > 30_000 && longest > 36.0, "{rested} {longest}");
    // What was measured is not another thing for the rest before it.
    for (a, b) in passes.iter().zip(&plain) {
        let mu = |p: &MeasuredPass| p.pass.lateral_force_n.unwrap().abs() / p.pass.normal_force_n;
        assert!((mu(a) / mu(b) - 1.0).abs() < 0.1, "{} {}", mu(a), mu(b));
    }
}

/// Whoever ended it: a ledger of the finger's exposure that was not written is no record that was lost.
#[test]
fn each_end_from_outside_has_its_own_outcome() {
    let world = sim::world::WorldConfig::ideal();
    for (end, outcome) in [
        (End::Requested, Outcome::Stopped),
        (End::NotSaved, Outcome::RecordLost),
        (End::ExposureNotSaved, Outcome::ExposureNotSaved),
    ] {
        let (passes, events, rows, found) = swept_on(&world, 600.0, |_| false, Some((1.0, end)));
        assert_eq!(found, outcome);
        let stops = events.iter().any(|e| matches!(e, Event::StopRequested | Event::Tripped(_)));
        assert!(passes.len() < 5 && stops, "{events:?}");
        assert!(rows.last().is_some_and(|(row, _)| !row.armed && row.drive_pp_m == 0.0));
    }
}

/// A stage whose position is too coarse never comes to the start of a pass: nobody requested that stop.
#[test]
fn a_start_that_is_not_reached_is_no_stop_on_request() {
    let mut world = sim::world::WorldConfig::ideal();
    world.stage.encoder_m = 7e-3;
    let (passes, events, rows, outcome) = swept_on(&world, 600.0, |_| false, None);
    assert!(passes.is_empty(), "{events:?}");
    assert!(
        matches!(outcome, Outcome::StartNotReached { point: 0, wanted_m, found_m }
        if (1e-3..4e-3).contains(&(wanted_m - found_m).abs())),
        "{outcome:?}"
    );
    assert!(outcome.remedy().is_some_and(|remedy| remedy.contains("resolution")));
    assert!(rows.iter().all(|(row, _)| row.drive_pp_m == 0.0));
}

/// A pause that nobody ends is ended by its limit, with the rig off; what was measured is stored.
#[test]
fn a_pause_has_an_end() {
    let world = sim::world::WorldConfig::ideal();
    let (passes, events, rows, outcome) = swept_on(&world, 5.0, |row| row.now.seconds() > 0.9, None);
    assert_eq!(outcome, Outcome::Stopped);
    assert_eq!(events.last(), Some(&Event::PauseTooLong { bound: 5.0 }));
    assert!(!passes.is_empty() && rows.iter().any(|(_, rests)| *rests));
    let rested = rows.iter().filter(|(_, rests)| *rests).count();
    assert!((5_000..5_010).contains(&rested), "{rested} ms");
    assert!(!rows.last().unwrap().0.armed);
}

/// An amplifier that stays on in a pause, and has no supply that could be cut: the run ends, and says why.
#[test]
fn a_pause_in_which_the_rig_does_not_show_itself_off_ends_the_run() {
    let mut world = sim::world::WorldConfig::ideal();
    (world.amplifier.refuses_off, world.amplifier.relay_welded) = (true, true);
    let driven = std::cell::Cell::new(false);
    let pause = |row: &Row| {
        driven.set(driven.get() || row.drive_pp_m > 0.0);
        driven.get()
    };
    let (_, events, _, outcome) = swept_on(&world, 600.0, pause, None);
    assert_eq!(outcome, Outcome::WouldNotArm { blocking: Some(TripCause::RefusesOff) });
    assert_eq!(events.last(), Some(&Event::PauseNotQuiet { cause: TripCause::RefusesOff }));
}

/// A person who changes a tip presses on the sensor: that ends nothing. An output that comes on meanwhile
/// does.
#[test]
fn a_hand_on_the_finger_ends_no_step_and_an_output_that_comes_on_does() {
    let (_, _, rows, _) = swept(&[[0.9, 5.0]]);
    let mut row = rows.into_iter().rev().find(|(row, rests)| *rests && !row.armed).unwrap().0;
    (row.tripped, row.inputs.seen.supply) = (None, Err(NoData::NotFitted));
    row.inputs.seen.forces.normal.as_mut().unwrap().value = 2.0;
    let setup = Setup::load("virtual-ideal").unwrap();
    let text = format!("{PLAN}[[step]]\nwhen = \"before\"\naction = \"change_tip\"\n");
    let plan = Plan::parse("plan.toml", &text).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut sweep =
        Sweep::new(points, plan.file.pass, model, &setup.tip, setup.file.noise).at_rig(&plan, &setup);
    let (mut questions, mut outcome) = (0, None);
    for ms in 0..30_000 {
        (row.now, row.cycle) = (row.now.plus(Nanos(1_000_000)), row.cycle + 1);
        row.inputs.seen.amplifier.as_mut().unwrap().output_on = ms >= 20_000;
        let reaction = sweep.on_row(&row);
        questions += usize::from(reaction.question.is_some());
        outcome = outcome.or(reaction.outcome.map(|outcome| (ms, outcome)));
    }
    assert_eq!(questions, 1);
    let (ms, outcome) = outcome.expect("an end");
    assert_eq!(outcome, Outcome::WouldNotArm { blocking: Some(TripCause::RefusesOff) });
    assert!((22_000..23_000).contains(&ms), "{ms} ms");
}
