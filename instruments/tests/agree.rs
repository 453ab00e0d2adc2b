//! What a profile says twice must agree: units and factors, set-points and their echoes, 'off' and zero.

use muprime_instruments::Profile;

const FORCE: &str = include_str!("../../drivers/profiles/muprime-force2.toml");
const AMPLIFIER: &str = include_str!("../../drivers/profiles/muprime-amplifier.toml");
const STAGE: &str = include_str!("../../drivers/profiles/muprime-stage.toml");
const RELAY: &str = include_str!("../../drivers/profiles/muprime-relay.toml");
const WORDS: &str = include_str!("../../docs/profiles/ascii-generator.toml");
const LINES: &str = include_str!("../../drivers/profiles/piezodrive-pdus210.toml");
const CAN: &str = include_str!("../../docs/profiles/can-force.toml");
const DBC: &str = include_str!("../../docs/profiles/can-force.dbc");

/// The profile with `from` replaced by `to` in the table of that name; what is said of it.
fn said(text: &str, table: &str, from: &str, to: &str) -> String {
    let at = text.find(table).unwrap_or_else(|| panic!("`{table}` is not there"));
    let rest = &text[at..];
    assert!(rest.contains(from), "`{from}` is not in `{table}`");
    let changed = format!("{}{}", &text[..at], rest.replacen(from, to, 1));
    let read = Profile::parse_with(&changed, &|_| Some(DBC.to_string()));
    read.err().map(|error| error.to_string()).unwrap_or_default()
}

fn each_is_refused(cases: &[(&str, &str, &str, &str, &str)]) {
    for (text, table, from, to, cause) in cases {
        let why = said(text, table, from, to);
        assert!(why.contains(cause), "{table} {to}: {why:?}");
        assert!(why.starts_with("line "), "{table} {to} has no place: {why}");
        assert_eq!(said(text, table, from, from), "", "unchanged");
    }
}

/// A value that switches on, or moves, is sent at every end and by `doctor`.
#[test]
fn off_is_zero() {
    let set = |name: &str| format!("[[set]]\nname = \"{name}\"");
    let (enable, amplitude) = (set("enable"), set("amplitude"));
    let (velocity, load, closed) = (set("velocity"), set("load"), set("closed"));
    each_is_refused(&[
        (AMPLIFIER, &enable, "safe = 0.0", "safe = 1.0", "off is 0"),
        (AMPLIFIER, &enable, "safe = 0.0", "safe = nan", "range"),
        (AMPLIFIER, &amplitude, "safe = 0.0", "safe = 5.0", "off is 0"),
        (STAGE, &velocity, "safe = 0.0", "safe = 20.0", "off is 0"),
        (STAGE, &load, "safe = 0.0", "safe = 1.0", "off is 0"),
        (RELAY, &closed, "safe = 0.0", "safe = 1.0", "off is 0"),
        // One line for every value switches nothing off.
        (LINES, &enable, "send_zero = \"DISABLE\"", "", "own value"),
        (LINES, &enable, "send_zero = \"DISABLE\"", "send_zero = \"ENABLE\"", "own value"),
    ]);
}

#[test]
fn words_of_a_set_point_and_its_echo_agree() {
    each_is_refused(&[
        (WORDS, "name = \"enable\"", "{:OFF|ON}", "{:ON|OFF}", "`ON`"),
        (WORDS, "name = \"state\"", "{output_on:OFF|ON}", "{output_on:ON|OFF}", "`OFF`"),
    ]);
    let both = WORDS.replace("{output_on:OFF|ON}", "{output_on:ON|OFF}");
    assert!(said(&both, "name = \"enable\"", "{:OFF|ON}", "{:ON|OFF}").contains("`ON`"));
    // A word that means its opposite has another way.
    let muted = "send = \"MUTE=OFF\"\nsend_zero = \"MUTE=ON\"";
    assert_eq!(said(WORDS, "name = \"enable\"", "send = \"OUT={:OFF|ON}\"", muted), "");
}

#[test]
fn units_and_factors_agree() {
    let (newton, nano) = ("factor = 1.0, unit = \"N\"", "factor = 1e-9, unit = \"m\"");
    let drive = "[[set]]\nname = \"amplitude\"";
    each_is_refused(&[
        (FORCE, "name = \"lateral\"", "unit = \"N\"", "unit = \"mN\"", "1e-3 N"),
        (FORCE, "name = \"lateral\"", newton, "factor = 1.0, unit = \"mN\"", "prefix"),
        (FORCE, "name = \"lateral\"", "unit = \"N\"", "unit = \"g\"", "9.80665e-3 N"),
        (FORCE, "name = \"lateral\"", "unit = \"N\"", "unit = \"lbf\"", "1 lbf is 4.44822"),
        (FORCE, "name = \"lateral\"", "unit = \"N\"", "unit = \"kgf\"", "1 kgf is 9.80665"),
        (FORCE, "name = \"lateral\"", "unit = \"N\"", "unit = \"gf\"", "9.80665e-3 N"),
        (FORCE, "name = \"lateral\"", newton, "factor = nan, unit = \"N\"", "not finite"),
        (AMPLIFIER, drive, nano, "factor = 1e-6, unit = \"m\"", "1e-9 m"),
        (AMPLIFIER, drive, nano, "factor = 1.0, unit = \"Hz\"", "unit = \"m\""),
        (AMPLIFIER, drive, nano, "factor = 0.0, unit = \"m\"", "above zero"),
        (AMPLIFIER, drive, nano, "factor = nan, unit = \"m\"", "above zero"),
        (AMPLIFIER, drive, nano, "factor = -1e-9, unit = \"m\"", "above zero"),
        (AMPLIFIER, drive, "echo_amplitude", "echo_frequency", "its echo `echo_frequency` in `Hz`"),
        (STAGE, "[[signal]]\nname = \"position\"", nano, "factor = 1e-3, unit = \"m\"", "1e-9 m"),
        (CAN, "name = \"lateral\"", "factor = 1e-3", "factor = 1.0", "1e-3 N"),
    ]);
    // What people round: 4.448 N in a pound.
    let pounds = "unit = \"lbf\"\nsi = { factor = 4.448, unit = \"N\" }";
    assert_eq!(
        said(FORCE, "name = \"lateral\"", "unit = \"N\"\nsi = { factor = 1.0, unit = \"N\" }", pounds),
        ""
    );
    // The DBC file states a unit of its own.
    let whole = CAN.replace("\"mN\"", "\"N\"").replace("factor = 1e-3", "factor = 1.0");
    let why = said(&whole, "[profile]", "[profile]", "[profile]");
    assert!(why.contains("1 mN is 1e-3 N"), "{why}");
}

/// Two numbers do not share a byte, and an answer takes time.
#[test]
fn numbers_do_not_overlap_and_time_limits_are_above_zero() {
    each_is_refused(&[
        (FORCE, "name = \"normal\"", "register = 8", "register = 7", "`normal` and `lateral` share bytes"),
        (FORCE, "name = \"normal\"", "register = 8", "register = 6", "`normal` and `lateral` share bytes"),
        (FORCE, "[link]", "response_timeout_ms = 50", "response_timeout_ms = 0", "`response_timeout_ms`"),
        (FORCE, "[link]", "connect_timeout_ms = 1000", "connect_timeout_ms = 0", "`connect_timeout_ms`"),
    ]);
}

/// The bits of a float are no counts, for a certificate of force over them is wrong and looks good. Its
/// counts, and those of a computed signal, do not depend on the resolution that the profile states.
#[test]
fn a_certificate_can_rest_on_the_counts_of_every_signal() {
    const FLOATS: &str = include_str!("../../docs/profiles/strain-amp.toml");
    const TWICE: &str = "[[signal]]\nname = \"twice\"\nvalue = \"2 * lateral\"\nunit = \"N\"\n\
        si = { factor = 1.0, unit = \"N\" }\nresolution_si = 2e-4\n[[signature]]";
    let text = FLOATS.replacen("[[signature]]", TWICE, 1);
    for text in [text.clone(), text.replace("2e-4", "5e-3")] {
        let profile = Profile::parse(&text).unwrap();
        let [lateral, twice] = ["lateral", "twice"].map(|name| profile.signal(name).unwrap());
        let frame = profile.frame_of(lateral);
        let (mut bytes, mut values) = (vec![0; profile.frame_bytes(frame)], profile.values());
        for (sent, counts) in [(0.125, 125_000_000_000), (-2.5, -2_500_000_000_000), (0.0, 0)] {
            profile.encode(frame, &mut bytes, &mut |id| (id == lateral).then_some(sent));
            profile.decode(frame, &bytes, &mut values).unwrap();
            assert_eq!([lateral, twice].map(|id| profile.raw(id, &bytes, &values)), [counts, 2 * counts]);
        }
    }
}
