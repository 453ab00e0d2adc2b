use super::*;
use crate::ports::DriveSetPoint;
use crate::profile;

fn amplifier() -> (Endpoint, AmplifierPort) {
    Endpoint::amplifier(profile("muprime-amplifier").unwrap(), &InstrumentSetup::new("muprime-amplifier", ""))
        .unwrap()
}

fn on(sequence: u32, expires_at: u64) -> DriveSetPoint {
    DriveSetPoint {
        amplitude_pp_m: 2e-6,
        frequency_hz: 27_500.0,
        enable: true,
        sequence,
        expires_at: Nanos(expires_at),
    }
}

/// The value that a set-point would get, if it is sent.
fn sent(endpoint: &Endpoint, due: &Due, name: &str) -> Option<f64> {
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
