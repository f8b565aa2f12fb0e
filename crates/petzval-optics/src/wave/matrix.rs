//! Complex matrices as pairs of real ones, whose products a linear-algebra library does fast.

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

    /// A matrix of `rows` rows, each element computed from the given matrix, its row and its column: the same real function of the real
    /// and of the imaginary part.
    pub fn from_rows(of: &Self, rows: usize, element: impl Fn(&DMatrix<f64>, usize, usize) -> f64) -> Self {
        let part = |of: &DMatrix<f64>| DMatrix::from_fn(rows, of.ncols(), |r, c| element(of, r, c));
        Self { re: part(&of.re), im: part(&of.im) }
    }

    pub fn transpose(&self) -> Self {
        Self { re: self.re.transpose(), im: self.im.transpose() }
    }

    pub fn scaled(self, by: f64) -> Self {
        Self { re: self.re * by, im: self.im * by }
    }

    pub fn times_i(self) -> Self {
        Self { re: -self.im, im: self.re }
    }

    pub fn times_minus_i(self) -> Self {
        Self { re: self.im, im: -self.re }
    }

    pub fn add(a: &Self, b: &Self) -> Self {
        Self { re: &a.re + &b.re, im: &a.im + &b.im }
    }

    /// The product with a real matrix on its left.
    pub fn times_left(&self, real: &DMatrix<f64>) -> Self {
        Self { re: real * &self.re, im: real * &self.im }
    }
}

#[cfg(test)]
impl Complex {
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

    /// The product.
    pub fn times(&self, b: &Self) -> Self {
        Self { re: &self.re * &b.re - &self.im * &b.im, im: &self.re * &b.im + &self.im * &b.re }
    }

    /// The largest absolute difference of a real or imaginary part.
    pub fn distance(&self, b: &Self) -> f64 {
        (&self.re - &b.re).amax().max((&self.im - &b.im).amax())
    }
}
