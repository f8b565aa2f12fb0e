//! Positions and orientations of every surface, and of the image, in the coordinates of the first vertex.

use crate::lens::Lens;
use crate::vector::{Matrix3, Vec3, apply, product, transposed};

/// No rotation.
pub(super) const STRAIGHT: Matrix3 = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Position and orientation of a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    /// Its vertex, mm.
    pub origin: Vec3,
    /// Rotation from its coordinates to those of the first vertex.
    pub rotation: Matrix3,
}

impl Place {
    /// Transforms a point from the surface's coordinates to those of the first vertex.
    pub fn point(&self, local: Vec3) -> Vec3 {
        let turned = apply(&self.rotation, local);
        [0, 1, 2].map(|k| self.origin[k] + turned[k])
    }

    /// Transforms a point (z, y) of the surface's own section to (z, y) of the first vertex.
    pub fn section(&self, [z, y]: [f64; 2]) -> [f64; 2] {
        let [_, y, z] = self.point([0.0, y, z]);
        [z, y]
    }

    /// Height across the surface's axis of a point (z, y).
    pub fn height_of(&self, [z, y]: [f64; 2]) -> f64 {
        let from = [0.0, y - self.origin[1], z - self.origin[2]];
        apply(&transposed(&self.rotation), from)[1]
    }
}

/// Places of the surfaces, and of the image plane behind them.
pub(crate) fn places(lens: &Lens) -> Vec<Place> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let mut axis = Place { origin: [0.0; 3], rotation: STRAIGHT };
    let mut places = Vec::with_capacity(lens.surfaces.len() + 1);
    for surface in &sequence.surfaces {
        let Some(frame) = &surface.frame else {
            places.push(axis);
            axis.origin = axis.point([0.0, 0.0, surface.thickness_mm]);
            continue;
        };
        let [dx, dy] = frame.placement.decenter_mm;
        let here =
            Place { origin: axis.point([dx, dy, 0.0]), rotation: product(axis.rotation, frame.rotation) };
        places.push(here);
        // Choose the axis behind the surface so that it agrees with the transformation of leaving rays.
        let back: Matrix3 = transposed(&[0, 1, 2].map(|k| {
            let mut unit = [0.0; 3];
            unit[k] = 1.0;
            frame.turn_back(unit)
        }));
        let rotation = product(here.rotation, transposed(&back));
        let [x, y, _] =
            if frame.placement.axis == crate::lens::Axis::Returns { [dx, dy, 0.0] } else { [0.0; 3] };
        let shifted = apply(&rotation, [x, y, 0.0]);
        axis = Place { origin: [0, 1, 2].map(|k| here.origin[k] - shifted[k]), rotation };
        axis.origin = axis.point([0.0, 0.0, surface.thickness_mm]);
    }
    places.push(axis);
    places
}
