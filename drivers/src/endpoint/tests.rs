use super::*;
use crate::profile;

pub(crate) fn amplifier() -> (Endpoint, AmplifierPort) {
    Endpoint::amplifier(profile("muprime-amplifier").unwrap(), &InstrumentSetup::new("muprime-amplifier", ""))
        .unwrap()
}

/// What the loop wants of the amplifier. Only the loop can make a command that drives.
pub(crate) struct DriveSetPoint {
    pub amplitude_pp_m: f64,
    pub frequency_hz: f64,
    pub enable: bool,
    pub sequence: u32,
    pub expires_at: Nanos,
}

impl From<DriveSetPoint> for SetPoint {
    fn from(of: DriveSetPoint) -> Self {
        let (on, sequence) = (of.enable, Some(of.sequence));
        let drive = [("amplitude", of.amplitude_pp_m), ("frequency", of.frequency_hz)];
        SetPoint {
            values: [drive[0], drive[1], ("enable", f64::from(on))],
            on,
            sequence,
            expires_at: of.expires_at,
        }
    }
}

pub(crate) fn on(sequence: u32, expires_at: u64) -> DriveSetPoint {
    DriveSetPoint {
        amplitude_pp_m: 2e-6,
        frequency_hz: 27_500.0,
        enable: true,
        sequence,
        expires_at: Nanos(expires_at),
    }
}

/// The value that a set-point would get, if it is sent.
pub(crate) fn sent(endpoint: &Endpoint, due: &Due, name: &str) -> Option<f64> {
    let (Due::SetPoints(set_points) | Due::Safe(set_points)) = due else { return None };
    let wanted = endpoint.profile().set(name)?;
    set_points.iter().find(|(set, _)| *set == wanted).map(|(_, value)| *value)
}

#[test]
fn the_newest_command_leaves_once() {
    let (mut endpoint, mut port) = amplifier();
    assert_eq!(endpoint.due(Nanos(0)), Due::Nothing);
    port.push(on(1, 100));
    port.push(on(2, 100));
    let due = endpoint.due(Nanos(10));
    assert!((sent(&endpoint, &due, "amplitude").unwrap() - 2000.0).abs() < 1e-9, "2 um are 2000 nm");
    assert_eq!(sent(&endpoint, &due, "enable"), Some(1.0));
    assert_eq!(sent(&endpoint, &due, "heartbeat"), Some(2.0));
    assert_eq!(endpoint.due(Nanos(11)), Due::Nothing, "once");
}

#[test]
fn a_heartbeat_runs_round_at_the_width_of_its_register() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(65_536 + 7, 100));
    let due = endpoint.due(Nanos(10));
    assert_eq!(sent(&endpoint, &due, "heartbeat"), Some(7.0));
}

#[test]
fn an_expired_command_never_leaves_and_what_was_on_goes_off_once() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    assert_eq!(endpoint.due(Nanos(101)), Due::Nothing, "nothing was on: nothing to make safe");
    assert_eq!(endpoint.health().report().commands_expired, 1);
    port.push(on(2, 300));
    endpoint.due(Nanos(200));
    // The loop falls silent: at the expiry the safe set-points leave, once, and feed no watchdog.
    let due = endpoint.due(Nanos(301));
    assert_eq!((sent(&endpoint, &due, "enable"), sent(&endpoint, &due, "amplitude")), (Some(0.0), Some(0.0)));
    assert_eq!(sent(&endpoint, &due, "heartbeat"), None);
    assert_eq!(endpoint.due(Nanos(302)), Due::Nothing);
}

/// roboticslab-uc3m/yarp-devices 246: frames queued while a link was down went out when it came back.
#[test]
fn no_on_command_from_before_an_outage_leaves_after_it() {
    for waiting in 1..=64 {
        let (mut endpoint, mut port) = amplifier();
        for sequence in 0..waiting {
            port.push(on(sequence, 1_000_000)); // not expired: being old is enough
        }
        endpoint.link_down(NoData::Disconnected);
        assert_eq!(endpoint.due(Nanos(10)), Due::Nothing);
    }
}

#[test]
fn a_command_beyond_the_profile_makes_safe() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 1000));
    endpoint.due(Nanos(1));
    for wrong in [f64::NAN, 1.0, -1e-6, f64::INFINITY] {
        port.push(on(2, 1000));
        endpoint.due(Nanos(2));
        port.push(DriveSetPoint { amplitude_pp_m: wrong, ..on(3, 1000) });
        let due = endpoint.due(Nanos(3));
        assert_eq!(sent(&endpoint, &due, "enable"), Some(0.0), "{wrong}");
    }
    assert_eq!(endpoint.health().report().commands_refused, 4);
}

#[test]
fn off_leaves_the_frequency_alone() {
    let (mut endpoint, mut port) = amplifier();
    port.push(DriveSetPoint { enable: false, frequency_hz: f64::NAN, ..on(5, 1000) });
    let due = endpoint.due(Nanos(1));
    assert_eq!((sent(&endpoint, &due, "enable"), sent(&endpoint, &due, "frequency")), (Some(0.0), None));
    assert_eq!(sent(&endpoint, &due, "heartbeat"), Some(5.0), "off feeds the watchdog as well");
}

/// A state of the amplifier: counter, time and whether the output is on.
pub(crate) fn state(counter: u16, output_on: bool) -> Vec<u8> {
    let mut registers = [0_u16; 20];
    (registers[0], registers[1]) = (0x6D75, 0x3241);
    (registers[3], registers[5]) = (counter, counter);
    registers[15] = u16::from(output_on);
    registers.iter().flat_map(|register| register.to_be_bytes()).collect()
}

pub(crate) fn show(endpoint: &mut Endpoint, counter: u16, output_on: bool, arrived: u64) {
    let frame = endpoint.profile().frame("state").unwrap();
    endpoint.frame(frame, &state(counter, output_on), Nanos(arrived)).unwrap();
}

/// Old behaviour: a full ring dropped the newest command, the 'off' among them.
#[test]
fn an_off_is_never_dropped_however_many_commands_wait() {
    for before in [0, 1, 64, 1000] {
        for after in [0, 1, 64, 1000] {
            let (mut endpoint, mut port) = amplifier();
            port.push(on(1, 1_000_000));
            endpoint.due(Nanos(1));
            (0..before).for_each(|i| port.push(on(i, 1_000_000)));
            port.push(DriveSetPoint { enable: false, ..on(7, 1_000_000) });
            (0..after).for_each(|i| port.push(on(i, 1_000_000)));
            let due = endpoint.due(Nanos(2));
            assert_eq!(sent(&endpoint, &due, "enable"), Some(0.0), "{before} before, {after} after");
        }
    }
}

#[test]
fn off_is_repeated_until_a_later_state_shows_it() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    endpoint.due(Nanos(10));
    assert!(endpoint.owes_off());
    let due = endpoint.due(Nanos(101));
    assert!(matches!(due, Due::Safe(_)), "expired: {due:?}");
    show(&mut endpoint, 1, true, 110);
    assert!(matches!(endpoint.due(Nanos(111)), Due::Safe(_)), "a later state still says on");
    assert_eq!(endpoint.due(Nanos(112)), Due::Nothing, "until the next state");
    endpoint.refused();
    assert!(matches!(endpoint.due(Nanos(113)), Due::Safe(_)), "refused: once more");
    endpoint.refused();
    show(&mut endpoint, 2, false, 112);
    assert!(!endpoint.reads_off(), "a state from before the last 'off' shows nothing of it");
    show(&mut endpoint, 3, false, 120);
    assert!(endpoint.reads_off() && !endpoint.owes_off());
    assert_eq!(endpoint.due(Nanos(121)), Due::Nothing);
}

/// Several set-points that leave one by one take their time: none drives after the command's time or after an 'off'.
#[test]
fn a_command_that_has_begun_to_leave_ends_with_its_time_and_with_an_off() {
    let (mut endpoint, mut port) = amplifier();
    port.push(on(1, 100));
    endpoint.due(Nanos(10));
    assert!(endpoint.still_wanted(Nanos(100)) && !endpoint.still_wanted(Nanos(101)));
    port.push(on(2, 200));
    assert!(endpoint.still_wanted(Nanos(150)), "a newer command keeps it alive");
    port.push(DriveSetPoint { enable: false, ..on(3, 300) });
    port.push(on(4, 300));
    assert!(!endpoint.still_wanted(Nanos(160)));
    let due = endpoint.due(Nanos(161));
    assert_eq!(sent(&endpoint, &due, "enable"), Some(0.0));
}

#[test]
fn what_switches_off_leaves_first() {
    for id in ["muprime-amplifier", "piezodrive-pdus210", "keysight-33500b", "muprime-stage", "muprime-relay"]
    {
        let profile = profile(id).unwrap();
        let names = |endpoint: &Endpoint| {
            let safe = endpoint.safe_set_points();
            let name = |(set, _): &(instruments::SetId, f64)| {
                endpoint.profile().description.set[set.0].name.as_ref().clone()
            };
            safe.iter().map(name).collect::<Vec<_>>()
        };
        let endpoint = match id {
            "muprime-stage" => Endpoint::stage(profile, &InstrumentSetup::new(id, "")).unwrap().0,
            "muprime-relay" => Endpoint::supply(profile).unwrap().0,
            _ => Endpoint::amplifier(profile, &InstrumentSetup::new(id, "")).unwrap().0,
        };
        let first = ["enable", "velocity", "closed"];
        assert!(first.contains(&names(&endpoint)[0].as_str()), "{id}: {:?}", names(&endpoint));
    }
}

/// A range or a filter of before may still hold: a number of it is no force.
#[test]
fn what_a_sensor_shows_before_it_is_set_up_is_kept_from_the_loop() {
    let setup = InstrumentSetup::new("muprime-force2", "");
    let (mut endpoint, port) = Endpoint::force(profile("muprime-force2").unwrap(), &setup).unwrap();
    let mut force = crate::ports::compose(vec![port]).unwrap();
    let registers = endpoint.profile().description.vector[0].registers.clone().unwrap();
    let frame = endpoint.profile().frame("sample").unwrap();
    let mut bytes: Vec<u8> = registers.iter().flat_map(|register| register.to_be_bytes()).collect();
    endpoint.hold(true);
    endpoint.frame(frame, &bytes, Nanos(10)).unwrap();
    assert!(force.read(Nanos(11)).lateral.is_err());
    assert_eq!(endpoint.health().report().samples, 0);
    endpoint.hold(false);
    // The next sample: its count is one on.
    bytes[7] = bytes[7].wrapping_add(1);
    endpoint.frame(frame, &bytes, Nanos(20)).unwrap();
    assert!(force.read(Nanos(21)).lateral.is_ok());
}

#[test]
fn one_signal_is_not_both_axes() {
    let normal = || Some(AxisSetup { signal: "normal".into(), gain: 1.0, offset_n: 0.0 });
    let force = |lateral, normal| {
        let setup = InstrumentSetup { lateral, normal, ..InstrumentSetup::new("muprime-force2", "") };
        Endpoint::force(profile("muprime-force2").unwrap(), &setup).map(|_| ()).err()
    };
    let same = Some(SetupError::OneSignal("normal".into()));
    assert_eq!((force(normal(), None), force(normal(), normal())), (same.clone(), same));
    assert_eq!((force(None, None), force(None, normal())), (None, None));
}

/// The words that a profile has for a fault or a wrong instrument reach people, with what was read.
#[test]
fn a_fault_and_a_wrong_instrument_are_shown_with_what_was_read() {
    let (mut endpoint, _port) = amplifier();
    let frame = endpoint.profile().frame("state").unwrap();
    let stops = endpoint.profile().description.fault.iter().position(|f| f.severity == Severity::Stop);
    let fault = endpoint.profile().description.fault[stops.unwrap()].clone();
    let sets = |endpoint: &mut Endpoint, counter: u16, faulty: bool| {
        let mut bytes = state(counter, false);
        let mut wanted = |signal: SignalId| {
            let named = endpoint.profile().description.signal[signal.0].name.as_ref();
            fault
                .when
                .as_ref()
                .split(|c: char| !(c.is_alphanumeric() || c == '_'))
                .any(|w| w == named)
                .then_some(1.0)
        };
        if faulty {
            endpoint.profile().encode(frame, &mut bytes, &mut wanted);
        }
        endpoint.frame(frame, &bytes, Nanos(u64::from(counter))).unwrap();
        endpoint.health().report().fault
    };
    assert_eq!(sets(&mut endpoint, 1, false), "");
    let said = sets(&mut endpoint, 2, true);
    assert!(
        said.starts_with(&fault.text) && said.contains(fault.when.as_ref()) && said.contains("= 1"),
        "{said}"
    );
    sets(&mut endpoint, 3, true);
    assert_eq!(sets(&mut endpoint, 4, false), "", "it is gone");
    sets(&mut endpoint, 5, true);
    let reported = endpoint.health().report().reported;
    assert_eq!(reported.get(&fault.text), Some(&2), "it came twice: {reported:?}");
    // One of severity `log` stops nothing, and is counted.
    let mut profile = profile("muprime-amplifier").unwrap();
    profile.description.fault.iter_mut().for_each(|fault| fault.severity = Severity::Log);
    let (mut logs, _port) =
        Endpoint::amplifier(profile, &InstrumentSetup::new("muprime-amplifier", "")).unwrap();
    assert_eq!(sets(&mut logs, 1, true), "");
    assert_eq!(logs.health().report().reported.get(&fault.text), Some(&1));
    let mut other = state(6, false);
    other[0] = 0;
    let Err(BadFrame::WrongInstrument(why)) = endpoint.frame(frame, &other, Nanos(9)) else { panic!() };
    assert!(why.contains("magic = ") && why.contains("does not hold"), "{why}");
}
