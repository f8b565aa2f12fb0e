//! The gradient of a scalar with respect to every number of a lens.

use std::ops::AddAssign;

use crate::lens::{ASPHERE_TERMS, DEPARTURE_NUMBERS, Departure, PHASE_TERMS, ShapeNumber, xy_powers};
use crate::trace::Sequence;

/// Derivatives with respect to the numbers of one surface, per mm, per 1/mm, ... as the number is.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// By the numbers of the departure.
    pub departure: [f64; DEPARTURE_NUMBERS],
    /// By the numbers of a diffractive structure.
    pub phase: [f64; PHASE_TERMS],
    /// By the power of a thin lens, 1/mm.
    pub power: f64,
    /// By the decentres along x and y, mm; only where the surface has a placement.
    pub decenter: [f64; 2],
    /// By the tilts about x, y and z, rad; only where the surface has a placement.
    pub tilt: [f64; 3],
}

impl Default for SurfaceGradient {
    fn default() -> Self {
        Self {
            curvature: 0.0,
            conic: 0.0,
            asphere: [0.0; ASPHERE_TERMS],
            thickness: 0.0,
            index: 0.0,
            semi_diameter: 0.0,
            departure: [0.0; DEPARTURE_NUMBERS],
            phase: [0.0; PHASE_TERMS],
            power: 0.0,
            decenter: [0.0; 2],
            tilt: [0.0; 3],
        }
    }
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

impl LensGradient {
    /// Takes out what only one half of a beam asks: in a lens whose y-z plane is a plane of symmetry, the other half asks
    /// the opposite of every number that would break the symmetry.
    pub(crate) fn keep_symmetry(&mut self, sequence: &Sequence) {
        if !sequence.is_mirror_symmetric {
            return;
        }
        for (g, s) in self.surfaces.iter_mut().zip(&sequence.surfaces) {
            if s.frame.is_some() {
                g.decenter[0] = 0.0;
                g.tilt[1] = 0.0;
                g.tilt[2] = 0.0;
            }
            if let Departure::Xy { .. } = s.shape.departure {
                for (by, (i, _)) in g.departure.iter_mut().zip(xy_powers()) {
                    if i % 2 == 1 {
                        *by = 0.0;
                    }
                }
            }
        }
    }
}

impl SurfaceGradient {
    /// The numbers, in a fixed order.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let mut copy = *self;
        copy.numbers_mut().map(|v| *v).collect::<Vec<_>>().into_iter()
    }

    fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        [
            &mut self.curvature,
            &mut self.conic,
            &mut self.thickness,
            &mut self.index,
            &mut self.semi_diameter,
            &mut self.power,
        ]
        .into_iter()
        .chain(&mut self.asphere)
        .chain(&mut self.departure)
        .chain(&mut self.phase)
        .chain(&mut self.decenter)
        .chain(&mut self.tilt)
    }

    /// By a number of the shape.
    pub fn shape(&self, number: ShapeNumber) -> f64 {
        match number {
            ShapeNumber::Curvature => self.curvature,
            ShapeNumber::Conic => self.conic,
            ShapeNumber::Asphere(j) => self.asphere[j],
            ShapeNumber::Departure(k) => self.departure[k],
        }
    }

    /// By a number of the shape, to be added to.
    pub fn shape_mut(&mut self, number: ShapeNumber) -> &mut f64 {
        match number {
            ShapeNumber::Curvature => &mut self.curvature,
            ShapeNumber::Conic => &mut self.conic,
            ShapeNumber::Asphere(j) => &mut self.asphere[j],
            ShapeNumber::Departure(k) => &mut self.departure[k],
        }
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
