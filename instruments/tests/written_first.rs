//! What a profile that is written for the first time gets wrong, or leaves out: told, or taken as it can only be meant.

use muprime_instruments::{Profile, ProfileError};

const GENERATOR: &str = include_str!("../../docs/profiles/ascii-generator.toml");
const BOARD: &str = include_str!("../../docs/profiles/bench-board.toml");
const STAGE: &str = include_str!("../../drivers/profiles/muprime-stage.toml");

fn read(text: &str) -> Result<Profile, ProfileError> {
    let profile = Profile::parse(text)?;
    profile.check(text)?;
    Ok(profile)
}

fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "`{from}` is not there");
    text.replacen(from, to, 1)
}

/// Two questions, each answer with the names of its numbers: neither signals nor vectors repeat which answer they stand in.
fn two_questions() -> String {
    let query = GENERATOR.find("[[query]]").unwrap();
    let signals = GENERATOR.find("[[signal]]").unwrap();
    let vector = GENERATOR.find("[[vector]]").unwrap();
    let queries = r#"
[[query]]
name = "level"
send = "AMP?"
answer = "AMP={echo_amplitude:.1}%"
rate_hz = 20

[[query]]
name = "rest"
send = "REST?"
answer = "F={echo_frequency:.1}Hz,OUT={output_on:OFF|ON},S={status:04X}"
rate_hz = 20

"#;
    let vectors = r#"
[[vector]]
line = "AMP=20.5%"
expect = { echo_amplitude = 20.5 }

[[vector]]
line = "F=27500.0Hz,OUT=ON,S=00A1"
expect = { echo_frequency = 27500.0, output_on = 1, status = 161 }
"#;
    format!("{}{queries}{}{vectors}", &GENERATOR[..query], &GENERATOR[signals..vector])
}

#[test]
fn an_answer_says_itself_which_numbers_it_holds() {
    let profile = read(&two_questions()).unwrap();
    let frame = |name: &str| profile.frame_of(profile.signal(name).unwrap());
    assert_eq!(frame("echo_amplitude"), profile.frame("level").unwrap());
    assert_eq!(frame("status"), profile.frame("rest").unwrap());
}

#[test]
fn what_stands_in_two_answers_or_in_none_needs_its_frame() {
    let twice = changed(
        &two_questions(),
        "answer = \"AMP={echo_amplitude:.1}%\"",
        "answer = \"{status:x},AMP={echo_amplitude:.1}%\"",
    );
    let said = read(&twice).unwrap_err().to_string();
    assert!(said.contains("`status` needs `frame`, one of level, rest"), "{said}");
    let vector = changed(&two_questions(), "{ echo_amplitude = 20.5 }", "{}");
    let said = read(&vector).unwrap_err().to_string();
    assert!(said.contains("the vector needs `frame`, one of level, rest"), "{said}");
}

/// A generator that answers a set-point with what it has taken: `OUT=ON`, and `OUT=OFF` for zero.
#[test]
fn the_answer_to_a_zero_is_the_second_one() {
    let own = changed(
        GENERATOR,
        "send = \"OUT={:OFF|ON}\"\nanswer = [\"OK\", \"OK\"]",
        "send = \"OUT={:OFF|ON}\"\nanswer = [\"OUT=ON\", \"OUT=OFF\"]",
    );
    let profile = read(&own).unwrap();
    let enable = profile.set("enable").unwrap();
    let line = |value| profile.line(enable, value, &|_| 0.0).unwrap();
    assert_eq!(line(1.0), ("OUT=ON".to_string(), Some("OUT=ON")));
    assert_eq!(line(0.0), ("OUT=OFF".to_string(), Some("OUT=OFF")));
}

#[test]
fn a_vector_with_another_check_or_length_is_refused() {
    read(BOARD).unwrap();
    for (from, to, cause) in [
        ("ff5d\"", "0000\"", "the check of these bytes is ff5d, and the frame ends with 0000"),
        ("check = \"CRC-16/XMODEM\"", "check = \"CRC-16/KERMIT\"", "the check of these bytes is"),
        ("check_from = 2 ", "check_from = 0 ", "the check of these bytes is"),
        ("hex = \"a55a", "hex = \"a55b", "the frame begins with a55a"),
    ] {
        let said = read(&changed(BOARD, from, to)).map(|_| ()).unwrap_err().to_string();
        assert!(said.contains(cause), "{to}: {said}");
    }
}

#[test]
fn a_crc_has_its_other_names_and_what_is_none_is_told_what_there_is() {
    let alias = changed(BOARD, "check = \"CRC-16/XMODEM\"", "check = \"ZMODEM\"");
    read(&alias).unwrap();
    let said = read(&changed(BOARD, "check = \"CRC-16/XMODEM\"", "check = \"CRC-16/CITT\""))
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(said.contains("CRC-16/KERMIT") && said.contains("CRC-16/IBM-3740"), "{said}");
}

#[test]
fn a_set_point_that_nobody_sends_is_refused() {
    let more = "\n[[set]]\nname = \"brake\"\nregister = 4\ntype = \"u16\"\n";
    let said = read(&format!("{STAGE}{more}")).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("nobody would send the set-point `brake`") && said.contains("[[init]]"), "{said}");
    let unsafe_one = more.replace("brake", "enable");
    let said = read(&format!("{STAGE}{unsafe_one}")).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("`safe`") && said.contains("`enable`"), "{said}");
}
