//! Double-double arithmetic: a number as an unevaluated sum of two `f64`, about 32 decimal digits.
//!
//! Error-free transformations of Dekker (1971) and Knuth; the product uses the fused multiply-add.
//! Why: normal equations square the condition number of a design. With 2^-104 of relative precision even
//! a condition of 1e10 squared leaves 11 digits, and the solver stays a plain Cholesky.

use std::ops::{Add, Div, Mul, Sub};

/// An unevaluated sum `hi + lo` with `|lo| <= ulp(hi) / 2`.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct DoubleDouble {
    hi: f64,
    lo: f64,
}

impl DoubleDouble {
    /// Zero.
    pub const ZERO: Self = DoubleDouble { hi: 0.0, lo: 0.0 };

    /// The exact product of two `f64`.
    pub fn product(a: f64, b: f64) -> Self {
        let hi = a * b;
        DoubleDouble { hi, lo: a.mul_add(b, -hi) }
    }

    /// Rounded to the nearest `f64`.
    pub fn value(self) -> f64 {
        self.hi + self.lo
    }

    /// Square root; NaN below zero.
    pub fn sqrt(self) -> Self {
        if self.hi == 0.0 {
            return Self::ZERO;
        }
        // One Newton step from the f64 root doubles its digits.
        let root = self.hi.sqrt();
        let rest = self - Self::product(root, root);
        Self::quick_sum(root, rest.hi / (2.0 * root))
    }

    fn sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        let part = hi - a;
        DoubleDouble { hi, lo: (a - (hi - part)) + (b - part) }
    }

    fn quick_sum(a: f64, b: f64) -> Self {
        let hi = a + b;
        DoubleDouble { hi, lo: b - (hi - a) }
    }
}

impl From<f64> for DoubleDouble {
    fn from(hi: f64) -> Self {
        DoubleDouble { hi, lo: 0.0 }
    }
}

impl Add for DoubleDouble {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        let high = Self::sum(self.hi, other.hi);
        let low = Self::sum(self.lo, other.lo);
        let first = Self::quick_sum(high.hi, high.lo + low.hi);
        Self::quick_sum(first.hi, first.lo + low.lo)
    }
}

impl Sub for DoubleDouble {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self + DoubleDouble { hi: -other.hi, lo: -other.lo }
    }
}

impl Mul for DoubleDouble {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let p = Self::product(self.hi, other.hi);
        Self::quick_sum(p.hi, p.lo + (self.hi * other.lo + self.lo * other.hi))
    }
}

impl Div for DoubleDouble {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let first = self.hi / other.hi;
        let rest = self - other * first.into();
        let second = rest.hi / other.hi;
        let rest = rest - other * second.into();
        Self::quick_sum(first, second) + (rest.hi / other.hi).into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_square_of_the_root_of_two_is_two_to_31_digits() {
        let root = DoubleDouble::from(2.0).sqrt();
        let error = (root * root - 2.0.into()).value();
        assert!(error.abs() < 1e-31, "{error}");
    }

    #[test]
    fn one_third_keeps_what_f64_loses() {
        let third = DoubleDouble::from(1.0) / 3.0.into();
        let error = (third * 3.0.into() - 1.0.into()).value();
        assert!(error.abs() < 1e-31, "{error}");
        // A sum that cancels to nothing in f64.
        let tiny = DoubleDouble::from(1.0) + 1e-25.into() - 1.0.into();
        assert!((tiny.value() - 1e-25).abs() < 1e-40);
    }
}
