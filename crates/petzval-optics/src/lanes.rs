//! One number of several rays at once, in two vector registers, with the operators of a number.
//!
//! There are two registers because a square root or a division takes tens of cycles, and a second one can run at the
//! same time. The width (1, 2, 4 or 8 numbers a register) is that of the [`Simd`] token, chosen at run time.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use pulp::Simd;

/// Registers in a [`Lanes`].
const REGISTERS: usize = 2;

/// The largest number of lanes on any machine; arrays that kernels read are padded to a multiple of it.
pub(crate) const MAX_LANES: usize = 8 * REGISTERS;

/// One number of each of several rays.
#[derive(Clone, Copy)]
pub(crate) struct Lanes<S: Simd> {
    simd: S,
    v: [S::f64s; REGISTERS],
}

/// One truth value per ray.
#[derive(Clone, Copy)]
pub(crate) struct Mask<S: Simd> {
    simd: S,
    v: [S::m64s; REGISTERS],
}

/// Numbers in a [`Lanes`].
pub(crate) const fn width<S: Simd>() -> usize {
    REGISTERS * S::F64_LANES
}

impl<S: Simd> Lanes<S> {
    /// The same number in every lane.
    #[inline(always)]
    pub fn splat(simd: S, value: f64) -> Self {
        Self { simd, v: [simd.splat_f64s(value); REGISTERS] }
    }

    /// The instruction set.
    #[inline(always)]
    pub fn simd(self) -> S {
        self.simd
    }

    /// The same number in every lane.
    #[inline(always)]
    pub fn constant(self, value: f64) -> Self {
        Self::splat(self.simd, value)
    }

    /// The first numbers of a slice of at least [`width`].
    #[inline(always)]
    pub fn load(simd: S, from: &[f64]) -> Self {
        let (packs, _) = S::as_simd_f64s(from);
        Self { simd, v: [packs[0], packs[1]] }
    }

    /// Overwrites the first numbers of a slice of at least [`width`].
    #[inline(always)]
    pub fn store(self, to: &mut [f64]) {
        let (packs, _) = S::as_mut_simd_f64s(to);
        packs[0] = self.v[0];
        packs[1] = self.v[1];
    }

    /// Square root.
    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.sqrt_f64s(self.v[0]), s.sqrt_f64s(self.v[1])] }
    }

    /// Absolute value.
    #[inline(always)]
    pub fn abs(self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.abs_f64s(self.v[0]), s.abs_f64s(self.v[1])] }
    }

    /// `self * b + c`, fused where the machine can.
    #[inline(always)]
    pub fn mul_add(self, b: Self, c: Self) -> Self {
        let s = self.simd;
        Self {
            simd: s,
            v: [s.mul_add_e_f64s(self.v[0], b.v[0], c.v[0]), s.mul_add_e_f64s(self.v[1], b.v[1], c.v[1])],
        }
    }

    /// The larger of the two.
    #[inline(always)]
    pub fn max(self, b: Self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.max_f64s(self.v[0], b.v[0]), s.max_f64s(self.v[1], b.v[1])] }
    }

    /// The smaller of the two.
    #[inline(always)]
    pub fn min(self, b: Self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.min_f64s(self.v[0], b.v[0]), s.min_f64s(self.v[1], b.v[1])] }
    }

    /// Where `self < b`.
    #[inline(always)]
    pub fn lt(self, b: Self) -> Mask<S> {
        let s = self.simd;
        Mask { simd: s, v: [s.less_than_f64s(self.v[0], b.v[0]), s.less_than_f64s(self.v[1], b.v[1])] }
    }

    /// Sum over the lanes, in a fixed order.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        self.simd.reduce_sum_f64s(self.simd.add_f64s(self.v[0], self.v[1]))
    }
}

impl<S: Simd> Mask<S> {
    /// Where both hold.
    #[inline(always)]
    pub fn and(self, b: Self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.and_m64s(self.v[0], b.v[0]), s.and_m64s(self.v[1], b.v[1])] }
    }

    /// Where at least one holds.
    #[inline(always)]
    pub fn or(self, b: Self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.or_m64s(self.v[0], b.v[0]), s.or_m64s(self.v[1], b.v[1])] }
    }

    /// Where it does not hold.
    #[inline(always)]
    pub fn not(self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.not_m64s(self.v[0]), s.not_m64s(self.v[1])] }
    }

    /// Whether it holds for some ray.
    #[inline(always)]
    pub fn any(self) -> bool {
        let s = self.simd;
        s.first_true_m64s(s.or_m64s(self.v[0], self.v[1])) < S::F64_LANES
    }

    /// Whether it holds for every ray.
    #[inline(always)]
    pub fn all(self) -> bool {
        !self.not().any()
    }

    /// `yes` where it holds, `no` elsewhere.
    #[inline(always)]
    pub fn select(self, yes: Lanes<S>, no: Lanes<S>) -> Lanes<S> {
        let s = self.simd;
        Lanes {
            simd: s,
            v: [s.select_f64s(self.v[0], yes.v[0], no.v[0]), s.select_f64s(self.v[1], yes.v[1], no.v[1])],
        }
    }
}

macro_rules! arithmetic {
    ($($trait:ident $name:ident $op:ident),*) => {$(
        impl<S: Simd> $trait for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: Self) -> Self {
                let s = self.simd;
                Self { simd: s, v: [s.$op(self.v[0], b.v[0]), s.$op(self.v[1], b.v[1])] }
            }
        }
        impl<S: Simd> $trait<f64> for Lanes<S> {
            type Output = Self;
            #[inline(always)]
            fn $name(self, b: f64) -> Self {
                $trait::$name(self, self.constant(b))
            }
        }
    )*};
}
arithmetic!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        let s = self.simd;
        Self { simd: s, v: [s.neg_f64s(self.v[0]), s.neg_f64s(self.v[1])] }
    }
}

impl<S: Simd> AddAssign for Lanes<S> {
    #[inline(always)]
    fn add_assign(&mut self, b: Self) {
        *self = *self + b;
    }
}

impl<S: Simd> SubAssign for Lanes<S> {
    #[inline(always)]
    fn sub_assign(&mut self, b: Self) {
        *self = *self - b;
    }
}

/// A vector of each ray.
pub(crate) type V3<S> = [Lanes<S>; 3];

/// Scalar product.
#[inline(always)]
pub(crate) fn dot<S: Simd>(a: V3<S>, b: V3<S>) -> Lanes<S> {
    a[0].mul_add(b[0], a[1].mul_add(b[1], a[2] * b[2]))
}

/// `a + s b`.
#[inline(always)]
pub(crate) fn along<S: Simd>(a: V3<S>, s: Lanes<S>, b: V3<S>) -> V3<S> {
    [s.mul_add(b[0], a[0]), s.mul_add(b[1], a[1]), s.mul_add(b[2], a[2])]
}

/// `s a`.
#[inline(always)]
pub(crate) fn scaled<S: Simd>(s: Lanes<S>, a: V3<S>) -> V3<S> {
    [s * a[0], s * a[1], s * a[2]]
}
