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

use crate::effect::{Effect, Law, Location, Parameter};
use crate::library::{KNOWN, library};
use models::condition::{Condition, OutOfDomain};
use models::law_table::{Answers, LawTable};
use std::sync::{PoisonError, RwLock};

/// What such a table answers.
const CHANGE: Answers = Answers {
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

    /// Whether the table reaches a condition; else why not.
    ///
    /// # Errors
    /// The first variable that lies beyond.
    pub fn reaches(&self, condition: &Condition) -> Result<(), OutOfDomain> {
        self.change.at(condition).map(drop)
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
    let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if name.is_empty() || name.len() > LONGEST || !name.chars().all(plain) {
        return Err(format!(
            "'{name}' is not a name of an effect: rename the file to letters a to z, digits and _"
        ));
    }
    if ANSWERS.contains(&name) {
        return Err(format!("'{name}' is an answer of a verdict: rename the file"));
    }
    if KNOWN.iter().any(|e| e.name == name) {
        return Err(format!("'{name}' is an effect of the library: rename the file"));
    }
    let mut all = OWN.write().unwrap_or_else(PoisonError::into_inner);
    let same = |e: &&Effect| e.name == name && e.own.is_some_and(|own| own.text == text);
    if let Some(there) = all.iter().position(same) {
        return Ok(KNOWN.len() + there);
    }
    let stated = |key: &str| {
        let of =
            |line: &'_ str| Some(line.strip_prefix('#')?.trim_start().strip_prefix(key)?.trim().to_string());
        text.lines().take_while(|line| line.starts_with('#')).find_map(of)
    };
    let place = stated("place:").unwrap_or_else(|| "contact".into());
    let nowhere = || format!("place '{place}': contact, finger, plate or instrument is needed");
    let place = Location::ALL.into_iter().find(|p| p.name() == place).ok_or_else(nowhere)?;
    let sd = stated("size_sd:")
        .map_or(Ok(1.0), |text| text.parse::<f64>().map_err(|_| text))
        .and_then(|sd| if sd > 0.0 && sd.is_finite() { Ok(sd) } else { Err(sd.to_string()) });
    let sd = sd.map_err(|text| format!("size_sd '{text}': a number above zero is needed"))?;
    let change = LawTable::answering(&CHANGE, text).map_err(|why| why.to_string())?;
    // For as long as the program runs: a diagnosis holds effects by reference, and a user's own are few.
    let size = Parameter::signed("size", "1", sd, -FARTHEST * sd, FARTHEST * sd);
    let summary =
        stated("summary:").unwrap_or_else(|| "Friction changes by a table of the user's own.".into());
    let effect = Effect {
        name: name.to_string().leak(),
        place,
        summary: summary.leak(),
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
