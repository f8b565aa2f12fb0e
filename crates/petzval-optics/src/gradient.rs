//! The gradient of a scalar with respect to every number of a lens.

use std::ops::{AddAssign, Index, IndexMut};

use crate::number::Number;

/// Derivatives with respect to the numbers of a lens, per mm, per 1/mm, ... as the number is:
/// `gradient[(surface, Number::Thickness)]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LensGradient {
    /// [`Number::COUNT`] derivatives per surface, by [`Number::slot`].
    numbers: Vec<f64>,
    /// By the entrance pupil diameter, mm.
    pub entrance_pupil: f64,
}

impl LensGradient {
    /// The zero gradient of a lens with so many surfaces.
    pub fn zero(surfaces: usize) -> Self {
        Self { numbers: vec![0.0; surfaces * Number::COUNT], entrance_pupil: 0.0 }
    }

    /// Number of surfaces.
    pub fn surfaces(&self) -> usize {
        self.numbers.len() / Number::COUNT
    }

    /// The derivatives by the numbers of one surface, by [`Number::slot`].
    pub fn of_surface(&self, surface: usize) -> &[f64] {
        &self.numbers[surface * Number::COUNT..][..Number::COUNT]
    }

    /// The same, to be added to.
    pub(crate) fn of_surface_mut(&mut self, surface: usize) -> &mut [f64] {
        &mut self.numbers[surface * Number::COUNT..][..Number::COUNT]
    }

    /// The derivatives by the numbers of all surfaces, one surface after the other.
    pub fn numbers(&self) -> &[f64] {
        &self.numbers
    }

    /// The derivative along a direction, given by the change of every number.
    pub fn along(&self, change: &Self) -> f64 {
        let of_surfaces: f64 = self.numbers.iter().zip(&change.numbers).map(|(by, change)| by * change).sum();
        of_surfaces + self.entrance_pupil * change.entrance_pupil
    }

    /// Every derivative times a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        for v in &mut self.numbers {
            *v *= factor;
        }
        self.entrance_pupil *= factor;
        self
    }
}

impl Index<(usize, Number)> for LensGradient {
    type Output = f64;

    #[inline]
    fn index(&self, (surface, number): (usize, Number)) -> &f64 {
        &self.numbers[surface * Number::COUNT + number.slot()]
    }
}

impl IndexMut<(usize, Number)> for LensGradient {
    #[inline]
    fn index_mut(&mut self, (surface, number): (usize, Number)) -> &mut f64 {
        &mut self.numbers[surface * Number::COUNT + number.slot()]
    }
}

impl AddAssign<&LensGradient> for LensGradient {
    fn add_assign(&mut self, other: &LensGradient) {
        for (a, b) in self.numbers.iter_mut().zip(&other.numbers) {
            *a += b;
        }
        self.entrance_pupil += other.entrance_pupil;
    }
}
