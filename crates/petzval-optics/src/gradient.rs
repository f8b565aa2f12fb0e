//! The gradient of a scalar with respect to every number of a lens.

use std::ops::AddAssign;

use crate::lens::ASPHERE_TERMS;

/// Derivatives with respect to the numbers of one surface, per mm, per 1/mm, ... as the number is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SurfaceGradient {
    /// By the vertex curvature, 1/mm.
    pub curvature: f64,
    /// By the conic constant.
    pub conic: f64,
    /// By a_2, a_4, ..., a_16.
    pub asphere: [f64; ASPHERE_TERMS],
    /// By the distance to the next vertex, mm.
    pub thickness: f64,
    /// By the index of the medium behind, shifted alike at every wavelength.
    pub index: f64,
    /// By the clear semi-diameter, mm.
    pub semi_diameter: f64,
}

/// Derivatives with respect to the numbers of a lens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LensGradient {
    /// One entry per surface.
    pub surfaces: Vec<SurfaceGradient>,
    /// By the entrance pupil diameter, mm.
    pub entrance_pupil: f64,
}

impl LensGradient {
    /// The zero gradient of a lens with so many surfaces.
    pub fn zero(surfaces: usize) -> Self {
        Self { surfaces: vec![SurfaceGradient::default(); surfaces], entrance_pupil: 0.0 }
    }

    /// Every derivative times a factor.
    pub fn scaled(mut self, factor: f64) -> Self {
        for s in &mut self.surfaces {
            for v in s.numbers_mut() {
                *v *= factor;
            }
        }
        self.entrance_pupil *= factor;
        self
    }
}

impl SurfaceGradient {
    /// The numbers, in a fixed order.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let mut copy = *self;
        copy.numbers_mut().map(|v| *v).collect::<Vec<_>>().into_iter()
    }

    fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        [&mut self.curvature, &mut self.conic, &mut self.thickness, &mut self.index, &mut self.semi_diameter]
            .into_iter()
            .chain(&mut self.asphere)
    }
}

impl AddAssign<&LensGradient> for LensGradient {
    fn add_assign(&mut self, other: &LensGradient) {
        for (a, b) in self.surfaces.iter_mut().zip(&other.surfaces) {
            let mut b = *b;
            for (a, b) in a.numbers_mut().zip(b.numbers_mut()) {
                *a += *b;
            }
        }
        self.entrance_pupil += other.entrance_pupil;
    }
}
