//! Set-points on their way to the wire: their ranges, their bytes, their lines of text.

use super::{Profile, SetId};
use crate::codec::pattern::Pattern;
use crate::field::Field;
use crate::schema::Set;

/// One block of set-points, compiled.
#[derive(Debug, Clone)]
pub(super) struct CompiledSet {
    /// Block and place; `None` for a line of text.
    pub block: Option<(usize, Field)>,
    pub scale: f64,
    /// The line of text, with the set-points whose values stand in it; `None` for its own.
    pub line: Option<(Pattern, Vec<Option<SetId>>)>,
}

impl Profile {
    /// Whether a set-point may take `value` (in its `unit`).
    ///
    /// # Errors
    /// A value outside the stated range, or not a number.
    pub fn allows(&self, set: SetId, value: f64) -> Result<(), SetError> {
        let (low, high) = self.description.set[set.0].range.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
        if value >= low && value <= high { Ok(()) } else { Err(SetError { value, low, high }) }
    }

    /// Encodes a set-point (in its `unit`) into its block's bytes.
    ///
    /// # Errors
    /// A value outside the stated range, or not a number, is refused.
    pub fn encode_set(&self, set: SetId, value: f64, block: &mut [u8]) -> Result<(), SetError> {
        self.allows(set, value)?;
        let compiled = &self.sets[set.0];
        if let Some((_, field)) = compiled.block {
            field.write(block, value / compiled.scale);
        }
        Ok(())
    }

    /// A set-point's value (in its `unit`) from its block's bytes.
    pub fn decode_set(&self, set: SetId, block: &[u8]) -> Option<f64> {
        let compiled = &self.sets[set.0];
        compiled.block?.1.read(block).map(|raw| raw * compiled.scale)
    }

    /// The set-points of one block.
    pub fn sets_of(&self, block: usize) -> impl Iterator<Item = SetId> {
        let stands = move |set: &CompiledSet| set.block.is_some_and(|(stands, _)| stands == block);
        self.sets.iter().enumerate().filter(move |(_, set)| stands(set)).map(|(i, _)| SetId(i))
    }

    /// The line of text that carries a set-point, and what its answer begins with; `None` where the
    /// set-point is not a line of text. `newest` gives the values of others in the line.
    pub fn line(
        &self,
        set: SetId,
        value: f64,
        newest: &dyn Fn(SetId) -> f64,
    ) -> Option<(String, Option<&str>)> {
        let description = &self.description.set[set.0];
        let (for_value, for_zero) =
            description.answer.as_ref().map(|(v, z)| (v.as_str(), z.as_str())).unzip();
        let answer = if value == 0.0 { for_zero } else { for_value };
        if let (true, Some(zero)) = (value == 0.0, &description.send_zero) {
            return Some((zero.clone(), answer));
        }
        let (pattern, owners) = self.sets[set.0].line.as_ref()?;
        let value = |owner: &Option<SetId>| {
            owner.map_or_else(|| self.quantise(set, value), |other| self.quantise(other, newest(other)))
        };
        let values: Vec<f64> = owners.iter().map(value).collect();
        // Counts are whole numbers; the scale says how many decimals the unit's value needs.
        let decimals = (-self.sets[set.0].scale.log10()).ceil().clamp(0.0, 12.0) as u8;
        Some((pattern.write(&values, decimals), answer))
    }

    /// The set-point that a line of text carries, as an emulator hears it: its own value, and those of others
    /// that the line holds. A line without a number is 1.
    pub fn heard(&self, set: SetId, line: &str) -> Option<Vec<(SetId, f64)>> {
        let (pattern, owners) = self.sets[set.0].line.as_ref()?;
        let values = pattern.read(line)?;
        let named = owners.iter().map(|owner| owner.unwrap_or(set));
        let heard: Vec<(SetId, f64)> = named.zip(values).collect();
        Some(if heard.is_empty() { vec![(set, 1.0)] } else { heard })
    }

    /// The value of a heartbeat's count: it runs round at the end of its range, else of its register.
    pub fn heartbeat_value(&self, set: SetId, count: u32) -> f64 {
        let last = self.sets[set.0].block.map_or(65535.0, |(_, field)| field.number.limits().1);
        let (low, high) = self.description.set[set.0].range.unwrap_or((0.0, last));
        low + f64::from(count) % (high.min(last) - low + 1.0)
    }

    /// What feeds the instrument's own watchdog, if it has one.
    pub fn heartbeat(&self) -> Option<&Set> {
        self.set("heartbeat").map(|set| &self.description.set[set.0])
    }

    /// The value nearest to `value` that the set-point can take (both in its `unit`).
    pub fn quantise(&self, set: SetId, value: f64) -> f64 {
        let scale = self.sets[set.0].scale;
        (value / scale).round() * scale
    }
}

/// A set-point was refused.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the set-point {value} lies outside {low} to {high}")]
pub struct SetError {
    /// The value, in the set-point's unit.
    pub value: f64,
    /// Smallest.
    pub low: f64,
    /// Largest.
    pub high: f64,
}
