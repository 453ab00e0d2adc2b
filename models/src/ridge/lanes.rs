//! A SIMD vector with operators, so that the kernel reads as algebra.
//!
//! pulp chooses the instruction set when the program runs. Every operation here works lane by lane, so
//! AVX2 and AVX-512 give the same bits; a machine without fused multiply-add rounds differently.

use pulp::Simd;
use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// One vector of f64 in the instruction set `S`.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S: Simd> {
    simd: S,
    v: S::f64s,
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    pub(super) fn of(simd: S, v: S::f64s) -> Self {
        Lanes { simd, v }
    }

    #[inline(always)]
    pub(super) fn splat(simd: S, x: f64) -> Self {
        Lanes { simd, v: simd.splat_f64s(x) }
    }

    #[inline(always)]
    pub(super) fn raw(self) -> S::f64s {
        self.v
    }

    /// self * b + c.
    #[inline(always)]
    pub(super) fn mul_add(self, b: Self, c: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.mul_add_e_f64s(self.v, b.v, c.v) }
    }

    /// c - self * b.
    #[inline(always)]
    pub(super) fn neg_mul_add(self, b: Self, c: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.negate_mul_add_e_f64s(self.v, b.v, c.v) }
    }

    /// self * b - c * d.
    #[inline(always)]
    pub(super) fn cross(self, b: Self, c: Self, d: Self) -> Self {
        c.neg_mul_add(d, self * b)
    }

    #[inline(always)]
    pub(super) fn over(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.div_f64s(self.v, b.v) }
    }

    #[inline(always)]
    pub(super) fn min(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.min_f64s(self.v, b.v) }
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        self.simd.reduce_sum_f64s(self.v)
    }
}

impl<S: Simd> Add for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn add(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.add_f64s(self.v, b.v) }
    }
}

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl<S: Simd> Sub for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.sub_f64s(self.v, b.v) }
    }
}

impl<S: Simd> Mul for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.mul_f64s(self.v, b.v) }
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes { simd: self.simd, v: self.simd.neg_f64s(self.v) }
    }
}
