//! The cone of light on the axis, by real rays: numerical aperture, working f-number, resolution.
//!
//! Where no beam of a lens is near the axis, it is that of the field nearest to it, see [`Lens::reference_field_deg`].

use std::f64::consts::{PI, TAU};

use crate::lens::Lens;
use crate::paraxial::{FirstOrder, first_order};
use crate::pupil::{aim_one, paraxial_launch};
use crate::seidel::marginal_and_chief;
use crate::trace::{Sequence, launch, trace_ray};
use crate::vector::{Vec3, along, dot};

/// Rays along the rim of the stop.
const RIM: usize = 16;

/// Share of the pupil at which rays say whether light leaves parallel: spherical aberration has a billionth of its angle there.
const NEAR_AXIS: f64 = 1e-3;

/// Paraxial f-number beyond which light counts as parallel if its image is far, see [`FAR_IN_APERTURES`].
const PARALLEL_F_NUMBER: f64 = 1e5;

/// Multiple of the semi-diameter of the last surface beyond which an image is far. A nearer one is an image, however narrow the cone to it.
const FAR_IN_APERTURES: f64 = 1e3;

/// Semi-diameter that is taken for smaller ones, mm: a lens that is as small as its beams says nothing of what is far.
const LEAST_APERTURE_MM: f64 = 1.0;

/// Angle between two such rays that leave parallel, rad.
const PARALLEL_RAD: f64 = 1e-7;

/// The cone of light that meets the image on the axis, or at [`Lens::reference_field_deg`], at the reference wavelength.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Numerical aperture `n' sin U` of the marginal rays; 0 of light that leaves the lens parallel.
    ///
    /// Of a cone that is not round, that of the round cone whose direction cosines fill the same area, which is the one with as much light.
    pub na: f64,
    /// Whether it is that of real rays through the rim of the stop; else of the paraxial marginal ray, because a real one is lost.
    pub is_real: bool,
}

impl Cone {
    /// The cone of a lens.
    pub fn of(lens: &Lens) -> Self {
        if leaves_parallel(lens) == [true; 2] {
            return Self { na: 0.0, is_real: false };
        }
        let sequence = lens.at_wavelength(lens.reference_um);
        match real_na(&sequence, lens.reference_field_deg().to_radians()) {
            Some(na) => Self { na, is_real: true },
            None => Self { na: paraxial_na(&sequence), is_real: false },
        }
    }

    /// Working f-number `1 / (2 NA)`; infinite of light that leaves the lens parallel.
    pub fn working_f_number(&self) -> f64 {
        0.5 / self.na
    }

    /// Frequency beyond which nothing is resolved on the axis, cycles/mm: `2 NA / wavelength`.
    pub fn cutoff_per_mm(&self, wavelength_um: f64) -> f64 {
        2e3 * self.na / wavelength_um
    }

    /// Radius of the first dark ring of a perfect image, um: `0.61 wavelength / NA`.
    pub fn airy_radius_um(&self, wavelength_um: f64) -> f64 {
        1.219_67 * wavelength_um * self.working_f_number()
    }
}

/// Distance from the last vertex to the paraxial image of the y-z section at the reference wavelength, mm. `None` if light leaves that section
/// parallel: the image is at infinity, or far behind the lens with a cone slower than f/100000, as with an object 1 um from the front focus.
pub fn paraxial_image_mm(lens: &Lens) -> Option<f64> {
    let sequence = lens.at_wavelength(lens.reference_um);
    image_within_reach_mm(lens, &sequence, &first_order(&sequence))
}

/// [`paraxial_image_mm`] of a lens at one wavelength.
fn image_within_reach_mm(lens: &Lens, sequence: &Sequence, order: &FirstOrder) -> Option<f64> {
    let na = paraxial_na(sequence);
    // An aperture of exactly 0 comes from a pupil at infinity, and says nothing of the image.
    let is_narrow = na > 0.0 && na < 0.5 / PARALLEL_F_NUMBER;
    let aperture_mm = lens.surfaces.last().map_or(0.0, |surface| surface.semi_diameter_mm);
    let is_far = |mm: f64| mm.abs() > FAR_IN_APERTURES * aperture_mm.max(LEAST_APERTURE_MM);
    Some(order.image_distance_mm).filter(|mm| mm.is_finite() && !(is_narrow && is_far(*mm)))
}

/// Whether light of the axis leaves a lens parallel in the x-z and in the y-z section, at the reference wavelength.
///
/// Where the y-z section has a paraxial image ([`paraxial_image_mm`]), it does not. Elsewhere real rays decide, a thousandth of the pupil on either side
/// of its middle: the paraxial ray sees neither the power of a cylinder in x nor the slope of an axicon. A section whose rays are lost counts as
/// parallel.
pub fn leaves_parallel(lens: &Lens) -> [bool; 2] {
    let sequence = lens.at_wavelength(lens.reference_um);
    let order = first_order(&sequence);
    if image_within_reach_mm(lens, &sequence, &order).is_some() {
        return [false; 2];
    }
    let direction = |p: [f64; 2]| {
        let at = paraxial_launch(&order, &sequence, 0.0, p);
        Some(trace_ray(&sequence, launch(&sequence, 0.0, at).ray).image?.direction)
    };
    [[NEAR_AXIS, 0.0], [0.0, NEAR_AXIS]].map(|p| match (direction(p), direction(p.map(|v| -v))) {
        (Some(a), Some(b)) => {
            let between = along(a, -1.0, b);
            dot(between, between).sqrt() <= PARALLEL_RAD
        }
        _ => true,
    })
}

/// Numerical aperture of a field by rays through the rim of the stop; `None` if one of them is lost.
///
/// The rays cut the plane across the chief ray in a polygon of direction cosines. Inscribed in an ellipse at evenly spaced angles, it has
/// `sin(step) / step` of the ellipse's area.
fn real_na(sequence: &Sequence, field_rad: f64) -> Option<f64> {
    let stop_radius_mm = first_order(sequence).stop_radius_mm;
    let direction = |p: [f64; 2]| -> Option<Vec3> {
        let at = aim_one(sequence, field_rad, stop_radius_mm, p)?;
        Some(trace_ray(sequence, launch(sequence, field_rad, at).ray).image?.direction)
    };
    // Axes across the chief ray, from x and y in turn; it is never near x, since lines have a positive z component.
    let chief = direction([0.0; 2])?;
    let across = |axis: Vec3| along(axis, -dot(axis, chief), chief);
    let x = across([1.0, 0.0, 0.0]);
    let x = x.map(|v| v / dot(x, x).sqrt());
    let y = [1, 2, 0].map(|i| chief[i] * x[(i + 1) % 3] - chief[(i + 1) % 3] * x[i]);
    let mut rim = Vec::with_capacity(RIM);
    for k in 0..RIM {
        let (sin, cos) = (TAU * k as f64 / RIM as f64).sin_cos();
        let d = direction([cos, sin])?;
        rim.push([dot(d, x), dot(d, y)]);
    }
    // The area of the polygon, then that of the cone.
    let pairs = rim.iter().zip(rim.iter().cycle().skip(1));
    let area: f64 = pairs.map(|(a, b)| 0.5 * (a[0] * b[1] - a[1] * b[0])).sum();
    let step = TAU / RIM as f64;
    let na = index_behind(sequence) * (area.abs() * step / step.sin() / PI).sqrt();
    na.is_finite().then_some(na)
}

/// Numerical aperture of the paraxial marginal ray, whose slope is the tangent of its angle.
fn paraxial_na(sequence: &Sequence) -> f64 {
    let n = index_behind(sequence);
    let (marginal, _) = marginal_and_chief(sequence, 0.0);
    let slope = marginal.w.last().copied().unwrap_or(0.0) / n;
    n * slope.abs() / slope.hypot(1.0)
}

/// Index behind the last surface, without the sign of mirrors.
fn index_behind(sequence: &Sequence) -> f64 {
    sequence.surfaces.last().map_or(1.0, |s| s.n_after.abs())
}
