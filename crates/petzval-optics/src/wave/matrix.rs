//! Products of complex matrices, computed as real products that a linear-algebra library does fast.

use nalgebra::DMatrix;

/// A complex matrix.
#[derive(Clone, Debug)]
pub(super) struct Complex {
    pub re: DMatrix<f64>,
    pub im: DMatrix<f64>,
}

impl Complex {
    pub fn zeros(rows: usize, columns: usize) -> Self {
        Self { re: DMatrix::zeros(rows, columns), im: DMatrix::zeros(rows, columns) }
    }

    /// `exp(i a_r b_c)`.
    pub fn phases(a: &[f64], b: &[f64]) -> Self {
        Self {
            re: DMatrix::from_fn(a.len(), b.len(), |r, c| (a[r] * b[c]).cos()),
            im: DMatrix::from_fn(a.len(), b.len(), |r, c| (a[r] * b[c]).sin()),
        }
    }

    pub fn conjugate(&self) -> Self {
        Self { re: self.re.clone(), im: -&self.im }
    }

    pub fn transpose(&self) -> Self {
        Self { re: self.re.transpose(), im: self.im.transpose() }
    }

    /// The product, from three real products.
    pub fn times(&self, b: &Self) -> Self {
        let (rr, ii) = (&self.re * &b.re, &self.im * &b.im);
        let both = (&self.re + &self.im) * (&b.re + &b.im);
        Self { im: both - &rr - &ii, re: rr - ii }
    }
}
