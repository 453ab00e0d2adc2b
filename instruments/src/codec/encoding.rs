//! Texts of other programs: UTF-8 and UTF-16 by their mark, UTF-8 where it is that, else Windows-1252, which
//! editors of DBC files and data sheets write.

/// What Windows-1252 has between 0x80 and 0x9F; the rest of it is Latin-1.
const WINDOWS: &str = "\u{20ac}\u{81}\u{201a}\u{192}\u{201e}\u{2026}\u{2020}\u{2021}\u{2c6}\u{2030}\u{160}\u{2039}\u{152}\u{8d}\u{17d}\u{8f}\
    \u{90}\u{2018}\u{2019}\u{201c}\u{201d}\u{2022}\u{2013}\u{2014}\u{2dc}\u{2122}\u{161}\u{203a}\u{153}\u{9d}\u{17e}\u{178}";

/// Bytes that are no text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NotText {
    /// UTF-16 that is cut, or has half a pair.
    #[error("its UTF-16 is damaged")]
    Utf16,
    /// The place of a byte of zero.
    #[error("it is not text: byte {0} is zero")]
    Zero(usize),
}

/// The text, without a mark of its encoding.
///
/// # Errors
/// UTF-16 that is cut or damaged; bytes of zero, which no text has.
pub fn decoded(bytes: &[u8]) -> Result<String, NotText> {
    let wide = |rest: &[u8], read: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = rest.chunks_exact(2).map(|pair| read([pair[0], pair[1]])).collect();
        String::from_utf16(&units).ok().filter(|_| rest.len().is_multiple_of(2)).ok_or(NotText::Utf16)
    };
    let bytes = match bytes {
        [0xff, 0xfe, rest @ ..] => return wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => return wide(rest, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => rest,
        bytes => bytes,
    };
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        return Err(NotText::Zero(at));
    }
    Ok(std::str::from_utf8(bytes).map_or_else(
        |_| {
            let letter = |byte: &u8| match byte {
                0x80..=0x9f => WINDOWS.chars().nth(usize::from(byte - 0x80)).unwrap_or('\u{fffd}'),
                byte => char::from(*byte),
            };
            bytes.iter().map(letter).collect()
        },
        String::from,
    ))
}

#[cfg(test)]
mod tests {
    use super::decoded;

    #[test]
    fn encodings_of_editors() {
        let text = "T [°C] – µm €";
        assert_eq!(decoded(text.as_bytes()).unwrap(), text);
        assert_eq!(decoded(&[b"\xef\xbb\xbf", text.as_bytes()].concat()).unwrap(), text);
        assert_eq!(decoded(b"T [\xb0C] \x96 \xb5m \x80").unwrap(), text);
        let wide = |mark: &[u8], of: fn(u16) -> [u8; 2]| {
            let units: Vec<u8> = text.encode_utf16().flat_map(of).collect();
            decoded(&[mark, &units].concat())
        };
        assert_eq!(wide(b"\xff\xfe", u16::to_le_bytes).unwrap(), text);
        assert_eq!(wide(b"\xfe\xff", u16::to_be_bytes).unwrap(), text);
        assert!(decoded(b"a\0b").is_err() && decoded(b"\xff\xfea").is_err());
    }
}
