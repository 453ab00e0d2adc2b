//! Numbers that start on a cache line, so that the vectors of a row do not lie across two.

use std::ops::{Deref, DerefMut};

/// Values in a line of the cache (64 bytes).
const LINE: usize = 8;

/// A fixed number of f64, the first on a cache line.
#[derive(Debug, Default)]
pub(super) struct Field {
    /// The values, with room before them to move to the next line.
    places: Vec<f64>,
    start: usize,
    count: usize,
}

impl Field {
    pub(super) fn zeros(count: usize) -> Field {
        let places = vec![0.0; count + LINE - 1];
        let byte = places.as_ptr().addr() % (8 * LINE);
        let start = ((8 * LINE - byte) % (8 * LINE)) / 8;
        Field { places, start, count }
    }
}

impl From<&[f64]> for Field {
    fn from(values: &[f64]) -> Field {
        let mut field = Field::zeros(values.len());
        field.copy_from_slice(values);
        field
    }
}

/// Another allocation has its first line elsewhere.
impl Clone for Field {
    fn clone(&self) -> Field {
        Field::from(&**self)
    }
}

impl Deref for Field {
    type Target = [f64];
    #[inline(always)]
    fn deref(&self) -> &[f64] {
        &self.places[self.start..self.start + self.count]
    }
}

impl DerefMut for Field {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.places[self.start..self.start + self.count]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_and_its_copy_start_on_a_line() {
        for count in [0, 1, 7, 8, 400, 100_000] {
            let field = Field::from(&(0..count).map(|v| v as f64).collect::<Vec<_>>()[..]);
            let copy = field.clone();
            assert_eq!(&*field, &*copy);
            for one in [&field, &copy] {
                assert_eq!(one.as_ptr().addr() % 64, 0, "{count}");
                assert_eq!(one.len(), count);
            }
        }
    }
}
