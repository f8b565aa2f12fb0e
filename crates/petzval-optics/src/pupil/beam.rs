//! The beam of one field at one wavelength: aimed at the stop, traced to the image, weighted by the
//! light that each ray carries; and the gradient of anything made from it.

use super::quadrature::Quadrature;
use crate::gradient::LensGradient;
use crate::lens::ObjectDistance;
use crate::paraxial::{FirstOrder, first_order, pull_back_entrance_pupil};
use crate::trace::{Fate, Launch, Path, RayCotangent, Sequence, aim_at_stop, launch, pull_back, trace_ray};
use crate::trace::{pull_back_from, retrace};

/// A beam at the image: one entry per node of the quadrature.
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
    /// the transmission of the clear apertures. The sum is the relative illumination.
    pub weight: Vec<f64>,
    /// Fate of each ray.
    pub fate: Vec<Fate>,
    launch_mm: Vec<[f64; 2]>,
    stop_by_launch: Vec<[[f64; 2]; 2]>,
    transmission: Vec<f64>,
    flux: Vec<f64>,
}

/// What a loss asks of a beam, one entry per node.
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
    /// No wish at all, for so many nodes.
    pub fn zero(nodes: usize) -> Self {
        Self { x: vec![0.0; nodes], y: vec![0.0; nodes], weight: vec![0.0; nodes] }
    }
}

/// The launch point that first-order optics would aim for: through the entrance pupil.
pub fn paraxial_launch(order: &FirstOrder, sequence: &Sequence, field_rad: f64, p: [f64; 2]) -> [f64; 2] {
    let radius = 0.5 * sequence.entrance_pupil_mm;
    let [x, y] = [radius * p[0], radius * p[1]];
    let at = order.entrance_pupil_at_mm;
    let Launch { ray, .. } = launch(sequence, field_rad, [0.0, 0.0]);
    let slope = ray.direction[1] / ray.direction[2];
    match sequence.object {
        ObjectDistance::Infinity => [x, y - at * slope],
        ObjectDistance::Finite(distance) => {
            // On the straight line from the object point to the pupil point.
            let share = distance / (distance + at);
            let object_y = -distance * field_rad.tan();
            [share * x, object_y + share * (y - object_y)]
        }
    }
}

/// Irradiance of a ray relative to one along the axis, `n_z^4` with n_z the direction cosine of its
/// launch (from infinity this is the cosine-fourth law), and its derivative by the launch point.
fn projection(start: &Launch) -> (f64, [f64; 2]) {
    let nz = start.ray.direction[2];
    let slope = 4.0 * nz.powi(3);
    (nz.powi(4), start.direction_by.map(|by| slope * by[2]))
}

/// Area, over pi, in which the paraxial beam of the axis crosses the plane of the first vertex, mm^2: that of the
/// entrance pupil or, from a near object, its shadow on that plane.
fn launch_area(sequence: &Sequence, order: &FirstOrder) -> f64 {
    let radius = 0.5 * sequence.entrance_pupil_mm;
    match sequence.object {
        ObjectDistance::Infinity => radius * radius,
        ObjectDistance::Finite(distance) => {
            let shadow = radius * distance / (distance + order.entrance_pupil_at_mm);
            shadow * shadow
        }
    }
}

/// Aims and traces the beam of a field.
///
/// `stop_radius_mm` is that of the reference wavelength: the stop is one piece of metal.
pub fn trace_beam(sequence: &Sequence, field_rad: f64, stop_radius_mm: f64, quadrature: &Quadrature) -> Beam {
    let order = first_order(sequence);
    let nodes = quadrature.len();
    let mut beam = Beam {
        field_rad,
        stop_radius_mm,
        x_mm: vec![0.0; nodes],
        y_mm: vec![0.0; nodes],
        weight: vec![0.0; nodes],
        fate: vec![Fate::NotAimed; nodes],
        launch_mm: vec![[0.0; 2]; nodes],
        stop_by_launch: vec![[[1.0, 0.0], [0.0, 1.0]]; nodes],
        transmission: vec![0.0; nodes],
        flux: vec![0.0; nodes],
    };
    let mut path = Path::default();
    for (i, p) in quadrature.nodes.iter().enumerate() {
        // Aim at the node of the stop.
        let guess = paraxial_launch(&order, sequence, field_rad, *p);
        let target = [stop_radius_mm * p[0], stop_radius_mm * p[1]];
        beam.launch_mm[i] = guess;
        let Some(aimed) = aim_at_stop(sequence, field_rad, target, guess) else { continue };
        beam.launch_mm[i] = aimed.launch_mm;
        beam.stop_by_launch[i] = aimed.stop_by_launch;
        // Trace to the image.
        let start = launch(sequence, field_rad, aimed.launch_mm);
        retrace(sequence, start.ray, &mut path);
        beam.fate[i] = path.fate;
        if let Some(image) = path.image {
            beam.x_mm[i] = image.position[0];
            beam.y_mm[i] = image.position[1];
            beam.transmission[i] = path.transmission;
        }
    }
    // Weigh each ray by the light it carries: its area of the launch plane over that of the paraxial beam.
    let pupil_area = launch_area(sequence, &order);
    let jacobian = quadrature.flux.jacobian(&beam.launch_mm);
    for i in 0..nodes {
        let start = launch(sequence, field_rad, beam.launch_mm[i]);
        beam.flux[i] = quadrature.weights[i] / pupil_area * jacobian[i];
        beam.weight[i] = beam.flux[i] * projection(&start).0 * beam.transmission[i];
    }
    beam
}

impl Beam {
    /// Relative illumination: 1 on the axis of an unvignetted lens without pupil aberration.
    pub fn illumination(&self) -> f64 {
        self.weight.iter().sum()
    }

    /// Adds the gradient of a loss to `gradient` and returns its derivative by the stop radius.
    ///
    /// The launch points follow the lens: they solve `stop(launch, lens) = R p`. With the launch
    /// cotangent a, the multiplier `l = -J^-T a` at the stop makes the total vanish, so the second,
    /// shorter sweep from the stop accounts for re-aiming, and `-l.p` is the wish for the radius.
    pub fn pull_back(
        &self,
        sequence: &Sequence,
        quadrature: &Quadrature,
        cotangent: &BeamCotangent,
        gradient: &mut LensGradient,
    ) -> f64 {
        let nodes = quadrature.len();
        let order = first_order(sequence);
        let pupil_area = launch_area(sequence, &order);
        let light: f64 = cotangent.weight.iter().zip(&self.weight).map(|(bar, w)| bar * w).sum();
        gradient.entrance_pupil -= 2.0 * light / sequence.entrance_pupil_mm;
        if let ObjectDistance::Finite(distance) = sequence.object {
            let by_position = 2.0 * light / (distance + order.entrance_pupil_at_mm);
            pull_back_entrance_pupil(sequence, by_position, gradient);
        }
        // Weights depend on the launch points through the Jacobian and the projection.
        let mut jacobian_bar = vec![0.0; nodes];
        for i in 0..nodes {
            let start = launch(sequence, self.field_rad, self.launch_mm[i]);
            jacobian_bar[i] = cotangent.weight[i] * quadrature.weights[i] / pupil_area
                * projection(&start).0
                * self.transmission[i];
        }
        let launch_bar = quadrature.flux.pull_back(&self.launch_mm, &jacobian_bar);

        let mut stop_radius_bar = 0.0;
        let mut path = Path::default();
        for (i, p) in quadrature.nodes.iter().enumerate() {
            if self.fate[i] == Fate::NotAimed {
                continue;
            }
            let start = launch(sequence, self.field_rad, self.launch_mm[i]);
            let (projection, projection_by) = projection(&start);
            retrace(sequence, start.ray, &mut path);
            // A ray without weight moves nothing, but its launch point still shapes the flux fit.
            let ray = if self.transmission[i] > 0.0 {
                RayCotangent {
                    image_x: cotangent.x[i],
                    image_y: cotangent.y[i],
                    transmission: cotangent.weight[i] * self.flux[i] * projection,
                }
            } else {
                RayCotangent::default()
            };
            let (mut at_bar, direction_bar) = pull_back(sequence, &path, ray, gradient);
            let projection_bar = cotangent.weight[i] * self.flux[i] * self.transmission[i];
            for axis in 0..2 {
                at_bar[axis] += launch_bar[i][axis] + projection_bar * projection_by[axis];
                for (d, by) in direction_bar.iter().zip(start.direction_by[axis]) {
                    at_bar[axis] += d * by;
                }
            }
            stop_radius_bar += re_aim(sequence, &path, self.stop_by_launch[i], at_bar, *p, gradient);
        }
        stop_radius_bar
    }
}

/// Accounts for the launch point following the lens; returns the cotangent of the stop radius.
fn re_aim(
    sequence: &Sequence,
    path: &Path,
    stop_by_launch: [[f64; 2]; 2],
    launch_bar: [f64; 2],
    pupil: [f64; 2],
    gradient: &mut LensGradient,
) -> f64 {
    if path.passages.len() <= sequence.stop {
        return 0.0;
    }
    let [[a, b], [c, d]] = stop_by_launch;
    let det = a * d - b * c;
    let l = [-(d * launch_bar[0] - c * launch_bar[1]) / det, -(a * launch_bar[1] - b * launch_bar[0]) / det];
    pull_back_from(sequence, path, sequence.stop, l, gradient);
    -(l[0] * pupil[0] + l[1] * pupil[1])
}

/// The ray of a field through the centre of the stop.
#[derive(Clone, Debug)]
pub struct ChiefRay {
    /// Its path.
    pub path: Path,
    /// Height on the image plane, mm.
    pub y_mm: f64,
    field_rad: f64,
    launch_mm: [f64; 2],
    stop_by_launch: [[f64; 2]; 2],
}

/// Traces the chief ray of a field; `None` if no ray passes the centre of the stop to the image.
pub fn chief_ray(sequence: &Sequence, field_rad: f64) -> Option<ChiefRay> {
    let order = first_order(sequence);
    let guess = paraxial_launch(&order, sequence, field_rad, [0.0, 0.0]);
    let aimed = aim_at_stop(sequence, field_rad, [0.0, 0.0], guess)?;
    let path = trace_ray(sequence, launch(sequence, field_rad, aimed.launch_mm).ray);
    let y_mm = path.image?.position[1];
    Some(ChiefRay { path, y_mm, field_rad, launch_mm: aimed.launch_mm, stop_by_launch: aimed.stop_by_launch })
}

/// The field whose chief ray lands at `y_mm` on the image plane, rad: by the secant method from the ideal field
/// `guess_rad`, with the distortion that the lens has. `None` if there is no such ray.
pub fn field_imaged_at(sequence: &Sequence, y_mm: f64, guess_rad: f64) -> Option<f64> {
    const STEPS: usize = 30;
    let miss = |field: f64| Some(chief_ray(sequence, field)?.y_mm - y_mm);
    let (mut before, mut at) = (0.98 * guess_rad, guess_rad);
    let (mut miss_before, mut miss_at) = (miss(before)?, miss(at)?);
    for _ in 0..STEPS {
        if miss_at.abs() < 1e-10 || miss_at == miss_before {
            return (miss_at.abs() < 1e-6).then_some(at);
        }
        let next = at - miss_at * (at - before) / (miss_at - miss_before);
        (before, miss_before) = (at, miss_at);
        (at, miss_at) = (next, miss(next)?);
    }
    None
}

/// Adds the gradient of a loss that depends on the chief ray's height, `y_bar` per mm.
pub fn pull_back_chief(sequence: &Sequence, chief: &ChiefRay, y_bar: f64, gradient: &mut LensGradient) {
    let wish = RayCotangent { image_y: y_bar, ..RayCotangent::default() };
    let (mut at_bar, direction_bar) = pull_back(sequence, &chief.path, wish, gradient);
    let start = launch(sequence, chief.field_rad, chief.launch_mm);
    for axis in 0..2 {
        for (d, by) in direction_bar.iter().zip(start.direction_by[axis]) {
            at_bar[axis] += d * by;
        }
    }
    re_aim(sequence, &chief.path, chief.stop_by_launch, at_bar, [0.0, 0.0], gradient);
}
