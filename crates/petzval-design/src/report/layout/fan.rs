//! Fans: the rays of a field in the plane of the drawing, from before the lens to the image.

use petzval_optics::lens::Lens;
use petzval_optics::paraxial::first_order;
use petzval_optics::pupil::paraxial_launch;
use petzval_optics::trace::{Fate, Path, Sequence, aim_at_stop, launch, trace_ray};

/// A ray as a line in the drawing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FanRay {
    /// Corners of the line, (z, y) in mm from the first vertex.
    pub points: Vec<[f64; 2]>,
    /// Whether it got lost on the way.
    pub is_lost: bool,
}

/// The rays of a field at the lens's reference wavelength, evenly spread over the stop's diameter and
/// aimed at it by real tracing. They start `lead_mm` in front of the first vertex; a clipped ray ends
/// where it is clipped. A ray that cannot be aimed is left out.
pub(super) fn fan(lens: &Lens, field_rad: f64, rays: usize, lead_mm: f64) -> Vec<FanRay> {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    let last = rays.max(2) - 1;
    let mut previous = None;
    (0..=last)
        .filter_map(|i| {
            let pupil = 2.0 * i as f64 / last as f64 - 1.0;
            let target = [0.0, pupil * order.stop_radius_mm];
            // Guess from first order; a strongly bent pupil is entered from the neighbouring ray.
            let aimed = [Some(paraxial_launch(&order, &sequence, field_rad, [0.0, pupil])), previous]
                .into_iter()
                .flatten()
                .find_map(|guess| aim_at_stop(&sequence, field_rad, target, guess))?;
            previous = Some(aimed.launch_mm);
            Some(draw(&sequence, field_rad, aimed.launch_mm, lead_mm))
        })
        .collect()
}

/// Traces a ray and joins the points where it meets the surfaces.
fn draw(sequence: &Sequence, field_rad: f64, launch_mm: [f64; 2], lead_mm: f64) -> FanRay {
    let start = launch(sequence, field_rad, launch_mm).ray;
    let path = trace_ray(sequence, start);
    let slope = start.direction[1] / start.direction[2];
    let mut points = vec![[-lead_mm, start.position[1] - lead_mm * slope]];
    let mut vertex = 0.0;
    for (surface, passage) in sequence.surfaces.iter().zip(&path.passages).take(survived(&path)) {
        points.push([vertex + passage.point[2], passage.point[1]]);
        vertex += surface.thickness_mm;
    }
    if let (Fate::Ok, Some(image)) = (path.fate, path.image) {
        points.push([vertex, image.position[1]]);
    }
    FanRay { points, is_lost: path.fate != Fate::Ok }
}

/// How many surfaces the ray meets before it is lost, the one that stops it included.
fn survived(path: &Path) -> usize {
    match path.fate {
        Fate::Clipped(surface) => surface + 1,
        _ => path.passages.len(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::sample::triplet;
    use super::*;

    #[test]
    fn the_axial_fan_is_symmetric_and_meets_the_stop_evenly() {
        let lens = triplet();
        let rays = fan(&lens, 0.0, 9, 5.0);
        assert_eq!(rays.len(), 9);
        let order = first_order(&lens.at_wavelength(lens.reference_um));
        for (i, ray) in rays.iter().enumerate() {
            assert!(!ray.is_lost);
            assert_eq!(ray.points[0][0], -5.0);
            // One corner before the lens, then one per surface: the stop is the fifth of them.
            let wanted = order.stop_radius_mm * (i as f64 / 4.0 - 1.0);
            assert!((ray.points[5][1] - wanted).abs() < 1e-9);
            assert!((ray.points.last().unwrap()[0] - lens.total_track_mm()).abs() < 1e-9);
            for (p, q) in ray.points.iter().zip(&rays[8 - i].points) {
                assert!((p[1] + q[1]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_clipped_ray_ends_at_the_surface_that_stops_it() {
        let mut lens = triplet();
        lens.surfaces[6].semi_diameter_mm = 2.0;
        let rays = fan(&lens, 15_f64.to_radians(), 11, 5.0);
        let lost: Vec<_> = rays.iter().filter(|r| r.is_lost).collect();
        assert!(!lost.is_empty());
        assert!(lost.iter().all(|r| r.points.len() == 8));
    }
}
