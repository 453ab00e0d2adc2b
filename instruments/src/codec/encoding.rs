//! Texts of other programs: UTF-8 and UTF-16 by their mark, UTF-8 where it is that, else Windows-1252, which
//! editors of DBC files and data sheets write.

use encoding_rs::{Encoding, UTF_8, WINDOWS_1252};
use std::borrow::Cow;

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
    let (encoding, mark) = Encoding::for_bom(bytes).unwrap_or((UTF_8, 0));
    let bytes = &bytes[mark..];
    let strict = encoding.decode_without_bom_handling_and_without_replacement(bytes);
    if encoding != UTF_8 {
        return strict.map(Cow::into_owned).ok_or(NotText::Utf16);
    }
    if let Some(at) = bytes.iter().position(|byte| *byte == 0) {
        return Err(NotText::Zero(at));
    }
    Ok(strict.unwrap_or_else(|| WINDOWS_1252.decode_without_bom_handling(bytes).0).into_owned())
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
