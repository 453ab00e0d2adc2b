//! A candidate cause of a user's own, as data: a table of how friction changes over the conditions.
//!
//! The table is a full grid like that of a law ([`models::law_table`]). Its answer `friction_change` is the
//! relative change of friction at size 1: the reading is that of the contact times
//! `1 + size * friction_change`. Beyond its grid it cannot tell, and the reading is not a number. Comments
//! before the header state the rest:
//!
//! ```text
//! # place: contact
//! # summary: Sweat that comes with the temperature.
//! # size_sd: 1
//! temperature_c,friction_change
//! 20,0
//! 40,0.3
//! ```

mod header;

use crate::effect::{Effect, Law, Location, Parameter};
use crate::library::{KNOWN, library};
use models::law_table::{LawTable, TabulatedQuantity};
use models::{Condition, OutOfDomain};
use std::sync::{PoisonError, RwLock};

/// What such a table answers.
const CHANGE: TabulatedQuantity = TabulatedQuantity {
    what: "an effect table",
    variables: models::law_table::VARIABLES.len(),
    columns: &[(COLUMN, [-1.0, 10.0])],
    meaning: "the relative change of friction at size 1",
    still: None,
};
/// The column that makes a table one of an effect.
pub const COLUMN: &str = "friction_change";
/// Farthest size, in deviations of its prior.
const FARTHEST: f64 = 8.0;
/// Longest name.
const LONGEST: usize = 60;

/// The table of an effect, and the text that it was read from.
pub struct OwnTable {
    /// The file's text.
    pub text: String,
    change: LawTable,
}

impl OwnTable {
    /// Factor on friction at this size.
    ///
    /// # Errors
    /// A condition beyond the grid.
    pub fn factor(&self, size: f64, condition: &Condition) -> Result<f64, OutOfDomain> {
        Ok((1.0 + size * self.change.at(condition)?[0]).max(0.0))
    }
}

/// Effects are known by their number wherever hypotheses are spelled, and are compared by it. So one that
/// comes as data gets a number for as long as the program runs; the same name and text get the same one.
static OWN: RwLock<Vec<&'static Effect>> = RwLock::new(Vec::new());

/// The effect of that number: of the library, of the open set, or of the user.
///
/// # Panics
/// A number that nobody was given.
pub fn at(number: usize) -> &'static Effect {
    let own = || OWN.read().unwrap_or_else(PoisonError::into_inner)[number - KNOWN.len()];
    KNOWN.get(number).copied().unwrap_or_else(own)
}

/// Names that a verdict has for something else.
const ANSWERS: [&str; 4] = ["unknown", "no_gap", "named", "ambiguous"];

/// Reads a user's own effect; its number.
///
/// # Errors
/// A name that is not made of letters, digits and `_`, or one of the library; a table that is refused, with
/// its line.
pub fn own(name: &str, text: &str) -> Result<usize, String> {
    // Spreadsheets put a byte-order mark before the first comment.
    let text = text.trim_start_matches('\u{feff}');
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    let is_name = !name.is_empty() && name.len() <= LONGEST && name.chars().all(plain);
    for (refused, why) in [
        (!is_name, "is not a name of an effect: rename the file to letters a to z, digits and _"),
        (ANSWERS.contains(&name), "is an answer of a verdict: rename the file"),
        (KNOWN.iter().any(|e| e.name == name), "is an effect of the library: rename the file"),
    ] {
        if refused {
            return Err(format!("'{name}' {why}"));
        }
    }
    let mut all = OWN.write().unwrap_or_else(PoisonError::into_inner);
    let same = |e: &&Effect| e.name == name && e.own.is_some_and(|own| own.text == text);
    if let Some(there) = all.iter().position(same) {
        return Ok(KNOWN.len() + there);
    }
    let [place, summary, sd] = header::stated(text)?;
    let refused =
        |line: usize, what: String, needed: &str| Err(format!("line {line}: {what}: {needed} is needed"));
    let (line, place) = place.unwrap_or((0, "contact"));
    let Some(place) = Location::ALL.into_iter().find(|p| p.name() == place) else {
        return refused(line, format!("place '{place}'"), "contact, finger, plate or instrument");
    };
    let (line, stated_sd) = sd.unwrap_or((0, "1"));
    let Some(sd) = stated_sd.parse().ok().filter(|sd| *sd > 0.0 && *sd < f64::INFINITY) else {
        return refused(line, format!("size_sd '{stated_sd}'"), "a number above zero");
    };
    let change = LawTable::answering(&CHANGE, text).map_err(|why| why.to_string())?;
    // For as long as the program runs: a diagnosis holds effects by reference, and a user's own are few.
    let size = Parameter::signed("size", "1", sd, -FARTHEST * sd, FARTHEST * sd);
    let summary = summary.map_or("Friction changes by a table of the user's own.", |(_, summary)| summary);
    let effect = Effect {
        name: name.to_string().leak(),
        place,
        summary: summary.to_string().leak(),
        source: "a table of the user's own",
        laws: vec![Law::new("table", vec![size].leak())].leak(),
        own: Some(Box::leak(Box::new(OwnTable { text: text.to_string(), change }))),
        ..Effect::NONE
    };
    all.push(Box::leak(Box::new(effect)));
    Ok(KNOWN.len() + all.len() - 1)
}

/// The effect of that name: of the library, or the latest of the user.
pub fn by_name(name: &str) -> Option<&'static Effect> {
    let own = || {
        let all = OWN.read().unwrap_or_else(PoisonError::into_inner);
        all.iter().rev().copied().find(|effect| effect.name == name)
    };
    library().iter().copied().find(|effect| effect.name == name).or_else(own)
}

#[cfg(test)]
mod tests {
    use super::{at, own};

    const TABLE: &str = "speed_m_s,friction_change\n0.005,0\n0.08,0.3\n";

    #[test]
    fn a_byte_order_mark_changes_nothing() {
        let text = format!("# place: finger\n# summary: Sweat.\n# size_sd: 0.1\n{TABLE}");
        let plain = own("marked", &text).unwrap();
        assert_eq!(own("marked", &format!("\u{feff}{text}")).unwrap(), plain);
        let effect = at(plain);
        assert_eq!((effect.place.name(), effect.summary), ("finger", "Sweat."));
        assert!(!effect.own.unwrap().text.starts_with('\u{feff}'));
        let other = own("marked_first", &format!("\u{feff}{text}")).unwrap();
        assert_eq!((at(other).place.name(), at(other).summary), ("finger", "Sweat."));
    }

    #[test]
    fn a_value_that_is_none_is_refused_with_its_line() {
        for (head, part) in [
            (
                "# mine\n# place: skin\n",
                "line 2: place 'skin': contact, finger, plate or instrument is needed",
            ),
            ("# size_sd: -1\n", "line 1: size_sd '-1': a number above zero is needed"),
            ("\n# size_sd: NaN\n", "line 2: size_sd 'NaN'"),
            ("# size_sd: inf\n", "line 1: size_sd 'inf'"),
            ("# size_sd: small\n", "line 1: size_sd 'small'"),
        ] {
            let why = own("refused", &format!("{head}{TABLE}")).unwrap_err();
            assert!(why.contains(part), "{head}: {why}");
        }
    }
}
