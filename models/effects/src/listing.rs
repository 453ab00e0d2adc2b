//! The library as data, for `muprime model effects --json`.

use crate::effect::{Law, Need, Place};
use serde::Serialize;

/// One effect as the listing shows it.
#[derive(Debug, Serialize)]
pub struct Entry {
    /// Name.
    pub name: &'static str,
    /// Where it sits.
    pub place: Place,
    /// One sentence on the mechanism.
    pub summary: &'static str,
    /// Where form and ranges come from.
    pub source: &'static str,
    /// What a table must hold before it can be seen.
    pub needs: &'static [Need],
    /// Its functional forms and their parameters.
    pub laws: &'static [Law],
}

/// Every effect of the library.
pub fn entries() -> Vec<Entry> {
    crate::library()
        .iter()
        .map(|effect| Entry {
            name: effect.name(),
            place: effect.place(),
            summary: effect.summary(),
            source: effect.source(),
            needs: effect.needs(),
            laws: effect.laws(),
        })
        .collect()
}
