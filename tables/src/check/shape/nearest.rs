//! The known name that a misspelt one is nearest to.

use runs::input::unit_of;
use strsim::levenshtein;

/// What to say of the known name that a misspelt one is nearest to.
pub fn nearest(name: &str, known: &[&str]) -> Option<String> {
    nearest_of(name, known).map(|best| match in_its_unit(name, best) {
        true => format!("did you mean `{best}`?"),
        false => format!("did you mean `{best}`? It is in {}, or a text with its unit", unit_of(best)),
    })
}

/// Whether a misspelt key names the unit of the key that was meant, or none.
pub fn in_its_unit(name: &str, meant: &str) -> bool {
    let unit = unit_of(meant);
    unit.is_empty() || unit == unit_of(name) || meant.starts_with(&format!("{name}_"))
}

/// The known name that a misspelt one is nearest to.
pub fn nearest_of<'k>(name: &str, known: &[&'k str]) -> Option<&'k str> {
    // A name without its unit is meant as often as a misspelt one.
    let of = |k: &str| if k.starts_with(&format!("{name}_")) { 1 } else { levenshtein(name, k) };
    let (distance, best) = known.iter().map(|k| (of(k), *k)).min()?;
    (distance <= 2.max(name.len() / 3)).then_some(best)
}
