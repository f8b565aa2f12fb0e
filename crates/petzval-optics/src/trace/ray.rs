//! Single rays and bundles of rays.

use super::fate::Fate;
use crate::lanes::MAX_LANES;
use crate::vector::Vec3;

/// One ray: a point (mm) and unit direction cosines (l, m, n).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A point on the ray, mm, in the coordinates of its present or next surface.
    pub position: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// Many rays as a structure of arrays, padded so that vectors of any width end with it.
#[derive(Clone, Debug)]
pub struct RayBundle {
    pub(super) x: Vec<f64>,
    pub(super) y: Vec<f64>,
    pub(super) z: Vec<f64>,
    pub(super) l: Vec<f64>,
    pub(super) m: Vec<f64>,
    pub(super) n: Vec<f64>,
    /// Codes of fates, see [`Fate::of_code`].
    pub(super) fate: Vec<f64>,
    pub(super) transmission: Vec<f64>,
    pub(super) optical_path: Vec<f64>,
    rays: usize,
}

impl RayBundle {
    /// A number of rays, all along the axis.
    pub fn new(rays: usize) -> Self {
        let zero = || vec![0.0; Self::padded(rays)];
        let one = || vec![1.0; Self::padded(rays)];
        Self {
            x: zero(),
            y: zero(),
            z: zero(),
            l: zero(),
            m: zero(),
            n: one(),
            fate: zero(),
            transmission: one(),
            optical_path: zero(),
            rays,
        }
    }

    /// Length of the arrays for a number of rays.
    pub fn padded(rays: usize) -> usize {
        rays.next_multiple_of(MAX_LANES)
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.rays
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays == 0
    }

    /// Ray i.
    pub fn ray(&self, i: usize) -> Ray {
        Ray { position: [self.x[i], self.y[i], self.z[i]], direction: [self.l[i], self.m[i], self.n[i]] }
    }

    /// Replaces ray i.
    pub fn set(&mut self, i: usize, ray: Ray) {
        [self.x[i], self.y[i], self.z[i]] = ray.position;
        [self.l[i], self.m[i], self.n[i]] = ray.direction;
    }

    /// x and y of every ray, mm; padded.
    pub fn image_xy(&self) -> [&[f64]; 2] {
        [&self.x, &self.y]
    }

    /// Fate of ray i.
    pub fn fate(&self, i: usize) -> Fate {
        Fate::of_code(self.fate[i])
    }

    /// Transmission of the clear apertures for ray i, 0..1; 0 if it does not reach the image.
    pub fn transmission(&self, i: usize) -> f64 {
        self.transmission[i]
    }

    /// Optical path of ray i from its launch to the image plane, mm.
    pub fn optical_path_mm(&self, i: usize) -> f64 {
        self.optical_path[i]
    }
}
