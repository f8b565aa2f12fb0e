//! RMS spot radii, and the gradient of their mean square.
//!
//! [`mean_square_spot`] integrates over the pupil by Gaussian quadrature with a few dozen rays. If a clear aperture
//! cuts the beam, it integrates densely over polynomials through these rays. [`mean_square_spot_traced`] is the
//! reference, with a traced ray for every pupil cell.

mod sampled;
mod traced;

pub(crate) use sampled::field_mean_square_sampled;
pub use sampled::{mean_square_spot, mean_square_spot_sampled};
pub use traced::mean_square_spot_traced;

use petzval_base::statistics::maximum;
use rayon::prelude::*;

use crate::gradient::LensGradient;
use crate::lens::Lens;
use crate::paraxial::first_order;
use crate::pupil::{
    Beam, ImageArea, PupilRefinement, Quadrature, Refined, Sides, chief_ray, paraxial_launch, refine,
    trace_beam,
};
use crate::trace::{Sequence, launch, trace_ray};

/// Spot radii of one field, um, about the centroid; rays are weighted by their light.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldSpot {
    /// Field angle, rad.
    pub field_rad: f64,
    /// About each wavelength's own centroid.
    pub rms_um: Vec<f64>,
    /// All wavelengths together, equally weighted, about their common centroid.
    pub rms_poly_um: f64,
    /// x of the common centroid on the image plane, mm; 0 in a lens that is symmetric about the plane of the fields.
    pub centroid_x_mm: f64,
    /// y of the common centroid on the image plane, mm.
    pub centroid_y_mm: f64,
    /// Illumination per wavelength: irradiance of the image of a uniform scene, over that of the paraxial entrance pupil. On the axis it is 1
    /// without vignetting and pupil aberration: rays fill the real stop, and spherical aberration of the pupil makes its image another in size.
    pub illumination: Vec<f64>,
}

impl FieldSpot {
    /// Illumination per wavelength relative to that of the spot on the axis.
    pub fn relative_illumination(&self, axis: &Self) -> Vec<f64> {
        self.illumination.iter().zip(&axis.illumination).map(|(here, on_axis)| here / on_axis).collect()
    }
}

/// RMS radius, um, below which a spot is taken for a point.
const PERFECT_UM: f64 = 1e-3;

/// [`spot`] on the coarsest pupil grid whose error is within the tolerance.
///
/// The error is that of the RMS radius of all wavelengths together or of the illumination of one, relative (radii below 1 nm count as
/// 1 nm: in them is little but rounding); see
/// [`PupilRefinement`]. `None` if no light arrives at some wavelength, or the first number of cells is not possible.
pub fn spot_converged(
    lens: &Lens,
    field_rad: f64,
    refinement: &PupilRefinement,
) -> Option<Refined<FieldSpot>> {
    let difference = |a: &FieldSpot, b: &FieldSpot| {
        let of_radius = (a.rms_poly_um - b.rms_poly_um).abs() / maximum(b.rms_poly_um, PERFECT_UM);
        let of_light = a.illumination.iter().zip(&b.illumination).map(|(a, b)| (a / b - 1.0).abs());
        of_light.fold(of_radius, maximum)
    };
    refine(refinement, |quadrature| spot(lens, field_rad, quadrature), difference)
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

/// Centroid of a beam, mm, including its mirror image if it is half a beam.
fn centroid(sequence: &Sequence, beam: &Beam) -> [f64; 2] {
    let light = beam.light();
    let mean = |of: &[f64]| of.iter().zip(&beam.weight).map(|(y, w)| y * w).sum::<f64>() / light;
    [if sequence.is_mirror_symmetric { 0.0 } else { mean(&beam.x_mm) }, mean(&beam.y_mm)]
}

/// Mean of points.
fn mean_of(points: &[[f64; 2]]) -> [f64; 2] {
    let count = points.len() as f64;
    [0, 1].map(|axis| points.iter().map(|p| p[axis]).sum::<f64>() / count)
}

/// Mean square distance of a beam from a point, weighted by light, mm^2.
fn mean_square(beam: &Beam, centre: [f64; 2]) -> f64 {
    let light = beam.light();
    (0..beam.y_mm.len())
        .map(|i| {
            let (x, y) = (beam.x_mm[i] - centre[0], beam.y_mm[i] - centre[1]);
            beam.weight[i] * (x * x + y * y)
        })
        .sum::<f64>()
        / light
}

/// Spot radii of a lens at a field; `None` if no light arrives at some wavelength.
pub fn spot(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Option<FieldSpot> {
    let traced = trace_field(lens, field_rad, quadrature);
    let reference = lens.at_wavelength(lens.reference_um);
    let area = ImageArea::new(&reference, field_rad, &chief_ray(&reference, field_rad)?)?;
    let illumination: Vec<f64> = traced.iter().map(|t| t.beam.light() * area.ratio).collect();
    if !illumination.iter().all(|i| *i > 0.0) {
        return None;
    }
    let centres: Vec<[f64; 2]> = traced.iter().map(|t| centroid(&t.sequence, &t.beam)).collect();
    let count = traced.len() as f64;
    let common = mean_of(&centres);
    let rms = |square_mm2: f64| 1e3 * square_mm2.sqrt();
    Some(FieldSpot {
        field_rad,
        rms_um: traced.iter().zip(&centres).map(|(t, c)| rms(mean_square(&t.beam, *c))).collect(),
        rms_poly_um: rms(traced.iter().map(|t| mean_square(&t.beam, common)).sum::<f64>() / count),
        centroid_x_mm: common[0],
        centroid_y_mm: common[1],
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

/// RMS spot radii over the evenly filled paraxial entrance pupil: the default of lens programs (no ray aiming) and of
/// published tables.
///
/// [`spot`] uses the beam through the real stop; off axis the two differ by the aberration of the pupil. `None` if no
/// light arrives.
pub fn spot_paraxial_pupil(lens: &Lens, field_rad: f64, quadrature: &Quadrature) -> Option<PrintedSpot> {
    let order = first_order(&lens.at_wavelength(lens.reference_um));
    // Trace the rays through the paraxial pupil: (x, y, share of the colour's light), colour by colour.
    let mut colours: Vec<Vec<[f64; 3]>> = Vec::new();
    for wavelength in &lens.wavelengths_um {
        let sequence = lens.at_wavelength(*wavelength);
        let (nodes, weights) = quadrature.on(Sides::of(&sequence));
        let mut rays: Vec<[f64; 3]> = Vec::with_capacity(nodes.len());
        for (node, weight) in nodes.iter().zip(&weights) {
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
    let is_half = lens.is_mirror_symmetric();
    let centroid = |rays: &[[f64; 3]]| {
        let mean = |axis: usize| rays.iter().map(|r| r[2] * r[axis]).sum::<f64>();
        [if is_half { 0.0 } else { mean(0) }, mean(1)]
    };
    let square = |rays: &[[f64; 3]], [x, y]: [f64; 2]| {
        rays.iter().map(|r| r[2] * ((r[0] - x) * (r[0] - x) + (r[1] - y).powi(2))).sum::<f64>()
    };
    let count = colours.len() as f64;
    let centres: Vec<[f64; 2]> = colours.iter().map(|rays| centroid(rays)).collect();
    let common = mean_of(&centres);
    let poly = colours.iter().map(|rays| square(rays, common)).sum::<f64>() / count;
    Some(PrintedSpot {
        rms_um: colours.iter().zip(&centres).map(|(rays, c)| 1e3 * square(rays, *c).sqrt()).collect(),
        rms_poly_um: 1e3 * poly.sqrt(),
    })
}

/// Mean of a value and its gradient over fields, in parallel; `None` if a field has none.
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
    gradient.keep_symmetry(&lens.at_wavelength(lens.reference_um));
    Some((value, gradient))
}
