//! Optical path differences of rays against a reference sphere.

use crate::paraxial::first_order;
use crate::pupil::{aim_at_pupil, optical_paths, paraxial_launch};
use crate::trace::{RayBundle, Sequence, launch, trace};

/// A sphere about the image point, through the exit pupil.
#[derive(Clone, Copy, Debug)]
pub(super) struct ReferenceSphere {
    /// Its centre on the image plane, mm.
    pub centre_mm: [f64; 2],
    /// Its radius, with the sign of the distance from the exit pupil to the image along z, mm; may be infinite.
    pub radius_mm: f64,
}

impl ReferenceSphere {
    /// The sphere about a point of the image plane through the centre of the paraxial exit pupil.
    pub fn through_exit_pupil(sequence: &Sequence, centre_mm: [f64; 2]) -> Self {
        let order = first_order(sequence);
        let last = sequence.surfaces.last().map_or(0.0, |s| s.thickness_mm);
        let along_z = last - order.exit_pupil_at_mm;
        let across = centre_mm[0].hypot(centre_mm[1]);
        Self { centre_mm, radius_mm: along_z.signum() * along_z.hypot(across) }
    }

    /// Run of a ray from the image plane to the sphere along its direction, plus the radius, and the unit vector from
    /// there to the centre (as a line's direction).
    ///
    /// With `e` from the centre to the ray's point on the image plane and `b = e.d`, the run is `s = -b - sqrt(b^2 + R^2 - e^2)` (for R >
    /// 0). The form `s + R = -b + (e^2 - b^2) / (R + sqrt(...))` keeps its digits for any radius.
    pub fn run(&self, at_mm: [f64; 2], d: [f64; 3]) -> (f64, [f64; 3]) {
        let e = [at_mm[0] - self.centre_mm[0], at_mm[1] - self.centre_mm[1], 0.0];
        let b = e[0] * d[0] + e[1] * d[1];
        let r = self.radius_mm;
        if r.is_infinite() {
            return (-b, d);
        }
        let square = e[0] * e[0] + e[1] * e[1];
        let root = r.signum() * (b * b + r * r - square).sqrt();
        let beyond = -b + (square - b * b) / (r + root);
        let s = beyond - r;
        // The point on the sphere is e + s d from the centre.
        (beyond, [0, 1, 2].map(|k| -(e[k] + s * d[k]) / r))
    }
}

impl ReferenceSphere {
    /// Distance from a point of the sphere to the point `dz` behind its centre: the distance minus the radius, and the
    /// distance divided by the radius. `cosine` is the z component of the unit vector to the centre.
    ///
    /// From `R t` the way is `R t + dz z`, of length `R s` with `s^2 = 1 + 2 cosine dz/R + (dz/R)^2`.
    pub fn further(&self, cosine: f64, dz: f64) -> (f64, f64) {
        let share = dz / self.radius_mm;
        let scale = (1.0 + 2.0 * cosine * share + share * share).sqrt();
        (dz * (2.0 * cosine + share) / (1.0 + scale), scale)
    }

    /// The transpose of [`ReferenceSphere::run`]: cotangents of the position and of the direction, from those of the
    /// run and of the first two components of the unit vector.
    pub fn pull_back(
        &self,
        at_mm: [f64; 2],
        d: [f64; 3],
        run_bar: f64,
        towards_bar: [f64; 2],
    ) -> ([f64; 2], [f64; 2]) {
        let e = [at_mm[0] - self.centre_mm[0], at_mm[1] - self.centre_mm[1]];
        let b = e[0] * d[0] + e[1] * d[1];
        let r = self.radius_mm;
        if r.is_infinite() {
            // The run is -b, and the vector is the direction.
            return ([0, 1].map(|k| -run_bar * d[k]), [0, 1].map(|k| towards_bar[k] - run_bar * e[k]));
        }
        let root = r.signum() * (b * b + r * r - e[0] * e[0] - e[1] * e[1]).sqrt();
        let s = -b - root;
        // towards = -(e + s d) / r, s = -b - root.
        let s_bar = run_bar - (towards_bar[0] * d[0] + towards_bar[1] * d[1]) / r;
        let b_bar = -s_bar * (1.0 + b / root);
        let place = [0, 1].map(|k| b_bar * d[k] + s_bar * e[k] / root - towards_bar[k] / r);
        let direction = [0, 1].map(|k| b_bar * e[k] - towards_bar[k] * s / r);
        (place, direction)
    }

    /// Changes of the run and of the first two components of the unit vector, from those of the position relative to the
    /// centre and of the direction: the transpose of [`ReferenceSphere::pull_back`].
    pub fn push_forward(
        &self,
        at_mm: [f64; 2],
        d: [f64; 3],
        moved: [f64; 2],
        turned: [f64; 2],
    ) -> (f64, [f64; 2]) {
        let e = [at_mm[0] - self.centre_mm[0], at_mm[1] - self.centre_mm[1]];
        let b_change = moved[0] * d[0] + moved[1] * d[1] + e[0] * turned[0] + e[1] * turned[1];
        let r = self.radius_mm;
        if r.is_infinite() {
            return (-b_change, turned);
        }
        let b = e[0] * d[0] + e[1] * d[1];
        let root = r.signum() * (b * b + r * r - e[0] * e[0] - e[1] * e[1]).sqrt();
        let s = -b - root;
        let run = -b_change - (b * b_change - e[0] * moved[0] - e[1] * moved[1]) / root;
        (run, [0, 1].map(|k| -(moved[k] + run * d[k] + s * turned[k]) / r))
    }

    /// The same sphere with its radius rounded to two digits, so that small changes of a lens do not change it. The
    /// result hardly depends on the radius.
    pub fn rounded(self) -> Self {
        if !self.radius_mm.is_normal() {
            return self;
        }
        let unit = 10f64.powf(self.radius_mm.abs().log10().floor() - 1.0);
        Self { radius_mm: (self.radius_mm / unit).round() * unit, ..self }
    }
}

/// Optical path differences of a field at one wavelength.
#[derive(Clone, Debug)]
pub struct Opd {
    /// Optical path difference of each point of the pupil, waves: path of the chief ray to the reference sphere minus
    /// that of the ray. It is positive where the wavefront is ahead of the sphere, and `None` where the ray is lost.
    pub waves: Vec<Option<f64>>,
    /// Position of the ray through each point on the image plane, mm; `None` if it is lost.
    pub landing_mm: Vec<Option<[f64; 2]>>,
    /// Transmission of the clear apertures for each ray.
    pub transmission: Vec<f64>,
    /// Radius of the reference sphere, mm (signed, see `ReferenceSphere`).
    pub radius_mm: f64,
    /// Position of the chief ray on the image plane, mm.
    pub chief_mm: [f64; 2],
}

/// The surface on which points of the pupil lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PupilPlane {
    /// The real stop.
    Stop,
    /// The paraxial entrance pupil, as in lens programs without ray aiming.
    Paraxial,
}

/// Optical path differences of rays through points of the pupil (units of its radius) against the sphere about the chief ray's
/// image through the paraxial exit pupil.
///
/// `stop_radius_mm` is that of the reference wavelength. `None` if the chief ray is lost.
pub fn opd(
    sequence: &Sequence,
    field_rad: f64,
    stop_radius_mm: f64,
    points: &[[f64; 2]],
    plane: PupilPlane,
) -> Option<Opd> {
    opd_about(sequence, field_rad, stop_radius_mm, points, plane, None)
}

/// [`opd`] against the sphere about another point of the image plane, mm, such as the image of the chief ray of the reference
/// wavelength: lateral colour is then a tilt of the wavefront.
pub fn opd_about(
    sequence: &Sequence,
    field_rad: f64,
    stop_radius_mm: f64,
    points: &[[f64; 2]],
    plane: PupilPlane,
    centre_mm: Option<[f64; 2]>,
) -> Option<Opd> {
    let mut all = vec![[0.0; 2]];
    all.extend_from_slice(points);
    let (launches, mut rays) = match plane {
        PupilPlane::Stop => {
            let aimed = aim_at_pupil(sequence, field_rad, stop_radius_mm, &all, None);
            let launches: Vec<[f64; 2]> = (0..all.len()).map(|i| aimed.launch_of(i)).collect();
            (launches, aimed.bundle(sequence))
        }
        PupilPlane::Paraxial => {
            let order = first_order(sequence);
            let launches: Vec<[f64; 2]> =
                all.iter().map(|p| paraxial_launch(&order, sequence, field_rad, *p)).collect();
            let mut rays = RayBundle::new(all.len());
            for (i, at) in launches.iter().enumerate() {
                rays.set(i, launch(sequence, field_rad, *at).ray);
            }
            (launches, rays)
        }
    };
    trace(sequence, &mut rays);
    if !rays.fate(0).reaches_image() {
        return None;
    }
    let paths = optical_paths(sequence, field_rad, |i| launches[i], &rays);
    let [x, y, _] = rays.ray(0).position;
    let sphere = ReferenceSphere::through_exit_pupil(sequence, centre_mm.unwrap_or([x, y]));
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    let to_sphere = |i: usize| {
        let ray = rays.ray(i);
        let (run, _) = sphere.run([ray.position[0], ray.position[1]], ray.direction);
        paths[i] + n_image * run
    };
    let chief = to_sphere(0);
    let of_points = 1..all.len();
    let waves = of_points.clone().map(|i| {
        rays.fate(i).reaches_image().then(|| (chief - to_sphere(i)) / (1e-3 * sequence.wavelength_um))
    });
    let landing = of_points.clone().map(|i| {
        let [x, y, _] = rays.ray(i).position;
        rays.fate(i).reaches_image().then_some([x, y])
    });
    Some(Opd {
        waves: waves.collect(),
        landing_mm: landing.collect(),
        transmission: of_points.map(|i| rays.transmission(i)).collect(),
        radius_mm: sphere.radius_mm,
        chief_mm: [x, y],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_of_runs_are_the_transpose_and_the_differences() {
        let (at, d) = ([0.7, -0.4], [0.1, 0.3, f64::sqrt(0.9)]);
        let (moved, turned) = ([0.2, 0.5], [-0.3, 0.4]);
        for radius_mm in [30.0, -30.0, f64::INFINITY, f64::NEG_INFINITY] {
            let sphere = ReferenceSphere { centre_mm: [0.5, 0.1], radius_mm };
            let (run, towards) = sphere.push_forward(at, d, moved, turned);
            // The transpose, for some cotangents.
            let (place_bar, direction_bar) = sphere.pull_back(at, d, 0.9, [1.3, -0.8]);
            let left = 0.9 * run + 1.3 * towards[0] - 0.8 * towards[1];
            let right: f64 = (0..2).map(|k| place_bar[k] * moved[k] + direction_bar[k] * turned[k]).sum();
            assert!((left - right).abs() < 1e-14, "{radius_mm}: {left} {right}");
            // Central differences; the third component of the direction is held.
            let h = 1e-6;
            let step = |h: f64| {
                let at = [0, 1].map(|k| at[k] + h * moved[k]);
                sphere.run(at, [d[0] + h * turned[0], d[1] + h * turned[1], d[2]])
            };
            let ((run_plus, plus), (run_minus, minus)) = (step(h), step(-h));
            assert!(((run_plus - run_minus) / (2.0 * h) - run).abs() < 1e-8, "{radius_mm}");
            for k in 0..2 {
                assert!(((plus[k] - minus[k]) / (2.0 * h) - towards[k]).abs() < 1e-8, "{radius_mm}");
            }
        }
    }
}
