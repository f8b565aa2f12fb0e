//! The beam of one field at one wavelength, traced at the samples of a pupil basis.

use super::aim::aim_at_pupil;
use super::basis::{PupilBasis, check_points};
use super::launch::{launch_area, projections, pull_back_log_launch_area, push_forward_log_launch_area};
use super::polynomial::{Sides, Symmetry};
use crate::gradient::LensGradient;
use crate::lens::ObjectDistance;
use crate::trace::{
    AimedRays, Ray, RayBundle, RayTangents, Reaim, SOFT_EDGE_MM, Seeds, Sequence, SquaredHeights, launch,
    pull_back, push_change_with_heights, trace_with_heights,
};
use crate::vector::{determinant_change, dot};

/// Samples stay inside the rim of the stop. An aperture is checked at the rim too if samples reach this share of its
/// clear radius.
const SAMPLED_SHARE: f64 = 0.9;

/// Rays through points of the stop, aimed and traced; arrays are padded.
pub(crate) struct TracedPoints {
    pub aimed: AimedRays,
    pub rays: RayBundle,
    pub heights: Vec<SquaredHeights>,
}

/// Aims and traces rays through points of the pupil; `None` if one of them does not reach the image.
pub(super) fn trace_points(
    sequence: &Sequence,
    field_rad: f64,
    stop_radius_mm: f64,
    points: &[[f64; 2]],
    near_mm: Option<&[[f64; 2]]>,
    surfaces: impl Iterator<Item = usize>,
) -> Option<TracedPoints> {
    let aimed = aim_at_pupil(sequence, field_rad, stop_radius_mm, points, near_mm);
    let mut rays = aimed.bundle(sequence);
    let mut heights: Vec<SquaredHeights> = surfaces.map(|s| SquaredHeights::zero(s, points.len())).collect();
    trace_with_heights(sequence, &mut rays, &mut heights);
    (0..points.len()).all(|i| rays.fate(i).reaches_image()).then_some(TracedPoints { aimed, rays, heights })
}

/// Optical paths of traced rays from the wavefront of a far object through the first vertex, or from a near object point.
pub(crate) fn optical_paths(
    sequence: &Sequence,
    field_rad: f64,
    launch_of: impl Fn(usize) -> [f64; 2],
    rays: &RayBundle,
) -> Vec<f64> {
    let before = |i: usize| {
        let Ray { position: [x, y, z], direction: d } = launch(sequence, field_rad, launch_of(i)).ray;
        match sequence.object {
            ObjectDistance::Infinity => x * d[0] + y * d[1] + z * d[2],
            ObjectDistance::Finite(distance) => distance / d[2],
        }
    };
    (0..rays.len()).map(|i| before(i) + rays.optical_path_mm(i)).collect()
}

/// A beam at the samples of a basis.
#[derive(Debug)]
pub(crate) struct PupilSamples {
    pub basis: &'static PupilBasis,
    /// Halves of the pupil with samples.
    pub sides: Sides,
    /// Positions on the image plane, mm, one per sample.
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    /// Light per share of the stop's area, one per sample: 1 on the axis of a lens without pupil aberration.
    pub light: Vec<f64>,
    /// Squared heights at the clear apertures that may cut the beam.
    pub heights: Vec<SquaredHeights>,
    /// The rays at the image.
    rays: RayBundle,
    pub(super) aimed: AimedRays,
    pub field_rad: f64,
    pub(super) stop_radius_mm: f64,
}

/// Cotangents of a beam at its samples.
#[derive(Clone, Debug)]
pub(crate) struct SamplesCotangent {
    /// By x, y, squared heights, optical paths and directions.
    pub seeds: Seeds,
    /// By the light.
    pub light: Vec<f64>,
}

/// Changes of a beam at its samples.
pub(crate) struct SamplesTangent {
    /// Of x, y, squared heights, optical paths (from the same start as [`PupilSamples::optical_path`]) and directions.
    pub rays: RayTangents,
    /// Of the light.
    pub light: Vec<f64>,
}

impl SamplesCotangent {
    pub fn zero(samples: &PupilSamples) -> Self {
        let count = samples.x.len();
        Self { seeds: Seeds::zero(count), light: vec![0.0; count] }
    }
}

impl PupilSamples {
    /// Traces the beam; `like`, the same field at another wavelength, makes aiming faster. `None` if a ray through the stop
    /// does not reach the image.
    ///
    /// `stop_radius_mm` is that of the reference wavelength: the stop has one size for all wavelengths.
    pub fn new(
        sequence: &Sequence,
        field_rad: f64,
        stop_radius_mm: f64,
        basis: &'static PupilBasis,
        like: Option<&Self>,
    ) -> Option<Self> {
        let sides = Sides::of(sequence);
        let points = sides.points(&basis.samples);
        let count = points.len();
        let near: Option<Vec<[f64; 2]>> = like
            .filter(|like| like.basis.degree == basis.degree && like.sides == sides)
            .map(|like| (0..count).map(|i| like.aimed.launch_of(i)).collect());
        let others = (0..sequence.surfaces.len()).filter(|i| *i != sequence.stop);
        let traced = trace_points(sequence, field_rad, stop_radius_mm, &points, near.as_deref(), others)?;
        let may_cut = |h: &SquaredHeights| {
            let clear = sequence.surfaces[h.surface].semi_diameter_mm - SOFT_EDGE_MM;
            let radius = |u: &[f64]| u.iter().fold(0.0_f64, |m, u| m.max(*u)).sqrt();
            let reach = radius(&h.values[..count]);
            // Evaluate the height of the rim by the polynomial.
            let at_checks = || basis.at_checks(&basis.fit(&h.values, sides, Symmetry::Even), sides);
            reach > SAMPLED_SHARE * clear && (reach > clear || radius(&at_checks()) > clear)
        };
        let [x, y] = traced.rays.image_xy().map(|v| v[..count].to_vec());
        let heights = traced.heights.into_iter().filter(may_cut).collect();
        let aimed = traced.aimed;
        let light = Vec::new();
        let mut samples =
            Self { basis, sides, x, y, light, heights, rays: traced.rays, aimed, field_rad, stop_radius_mm };
        // Compute the light by the Jacobian of polynomials through the launch points, so that it agrees with its gradient.
        let area = launch_area(sequence, stop_radius_mm);
        let [[xx, xy], [yx, yy]] = samples.launch_slopes();
        samples.light = projections(sequence, field_rad, &samples.aimed, count)
            .enumerate()
            .map(|(i, (projection, _))| (xx[i] * yy[i] - xy[i] * yx[i]).abs() / area * projection)
            .collect();
        Some(samples)
    }

    /// Optical path from the wavefront of a far object through the first vertex, or from a near object point, to the image
    /// plane, mm, one per sample.
    pub fn optical_path(&self, sequence: &Sequence) -> Vec<f64> {
        optical_paths(sequence, self.field_rad, |i| self.aimed.launch_of(i), &self.rays)
    }

    /// Direction cosines at the image (those of lines, see `SurfaceAtWavelength`), one per sample.
    pub fn direction(&self) -> [Vec<f64>; 3] {
        let directions = (0..self.x.len()).map(|i| self.rays.ray(i).direction);
        let mut all = [Vec::new(), Vec::new(), Vec::new()];
        for d in directions {
            for (to, v) in all.iter_mut().zip(d) {
                to.push(v);
            }
        }
        all
    }

    /// Rays through the check points of the pupil, with their squared heights at some surfaces; `None` if one is lost.
    pub fn trace_checks(
        &self,
        sequence: &Sequence,
        surfaces: impl Iterator<Item = usize>,
    ) -> Option<TracedPoints> {
        let (basis, sides) = (self.basis, self.sides);
        let [launch_x, launch_y] = &self.aimed.launch_mm;
        let x = basis.at_checks(&basis.fit(launch_x, sides, Symmetry::Odd), sides);
        let y = basis.at_checks(&basis.fit(launch_y, sides, Symmetry::Even), sides);
        let guesses: Vec<[f64; 2]> = x.iter().zip(&y).map(|(x, y)| [*x, *y]).collect();
        let points = sides.points(&check_points());
        trace_points(sequence, self.field_rad, self.stop_radius_mm, &points, Some(&guesses), surfaces)
    }

    /// Shares of the stop's area of the samples; the sum is 1.
    pub fn weights(&self) -> Vec<f64> {
        self.sides.weights(&self.basis.weights)
    }

    /// Derivatives of launch x and launch y by p_x and p_y, at the samples, mm.
    fn launch_slopes(&self) -> [[Vec<f64>; 2]; 2] {
        self.slopes_of(&self.aimed.launch_mm)
    }

    /// Derivatives of two coordinates by p_x and p_y, at the samples, from those coordinates at the samples.
    fn slopes_of(&self, [x, y]: &[Vec<f64>; 2]) -> [[Vec<f64>; 2]; 2] {
        let (basis, sides) = (self.basis, self.sides);
        [
            basis.slopes(&basis.fit(x, sides, Symmetry::Odd), sides),
            basis.slopes(&basis.fit(y, sides, Symmetry::Even), sides),
        ]
    }

    /// Adds the gradient of a loss to `gradient` and returns its derivative by the stop radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        samples_bar: &SamplesCotangent,
        gradient: &mut LensGradient,
    ) -> f64 {
        let (mut launch_bar, by_area) = self.pull_back_light(sequence, &samples_bar.light, gradient);
        if let Some(wave) = &samples_bar.seeds.wave {
            // The path in front of the launch plane grows with the launch point along the launch direction.
            for i in 0..self.x.len() {
                let start = launch(sequence, self.field_rad, self.aimed.launch_of(i));
                for (bar, by) in launch_bar.iter_mut().zip(start.position_by) {
                    bar[i] += wave.optical_path[i] * dot(by, start.ray.direction);
                }
            }
        }
        let launch_bar = launch_bar.each_ref().map(Vec::as_slice);
        let reaim = Reaim { aimed: &self.aimed, launch_bar };
        let by_rays =
            pull_back(sequence, &self.aimed.bundle(sequence), &samples_bar.seeds, Some(&reaim), gradient);
        (by_rays + by_area) / self.stop_radius_mm
    }

    /// The change of the beam along a change of the lens and of the logarithm of the stop radius: the transpose of
    /// [`PupilSamples::pull_back`].
    pub fn push_forward(
        &self,
        sequence: &Sequence,
        change: &LensGradient,
        stop_growth: f64,
    ) -> SamplesTangent {
        // Move the rays, which keep their points of the stop.
        let surfaces: Vec<usize> = self.heights.iter().map(|h| h.surface).collect();
        let (launched, aimed) = (self.aimed.bundle(sequence), Some((&self.aimed, stop_growth)));
        let mut rays = push_change_with_heights(sequence, &launched, change, aimed, &surfaces);
        // The path in front of the launch plane grows with the launch point along the launch direction.
        let count = self.x.len();
        for i in 0..count {
            let start = launch(sequence, self.field_rad, self.aimed.launch_of(i));
            for (moved, by) in rays.launch_mm.iter().zip(start.position_by) {
                rays.optical_path[i] += moved[i] * dot(by, start.ray.direction);
            }
        }
        // Differentiate the light: Jacobian times projection, over the area of the paraxial beam.
        let area = launch_area(sequence, self.stop_radius_mm);
        let by_area = push_forward_log_launch_area(sequence, change, stop_growth);
        let ([[xx, xy], [yx, yy]], [x, y]) = (self.launch_slopes(), self.slopes_of(&rays.launch_mm));
        let light = projections(sequence, self.field_rad, &self.aimed, count)
            .enumerate()
            .map(|(i, (projection, by))| {
                let sign = (xx[i] * yy[i] - xy[i] * yx[i]).signum();
                let moved = [&x, &y].map(|row| [row[0][i], row[1][i]]);
                let jacobian = determinant_change([[xx[i], xy[i]], [yx[i], yy[i]]], moved);
                let projected = by[0] * rays.launch_mm[0][i] + by[1] * rays.launch_mm[1][i];
                sign * jacobian / area * projection + self.light[i] * (projected / projection - by_area)
            })
            .collect();
        SamplesTangent { rays, light }
    }

    /// Pulls cotangents of the light back to the launch points, and to the logarithm of the stop radius.
    fn pull_back_light(
        &self,
        sequence: &Sequence,
        light_bar: &[f64],
        gradient: &mut LensGradient,
    ) -> ([Vec<f64>; 2], f64) {
        let area = launch_area(sequence, self.stop_radius_mm);
        let total: f64 = light_bar.iter().zip(&self.light).map(|(bar, l)| bar * l).sum();
        let by_area = pull_back_log_launch_area(sequence, -total, gradient);
        let count = self.x.len();
        let mut launch_bar = [0, 1].map(|_| vec![0.0; RayBundle::padded(count)]);
        let [[xx, xy], [yx, yy]] = self.launch_slopes();
        let mut jacobian_bar = vec![0.0; count];
        let projections = projections(sequence, self.field_rad, &self.aimed, count);
        for (i, (projection, by)) in projections.enumerate() {
            let sign = (xx[i] * yy[i] - xy[i] * yx[i]).signum();
            jacobian_bar[i] = light_bar[i] * projection / area * sign;
            for axis in 0..2 {
                launch_bar[axis][i] += light_bar[i] * self.light[i] / projection * by[axis];
            }
        }
        // Differentiate jacobian = xx yy - xy yx.
        let times = |v: &[f64], sign: f64| -> Vec<f64> {
            v.iter().zip(&jacobian_bar).map(|(v, bar)| sign * v * bar).collect()
        };
        let (basis, sides) = (self.basis, self.sides);
        let pull = |symmetry: Symmetry, by_x: &[f64], by_y: &[f64], to: &mut [f64]| {
            basis.pull_back_fit(&basis.pull_back_slopes([by_x, by_y], sides, symmetry), sides, to);
        };
        pull(Symmetry::Odd, &times(&yy, 1.0), &times(&yx, -1.0), &mut launch_bar[0]);
        pull(Symmetry::Even, &times(&xy, -1.0), &times(&xx, 1.0), &mut launch_bar[1]);
        (launch_bar, by_area)
    }
}
