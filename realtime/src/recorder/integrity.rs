//! What a record has lost, and where.

use serde::Serialize;
use std::collections::BTreeMap;

/// Places and gaps that are listed one by one; the sums go on.
const LISTED: usize = 100;

/// A stretch of a record that is no longer what was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DamagedStretch {
    /// First byte of the stretch.
    pub from: u64,
    /// First byte behind it.
    pub to: u64,
    /// What is wrong with it.
    pub why: String,
}

/// Messages that were written and are not there.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Gap {
    /// Their topic.
    pub topic: String,
    /// Number of the last message before them, counted from 1; 0 where the first is missing.
    pub after: u64,
    /// How many they are.
    pub count: u64,
}

/// What a reading found to be other than it was written. Nothing: every byte of the record was checked and is good.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Integrity {
    /// Why the record ends before its proper end, if it does. What would have followed is not known.
    pub cut: Option<String>,
    /// Damaged stretches, the first hundred.
    pub places: Vec<DamagedStretch>,
    /// Damaged stretches in all.
    pub damaged_places: u64,
    /// Bytes that the damaged stretches hold together.
    pub damaged_bytes: u64,
    /// What the checksum of the whole denies where no other one says where.
    pub somewhere: Option<String>,
    /// Gaps in the numbers of the messages, the first hundred.
    pub gaps: Vec<Gap>,
    /// Messages missing, by topic.
    pub missing: BTreeMap<String, u64>,
    /// What 'recover' found when it made the file anew, if it did.
    pub recovered: Option<String>,
}

impl Integrity {
    /// Whether the file itself is as it was written, from the first byte to the last.
    pub fn intact(&self) -> bool {
        self.cut.is_none() && self.damaged_places == 0 && self.somewhere.is_none()
    }

    /// Messages of a topic that are known to be missing.
    pub fn missing(&self, topic: &str) -> u64 {
        self.missing.get(topic).copied().unwrap_or(0)
    }

    pub(super) fn place(&mut self, from: u64, to: u64, why: String) {
        self.damaged_places += 1;
        self.damaged_bytes += to.saturating_sub(from);
        if self.places.len() < LISTED {
            self.places.push(DamagedStretch { from, to, why });
        }
    }

    pub(super) fn gap(&mut self, topic: &str, after: u64, count: u64) {
        *self.missing.entry(topic.to_string()).or_default() += count;
        if self.gaps.len() < LISTED {
            self.gaps.push(Gap { topic: topic.to_string(), after, count });
        }
    }

    /// The findings, one sentence each; empty if the record is complete.
    pub fn sentences(&self) -> Vec<String> {
        let damaged = |DamagedStretch { from, to, why }: &DamagedStretch| {
            format!("bytes {from} to {to} are damaged: {why}")
        };
        let mut list: Vec<String> = self.places.iter().map(damaged).collect();
        let unlisted = self.damaged_places - self.places.len() as u64;
        if unlisted > 0 {
            list.push(format!("{unlisted} more stretches are damaged, {} bytes in all", self.damaged_bytes));
        }
        list.extend(self.somewhere.clone());
        for Gap { topic, after, count } in &self.gaps {
            let what = match topic.as_str() {
                super::CYCLES => "cycles",
                super::PASSES => "passes",
                _ => "events",
            };
            list.push(format!("{count} {what} are missing after the first {after}"));
        }
        if let Some(why) = &self.cut {
            list.push(format!("the record is cut, and what followed is not known: {why}"));
        }
        if let Some(why) = &self.recovered {
            list.push(format!("the record was made whole by 'muprime recover', which had found: {why}"));
        }
        list
    }
}
