//! What is owed, what is handed out, and what counts as read back, for each kind of instrument.

use super::super::tests::{DriveSetPoint, amplifier, on, sent, show};
use super::*;
use crate::InstrumentSetup;
use crate::ports::{StagePort, SupplyPort};
use crate::profile;
use realtime::ports::{Amplifier, ForceSensor, SafetyInputs, Stage, SupplyCommand, SupplySwitch};

fn stage(dead_weight_n: Option<f64>) -> (Endpoint, StagePort) {
    let setup = InstrumentSetup { dead_weight_n, ..InstrumentSetup::new("muprime-stage", "") };
    Endpoint::stage(profile("muprime-stage").unwrap(), &setup).unwrap()
}

fn supply() -> (Endpoint, SupplyPort) {
    Endpoint::supply(profile("muprime-relay").unwrap()).unwrap()
}

/// The loop's command to a stage. Only the loop can make one that moves, so it is put where the loop's port would put it.
fn ask(endpoint: &Endpoint, velocity_m_s: f64, normal_force_n: f64) {
    let command = SetPoint::of_stage(velocity_m_s, normal_force_n, 3, Nanos(100));
    endpoint.orders.commands.put(command, command.on.then_some(command.expires_at));
}

fn show_closed(endpoint: &mut Endpoint, closed: bool, arrived: u64) {
    let frame = endpoint.profile().frame("state").unwrap();
    endpoint.frame(frame, &[0, u8::from(closed), 0, 1, 0, 1, 0, 1], Nanos(arrived)).unwrap();
}

#[test]
fn a_state_of_the_same_moment_reads_no_off_back() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    endpoint.due(Nanos(10));
    endpoint.hand_out_off(Nanos(20));
    show(&mut endpoint, 1, false, 20);
    assert!(endpoint.owes_off() && !endpoint.reads_off(), "it may have been taken before the 'off' came");
    show(&mut endpoint, 2, false, 21);
    assert!(!endpoint.owes_off() && endpoint.reads_off());
    // The same of an instrument that nobody drove.
    let (mut endpoint, _port) = amplifier();
    endpoint.hand_out_off(Nanos(20));
    show(&mut endpoint, 1, false, 20);
    assert!(!endpoint.reads_off());
    show(&mut endpoint, 2, true, 30);
    assert!(!endpoint.reads_off() && endpoint.owes_off(), "a later state that shows 'on'");
    show(&mut endpoint, 3, false, 40);
    assert!(endpoint.reads_off() && !endpoint.owes_off());
}

#[test]
fn a_state_alone_reads_no_off_back() {
    let (mut endpoint, mut port) = amplifier();
    show(&mut endpoint, 1, false, 10);
    assert!(!endpoint.reads_off() && !endpoint.owes_off(), "no 'off' was sent, and none is owed");
    show(&mut endpoint, 2, true, 20);
    assert!(endpoint.owes_off(), "on, whoever switched it on");
    assert!(matches!(endpoint.due(Nanos(21)), Due::Safe(_)), "no command");
    // 'Off' was sent, it was driven again, and shows 'off' still: that is from before.
    show(&mut endpoint, 3, false, 30);
    assert!(endpoint.reads_off());
    port.push(on(1, 100));
    endpoint.due(Nanos(40));
    show(&mut endpoint, 4, false, 50);
    assert!(!endpoint.reads_off() && endpoint.owes_off());
}

#[test]
fn an_off_is_sent_once_more_for_a_later_state_only() {
    let (mut endpoint, _port) = amplifier();
    show(&mut endpoint, 1, true, 10);
    assert!(matches!(endpoint.due(Nanos(20)), Due::Safe(_)));
    show(&mut endpoint, 2, true, 20);
    assert_eq!(endpoint.due(Nanos(21)), Due::Nothing, "a state of the same moment");
    show(&mut endpoint, 3, true, 22);
    assert!(matches!(endpoint.due(Nanos(23)), Due::Safe(_)));
    // Refused, then shown: what the instrument shows counts.
    endpoint.refused();
    show(&mut endpoint, 4, false, 30);
    assert_eq!(endpoint.due(Nanos(31)), Due::Nothing);
    // Taken, and not shown yet: it is waited for.
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    endpoint.due(Nanos(10));
    assert!(matches!(endpoint.due(Nanos(101)), Due::Safe(_)));
    assert_eq!(endpoint.due(Nanos(102)), Due::Nothing);
    endpoint.refused();
    assert!(matches!(endpoint.due(Nanos(103)), Due::Safe(_)));
}

#[test]
fn the_loop_s_own_off_is_repeated_like_any() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 1000));
    endpoint.due(Nanos(10));
    port.push(DriveSetPoint { enable: false, ..on(2, 1000) });
    assert!(matches!(endpoint.due(Nanos(20)), Due::SetPoints(_)));
    assert!(!endpoint.wants_on());
    assert_eq!(endpoint.due(Nanos(21)), Due::Nothing);
    show(&mut endpoint, 1, true, 30);
    assert!(matches!(endpoint.due(Nanos(31)), Due::Safe(_)), "it is on still");
    show(&mut endpoint, 2, false, 40);
    assert!(endpoint.reads_off());
}

#[test]
fn a_refused_command_is_dropped_and_off_is_owed_for_it() {
    let (mut endpoint, mut port) = amplifier();
    assert!(!endpoint.wants_on());
    port.push(on(1, 1000));
    endpoint.due(Nanos(10));
    assert!(endpoint.wants_on());
    endpoint.refused();
    assert!(!endpoint.wants_on());
    let due = endpoint.due(Nanos(11));
    assert_eq!(sent(&endpoint, &due, "enable"), Some(0.0), "a part of it may have been taken");
}

/// Else the loop's next command, a cycle later, switches on again what the refusal switched off, and the run goes on.
#[test]
fn a_refused_command_shows_as_a_fault() {
    let (mut endpoint, mut port) = amplifier();
    show(&mut endpoint, 1, false, 10);
    assert!(!port.state(Nanos(10)).unwrap().fault);
    // An 'off' that is refused is no fault of this kind: it is owed.
    endpoint.hand_out_off(Nanos(11));
    endpoint.refused();
    show(&mut endpoint, 2, false, 12);
    assert!(!port.state(Nanos(12)).unwrap().fault);
    port.push(on(1, 1000));
    endpoint.due(Nanos(20));
    endpoint.refused();
    port.push(on(2, 1000));
    endpoint.due(Nanos(21));
    show(&mut endpoint, 3, true, 30);
    assert!(port.state(Nanos(30)).unwrap().fault);
    let long_after = 12 + ALARM_HOLDS.0 + 1;
    show(&mut endpoint, 4, false, long_after);
    assert!(!port.state(Nanos(long_after)).unwrap().fault);
}

#[test]
fn a_repeated_command_that_has_left_does_not_leave_again() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    endpoint.due(Nanos(10));
    port.push(on(1, 200));
    assert!(endpoint.still_wanted(Nanos(20)));
    assert_eq!(endpoint.due(Nanos(21)), Due::Nothing, "the same set-points");
    port.push(DriveSetPoint { amplitude_pp_m: 3e-6, ..on(1, 300) });
    assert!(endpoint.still_wanted(Nanos(150)), "its time is the newer command's");
    let due = endpoint.due(Nanos(151));
    assert!((sent(&endpoint, &due, "amplitude").unwrap() - 3000.0).abs() < 1e-9);
    assert!(!endpoint.still_wanted(Nanos(301)));
    let (mut endpoint, mut port) = amplifier();
    assert!(!endpoint.still_wanted(Nanos(0)), "nothing is wanted");
    port.push(DriveSetPoint { enable: false, ..on(1, 100) });
    assert!(!endpoint.still_wanted(Nanos(1)), "what switches off is not held to that");
}

#[test]
fn off_is_every_safe_set_point_and_forgets_what_was_wanted() {
    let (mut endpoint, mut port) = amplifier();
    let name = |endpoint: &Endpoint, (set, value): (SetId, f64)| {
        (endpoint.profile().description.set[set.0].name.as_ref().clone(), value)
    };
    let expected = [("enable".to_string(), 0.0), ("amplitude".to_string(), 0.0)];
    let safe = endpoint.safe_set_points();
    assert_eq!(safe.into_iter().map(|one| name(&endpoint, one)).collect::<Vec<_>>(), expected);
    port.push(on(1, 1000));
    endpoint.due(Nanos(10));
    port.push(DriveSetPoint { enable: false, ..on(2, 1000) });
    let handed = endpoint.hand_out_off(Nanos(20));
    assert_eq!(handed.into_iter().map(|one| name(&endpoint, one)).collect::<Vec<_>>(), expected);
    assert!(!endpoint.wants_on());
    assert_eq!(endpoint.health().report().safe_sent, 1);
    // The 'off' that waited has left with it: a newer command is not held back for it.
    port.push(on(3, 1000));
    let due = endpoint.due(Nanos(30));
    assert_eq!(sent(&endpoint, &due, "enable"), Some(1.0));
}

#[test]
fn only_what_takes_safe_set_points_is_switched_off() {
    let force = InstrumentSetup::new("muprime-force2", "");
    let (force, _) = Endpoint::force(profile("muprime-force2").unwrap(), &force).unwrap();
    let inputs = InstrumentSetup::new("muprime-relay", "");
    let (contacts, _) = Endpoint::contacts(profile("muprime-relay").unwrap(), &inputs).unwrap();
    let (amplifier, stage, supply) = (amplifier().0, stage(None).0, supply().0);
    let roles = [&force, &amplifier, &stage, &supply, &contacts].map(|one| (one.role(), one.is_actuator()));
    assert_eq!(
        roles,
        [
            (PortRole::Force, false),
            (PortRole::Amplifier, true),
            (PortRole::Stage, true),
            (PortRole::Supply, true),
            (PortRole::Contacts, false)
        ]
    );
    let mut bare = profile("muprime-amplifier").unwrap();
    bare.description.set.iter_mut().for_each(|set| set.safe = None);
    let setup = InstrumentSetup::new("muprime-amplifier", "");
    let (mut bare, mut port) = Endpoint::amplifier(bare, &setup).unwrap();
    port.push(on(1, 100));
    bare.due(Nanos(10));
    assert!(!bare.is_actuator() && !bare.owes_off(), "there is nothing that could be sent");
    assert_eq!(bare.due(Nanos(101)), Due::Nothing);
}

#[test]
fn a_stage_that_was_moved_or_loaded_is_owed_a_stop() {
    for (velocity, load) in [(0.01, 0.0), (0.0, 0.2), (-0.01, 0.2)] {
        let (mut endpoint, _port) = stage(None);
        ask(&endpoint, velocity, load);
        let due = endpoint.due(Nanos(10));
        assert!((sent(&endpoint, &due, "velocity").unwrap() - 1e9 * velocity).abs() < 1e-3);
        assert!((sent(&endpoint, &due, "load").unwrap() - 1e6 * load).abs() < 1e-3);
        assert_eq!(sent(&endpoint, &due, "heartbeat"), Some(3.0));
        assert!(endpoint.owes_off() && endpoint.wants_on());
        // A stop and then a motion: the stop leaves first.
        ask(&endpoint, 0.0, 0.0);
        ask(&endpoint, velocity, load);
        assert!(!endpoint.still_wanted(Nanos(11)), "a stop came");
        let due = endpoint.due(Nanos(12));
        assert!(matches!(due, Due::Safe(_)), "{due:?}");
        assert_eq!(
            (sent(&endpoint, &due, "velocity"), sent(&endpoint, &due, "load")),
            (Some(0.0), Some(0.0))
        );
    }
    let (mut endpoint, _port) = stage(None);
    ask(&endpoint, 0.0, 0.0);
    assert!(matches!(endpoint.due(Nanos(10)), Due::SetPoints(_)));
    assert!(!endpoint.owes_off(), "it rested, and rests");
}

#[test]
fn a_load_that_no_weight_gives_is_refused_and_reported() {
    for (requested, given) in
        [(0.25, true), (0.25 + 5e-7, true), (0.0, true), (0.3, false), (0.2, false), (-0.25, false)]
    {
        let (mut endpoint, _port) = stage(Some(0.25));
        ask(&endpoint, 0.01, requested);
        let due = endpoint.due(Nanos(10));
        assert_eq!(matches!(due, Due::SetPoints(_)), given, "{requested} N: {due:?}");
        assert_eq!(endpoint.health().report().commands_refused, u64::from(!given), "{requested} N");
    }
}

#[test]
fn a_supply_that_was_closed_is_owed_an_opening() {
    let (mut endpoint, mut port) = supply();
    port.command(SupplyCommand::Restore, Nanos(0));
    let due = endpoint.due(Nanos(10));
    assert_eq!(sent(&endpoint, &due, "closed"), Some(1.0));
    assert!(endpoint.owes_off());
    port.command(SupplyCommand::Cut, Nanos(20));
    port.command(SupplyCommand::Restore, Nanos(21));
    assert!(!endpoint.still_wanted(Nanos(22)), "a cut was commanded");
    let due = endpoint.due(Nanos(22));
    assert_eq!(sent(&endpoint, &due, "closed"), Some(0.0), "the cut leaves first");
    show_closed(&mut endpoint, false, 30);
    assert!(endpoint.reads_off() && !endpoint.owes_off());
    show_closed(&mut endpoint, true, 40);
    assert!(endpoint.owes_off(), "closed by itself");
}

/// A link that goes down drops whatever waits, and gives the loop the reason.
#[test]
fn a_link_that_goes_down_tells_the_loop_and_forgets_what_was_wanted() {
    let why = NoData::Corrupt;
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 1000));
    endpoint.due(Nanos(10));
    endpoint.link_down(why);
    assert_eq!(port.state(Nanos(20)), Err(why));
    assert!(!endpoint.wants_on() && endpoint.owes_off(), "an 'off' stays owed");

    let (mut endpoint, mut port) = stage(None);
    ask(&endpoint, 0.01, 0.2);
    endpoint.link_down(why);
    assert_eq!((port.state(Nanos(20)), endpoint.due(Nanos(20))), (Err(why), Due::Nothing));

    let (mut endpoint, mut port) = supply();
    port.command(SupplyCommand::Restore, Nanos(0));
    endpoint.link_down(why);
    assert_eq!((port.state(Nanos(20)), endpoint.due(Nanos(20))), (Err(why), Due::Nothing));

    let setup = InstrumentSetup::new("muprime-force2", "");
    let (mut endpoint, (mut port, _)) = Endpoint::force(profile("muprime-force2").unwrap(), &setup).unwrap();
    endpoint.link_down(why);
    let forces = port.read(Nanos(20));
    assert_eq!((forces.lateral, forces.normal), (Err(why), Err(why)));

    let setup = InstrumentSetup {
        wired: Some(vec!["interlock".into()]),
        ..InstrumentSetup::new("muprime-relay", "")
    };
    let (mut endpoint, mut port) = Endpoint::contacts(profile("muprime-relay").unwrap(), &setup).unwrap();
    endpoint.link_down(why);
    let contacts = port.read(Nanos(20));
    assert_eq!((contacts.interlock, contacts.emergency_stop), (Err(why), Err(NoData::NotFitted)));
}

/// An 'off' that came while the link was down is sent when it is up, before what came after it.
#[test]
fn dropping_what_waits_keeps_a_noted_off() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 1000));
    endpoint.due(Nanos(10));
    port.push(DriveSetPoint { enable: false, ..on(2, 1000) });
    endpoint.discard_commands();
    port.push(on(3, 1000));
    let due = endpoint.due(Nanos(20));
    assert_eq!(sent(&endpoint, &due, "enable"), Some(0.0));
}

/// A stage with an enable of its own is on while it is to move or to load, and off at rest and at the end.
#[test]
fn a_stage_is_enabled_while_it_is_to_move_or_to_load() {
    let text = include_str!("../../../profiles/muprime-stage.toml")
        .replace("count = 5\nrate_hz = 500", "count = 6\nrate_hz = 500");
    let more = "\n[[set]]\nname = \"enable\"\nregister = 5\ntype = \"u16\"\nrange = [0.0, 1.0]\nsafe = 0.0\n";
    let profile = instruments::Profile::parse(&format!("{text}{more}")).unwrap();
    let setup = InstrumentSetup::new("muprime-stage", "");
    let (mut endpoint, _port) = Endpoint::stage(profile, &setup).unwrap();
    for (velocity_m_s, normal_force_n, enabled) in
        [(0.0, 0.0, 0.0), (0.02, 0.0, 1.0), (0.0, 0.25, 1.0), (0.0, 0.0, 0.0)]
    {
        ask(&endpoint, velocity_m_s, normal_force_n);
        let due = endpoint.due(Nanos(10));
        assert_eq!(sent(&endpoint, &due, "enable"), Some(enabled), "{velocity_m_s} m/s, {normal_force_n} N");
    }
    let enable = endpoint.profile().set("enable").unwrap();
    assert!(endpoint.safe_set_points().contains(&(enable, 0.0)));
}

/// A coil that has two values changes with every command that leaves, however the loop's commands and the
/// link's turns fall; what the loop does not ask for, and a safe set-point, feed nothing.
#[test]
fn a_supplys_heartbeat_changes_with_every_command_and_with_nothing_else() {
    let relay = crate::bundled::text("muprime-relay").unwrap();
    let beats = "[[set]]\nname = \"heartbeat\"\nregister = 1\ntype = \"u16\"\nrange = [0.0, 1.0]\ntimeout_ms = 200\n\n[emulator.measure]";
    let coils =
        relay.replace("table = \"coil\"\naddress = 0\ncount = 1", "table = \"coil\"\naddress = 0\ncount = 2");
    let coils = coils.replace(
        "registers = [1]\nexpect = { closed = 1 }",
        "registers = [1, 1]\nexpect = { closed = 1, heartbeat = 1 }",
    );
    let text = coils.replace("[emulator.measure]", beats);
    let profile = Profile::parse(&text).unwrap_or_else(|error| panic!("{error}"));
    let (mut endpoint, mut port) = Endpoint::supply(profile).unwrap();
    let beat = endpoint.profile().set("heartbeat").unwrap();
    let value =
        |set_points: &[(SetId, f64)]| set_points.iter().find(|(set, _)| *set == beat).map(|(_, v)| *v);
    let mut before = None;
    for (turn, every) in (0..40).zip([1, 2, 4, 5].into_iter().cycle()) {
        // So many cycles of the loop pass between two turns of the link.
        for cycle in 0..every {
            let command = if turn < 30 { SupplyCommand::Restore } else { SupplyCommand::Cut };
            SupplySwitch::command(&mut port, command, Nanos(1000 * turn + cycle));
        }
        let Due::SetPoints(set_points) = endpoint.due(Nanos(1000 * turn + 10)) else { panic!("turn {turn}") };
        let now = value(&set_points);
        assert!(now.is_some() && now != before, "turn {turn}: {set_points:?}");
        // What opens leaves before the heartbeat, what closes behind it.
        assert_eq!(set_points[0].0 == beat, turn < 30);
        before = now;
        // A loop that is dead says nothing more.
        let again = endpoint.due(Nanos(1000 * turn + 11));
        assert!(!matches!(again, Due::SetPoints(_)), "{again:?}");
    }
    assert_eq!(value(&endpoint.hand_out_off(Nanos(50_000))), None);
    assert_eq!(
        crate::profile("wago-750-watchdog").unwrap().heartbeat().and_then(|set| set.timeout_ms),
        Some(200)
    );
}
