//! What a constant may be: a number, a count, or a list of numbers.

/// A constant as numbers, so that a study can set and scale it.
pub trait Value: Sized {
    /// Its numbers.
    fn numbers(&self) -> Vec<f64>;
    /// The value of numbers; `None` where they do not fit.
    fn from_numbers(numbers: &mut dyn Iterator<Item = f64>) -> Option<Self>;
}

impl Value for f64 {
    fn numbers(&self) -> Vec<f64> {
        vec![*self]
    }
    fn from_numbers(numbers: &mut dyn Iterator<Item = f64>) -> Option<Self> {
        numbers.next()
    }
}

impl Value for usize {
    fn numbers(&self) -> Vec<f64> {
        vec![*self as f64]
    }
    fn from_numbers(numbers: &mut dyn Iterator<Item = f64>) -> Option<Self> {
        numbers.next().filter(|v| v.is_finite() && *v >= 0.0).map(|v| (v.round() as usize).max(1))
    }
}

impl<const N: usize> Value for [f64; N] {
    fn numbers(&self) -> Vec<f64> {
        self.to_vec()
    }
    fn from_numbers(numbers: &mut dyn Iterator<Item = f64>) -> Option<Self> {
        let list: Vec<f64> = numbers.take(N).collect();
        list.try_into().ok()
    }
}
