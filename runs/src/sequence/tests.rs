use super::*;
use crate::plan::{Plan, Resolution};
use crate::setup::Setup;
use crate::supervisor::{self, Asked, VirtualLoop};
use models::prediction::SpringSlider;
use realtime::turn::Ports;
use sim::virtual_rig::VirtualRig;

const PLAN: &str = "name = \"p\"\nseed = 3\nreference_every = 0\n[pass]\nsettle_s = 0.05\nmeasure_s = 0.05\n[base]\n\
    amplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
    amplitude_pp_m = [2e-6, 1e-6, 2e-6, 3e-6, 1.5e-6]\n";

/// Sweeps with somebody who asks for a pause in these spans of time (s); returns the passes, the events and every row with whether the
/// sweep rested then.
fn swept(pauses: &[[f64; 2]]) -> (Vec<MeasuredPass>, Vec<Event>, Vec<(Row, bool)>, Outcome) {
    let setup = Setup::load("virtual-ideal").unwrap();
    let plan = Plan::parse("plan.toml", PLAN).unwrap();
    let resolution = Resolution { amplitude_pp_m: 1e-9, frequency_hz: 0.1 };
    let points = plan.points(1, &setup.config.limits, &resolution).unwrap();
    let model: Arc<dyn FrictionModel> = Arc::new(SpringSlider::new(setup.tip.finger).unwrap());
    let mut sequence =
        Sequence::new(points, plan.file.pass, Arc::clone(&model), &setup.tip, setup.file.noise);
    let [force, amplifier, stage] = VirtualRig::new(&sim::world::WorldConfig::ideal(), 1).unwrap().split();
    let ports = Ports::new(Box::new(force), Box::new(amplifier), Box::new(stage));
    let mut rig = VirtualLoop::new(setup.config, model, ports);
    let now = std::cell::Cell::new(0.0);
    let mut ask =
        || Asked { end: None, pause: pauses.iter().any(|[from, to]| (*from..*to).contains(&now.get())) };
    let (mut passes, mut events, mut rows, mut rests) = (Vec::new(), Vec::new(), Vec::new(), false);
    let outcome = supervisor::sweep(&mut rig, &mut sequence, &mut ask, &mut |row, _, reaction| {
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
    // Before the first pass; in the midst of one, for longer than any time that a rule waits for; and between two.
    let (passes, events, rows, outcome) = swept(&[[0.0, 2.0], [2.3, 40.0], [40.5, 40.6]]);
    assert_eq!(outcome, Outcome::Complete, "{events:?}");
    let points = |passes: &[MeasuredPass]| passes.iter().map(|p| p.pass.point).collect::<Vec<_>>();
    assert_eq!(points(&passes), points(&plain));
    let paused = events.iter().filter(|e| matches!(e, Event::Paused { .. })).count();
    let resumed = events.iter().filter(|e| **e == Event::Resumed).count();
    assert!(paused >= 2 && paused == resumed, "{events:?}");
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
            assert!(row.armed, "{age} s");
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
