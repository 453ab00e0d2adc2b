//! What to do about an answer that failed: each cause has a remedy of its own.

use std::fmt::Write;

/// Bytes that are shown of an answer.
const SHOWN: usize = 48;

/// Bytes as text between quotes, what cannot be seen as escapes.
pub fn shown(bytes: &[u8]) -> String {
    let mut text = String::from("\"");
    for byte in bytes.iter().take(SHOWN) {
        let _ = match byte {
            b'\r' => write!(text, "\\r"),
            b'\n' => write!(text, "\\n"),
            b'\t' => write!(text, "\\t"),
            0x20..=0x7e => write!(text, "{}", char::from(*byte)),
            byte => write!(text, "\\x{byte:02x}"),
        };
    }
    text.push_str(if bytes.len() > SHOWN { "\"..." } else { "\"" });
    text
}

/// Why a line did not end in time, of the bytes that did come and the question that was sent.
pub fn unended(came: &[u8], end: &[u8], question: &str) -> String {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02X}")).collect::<Vec<_>>().join(" ");
    let found =
        format!("{} bytes came and no line end ({}) among them: {}", came.len(), hex(end), shown(came));
    let text = came.iter().filter(|b| matches!(b, 0x20..=0x7e | b'\r' | b'\n' | b'\t' | 0 | 2 | 3)).count();
    let other =
        ["\r\n", "\n\r", "\r", "\n", "\0", "\u{3}"].into_iter().find(|e| came.ends_with(e.as_bytes()));
    let echoed = !question.is_empty() && came.starts_with(question.as_bytes());
    let cause = match other {
        _ if 4 * text < 3 * came.len() => {
            "that is not text: are the speed and the format of the line (baud, parity) those of the instrument?".to_string()
        }
        _ if echoed => "that begins with the question itself: switch the instrument's echo off".into(),
        Some(other) => format!("is rx_terminator right? This ends with {}: rx_terminator = {other:?}", hex(other.as_bytes())),
        None => "is rx_terminator right? It may also be a prompt, or an answer that response_timeout_ms cuts".into(),
    };
    format!("{found}: {cause}")
}

/// What a Modbus exception says, and what to do.
pub fn exception(code: u8) -> String {
    let words = match code {
        1 => "it does not know this function: the table is another (holding, input, coil, discrete)",
        2 => {
            "it has no such register: check address, count and table of the profile; some manuals count from 1"
        }
        3 => "it does not take this value or this many registers: check range and count",
        4 => "it failed: check its display or its error register",
        5 | 6 => "it is busy: lower the rate, or end what else talks to it",
        10 => "the gateway has no way to the unit: check its settings",
        11 => "no unit answers behind the gateway: check `unit`, the wiring and the speed behind it",
        _ => "see its manual",
    };
    format!("exception {code}: {words}")
}

/// What to look at after a problem: the words of the problem say which of the causes it is.
pub fn advice(problem: &str) -> &'static str {
    let has = |words: &str| problem.contains(words);
    if has("does not hold") {
        "the instrument answers: check its model, address and `unit`, then the [[signature]] of its profile"
    } else if has("exception ") || has("another unit") || has("transaction") {
        "the link itself works: check the profile and the settings of the gateway"
    } else if has("rx_terminator") || has("was answered by") || has("bytes came") {
        "the instrument answers: check line end, speed, format and echo, then the profile"
    } else if has("no answer") {
        "check address, unit, wiring and power, and that no other program holds the link"
    } else {
        "check address, wiring, power, and that no other program holds the link"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cause_has_a_remedy_of_its_own() {
        let remark = |came: &[u8]| unended(came, b"\r\n", "READ?");
        let line_end = remark(b"+1.25E-01,-2.5E-03\r");
        assert!(
            line_end
                .starts_with("19 bytes came and no line end (0D 0A) among them: \"+1.25E-01,-2.5E-03\\r\"")
        );
        assert!(line_end.contains("is rx_terminator right? This ends with 0D"), "{line_end}");
        assert!(remark(b"\xfe\x80\x06\xf8").contains("baud, parity"));
        assert!(remark(b"READ?\r1.5").contains("echo"));
        assert!(remark(b"1.5 N>").contains("prompt"));
        assert!(remark(b"1.5\x03").contains("ends with 03"));
        let all: std::collections::BTreeSet<String> = [1, 2, 3, 4, 6, 10, 11].map(exception).into();
        assert_eq!(all.len(), 7);
        assert_ne!(advice(&exception(2)), advice("no answer within 100 ms"));
    }
}
