//! Algebra before optimisation: focal length and focus are solved, not searched.

use crate::lens::{Action, Lens, ObjectDistance, Surface};
use crate::paraxial::{first_order, image_height_per_tangent, marginal_tangent};
use crate::pupil::Quadrature;
use crate::spot::mean_square_spot_traced;
use crate::trace::Sequence;

/// The lens with surface `surface`'s curvature solved so that the effective focal length at the reference
/// wavelength is `efl_mm`; `None` if that surface does not change it.
///
/// The final slope of a parallel ray is linear in any one curvature, so two traces give the solution.
pub fn with_efl(lens: &Lens, surface: usize, efl_mm: f64) -> Option<Lens> {
    with_curvature(lens, surface, -1.0 / efl_mm, |sequence| -1.0 / first_order(sequence).efl_mm)
}

/// The lens with surface `surface`'s curvature solved so that the paraxial magnification of its near object is `magnification`, negative
/// for an inverted image. The result is `None` if that surface does not change it, or the object is at infinity.
pub fn with_magnification(lens: &Lens, surface: usize, magnification: f64) -> Option<Lens> {
    let ObjectDistance::Finite(distance_mm) = lens.object else { return None };
    // The final slope of a ray from the object's foot.
    let slope = |sequence: &Sequence| -distance_mm / image_height_per_tangent(sequence);
    with_curvature(lens, surface, 1.0 / magnification, slope)
}

/// The paraxial magnification of a near object at the reference wavelength, negative for an inverted image; `None` for an object at infinity, or
/// whose image is there.
pub fn magnification(lens: &Lens) -> Option<f64> {
    let ObjectDistance::Finite(distance_mm) = lens.object else { return None };
    let found = -image_height_per_tangent(&lens.at_wavelength(lens.reference_um)) / distance_mm;
    Some(found).filter(|m| m.is_finite() && *m != 0.0)
}

/// The lens with a curvature for which a slope, linear in it, is as wanted.
fn with_curvature(
    lens: &Lens,
    surface: usize,
    wanted: f64,
    slope: impl Fn(&Sequence) -> f64,
) -> Option<Lens> {
    let mut solved = lens.clone();
    let mut slope_with = |curvature: f64| {
        solved.surfaces[surface].shape.curvature = curvature;
        slope(&solved.at_wavelength(solved.reference_um))
    };
    // Trial curvatures of the usual size keep the subtraction accurate.
    let (a, b) = (-0.1, 0.1);
    let (at_a, at_b) = (slope_with(a), slope_with(b));
    let curvature = a + (b - a) * (wanted - at_a) / (at_b - at_a);
    solved.surfaces[surface].shape.curvature = curvature;
    curvature.is_finite().then_some(solved)
}

/// The lens with the entrance pupil that the marginal ray of a near object needs for the tangent of its angle; unchanged for an object at infinity.
///
/// The tangent's sign does not count: it changes where the pupil goes through infinity, as that of a telecentric lens may, and the cone stays.
pub fn with_marginal_tangent(lens: &Lens, tangent: f64) -> Lens {
    let found = marginal_tangent(&lens.at_wavelength(lens.reference_um));
    let factor = found.map_or(1.0, |found| (tangent / found).abs());
    Lens { entrance_pupil_mm: factor * lens.entrance_pupil_mm, ..lens.clone() }
}

/// The lens with a thickness solved for the distance from the first vertex to the last, mm.
pub fn with_length(lens: &Lens, surface: usize, length_mm: f64) -> Lens {
    let mut solved = lens.clone();
    let vertices = lens.total_track_mm() - lens.image_distance_mm();
    solved.surfaces[surface].thickness_mm += length_mm - vertices;
    solved
}

/// The lens with its image plane at the paraxial image of the reference wavelength, `defocus_mm` further.
pub fn with_paraxial_focus(lens: &Lens, defocus_mm: f64) -> Lens {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    lens.with_image_distance(order.image_distance_mm + defocus_mm)
}

/// The thin lens without aberrations of the same focal length and entrance pupil, focused on the same object: the best that any lens
/// of this f-number could be.
pub fn thin_equivalent(lens: &Lens) -> Lens {
    let efl_mm = first_order(&lens.at_wavelength(lens.reference_um)).efl_mm;
    let surface = Surface {
        action: Action::ThinLens { power_per_mm: 1.0 / efl_mm },
        semi_diameter_mm: 0.5 * lens.entrance_pupil_mm,
        ..Surface::default()
    };
    let name = format!("{}, without aberrations", lens.name);
    with_paraxial_focus(&Lens { name, surfaces: vec![surface], stop: 0, ..lens.clone() }, 0.0)
}

/// The lens with its image plane where the mean squared RMS spot over `fields_rad` and all wavelengths is
/// least; `None` if some field brings no light.
///
/// Rays are straight behind the lens, so the mean is exactly quadratic in the image distance, and three values give its
/// minimum.
pub fn with_best_focus(lens: &Lens, fields_rad: &[f64], quadrature: &Quadrature) -> Option<Lens> {
    with_least(lens, |lens| Some(mean_square_spot_traced(lens, fields_rad, quadrature)?.0))
}

/// The same with the spot of each wavelength about its own centroid, so that how far the wavelengths lie apart does not count.
pub fn with_best_focus_of_colours(lens: &Lens, fields_rad: &[f64], quadrature: &Quadrature) -> Option<Lens> {
    with_least(lens, |lens| Some(mean_square_spots_of_colours(lens, fields_rad, quadrature)?.iter().sum()))
}

/// Mean over fields of the squared RMS spot radius of each wavelength about its own centroid, um^2; `None` if some field brings no light.
pub fn mean_square_spots_of_colours(
    lens: &Lens,
    fields_rad: &[f64],
    quadrature: &Quadrature,
) -> Option<Vec<f64>> {
    let of_colour = |um: &f64| {
        let one = Lens { wavelengths_um: vec![*um], ..lens.clone() };
        Some(mean_square_spot_traced(&one, fields_rad, quadrature)?.0)
    };
    lens.wavelengths_um.iter().map(of_colour).collect()
}

/// The lens with its image plane where a value that is quadratic in the image distance is least.
fn with_least(lens: &Lens, value: impl Fn(&Lens) -> Option<f64>) -> Option<Lens> {
    let step = 0.1;
    let at = lens.image_distance_mm();
    let value = |distance: f64| value(&lens.with_image_distance(distance));
    let (below, here, above) = (value(at - step)?, value(at)?, value(at + step)?);
    let curvature = below - 2.0 * here + above;
    Some(lens.with_image_distance(at - 0.5 * step * (above - below) / curvature))
}
