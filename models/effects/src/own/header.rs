//! What the comments above a table of an effect state.

use strsim::levenshtein;

/// What they may state.
const KEYS: [&str; 3] = ["place", "summary", "size_sd"];
/// Words that are near to a key and are none: remarks may begin with them.
const WORDS: [&str; 4] = ["plate", "plane", "pace", "summer"];

/// Each of the keys with its line, from 1, and its value.
///
/// # Errors
/// A comment that states a key in another writing, in another place or a second time.
pub fn stated(text: &str) -> Result<[Option<(usize, &str)>; 3], String> {
    let (mut all, mut above) = ([None; 3], true);
    for (line, row) in (1..).zip(text.lines()) {
        let comment = row.strip_prefix('#').unwrap_or_default();
        above &= row.starts_with('#') || row.trim().is_empty();
        let Some(at) = comment.find([':', '=']) else { continue };
        let (word, value) = (comment[..at].trim_start_matches('#').trim(), comment[at + 1..].trim());
        let Some(key) = KEYS.iter().position(|key| meant(word, key)) else { continue };
        if !above || all[key].is_some() || word != KEYS[key] || comment[at..].starts_with('=') {
            let keys = KEYS.map(|key| format!("`# {key}: ...`")).join(", ");
            return Err(format!(
                "line {line}: '{word}' is not read here: above the row of column names each of {keys} may stand once, \
                 and a remark has no ':' or '=' after such a word"
            ));
        }
        all[key] = Some((line, value));
    }
    Ok(all)
}

/// Whether a word is a key in any writing, or one with a letter or two wrong.
fn meant(word: &str, key: &str) -> bool {
    let letters = |text: &str| text.to_lowercase().replace(|c: char| !c.is_alphanumeric(), "");
    let (word, key) = (letters(word), letters(key));
    let moved = word.len() == key.len() && word.chars().all(|c| key.contains(c));
    (moved || levenshtein(&word, &key) <= key.len() / 3) && !WORDS.contains(&&*word)
}

#[cfg(test)]
mod tests {
    use super::stated;

    const TABLE: &str = "speed_m_s,friction_change\n0.005,0\n0.08,0.3\n";

    #[test]
    fn keys_are_read_above_the_names_and_remarks_are_free() {
        let head = "# made on Monday: sample 3\n\n# plate: glass = new\n# see summary: no\n#place: finger\n\
            # just words\n# https://example.org\n# size_sd : 0.5\n# plane: xy\n# Summer: 2026\n# summary: a: b\n# sd: 2\n# speed=20 mm/s\n";
        let text = format!("{head}{TABLE}# a remark below: 3\n");
        assert_eq!(stated(&text).unwrap(), [Some((5, "finger")), Some((11, "a: b")), Some((8, "0.5"))]);
        assert_eq!(stated(TABLE).unwrap(), [None; 3]);
    }

    #[test]
    fn a_key_in_another_writing_or_place_is_refused_with_its_line_and_the_keys() {
        for wrong in [
            "# sice_sd: 0.1",
            "# Place: skin",
            "# plcae: skin",
            "# size sd: 0.1",
            "# size_sd=0.01",
            "# SIZE-SD: 0.01",
            "# size: 0.01",
            "## sumary: Sweat.",
        ] {
            let why = stated(&format!("# mine\n{wrong}\n{TABLE}")).unwrap_err();
            let word = wrong.trim_start_matches(['#', ' ']).split([':', '=']).next().unwrap();
            assert!(why.starts_with(&format!("line 2: '{word}' is not read")), "{why}");
            assert!(why.contains("`# place: ...`, `# summary: ...`, `# size_sd: ...`"), "{why}");
        }
        for text in
            [format!("{TABLE}# place: finger\n"), format!("#\n#\n# place: plate\n# place: plate\n{TABLE}")]
        {
            let why = stated(&text).unwrap_err();
            assert!(why.starts_with("line 4: 'place' is not read here: above"), "{why}");
        }
    }
}
