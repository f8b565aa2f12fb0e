//! The readable reference of diffraction: adds spherical wavelets from a reference sphere at every point of the image.

use std::f64::consts::TAU;

use super::opd::ReferenceSphere;
use crate::paraxial::first_order;
use crate::pupil::{Quadrature, chief_ray, trace_beam};
use crate::trace::Sequence;

/// Energy per cell of a grid about the chief ray's image, row by row, of unit sum; `None` if rays through the stop are
/// lost.
///
/// A ray is traced for every node of the quadrature. A wavelet starts at its point on the reference sphere, which is
/// centred on the chief ray's image and goes through the exit pupil. Its phase is that of the ray's optical path; the
/// square of its amplitude is the ray's light per area of the sphere. The sum uses the true distance of every wavelet
/// to the point of the image. The cost is nodes times cells.
pub fn huygens_psf(
    sequence: &Sequence,
    field_rad: f64,
    quadrature: &Quadrature,
    cells: usize,
    pitch_um: f64,
) -> Option<Vec<f64>> {
    let chief = chief_ray(sequence, field_rad)?;
    let centre_mm = [chief.x_mm, chief.y_mm];
    let sphere = ReferenceSphere::through_exit_pupil(sequence, centre_mm);
    let stop_radius_mm = first_order(sequence).stop_radius_mm;
    let beam = trace_beam(sequence, field_rad, stop_radius_mm, quadrature);
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    let k = TAU / (1e-3 * sequence.wavelength_um);
    let r = sphere.radius_mm;

    // Compute the wavelet of each ray: its start relative to the centre, its optical path there, and its amplitude
    // times area.
    let areas = beam.solid_angles(sequence, |place, d| sphere.run(place, d).1)?;
    let paths = beam.optical_paths(sequence);
    let mut wavelets: Vec<([f64; 3], f64, f64)> = Vec::new();
    for i in 0..beam.x_mm.len() {
        if !(beam.weight[i] > 0.0 && areas[i].is_finite()) {
            continue;
        }
        let d = beam.direction(i);
        let (run, towards) = sphere.run([beam.x_mm[i], beam.y_mm[i]], d);
        let start = towards.map(|v| -r * v);
        // The ray's light is amplitude^2 x area, so amplitude x area = sqrt(light x area).
        let strength = (beam.weight[i] * areas[i]).sqrt();
        let path = paths[i] + n_image * run;
        wavelets.push((start, path, strength));
        if sequence.is_mirror_symmetric {
            let [x, y, z] = start;
            wavelets.push(([-x, y, z], path, strength));
        }
    }
    let path_origin = wavelets.first()?.1;
    // Add all wavelets at the middle of every cell.
    let half = 0.5 * (cells as f64 - 1.0);
    let mut values: Vec<f64> = (0..cells * cells)
        .map(|cell| {
            let [x, y] = [cell % cells, cell / cells].map(|g| (g as f64 - half) * 1e-3 * pitch_um);
            let (mut re, mut im) = (0.0, 0.0);
            for ([sx, sy, sz], path, strength) in &wavelets {
                // Distance from the start minus the radius, in a form without cancellation.
                let along = (x * x + y * y - 2.0 * (x * sx + y * sy))
                    / (r.abs() + ((x - sx).hypot(y - sy)).hypot(*sz));
                let (sin, cos) = (k * (path - path_origin + n_image * r.signum() * along)).sin_cos();
                re += strength * cos;
                im += strength * sin;
            }
            re * re + im * im
        })
        .collect();
    let total: f64 = values.iter().sum();
    values.iter_mut().for_each(|v| *v /= total);
    Some(values)
}
