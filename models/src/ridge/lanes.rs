//! A SIMD vector with operators, so that the kernel reads as algebra.
//!
//! pulp chooses the instruction set when the program runs. Every operation here works lane by lane, so
//! AVX2 and AVX-512 give the same bits; a machine without fused multiply-add rounds differently.

use pulp::{Arch, Simd};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Which instructions the kernel uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Instructions {
    /// The widest vectors that this machine has.
    #[default]
    Widest,
    /// Vectors of 512 bits.
    Avx512,
    /// Vectors of 256 bits, with no instruction of AVX-512.
    Avx2,
    /// One number at a time.
    Scalar,
}

impl Instructions {
    /// None where this machine does not have them.
    pub(super) fn arch(self) -> Option<Arch> {
        match self {
            Instructions::Widest => Some(Arch::new()),
            Instructions::Scalar => Some(Arch::Scalar),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx512 => pulp::x86::V4::try_new().map(Arch::V4),
            #[cfg(target_arch = "x86_64")]
            Instructions::Avx2 => pulp::x86::V3::try_new().map(Arch::V3),
            #[cfg(not(target_arch = "x86_64"))]
            Instructions::Avx512 | Instructions::Avx2 => None,
        }
    }

    /// Whether this machine has them.
    pub fn here(self) -> bool {
        self.arch().is_some()
    }
}

/// One vector of f64 in the instruction set `S`.
#[derive(Clone, Copy)]
pub(super) struct Lanes<S: Simd> {
    simd: S,
    pub(super) v: S::f64s,
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
    pub(super) fn min(self, b: Self) -> Self {
        Lanes { simd: self.simd, v: self.simd.min_f64s(self.v, b.v) }
    }

    #[inline(always)]
    pub(super) fn sum(self) -> f64 {
        self.simd.reduce_sum_f64s(self.v)
    }
}

macro_rules! operators {
    ($($operator:ident $method:ident $instruction:ident;)*) => {
        $(impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, b: Self) -> Self {
                Lanes { simd: self.simd, v: self.simd.$instruction(self.v, b.v) }
            }
        })*
    };
}

operators! {
    Add add add_f64s;
    Sub sub sub_f64s;
    Mul mul mul_f64s;
    Div div div_f64s;
}

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Lanes { simd: self.simd, v: self.simd.neg_f64s(self.v) }
    }
}
