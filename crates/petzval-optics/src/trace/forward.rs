//! The readable reference: traces one ray through the lens and records every crossing.

use super::fate::Fate;
use super::ray::Ray;
use super::sequence::Sequence;
use super::soft_edge::aperture_transmission;
use super::surface_step::{Passage, pass};
use crate::vector::along;

/// The path of one ray.
#[derive(Clone, Debug, Default)]
pub struct Path {
    /// The crossing of each surface that it met.
    pub passages: Vec<Passage>,
    /// The ray on the image plane (z = 0 there), if it reaches it.
    pub image: Option<Ray>,
    /// Its fate.
    pub fate: Fate,
    /// Share of light that the clear apertures let through, 0..1.
    pub transmission: f64,
    /// Optical path from the launch point to the image plane, mm.
    pub optical_path_mm: f64,
}

/// Traces one ray, given in the coordinates of the first vertex, to the image plane.
///
/// Points and directions of the passages are in the coordinates of each surface; directions are those of lines, with a
/// positive z component (see [`SurfaceAtWavelength`](super::SurfaceAtWavelength)).
pub fn trace_ray(sequence: &Sequence, start: Ray) -> Path {
    let mut path = Path { transmission: 1.0, ..Path::default() };
    path.passages.reserve_exact(sequence.surfaces.len());
    let mut ray = start;
    for (i, surface) in sequence.surfaces.iter().enumerate() {
        // Intersect the surface, and refract, reflect or diffract there.
        let passage = match pass(surface, i, &surface.enter(ray)) {
            Ok(passage) => passage,
            Err(fate) => {
                path.fate = fate;
                path.transmission = 0.0;
                return path;
            }
        };
        let [x, y, _] = passage.point;
        path.optical_path_mm += surface.n_before * passage.path_mm + surface.added_path_mm([x, y]);
        // Multiply by the transmission of the clear aperture. The stop does not clip: rays are aimed inside it.
        if i != sequence.stop {
            let radius = x.hypot(y);
            let (transmission, _) = aperture_transmission(radius, surface.semi_diameter_mm);
            path.transmission *= transmission;
            if transmission == 0.0 && path.fate == Fate::Ok {
                path.fate = Fate::Clipped(i);
            }
        }
        path.passages.push(passage);
        ray = surface.leave(Ray { position: passage.point, direction: passage.direction_after });
    }
    // Reach the image plane.
    let to_image = -ray.position[2] / ray.direction[2];
    let n_image = sequence.surfaces.last().map_or(1.0, |s| s.n_after);
    path.optical_path_mm += n_image * to_image;
    path.image = Some(Ray { position: along(ray.position, to_image, ray.direction), ..ray });
    path
}
