//! The beam of one field at one wavelength: its rays are aimed at the stop, traced to the image and weighted by their
//! light. Also the gradient of losses of the beam.

use super::aim::aim_at_pupil;
use super::basis::PupilBasis;
use super::launch::{launch_area, projections, pull_back_log_launch_area, push_forward_log_launch_area};
use super::polynomial::{PupilPolynomial, Sides, Symmetry};
use super::quadrature::Quadrature;
use super::samples::{PupilSamples, optical_paths};
use crate::gradient::LensGradient;
use crate::paraxial::first_order;
use crate::trace::{AimedRays, Fate, RayBundle, Reaim, Seeds, Sequence, pull_back, push_change, trace};
use crate::vector::determinant_change;

/// Degree of the polynomials through launch points; high, because this is the reference.
const JACOBIAN_DEGREE: usize = 20;

/// A beam at the image, with one entry per node of the quadrature; in a lens without symmetry also one per mirror image.
#[derive(Clone, Debug)]
pub struct Beam {
    /// Field angle, rad.
    pub field_rad: f64,
    /// Radius of the stop, mm, the same for all wavelengths.
    pub stop_radius_mm: f64,
    /// x on the image plane, mm.
    pub x_mm: Vec<f64>,
    /// y on the image plane, mm.
    pub y_mm: Vec<f64>,
    /// Light of each ray (with its mirror image): quadrature weight, Jacobian of the pupil map and
    /// the projection `n_z^4` of irradiance, over the area of the paraxial entrance pupil, times
    /// the transmission of the clear apertures.
    pub weight: Vec<f64>,
    /// Fate of each ray.
    pub fate: Vec<Fate>,
    /// The rays at the image.
    rays: RayBundle,
    /// Nodes of the pupil and their shares of its area.
    nodes: Vec<[f64; 2]>,
    shares: Vec<f64>,
    aimed: AimedRays,
    transmission: Vec<f64>,
    flux: Vec<f64>,
}

/// Cotangents of a beam, one entry per node.
#[derive(Clone, Debug, Default)]
pub struct BeamCotangent {
    /// By x on the image plane, 1/mm.
    pub x: Vec<f64>,
    /// By y on the image plane, 1/mm.
    pub y: Vec<f64>,
    /// By the ray's weight.
    pub weight: Vec<f64>,
}

impl BeamCotangent {
    /// All-zero cotangents for a number of nodes.
    pub fn zero(nodes: usize) -> Self {
        Self { x: vec![0.0; nodes], y: vec![0.0; nodes], weight: vec![0.0; nodes] }
    }
}

/// Changes of a beam along a change of the lens, one entry per node.
#[derive(Clone, Debug, Default)]
pub struct BeamTangent {
    /// Of x on the image plane, mm.
    pub x_mm: Vec<f64>,
    /// Of y on the image plane, mm.
    pub y_mm: Vec<f64>,
    /// Of the ray's weight.
    pub weight: Vec<f64>,
}

/// Aims and traces the beam of a field.
///
/// `stop_radius_mm` is that of the reference wavelength: the stop has one size for all wavelengths.
pub fn trace_beam(sequence: &Sequence, field_rad: f64, stop_radius_mm: f64, quadrature: &Quadrature) -> Beam {
    let (points, shares) = quadrature.on(Sides::of(sequence));
    let nodes = points.len();
    // Aim at the nodes of the stop, and trace to the image.
    let aimed = aim_at_pupil(sequence, field_rad, stop_radius_mm, &points, None);
    let mut rays = aimed.bundle(sequence);
    trace(sequence, &mut rays);
    let fate: Vec<Fate> = (0..nodes).map(|i| rays.fate(i)).collect();
    let transmission: Vec<f64> = (0..nodes).map(|i| rays.transmission(i)).collect();

    // Weight each ray by its light: its area of the launch plane divided by that of the paraxial beam.
    let pupil_area = launch_area(sequence, stop_radius_mm);
    let stop_area = stop_radius_mm * stop_radius_mm;
    // Take the absolute value of the Jacobian: if only one section of the beam has crossed the axis, the map from launch to
    // stop is mirrored.
    let jacobian = |i: usize| stop_area * aimed.launch_per_stop_area(i).abs();
    let flux: Vec<f64> =
        shares.iter().enumerate().map(|(i, weight)| weight / pupil_area * jacobian(i)).collect();
    let weight = projections(sequence, field_rad, &aimed, nodes)
        .enumerate()
        .map(|(i, (projection, _))| flux[i] * projection * transmission[i])
        .collect();
    Beam {
        field_rad,
        stop_radius_mm,
        x_mm: (0..nodes).map(|i| rays.ray(i).position[0]).collect(),
        y_mm: (0..nodes).map(|i| rays.ray(i).position[1]).collect(),
        weight,
        fate,
        rays,
        nodes: points,
        shares,
        aimed,
        transmission,
        flux,
    }
}

impl Beam {
    /// Light of the whole beam per ideal image area, that of a lens without distortion: 1 on the axis of an unvignetted lens without
    /// pupil aberration. With [`ImageArea`](super::ImageArea) it gives the relative illumination.
    pub fn light(&self) -> f64 {
        self.weight.iter().sum()
    }

    /// Optical paths of the rays from the wavefront of a far object through the first vertex, or from a near object point, to
    /// the image plane, mm.
    pub fn optical_paths(&self, sequence: &Sequence) -> Vec<f64> {
        optical_paths(sequence, self.field_rad, |i| self.aimed.launch_of(i), &self.rays)
    }

    /// Direction cosines of a ray at the image (those of a line, see `SurfaceAtWavelength`).
    pub fn direction(&self, ray: usize) -> [f64; 3] {
        self.rays.ray(ray).direction
    }

    /// Solid angle of each ray: that of the unit vectors which `towards` computes from its position on the image plane
    /// (mm) and its direction, by polynomials through those of some rays. `None` if one of these rays is lost.
    pub fn solid_angles(
        &self,
        sequence: &Sequence,
        towards: impl Fn([f64; 2], [f64; 3]) -> [f64; 3],
    ) -> Option<Vec<f64>> {
        let (basis, sides) = (PupilBasis::of_degree(JACOBIAN_DEGREE), Sides::of(sequence));
        let samples = PupilSamples::new(sequence, self.field_rad, self.stop_radius_mm, basis, None)?;
        let direction = samples.direction();
        let vectors: Vec<[f64; 3]> = (0..samples.x.len())
            .map(|i| towards([samples.x[i], samples.y[i]], [0, 1, 2].map(|k| direction[k][i])))
            .collect();
        let fit = |axis: usize, symmetry| {
            let values: Vec<f64> = vectors.iter().map(|v| v[axis]).collect();
            basis.fit(&values, sides, symmetry)
        };
        let (l, m) = (fit(0, Symmetry::Odd), fit(1, Symmetry::Even));
        let area = |i: usize| {
            let ([a, b], [c, d]) = (basis.slope(&l, self.nodes[i]), basis.slope(&m, self.nodes[i]));
            let [.., n] = towards([self.x_mm[i], self.y_mm[i]], self.direction(i));
            self.shares[i] * std::f64::consts::PI * (a * d - b * c).abs() / n
        };
        Some((0..self.nodes.len()).map(area).collect())
    }

    /// Adds the gradient of a loss to `gradient` and returns its derivative by the stop radius.
    ///
    /// The launch points follow the lens, so that every ray keeps its point of the stop.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        cotangent: &BeamCotangent,
        gradient: &mut LensGradient,
    ) -> f64 {
        // The weights are relative to the paraxial beam: differentiate its area.
        let nodes = self.nodes.len();
        let pupil_area = launch_area(sequence, self.stop_radius_mm);
        let light: f64 = cotangent.weight.iter().zip(&self.weight).map(|(bar, w)| bar * w).sum();
        let by_area = pull_back_log_launch_area(sequence, -light, gradient);
        // Split the cotangent of each weight into those of the Jacobian, the projection and the transmission. A ray without
        // weight has no cotangent of its position, but its launch point still enters the fit of the Jacobian.
        let projections: Vec<(f64, [f64; 2])> =
            projections(sequence, self.field_rad, &self.aimed, nodes).collect();
        let mut seeds = Seeds::zero(nodes);
        let mut jacobian_bar = vec![0.0; nodes];
        for i in 0..nodes {
            let bar = cotangent.weight[i];
            jacobian_bar[i] = bar * self.shares[i] / pupil_area * projections[i].0 * self.transmission[i];
            if self.transmission[i] > 0.0 {
                seeds.image_x[i] = cotangent.x[i];
                seeds.image_y[i] = cotangent.y[i];
                seeds.transmission[i] = bar * self.flux[i] * projections[i].0;
            }
        }
        // Pull the projection back to the launch points, and all rays back through the lens.
        let mut launch_bar = [0, 1].map(|_| vec![0.0; RayBundle::padded(nodes)]);
        for i in (0..nodes).filter(|i| self.aimed.is_aimed(*i)) {
            let projection_bar = cotangent.weight[i] * self.flux[i] * self.transmission[i];
            for axis in 0..2 {
                launch_bar[axis][i] = projection_bar * projections[i].1[axis];
            }
        }
        let launch_bar = launch_bar.each_ref().map(Vec::as_slice);
        let reaim = Reaim { aimed: &self.aimed, launch_bar };
        let by_rays = pull_back(sequence, &self.aimed.bundle(sequence), &seeds, Some(&reaim), gradient);
        (by_rays + self.pull_back_jacobian(sequence, &jacobian_bar, gradient) + by_area) / self.stop_radius_mm
    }

    /// Pulls back cotangents of the Jacobians of launch by pupil coordinates, one per node; returns the derivative by
    /// the stop radius times that radius, mm.
    ///
    /// The Jacobian of a ray is exact; its derivative comes from polynomials through the launch points of some rays. If
    /// one of these rays cannot be aimed, the Jacobian is left out of the gradient.
    fn pull_back_jacobian(
        &self,
        sequence: &Sequence,
        jacobian_bar: &[f64],
        gradient: &mut LensGradient,
    ) -> f64 {
        let (basis, sides) = (PupilBasis::of_degree(JACOBIAN_DEGREE), Sides::of(sequence));
        let points = sides.points(&basis.samples);
        let samples = points.len();
        let aimed = aim_at_pupil(sequence, self.field_rad, self.stop_radius_mm, &points, None);
        if !(0..samples).all(|i| aimed.is_aimed(i)) {
            return 0.0;
        }
        let x = basis.fit(&aimed.launch_mm[0], sides, Symmetry::Odd);
        let y = basis.fit(&aimed.launch_mm[1], sides, Symmetry::Even);
        let (mut x_bar, mut y_bar) = (PupilPolynomial::zero_like(&x), PupilPolynomial::zero_like(&y));
        for (p, bar) in self.nodes.iter().zip(jacobian_bar).filter(|(_, bar)| **bar != 0.0) {
            // Differentiate jacobian = xx yy - xy yx.
            let ([xx, xy], [yx, yy]) = (basis.slope(&x, *p), basis.slope(&y, *p));
            let bar = bar * (xx * yy - xy * yx).signum();
            basis.pull_back_slope([bar * yy, -bar * yx], *p, &mut x_bar);
            basis.pull_back_slope([-bar * xy, bar * xx], *p, &mut y_bar);
        }
        let mut launch_bar = [0, 1].map(|_| vec![0.0; RayBundle::padded(samples)]);
        basis.pull_back_fit(&x_bar, sides, &mut launch_bar[0]);
        basis.pull_back_fit(&y_bar, sides, &mut launch_bar[1]);
        let reaim = Reaim { aimed: &aimed, launch_bar: launch_bar.each_ref().map(Vec::as_slice) };
        pull_back(sequence, &aimed.bundle(sequence), &Seeds::zero(samples), Some(&reaim), gradient)
    }

    /// The change of the beam along a change of the lens and of the logarithm of the stop radius: the transpose of
    /// [`Beam::pull_back`]. Rays without weight have no change.
    pub fn push_forward(&self, sequence: &Sequence, change: &LensGradient, stop_growth: f64) -> BeamTangent {
        // Move the rays, which keep their points of the stop.
        let nodes = self.nodes.len();
        let aimed = Some((&self.aimed, stop_growth));
        let moved = push_change(sequence, &self.aimed.bundle(sequence), change, aimed);
        let jacobian = self.push_forward_jacobian(sequence, change, stop_growth);
        // Differentiate the product of Jacobian, projection and transmission, over the area of the paraxial beam.
        let pupil_area = launch_area(sequence, self.stop_radius_mm);
        let by_area = push_forward_log_launch_area(sequence, change, stop_growth);
        let mut tangent =
            BeamTangent { x_mm: vec![0.0; nodes], y_mm: vec![0.0; nodes], weight: vec![0.0; nodes] };
        let projections = projections(sequence, self.field_rad, &self.aimed, nodes);
        for (i, (projection, by)) in projections.enumerate().filter(|(i, _)| self.transmission[*i] > 0.0) {
            tangent.x_mm[i] = moved.image_x[i];
            tangent.y_mm[i] = moved.image_y[i];
            let flux = self.shares[i] / pupil_area * jacobian[i];
            let projected = by[0] * moved.launch_mm[0][i] + by[1] * moved.launch_mm[1][i];
            tangent.weight[i] = flux * projection * self.transmission[i]
                + self.flux[i] * projected * self.transmission[i]
                + self.flux[i] * projection * moved.transmission[i]
                - self.weight[i] * by_area;
        }
        tangent
    }

    /// Changes of the absolute Jacobians of launch by pupil coordinates, one per node, mm^2: the transpose of
    /// [`Beam::pull_back_jacobian`].
    fn push_forward_jacobian(
        &self,
        sequence: &Sequence,
        change: &LensGradient,
        stop_growth: f64,
    ) -> Vec<f64> {
        let (basis, sides) = (PupilBasis::of_degree(JACOBIAN_DEGREE), Sides::of(sequence));
        let points = sides.points(&basis.samples);
        let aimed = aim_at_pupil(sequence, self.field_rad, self.stop_radius_mm, &points, None);
        if !(0..points.len()).all(|i| aimed.is_aimed(i)) {
            return vec![0.0; self.nodes.len()];
        }
        let moved = push_change(sequence, &aimed.bundle(sequence), change, Some((&aimed, stop_growth)));
        let fit = |[x, y]: &[Vec<f64>; 2]| {
            [basis.fit(x, sides, Symmetry::Odd), basis.fit(y, sides, Symmetry::Even)]
        };
        let (launch, moved) = (fit(&aimed.launch_mm), fit(&moved.launch_mm));
        let of_node = |p: &[f64; 2]| {
            let slopes = |of: &[PupilPolynomial; 2]| of.each_ref().map(|axis| basis.slope(axis, *p));
            let (at, by) = (slopes(&launch), slopes(&moved));
            let [[xx, xy], [yx, yy]] = at;
            (xx * yy - xy * yx).signum() * determinant_change(at, by)
        };
        self.nodes.iter().map(of_node).collect()
    }
}

/// The ray of a field through the centre of the stop.
#[derive(Clone, Debug)]
pub struct ChiefRay {
    /// x on the image plane, mm; 0 in a lens that is symmetric about the plane of the fields.
    pub x_mm: f64,
    /// Height on the image plane, mm.
    pub y_mm: f64,
    aimed: AimedRays,
}

/// Traces the chief ray of a field; `None` if no ray passes the centre of the stop to the image.
pub fn chief_ray(sequence: &Sequence, field_rad: f64) -> Option<ChiefRay> {
    let aimed = aim_at_pupil(sequence, field_rad, first_order(sequence).stop_radius_mm, &[[0.0; 2]], None);
    let mut ray = aimed.bundle(sequence);
    trace(sequence, &mut ray);
    let [x_mm, y_mm, _] = ray.ray(0).position;
    let x_mm = if sequence.is_mirror_symmetric { 0.0 } else { x_mm };
    ray.fate(0).reaches_image().then_some(ChiefRay { x_mm, y_mm, aimed })
}

/// The field whose chief ray lands at `y_mm` on the image plane, rad, distortion included: by the secant method from
/// the ideal field `guess_rad`. `None` if there is no such ray.
pub fn field_imaged_at(sequence: &Sequence, y_mm: f64, guess_rad: f64) -> Option<f64> {
    const STEPS: usize = 30;
    const HALVINGS: usize = 10;
    let miss = |field: f64| Some(chief_ray(sequence, field)?.y_mm - y_mm);
    // The field `to` and its miss or, where no chief ray reaches the image, those of a field nearer to `from`.
    let step = |from: f64, to: f64| {
        let mut nearer = (0..HALVINGS).map(|k| from + (to - from) * 0.5_f64.powi(k as i32));
        nearer.find_map(|field| Some((field, miss(field)?)))
    };
    let (mut at, mut miss_at) = step(0.0, guess_rad)?;
    let mut before = 0.98 * at;
    let mut miss_before = miss(before)?;
    for _ in 0..STEPS {
        if miss_at.abs() < 1e-10 || miss_at == miss_before {
            return (miss_at.abs() < 1e-6).then_some(at);
        }
        let next = at - miss_at * (at - before) / (miss_at - miss_before);
        (before, miss_before) = (at, miss_at);
        (at, miss_at) = step(at, next)?;
    }
    None
}

/// Adds the gradient of a loss that depends on the chief ray on the image plane, `bar` per mm of x and y.
pub fn pull_back_chief(sequence: &Sequence, chief: &ChiefRay, bar: [f64; 2], gradient: &mut LensGradient) {
    let mut seeds = Seeds::zero(1);
    seeds.image_y[0] = bar[1];
    if !sequence.is_mirror_symmetric {
        seeds.image_x[0] = bar[0];
    }
    let nothing = vec![0.0; RayBundle::padded(1)];
    let reaim = Reaim { aimed: &chief.aimed, launch_bar: [&nothing, &nothing] };
    pull_back(sequence, &chief.aimed.bundle(sequence), &seeds, Some(&reaim), gradient);
}
