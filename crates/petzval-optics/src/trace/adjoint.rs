//! The adjoint of tracing: what a change of the loss at the image asks of every surface.
//!
//! Cotangents (written with a bar in the comments) travel against the light. At a surface with
//! gradient `N = (-z_x, -z_y, 1)`, unit normal `n`, entry point `p`, path `t` and point `q`:
//!
//! - refraction: `d' = mu d + b n` with `b = root - mu cos`, differentiated as it stands;
//! - meeting: `q = p + t d` with `N.dq = z_theta dtheta`, so `alpha = qbar.d / N.d` gives
//!   `pbar = qbar - alpha N`, `dbar += t pbar`, `thetabar += alpha z_theta`.

use super::forward::Path;
use super::ray::{Vec3, along, dot};
use super::sequence::Sequence;
use super::surface_step::{aperture_transmission, unit_normal};
use crate::gradient::LensGradient;

/// What the loss asks of one ray.
#[derive(Clone, Copy, Debug, Default)]
pub struct RayCotangent {
    /// By its x on the image plane, 1/mm.
    pub image_x: f64,
    /// By its y on the image plane, 1/mm.
    pub image_y: f64,
    /// By its transmission.
    pub transmission: f64,
}

/// Pulls a cotangent at the image back through the whole path; adds to `gradient`, and returns the
/// cotangents of the launch position (x, y on the first vertex plane) and of the launch direction.
pub fn pull_back(
    sequence: &Sequence,
    path: &Path,
    cotangent: RayCotangent,
    gradient: &mut LensGradient,
) -> ([f64; 2], Vec3) {
    let (Some(last), Some(image)) = (path.passages.last(), path.image) else {
        return ([0.0; 2], [0.0; 3]);
    };
    let end = path.passages.len() - 1;
    // Image plane: x = p_x + s d_x, s = -p_z / d_z, with p the point in image coordinates.
    let d = last.direction_after;
    let thickness = sequence.surfaces[end].thickness_mm;
    let s = (image.position[0] - last.point[0], image.position[1] - last.point[1]);
    let run = (thickness - last.point[2]) / d[2];
    debug_assert!((s.0 - run * d[0]).abs() < 1e-6 && (s.1 - run * d[1]).abs() < 1e-6);
    let (gx, gy) = (cotangent.image_x, cotangent.image_y);
    let by_run = gx * d[0] + gy * d[1];
    let point = [gx, gy, -by_run / d[2]];
    let direction = [run * gx, run * gy, -by_run * run / d[2]];
    gradient.surfaces[end].thickness += by_run / d[2];
    sweep(sequence, path, end, point, direction, cotangent.transmission, gradient)
}

/// Pulls a cotangent of the point where the ray meets surface `at` back to the launch.
pub(crate) fn pull_back_from(
    sequence: &Sequence,
    path: &Path,
    at: usize,
    point_xy: [f64; 2],
    gradient: &mut LensGradient,
) -> ([f64; 2], Vec3) {
    sweep(sequence, path, at, [point_xy[0], point_xy[1], 0.0], [0.0; 3], 0.0, gradient)
}

/// The backward sweep from surface `from`, given cotangents of the point on it and of the direction
/// behind it.
fn sweep(
    sequence: &Sequence,
    path: &Path,
    from: usize,
    mut point_bar: Vec3,
    mut direction_bar: Vec3,
    transmission_bar: f64,
    gradient: &mut LensGradient,
) -> ([f64; 2], Vec3) {
    for i in (0..=from).rev() {
        let (surface, p) = (&sequence.surfaces[i], &path.passages[i]);
        let [x, y, _] = p.point;
        let u = x * x + y * y;
        let d = p.direction_before;

        // The clear aperture: transmission falls with the radius at which the ray passes.
        if transmission_bar != 0.0 && i != sequence.stop {
            let radius = u.sqrt();
            let (transmission, slope) = aperture_transmission(radius, surface.semi_diameter_mm);
            if slope != 0.0 && transmission > 0.0 {
                let g = transmission_bar * path.transmission / transmission * slope;
                point_bar[0] += g * x / radius;
                point_bar[1] += g * y / radius;
                gradient.surfaces[i].semi_diameter -= g;
            }
        }

        // Refraction.
        let (normal, length) = unit_normal(p.slope);
        let mu = surface.n_before / surface.n_after;
        let cos = dot(normal, d);
        let root = (1.0 - mu * mu * (1.0 - cos * cos)).sqrt();
        let bend = root - mu * cos;
        let bend_bar = dot(direction_bar, normal);
        let mu_bar = dot(direction_bar, d) - bend_bar * (mu * (1.0 - cos * cos) / root + cos);
        let cos_bar = bend_bar * (mu * mu * cos / root - mu);
        let normal_bar = along(direction_bar.map(|v| bend * v), cos_bar, d);
        let mut d_bar = along(direction_bar.map(|v| mu * v), cos_bar, normal);
        gradient.surfaces[i].index -= mu_bar * mu / surface.n_after;
        if i > 0 {
            gradient.surfaces[i - 1].index += mu_bar / surface.n_after;
        }

        // The normal turns with the slopes z_x = 2 x z'(u), z_y = 2 y z'(u).
        let turn = along(normal_bar, -dot(normal, normal_bar), normal).map(|v| v / length);
        let (slope_x_bar, slope_y_bar) = (-turn[0], -turn[1]);
        if let Some(jet) = surface.shape.jet(u) {
            let cross = 4.0 * x * y * jet.second;
            point_bar[0] += slope_x_bar * (2.0 * jet.first + 4.0 * x * x * jet.second) + slope_y_bar * cross;
            point_bar[1] += slope_y_bar * (2.0 * jet.first + 4.0 * y * y * jet.second) + slope_x_bar * cross;
        }

        // Meeting the surface.
        let normal_raw = [-p.slope[0], -p.slope[1], 1.0];
        let alpha = dot(point_bar, d) / dot(normal_raw, d);
        let entry_bar = along(point_bar, -alpha, normal_raw);
        d_bar = along(d_bar, p.path_mm, entry_bar);

        // The surface's own numbers enter by its sag (alpha) and by its slope.
        let first_bar = 2.0 * (slope_x_bar * x + slope_y_bar * y);
        let ((z_c, z_k), (first_c, first_k)) = surface.shape.conic_sensitivity(u);
        let g = &mut gradient.surfaces[i];
        g.curvature += alpha * z_c + first_bar * first_c;
        g.conic += alpha * z_k + first_bar * first_k;
        let mut power = 1.0;
        for (j, a) in g.asphere.iter_mut().enumerate() {
            *a += alpha * power * u + first_bar * (j + 1) as f64 * power;
            power *= u;
        }

        // Back to the vertex before: p = q_previous - (0, 0, thickness).
        if i > 0 {
            gradient.surfaces[i - 1].thickness -= entry_bar[2];
        }
        point_bar = entry_bar;
        direction_bar = d_bar;
    }
    ([point_bar[0], point_bar[1]], direction_bar)
}
