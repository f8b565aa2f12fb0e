//! A lens at one wavelength: the numbers that tracing needs.

use super::ray::Ray;
use crate::jet::Real;
use crate::lens::{Action, Axis, Departure, Lens, ObjectDistance, Pattern, Placement, SurfaceShape};
use crate::number::PHASE_TERMS;
use crate::vector::{Matrix3, Vec3, apply, half_turned, transposed};

/// A surface with the indices on both of its sides.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceAtWavelength {
    /// Shape.
    pub shape: SurfaceShape,
    /// Whether the shape has no polynomial part (closed-form intersection).
    pub is_conic: bool,
    /// Number of coefficients up to the last that is not zero.
    pub(crate) terms: usize,
    /// Index in front; negative after an odd number of reflections.
    ///
    /// With such signs Snell's law holds for mirrors too. A direction is then that of the ray as a line, with a positive z
    /// component; light travels along the direction times the sign of the index.
    pub n_before: f64,
    /// Index behind, with the same rule of signs.
    pub n_after: f64,
    /// Distance to the next vertex, mm.
    pub thickness_mm: f64,
    /// Clear semi-diameter, mm; infinite where light passes at any height.
    pub semi_diameter_mm: f64,
    /// Whether it is a mirror, with the medium of its front behind it.
    pub(crate) reflects: bool,
    /// Its change of directions.
    pub(crate) bending: Bending,
    /// Whether it needs the general formulas: it has a departure, or does not bend light by Snell's law alone.
    pub(crate) is_general: bool,
    /// Its own coordinates, if they differ from those of the axis.
    pub(crate) frame: Option<Frame>,
}

/// The change of directions at a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Bending {
    /// By Snell's law.
    Snell,
    /// As a thin lens without aberrations.
    ThinLens { power_per_mm: f64 },
    /// By Snell's law and a structure that adds `along_y y + radial_0 u + radial_1 u^2 + ...` to the optical path, mm.
    Path {
        along_y: f64,
        radial: [f64; PHASE_TERMS],
        /// Whether the structure is a grating, whose only number is the first.
        is_grating: bool,
        /// Derivatives of the coefficients by the numbers of the [`Phase`](crate::lens::Phase).
        per_number: [f64; PHASE_TERMS],
    },
}

/// Optical path of a structure at a point, mm; see [`Bending::Path`].
#[inline(always)]
pub(crate) fn structure_path<R: Real>(along_y: f64, radial: &[f64; PHASE_TERMS], x: R, y: R) -> R {
    let u = x * x + y * y;
    let mut sum = u.constant(0.0);
    for a in radial.iter().rev() {
        sum = (sum + *a) * u;
    }
    sum + y * along_y
}

/// Coordinates of a surface that is shifted or turned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub placement: Placement,
    /// Rotation from surface coordinates to those of the axis in front.
    pub rotation: Matrix3,
}

impl Frame {
    fn new(placement: Placement) -> Self {
        Self { placement, rotation: placement.rotation() }
    }

    /// Transforms a ray from the coordinates of the axis to those of the surface.
    pub fn enter(&self, ray: Ray) -> Ray {
        let to_surface = transposed(&self.rotation);
        let [dx, dy] = self.placement.decenter_mm;
        let [x, y, z] = ray.position;
        Ray {
            position: apply(&to_surface, [x - dx, y - dy, z]),
            direction: apply(&to_surface, ray.direction),
        }
    }

    /// Transforms a ray from the coordinates of the surface to those of the axis behind it.
    pub fn leave(&self, ray: Ray) -> Ray {
        let [dx, dy] = match self.placement.axis {
            Axis::Returns => self.placement.decenter_mm,
            Axis::Follows | Axis::Bends => [0.0; 2],
        };
        let [x, y, z] = self.turn_back(ray.position);
        Ray { position: [x + dx, y + dy, z], direction: self.turn_back(ray.direction) }
    }

    /// Rotates a vector from surface coordinates to those of the axis behind it.
    pub fn turn_back(&self, v: Vec3) -> Vec3 {
        match self.placement.axis {
            Axis::Returns => apply(&self.rotation, v),
            Axis::Follows => v,
            Axis::Bends => apply(&half_turned(&self.rotation), v),
        }
    }
}

/// A lens at one wavelength.
#[derive(Clone, Debug)]
pub struct Sequence {
    /// Surfaces in the order that light meets them.
    pub surfaces: Vec<SurfaceAtWavelength>,
    /// Index of the stop.
    pub stop: usize,
    /// Object plane.
    pub object: ObjectDistance,
    /// Entrance pupil diameter, mm.
    pub entrance_pupil_mm: f64,
    /// The wavelength, um.
    pub wavelength_um: f64,
    /// Whether the y-z plane is a plane of symmetry.
    pub is_mirror_symmetric: bool,
}

impl Lens {
    /// The lens at one wavelength, ready for tracing.
    pub fn at_wavelength(&self, wavelength_um: f64) -> Sequence {
        Sequence::new(self, wavelength_um)
    }
}

impl SurfaceAtWavelength {
    /// Transforms a ray from the coordinates of the axis at the vertex to those of the surface.
    pub(crate) fn enter(&self, ray: Ray) -> Ray {
        self.frame.map_or(ray, |frame| frame.enter(ray))
    }

    /// Transforms a ray from the coordinates of the surface to those of the axis at the next vertex.
    pub(crate) fn leave(&self, ray: Ray) -> Ray {
        let mut ray = self.frame.map_or(ray, |frame| frame.leave(ray));
        ray.position[2] -= self.thickness_mm;
        ray
    }

    /// Optical path of the thin lens or structure at a point, mm.
    ///
    /// The optical path of a thin lens without aberrations is not defined; this is the one of first-order optics.
    #[inline(always)]
    pub(crate) fn added_path_mm<R: Real>(&self, [x, y]: [R; 2]) -> R {
        match &self.bending {
            Bending::Snell => x.constant(0.0),
            Bending::ThinLens { power_per_mm } => (x * x + y * y) * (-0.5 * power_per_mm),
            Bending::Path { along_y, radial, .. } => structure_path(*along_y, radial, x, y),
        }
    }

    /// Coefficients a_2, a_4, ... up to the last that is not zero.
    #[inline]
    pub(crate) fn polynomial(&self) -> &[f64] {
        &self.shape.asphere[..self.terms]
    }
}

impl Sequence {
    /// Whether rays have optical paths for waves. A thin lens has none: the paths that make it perfect depend on the
    /// object.
    pub fn has_optical_paths(&self) -> bool {
        !self.surfaces.iter().any(|s| matches!(s.bending, Bending::ThinLens { .. }))
    }

    /// Change of the signed index behind a surface, from the change `by_glass` of each glass. Behind a mirror is the
    /// medium in front of it.
    pub(crate) fn index_change(&self, surface: usize, by_glass: impl Fn(usize) -> f64) -> f64 {
        let (mut at, mut sign) = (surface, 1.0);
        while self.surfaces[at].reflects {
            if at == 0 {
                return 0.0;
            }
            at -= 1;
            sign = -sign;
        }
        sign * self.surfaces[at].n_after.signum() * by_glass(at)
    }

    /// The transpose of [`Sequence::index_change`]: the cotangent of the glass behind a surface, from those of every
    /// signed index behind a surface.
    pub(crate) fn glass_index_bar(&self, surface: usize, by_index: impl Fn(usize) -> f64) -> f64 {
        if self.surfaces[surface].reflects {
            return 0.0;
        }
        let mut sign = self.surfaces[surface].n_after.signum();
        let mut sum = sign * by_index(surface);
        for (i, s) in self.surfaces.iter().enumerate().skip(surface + 1) {
            if !s.reflects {
                break;
            }
            sign = -sign;
            sum += sign * by_index(i);
        }
        sum
    }

    /// Evaluates every index of the lens at the wavelength.
    pub fn new(lens: &Lens, wavelength_um: f64) -> Self {
        let mut n_before = 1.0_f64;
        let surfaces = lens.surfaces.iter().enumerate().map(|(i, s)| {
            let n_after = match s.action {
                Action::Reflect => -n_before,
                _ => s.glass.index(wavelength_um).copysign(n_before),
            };
            let bending = match (s.action, s.phase) {
                (Action::ThinLens { power_per_mm }, _) => Bending::ThinLens { power_per_mm },
                (_, None) => Bending::Snell,
                (_, Some(phase)) => {
                    let per_number = phase.path_per_number(wavelength_um);
                    let numbers = phase.numbers();
                    let mut radial = [0.0; PHASE_TERMS];
                    for ((r, a), by) in radial.iter_mut().zip(numbers).zip(per_number) {
                        *r = a * by;
                    }
                    let is_grating = matches!(phase.pattern, Pattern::Grating { .. });
                    let (along_y, radial) =
                        if is_grating { (radial[0], [0.0; PHASE_TERMS]) } else { (0.0, radial) };
                    Bending::Path { along_y, radial, is_grating, per_number }
                }
            };
            let surface = SurfaceAtWavelength {
                shape: s.shape,
                is_conic: s.shape.is_conic(),
                terms: s.shape.asphere.iter().rposition(|a| *a != 0.0).map_or(0, |last| last + 1),
                n_before,
                n_after,
                thickness_mm: s.thickness_mm,
                semi_diameter_mm: if s.is_open && i != lens.stop {
                    f64::INFINITY
                } else {
                    s.semi_diameter_mm
                },
                is_general: s.shape.departure != Departure::None || !matches!(bending, Bending::Snell),
                reflects: s.action == Action::Reflect,
                bending,
                frame: s.placement.map(Frame::new),
            };
            n_before = n_after;
            surface
        });
        let surfaces = surfaces.collect();
        Self {
            surfaces,
            stop: lens.stop,
            object: lens.object,
            entrance_pupil_mm: lens.entrance_pupil_mm,
            wavelength_um,
            is_mirror_symmetric: lens.is_mirror_symmetric(),
        }
    }
}
