//! RMS spot radii, and the gradient of their mean square.
//!
//! [`mean_square_spot`] integrates over the pupil by Gaussian quadrature through a few dozen rays; where a clear aperture
//! cuts the beam, densely over polynomials through them. [`mean_square_spot_traced`] is the reference, with a traced ray
//! for every pupil cell.

mod sampled;
mod traced;

pub use sampled::{mean_square_spot, mean_square_spot_sampled};
pub use traced::mean_square_spot_traced;

use rayon::prelude::*;

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::pupil::{Beam, Quadrature, paraxial_launch, trace_beam};
use crate::trace::{Sequence, launch, trace_ray};

/// Spot radii of one field, um, about the centroid (by the light of each ray).
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpot {
    /// Field angle, rad.
    pub field_rad: f64,
    /// About each wavelength's own centroid.
    pub rms_um: Vec<f64>,
    /// All wavelengths together, equally weighted, about their common centroid.
    pub rms_poly_um: f64,
    /// Common centroid on the image plane, mm.
    pub centroid_y_mm: f64,
    /// Relative illumination per wavelength.
    pub illumination: Vec<f64>,
}

struct Traced {
    sequence: Sequence,
    beam: Beam,
}

fn trace_field(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Vec<Traced> {
    let stop = first_order(&lens.at_wavelength(lens.reference_um)).stop_radius_mm;
    lens.wavelengths_um
        .iter()
        .map(|w| {
            let sequence = lens.at_wavelength(*w);
            let beam = trace_beam(&sequence, field_rad, stop, quadrature);
            Traced { sequence, beam }
        })
        .collect()
}

/// Centroid of a beam, mm.
fn mean_y(beam: &Beam) -> f64 {
    let light = beam.illumination();
    beam.y_mm.iter().zip(&beam.weight).map(|(y, w)| y * w).sum::<f64>() / light
}

/// Mean of x^2 + (y - centre)^2 over the light of a beam, mm^2.
fn mean_square(beam: &Beam, centre: f64) -> f64 {
    let light = beam.illumination();
    (0..beam.y_mm.len())
        .map(|i| {
            let (x, y) = (beam.x_mm[i], beam.y_mm[i] - centre);
            beam.weight[i] * (x * x + y * y)
        })
        .sum::<f64>()
        / light
}

/// Spot radii of a lens at a field; `None` if no light arrives at some wavelength.
pub fn spot(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Option<FieldSpot> {
    let traced = trace_field(lens, field_rad, quadrature);
    let illumination: Vec<f64> = traced.iter().map(|t| t.beam.illumination()).collect();
    if !illumination.iter().all(|i| *i > 0.0) {
        return None;
    }
    let centres: Vec<f64> = traced.iter().map(|t| mean_y(&t.beam)).collect();
    let count = traced.len() as f64;
    let centroid_y_mm = centres.iter().sum::<f64>() / count;
    let rms = |square_mm2: f64| 1e3 * square_mm2.max(0.0).sqrt();
    Some(FieldSpot {
        field_rad,
        rms_um: traced.iter().zip(&centres).map(|(t, c)| rms(mean_square(&t.beam, *c))).collect(),
        rms_poly_um: rms(traced.iter().map(|t| mean_square(&t.beam, centroid_y_mm)).sum::<f64>() / count),
        centroid_y_mm,
        illumination,
    })
}

/// RMS spot radii over the evenly filled *paraxial entrance pupil*, um.
#[derive(Clone, Debug, PartialEq)]
pub struct PrintedSpot {
    /// About each wavelength's own centroid.
    pub rms_um: Vec<f64>,
    /// All wavelengths together, equally weighted, about their common centroid.
    pub rms_poly_um: f64,
}

/// RMS spot radii over the evenly filled paraxial entrance pupil: what lens programs print by default (no ray
/// aiming), and published tables with them.
///
/// The beam that the real stop lets through is that of [`spot`]; off axis the two differ by the aberration
/// of the pupil. `None` if no light arrives.
pub fn spot_paraxial_pupil(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Option<PrintedSpot> {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    // (x, y, share of the colour's light) of every ray, colour by colour.
    let mut colours: Vec<Vec<[f64; 3]>> = Vec::new();
    for wavelength in &lens.wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        let mut rays: Vec<[f64; 3]> = Vec::with_capacity(quadrature.len());
        for (node, weight) in quadrature.nodes.iter().zip(&quadrature.weights) {
            let at = paraxial_launch(&order, &sequence, field_rad, *node);
            let path = trace_ray(&sequence, launch(&sequence, field_rad, at).ray);
            if let Some(image) = path.image {
                rays.push([image.position[0], image.position[1], weight * path.transmission]);
            }
        }
        let light: f64 = rays.iter().map(|r| r[2]).sum();
        if light <= 0.0 {
            return None;
        }
        rays.iter_mut().for_each(|r| r[2] /= light);
        colours.push(rays);
    }
    let mean_y = |rays: &[[f64; 3]]| rays.iter().map(|r| r[2] * r[1]).sum::<f64>();
    let square = |rays: &[[f64; 3]], centre: f64| {
        rays.iter().map(|r| r[2] * (r[0] * r[0] + (r[1] - centre).powi(2))).sum::<f64>()
    };
    let count = colours.len() as f64;
    let centre = colours.iter().map(|rays| mean_y(rays)).sum::<f64>() / count;
    let poly = colours.iter().map(|rays| square(rays, centre)).sum::<f64>() / count;
    Some(PrintedSpot {
        rms_um: colours.iter().map(|rays| 1e3 * square(rays, mean_y(rays)).sqrt()).collect(),
        rms_poly_um: 1e3 * poly.sqrt(),
    })
}

/// Mean of a value and its gradient over fields, in parallel; `None` if one of them has none.
fn mean_over_fields(
    lens: &Lens,
    fields_rad: &[f64],
    of_field: impl Fn(f64) -> Option<(f64, LensGradient)> + Sync,
) -> Option<(f64, LensGradient)> {
    let per_field: Vec<(f64, LensGradient)> =
        fields_rad.par_iter().map(|field| of_field(*field)).collect::<Option<_>>()?;
    // Sum in the order of the fields, so that the bits do not depend on the threads.
    let share = 1.0 / fields_rad.len() as f64;
    let mut gradient = LensGradient::zero(lens.surfaces.len());
    let mut value = 0.0;
    for (v, g) in per_field {
        value += share * v;
        gradient += &g.scaled(share);
    }
    Some((value, gradient))
}
